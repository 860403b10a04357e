//! A document: a state, and the journal that leads to it.

use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use formats::ReadLimits;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::entry::{EditCounts, EditHead, EditInfo, Kind, MoveHead, SnapshotHead, hex};
use crate::error::damaged;
use crate::journal::{Journal, Parts, Record, Tail};
use crate::layout::Layout;
use crate::records::{followed, json, read_text, snapshot};
use crate::{Change, DocumentError, State};

/// How a document is kept.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Bytes that the file may grow to before the oldest edits are forgotten. What the objects take themselves, and what
    /// is undone, is kept in any case.
    pub quota: u64,
    /// What reading may take.
    pub limits: ReadLimits,
}

impl Default for Options {
    /// A gibibyte.
    fn default() -> Self {
        Self {
            quota: 1 << 30,
            limits: ReadLimits::default(),
        }
    }
}

/// Objects that are edited, and a file that has every edit before it shows. See the crate's documentation.
#[derive(Debug)]
pub struct Document {
    path: PathBuf,
    /// None once another program has taken the file, which can happen only while it is shortened.
    journal: Option<Journal>,
    options: Options,
    state: State,
    layout: Layout,
    /// Set where the file goes on beyond what could be followed: it is copied before it is written to.
    is_partial: bool,
    trouble: Option<DocumentError>,
}

/// What opening a document found.
#[derive(Debug)]
pub struct Opened {
    /// The document.
    pub document: Document,
    /// What of the file could not be read, if anything.
    pub lost: Option<Lost>,
}

/// What of a document could not be read. All before it is there.
#[derive(Clone, Debug, PartialEq)]
pub struct Lost {
    /// Bytes at the end of the file that cannot be followed.
    pub bytes: u64,
    /// Whether it is no more than what a crash leaves of the edit in hand. Anything else is copied beside the document,
    /// under its name with `.damaged`, before the document is next written to.
    pub is_torn: bool,
    /// What was met.
    pub why: String,
}

impl Document {
    /// A new document.
    ///
    /// # Errors
    /// [`DocumentError::Exists`]; I/O.
    pub fn create(path: &Path, state: State, options: Options) -> Result<Self, DocumentError> {
        if path.symlink_metadata().is_ok() {
            return Err(DocumentError::Exists(path.into()));
        }
        state.check_all()?;
        Journal::create(
            path,
            [snapshot(path, &state, 0).map(|parts| (Kind::Snapshot, parts))],
        )?;
        Ok(Self::open(path, options)?.document)
    }

    /// Opens a document and takes it for itself until it is dropped.
    ///
    /// # Errors
    /// [`DocumentError::InUse`]; [`DocumentError::File`] for a file that is no document, is newer than this program, has no
    /// snapshot that can be read, or is larger than the limits allow.
    pub fn open(path: &Path, options: Options) -> Result<Opened, DocumentError> {
        let (mut journal, records, mut tail) = Journal::open(path)?;
        let length = journal.size() + tail.bytes;
        let (mut layout, mut trouble) = Layout::read(&mut journal, &records)?;
        let (state, reached, on_the_way) = layout.reach(&mut journal, &options.limits)?;
        if reached < layout.done {
            // All before this edit leads to where it was made.
            journal.cut(&layout.edits[reached]);
            layout.forget_after(reached);
            trouble = on_the_way;
        }
        if trouble.is_some() {
            tail = Tail {
                bytes: length - journal.size(),
                is_torn: false,
            };
        }
        let lost = (tail.bytes > 0).then(|| Lost {
            bytes: tail.bytes,
            is_torn: tail.is_torn,
            why: trouble.map_or("the last record is not whole".into(), |error| error.to_string()),
        });
        let document = Self {
            path: path.into(),
            is_partial: lost.as_ref().is_some_and(|lost| !lost.is_torn),
            journal: Some(journal),
            options,
            state,
            layout,
            trouble: None,
        };
        Ok(Opened { document, lost })
    }

    /// All objects as they are.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Where the document is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Tells before hours of work whether edits can be kept.
    ///
    /// # Errors
    /// [`DocumentError::File`] for a file that may only be read.
    pub fn writable(&self) -> Result<(), DocumentError> {
        self.journal.as_ref().map_or(Ok(()), Journal::writable)
    }

    /// Bytes of the file.
    pub fn size(&self) -> u64 {
        self.journal.as_ref().map_or(0, Journal::size)
    }

    /// How many edits there are.
    ///
    /// # Errors
    /// Of reading.
    pub fn counts(&mut self) -> Result<EditCounts, DocumentError> {
        let (_, first) = self.layout.snapshots[0];
        let forgotten = self.read_text::<SnapshotHead>(&first)?.forgotten;
        Ok(EditCounts {
            done: self.layout.done,
            undone: self.layout.edits.len() - self.layout.done,
            forgotten,
        })
    }

