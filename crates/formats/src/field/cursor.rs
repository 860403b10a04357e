//! Checked reading of little-endian bytes.

use crate::Fault;

/// Bytes of a chunk, read front to back.
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Name of the chunk, for messages.
    what: &'static str,
}

impl<'a> Cursor<'a> {
    pub fn new(bytes: &'a [u8], what: &'static str) -> Self {
        Self { bytes, at: 0, what }
    }

    pub fn take(&mut self, count: u64) -> Result<&'a [u8], Fault> {
        let left = (self.bytes.len() - self.at) as u64;
        if count > left {
            return Err(Fault::Truncated {
                what: format!("{} at byte {} of it", self.what, self.at),
                needed: count,
                found: left,
            });
        }
        let part = &self.bytes[self.at..self.at + count as usize];
        self.at += count as usize;
        Ok(part)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        Ok(self.take(N as u64)?.try_into().expect("taken with this length"))
    }
    pub fn u8(&mut self) -> Result<u8, Fault> {
        Ok(self.array::<1>()?[0])
    }
    pub fn u32(&mut self) -> Result<u32, Fault> {
        self.array().map(u32::from_le_bytes)
    }
    pub fn f64(&mut self) -> Result<f64, Fault> {
        self.array().map(f64::from_le_bytes)
    }

    /// A text: its length in bytes, then UTF-8.
    pub fn text(&mut self) -> Result<String, Fault> {
        let length = self.u32()?;
        let bytes = self.take(length.into())?;
        String::from_utf8(bytes.to_vec()).map_err(|_| Fault::Damaged {
            what: format!("{} is no UTF-8", self.what),
        })
    }

    /// Refuses bytes that nothing asked for.
    pub fn end(self) -> Result<(), Fault> {
        match self.bytes.len() - self.at {
            0 => Ok(()),
            n => Err(Fault::Damaged {
                what: format!("{} has {n} bytes too many", self.what),
            }),
        }
    }
}
