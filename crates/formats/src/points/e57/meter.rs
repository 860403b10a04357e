//! Bytes on their way to the decoder, counted and stopped.

use std::cell::Cell;
use std::io::{self, Cursor, Read, Seek, SeekFrom};
use std::rc::Rc;

/// The content of a file.
pub(super) struct Metered<'a> {
    content: Cursor<&'a [u8]>,
    meter: Rc<Meter>,
}

/// What was read so far, and what may be.
#[derive(Debug)]
pub(super) struct Meter {
    pub read: Cell<u64>,
    pub quota: Cell<u64>,
}

impl<'a> Metered<'a> {
    /// `content` without a quota.
    pub fn new(content: &'a [u8]) -> (Self, Rc<Meter>) {
        let meter = Rc::new(Meter {
            read: Cell::new(0),
            quota: Cell::new(u64::MAX),
        });
        let content = Cursor::new(content);
        (
            Self {
                content,
                meter: Rc::clone(&meter),
            },
            meter,
        )
    }
}

impl Read for Metered<'_> {
    fn read(&mut self, buf: &mut [u8]) -> io::Result<usize> {
        if self.meter.read.get() > self.meter.quota.get() {
            return Err(io::Error::other("the quota of the decoder is used up"));
        }
        let n = self.content.read(buf)?;
        self.meter.read.set(self.meter.read.get() + n as u64);
        Ok(n)
    }
}

impl Seek for Metered<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.content.seek(to)
    }
}
