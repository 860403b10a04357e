//! TIFF stacks: the pages of one file, or a directory of files with one page each.

mod decode;
mod directory;
mod folder;
mod page;
mod spacing;

use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek};
use std::path::{Path, PathBuf};

pub(crate) use folder::is_stack as is_stack_folder;

use page::{Page, Stack};

use super::slices::{self, SliceSource};
use super::stream::{StreamSlices, check_length, convert};
use super::volume::{Volume, VolumeHeader};
use crate::input::{self, SkipRead, io_fault};
use crate::limits::Budget;
use crate::{Fault, ReadLimits};

/// Whether a content starts like a TIFF or BigTIFF file.
pub(crate) fn looks_like_tiff(head: &[u8]) -> bool {
    [&b"II*\0"[..], b"MM\0*", b"II+\0", b"MM\0+"]
        .iter()
        .any(|m| head.starts_with(m))
}

/// What the decoder reads from.
trait Random: Read + Seek {}
impl<T: Read + Seek> Random for T {}

/// Reads the bytes of a TIFF file with several pages.
///
/// # Errors
/// As [`super::read`], without the path.
pub fn parse_tiff(bytes: &[u8], limits: &ReadLimits) -> Result<Volume, Fault> {
    let mut budget = Budget::new(limits);
    let length = bytes.len() as u64;
    let again = || Ok(Box::new(bytes) as Box<dyn SkipRead + '_>);
    let mut source = stack(Box::new(Cursor::new(bytes)), length, again, &mut budget)?;
    slices::read(&mut *source, &mut budget)
}

pub(super) fn open(path: &Path, budget: &mut Budget) -> Result<Box<dyn SliceSource>, Fault> {
    if path.is_dir() {
        return Ok(Box::new(FolderSlices::open(folder::pages(path)?, budget)?));
    }
    let (reader, length) = random(path, budget)?;
    stack(reader, length, || Ok(Box::new(input::open(path)?.source)), budget)
}

/// A file that can be sought in: what is gzipped is inflated whole, which is booked.
fn random(path: &Path, budget: &mut Budget) -> Result<(Box<dyn Random>, u64), Fault> {
    let input = input::open(path)?;
    if let (input::Source::Plain(_), Some(_)) = (&input.source, input.length_bound) {
        return plain(path);
    }
    let bytes = input.read_all(budget)?;
    let length = bytes.len() as u64;
    Ok((Box::new(Cursor::new(bytes)), length))
}

fn plain(path: &Path) -> Result<(Box<dyn Random>, u64), Fault> {
    let file = File::open(path).map_err(io_fault("opening"))?;
    let length = file.metadata().map_err(io_fault("opening"))?.len();
    Ok((Box::new(BufReader::with_capacity(READER as usize, file)), length))
}

/// The pages of one file as slices; `again` gives the content once more, from its start.
fn stack<'a>(
    reader: Box<dyn Random + 'a>,
    length: u64,
    again: impl FnOnce() -> Result<Box<dyn SkipRead + 'a>, Fault>,
    budget: &mut Budget,
) -> Result<Box<dyn SliceSource + 'a>, Fault> {
    let mut stack = Stack::open(reader, length, budget)?;
    let mut notes = Vec::new();
    let described = stack.description()?;
    if let Some(at) = described.pages_without_headers(stack.count())? {
        return contiguous(&mut stack, at, length, &described, again, notes);
    }
    let header = described.header(&stack.first, stack.count(), &mut notes)?;
    // LZW, the best of the compressions at nothing but zeros, makes 1.5 bytes of 4096.
    check_length(&header, length.saturating_mul(4096))?;
    Ok(Box::new(StackSlices {
        header,
        notes,
        stack,
        raw: Vec::new(),
        next: 0,
    }))
}

/// ImageJ writes stacks beyond 4 GB as one page with the voxels of the others right behind its own.
fn contiguous<'a>(
    stack: &mut Stack<'a>,
    count: usize,
    length: u64,
    described: &page::Description,
    again: impl FnOnce() -> Result<Box<dyn SkipRead + 'a>, Fault>,
    mut notes: Vec<String>,
) -> Result<Box<dyn SliceSource + 'a>, Fault> {
    let start = stack.start_of_plain_voxels()?;
    let header = described.header(&stack.first, count, &mut notes)?;
    check_length(&header, length.saturating_sub(start))?;
    let mut source = again()?;
    super::stream::skip(&mut *source, start)?;
    Ok(Box::new(StreamSlices::new(
        header,
        notes,
        stack.is_big_endian(),
        source,
    )))
}

