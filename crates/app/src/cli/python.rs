//! The Python that a command runs scripts with.

use std::path::{Path, PathBuf};
use std::process::Command;

use super::failure::{Failure, Outcome};
use super::own;

/// The one that the user names, which has to be there, or the system's.
pub fn chosen(given: Option<&Path>) -> Outcome<PathBuf> {
    let Some(given) = given else {
        return Ok("python3".into());
    };
    let why = match own::output(Command::new(given).arg("--version")) {
        Ok(out) if out.status.success() => return Ok(given.into()),
        Ok(out) => format!("it ends with {}", out.status),
        Err(e) => e.to_string(),
    };
    Err(Failure::usage(format!(
        "--python {}: cannot be run ({why}); name a Python, such as venv/bin/python",
        given.display()
    )))
}