    /// What is told of each edit, the oldest first; the first [`EditCounts::done`] of them are done.
    ///
    /// # Errors
    /// Of reading.
    pub fn history(&mut self) -> Result<Vec<EditInfo>, DocumentError> {
        let edits = self.layout.edits.clone();
        edits
            .iter()
            .map(|edit| Ok(self.read_text::<EditHead>(edit)?.info))
            .collect()
    }

    /// What was asked for by edit `n` of the history.
    ///
    /// # Errors
    /// Of reading.
    ///
    /// # Panics
    /// If there are not that many.
    pub fn command(&mut self, n: usize) -> Result<Value, DocumentError> {
        let edit = self.layout.edits[n];
        Ok(self.read_text::<EditHead>(&edit)?.command)
    }

    /// What was asked for by all edits that are done, one a line, as [`Command::of_script`](crate::Command::of_script) reads it: done on
    /// [`first_state`](Self::first_state) it leads to the state that there is now, to the bit.
    ///
    /// # Errors
    /// Of reading.
    pub fn script(&mut self) -> Result<String, DocumentError> {
        let mut lines = String::new();
        for n in 0..self.counts()?.done {
            lines.push_str(&self.command(n)?.to_string());
            lines.push('\n');
        }
        Ok(lines)
    }

    /// The objects before the first edit of the history.
    ///
    /// # Errors
    /// Of reading.
    pub fn first_state(&mut self) -> Result<State, DocumentError> {
        self.state_at(0)
    }

    /// Why the journal could not be shortened after the last edit, if so. The edit itself is safe.
    pub fn trouble(&self) -> Option<&DocumentError> {
        self.trouble.as_ref()
    }

    /// Goes over to another state: what differs is on the disk before this returns. Edits that were undone are no more.
    /// False if nothing differs; then nothing is done.
    ///
    /// # Errors
    /// Of writing; the document is as before.
    pub fn commit(&mut self, title: &str, command: Value, state: State) -> Result<bool, DocumentError> {
        let changes = Change::between(&self.state, &state);
        if changes.is_empty() {
            return Ok(false);
        }
        let mut bulk = Vec::new();
        let heads = changes.iter().map(|change| change.write(&self.path, &mut bulk));
        let changes = heads.collect::<Result<_, _>>()?;
        let head = EditHead {
            info: EditInfo {
                title: title.into(),
                time: SystemTime::now()
                    .duration_since(UNIX_EPOCH)
                    .map_or(0, |t| t.as_secs()),
                sha256: hex(state.sha256()),
            },
            command,
            changes,
        };
        let record = self.append(
            Kind::Edit,
            &Parts {
                text: json(&head),
                bulk,
            },
        )?;
        self.layout.forget_after(self.layout.done);
        self.layout.edits.push(record);
        self.layout.done += 1;
        self.state = state;
        self.trouble = self.tidy().err();
        Ok(true)
    }

    /// Undoes up to `count` edits; tells how many.
    ///
    /// # Errors
    /// Of reading and writing; the document is as before.
    pub fn undo(&mut self, count: usize) -> Result<usize, DocumentError> {
        let count = count.min(self.layout.done);
        self.go_to(self.layout.done - count)?;
        Ok(count)
    }

    /// Does up to `count` edits again that were undone; tells how many.
    ///
    /// # Errors
    /// Of reading and writing; the document is as before.
    pub fn redo(&mut self, count: usize) -> Result<usize, DocumentError> {
        let count = count.min(self.layout.edits.len() - self.layout.done);
        self.go_to(self.layout.done + count)?;
        Ok(count)
    }

    fn go_to(&mut self, done: usize) -> Result<(), DocumentError> {
        if done == self.layout.done {
            return Ok(());
        }
        let state = self.state_at(done)?;
        self.append(
            Kind::Move,
            &Parts {
                text: json(&MoveHead { done: done as u64 }),
                bulk: Vec::new(),
            },
        )?;
        self.layout.done = done;
        self.state = state;
        Ok(())
    }

