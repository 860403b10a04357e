//! What a batch has done: one JSON object a line, each written when its files have their names. A line cut off by a kill
//! is dropped when the file is read again, and its input is done again. What a line tells is believed only if the files
//! that it names have the content that it names, so that nothing has to be waited for until it is on the disk.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::super::failure::{Failure, OrFail, Outcome};
use super::shard::Shard;

/// What wrote it; a result of another version is no result of this one.
pub const PROGRAM: &str = concat!("isoclay ", env!("CARGO_PKG_VERSION"));
/// Shape of the lines.
const FORMAT: u32 = 1;

/// A run of a batch, before the lines of its inputs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// What wrote it.
    pub program: String,
    /// Shape of the lines.
    pub format: u32,
    /// Options that the results depend on.
    pub parameters: Map<String, Value>,
    /// Which share of the inputs it is; none is all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<Shard>,
    /// Inputs of all shards.
    pub total: usize,
    /// Inputs of this one: names of their outputs, and where they are, in order.
    pub inputs: Vec<(String, String)>,
}

impl Run {
    /// A run of this program.
    pub fn new(
        parameters: Map<String, Value>,
        shard: Option<Shard>,
        total: usize,
        inputs: Vec<(String, String)>,
    ) -> Self {
        Self {
            program: PROGRAM.into(),
            format: FORMAT,
            parameters,
            shard,
            total,
            inputs,
        }
    }
}

/// How an input ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// All that was asked for is there.
    Done,
    /// It is not; [`Entry::failure`] says why.
    Failed,
}

/// Why an input failed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reason {
    /// At what: reading, fit, mesh.
    pub stage: String,
    /// What the process said with its end; none if it was ended.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exit_code: Option<i32>,
    /// Signal that ended it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub signal: Option<i32>,
    /// For people, with what would help.
    pub message: String,
}

/// A file that was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Written {
    /// Where, below the directory of the batch.
    pub path: String,
    /// Its size.
    pub bytes: u64,
    /// Its content.
    pub sha256: String,
}

/// An input and what became of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Where it is, as far as that is text.
    pub input: String,
    /// Name of its outputs, one for each input.
    pub name: String,
    /// How it ended.
    pub state: State,
    /// Cloud, mesh or volume, and the format.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<String>,
    /// Bytes that were read.
    pub input_bytes: u64,
    /// Content of the input.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub input_sha256: Option<String>,
    /// Content, options and program in one: a result with the same key is the same result.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub key: Option<String>,
    /// Why it failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<Reason>,
    /// What `isoclay fit --json` said.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    pub fit: Map<String, Value>,
    /// What `isoclay mesh --json` said.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    pub mesh: Map<String, Value>,
    /// Files: field, mesh, picture, errors.
    #[serde(default)]
    pub outputs: BTreeMap<String, Written>,
    /// Wall seconds for all of it.
    pub seconds: f64,
    /// Largest resident size of its processes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_rss_bytes: Option<u64>,
    /// Repairs and doubts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

/// A line of the file.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(untagged)]
enum Line {
    Run { run: Box<Run> },
    Entry(Box<Entry>),
}

/// A manifest that was read.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// The last run.
    pub run: Option<Run>,
    /// The last entry of each input, by the names of outputs.
    pub entries: BTreeMap<String, Entry>,
    /// Bytes up to the last whole line.
    whole: u64,
}

impl Found {
    /// Reads a manifest. Lines that are cut off or spoilt are passed over.
    ///
    /// # Errors
    /// Those of the system; a manifest of a later program.
    pub fn read(path: &Path) -> Outcome<Self> {
        let bytes =
            fs::read(path).map_err(|e| Failure::input(format!("{}: {e}; check the path", path.display())))?;
        Self::of(&bytes, path)
    }

    fn of(bytes: &[u8], path: &Path) -> Outcome<Self> {
        let mut found = Self::default();
        for line in bytes.split_inclusive(|b| *b == b'\n') {
            if line.last() != Some(&b'\n') {
                break;
            }
            found.whole += line.len() as u64;
            match serde_json::from_slice(line) {
                Ok(Line::Run { run }) if run.format > FORMAT => {
                    return Err(Failure::input(format!(
                        "{}: was written by {}, whose manifests this program does not know; use that version or another \
                         directory",
                        path.display(),
                        run.program
                    )));
                }
                Ok(Line::Run { run }) => found.run = Some(*run),
                Ok(Line::Entry(entry)) => drop(found.entries.insert(entry.name.clone(), *entry)),
                Err(_) => {}
            }
        }
        Ok(found)
    }
}

/// A manifest that is being written.
pub struct Manifest {
    path: PathBuf,
    file: File,
}

