//! An append-only file of records, each with its checksums.
//!
//! A record is on the disk before [`Journal::append`] returns. What a crash leaves of the last one is told from a whole
//! one by its length and checksum, and goes with the next append.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use formats::{Fault, atomic};

use crate::DocumentError;
use crate::entry::Kind;
use crate::error::{damaged, fault, io_error};

/// First bytes of every document. Like those of PNG, they show when a transfer has mangled line ends.
const MAGIC: [u8; 8] = *b"\x89ICDOC\r\n";
/// Version that is written, and the newest that is read.
const VERSION: u32 = 1;
/// Magic and version.
const START: u64 = 12;
/// Bytes in front of a record's two parts: kind, their lengths, their checksums, checksum of all these.
const HEAD: usize = 32;

/// Whether a file begins as documents do. False if it cannot be read.
pub fn is_document(path: &Path) -> bool {
    let mut start = [0; MAGIC.len()];
    path.is_file()
        && File::open(path)
            .and_then(|mut f| f.read_exact(&mut start))
            .is_ok_and(|()| start == MAGIC)
}

/// Where a record is. Its first part tells what it is, its second holds the bulk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Record {
    pub kind: Kind,
    /// Its first byte in the file.
    at: u64,
    lengths: [u64; 2],
    checksums: [u32; 2],
}

/// The two parts of a record.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Parts {
    /// JSON.
    pub text: Vec<u8>,
    /// Fields and differences.
    pub bulk: Vec<u8>,
}

impl Record {
    /// The record of these parts that begins at byte `at`.
    fn of(kind: Kind, parts: &Parts, at: u64) -> Self {
        let both = [&parts.text, &parts.bulk];
        Self {
            kind,
            at,
            lengths: both.map(|part| part.len() as u64),
            checksums: both.map(|part| crc32fast::hash(part)),
        }
    }

    /// Bytes that it takes; none if there are no files that long.
    fn checked_size(&self) -> Option<u64> {
        self.lengths[0]
            .checked_add(self.lengths[1])?
            .checked_add(HEAD as u64)
    }

    /// Bytes that it takes.
    pub fn size(&self) -> u64 {
        self.checked_size().expect("a record that is there fits a file")
    }

    fn head(&self) -> [u8; HEAD] {
        let mut head = [0; HEAD];
        head[..4].copy_from_slice(&(self.kind as u32).to_le_bytes());
        head[4..12].copy_from_slice(&self.lengths[0].to_le_bytes());
        head[12..20].copy_from_slice(&self.lengths[1].to_le_bytes());
        head[20..24].copy_from_slice(&self.checksums[0].to_le_bytes());
        head[24..28].copy_from_slice(&self.checksums[1].to_le_bytes());
        let crc = crc32fast::hash(&head[..28]);
        head[28..].copy_from_slice(&crc.to_le_bytes());
        head
    }

    /// The record of a head at byte `at`, if it is one.
    fn parsed(head: &[u8; HEAD], at: u64) -> Option<Self> {
        let u32_at = |i: usize| u32::from_le_bytes(head[i..i + 4].try_into().expect("4 bytes"));
        let u64_at = |i: usize| u64::from_le_bytes(head[i..i + 8].try_into().expect("8 bytes"));
        if u32_at(28) != crc32fast::hash(&head[..28]) {
            return None;
        }
        Some(Self {
            kind: Kind::from_code(u32_at(0))?,
            at,
            lengths: [u64_at(4), u64_at(12)],
            checksums: [u32_at(20), u32_at(24)],
        })
    }
}

/// A journal that nobody else has open.
#[derive(Debug)]
pub(crate) struct Journal {
    path: PathBuf,
    file: File,
    /// Whether records can be appended.
    is_writable: bool,
    /// Where the next record goes.
    end: u64,
}

/// What follows the last whole record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Tail {
    /// Bytes that no record holds.
    pub bytes: u64,
    /// Whether they can be what a crash leaves of one record; otherwise more may be lost.
    pub is_torn: bool,
}