    /// The state with that many edits done, by way of the changes from the one at hand.
    pub(crate) fn state_at(&mut self, done: usize) -> Result<State, DocumentError> {
        let journal = self
            .journal
            .as_mut()
            .ok_or_else(|| DocumentError::InUse(self.path.clone()))?;
        let (mut state, limits) = (self.state.clone(), &self.options.limits);
        for edit in self.layout.edits[done.min(self.layout.done)..self.layout.done]
            .iter()
            .rev()
        {
            state = followed(journal, edit, &state, false, limits)?;
        }
        for edit in &self.layout.edits[self.layout.done..done.max(self.layout.done)] {
            state = followed(journal, edit, &state, true, limits)?;
        }
        let expected = match done.checked_sub(1) {
            Some(last) => {
                read_text::<EditHead>(journal, &self.layout.edits[last])?
                    .info
                    .sha256
            }
            None => read_text::<SnapshotHead>(journal, &self.layout.snapshots[0].1)?.sha256,
        };
        match hex(state.sha256()) == expected {
            true => Ok(state),
            false => Err(damaged(
                &self.path,
                "the edits do not lead back to where they came from",
            )),
        }
    }

    fn read_text<T: DeserializeOwned>(&mut self, record: &Record) -> Result<T, DocumentError> {
        let journal = self
            .journal
            .as_mut()
            .ok_or_else(|| DocumentError::InUse(self.path.clone()))?;
        read_text(journal, record)
    }

    fn append(&mut self, kind: Kind, parts: &Parts) -> Result<Record, DocumentError> {
        let journal = self
            .journal
            .as_mut()
            .ok_or_else(|| DocumentError::InUse(self.path.clone()))?;
        if self.is_partial {
            let copy = free_name(&self.path);
            journal.copy(&copy)?;
            self.is_partial = false;
        }
        journal.append(kind, parts)
    }

    /// Writes a snapshot where the way from the last one has become longer than a snapshot, and forgets the oldest edits
    /// where the file has outgrown its quota.
    fn tidy(&mut self) -> Result<(), DocumentError> {
        let &(at, last) = self.layout.snapshots.last().expect("a document begins with one");
        let way: u64 = self.layout.edits[at..].iter().map(Record::size).sum();
        if way > last.size().max(SHORT) {
            let parts = snapshot(&self.path, &self.state, 0)?;
            let record = self.append(Kind::Snapshot, &parts)?;
            self.layout.snapshots.push((self.layout.done, record));
        }
        match self.size() > self.options.quota {
            true => self.shorten(),
            false => Ok(()),
        }
    }

    /// Forgets the oldest edits, so that the file takes about half its quota. The last one done stays, however large.
    fn shorten(&mut self) -> Result<(), DocumentError> {
        let object_bytes = self
            .layout
            .snapshots
            .last()
            .map_or(0, |(_, record)| record.size());
        // Objects beyond the quota leave room for some edits all the same.
        let room = (self.options.quota / 2)
            .saturating_sub(object_bytes)
            .max(self.options.quota / 4);
        let mut kept = 0;
        let fits = |record: &&Record| {
            kept += record.size();
            kept <= room
        };
        let first = self.layout.edits.len() - self.layout.edits.iter().rev().take_while(fits).count();
        let first = first.min(self.layout.done.saturating_sub(1));
        let left: u64 = self.layout.edits[first..].iter().map(Record::size).sum::<u64>() + object_bytes;
        // What little it gains is not worth a new file.
        if left > self.size() / 4 * 3 {
            return Ok(());
        }
        let forgotten = self.counts()?.forgotten + first as u64;
        let base = self.state_at(first)?;
        let mut journal = self
            .journal
            .take()
            .ok_or_else(|| DocumentError::InUse(self.path.clone()))?;
        let start = snapshot(&self.path, &base, forgotten).map(|parts| (Kind::Snapshot, parts));
        let edits = &self.layout.edits[first..];
        let done = (self.layout.done - first) as u64;
        let end = Parts {
            text: json(&MoveHead { done }),
            bulk: Vec::new(),
        };
        let written = Journal::create(
            &self.path,
            std::iter::once(start)
                .chain(edits.iter().map(|edit| Ok((Kind::Edit, journal.read(edit)?))))
                .chain([Ok((Kind::Move, end))]),
        );
        if let Err(error) = written {
            self.journal = Some(journal);
            return Err(error);
        }
        let (mut journal, records, _) = Journal::open(&self.path)?;
        (self.layout, _) = Layout::read(&mut journal, &records)?;
        self.journal = Some(journal);
        Ok(())
    }
}

/// Bytes of edits that need no snapshot, however small the objects are.
const SHORT: u64 = 1 << 20;

/// A name for the copy of a damaged document that no file has.
fn free_name(path: &Path) -> PathBuf {
    let named = |end: String| {
        let mut name = path.as_os_str().to_os_string();
        name.push(end);
        PathBuf::from(name)
    };
    let numbered = (2..).map(|n| named(format!(".damaged-{n}")));
    std::iter::once(named(".damaged".into()))
        .chain(numbered)
        .find(|name| name.symlink_metadata().is_err())
        .expect("numbers do not end")
}
