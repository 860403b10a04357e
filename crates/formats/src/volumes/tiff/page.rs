//! Pages of a TIFF file: grey images of one size and type.

use std::collections::BTreeSet;
use std::fmt;

use super::Random;
use super::decode::{Compression, Predictor, inflate, undo_predictor};
use super::directory::{Bytes, Directory, damaged};
use crate::Fault;
use crate::limits::Budget;
use crate::volumes::geometry::checked_dims;
use crate::volumes::voxel::VoxelType;

/// What is held for each page: its place, twice.
const PAGE: usize = 64;
/// Longest description that is looked at; ImageJ's have some hundred bytes.
const DESCRIPTION: u64 = 1 << 16;

mod tag {
    pub const NEW_SUBFILE_TYPE: u16 = 254;
    pub const WIDTH: u16 = 256;
    pub const HEIGHT: u16 = 257;
    pub const BITS: u16 = 258;
    pub const COMPRESSION: u16 = 259;
    pub const PHOTOMETRIC: u16 = 262;
    pub const FILL_ORDER: u16 = 266;
    pub const DESCRIPTION: u16 = 270;
    pub const STRIP_OFFSETS: u16 = 273;
    pub const SAMPLES: u16 = 277;
    pub const ROWS_PER_STRIP: u16 = 278;
    pub const STRIP_BYTES: u16 = 279;
    pub const X_RESOLUTION: u16 = 282;
    pub const Y_RESOLUTION: u16 = 283;
    pub const RESOLUTION_UNIT: u16 = 296;
    pub const PREDICTOR: u16 = 317;
    pub const TILE_WIDTH: u16 = 322;
    pub const TILE_HEIGHT: u16 = 323;
    pub const TILE_OFFSETS: u16 = 324;
    pub const TILE_BYTES: u16 = 325;
    pub const SAMPLE_FORMAT: u16 = 339;
}

/// Tags of the first page that tell of lengths.
#[derive(Debug, Default)]
pub(super) struct Description {
    /// Free text, in ImageJ's files lines of `key=value`.
    pub text: String,
    /// Pixels per unit along x and y.
    pub resolution: [Option<f64>; 2],
    /// 1: none, 2: inch, 3: centimetre.
    pub unit: Option<u64>,
}

/// What all pages have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Page {
    pub width: u32,
    pub height: u32,
    pub voxel: VoxelType,
    is_tiled: bool,
    /// Size of a strip or tile; strips are as wide as the page, the last may be lower.
    chunk: [u32; 2],
}

impl Page {
    /// Bytes of a decoded page.
    fn bytes(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height) * self.voxel.size() as u64
    }

    fn chunk_bytes(&self) -> u64 {
        let [w, h] = self.chunk.map(u64::from);
        w.saturating_mul(h).saturating_mul(self.voxel.size() as u64)
    }

    /// Longest compressed chunk that is believed: no compression makes twice as much of anything.
    fn most_compressed(&self) -> u64 {
        self.chunk_bytes().saturating_mul(2).saturating_add(4096)
    }

    fn chunk_count(&self) -> u64 {
        u64::from(self.width.div_ceil(self.chunk[0])) * u64::from(self.height.div_ceil(self.chunk[1]))
    }

    /// Bytes held while a page is decoded: the page, a chunk packed and unpacked, the places of all chunks with
    /// what they are made of.
    pub fn working_bytes(&self) -> u64 {
        let chunk = self.chunk_bytes().saturating_add(self.most_compressed());
        let places = self.chunk_count().saturating_mul(4 * 8);
        self.bytes().saturating_add(chunk).saturating_add(places)
    }
}

impl fmt::Display for Page {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let form = if self.is_tiled { "tiles" } else { "strips" };
        let [w, h] = self.chunk;
        write!(
            f,
            "{} x {} of {} in {form} of {w} x {h}",
            self.width, self.height, self.voxel
        )
    }
}

/// A file and its pages.
pub(super) struct Stack<'a> {
    bytes: Bytes<'a>,
    /// Places of the directories of the pages.
    pages: Vec<u64>,
    pub first: Page,
    packed: Vec<u8>,
    chunk: Vec<u8>,
    zlib: flate2::Decompress,
}

