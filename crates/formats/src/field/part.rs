//! A part of a field that is put together elsewhere: its bricks in pages, one for each first key of a level, that are read
//! one at a time.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek, SeekFrom};

use bspline::hierarchical::{Lattice, LevelCorrections};

use super::chunk::{self, expected};
use super::cursor::Cursor;
use super::kinds::{LEVEL, PAGES};
use super::levels::{from_bytes, to_bytes};
use super::{MAX_LEVELS, Stored};
use crate::limits::Budget;
use crate::{Fault, ReadLimits};

/// First bytes of a part.
pub const PART_MAGIC: [u8; 8] = *b"\x89IPART\r\n";

/// Bytes of the magic and of the length of the index behind it.
const FRONT: usize = 16;

/// The bytes of a part: the bricks of each level, with the keys that they have in the whole field, and the slope of the fit
/// that they are of.
pub fn encode_part<T: Stored>(levels: &[LevelCorrections<T>], slope: f64) -> Vec<u8> {
    let mut raw = slope.to_le_bytes().to_vec();
    let mut pages = Vec::new();
    for (level, bricks) in levels.iter().enumerate() {
        let mut planes: BTreeMap<u32, LevelCorrections<T>> = BTreeMap::new();
        for (key, functions) in bricks {
            planes
                .entry(key.0[0])
                .or_default()
                .insert(*key, functions.clone());
        }
        for (x, plane) in planes {
            let start = pages.len();
            put(&mut pages, LEVEL, &to_bytes(level as u32, &plane));
            raw.extend((level as u32).to_le_bytes());
            raw.extend(x.to_le_bytes());
            raw.extend(((pages.len() - start) as u64).to_le_bytes());
        }
    }
    let mut index = Vec::new();
    put(&mut index, PAGES, &raw);
    let mut bytes = PART_MAGIC.to_vec();
    bytes.extend((index.len() as u64).to_le_bytes());
    bytes.extend(index);
    bytes.extend(pages);
    bytes
}

fn put(bytes: &mut Vec<u8>, kind: chunk::Kind, raw: &[u8]) {
    chunk::write(bytes, kind, raw).expect("memory takes all that is written to it");
}

/// Where the pages of a part are.
#[derive(Clone, Debug)]
pub struct PartIndex {
    slope: f64,
    /// By level and first key: first byte and number of bytes.
    pages: BTreeMap<(usize, u32), (u64, u64)>,
}

impl PartIndex {
    /// Reads the index of a part.
    ///
    /// # Errors
    /// [`Fault::Truncated`], [`Fault::Damaged`], [`Fault::Value`] for what is no part; I/O.
    pub fn read(part: &mut (impl Read + Seek)) -> Result<Self, Fault> {
        let front = bytes_at(part, 0, FRONT as u64)?;
        if front[..8] != PART_MAGIC {
            return Err(Fault::Value {
                what: "the start of a part",
                value: crate::error::excerpt(&front[..8]),
                remedy: "empty the directory of the parts, and begin again",
            });
        }
        let length = u64::from_le_bytes(front[8..].try_into().expect("8 bytes"));
        let bytes = bytes_at(part, FRONT as u64, length)?;
        let mut budget = Budget::new(&ReadLimits::default());
        let raw = expected(&mut &bytes[..], bytes.len(), PAGES, &mut budget)?;
        let (slope, rest) = raw.split_first_chunk().ok_or_else(|| Fault::Damaged {
            what: "the index of a part has no slope".into(),
        })?;
        let mut cursor = Cursor::new(rest, "the index of a part");
        let mut pages = BTreeMap::new();
        let mut start = FRONT as u64 + length;
        for _ in 0..rest.len().div_ceil(16) {
            let (level, x) = (cursor.u32()?, cursor.u32()?);
            let (low, high) = (cursor.u32()?, cursor.u32()?);
            let length = u64::from(high) << 32 | u64::from(low);
            if level as usize >= MAX_LEVELS {
                return Err(Fault::Damaged {
                    what: format!("a part has a page of level {level}"),
                });
            }
            pages.insert((level as usize, x), (start, length));
            start = start.saturating_add(length);
        }
        Ok(Self {
            slope: f64::from_le_bytes(*slope),
            pages,
        })
    }

    /// Slope of the fit.
    pub fn slope(&self) -> f64 {
        self.slope
    }

    /// Level and first key of each page, in order.
    pub fn pages(&self) -> impl Iterator<Item = (usize, u32)> {
        self.pages.keys().copied()
    }

    /// The bricks of a page of the part; none if there is no such page. `lattice` is that of the whole field.
    ///
    /// # Errors
    /// As [`Self::read`]; [`Fault::Value`] for bricks that the lattice does not have.
    pub fn page<T: Stored>(
        &self,
        part: &mut (impl Read + Seek),
        lattice: &Lattice,
        (level, x): (usize, u32),
    ) -> Result<LevelCorrections<T>, Fault> {
        let Some((start, length)) = self.pages.get(&(level, x)) else {
            return Ok(LevelCorrections::new());
        };
        let bytes = bytes_at(part, *start, *length)?;
        let mut budget = Budget::new(&ReadLimits::default());
        let raw = expected(&mut &bytes[..], bytes.len(), LEVEL, &mut budget)?;
        let bricks = from_bytes(&raw, level as u32, lattice, &mut budget)?;
        match bricks.keys().find(|key| key.0[0] != x) {
            None => Ok(bricks),
            Some(key) => Err(Fault::Damaged {
                what: format!("brick {:?} stands in page {x} of level {level}", key.0),
            }),
        }
    }
}

/// Some bytes of a part; what is not there is not allocated for.
fn bytes_at(part: &mut (impl Read + Seek), start: u64, length: u64) -> Result<Vec<u8>, Fault> {
    let mut bytes = Vec::new();
    let mut read = || -> io::Result<usize> {
        part.seek(SeekFrom::Start(start))?;
        part.take(length).read_to_end(&mut bytes)
    };
    let found = read().map_err(|source| Fault::Io {
        doing: "reading",
        source,
    })?;
    match found as u64 == length {
        true => Ok(bytes),
        false => Err(Fault::Truncated {
            what: format!("a part at byte {start}"),
            needed: length,
            found: found as u64,
        }),
    }
}