struct StackSlices<'a> {
    header: VolumeHeader,
    notes: Vec<String>,
    stack: Stack<'a>,
    raw: Vec<u8>,
    next: usize,
}

impl SliceSource for StackSlices<'_> {
    fn header(&self) -> &VolumeHeader {
        &self.header
    }

    fn notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    fn next_slice(&mut self, out: &mut [f32]) -> Result<(), Fault> {
        let is_big_endian = self.stack.decode(self.next, &mut self.raw)?;
        self.next += 1;
        voxels(&self.raw, is_big_endian, &self.header, out);
        Ok(())
    }

    fn skip_slice(&mut self) -> Result<(), Fault> {
        self.next += 1;
        Ok(())
    }

    fn working_bytes(&self) -> u64 {
        self.stack.first.working_bytes().saturating_add(READER)
    }

    fn finish(&mut self) -> Result<(), Fault> {
        Ok(())
    }
}

/// Bytes of the file held at a time.
const READER: u64 = 1 << 16;

fn voxels(raw: &[u8], is_big_endian: bool, header: &VolumeHeader, out: &mut [f32]) {
    if is_big_endian {
        convert::<true>(raw, header.stored, header.rescale, out);
    } else {
        convert::<false>(raw, header.stored, header.rescale, out);
    }
}

/// Files with a page each.
struct FolderSlices {
    header: VolumeHeader,
    notes: Vec<String>,
    paths: Vec<PathBuf>,
    page: Page,
    raw: Vec<u8>,
    next: usize,
}

impl FolderSlices {
    fn open(folder: folder::Pages, budget: &mut Budget) -> Result<Self, Fault> {
        let names: u64 = folder.paths.iter().map(|p| p.as_os_str().len() as u64 + 32).sum();
        budget.reserve("the list of files", names, 1)?;
        let mut notes = folder.notes;
        let path = &folder.paths[0];
        let mut first = one_page(path, budget).map_err(|fault| fault.inside(&name_of(path)))?;
        let described = first.description()?;
        let header = described.header(&first.first, folder.paths.len(), &mut notes)?;
        Ok(Self {
            header,
            notes,
            page: first.first,
            paths: folder.paths,
            raw: Vec::new(),
            next: 0,
        })
    }

    fn decode(&mut self, path: &Path) -> Result<bool, Fault> {
        let mut stack = one_page(path, &mut Budget::new(&ReadLimits::default()))?;
        if stack.first != self.page {
            return Err(Fault::Value {
                what: "the page",
                value: format!("{}, where the first file has {}", stack.first, self.page),
                remedy: "all files of a stack have the same size and type; put others somewhere else",
            });
        }
        stack.decode(0, &mut self.raw)
    }
}

/// Name of a file in the directory.
fn name_of(path: &Path) -> String {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}

/// A file that has one page; in a directory none is gzipped, so that no file has to be held whole.
fn one_page(path: &Path, budget: &mut Budget) -> Result<Stack<'static>, Fault> {
    let (reader, length) = plain(path)?;
    let stack = Stack::open(reader, length, budget)?;
    if stack.count() != 1 {
        return Err(Fault::Value {
            what: "the number of pages",
            value: stack.count().to_string(),
            remedy: "in a directory each file is one slice; name the file itself to read its pages",
        });
    }
    Ok(stack)
}

impl SliceSource for FolderSlices {
    fn header(&self) -> &VolumeHeader {
        &self.header
    }

    fn notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    fn next_slice(&mut self, out: &mut [f32]) -> Result<(), Fault> {
        let path = self.paths[self.next].clone();
        self.next += 1;
        let is_big_endian = self
            .decode(&path)
            .map_err(|fault| fault.inside(&name_of(&path)))?;
        voxels(&self.raw, is_big_endian, &self.header, out);
        Ok(())
    }

    fn skip_slice(&mut self) -> Result<(), Fault> {
        self.next += 1;
        Ok(())
    }

    fn working_bytes(&self) -> u64 {
        self.page.working_bytes().saturating_add(READER)
    }

    fn finish(&mut self) -> Result<(), Fault> {
        Ok(())
    }
}