impl Journal {
    /// A new file of these records. It appears whole or not at all.
    pub fn create(
        path: &Path,
        records: impl IntoIterator<Item = Result<(Kind, Parts), DocumentError>>,
    ) -> Result<(), DocumentError> {
        let mut fault = None;
        let written = atomic::replace(path, |out| {
            out.write_all(&MAGIC)?;
            out.write_all(&VERSION.to_le_bytes())?;
            for record in records {
                let (kind, parts) = match record {
                    Ok(record) => record,
                    Err(error) => {
                        fault = Some(error);
                        return Err(io::Error::other("a record cannot be read"));
                    }
                };
                out.write_all(&Record::of(kind, &parts, 0).head())?;
                out.write_all(&parts.text)?;
                out.write_all(&parts.bulk)?;
            }
            Ok(())
        });
        match fault {
            Some(error) => Err(error),
            None => Ok(written?),
        }
    }

    /// Opens a file, and finds its records.
    pub fn open(path: &Path) -> Result<(Self, Vec<Record>, Tail), DocumentError> {
        let opened = OpenOptions::new().read(true).write(true).open(path);
        // What may only be read is read.
        let (opened, is_writable) = match opened.as_ref().map_err(io::Error::kind) {
            Err(io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem) => {
                (File::open(path), false)
            }
            _ => (opened, true),
        };
        let mut file = opened.map_err(io_error(path, "opening"))?;
        lock(&file, path)?;
        let length = file.metadata().map_err(io_error(path, "reading"))?.len();
        let reading = || io_error(path, "reading");
        let mut start = Vec::new();
        (&mut file)
            .take(START)
            .read_to_end(&mut start)
            .map_err(reading())?;
        if !start.starts_with(&MAGIC) || (start.len() as u64) < START {
            return Err(fault(
                path,
                Fault::Value {
                    what: "the start of the file",
                    value: "none of a document's".into(),
                    remedy: "name a document of this program",
                },
            ));
        }
        let version = u32::from_le_bytes(start[8..].try_into().expect("4 bytes"));
        if version != VERSION {
            return Err(fault(
                path,
                Fault::Value {
                    what: "the version of the document",
                    value: version.to_string(),
                    remedy: "known is 1; a newer version of the program may read it",
                },
            ));
        }
        let mut journal = Self {
            path: path.into(),
            file,
            is_writable,
            end: START,
        };
        let mut records = Vec::new();
        while let Some(record) = journal.next(length).map_err(reading())? {
            journal.end += record.size();
            records.push(record);
        }
        let mut tail = Tail {
            bytes: length - journal.end,
            is_torn: true,
        };
        if tail.bytes == 0 {
            // A power cut may leave the length of the last record without its bytes.
            if let Some(last) = records.last().copied()
                && journal.read(&last).is_err()
            {
                records.pop();
                journal.end = last.at;
                tail.bytes = length - journal.end;
            }
        } else {
            tail.is_torn = journal.is_torn().map_err(reading())?;
        }
        Ok((journal, records, tail))
    }

    /// The record at the end, if a whole one follows.
    fn next(&mut self, length: u64) -> io::Result<Option<Record>> {
        let Some(head) = self.head_at_end()? else {
            return Ok(None);
        };
        let record = Record::parsed(&head, self.end);
        Ok(record.filter(|r| r.checked_size().is_some_and(|size| size <= length - self.end)))
    }

    fn head_at_end(&mut self) -> io::Result<Option<[u8; HEAD]>> {
        self.file.seek(SeekFrom::Start(self.end))?;
        let mut head = Vec::with_capacity(HEAD);
        (&mut self.file).take(HEAD as u64).read_to_end(&mut head)?;
        Ok(head.try_into().ok())
    }

