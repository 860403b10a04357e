//! Files to write, standard output among them.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use formats::atomic::PassingDirectory;
use formats::{Fault, FormatError};

use super::failure::{Failure, OrFail, Outcome};
use super::overwrite::refuse_own_input;
use super::source::{Source, scratch};

/// A file to write. What has no name that tells a format (standard output, a pipe) is written under one that does
/// and copied when it is whole.
pub struct Output {
    /// Where writers write.
    path: PathBuf,
    /// What the user calls it; `None` is standard output.
    given: Option<PathBuf>,
    held: Option<PassingDirectory>,
}

impl Output {
    /// Checks an output before hours of work are spent on it. `option` is where the user named it, `formats` are the
    /// endings of names that will do, `format` the one that the user asks for, `inputs` what must not be overwritten.
    ///
    /// # Errors
    /// Wrong usage: a directory, another ending, no place to write in, an input.
    pub fn check(
        option: &str,
        given: &Path,
        formats: &[&str],
        format: Option<&str>,
        inputs: &[&Source],
    ) -> Outcome<Self> {
        let named = formats.iter().copied().find(|f| ends_in(given, f));
        if let (Some(named), Some(format)) = (named, format)
            && named != format
        {
            return Err(Failure::usage(format!(
                "--format {format}: {option} {} ends in .{named}; leave --format out or name another file",
                given.display()
            )));
        }
        if let Some(format) = format.filter(|f| !formats.contains(f)) {
            return Err(Failure::usage(format!(
                "--format {format}: what is written here can be .{}",
                formats.join(" or .")
            )));
        }
        let is_stdout = given == Path::new("-");
        if !is_stdout {
            check_place(option, given)?;
            for input in inputs {
                refuse_own_input(option, input, given)?;
            }
        }
        let is_device = given.metadata().is_ok_and(|m| !m.is_file() && !m.is_dir());
        let held = match (named, format) {
            (Some(_), _) if !is_stdout => None,
            (_, Some(format)) => Some(format),
            (None, None) if is_stdout || is_device => Some(formats[0]),
            _ => {
                return Err(Failure::usage(format!(
                    "{option} {}: the name tells no format that is written here; let it end in .{}",
                    given.display(),
                    formats.join(" or .")
                )));
            }
        };
        let given = (!is_stdout).then(|| given.to_path_buf());
        Ok(match held {
            None => Self {
                path: given.clone().unwrap_or_default(),
                given,
                held: None,
            },
            Some(format) => {
                let held = scratch("the output")?;
                Self {
                    path: held.path().join(format!("out.{format}")),
                    given,
                    held: Some(held),
                }
            }
        })
    }

    /// Where to write.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the user calls it.
    pub fn name(&self) -> String {
        self.given
            .as_ref()
            .map_or_else(|| "standard output".into(), |p| p.display().to_string())
    }

    /// Whether the data go to standard output, so that nothing else may.
    pub fn is_stdout(&self) -> bool {
        self.given.is_none()
    }

    /// An error of writing: a name that no format fits is wrong usage, all else a limit of the machine.
    pub fn writing(&self, e: FormatError) -> Failure {
        let message = if e.path == self.path {
            format!("{}: {}", self.name(), e.fault)
        } else {
            e.to_string()
        };
        match e.fault {
            Fault::UnknownKind { .. } | Fault::Directory => Failure::usage(message),
            _ => Failure::limit(message),
        }
    }

    /// Hands on what was written, once it is whole.
    pub fn finish(&self) -> Outcome {
        if self.held.is_none() {
            return Ok(());
        }
        let mut whole = File::open(&self.path).or_limit()?;
        match &self.given {
            None => {
                let mut out = io::stdout().lock();
                io::copy(&mut whole, &mut out)
                    .and_then(|_| out.flush())
                    .or_limit()
            }
            Some(given) => formats::atomic::replace(given, |out| io::copy(&mut whole, out).map(drop))
                .map_err(Failure::limit),
        }
    }
}

fn ends_in(path: &Path, format: &str) -> bool {
    path.file_name().is_some_and(|n| {
        n.to_string_lossy()
            .to_ascii_lowercase()
            .ends_with(&format!(".{format}"))
    })
}

/// Refuses a directory, and a file in a directory that is not there.
fn check_place(option: &str, given: &Path) -> Outcome {
    if given.is_dir() {
        return Err(Failure::usage(format!(
            "{option} {}: is a directory; name a file in it",
            given.display()
        )));
    }
    let directory = match given.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    if !directory.is_dir() {
        return Err(Failure::usage(format!(
            "{option} {}: there is no directory {}; make it first",
            given.display(),
            directory.display()
        )));
    }
    Ok(())
}
