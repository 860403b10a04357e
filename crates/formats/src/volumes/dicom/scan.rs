//! Which files belong together.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::DicomOptions;
use super::dataset::{self, Broken, DataSet, LOOK, SeriesId, looks_like_dicom};
use super::stream::Location;
use crate::input::io_fault;
use crate::limits::Budget;
use crate::{Choice, Fault};

/// One file of a series.
#[derive(Debug)]
pub(super) struct File {
    pub location: Location,
    /// What it is called in messages: its path below the directory that was asked for.
    pub name: String,
    pub data: DataSet,
}

/// The files of one series, in the order of their names.
#[derive(Debug)]
pub(super) struct Found {
    pub files: Vec<File>,
    pub notes: Vec<String>,
}

/// Directories below the one asked for that are looked into.
const DEEPEST: usize = 8;
/// Bytes that the description of a file takes, its name included.
const FILE_BYTES: usize = 2048;
/// The class of a `DICOMDIR`.
const DIRECTORY_CLASS: &str = "1.2.840.10008.1.3.10";

/// The file in `bytes` alone.
pub(super) fn one(bytes: Arc<[u8]>, budget: &mut Budget) -> Result<Found, Fault> {
    let location = Location::Memory(bytes);
    let data = dataset::read(&location, budget)
        .map_err(|b| b.fault)?
        .ok_or_else(no_dicom)?;
    Ok(Found {
        files: vec![File {
            location,
            name: "the file".into(),
            data,
        }],
        notes: Vec::new(),
    })
}

/// The series that `path` stands for.
///
/// # Errors
/// [`Fault::Value`] if there is no picture, or several series and no choice; [`Fault::Inside`] for a file that
/// cannot be understood.
pub(super) fn find(path: &Path, options: &DicomOptions, budget: &mut Budget) -> Result<Found, Fault> {
    if path.is_dir() {
        let mut all = Scan::default();
        all.directory(path, path, 0, budget)?;
        return all.choose(options.series.as_deref());
    }
    let location = Location::Path(path.into());
    let data = dataset::read(&location, budget)
        .map_err(|b| b.fault)?
        .ok_or_else(no_dicom)?;
    if data.frame_count.is_some_and(|n| n > 1) {
        let name = name_of(path, path.parent().unwrap_or(path));
        return Ok(Found {
            files: vec![File { location, name, data }],
            notes: Vec::new(),
        });
    }
    let directory = match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    let mut all = Scan::default();
    all.files_of(directory, directory, budget)?;
    all.choose(Some(options.series.as_deref().unwrap_or(&data.series.uid)))
}

/// Whether a directory holds a DICOM file, or one below it does.
pub(crate) fn holds_dicom(path: &Path) -> Result<bool, Fault> {
    fn look(path: &Path, depth: usize) -> Result<bool, Fault> {
        let (files, directories) = entries(path, &mut |_| Ok(()))?;
        for file in files {
            let mut head = [0; LOOK];
            // What cannot be opened is named when the directory is read.
            let got = match Location::Path(file).open() {
                Ok(mut stream) => stream.fill_or_end(&mut head)?,
                Err(_) => 0,
            };
            if looks_like_dicom(&head[..got]) {
                return Ok(true);
            }
        }
        for directory in directories {
            if depth < DEEPEST && look(&directory, depth + 1)? {
                return Ok(true);
            }
        }
        Ok(false)
    }
    look(path, 0)
}