    /// Whether what follows the last record is the start of one: a head that is cut, or a whole one whose parts are, or
    /// nothing but zeros, which a power cut leaves of bytes that were not written yet.
    fn is_torn(&mut self) -> io::Result<bool> {
        let Some(head) = self.head_at_end()? else {
            return Ok(true);
        };
        Ok(head == [0; HEAD] || Record::parsed(&head, self.end).is_some())
    }

    /// What a record tells.
    pub fn text(&mut self, record: &Record) -> Result<Vec<u8>, DocumentError> {
        self.part(record, 0)
    }

    /// All of a record.
    pub fn read(&mut self, record: &Record) -> Result<Parts, DocumentError> {
        Ok(Parts {
            text: self.part(record, 0)?,
            bulk: self.part(record, 1)?,
        })
    }

    fn part(&mut self, record: &Record, n: usize) -> Result<Vec<u8>, DocumentError> {
        let start = record.at + HEAD as u64 + if n == 0 { 0 } else { record.lengths[0] };
        let mut part = Vec::new();
        let reading = || io_error(&self.path, "reading");
        self.file.seek(SeekFrom::Start(start)).map_err(reading())?;
        (&mut self.file)
            .take(record.lengths[n])
            .read_to_end(&mut part)
            .map_err(reading())?;
        if part.len() as u64 == record.lengths[n] && crc32fast::hash(&part) == record.checksums[n] {
            return Ok(part);
        }
        let at = record.at;
        Err(damaged(
            &self.path,
            format!("the record at byte {at} does not fit its checksum"),
        ))
    }

    /// Appends a record. When it fails, nothing is appended.
    pub fn append(&mut self, kind: Kind, parts: &Parts) -> Result<Record, DocumentError> {
        self.writable()?;
        let record = Record::of(kind, parts, self.end);
        let start = [&record.head()[..], &parts.text].concat();
        let mut write = || {
            self.file.set_len(self.end)?;
            self.file.seek(SeekFrom::Start(self.end))?;
            self.file.write_all(&start)?;
            self.file.write_all(&parts.bulk)?;
            self.file.sync_data()
        };
        if let Err(source) = write() {
            // Should this fail too, the next append does it, or the next opening.
            let _ = self.file.set_len(self.end);
            return Err(io_error(&self.path, "writing")(source));
        }
        self.end += record.size();
        Ok(record)
    }

    /// Whether records can be appended.
    ///
    /// # Errors
    /// If the file may only be read.
    pub fn writable(&self) -> Result<(), DocumentError> {
        match self.is_writable {
            true => Ok(()),
            false => Err(io_error(&self.path, "writing")(
                io::ErrorKind::PermissionDenied.into(),
            )),
        }
    }

    /// Takes a record for the end: it and all behind it go with the next append.
    pub fn cut(&mut self, record: &Record) {
        self.end = record.at;
    }

    /// Copies the whole file, with what no record holds.
    pub fn copy(&mut self, to: &Path) -> Result<(), DocumentError> {
        self.file
            .seek(SeekFrom::Start(0))
            .map_err(io_error(&self.path, "reading"))?;
        let mut file = &self.file;
        Ok(atomic::replace(to, |out| io::copy(&mut file, out).map(drop))?)
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes of all records.
    pub fn size(&self) -> u64 {
        self.end
    }
}

/// Takes a file for this opening alone. Waits a little for whoever is just closing it: a child that another thread starts
/// holds it until it runs its own program.
fn lock(file: &File, path: &Path) -> Result<(), DocumentError> {
    for patience in (0..20).rev() {
        match file.try_lock() {
            Ok(()) => return Ok(()),
            Err(TryLockError::WouldBlock) if patience > 0 => std::thread::sleep(Duration::from_millis(10)),
            Err(TryLockError::WouldBlock) => break,
            Err(TryLockError::Error(source)) => return Err(io_error(path, "locking")(source)),
        }
    }
    Err(DocumentError::InUse(path.into()))
}
