//! What NRRD and MetaImage share: a header of text lines, then voxels in one of several encodings, in the same file
//! or in others that the header names.

mod files;
mod inflate;
mod lines;
mod text;

pub(super) use files::numbered;
pub(super) use lines::Lines;

use std::path::{Path, PathBuf};

use inflate::{GzipBody, ZlibBody};
use text::{HexBody, TextSlices};

use super::several::{OneOf, Several};
use super::slices::{self, SliceSource};
use super::stream::{self, StreamSlices, check_length, stored_bytes};
use super::volume::{Volume, VolumeHeader};
use crate::input::{self, Input, SkipRead, Source, read_fault};
use crate::limits::Budget;
use crate::{Fault, ReadLimits};

/// A content, standing somewhere in it.
pub(super) struct Content<'a> {
    pub source: Box<dyn SkipRead + 'a>,
    /// Bytes left, at most; `None` for a pipe.
    pub bound: Option<u64>,
    /// Whether `bound` is the number of bytes left.
    pub is_exact: bool,
}

impl<'a> Content<'a> {
    pub fn of_bytes(bytes: &'a [u8]) -> Self {
        Self {
            bound: Some(bytes.len() as u64),
            is_exact: true,
            source: Box::new(bytes),
        }
    }

    fn skip(&mut self, count: u64) -> Result<(), Fault> {
        stream::skip(&mut *self.source, count)?;
        self.bound = self.bound.map(|b| b.saturating_sub(count));
        Ok(())
    }
}

impl From<Input> for Content<'static> {
    fn from(input: Input) -> Self {
        Self {
            bound: input.length_bound,
            is_exact: matches!(input.source, Source::Plain(_)),
            source: Box::new(input.source),
        }
    }
}

/// How voxels are written down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Raw,
    Gzip,
    /// A zlib stream, or gzip where the magic says so.
    Zlib,
    Text,
    Hex,
}

/// Where the voxels start in each file that has some.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Start {
    /// After so many bytes (of the inflated content).
    After(u64),
    /// So that they end with the file.
    AtTheEnd,
}

/// How to get from the bytes of a file to voxels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    pub encoding: Encoding,
    pub big_endian: bool,
    /// Lines passed over first, before anything is inflated.
    pub skip_lines: u64,
    pub start: Start,
}

/// A header and where its voxels are.
pub(super) struct Parsed {
    /// Of the volume that is read.
    pub header: VolumeHeader,
    /// Which of those in the file, if there are several.
    pub several: Option<Several>,
    pub notes: Vec<String>,
    pub layout: Layout,
    /// Data files; `None`: the voxels follow the header.
    pub files: Option<Vec<PathBuf>>,
}

/// Reads a header: of a content, of the file it is in if any; and which of several volumes is wanted.
pub(super) type ReadHeader =
    fn(&mut Content<'_>, Option<&Path>, Option<usize>, &mut Budget) -> Result<Parsed, Fault>;

/// Opens a header, and the voxels behind it or those it names; of several volumes number `volume`.
pub(super) fn open(
    path: &Path,
    read: ReadHeader,
    volume: Option<usize>,
    budget: &mut Budget,
) -> Result<Box<dyn SliceSource>, Fault> {
    voxels_behind(input::open(path)?.into(), Some(path), read, volume, budget)
}

/// Reads a header and the voxels that follow it.
pub(super) fn parse(bytes: &[u8], read: ReadHeader, limits: &ReadLimits) -> Result<Volume, Fault> {
    let mut budget = Budget::new(limits);
    let mut source = voxels_behind(Content::of_bytes(bytes), None, read, None, &mut budget)?;
    slices::read(&mut *source, &mut budget)
}

fn voxels_behind<'a>(
    mut content: Content<'a>,
    path: Option<&Path>,
    read: ReadHeader,
    volume: Option<usize>,
    budget: &mut Budget,
) -> Result<Box<dyn SliceSource + 'a>, Fault> {
    let parsed = read(&mut content, path, volume, budget)?;
    let whole = match &parsed.several {
        Some(several) => several.file_header(&parsed.header)?,
        None => parsed.header.clone(),
    };
    let inner = match parsed.files {
        None => attached(whole, parsed.notes, parsed.layout, content),
        Some(paths) => in_files(whole, parsed.notes, parsed.layout, paths),
    }?;
    Ok(match parsed.several {
        Some(several) => Box::new(OneOf::new(inner, parsed.header, several)),
        None => inner,
    })
}

