//! The bytes of one file, read forwards and skipped without being read.

use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::PathBuf;
use std::sync::Arc;

use flate2::read::DeflateDecoder;

use crate::Fault;
use crate::input::io_fault;

/// Where a file is.
#[derive(Clone, Debug)]
pub(super) enum Location {
    Path(PathBuf),
    Memory(Arc<[u8]>),
}

impl Location {
    /// Opens the file at its first byte.
    pub fn open(&self) -> Result<Stream, Fault> {
        match self {
            Self::Path(path) => {
                let file = File::open(path).map_err(io_fault("opening"))?;
                let length = file.metadata().map_err(io_fault("opening"))?.len();
                // A header is a few KiB, pixel data are read past the buffer.
                let source = Source::File(BufReader::with_capacity(1 << 13, file));
                Ok(Stream::new(source, Some(length)))
            }
            Self::Memory(bytes) => {
                let length = bytes.len() as u64;
                Ok(Stream::new(
                    Source::Memory(Cursor::new(bytes.clone())),
                    Some(length),
                ))
            }
        }
    }
}

enum Source {
    File(BufReader<File>),
    Memory(Cursor<Arc<[u8]>>),
    Inflated(Box<DeflateDecoder<Source>>),
}

impl Read for Source {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::File(r) => r.read(buffer),
            Self::Memory(r) => r.read(buffer),
            Self::Inflated(r) => r.read(buffer),
        }
    }
}

/// An open file, or the inflated rest of one.
pub(super) struct Stream {
    source: Source,
    at: u64,
    length: Option<u64>,
}

impl Stream {
    fn new(source: Source, length: Option<u64>) -> Self {
        Self {
            source,
            at: 0,
            length,
        }
    }

    /// The rest of the file inflated; positions start again at 0.
    pub fn inflated(self) -> Self {
        Self::new(Source::Inflated(Box::new(DeflateDecoder::new(self.source))), None)
    }

    /// Bytes read or skipped so far.
    pub fn position(&self) -> u64 {
        self.at
    }

    /// Bytes to the end, where that is known.
    pub fn left(&self) -> Option<u64> {
        self.length.map(|n| n.saturating_sub(self.at))
    }

    /// Fills `buffer`; `what` names it in the error of a file that ends before.
    pub fn fill(&mut self, buffer: &mut [u8], what: &str) -> Result<(), Fault> {
        let filled = self.fill_or_end(buffer)?;
        if filled < buffer.len() {
            return Err(cut(what, buffer.len() as u64, filled as u64));
        }
        Ok(())
    }

    /// Fills `buffer` as far as the file goes.
    pub fn fill_or_end(&mut self, buffer: &mut [u8]) -> Result<usize, Fault> {
        let mut filled = 0;
        while filled < buffer.len() {
            match self.source.read(&mut buffer[filled..]) {
                Ok(0) => break,
                Ok(n) => filled += n,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => return Err(stream_fault(e)),
            }
        }
        self.at += filled as u64;
        Ok(filled)
    }

    /// Passes over `count` bytes, which have to be there.
    pub fn skip(&mut self, count: u64, what: &str) -> Result<(), Fault> {
        if let Some(left) = self.left().filter(|left| *left < count) {
            return Err(cut(what, count, left));
        }
        match &mut self.source {
            Source::File(r) => {
                let step = i64::try_from(count).map_err(|_| cut(what, count, 0))?;
                r.seek_relative(step).map_err(stream_fault)?;
            }
            Source::Memory(r) => {
                r.seek(SeekFrom::Start(self.at + count)).map_err(stream_fault)?;
            }
            Source::Inflated(r) => {
                let skipped = io::copy(&mut r.by_ref().take(count), &mut io::sink()).map_err(stream_fault)?;
                if skipped < count {
                    return Err(cut(what, count, skipped));
                }
            }
        }
        self.at += count;
        Ok(())
    }

    /// Goes back to byte `at` of a file that is not inflated.
    pub fn back_to(&mut self, at: u64) -> Result<(), Fault> {
        debug_assert!(
            at <= self.at && self.length.is_some(),
            "inflated streams go forwards"
        );
        match &mut self.source {
            Source::File(r) => r.seek_relative(at as i64 - self.at as i64),
            Source::Memory(r) => r.seek(SeekFrom::Start(at)).map(|_| ()),
            Source::Inflated(_) => unreachable!("inflated streams are not turned back"),
        }
        .map_err(stream_fault)?;
        self.at = at;
        Ok(())
    }
}

fn cut(what: &str, needed: u64, found: u64) -> Fault {
    Fault::Truncated {
        what: what.into(),
        needed,
        found,
    }
}

/// The decoder of deflated data sets reports cuts and damage as I/O errors.
fn stream_fault(source: io::Error) -> Fault {
    match source.kind() {
        io::ErrorKind::UnexpectedEof | io::ErrorKind::InvalidInput | io::ErrorKind::InvalidData => {
            Fault::Damaged {
                what: format!("the deflated data set does not hold ({source})"),
            }
        }
        _ => io_fault("reading")(source),
    }
}
