//! This program run once more by itself: only a process of its own has a time and a memory of its own.

use std::ffi::OsString;
use std::io::{self, Read};
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The run under way; one at a time.
static RUNNING: Mutex<Option<Child>> = Mutex::new(None);

fn running() -> MutexGuard<'static, Option<Child>> {
    RUNNING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs this program with `arguments` and gathers what it prints.
pub fn run(arguments: impl Iterator<Item = OsString>) -> io::Result<Output> {
    let (mut out, mut err) = {
        let mut running = running();
        let mut child = Command::new(std::env::current_exe()?)
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()?;
        let pipes = (child.stdout.take(), child.stderr.take());
        *running = Some(child);
        pipes
    };
    let (mut stdout, mut stderr) = (Vec::new(), Vec::new());
    std::thread::scope(|scope| {
        let errors = scope.spawn(|| err.as_mut().map_or(Ok(0), |e| e.read_to_end(&mut stderr)));
        let read = out.as_mut().map_or(Ok(0), |o| o.read_to_end(&mut stdout));
        errors.join().unwrap_or_else(|p| std::panic::resume_unwind(p))?;
        read
    })?;
    let ended = running().take().map(|mut child| child.wait());
    Ok(Output {
        status: ended.ok_or(io::ErrorKind::NotFound)??,
        stdout,
        stderr,
    })
}

/// Ends the run under way, and lets none begin any more: for a program that is about to exit, whose files such a run
/// would go on writing.
pub fn end() {
    let mut running = running();
    if let Some(child) = running.as_mut() {
        // One that has ended already is just as good.
        let _ = child.kill();
        let _ = child.wait();
    }
    std::mem::forget(running);
}
