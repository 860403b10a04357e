//! What the user named, as a list of inputs: files, what folders hold, patterns.

use std::collections::HashSet;
use std::ffi::OsStr;
use std::fs::{self, Metadata};
use std::io::Read;
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};

use fitting::Cancel;
use formats::volumes::VolumeFormat;
use formats::{Fault, Kind};

use super::super::failure::Outcome;
use super::super::interrupt;
use super::super::source::SAMPLES;
use super::{glob, name};

/// One thing to fit.
#[derive(Clone, Debug)]
pub struct Item {
    /// Where it is: a file, or the directory of a series.
    pub path: PathBuf,
    /// Name of its outputs.
    pub name: String,
    /// What it is, as far as its first bytes or its name tell.
    pub kind: Option<Kind>,
    /// Bytes of the file, or of the files right in the directory.
    pub bytes: u64,
    /// Why it cannot even be read.
    pub trouble: Option<String>,
}

/// What was found.
#[derive(Debug, Default)]
pub struct Gathered {
    /// Sorted by path, none twice.
    pub items: Vec<Item>,
    /// What folders hold besides.
    pub skipped: Vec<PathBuf>,
}

/// Directories that a folder is looked into.
const DEEPEST: usize = 64;
/// Bytes of a text that are looked at for numbers.
const LOOK: u64 = 4096;

impl Gathered {
    /// What `inputs` stand for; nothing of `output`, which may be in one of the folders.
    pub fn new(inputs: &[PathBuf], output: &Path, cancel: &Cancel) -> Outcome<Self> {
        let mut all = Self::default();
        let output = output.canonicalize().ok();
        for input in inputs {
            let input = name::plain(input);
            if input.symlink_metadata().is_err() && glob::is_pattern(&input) {
                let matches = glob::matches(&input);
                if matches.is_empty() {
                    all.add(
                        input,
                        None,
                        Some("no file fits this pattern; check the path".into()),
                    );
                }
                for path in matches {
                    interrupt::check(cancel)?;
                    all.named(path, output.as_deref(), cancel)?;
                }
            } else {
                all.named(input, output.as_deref(), cancel)?;
            }
        }
        all.items.sort_by(|a, b| a.path.cmp(&b.path));
        let mut seen = HashSet::new();
        all.items
            .retain(|i| seen.insert(std::path::absolute(&i.path).unwrap_or_else(|_| i.path.clone())));
        let paths: Vec<PathBuf> = all.items.iter().map(|i| i.path.clone()).collect();
        for (item, name) in all.items.iter_mut().zip(name::of_all(&paths)) {
            item.name = name;
        }
        all.skipped.sort();
        Ok(all)
    }

    fn add(&mut self, path: PathBuf, kind: Option<Kind>, trouble: Option<String>) {
        let bytes = match path.metadata() {
            Ok(m) if m.is_dir() => files_of(&path)
                .iter()
                .filter_map(|f| Some(f.metadata().ok()?.len()))
                .sum(),
            Ok(m) => m.len(),
            Err(_) => 0,
        };
        self.items.push(Item {
            path,
            name: String::new(),
            kind,
            bytes,
            trouble,
        });
    }

    /// A path that the user named: taken whatever it is.
    fn named(&mut self, path: PathBuf, output: Option<&Path>, cancel: &Cancel) -> Outcome {
        let metadata = match path.metadata() {
            Ok(m) => m,
            Err(e) => {
                let fault = Fault::Io {
                    doing: "opening it",
                    source: e,
                };
                self.add(path, None, Some(fault.to_string()));
                return Ok(());
            }
        };
        if metadata.is_dir() {
            let before = self.items.len();
            self.folder(&path, output, 0, cancel)?;
            if self.items.len() == before {
                let trouble = match path.read_dir() {
                    Ok(_) => format!("the folder holds nothing that can be fitted; give {SAMPLES}"),
                    Err(e) => {
                        format!("the folder cannot be listed ({e}); give yourself the right to read it")
                    }
                };
                self.add(path, None, Some(trouble));
            }
        } else if let Some(what) = no_file(&metadata) {
            self.add(
                path,
                None,
                Some(format!(
                    "is {what}, which has no end that could be waited for; give a file"
                )),
            );
        } else {
            let kind = formats::detect(&path).ok();
            self.add(path, kind, None);
        }
        Ok(())
    }

    /// What a folder holds: itself, if it is a series of slices; else files that can be fitted, and folders.
    fn folder(&mut self, directory: &Path, output: Option<&Path>, depth: usize, cancel: &Cancel) -> Outcome {
        interrupt::check(cancel)?;
        if output.is_some_and(|o| directory.canonicalize().is_ok_and(|d| d == o)) {
            return Ok(());
        }
        let files = files_of(directory);
        let mut kinds = Vec::new();
        for file in &files {
            interrupt::check(cancel)?;
            kinds.push(kind_in_folder(file));
        }
        let is = |kind: &Found, format| matches!(kind, Found::Is(Kind::Volume(f)) if *f == format);
        if kinds.iter().any(|k| is(k, VolumeFormat::Dicom)) {
            // Its reader goes through the folders below too. What else lies here is for itself.
            self.add(directory.into(), Some(Kind::Volume(VolumeFormat::Dicom)), None);
            for (file, kind) in files.iter().zip(kinds) {
                if !is(&kind, VolumeFormat::Dicom) {
                    self.of_folder(file, kind);
                }
            }
            return Ok(());
        }
        let stack = Kind::Volume(VolumeFormat::TiffFolder);
        let is_stack = kinds.iter().filter(|k| is(k, VolumeFormat::Tiff)).count() > 1
            && formats::detect(directory).is_ok_and(|k| k == stack);
        if is_stack {
            self.add(directory.into(), Some(stack), None);
        }
        for (file, kind) in files.iter().zip(kinds) {
            if !(is_stack && is(&kind, VolumeFormat::Tiff)) {
                self.of_folder(file, kind);
            }
        }
        for below in folders_of(directory) {
            if depth < DEEPEST {
                self.folder(&below, output, depth + 1, cancel)?;
            } else {
                self.skipped.push(below);
            }
        }
        Ok(())
    }

