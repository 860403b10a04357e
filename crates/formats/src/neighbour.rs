//! Files that another file names.

use std::path::{Component, Path, PathBuf};

use crate::Fault;

/// The file called `name` in the directory of `file`, which names it: no other directory can be reached, so that a
/// file from elsewhere cannot make a program read what it should not.
pub(crate) fn beside(file: Option<&Path>, name: &str) -> Result<PathBuf, Fault> {
    let Some(file) = file else {
        return Err(Fault::Value {
            what: "the data file",
            value: crate::error::excerpt(name.as_bytes()),
            remedy: "bytes in memory have no files beside them; name the file that names it",
        });
    };
    let is_inside = !name.is_empty()
        && !name.contains('\0')
        && Path::new(name)
            .components()
            .all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    if !is_inside {
        return Err(Fault::Value {
            what: "the data file",
            value: crate::error::excerpt(name.as_bytes()),
            remedy: "only files in the directory of the file that names it or below are read, by a relative name without ..",
        });
    }
    Ok(file.parent().unwrap_or(Path::new("")).join(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_reaches_nothing_but_its_own_directory() {
        let header = Some(Path::new("/scans/ct/a.nhdr"));
        assert_eq!(beside(header, "a.raw").unwrap(), Path::new("/scans/ct/a.raw"));
        assert_eq!(
            beside(header, "./b/a.raw").unwrap(),
            Path::new("/scans/ct/./b/a.raw")
        );
        for name in ["", "/etc/passwd", "../a.raw", "b/../../a.raw", "a\0b"] {
            assert!(beside(header, name).is_err(), "{name:?}");
        }
        assert!(beside(None, "a.raw").is_err());
    }
}
