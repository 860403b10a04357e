//! Work in threads of its own: the interpreter is free meanwhile, signals are heard, progress is told.

use std::any::Any;
use std::num::NonZeroUsize;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use fitting::{Cancel, Control, Progress};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::failure::{Failure, lost};

/// How often signals are looked for. Well below the 50 ms in which a Ctrl-C is to be heard.
const TICK: Duration = Duration::from_millis(10);

/// Stops work from another thread.
///
/// Give it to a function as ``cancel=`` and call :meth:`cancel` from anywhere; the function raises
/// :class:`isoclay.errors.Cancelled` soon after.
#[pyclass(frozen, module = "isoclay._isoclay")]
#[derive(Default)]
pub struct CancelToken(Cancel);

#[pymethods]
impl CancelToken {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// Asks all work that has this token to stop.
    fn cancel(&self) {
        self.0.cancel();
    }

    /// Whether someone asked.
    #[getter]
    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }
}

/// How a caller wants a piece of work to be done.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Wishes {
    threads: Option<NonZeroUsize>,
    memory: Option<u64>,
    progress: Option<Py<PyAny>>,
    cancel: Option<Py<CancelToken>>,
}

enum Event<R> {
    Progress(Progress),
    Done(R),
}

/// Does `work` and returns what it gives.
///
/// The calling thread waits without the interpreter, hears signals if it is the main thread, and calls back with the progress.
/// Whatever comes up there is raised at once: `work` is told to stop and left to end by itself, for which it owns all it needs.
///
/// # Errors
/// Those of `work`; of signals and of the callback; [`Failure::Cancelled`].
pub fn run<R: Send + 'static>(
    py: Python<'_>,
    wishes: &Wishes,
    work: impl FnOnce(&mut Control) -> Result<R, Failure> + Send + 'static,
) -> PyResult<R> {
    let pool = pool(wishes.threads)?;
    let outside = wishes.cancel.as_ref().map(|token| token.get().0.clone());
    let cancel = Cancel::new();
    let (sender, mut receiver) = mpsc::channel();
    let told = sender.clone();
    let mut control = Control {
        on_progress: Box::new(move |progress| drop(told.send(Event::Progress(progress)))),
        cancel: cancel.clone(),
        memory_limit: wishes.memory,
    };
    let thread = std::thread::Builder::new()
        .name("isoclay".into())
        .spawn(move || {
            let done = pool.install(|| work(&mut control));
            // Nobody listens any more after a signal.
            drop(sender.send(Event::Done(done)));
        })
        .map_err(|e| Failure::value(format!("cannot start a thread ({e}); lower threads")))?;
    let mut is_told = false;
    loop {
        let event;
        (receiver, event) = py.detach(move || {
            let event = receiver.recv_timeout(TICK);
            (receiver, event)
        });
        let heard = match event {
            Ok(Event::Done(done)) => {
                let done = done?;
                if !is_told {
                    tell(
                        py,
                        wishes,
                        Progress {
                            stage: "done",
                            fraction: 1.0,
                        },
                    )?;
                }
                return Ok(done);
            }
            Ok(Event::Progress(progress)) => {
                is_told = progress.fraction >= 1.0;
                tell(py, wishes, progress)
            }
            Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => {
                return Err(lost(&thread.join().map_or_else(why, |()| "no answer".into())));
            }
        };
        let heard = heard.and_then(|()| py.check_signals());
        if let Err(error) = heard {
            cancel.cancel();
            return Err(error);
        }
        if outside.as_ref().is_some_and(Cancel::is_cancelled) {
            cancel.cancel();
            return Err(Failure::Cancelled.into());
        }
    }
}

/// Does short work that nobody needs to hear of.
///
/// All that may share its work among threads has to go this way or by [`run`]: the library's own threads do not live in forks.
///
/// # Errors
/// Those of `work`; no threads.
pub fn brief<R: Send>(py: Python<'_>, work: impl FnOnce() -> Result<R, Failure> + Send) -> PyResult<R> {
    let pool = pool(None)?;
    py.detach(|| pool.install(work)).map_err(Into::into)
}

fn tell(py: Python<'_>, wishes: &Wishes, progress: Progress) -> PyResult<()> {
    if let Some(callback) = &wishes.progress {
        callback.call1(py, (progress.stage, progress.fraction))?;
    }
    Ok(())
}

fn why(panic: Box<dyn Any + Send>) -> String {
    let text = panic.downcast_ref::<&str>().map(ToString::to_string);
    text.or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_default()
}

struct Kept {
    process: u32,
    threads: Option<NonZeroUsize>,
    pool: Arc<ThreadPool>,
}

/// The threads of the last call, for the next one.
static KEPT: Mutex<Option<Kept>> = Mutex::new(None);

/// Threads to work with: as many as asked for, or one a core. Those of a process do not live in its forks, which get their own.
fn pool(threads: Option<NonZeroUsize>) -> PyResult<Arc<ThreadPool>> {
    let process = std::process::id();
    let new = || {
        let builder = ThreadPoolBuilder::new().thread_name(|n| format!("isoclay-{n}"));
        let pool = builder.num_threads(threads.map_or(0, NonZeroUsize::get)).build();
        pool.map(Arc::new)
            .map_err(|e| Failure::value(format!("cannot start threads ({e}); lower threads")).into())
    };
    // Held by a thread that a fork left behind, it would never be free again.
    let Ok(mut kept) = KEPT.try_lock() else {
        return new();
    };
    if let Some(k) = kept.as_ref()
        && k.process == process
        && k.threads == threads
    {
        return Ok(k.pool.clone());
    }
    let pool = new()?;
    let next = Kept {
        process,
        threads,
        pool: pool.clone(),
    };
    if let Some(old) = kept.replace(next)
        && old.process != process
    {
        // Its threads are not here to be ended.
        std::mem::forget(old);
    }
    Ok(pool)
}
