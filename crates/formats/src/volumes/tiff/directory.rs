//! Image directories of TIFF 6 and BigTIFF files. Read by code of our own: crate `tiff` (0.11) sets aside up to
//! 256 MiB on the word of the first directory, before its limits can be given, and prints while it decodes.

use std::io::{Read, Seek, SeekFrom};

use super::Random;
use crate::Fault;
use crate::input::io_fault;

/// Most entries of a directory; real ones have some twenty.
const MOST_ENTRIES: u64 = 4096;

/// A file of known length and the byte order it names.
pub(super) struct Bytes<'a> {
    reader: Box<dyn Random + 'a>,
    length: u64,
    /// Where the reader stands, if it is known.
    position: Option<u64>,
    pub is_big_endian: bool,
    is_big_tiff: bool,
}

/// One image: its tags, and where the next directory is.
#[derive(Debug, Default)]
pub(super) struct Directory {
    entries: Vec<Entry>,
    /// 0 after the last.
    pub next: u64,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    tag: u16,
    kind: u16,
    count: u64,
    /// Byte at which the values start.
    at: u64,
}

pub(super) fn damaged(what: impl Into<String>) -> Fault {
    Fault::Damaged {
        what: format!("the TIFF structure does not hold, {}", what.into()),
    }
}

impl<'a> Bytes<'a> {
    /// Reads the first bytes; also gives the place of the first directory.
    pub fn open(reader: Box<dyn Random + 'a>, length: u64) -> Result<(Self, u64), Fault> {
        let mut bytes = Self {
            reader,
            length,
            position: None,
            is_big_endian: false,
            is_big_tiff: false,
        };
        let mut head = [0; 8];
        bytes.read_at(0, &mut head)?;
        bytes.is_big_endian = &head[..2] == b"MM";
        bytes.is_big_tiff = bytes.number(&head[2..4]) == 43;
        if !super::looks_like_tiff(&head) {
            return Err(damaged("it does not start with II or MM and 42 or 43"));
        }
        let first = if bytes.is_big_tiff {
            let mut place = [0; 8];
            bytes.read_at(8, &mut place)?;
            bytes.number(&place)
        } else {
            bytes.number(&head[4..8])
        };
        Ok((bytes, first))
    }

    /// An unsigned number of 1, 2, 4 or 8 bytes.
    fn number(&self, raw: &[u8]) -> u64 {
        let join = |n, b: &u8| n << 8 | u64::from(*b);
        if self.is_big_endian {
            raw.iter().fold(0, join)
        } else {
            raw.iter().rev().fold(0, join)
        }
    }

    /// Fills `buffer` from byte `at` on.
    pub fn read_at(&mut self, at: u64, buffer: &mut [u8]) -> Result<(), Fault> {
        let end = at.saturating_add(buffer.len() as u64);
        if end > self.length {
            return Err(Fault::Truncated {
                what: format!("what stands at byte {at}"),
                needed: buffer.len() as u64,
                found: self.length.saturating_sub(at),
            });
        }
        // A relative step keeps what the reader has buffered.
        let step = match self.position.take() {
            Some(position) => self.reader.seek_relative(at.wrapping_sub(position) as i64),
            None => self.reader.seek(SeekFrom::Start(at)).map(drop),
        };
        step.and_then(|()| self.reader.read_exact(buffer))
            .map_err(io_fault("reading"))?;
        self.position = Some(end);
        Ok(())
    }

