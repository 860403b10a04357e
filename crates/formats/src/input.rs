//! Bytes of a file, inflated if gzipped, never more than the budget allows.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;

use crate::Fault;
use crate::file_name::is_gz_name;
use crate::limits::Budget;

const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];
/// Largest first allocation on the word of a file alone.
const TRUSTED_HINT: u64 = 64 << 20;

/// Whether a content begins as one that is gzipped.
pub(crate) fn is_gzip(head: &[u8]) -> bool {
    head.starts_with(&GZIP_MAGIC)
}

/// The content of a file as a stream.
pub(crate) enum Source {
    Plain(BufReader<File>),
    Gzip(Box<MultiGzDecoder<BufReader<File>>>),
}

impl Read for Source {
    fn read(&mut self, buf: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Plain(r) => r.read(buf),
            Self::Gzip(r) => r.read(buf),
        }
    }
}

/// A stream of which parts are passed over.
pub(crate) trait SkipRead: Read {
    /// Passes over up to `count` bytes; returns how many there were (a file may be sought beyond its end, which
    /// the next reading notices).
    fn skip(&mut self, count: u64) -> io::Result<u64>;
}

/// Reads what is passed over.
pub(crate) fn skip_by_reading(source: &mut impl Read, count: u64) -> io::Result<u64> {
    io::copy(&mut source.take(count), &mut io::sink())
}

impl SkipRead for &[u8] {
    fn skip(&mut self, count: u64) -> io::Result<u64> {
        let n = count.min(self.len() as u64);
        *self = &self[n as usize..];
        Ok(n)
    }
}

impl SkipRead for Source {
    fn skip(&mut self, count: u64) -> io::Result<u64> {
        match self {
            Self::Plain(r) => match i64::try_from(count) {
                Ok(n) if r.get_ref().metadata()?.is_file() => r.seek_relative(n).map(|()| count),
                _ => skip_by_reading(r, count),
            },
            Self::Gzip(r) => skip_by_reading(r, count),
        }
    }
}

/// An open file: its content and, where known, how many bytes that has.
pub(crate) struct Input {
    pub source: Source,
    /// Length of the content; for gzip the stored one, modulo 2³² and not to be trusted.
    pub length_hint: u64,
    /// Bytes that the content cannot exceed; `None` for a pipe.
    pub length_bound: Option<u64>,
}

pub(crate) fn io_fault(doing: &'static str) -> impl Fn(io::Error) -> Fault {
    move |source| match source.kind() {
        io::ErrorKind::IsADirectory => Fault::Directory,
        _ => Fault::Io { doing, source },
    }
}

/// Opens `path`; gzip is told by its magic bytes, whatever the name.
pub(crate) fn open(path: &Path) -> Result<Input, Fault> {
    open_with(path, true)
}

/// Opens a file of bare voxels, whose first ones may look like any magic: gzip is told by the name.
pub(crate) fn open_by_name(path: &Path) -> Result<Input, Fault> {
    open_with(path, is_gz_name(path))
}

/// Opens `path` as it is.
pub(crate) fn open_as_it_is(path: &Path) -> Result<Input, Fault> {
    open_with(path, false)
}

fn open_with(path: &Path, may_inflate: bool) -> Result<Input, Fault> {
    let mut file = File::open(path).map_err(io_fault("opening"))?;
    let meta = file.metadata().map_err(io_fault("opening"))?;
    if meta.is_dir() {
        return Err(Fault::Directory);
    }
    if !meta.is_file() {
        // A pipe cannot be rewound after a look at its first bytes.
        let source = Source::Plain(BufReader::with_capacity(1 << 16, file));
        return Ok(Input {
            source,
            length_hint: 0,
            length_bound: None,
        });
    }
    let mut magic = [0; 2];
    let gzip = may_inflate && meta.len() >= 18 && file.read_exact(&mut magic).is_ok() && magic == GZIP_MAGIC;
    let (mut length, mut bound) = (meta.len(), meta.len());
    if gzip {
        let mut tail = [0; 4];
        file.seek(SeekFrom::End(-4))
            .and_then(|_| file.read_exact(&mut tail))
            .map_err(io_fault("reading"))?;
        // Deflate cannot blow a byte up to more than 1032.
        bound = meta.len().saturating_mul(1032);
        length = u64::from(u32::from_le_bytes(tail)).min(bound);
    }
    file.seek(SeekFrom::Start(0)).map_err(io_fault("reading"))?;
    let plain = BufReader::with_capacity(1 << 16, file);
    let source = if gzip {
        Source::Gzip(Box::new(MultiGzDecoder::new(plain)))
    } else {
        Source::Plain(plain)
    };
    Ok(Input {
        source,
        length_hint: length,
        length_bound: Some(bound),
    })
}

impl Input {
    /// The whole content, booked in `budget`.
    pub fn read_all(mut self, budget: &mut Budget) -> Result<Vec<u8>, Fault> {
        let limit = budget.left();
        if let Source::Plain(_) = self.source {
            // Known before a byte is read, so that a large file is refused at once.
            if self.length_hint > limit {
                return budget
                    .reserve("the file's content", self.length_hint, 1)
                    .map(|()| Vec::new());
            }
        }
        // The hint of a gzip file is a claim: trusted up to a size that does no harm, then doubled.
        let mut bytes = Vec::with_capacity(self.length_hint.min(limit).min(TRUSTED_HINT) as usize + 1);
        let mut filled = 0;
        loop {
            if filled == bytes.len() {
                if filled as u64 > limit {
                    break;
                }
                if filled == bytes.capacity() {
                    let room = (limit + 1 - filled as u64).min(filled.max(1 << 16) as u64);
                    bytes.reserve_exact(room as usize);
                }
                bytes.resize(bytes.capacity(), 0);
            }
            match self.source.read(&mut bytes[filled..]) {
                Ok(0) => break,
                Ok(n) => filled += n,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => return Err(read_fault(e)),
            }
        }
        bytes.truncate(filled);
        budget.reserve("the file's content", bytes.len() as u64, 1)?;
        if bytes.is_empty() {
            return Err(Fault::Empty);
        }
        Ok(bytes)
    }
}

/// What an error while reading content means: the gzip decoder reports cuts and damage as I/O errors.
pub(crate) fn read_fault(source: io::Error) -> Fault {
    match source.kind() {
        io::ErrorKind::UnexpectedEof => Fault::Damaged {
            what: "it ends too early, before the end of its content".into(),
        },
        io::ErrorKind::InvalidInput | io::ErrorKind::InvalidData => Fault::Damaged {
            what: format!("the gzip stream does not hold ({source})"),
        },
        _ => io_fault("reading")(source),
    }
}
