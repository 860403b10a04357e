use std::io;
use std::path::{Path, PathBuf};

/// A [`Fault`] and the file it was met in.
#[derive(Debug, thiserror::Error)]
#[error("{}: {fault}", path.display())]
pub struct FormatError {
    /// The file, as the caller named it.
    pub path: PathBuf,
    /// What is wrong with it.
    #[source]
    pub fault: Fault,
}

/// What can be wrong with a file; each says what was met, the value, and what would help.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// The operating system refused.
    #[error("{doing} failed: {source}{}", io_remedy(source))]
    Io {
        /// What was being done.
        doing: &'static str,
        /// What the system said.
        source: io::Error,
    },
    /// A directory stands where a file is needed.
    #[error("is a directory; name a file")]
    Directory,
    /// The file has no bytes.
    #[error("is empty (0 bytes); was it copied whole?")]
    Empty,
    /// Neither content nor name tell what this is.
    #[error("{found} is not a supported {purpose}; supported: {supported}")]
    UnknownKind {
        /// What the name or the first bytes are.
        found: String,
        /// What it was wanted for.
        purpose: &'static str,
        /// Everything that would do.
        supported: &'static str,
    },
    /// The file ends before what its header promises.
    #[error(
        "ends too early: {what} needs {needed} bytes, {found} are there; \
         the file was cut off or its header is wrong, fetch it again"
    )]
    Truncated {
        /// The part that is cut.
        what: String,
        /// Bytes the part needs.
        needed: u64,
        /// Bytes left.
        found: u64,
    },
    /// A checksum or a compressed stream does not hold.
    #[error("is damaged: {what}; fetch the file again or take a backup")]
    Damaged {
        /// Which part, and how that was seen.
        what: String,
    },
    /// The text or header breaks its format.
    #[error("{place}: {what}; {remedy}")]
    Syntax {
        /// Where.
        place: Place,
        /// What is there.
        what: String,
        /// What would help.
        remedy: &'static str,
    },
    /// A well-formed value that cannot be used.
    #[error("{what} is {value}; {remedy}")]
    Value {
        /// Name of the value.
        what: &'static str,
        /// The value.
        value: String,
        /// What would help.
        remedy: &'static str,
    },
    /// Something that the caller has to choose or to allow first.
    #[error("{what} is {value}; {remedy}")]
    Choose {
        /// Name of the value.
        what: &'static str,
        /// The value.
        value: String,
        /// What would help.
        remedy: &'static str,
        /// What of the reader's options is meant.
        choice: Choice,
    },
    /// Reading would hold more bytes than allowed.
    #[error(
        "{what} would need {needed} bytes, the ceiling is {limit}; \
         raise the memory ceiling if the file is trusted"
    )]
    Limit {
        /// What would be held.
        what: &'static str,
        /// Bytes held at once with it.
        needed: u64,
        /// Ceiling given by the caller.
        limit: u64,
    },
    /// One of several files is at fault.
    #[error("in {file}: {fault}")]
    Inside {
        /// Its name, below the path that was asked for.
        file: String,
        /// What is wrong with it.
        fault: Box<Fault>,
    },
    /// The output has no room for what is to be written.
    #[error("cannot hold {what} of {value}; {remedy}")]
    Output {
        /// What does not fit.
        what: &'static str,
        /// Its value.
        value: String,
        /// What would help.
        remedy: &'static str,
    },
}

/// An option of the readers that a [`Fault::Choose`] asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// [`crate::volumes::DicomOptions::series`].
    Series,
    /// [`crate::volumes::DicomOptions::uneven`].
    Uneven,
    /// [`crate::volumes::VolumeOptions::volume`].
    Volume,
}

/// A place in a file, for messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Line, counted from 1.
    Line(u64),
    /// Byte offset of the (inflated) content, counted from 0.
    Byte(u64),
    /// Row of an element, counted from 0.
    Row(&'static str, u64),
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Line(n) => write!(f, "line {n}"),
            Self::Byte(n) => write!(f, "byte {n}"),
            Self::Row(element, n) => write!(f, "{element} {n}"),
        }
    }
}

impl Fault {
    /// Adds the file's name.
    pub fn at(self, path: &Path) -> FormatError {
        FormatError {
            path: path.to_path_buf(),
            fault: self,
        }
    }

    /// For a file of a family that this build leaves out.
    #[allow(dead_code, reason = "a build with all families leaves none out")]
    pub(crate) fn left_out(what: impl std::fmt::Display, family: &str) -> Self {
        Self::UnknownKind {
            found: format!("{what}, whose family «{family}» this program was built without,"),
            purpose: "file",
            supported: "the formats of the families that it was built with",
        }
    }

    /// The choice that is asked for, if one would help.
    pub fn choice(&self) -> Option<Choice> {
        match self {
            Self::Choose { choice, .. } => Some(*choice),
            Self::Inside { fault, .. } => fault.choice(),
            _ => None,
        }
    }

    /// Adds the name of one of several files. A limit stays as it is: it is a matter of them all.
    pub(crate) fn inside(self, file: &str) -> Self {
        match self {
            Self::Limit { .. } | Self::Inside { .. } => self,
            fault => Self::Inside {
                file: file.into(),
                fault: Box::new(fault),
            },
        }
    }

    pub(crate) fn line(line: u64, what: impl Into<String>, remedy: &'static str) -> Self {
        Self::Syntax {
            place: Place::Line(line),
            what: what.into(),
            remedy,
        }
    }
}

fn io_remedy(e: &io::Error) -> &'static str {
    match e.kind() {
        io::ErrorKind::NotFound => "; check the path",
        io::ErrorKind::PermissionDenied => "; check the permissions",
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge => {
            "; free some space, an earlier file of this name is untouched"
        }
        io::ErrorKind::ReadOnlyFilesystem => "; write somewhere else",
        _ => "",
    }
}

/// At most 40 characters of foreign text, made printable, for an error message.
pub(crate) fn excerpt(bytes: &[u8]) -> String {
    excerpt_of(bytes, 40)
}

/// At most `most` characters of it.
pub(crate) fn excerpt_of(bytes: &[u8], most: usize) -> String {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(4 * most)]);
    let mut short: String = text.chars().take(most).flat_map(char::escape_default).collect();
    if text.chars().count() > most || bytes.len() > 4 * most {
        short.push('…');
    }
    format!("\"{short}\"")
}