    /// Reads the directory at byte `at`.
    pub fn directory(&mut self, at: u64) -> Result<Directory, Fault> {
        let (count_size, entry_size, place_size) = if self.is_big_tiff { (8, 20, 8) } else { (2, 12, 4) };
        let mut raw = [0; 20];
        self.read_at(at, &mut raw[..count_size])?;
        let count = self.number(&raw[..count_size]);
        if count > MOST_ENTRIES {
            return Err(damaged(format!(
                "a directory has {count} entries, more than {MOST_ENTRIES}"
            )));
        }
        let mut directory = Directory::default();
        for k in 0..count {
            let entry_at = at + count_size as u64 + k * entry_size as u64;
            self.read_at(entry_at, &mut raw[..entry_size])?;
            let kind = self.number(&raw[2..4]) as u16;
            let values = 4 + place_size;
            let count = self.number(&raw[4..values]);
            let is_inside = count.saturating_mul(size_of_kind(kind)) <= place_size as u64;
            directory.entries.push(Entry {
                tag: self.number(&raw[..2]) as u16,
                kind,
                count,
                at: if is_inside {
                    entry_at + values as u64
                } else {
                    self.number(&raw[values..entry_size])
                },
            });
        }
        let next_at = at + count_size as u64 + count * entry_size as u64;
        self.read_at(next_at, &mut raw[..place_size])?;
        directory.next = self.number(&raw[..place_size]);
        Ok(directory)
    }

    /// Bytes of the values of an entry, at most `most` of them.
    fn values(&mut self, entry: Entry, most: u64) -> Result<Vec<u8>, Fault> {
        let length = entry.count.saturating_mul(size_of_kind(entry.kind));
        let fits = entry.at.checked_add(length).is_some_and(|end| end <= self.length);
        if length > most || !fits {
            return Err(damaged(format!(
                "tag {} has {} values at byte {}",
                entry.tag, entry.count, entry.at
            )));
        }
        let mut raw = vec![0; length as usize];
        self.read_at(entry.at, &mut raw)?;
        Ok(raw)
    }

    /// Whole numbers of a tag, as many as `count`; `None` if the tag is missing.
    pub fn numbers(&mut self, from: &Directory, tag: u16, count: u64) -> Result<Option<Vec<u64>>, Fault> {
        let Some(entry) = from.find(tag) else {
            return Ok(None);
        };
        if !matches!(entry.kind, 1 | 3 | 4 | 13 | 16 | 18) || entry.count < count {
            return Err(damaged(format!(
                "tag {tag} has {} values of type {} where {count} whole numbers are needed",
                entry.count, entry.kind
            )));
        }
        let wanted = Entry { count, ..entry };
        let size = size_of_kind(entry.kind);
        let raw = self.values(wanted, count.saturating_mul(8))?;
        Ok(Some(
            raw.chunks_exact(size as usize).map(|c| self.number(c)).collect(),
        ))
    }

    /// The first whole number of a tag.
    pub fn first(&mut self, from: &Directory, tag: u16) -> Result<Option<u64>, Fault> {
        Ok(self.numbers(from, tag, 1)?.map(|n| n[0]))
    }

    /// The text of a tag up to its first zero byte; empty if it is missing, no text, or longer than `most`.
    pub fn text(&mut self, from: &Directory, tag: u16, most: u64) -> Result<String, Fault> {
        match from.find(tag) {
            Some(entry) if entry.kind == 2 && entry.count <= most => {
                let raw = self.values(entry, most)?;
                let text = raw.split(|b| *b == 0).next().unwrap_or_default();
                Ok(String::from_utf8_lossy(text).into_owned())
            }
            _ => Ok(String::new()),
        }
    }

    /// The quotient of a tag, if it is there and is one.
    pub fn rational(&mut self, from: &Directory, tag: u16) -> Result<Option<f64>, Fault> {
        match from.find(tag) {
            Some(entry) if entry.kind == 5 && entry.count == 1 => {
                let raw = self.values(entry, 8)?;
                Ok(Some(
                    self.number(&raw[..4]) as f64 / self.number(&raw[4..]) as f64,
                ))
            }
            _ => Ok(None),
        }
    }
}

impl Directory {
    fn find(&self, tag: u16) -> Option<Entry> {
        self.entries.iter().find(|e| e.tag == tag).copied()
    }
}

/// Bytes of a value; types that are not known take none.
fn size_of_kind(kind: u16) -> u64 {
    match kind {
        1 | 2 | 6 | 7 => 1,
        3 | 8 => 2,
        4 | 9 | 11 | 13 => 4,
        5 | 10 | 12 | 16 | 17 | 18 => 8,
        _ => 0,
    }
}