impl<'a> Stack<'a> {
    /// Goes through all image directories; smaller copies of pages are passed over.
    pub fn open(reader: Box<dyn Random + 'a>, length: u64, budget: &mut Budget) -> Result<Self, Fault> {
        let (mut bytes, mut at) = Bytes::open(reader, length)?;
        let (mut pages, mut first, mut met) = (Vec::new(), None, BTreeSet::new());
        while at != 0 {
            budget.reserve("the list of pages", 1, PAGE)?;
            if !met.insert(at) {
                return Err(damaged(format!("the directory at byte {at} comes again")));
            }
            let directory = bytes.directory(at)?;
            if bytes.first(&directory, tag::NEW_SUBFILE_TYPE)?.unwrap_or(0) & 1 == 0 {
                let page = page_of(&mut bytes, &directory)?;
                let expected = *first.get_or_insert(page);
                if expected != page {
                    return Err(Fault::Value {
                        what: "a page",
                        value: format!(
                            "{page} (page {} from 0), where the first is {expected}",
                            pages.len()
                        ),
                        remedy: "all slices have the same size and type; save the stack without the other pages",
                    });
                }
                pages.push(at);
            }
            at = directory.next;
        }
        let first = first.ok_or_else(|| damaged("it has no page of full size"))?;
        Ok(Self {
            bytes,
            pages,
            first,
            packed: Vec::new(),
            chunk: Vec::new(),
            zlib: flate2::Decompress::new(true),
        })
    }

    /// Number of pages.
    pub fn count(&self) -> usize {
        self.pages.len()
    }

    pub fn is_big_endian(&self) -> bool {
        self.bytes.is_big_endian
    }

    /// What the first page says about the stack.
    pub fn description(&mut self) -> Result<Description, Fault> {
        let directory = self.bytes.directory(self.pages[0])?;
        let bytes = &mut self.bytes;
        Ok(Description {
            text: bytes.text(&directory, tag::DESCRIPTION, DESCRIPTION)?,
            resolution: [
                bytes.rational(&directory, tag::X_RESOLUTION)?,
                bytes.rational(&directory, tag::Y_RESOLUTION)?,
            ],
            unit: bytes.first(&directory, tag::RESOLUTION_UNIT)?,
        })
    }

    /// Decodes a page into `raw`; true if its voxels are big endian then.
    pub fn decode(&mut self, page: usize, raw: &mut Vec<u8>) -> Result<bool, Fault> {
        let directory = self.bytes.directory(self.pages[page])?;
        let layout = Chunks::of(&mut self.bytes, &directory, &self.first)?;
        let page = self.first;
        let (size, [chunk_width, chunk_height]) = (page.voxel.size(), page.chunk.map(|n| n as usize));
        let (width, height) = (page.width as usize, page.height as usize);
        raw.resize(page.bytes() as usize, 0);
        let across = width.div_ceil(chunk_width);
        for (k, (at, length)) in layout.places.iter().copied().enumerate() {
            let (x0, y0) = (k % across * chunk_width, k / across * chunk_height);
            let rows = chunk_height.min(height - y0);
            // Tiles are whole, with padding; the last strip ends with the page.
            let stored_rows = if page.is_tiled { chunk_height } else { rows };
            let row_bytes = chunk_width * size;
            self.chunk.resize(row_bytes * stored_rows, 0);
            if layout.compression == Compression::None {
                if length < self.chunk.len() as u64 {
                    return Err(damaged(format!(
                        "chunk {k} has {length} bytes, {} are needed",
                        self.chunk.len()
                    )));
                }
                self.bytes.read_at(at, &mut self.chunk)?;
            } else {
                self.packed.resize(length as usize, 0);
                self.bytes.read_at(at, &mut self.packed)?;
                inflate(layout.compression, &mut self.zlib, &self.packed, &mut self.chunk)
                    .map_err(|what| damaged(format!("chunk {k}: {what}")))?;
            }
            for row in self.chunk.chunks_exact_mut(row_bytes) {
                undo_predictor(layout.predictor, row, size, self.bytes.is_big_endian);
            }
            let taken = chunk_width.min(width - x0) * size;
            for (y, row) in self.chunk.chunks_exact(row_bytes).take(rows).enumerate() {
                let to = ((y0 + y) * width + x0) * size;
                raw[to..to + taken].copy_from_slice(&row[..taken]);
            }
        }
        Ok(self.bytes.is_big_endian || layout.predictor == Predictor::Float)
    }

    /// Byte at which the voxels of the first page start, if they lie there as they are, one after the other.
    pub fn start_of_plain_voxels(&mut self) -> Result<u64, Fault> {
        let directory = self.bytes.directory(self.pages[0])?;
        let chunks = Chunks::of(&mut self.bytes, &directory, &self.first)?;
        let is_gapless = chunks
            .places
            .windows(2)
            .all(|p| p[0].0.checked_add(p[0].1) == Some(p[1].0));
        if self.first.is_tiled || chunks.compression != Compression::None || !is_gapless {
            return Err(Fault::Value {
                what: "the stack",
                value: "described as of several slices, with one page that is not plain".into(),
                remedy: "save the stack again, one page a slice",
            });
        }
        Ok(chunks.places[0].0)
    }
}

