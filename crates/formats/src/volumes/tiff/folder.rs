//! A directory whose TIFF files are the slices of one volume.

use std::cmp::Ordering;
use std::fs;
use std::path::{Path, PathBuf};

use crate::Fault;
use crate::input::io_fault;

/// Files in the order of their slices.
#[derive(Debug)]
pub(super) struct Pages {
    pub paths: Vec<PathBuf>,
    pub notes: Vec<String>,
}

/// Whether a directory holds TIFF files.
pub(crate) fn is_stack(directory: &Path) -> Result<bool, Fault> {
    Ok(!names(directory)?.is_empty())
}

/// Names of the TIFF files of a directory, hidden ones left out.
fn names(directory: &Path) -> Result<Vec<String>, Fault> {
    let mut names = Vec::new();
    for entry in fs::read_dir(directory).map_err(io_fault("reading the directory"))? {
        let name = entry.map_err(io_fault("reading the directory"))?.file_name();
        let name = name.to_string_lossy().into_owned();
        let lower = name.to_ascii_lowercase();
        if !name.starts_with('.') && (lower.ends_with(".tif") || lower.ends_with(".tiff")) {
            names.push(name);
        }
    }
    Ok(names)
}

/// The TIFF files of a directory in the natural order of their names: numbers count as numbers.
pub(super) fn pages(directory: &Path) -> Result<Pages, Fault> {
    let mut names = names(directory)?;
    names.sort_by(|a, b| natural(a, b));
    let (Some(first), Some(last)) = (names.first(), names.last()) else {
        return Err(Fault::Directory);
    };
    if let Some(other) = names.iter().find(|n| skeleton(n) != skeleton(first)) {
        return Err(Fault::Value {
            what: "the directory",
            value: format!("one with files of different names, {first} and {other}"),
            remedy: "the slices of a volume differ in their numbers alone; give each series its own directory",
        });
    }
    let mut notes = vec![format!("{} slices by name, {first} to {last}", names.len())];
    if let Some((a, b)) = jump(&names) {
        notes.push(format!("numbers jump between {a} and {b}; are slices missing?"));
    }
    Ok(Pages {
        paths: names.iter().map(|n| directory.join(n)).collect(),
        notes,
    })
}

/// Parts of a name that are all digits, or have none.
fn runs(name: &str) -> impl Iterator<Item = &str> {
    let mut rest = name;
    std::iter::from_fn(move || {
        let is_number = rest.chars().next()?.is_ascii_digit();
        let end = rest
            .find(|c: char| c.is_ascii_digit() != is_number)
            .unwrap_or(rest.len());
        let (run, later) = rest.split_at(end);
        rest = later;
        Some(run)
    })
}

fn is_number(run: &str) -> bool {
    run.starts_with(|c: char| c.is_ascii_digit())
}

/// A name with its numbers taken out.
fn skeleton(name: &str) -> Vec<&str> {
    runs(name).map(|r| if is_number(r) { "0" } else { r }).collect()
}

fn natural(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (runs(a), runs(b));
    loop {
        let order = match (left.next(), right.next()) {
            // The same numbers with other zeros before them: any order that is always the same.
            (None, None) => return a.cmp(b),
            (x, y) => match (x, y) {
                (Some(x), Some(y)) if is_number(x) && is_number(y) => {
                    let (x, y) = (x.trim_start_matches('0'), y.trim_start_matches('0'));
                    x.len().cmp(&y.len()).then_with(|| x.cmp(y))
                }
                (x, y) => x.cmp(&y),
            },
        };
        if order != Ordering::Equal {
            return order;
        }
    }
}

/// Neighbours whose numbers differ by another step than the first two.
fn jump(names: &[String]) -> Option<(&str, &str)> {
    let number = |name: &str| -> Option<Vec<i128>> {
        runs(name)
            .filter(|r| is_number(r))
            .map(|r| r.parse().ok())
            .collect()
    };
    let numbers: Vec<_> = names.iter().map(|n| number(n)).collect::<Option<_>>()?;
    let step = |k: usize| -> Option<Vec<i128>> {
        let pairs = numbers[k].iter().zip(&numbers[k - 1]);
        pairs.map(|(a, b)| a.checked_sub(*b)).collect()
    };
    let k = (2..names.len()).find(|k| step(*k) != step(1))?;
    Some((&names[k - 1], &names[k]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn listed(names: &[&str]) -> Result<Pages, Fault> {
        let directory = tempfile::tempdir().unwrap();
        for name in names {
            fs::write(directory.path().join(name), "").unwrap();
        }
        pages(directory.path())
    }

    #[test]
    fn slices_come_in_the_order_of_their_numbers() {
        let found = listed(&["s10.tif", "s9.tif", "s8.TIF", "notes.txt", ".s1.tif"]);
        // Capitals are another name, and no series of its own is meant: it is refused rather than guessed.
        assert!(found.is_err());
        let found = listed(&["s10.tif", "s9.tif", "s008.tif", "notes.txt", ".s1.tif"]).unwrap();
        let names: Vec<_> = found
            .paths
            .iter()
            .map(|p| p.file_name().unwrap().to_str().unwrap())
            .collect();
        assert_eq!(names, ["s008.tif", "s9.tif", "s10.tif"]);
        assert_eq!(found.notes.len(), 1);
    }

    #[test]
    fn a_gap_is_noted_and_a_mixture_refused() {
        let found = listed(&["a1.tif", "a2.tif", "a4.tif"]).unwrap();
        assert!(
            found.notes[1].contains("between a2.tif and a4.tif"),
            "{:?}",
            found.notes
        );
        let e = listed(&["a1.tif", "b1.tif"]).unwrap_err().to_string();
        assert!(e.contains("a1.tif and b1.tif"), "{e}");
        assert!(matches!(listed(&["readme"]), Err(Fault::Directory)));
    }
}
