//! The content of an input as a number: of a file, of a directory, and of files that a header names.

use std::fs::File;
use std::io::{self, Read};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::super::overwrite::named_files;
use super::super::summary::hex;

/// Directories below that of a series that are read with it.
const DEEPEST: usize = 8;

/// SHA-256 of all that a fit of `path` reads, and its bytes. A change of a name inside a directory is a change.
///
/// # Errors
/// Those of the system; [`io::ErrorKind::Interrupted`] once it `is_over`.
pub fn of(path: &Path, is_over: &dyn Fn() -> bool) -> io::Result<(String, u64)> {
    let mut files = Vec::new();
    if path.is_dir() {
        files_below(path, Path::new(""), 0, &mut files)?;
    } else {
        files.push((PathBuf::new(), path.to_path_buf()));
        let mut named = named_files(path);
        named.sort();
        named.dedup();
        let others = named.into_iter().filter(|p| p.is_file());
        files.extend(others.map(|p| (p.file_name().unwrap_or_default().into(), p)));
    }
    let (mut whole, mut bytes) = (Sha256::new(), 0);
    for (name, file) in files {
        let (content, length) = of_file(&file, is_over)?;
        for part in [name.as_os_str().as_bytes(), &content] {
            whole.update((part.len() as u64).to_le_bytes());
            whole.update(part);
        }
        bytes += length;
    }
    Ok((hex(&whole.finalize()), bytes))
}

/// SHA-256 of one file, and its length.
pub fn of_file(path: &Path, is_over: &dyn Fn() -> bool) -> io::Result<([u8; 32], u64)> {
    let mut file = File::open(path)?;
    let (mut hash, mut length) = (Sha256::new(), 0);
    let mut part = vec![0; 1 << 18];
    loop {
        if is_over() {
            return Err(io::Error::from(io::ErrorKind::Interrupted));
        }
        match file.read(&mut part) {
            Ok(0) => return Ok((hash.finalize().into(), length)),
            Ok(n) => {
                hash.update(&part[..n]);
                length += n as u64;
            }
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
}

/// Plain files below a directory, sorted by their names there.
fn files_below(
    root: &Path,
    below: &Path,
    depth: usize,
    found: &mut Vec<(PathBuf, PathBuf)>,
) -> io::Result<()> {
    let mut names = Vec::new();
    for entry in root.join(below).read_dir()? {
        names.push(entry?.file_name());
    }
    names.sort();
    for name in names {
        let inner = below.join(name);
        let path = root.join(&inner);
        if path.symlink_metadata()?.is_dir() {
            if depth < DEEPEST {
                files_below(root, &inner, depth + 1, found)?;
            }
        } else if path.is_file() {
            found.push((inner, path));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn all_that_is_read_counts() {
        let scratch = tempfile::tempdir().unwrap();
        let at = |name: &str| scratch.path().join(name);
        let hash = |name: &str| of(&at(name), &|| false).unwrap();
        fs::create_dir(at("series")).unwrap();
        fs::write(at("series/1"), "one").unwrap();
        fs::write(at("series/2"), "two").unwrap();
        fs::write(at("v.mhd"), "NDims = 3\nElementDataFile = v.raw\n").unwrap();
        fs::write(at("v.raw"), "voxels").unwrap();
        let (series, bytes) = hash("series");
        assert_eq!(bytes, 6);
        let volume = hash("v.mhd").0;
        fs::write(at("v.raw"), "others").unwrap();
        assert_ne!(hash("v.mhd").0, volume);
        fs::rename(at("series/2"), at("series/3")).unwrap();
        let renamed = hash("series").0;
        assert_ne!(renamed, series);
        fs::write(at("series/3"), "TWO").unwrap();
        assert_ne!(hash("series").0, renamed);
        assert_eq!(
            of(&at("series"), &|| true).unwrap_err().kind(),
            io::ErrorKind::Interrupted
        );
    }
}
