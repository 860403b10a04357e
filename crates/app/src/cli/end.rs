//! The end of the program from wherever it is: no temporary file stays, and the last word is its own.

use std::io::{self, Write};
use std::sync::{Mutex, OnceLock, PoisonError, mpsc};
use std::time::Duration;

use super::failure::Failure;
use super::own;

/// Whether errors are printed as JSON too, and whether standard output is taken by data.
static ERRORS: OnceLock<(bool, bool)> = OnceLock::new();

/// Has errors printed as objects too: on standard output, or on standard error if the other takes data.
pub fn tell_as(json: bool, data_on_stdout: bool) {
    let _ = ERRORS.set((json, data_on_stdout));
}

/// Whether the last word has been said.
static TOLD: Mutex<bool> = Mutex::new(false);

/// Prints an error, as text and as the user asked for besides. Only the first one counts.
pub fn tell(failure: &Failure) {
    tell_with(failure, |form| match form {
        Some((true, false)) => print_quietly(&failure.json()),
        Some((true, true)) => eprint_quietly(&failure.json()),
        _ => {}
    });
}

/// Prints an error as text, for a command whose own last object holds it too: `object`.
pub fn tell_within(failure: &Failure, object: &str) {
    tell_with(failure, |form| {
        if matches!(form, Some((true, _))) {
            print_quietly(object);
        }
    });
}

fn tell_with(failure: &Failure, as_object: impl FnOnce(Option<&(bool, bool)>)) {
    // Held while it is said: who comes second may end the program when this returns.
    let mut told = TOLD.lock().unwrap_or_else(PoisonError::into_inner);
    if std::mem::replace(&mut *told, true) {
        return;
    }
    eprint_quietly(&format!("isoclay: {failure}"));
    as_object(ERRORS.get());
}

/// Ends the program at once.
pub fn now(failure: Failure) -> ! {
    crate::devices::leave_all();
    own::end();
    formats::atomic::abandon();
    let code = failure.code();
    // Somebody may hold standard output, in front of a pipe that nobody reads.
    let (told, done) = mpsc::channel();
    let teller = std::thread::Builder::new().spawn(move || {
        tell(&failure);
        let _ = told.send(());
    });
    if teller.is_ok() {
        let _ = done.recv_timeout(Duration::from_millis(100));
    }
    std::process::exit(i32::from(code))
}

/// Prints a line; a closed pipe is nobody's loss.
pub fn print_quietly(line: &str) {
    let mut out = io::stdout().lock();
    let _ = writeln!(out, "{line}").and_then(|()| out.flush());
}

fn eprint_quietly(line: &str) {
    let _ = writeln!(io::stderr().lock(), "{line}");
}