/// Voxels that follow their header.
fn attached<'a>(
    header: VolumeHeader,
    notes: Vec<String>,
    layout: Layout,
    content: Content<'a>,
) -> Result<Box<dyn SliceSource + 'a>, Fault> {
    let needed = stored_bytes(&header);
    let content = decoded(&header, layout, content, needed)?;
    Ok(voxels(header, notes, layout, content))
}

/// Voxels in files of their own, each with as many as the others.
fn in_files(
    header: VolumeHeader,
    notes: Vec<String>,
    layout: Layout,
    paths: Vec<PathBuf>,
) -> Result<Box<dyn SliceSource>, Fault> {
    let parts = paths.len() as u64;
    let values = header.voxel_count() as u64;
    if !values.is_multiple_of(parts) {
        return Err(Fault::Value {
            what: "the number of data files",
            value: format!("{parts} for {values} voxels"),
            remedy: "each file holds as many voxels as the others; correct the list in the header",
        });
    }
    let content = match <[_; 1]>::try_from(paths) {
        Ok([path]) => files::open_share(&header, layout, &path, stored_bytes(&header))?,
        Err(paths) => files::chain(&header, layout, paths)?,
    };
    Ok(voxels(header, notes, layout, content))
}

fn voxels<'a>(
    header: VolumeHeader,
    notes: Vec<String>,
    layout: Layout,
    content: Content<'a>,
) -> Box<dyn SliceSource + 'a> {
    match layout.encoding {
        Encoding::Text => Box::new(TextSlices::new(header, notes, content.source)),
        _ => Box::new(StreamSlices::new(
            header,
            notes,
            layout.big_endian,
            content.source,
        )),
    }
}

/// The content from the first voxel on, inflated; `needed` bytes of voxels are expected of it.
fn decoded<'a>(
    header: &VolumeHeader,
    layout: Layout,
    mut content: Content<'a>,
    needed: u64,
) -> Result<Content<'a>, Fault> {
    for _ in 0..layout.skip_lines {
        skip_line(&mut content)?;
    }
    if let Encoding::Gzip | Encoding::Zlib = layout.encoding {
        let is_gzip = layout.encoding == Encoding::Gzip;
        content = Content {
            // Deflate cannot blow a byte up to more than 1032.
            bound: content.bound.map(|b| b.saturating_mul(1032)),
            is_exact: false,
            source: if is_gzip {
                Box::new(GzipBody::new(content.source))
            } else {
                ZlibBody::or_gzip(content.source)?
            },
        };
    }
    match layout.start {
        Start::After(count) => content.skip(count)?,
        Start::AtTheEnd => match content.bound {
            Some(length) if content.is_exact && layout.encoding == Encoding::Raw => {
                content.skip(length.saturating_sub(needed))?;
            }
            _ => {
                return Err(Fault::Value {
                    what: "the start of the voxels",
                    value: "counted from the end of the file".into(),
                    remedy: "that works for a plain file in raw encoding; give the bytes before them instead",
                });
            }
        },
    }
    if let Some(bound) = content.bound {
        match layout.encoding {
            // A digit and a separator each; the last needs none.
            Encoding::Text => {
                let least = (header.voxel_count() as u64 * 2).saturating_sub(1);
                if bound < least {
                    return Err(Fault::Truncated {
                        what: format!("text of {} numbers", header.voxel_count()),
                        needed: least,
                        found: bound,
                    });
                }
            }
            Encoding::Hex => check_part(header, needed, bound / 2)?,
            _ => check_part(header, needed, bound)?,
        }
    }
    if layout.encoding == Encoding::Hex {
        content.source = Box::new(HexBody::new(content.source));
    }
    Ok(content)
}

fn check_part(header: &VolumeHeader, needed: u64, found: u64) -> Result<(), Fault> {
    if needed == stored_bytes(header) {
        return check_length(header, found);
    }
    if needed <= found {
        return Ok(());
    }
    Err(Fault::Truncated {
        what: "a data file's share of the voxels".into(),
        needed,
        found,
    })
}

fn skip_line(content: &mut Content) -> Result<(), Fault> {
    let mut byte = [0];
    loop {
        if content.source.read(&mut byte).map_err(read_fault)? == 0 {
            return Err(Fault::Truncated {
                what: "the lines before the voxels".into(),
                needed: 1,
                found: 0,
            });
        }
        content.bound = content.bound.map(|b| b.saturating_sub(1));
        if byte[0] == b'\n' {
            return Ok(());
        }
    }
}