/// Files and directories in a directory, each sorted by name: systems list in any order. `count` is called for each.
fn entries(
    path: &Path,
    count: &mut dyn FnMut(&Path) -> Result<(), Fault>,
) -> Result<(Vec<PathBuf>, Vec<PathBuf>), Fault> {
    let (mut files, mut directories) = (Vec::new(), Vec::new());
    for entry in fs::read_dir(path).map_err(io_fault("listing the directory"))? {
        let entry = entry.map_err(io_fault("listing the directory"))?;
        let path = entry.path();
        count(&path)?;
        // Links to directories are not followed: they may lead back.
        let kind = entry.file_type().map_err(io_fault("listing the directory"))?;
        if kind.is_dir() {
            directories.push(path);
        } else if kind.is_file() || path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    directories.sort();
    Ok((files, directories))
}

fn no_dicom() -> Fault {
    Fault::Value {
        what: "the start of the file",
        value: "neither the mark DICM at byte 128 nor elements of DICOM".into(),
        remedy: "is it a DICOM file?",
    }
}

fn name_of(path: &Path, root: &Path) -> String {
    path.strip_prefix(root).unwrap_or(path).display().to_string()
}

#[derive(Default)]
struct Scan {
    files: Vec<File>,
    /// Files that are no DICOM, and those that hold no picture.
    foreign: usize,
    blind: usize,
    /// DICOM files that cannot be understood, each with its name.
    broken: Vec<Broken>,
    has_catalogue: bool,
}

impl Scan {
    fn directory(
        &mut self,
        path: &Path,
        root: &Path,
        depth: usize,
        budget: &mut Budget,
    ) -> Result<(), Fault> {
        let before = self.files.len();
        let below = self.files_of(path, root, budget)?;
        if depth < DEEPEST && (self.has_catalogue || self.files.len() == before || depth > 0) {
            for directory in below {
                self.directory(&directory, root, depth + 1, budget)?;
            }
        }
        Ok(())
    }

    /// Takes the files of a directory; gives the directories in it.
    fn files_of(&mut self, path: &Path, root: &Path, budget: &mut Budget) -> Result<Vec<PathBuf>, Fault> {
        let book = &mut |_: &Path| budget.reserve("the list of files", 1, FILE_BYTES);
        let (files, directories) = entries(path, book)?;
        for path in files {
            let name = name_of(&path, root);
            let location = Location::Path(path);
            match dataset::read(&location, budget) {
                // A matter of all files, not of this one.
                Err(Broken {
                    fault: fault @ Fault::Limit { .. },
                    ..
                }) => return Err(fault),
                Err(Broken { fault, series }) => self.broken.push(Broken {
                    fault: fault.inside(&name),
                    series,
                }),
                Ok(None) => self.foreign += 1,
                Ok(Some(data)) if data.pixels.is_none() => {
                    self.has_catalogue |= data.sop_class == DIRECTORY_CLASS;
                    self.blind += usize::from(data.sop_class != DIRECTORY_CLASS);
                }
                Ok(Some(data)) => self.files.push(File { location, name, data }),
            }
        }
        Ok(directories)
    }

    /// The files of the series with that number or identifier, or of the only one that is a volume.
    ///
    /// Files that cannot be understood are passed over with a note, unless they are known to belong to it.
    fn choose(mut self, wanted: Option<&str>) -> Result<Found, Fault> {
        let mut notes = Vec::new();
        if self.files.is_empty() && !self.broken.is_empty() {
            return Err(self.broken.swap_remove(0).fault);
        }
        if let Some(first) = self.broken.first() {
            notes.push(format!(
                "{} DICOM files cannot be understood and were passed over, the first {}",
                self.broken.len(),
                first.fault
            ));
        }
        if self.foreign > 0 {
            notes.push(format!(
                "{} files that are no DICOM were passed over",
                self.foreign
            ));
        }
        if self.blind > 0 {
            notes.push(format!(
                "{} DICOM files without a picture were passed over",
                self.blind
            ));
        }
        let mut order: Vec<Group> = Vec::new();
        let mut index: BTreeMap<String, usize> = BTreeMap::new();
        for (i, file) in self.files.iter().enumerate() {
            let at = *index.entry(file.data.series.uid.clone()).or_insert(order.len());
            if at == order.len() {
                order.push(Group::default());
            }
            order[at].files.push(i);
        }
        for group in &mut order {
            group.describe(&self.files);
        }
        let chosen: Vec<usize> = match wanted {
            Some(w) => (0..order.len()).filter(|i| order[*i].is_called(w)).collect(),
            None if order.len() == 1 => vec![0],
            None => (0..order.len()).filter(|i| order[*i].is_volume).collect(),
        };
        let [chosen] = chosen[..] else {
            return Err(ambiguous(&order, &chosen, wanted, self.foreign + self.blind));
        };
        let uid = &order[chosen].id.uid;
        if let Some(i) = self.broken.iter().position(|b| b.series == *uid) {
            return Err(self.broken.swap_remove(i).fault);
        }
        if wanted.is_none() && order.len() > 1 {
            let others = order
                .iter()
                .enumerate()
                .filter(|(i, _)| *i != chosen)
                .map(|(_, g)| &g.text);
            let others: Vec<&str> = others.map(String::as_str).collect();
            notes.push(format!(
                "{} other series were passed over, none of them a volume: {}",
                others.len(),
                others.join("; ")
            ));
        }
        let mut is_member = vec![false; self.files.len()];
        order[chosen].files.iter().for_each(|i| is_member[*i] = true);
        let mut is_member = is_member.into_iter();
        let files = self
            .files
            .into_iter()
            .filter(|_| is_member.next().unwrap_or(false))
            .collect();
        Ok(Found { files, notes })
    }
}

/// The files that share an identifier.
#[derive(Default)]
struct Group {
    files: Vec<usize>,
    id: SeriesId,
    is_volume: bool,
    text: String,
}

impl Group {
    fn describe(&mut self, files: &[File]) {
        let first = &files[self.files[0]].data;
        self.id = first.series.clone();
        let pictures: u64 = self
            .files
            .iter()
            .map(|i| u64::from(files[*i].data.frame_count.unwrap_or(1)))
            .sum();
        let is_placed = |d: &DataSet| {
            let first = d.frames.first().unwrap_or(&d.common).or(&d.common);
            first.position.is_some() && first.orientation.is_some()
        };
        let is_placed = self.files.iter().all(|i| is_placed(&files[*i].data));
        self.is_volume = pictures > 1 && is_placed && first.flavour != "LOCALIZER";
        let number = self
            .id
            .number
            .map_or("without a number".into(), |n| n.to_string());
        self.text = format!(
            "{number} {} {}, {pictures} pictures of {} x {}{} ({})",
            self.id.modality,
            crate::error::excerpt(self.id.description.as_bytes()),
            first.columns,
            first.rows,
            if self.is_volume { "" } else { ", no volume" },
            self.id.uid
        );
    }

    fn is_called(&self, name: &str) -> bool {
        self.id.uid == name || self.id.number.is_some_and(|n| n.to_string() == name.trim())
    }
}

fn ambiguous(all: &[Group], chosen: &[usize], wanted: Option<&str>, others: usize) -> Fault {
    if all.is_empty() {
        return Fault::Value {
            what: "the number of DICOM pictures",
            value: format!("0 in a directory with {others} other files"),
            remedy: "name the directory that holds the files of the series",
        };
    }
    let listed: Vec<&Group> = match wanted {
        Some(_) if !chosen.is_empty() => chosen.iter().map(|i| &all[*i]).collect(),
        _ => all.iter().collect(),
    };
    let list: String = listed.iter().map(|g| format!("\n  {}", g.text)).collect();
    let name = wanted.map(|w| crate::error::excerpt(w.as_bytes()));
    let (what, value) = match (name, chosen.len()) {
        (Some(name), 0) => ("the series asked for", format!("{name}, and there are:{list}")),
        (Some(name), n) => ("the number of series", format!("{n} named {name}:{list}")),
        (None, n) => (
            "the number of series",
            format!("{}, of which {n} are volumes:{list}", all.len()),
        ),
    };
    Fault::Choose {
        what,
        value,
        remedy: "choose one by its number or identifier",
        choice: Choice::Series,
    }
}