/// Strips or tiles of a page.
struct Chunks {
    compression: Compression,
    predictor: Predictor,
    /// Byte and length of each.
    places: Vec<(u64, u64)>,
}

impl Chunks {
    fn of(bytes: &mut Bytes, directory: &Directory, page: &Page) -> Result<Self, Fault> {
        let (offsets, lengths) = if page.is_tiled {
            (tag::TILE_OFFSETS, tag::TILE_BYTES)
        } else {
            (tag::STRIP_OFFSETS, tag::STRIP_BYTES)
        };
        let count = page.chunk_count();
        let missing = |what: &str| damaged(format!("the {what} of strips or tiles are missing"));
        let offsets = bytes
            .numbers(directory, offsets, count)?
            .ok_or_else(|| missing("places"))?;
        let lengths = bytes
            .numbers(directory, lengths, count)?
            .ok_or_else(|| missing("lengths"))?;
        let compression = Compression::of(bytes.first(directory, tag::COMPRESSION)?.unwrap_or(1))?;
        let most = page.most_compressed();
        if let Some(n) = lengths
            .iter()
            .find(|n| compression != Compression::None && **n > most)
        {
            return Err(damaged(format!(
                "a strip or tile has {n} bytes, at most {most} can be"
            )));
        }
        Ok(Self {
            compression,
            predictor: Predictor::of(bytes.first(directory, tag::PREDICTOR)?.unwrap_or(1), page.voxel)?,
            places: offsets.into_iter().zip(lengths).collect(),
        })
    }
}

fn page_of(bytes: &mut Bytes, directory: &Directory) -> Result<Page, Fault> {
    let mut get = |tag| bytes.first(directory, tag);
    let size = |n: Option<u64>, what: &str| match n.map(u32::try_from) {
        Some(Ok(n)) if n > 0 => Ok(n),
        _ => Err(damaged(format!(
            "the {what} is {}",
            n.map_or("missing".into(), |n| n.to_string())
        ))),
    };
    let width = size(get(tag::WIDTH)?, "width of a page")?;
    let height = size(get(tag::HEIGHT)?, "height of a page")?;
    let (samples, bits) = (get(tag::SAMPLES)?.unwrap_or(1), get(tag::BITS)?.unwrap_or(1));
    let (format, photometric) = (
        get(tag::SAMPLE_FORMAT)?.unwrap_or(1),
        get(tag::PHOTOMETRIC)?.unwrap_or(1),
    );
    let voxel = match (bits, format) {
        (8, 1) => Some(VoxelType::U8),
        (8, 2) => Some(VoxelType::I8),
        (16, 1) => Some(VoxelType::U16),
        (16, 2) => Some(VoxelType::I16),
        (32, 1) => Some(VoxelType::U32),
        (32, 2) => Some(VoxelType::I32),
        (32, 3) => Some(VoxelType::F32),
        (64, 1) => Some(VoxelType::U64),
        (64, 2) => Some(VoxelType::I64),
        (64, 3) => Some(VoxelType::F64),
        _ => None,
    };
    let (Some(voxel), 1) = (voxel, samples) else {
        return Err(Fault::Value {
            what: "the voxel type",
            value: format!("{samples} samples of {bits} bits, sample format {format}"),
            remedy: "read are grey pages of 8 to 64 bits, integers or floats of 32 and 64; convert it to one of these",
        });
    };
    if photometric != 1 {
        let meaning = match photometric {
            0 => " (white is zero)",
            2 => " (colour)",
            3 => " (palette)",
            _ => "",
        };
        return Err(Fault::Value {
            what: "the photometric interpretation",
            value: format!("{photometric}{meaning}"),
            remedy: "densities are grey with black as zero, 1; save it so",
        });
    }
    if get(tag::FILL_ORDER)?.unwrap_or(1) != 1 {
        return Err(Fault::Value {
            what: "the fill order",
            value: "lowest bit first".into(),
            remedy: "save the file with the highest bit first, as nearly all are",
        });
    }
    let tile = (get(tag::TILE_WIDTH)?, get(tag::TILE_HEIGHT)?);
    let (is_tiled, chunk) = match tile {
        (None, _) | (_, None) => {
            let rows = get(tag::ROWS_PER_STRIP)?
                .unwrap_or(height.into())
                .min(height.into());
            (false, [width, size(Some(rows), "number of rows in a strip")?])
        }
        (w, h) => (true, [size(w, "width of a tile")?, size(h, "height of a tile")?]),
    };
    for [w, h] in [[width, height], chunk] {
        checked_dims([w.into(), h.into(), 1])?;
    }
    Ok(Page {
        width,
        height,
        voxel,
        is_tiled,
        chunk,
    })
}
