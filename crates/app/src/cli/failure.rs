use std::fmt;
use std::io;

use fitting::FitError;

use super::flags;

/// What a subcommand gives back.
pub type Outcome<T = ()> = Result<T, Failure>;

/// Whose fault it was; decides the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cause {
    /// The command line contradicts itself or the input (2).
    Usage,
    /// A file is missing, damaged, or cannot stand for a solid (3).
    Input,
    /// Memory, disk, threads, or the user said stop (4).
    Limit,
}

/// An error with its exit code.
#[derive(Debug)]
pub struct Failure {
    cause: Cause,
    error: anyhow::Error,
}

impl Failure {
    /// Wrong usage: exit code 2.
    pub fn usage(message: impl fmt::Display) -> Self {
        Self {
            cause: Cause::Usage,
            error: anyhow::anyhow!("{message}"),
        }
    }

    /// Bad input: exit code 3.
    pub fn input(message: impl fmt::Display) -> Self {
        Self {
            cause: Cause::Input,
            error: anyhow::anyhow!("{message}"),
        }
    }

    /// A limit was reached, or the work was cancelled: exit code 4.
    pub fn limit(message: impl fmt::Display) -> Self {
        Self {
            cause: Cause::Limit,
            error: anyhow::anyhow!("{message}"),
        }
    }

    /// The exit code.
    pub fn code(&self) -> u8 {
        match self.cause {
            Cause::Usage => 2,
            Cause::Input => 3,
            Cause::Limit => 4,
        }
    }

    /// Whether the reader of stdout went away, which ends the work but is no error.
    pub fn is_broken_pipe(&self) -> bool {
        self.error
            .chain()
            .filter_map(|e| e.downcast_ref::<io::Error>())
            .any(|e| e.kind() == io::ErrorKind::BrokenPipe)
    }

    /// One line of JSON: the exit code, the message, and the part of it that says what would help.
    pub fn json(&self) -> String {
        let message = self.to_string();
        error_object(self.code(), &message, remedy(&message))
    }

    /// Puts `subject` (a file, mostly) before the message.
    pub fn about(self, subject: impl fmt::Display) -> Self {
        Self {
            cause: self.cause,
            error: self.error.context(subject.to_string()),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        // The whole chain of contexts on one line.
        write!(f, "{:#}", self.error)
    }
}

/// An error as `--json` prints it.
pub fn error_object(code: u8, message: &str, remedy: Option<&str>) -> String {
    serde_json::json!({ "exit_code": code, "message": message, "remedy": remedy }).to_string()
}

/// What would help: messages have it behind their last semicolon.
fn remedy(message: &str) -> Option<&str> {
    message.rsplit_once("; ").map(|(_, remedy)| remedy)
}

/// Sorts an error under an exit code.
pub trait OrFail<T> {
    /// Exit code 3.
    fn or_input(self) -> Outcome<T>;
    /// Exit code 4.
    fn or_limit(self) -> Outcome<T>;
}

impl<T, E: Into<anyhow::Error>> OrFail<T> for Result<T, E> {
    fn or_input(self) -> Outcome<T> {
        self.map_err(|e| Failure {
            cause: Cause::Input,
            error: e.into(),
        })
    }
    fn or_limit(self) -> Outcome<T> {
        self.map_err(|e| Failure {
            cause: Cause::Limit,
            error: e.into(),
        })
    }
}

impl From<FitError> for Failure {
    fn from(e: FitError) -> Self {
        if let FitError::Option {
            option,
            value,
            requirement,
        } = e
        {
            let option = option.trim_start_matches("--").replace('_', "-");
            return Self::usage(format!("--{option} {value}: {requirement}"));
        }
        let cause = match e {
            FitError::Cancelled | FitError::MemoryLimit { .. } => Cause::Limit,
            FitError::NotEnoughSamples { .. } | FitError::Degenerate(_) => Cause::Input,
            FitError::Option { .. } => Cause::Usage,
        };
        Self {
            cause,
            error: anyhow::anyhow!(flags::named(&e.to_string())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn broken_pipe_is_found_below_its_context() {
        let e = Err::<(), _>(io::Error::from(io::ErrorKind::BrokenPipe))
            .or_limit()
            .unwrap_err();
        assert!(e.about("standard output").is_broken_pipe());
        assert!(!Failure::input("broken pipe").is_broken_pipe());
    }

    #[test]
    fn an_error_as_json_has_its_code_and_its_remedy() {
        let object: serde_json::Value =
            serde_json::from_str(&Failure::input("a.ply: is empty; was \"it\" copied?").json()).unwrap();
        assert_eq!(object["exit_code"], 3);
        assert_eq!(object["message"], "a.ply: is empty; was \"it\" copied?");
        assert_eq!(object["remedy"], "was \"it\" copied?");
        assert!(Failure::input("no").json().contains("null"));
    }

    #[test]
    fn exit_codes_follow_the_cause() {
        assert_eq!(Failure::from(FitError::Cancelled).code(), 4);
        assert_eq!(
            Failure::from(FitError::MemoryLimit { needed: 2, limit: 1 }).code(),
            4
        );
        assert_eq!(
            Failure::from(FitError::NotEnoughSamples { found: 1, needed: 4 }).code(),
            3
        );
        let option = FitError::Option {
            option: "--smoothing",
            value: -1.0,
            requirement: "it must be positive",
        };
        assert_eq!(Failure::from(option).code(), 2);
        assert_eq!(
            Failure::input("no such file").about("a.ply").to_string(),
            "a.ply: no such file"
        );
    }
}
