//! Names of outputs: plain, different for different inputs, and never a way out of the directory.

use std::os::unix::ffi::OsStrExt;
use std::path::{Component, Path, PathBuf};

use sha2::{Digest, Sha256};

use super::super::summary::hex;

/// Characters that are taken over from the name of the input.
const READABLE: usize = 64;
/// Digits that tell inputs of one name apart: of 5 000 inputs two have the same with a chance of 4e-8, and then
/// [`of_all`] takes more.
const DIGITS: usize = 12;

/// The path without parts that mean nothing, as one input is always written.
pub fn plain(path: &Path) -> PathBuf {
    let parts = path.components().filter(|c| *c != Component::CurDir);
    let plain: PathBuf = parts.collect();
    if plain.as_os_str().is_empty() {
        PathBuf::from(".")
    } else {
        plain
    }
}

/// A name for each path: what is plain of the file's own, and digits made from the whole path, so that a name stays
/// what it is when other inputs come or go.
pub fn of_all(paths: &[PathBuf]) -> Vec<String> {
    let digests: Vec<String> = (paths.iter())
        .map(|p| hex(&Sha256::digest(p.as_os_str().as_bytes())))
        .collect();
    let mut short: Vec<&str> = digests.iter().map(|d| &d[..DIGITS]).collect();
    short.sort_unstable();
    let twice = |d: &str| {
        let at = short.partition_point(|s| *s < d);
        short.get(at + 1).is_some_and(|s| *s == d)
    };
    (paths.iter().zip(&digests))
        .map(|(path, digest)| {
            let digits = if twice(&digest[..DIGITS]) {
                &digest[..]
            } else {
                &digest[..DIGITS]
            };
            format!("{}-{digits}", readable(path))
        })
        .collect()
}

/// Letters, digits, `-`, `_` and inner points; everything else becomes `_`.
fn readable(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let safe: String = (name.chars())
        .map(|c| match c {
            'a'..='z' | 'A'..='Z' | '0'..='9' | '-' | '_' | '.' => c,
            _ => '_',
        })
        .take(READABLE)
        .collect();
    // Neither hidden nor an option.
    match safe.trim_start_matches(['.', '-']) {
        "" => "input".into(),
        safe => safe.into(),
    }
}

#[cfg(test)]
mod tests {
    use std::ffi::OsStr;

    use super::*;

    #[test]
    fn names_differ_and_stay_inside() {
        let mut paths: Vec<PathBuf> = [
            "a/scan.ply",
            "b/scan.ply",
            "../../etc/passwd",
            "..",
            "/",
            "-o",
            "a b/<img src=x>.ply",
            "näme.ply",
            "name\n.ply",
            ".hidden",
        ]
        .map(PathBuf::from)
        .into();
        paths.push(OsStr::from_bytes(b"bad\xff.ply").into());
        paths.push(OsStr::from_bytes(b"bad\xfe.ply").into());
        paths.push("x".repeat(255).into());
        let names = of_all(&paths);
        for name in &names {
            assert!(name.len() < 100 && !name.starts_with(['.', '-']), "{name}");
            assert!(
                name.bytes()
                    .all(|b| b.is_ascii_alphanumeric() || b"-_.".contains(&b)),
                "{name}"
            );
        }
        let mut unique = names.clone();
        unique.sort();
        unique.dedup();
        assert_eq!(unique.len(), paths.len());
        assert_eq!(
            of_all(&paths[1..2])[0],
            names[1],
            "a name that depends on the others"
        );
        assert!(names[0].starts_with("scan.ply-"));
    }

    #[test]
    fn one_input_has_one_spelling() {
        assert_eq!(plain(Path::new("./a//./b")), Path::new("a/b"));
        assert_eq!(plain(Path::new("././")), Path::new("."));
    }
}