impl Manifest {
    /// Opens a manifest, or a new one, for this process alone; tells what it holds.
    ///
    /// # Errors
    /// Exit code 4 if another process has it.
    pub fn open(path: &Path) -> Outcome<(Self, Found)> {
        let cannot = |e: io::Error| cannot(path, &e);
        let mut file = loop {
            let options = OpenOptions::new().read(true).append(true).create(true).clone();
            let file = options.open(path).map_err(cannot)?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    return Err(Failure::limit(format!(
                        "{}: another batch is at work here; wait for it, or name another directory by -o",
                        path.display()
                    )));
                }
                Err(TryLockError::Error(e)) => return Err(cannot(e)),
            }
            // Its holder may just have replaced it.
            let here = path.metadata().map_err(cannot)?;
            let own = file.metadata().map_err(cannot)?;
            if (here.dev(), here.ino()) == (own.dev(), own.ino()) {
                break file;
            }
        };
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(cannot)?;
        let manifest = Self {
            path: path.into(),
            file,
        };
        Ok((manifest, Found::of(&bytes, path)?))
    }

    /// Goes on behind the last whole line of what was found, with a new run.
    pub fn begin(&mut self, found: &Found, run: &Run) -> Outcome {
        self.file
            .set_len(found.whole)
            .map_err(|e| cannot(&self.path, &e))?;
        self.write(&Line::Run {
            run: Box::new(run.clone()),
        })
    }

    /// Adds an entry.
    pub fn add(&mut self, entry: &Entry) -> Outcome {
        self.write(&Line::Entry(Box::new(entry.clone())))
    }

    fn write(&mut self, line: &Line) -> Outcome {
        let mut text = serde_json::to_vec(line).or_limit()?;
        text.push(b'\n');
        self.file.write_all(&text).map_err(|e| cannot(&self.path, &e))
    }
}

impl Drop for Manifest {
    /// Closing would not do: a process that another thread is just starting holds the file until it runs its own program.
    fn drop(&mut self) {
        drop(self.file.unlock());
    }
}

fn cannot(path: &Path, e: &io::Error) -> Failure {
    Failure::limit(format!(
        "{}: the manifest cannot be written ({e}); free some space, or name another directory by -o",
        path.display()
    ))
}

/// Replaces a manifest by one run and its entries in the order of its inputs: what came and went is forgotten.
pub fn replace(path: &Path, run: &Run, entries: &BTreeMap<String, Entry>) -> Outcome {
    let mut lines = vec![Line::Run {
        run: Box::new(run.clone()),
    }];
    let kept = run.inputs.iter().filter_map(|(name, _)| entries.get(name));
    lines.extend(kept.map(|e| Line::Entry(Box::new(e.clone()))));
    formats::atomic::replace(path, |out| {
        for line in &lines {
            serde_json::to_writer(&mut *out, line)?;
            out.write_all(b"\n")?;
        }
        Ok(())
    })
    .map_err(Failure::limit)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(name: &str) -> Entry {
        Entry {
            input: format!("scans/{name} ü\n\".ply"),
            name: name.into(),
            state: State::Done,
            kind: None,
            input_bytes: 7,
            input_sha256: None,
            key: Some("k".into()),
            failure: None,
            fit: Map::new(),
            mesh: Map::new(),
            outputs: BTreeMap::new(),
            seconds: 0.1 + 0.2,
            peak_rss_bytes: None,
            notes: vec!["a note".into()],
        }
    }

    /// Cut off at any byte, the file still tells all entries before the cut, and goes on behind them.
    #[test]
    fn a_manifest_survives_a_cut_at_any_byte() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("manifest.jsonl");
        let run = Run::new(
            Map::new(),
            None,
            2,
            vec![("a".into(), "a".into()), ("b".into(), "b".into())],
        );
        let begin = || {
            let (mut manifest, found) = Manifest::open(&path).unwrap();
            manifest.begin(&found, &run).unwrap();
            manifest
        };
        let mut manifest = begin();
        manifest.add(&entry("a")).unwrap();
        assert!(Manifest::open(&path).is_err_and(|e| e.to_string().contains("at work")));
        manifest.add(&entry("b")).unwrap();
        drop(manifest);
        let whole = fs::read(&path).unwrap();
        let ends: Vec<usize> = (0..whole.len())
            .filter(|i| whole[*i] == b'\n')
            .map(|i| i + 1)
            .collect();
        assert_eq!(ends.len(), 3, "names with line breaks stay on one line");
        for cut in 0..=whole.len() {
            fs::write(&path, &whole[..cut]).unwrap();
            let found = Found::read(&path).unwrap();
            let lines = ends.iter().filter(|e| **e <= cut).count();
            assert_eq!(found.run.is_some(), lines > 0);
            assert_eq!(found.entries.len(), lines.saturating_sub(1));
            begin().add(&entry("b")).unwrap();
            let again = Found::read(&path).unwrap();
            assert_eq!(again.entries["b"], entry("b"));
            assert_eq!(again.entries.contains_key("a"), lines > 1, "cut at {cut}");
        }
        replace(&path, &run, &Found::read(&path).unwrap().entries).unwrap();
        assert_eq!(fs::read(&path).unwrap(), whole, "the order is that of the inputs");
    }

    #[test]
    fn spoilt_lines_are_passed_over_and_later_formats_refused() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("manifest.jsonl");
        let mut run = Run::new(Map::new(), None, 1, Vec::new());
        let (mut manifest, found) = Manifest::open(&path).unwrap();
        manifest.begin(&found, &run).unwrap();
        manifest.file.write_all(b"\0\0\0\0{\n").unwrap();
        manifest.add(&entry("a")).unwrap();
        assert_eq!(Found::read(&path).unwrap().entries.len(), 1);
        run.format = FORMAT + 1;
        manifest.begin(&Found::read(&path).unwrap(), &run).unwrap();
        assert!(
            Found::read(&path)
                .unwrap_err()
                .to_string()
                .contains("another directory")
        );
    }
}
