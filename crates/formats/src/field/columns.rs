//! The payload of a chunk in columns that grow side by side, each in a nameless file beside the output.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, Write};
use std::path::Path;

use super::chunk::{self, Kind};

pub(super) struct Columns {
    files: Vec<BufWriter<File>>,
    length: u64,
}

impl Columns {
    pub fn new(directory: &Path, count: usize) -> io::Result<Self> {
        let files = (0..count).map(|_| Ok(BufWriter::new(nameless(directory)?)));
        Ok(Self {
            files: files.collect::<io::Result<_>>()?,
            length: 0,
        })
    }

    /// Appends to a column.
    #[inline]
    pub fn put(&mut self, column: usize, bytes: &[u8]) -> io::Result<()> {
        self.length += bytes.len() as u64;
        self.files[column].write_all(bytes)
    }

    /// Writes the chunk: `head`, then one column after the other.
    pub fn write(self, out: &mut dyn Write, directory: &Path, kind: Kind, head: &[u8]) -> io::Result<()> {
        let files = self.files.into_iter().map(|f| Ok(f.into_inner()?));
        let files = files.collect::<io::Result<Vec<File>>>()?;
        let mut raw = || -> io::Result<Box<dyn Read + '_>> {
            let mut all: Box<dyn Read> = Box::new(head);
            for mut file in &files {
                file.rewind()?;
                all = Box::new(all.chain(BufReader::with_capacity(1 << 16, file)));
            }
            Ok(all)
        };
        let length = head.len() as u64 + self.length;
        chunk::write_stream(out, kind, length, &mut raw, &mut nameless(directory)?)
    }
}

/// A file that goes when it is closed.
fn nameless(directory: &Path) -> io::Result<File> {
    tempfile::tempfile_in(directory).or_else(|_| tempfile::tempfile())
}
