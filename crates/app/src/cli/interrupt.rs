use std::sync::LazyLock;
#[cfg(feature = "window")]
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use fitting::Cancel;

use super::end;
use super::failure::{Failure, Outcome};

/// Raised by the first Ctrl-C or SIGTERM.
static ASKED: LazyLock<Cancel> = LazyLock::new(Cancel::new);

/// Time that work under way has to end in order after it was asked to; then the program ends wherever it is.
const GRACE: Duration = Duration::from_millis(150);
/// The same of a window, which has a stroke to end and a document to close.
#[cfg(feature = "window")]
const WINDOW_GRACE: Duration = Duration::from_secs(5);

/// Whether a window is open.
#[cfg(feature = "window")]
static IN_WINDOW: AtomicBool = AtomicBool::new(false);

/// Lets Ctrl-C (and SIGTERM) end the program with exit code 4: in order where the work looks at [`cancel`], and after
/// [`GRACE`] in any case. No half-written file is left.
pub fn listen() -> Outcome {
    ctrlc::set_handler(|| {
        ASKED.cancel();
        std::thread::sleep(grace());
        end::now(fitting::FitError::Cancelled.into())
    })
    .map_err(|e| Failure::limit(format!("cannot listen for Ctrl-C: {e}")))
}

fn grace() -> Duration {
    #[cfg(feature = "window")]
    if IN_WINDOW.load(Ordering::Relaxed) {
        return WINDOW_GRACE;
    }
    GRACE
}

/// A window is open, and closes when it is asked to.
#[cfg(feature = "window")]
pub fn in_window() -> Cancel {
    IN_WINDOW.store(true, Ordering::Relaxed);
    cancel()
}

/// The flag that Ctrl-C raises.
pub fn cancel() -> Cancel {
    ASKED.clone()
}

/// Gives way to a cancel between two stages of work.
pub fn check(cancel: &Cancel) -> Outcome {
    if cancel.is_cancelled() {
        Err(fitting::FitError::Cancelled.into())
    } else {
        Ok(())
    }
}
