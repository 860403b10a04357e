//! Voxels as numbers in text, and bytes as hexadecimal digits.

use std::io::{self, Read};

use crate::Fault;
use crate::error::{Place, excerpt};
use crate::input::{SkipRead, read_fault, skip_by_reading};
use crate::volumes::slices::SliceSource;
use crate::volumes::volume::VolumeHeader;
use crate::volumes::voxel::VoxelType;

const BUFFER: usize = 1 << 16;
/// Longest number: all digits of a double and a few more.
const LONGEST: usize = 400;

/// Numbers between blanks or commas.
pub(super) struct TextSlices<'a> {
    header: VolumeHeader,
    notes: Vec<String>,
    source: Box<dyn SkipRead + 'a>,
    buffer: Vec<u8>,
    ready: std::ops::Range<usize>,
    word: Vec<u8>,
    given: u64,
}

impl<'a> TextSlices<'a> {
    pub fn new(header: VolumeHeader, notes: Vec<String>, source: Box<dyn SkipRead + 'a>) -> Self {
        Self {
            header,
            notes,
            source,
            buffer: Vec::new(),
            ready: 0..0,
            word: Vec::with_capacity(LONGEST),
            given: 0,
        }
    }

    /// The next number's text in `word`; false at the end of the text.
    fn next_word(&mut self) -> Result<bool, Fault> {
        self.word.clear();
        loop {
            if self.ready.is_empty() {
                self.buffer.resize(BUFFER, 0);
                let n = self.source.read(&mut self.buffer).map_err(read_fault)?;
                self.ready = 0..n;
                if n == 0 {
                    return Ok(!self.word.is_empty());
                }
            }
            for i in self.ready.clone() {
                let b = self.buffer[i];
                self.ready.start = i + 1;
                if !(b.is_ascii_whitespace() || b == b',') {
                    self.word.push(b);
                    if self.word.len() >= LONGEST {
                        return Err(self.bad());
                    }
                } else if !self.word.is_empty() {
                    return Ok(true);
                }
            }
        }
    }

    fn next_value(&mut self) -> Result<f32, Fault> {
        if !self.next_word()? {
            return Err(Fault::Truncated {
                what: format!("text of {} numbers", self.header.voxel_count()),
                needed: self.header.voxel_count() as u64,
                found: self.given,
            });
        }
        let value = self.parse().ok_or_else(|| self.bad())?;
        self.given += 1;
        Ok(match self.header.rescale {
            None => value as f32,
            Some([slope, intercept]) => (value * slope + intercept) as f32,
        })
    }

    /// The word as a number of the voxels' type.
    fn parse(&self) -> Option<f64> {
        let text = std::str::from_utf8(&self.word).ok()?;
        macro_rules! whole {
            ($t:ty) => {
                text.parse::<$t>().ok().map(|v| v as f64)
            };
        }
        match self.header.stored {
            VoxelType::U8 => whole!(u8),
            VoxelType::I8 => whole!(i8),
            VoxelType::U16 => whole!(u16),
            VoxelType::I16 => whole!(i16),
            VoxelType::U32 => whole!(u32),
            VoxelType::I32 => whole!(i32),
            VoxelType::U64 => whole!(u64),
            VoxelType::I64 => whole!(i64),
            VoxelType::F32 => fast_float2::parse::<f32, _>(text).ok().map(f64::from),
            VoxelType::F64 => fast_float2::parse(text).ok(),
        }
    }

    fn bad(&self) -> Fault {
        Fault::Syntax {
            place: Place::Row("voxel", self.given),
            what: format!("{} is no {}", excerpt(&self.word), self.header.stored),
            remedy: "correct the number or the type in the header",
        }
    }
}

impl SliceSource for TextSlices<'_> {
    fn header(&self) -> &VolumeHeader {
        &self.header
    }

    fn notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    fn next_slice(&mut self, out: &mut [f32]) -> Result<(), Fault> {
        for value in out {
            *value = self.next_value()?;
        }
        Ok(())
    }

    fn skip_slice(&mut self) -> Result<(), Fault> {
        for _ in 0..self.header.dims[0] * self.header.dims[1] {
            self.next_value()?;
        }
        Ok(())
    }

    fn working_bytes(&self) -> u64 {
        (BUFFER + LONGEST) as u64
    }

    fn finish(&mut self) -> Result<(), Fault> {
        if self.next_word()? {
            return Err(Fault::Syntax {
                place: Place::Row("voxel", self.given),
                what: format!("{} stands after the last voxel", excerpt(&self.word)),
                remedy: "the dimensions and the numbers do not agree; correct the header",
            });
        }
        Ok(())
    }
}

/// Bytes of hexadecimal digits, two each, blanks between them.
pub(super) struct HexBody<'a> {
    source: Box<dyn SkipRead + 'a>,
    buffer: Vec<u8>,
    ready: std::ops::Range<usize>,
    /// First digit of a byte whose second one is still to come.
    half: Option<u8>,
}

impl<'a> HexBody<'a> {
    pub fn new(source: Box<dyn SkipRead + 'a>) -> Self {
        Self {
            source,
            buffer: vec![0; BUFFER],
            ready: 0..0,
            half: None,
        }
    }
}

impl Read for HexBody<'_> {
    fn read(&mut self, buf: &mut [u8]) -> io::Result<usize> {
        let mut filled = 0;
        while filled < buf.len() {
            if self.ready.is_empty() {
                if filled > 0 {
                    break;
                }
                let n = self.source.read(&mut self.buffer)?;
                if n == 0 {
                    return match self.half {
                        Some(_) => Err(io::ErrorKind::UnexpectedEof.into()),
                        None => Ok(0),
                    };
                }
                self.ready = 0..n;
            }
            let b = self.buffer[self.ready.start];
            self.ready.start += 1;
            let digit = match b {
                b'0'..=b'9' => b - b'0',
                b'a'..=b'f' => b - b'a' + 10,
                b'A'..=b'F' => b - b'A' + 10,
                _ if b.is_ascii_whitespace() => continue,
                _ => {
                    let what = format!("{} is no hexadecimal digit", excerpt(&[b]));
                    return Err(io::Error::other(what));
                }
            };
            match self.half.take() {
                None => self.half = Some(digit),
                Some(high) => {
                    buf[filled] = high << 4 | digit;
                    filled += 1;
                }
            }
        }
        Ok(filled)
    }
}

impl SkipRead for HexBody<'_> {
    fn skip(&mut self, count: u64) -> io::Result<u64> {
        skip_by_reading(self, count)
    }
}
