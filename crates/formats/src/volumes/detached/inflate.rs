//! Compressed bodies behind a header.

use std::io::{self, BufReader, Read};

use flate2::bufread::MultiGzDecoder;
use flate2::{Decompress, FlushDecompress, Status};

use crate::Fault;
use crate::input::{SkipRead, read_fault, skip_by_reading};

const BUFFER: usize = 1 << 16;

/// Gzip members, one after the other.
pub(super) struct GzipBody<'a>(MultiGzDecoder<BufReader<Box<dyn SkipRead + 'a>>>);

impl<'a> GzipBody<'a> {
    pub fn new(source: Box<dyn SkipRead + 'a>) -> Self {
        Self(MultiGzDecoder::new(BufReader::with_capacity(BUFFER, source)))
    }
}

impl Read for GzipBody<'_> {
    fn read(&mut self, buf: &mut [u8]) -> io::Result<usize> {
        self.0.read(buf)
    }
}

impl SkipRead for GzipBody<'_> {
    fn skip(&mut self, count: u64) -> io::Result<u64> {
        skip_by_reading(&mut self.0, count)
    }
}

/// One zlib stream. Unlike flate2's reader it tells a stream that was cut in its checksum from a whole one.
pub(super) struct ZlibBody<'a> {
    source: Box<dyn SkipRead + 'a>,
    inflate: Decompress,
    buffer: Vec<u8>,
    ready: std::ops::Range<usize>,
    is_done: bool,
}

impl<'a> ZlibBody<'a> {
    /// The inflated content of a zlib stream, or of gzip if its magic is met: MetaImage allows both.
    pub fn or_gzip(mut source: Box<dyn SkipRead + 'a>) -> Result<Box<dyn SkipRead + 'a>, Fault> {
        let mut buffer = vec![0; BUFFER];
        let mut got = 0;
        while got < 2 {
            match source.read(&mut buffer[got..2]).map_err(read_fault)? {
                0 => break,
                n => got += n,
            }
        }
        if got == 2 && buffer[..2] == [0x1f, 0x8b] {
            return Ok(Box::new(GzipBody::new(Box::new(Rewound {
                head: 0x8b1f_u16.to_le_bytes(),
                at: 0,
                source,
            }))));
        }
        Ok(Box::new(Self {
            source,
            inflate: Decompress::new(true),
            buffer,
            ready: 0..got,
            is_done: false,
        }))
    }
}

impl Read for ZlibBody<'_> {
    fn read(&mut self, buf: &mut [u8]) -> io::Result<usize> {
        if buf.is_empty() {
            return Ok(0);
        }
        while !self.is_done {
            if self.ready.is_empty() {
                let n = self.source.read(&mut self.buffer)?;
                if n == 0 {
                    return Err(io::ErrorKind::UnexpectedEof.into());
                }
                self.ready = 0..n;
            }
            let (before_in, before_out) = (self.inflate.total_in(), self.inflate.total_out());
            let input = &self.buffer[self.ready.clone()];
            let status = self.inflate.decompress(input, buf, FlushDecompress::None);
            let status = status.map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e))?;
            let taken = (self.inflate.total_in() - before_in) as usize;
            let given = (self.inflate.total_out() - before_out) as usize;
            self.ready.start += taken;
            self.is_done = status == Status::StreamEnd;
            if given > 0 {
                return Ok(given);
            }
            if taken == 0 && !self.is_done && !self.ready.is_empty() {
                return Err(io::Error::new(io::ErrorKind::InvalidData, "no progress"));
            }
        }
        Ok(0)
    }
}

impl SkipRead for ZlibBody<'_> {
    fn skip(&mut self, count: u64) -> io::Result<u64> {
        skip_by_reading(self, count)
    }
}

/// A source with the two bytes that were looked at before it.
struct Rewound<'a> {
    head: [u8; 2],
    at: usize,
    source: Box<dyn SkipRead + 'a>,
}

impl Read for Rewound<'_> {
    fn read(&mut self, buf: &mut [u8]) -> io::Result<usize> {
        if self.at == self.head.len() {
            return self.source.read(buf);
        }
        let n = (&self.head[self.at..]).read(buf)?;
        self.at += n;
        Ok(n)
    }
}

impl SkipRead for Rewound<'_> {
    fn skip(&mut self, count: u64) -> io::Result<u64> {
        skip_by_reading(self, count)
    }
}
