//! Patterns of file names that the shell left over: because they were quoted, or match nothing there.

use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::{Component, Path, PathBuf};

/// Directories that `**` descends into.
const DEEPEST: usize = 64;

/// Whether a path holds signs of a pattern.
pub fn is_pattern(path: &Path) -> bool {
    path.as_os_str().as_bytes().iter().any(|b| b"*?[".contains(b))
}

/// The paths that a pattern stands for, sorted: `*` for any characters of a name, `?` for one, `[a-c]` and `[!a-c]` for
/// one of a set, `**` for any directories. Names that begin with a dot have to be asked for by a dot.
pub fn matches(pattern: &Path) -> Vec<PathBuf> {
    let mut found = vec![PathBuf::new()];
    for part in pattern.components() {
        found = match part {
            Component::Normal(part) if part == "**" => found.iter().flat_map(|at| below(at, 0)).collect(),
            Component::Normal(part) if is_pattern(Path::new(part)) => found
                .iter()
                .flat_map(|at| names(at).into_iter().map(move |n| (at, n)))
                .filter(|(_, name)| fits(part.as_bytes(), name.as_bytes()))
                .map(|(at, name)| at.join(name))
                .collect(),
            part => (found.iter().map(|at| at.join(part)))
                .filter(|p| p.symlink_metadata().is_ok())
                .collect(),
        };
    }
    found.sort();
    found.dedup();
    found
}

fn names(directory: &Path) -> Vec<std::ffi::OsString> {
    let here = if directory.as_os_str().is_empty() {
        Path::new(".")
    } else {
        directory
    };
    let entries = here.read_dir().into_iter().flatten().flatten();
    entries.map(|e| e.file_name()).collect()
}

fn is_hidden(name: &OsStr) -> bool {
    name.as_bytes().starts_with(b".")
}

/// A directory and those below it.
fn below(at: &Path, depth: usize) -> Vec<PathBuf> {
    let mut all = vec![at.to_path_buf()];
    if depth < DEEPEST {
        for name in names(at).into_iter().filter(|n| !is_hidden(n)) {
            let path = at.join(name);
            // Links to directories are not followed: they may lead back.
            if path.symlink_metadata().is_ok_and(|m| m.is_dir()) {
                all.extend(below(&path, depth + 1));
            }
        }
    }
    all
}

/// Whether a name fits a pattern.
fn fits(pattern: &[u8], name: &[u8]) -> bool {
    if name.starts_with(b".") && !pattern.starts_with(b".") {
        return false;
    }
    // Where to go on after a mismatch: behind the last star, which then takes one character more.
    let (mut p, mut n) = (0, 0);
    let mut star = None;
    while n < name.len() {
        let next = match pattern.get(p) {
            Some(b'*') => {
                star = Some((p + 1, n));
                p += 1;
                continue;
            }
            Some(_) => one(&pattern[p..], name[n]),
            None => None,
        };
        match (next, star) {
            (Some(length), _) => {
                p += length;
                n += 1;
            }
            (None, Some((after, taken))) => {
                star = Some((after, taken + 1));
                (p, n) = (after, taken + 1);
            }
            (None, None) => return false,
        }
    }
    pattern[p..].iter().all(|b| *b == b'*')
}

/// Length of the first part of the pattern, if it stands for `c`.
fn one(pattern: &[u8], c: u8) -> Option<usize> {
    match pattern[0] {
        b'?' => Some(1),
        b'[' => {
            let is_not = matches!(pattern.get(1), Some(b'!' | b'^'));
            let start = 1 + usize::from(is_not);
            // A closing bracket that comes first is one of the set.
            let end = start + 1 + pattern.get(start + 1..)?.iter().position(|b| *b == b']')?;
            let (mut is_in, mut i) = (false, start);
            while i < end {
                if i + 2 < end && pattern[i + 1] == b'-' {
                    is_in |= (pattern[i]..=pattern[i + 2]).contains(&c);
                    i += 3;
                } else {
                    is_in |= pattern[i] == c;
                    i += 1;
                }
            }
            (is_in != is_not).then_some(end + 1)
        }
        literal => (literal == c).then_some(1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_fit_as_in_a_shell() {
        let fits = |p: &str, n: &str| fits(p.as_bytes(), n.as_bytes());
        for (pattern, name) in [
            ("*", "a"),
            ("*.ply", "a.b.ply"),
            ("a*b*c", "aXbbYbc"),
            ("scan?.xyz", "scan7.xyz"),
            ("[a-c]x", "bx"),
            ("[!a-c]x", "dx"),
            ("[]]", "]"),
            (".*", ".hidden"),
        ] {
            assert!(fits(pattern, name), "{pattern} {name}");
        }
        for (pattern, name) in [
            ("*.ply", "a.ply.gz"),
            ("*", ".hidden"),
            ("?", ""),
            ("[a-c]x", "dx"),
            ("[a", "[a"),
            ("a*b*c", "acb"),
        ] {
            assert!(!fits(pattern, name), "{pattern} {name}");
        }
        // One star after the other must not take time that grows with a power of the length.
        assert!(!fits(&"*a".repeat(40), &"a".repeat(39)));
    }

    #[test]
    fn patterns_stand_for_paths() {
        let scratch = tempfile::tempdir().unwrap();
        for path in ["a/x.ply", "a/b/y.ply", "a/b/z.xyz", "c.ply", ".d/w.ply"] {
            let path = scratch.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let found = |pattern: &str| -> Vec<String> {
            let all = matches(&scratch.path().join(pattern));
            let short = |p: PathBuf| p.strip_prefix(scratch.path()).unwrap().display().to_string();
            all.into_iter().map(short).collect()
        };
        assert_eq!(found("*.ply"), ["c.ply"]);
        assert_eq!(found("**/*.ply"), ["a/b/y.ply", "a/x.ply", "c.ply"]);
        assert_eq!(found("a/?/*"), ["a/b/y.ply", "a/b/z.xyz"]);
        assert!(found("nothing*").is_empty());
    }
}