    fn of_folder(&mut self, file: &Path, kind: Found) {
        match kind {
            Found::Is(kind) => self.add(file.into(), Some(kind), None),
            Found::Broken => self.add(file.into(), None, None),
            Found::Nothing => self.skipped.push(file.into()),
        }
    }
}

/// What a file in a folder is taken for.
#[derive(Clone, Copy, Debug)]
enum Found {
    /// Something to fit.
    Is(Kind),
    /// Something to fit by its name, that cannot be read: its fit says why.
    Broken,
    /// Something else.
    Nothing,
}

/// What is no file to be read to its end.
fn no_file(metadata: &Metadata) -> Option<&'static str> {
    let kind = metadata.file_type();
    if kind.is_fifo() {
        Some("a pipe")
    } else if kind.is_socket() {
        Some("a socket")
    } else if kind.is_file() || kind.is_dir() {
        None
    } else {
        Some("a device")
    }
}

fn kind_in_folder(file: &Path) -> Found {
    let name = (file.file_name().map(OsStr::to_string_lossy))
        .unwrap_or_default()
        .to_ascii_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    // Half of a pair, which its header stands for.
    if let Some(stem) = name.strip_suffix(".img") {
        let directory = file.parent().unwrap_or(Path::new(""));
        let has = |e: &str| {
            files_of(directory).iter().any(|f| {
                let other = f.file_name().unwrap_or_default().to_string_lossy();
                other.to_ascii_lowercase() == format!("{stem}{e}")
            })
        };
        if has(".hdr") || has(".hdr.gz") {
            return Found::Nothing;
        }
    }
    match formats::detect(file) {
        Ok(Kind::Field) => Found::Nothing,
        // Texts by their names alone: a list of numbers may be a cloud, words are none.
        Ok(kind) if [".txt", ".csv", ".asc"].iter().any(|e| name.ends_with(e)) && !has_numbers(file) => {
            match kind {
                Kind::Cloud(_) => Found::Nothing,
                kind => Found::Is(kind),
            }
        }
        Ok(kind) => Found::Is(kind),
        Err(e) if matches!(e.fault, Fault::UnknownKind { .. }) => Found::Nothing,
        Err(_) if is_known(name) => Found::Broken,
        Err(_) => Found::Nothing,
    }
}

/// Whether a name promises something to fit.
fn is_known(name: &str) -> bool {
    // The names in the list that messages show are the ones that are read.
    let extension = name.rsplit_once('.').map_or("", |(_, e)| e);
    let is_listed = SAMPLES
        .split([' ', ',', '('])
        .any(|word| word.strip_prefix('.') == Some(extension));
    is_listed && !extension.is_empty()
}

/// Whether one of the first lines starts with three numbers.
fn has_numbers(file: &Path) -> bool {
    let mut head = Vec::new();
    let read = fs::File::open(file).and_then(|f| f.take(LOOK).read_to_end(&mut head));
    // Packed text cannot be looked at here.
    read.is_ok()
        && (head.starts_with(&[0x1f, 0x8b])
            || String::from_utf8_lossy(&head).lines().any(|line| {
                let words = line
                    .split(|c: char| c.is_whitespace() || c == ',' || c == ';')
                    .filter(|w| !w.is_empty());
                words.take(3).filter(|w| w.parse::<f64>().is_ok()).count() == 3
            }))
}

/// Plain files of a directory that are not hidden, sorted, and links that lead nowhere: someone meant a file.
fn files_of(directory: &Path) -> Vec<PathBuf> {
    entries(directory, |path, metadata| {
        metadata.is_file() || metadata.is_symlink() && path.metadata().map_or(true, |m| m.is_file())
    })
}

/// Directories in a directory that are not hidden, sorted. Links to directories are not followed: they may lead back.
fn folders_of(directory: &Path) -> Vec<PathBuf> {
    entries(directory, |_, metadata| metadata.is_dir())
}

fn entries(directory: &Path, pass: impl Fn(&Path, &Metadata) -> bool) -> Vec<PathBuf> {
    let is_here = directory == Path::new(".");
    let entries = directory.read_dir().into_iter().flatten().flatten();
    let mut found: Vec<PathBuf> = entries
        .filter(|e| !e.file_name().to_string_lossy().starts_with('.'))
        .map(|e| if is_here { e.file_name().into() } else { e.path() })
        .filter(|path: &PathBuf| path.symlink_metadata().is_ok_and(|m| pass(path, &m)))
        .collect();
    found.sort();
    found
}
