use std::io;
use std::path::{Path, PathBuf};

use formats::{Fault, FormatError};

/// Why a document cannot be read or changed. It is unharmed then, on the disk and in memory.
#[derive(Debug, thiserror::Error)]
pub enum DocumentError {
    /// The file could not be read or written.
    #[error(transparent)]
    File(#[from] FormatError),
    /// Another program, or another part of this one, has it open.
    #[error("{} is open in another program; close it there first", .0.display())]
    InUse(PathBuf),
    /// There is a file of that name already.
    #[error("{} exists already; open it, or choose another name", .0.display())]
    Exists(PathBuf),
    /// An object's name cannot be used.
    #[error("{name:?} cannot be the name of an object: {why}")]
    Name {
        /// The name.
        name: String,
        /// What is wrong with it.
        why: &'static str,
    },
    /// No object has this name.
    #[error("there is no object {name:?}; there {}", found(.known))]
    NoObject {
        /// The name.
        name: String,
        /// Names of all objects.
        known: Vec<String>,
    },
    /// A placement cannot be used, or parents go in a circle.
    #[error("object {name:?}: {why}")]
    Properties {
        /// Name of the object.
        name: String,
        /// What is wrong with it.
        why: String,
    },
}

fn found(known: &[String]) -> String {
    match known {
        [] => "are none".into(),
        [one] => format!("is {one:?}"),
        many => format!(
            "are {}",
            many.iter()
                .map(|n| format!("{n:?}"))
                .collect::<Vec<_>>()
                .join(", ")
        ),
    }
}

pub(crate) fn io_error(path: &Path, doing: &'static str) -> impl FnOnce(io::Error) -> DocumentError {
    let path = path.to_path_buf();
    move |source| fault(&path, Fault::Io { doing, source })
}

pub(crate) fn damaged(path: &Path, what: impl Into<String>) -> DocumentError {
    fault(path, Fault::Damaged { what: what.into() })
}

pub(crate) fn fault(path: &Path, fault: Fault) -> DocumentError {
    let path = path.to_path_buf();
    FormatError { path, fault }.into()
}
