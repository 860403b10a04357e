use std::sync::atomic::{AtomicBool, Ordering};

use fitting::Cancel;

use super::failure::{Failure, Outcome};

/// Lets Ctrl-C (and SIGTERM) raise `cancel`, so that the work ends in order and leaves nothing half-written.
/// A second Ctrl-C ends the program at once, with the same exit code.
pub fn cancel_on_interrupt(cancel: &Cancel) -> Outcome {
    static ASKED: AtomicBool = AtomicBool::new(false);
    let cancel = cancel.clone();
    ctrlc::set_handler(move || {
        cancel.cancel();
        if ASKED.swap(true, Ordering::Relaxed) {
            std::process::exit(4);
        }
    })
    .map_err(|e| Failure::limit(format!("cannot listen for Ctrl-C: {e}")))
}

/// Gives way to a cancel between two stages of work.
pub fn check(cancel: &Cancel) -> Outcome {
    if cancel.is_cancelled() {
        Err(fitting::FitError::Cancelled.into())
    } else {
        Ok(())
    }
}
