//! This program run once more by itself: only a process of its own has a time and a memory of its own, and only a
//! process of its own takes nothing with it when it falls.

use std::ffi::OsString;
use std::io::{self, Read};
use std::iter::once;
use std::path::PathBuf;
use std::process::{Child, ChildStderr, ChildStdout, Command, ExitStatus, Output, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde_json::{Map, Value};

use super::failure::{Failure, OrFail, Outcome};

/// The runs under way, by number.
static RUNNING: Mutex<Vec<(u32, Child)>> = Mutex::new(Vec::new());

/// Names the process that a run belongs to, so that it ends with it and tells it how far it has come.
const PARENT: &str = "ISOCLAY_PARENT";

fn running() -> MutexGuard<'static, Vec<(u32, Child)>> {
    RUNNING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A run under way. It is ended when this is dropped.
pub struct Run {
    /// Number of its process.
    pub id: u32,
}

/// What a run prints.
pub struct Printed {
    /// Its standard output.
    pub stdout: ChildStdout,
    /// Its standard error.
    pub stderr: ChildStderr,
}

/// This program, also where its file has been replaced meanwhile.
pub fn program() -> io::Result<Command> {
    let exe = if cfg!(target_os = "linux") {
        PathBuf::from("/proc/self/exe")
    } else {
        std::env::current_exe()?
    };
    let command = Command::new(exe);
    #[cfg(test)]
    let command = tests::as_program(command);
    Ok(command)
}

/// Has the run end as soon as the thread that starts it does, and print how far it has come.
pub fn bind(command: &mut Command) {
    command.env(PARENT, std::process::id().to_string());
}

impl Run {
    /// Starts `command`, with nothing to read.
    pub fn start(command: &mut Command) -> io::Result<(Self, Printed)> {
        command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        // Held while it starts: none may begin behind the back of `end`.
        let mut running = running();
        let mut child = command.spawn()?;
        let pipes = child.stdout.take().zip(child.stderr.take());
        let id = child.id();
        running.push((id, child));
        drop(running);
        let run = Self { id };
        let (stdout, stderr) = pipes.ok_or(io::ErrorKind::BrokenPipe)?;
        Ok((run, Printed { stdout, stderr }))
    }

    /// How it ended, if it has.
    pub fn try_wait(&self) -> io::Result<Option<ExitStatus>> {
        let mut running = running();
        let own = running.iter_mut().find(|(id, _)| *id == self.id);
        own.ok_or(io::ErrorKind::NotFound)?.1.try_wait()
    }

    /// Ends it at once.
    pub fn kill(&self) {
        if let Some((_, child)) = running().iter_mut().find(|(id, _)| *id == self.id) {
            // One that has ended already is just as good.
            let _ = child.kill();
        }
    }

    /// Waits for the end of a run that has closed what it prints to, and so is about to end.
    pub fn wait(&self) -> io::Result<ExitStatus> {
        loop {
            if let Some(status) = self.try_wait()? {
                return Ok(status);
            }
            std::thread::sleep(Duration::from_micros(200));
        }
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        let own = {
            let mut running = running();
            let at = running.iter().position(|(id, _)| *id == self.id);
            at.map(|at| running.swap_remove(at).1)
        };
        if let Some(mut child) = own {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// Runs a command, with nothing to read, and gathers what it prints.
pub fn output(command: &mut Command) -> io::Result<Output> {
    let (run, mut pipes) = Run::start(command)?;
    let (mut stdout, mut stderr) = (Vec::new(), Vec::new());
    std::thread::scope(|scope| {
        let errors = scope.spawn(|| pipes.stderr.read_to_end(&mut stderr));
        let read = pipes.stdout.read_to_end(&mut stdout);
        errors.join().unwrap_or_else(|p| std::panic::resume_unwind(p))?;
        read
    })?;
    Ok(Output {
        status: run.wait()?,
        stdout,
        stderr,
    })
}

/// Runs a subcommand of this program with `--json` and reads its last line.
pub fn ask(subcommand: &str, arguments: impl Iterator<Item = OsString>) -> Outcome<Map<String, Value>> {
    let arguments = once(subcommand.into()).chain(arguments);
    let mut command = program().or_limit()?;
    let out = output(command.args(arguments).arg("--json")).or_limit()?;
    let last = out
        .stdout
        .trim_ascii()
        .rsplit(|b| *b == b'\n')
        .next()
        .unwrap_or_default();
    match serde_json::from_slice(last) {
        Ok(Value::Object(object)) if out.status.success() => Ok(object),
        _ => {
            let said = String::from_utf8_lossy(&out.stderr);
            let said = said.trim().trim_start_matches("isoclay: ");
            Err(Failure::input(format!("{subcommand}: {said}")))
        }
    }
}

/// Ends the runs under way, and lets none begin any more: for a program that is about to exit, whose files such a run
/// would go on writing.
pub fn end() {
    let mut running = running();
    for (_, child) in running.iter_mut() {
        let _ = child.kill();
    }
    for (_, child) in running.iter_mut() {
        let _ = child.wait();
    }
    std::mem::forget(running);
}

/// Whether this process is such a run, and is to tell how far it has come.
pub fn is_bound() -> bool {
    std::env::var_os(PARENT).is_some()
}

/// In such a run: sees to it that it ends with its parent. To be called first of all.
pub fn follow() {
    #[cfg(target_os = "linux")]
    if let Some(parent) = std::env::var(PARENT).ok().and_then(|p| p.parse::<i32>().ok()) {
        use rustix::process::{Signal, getppid, set_parent_process_death_signal};
        // Not the one that cannot be caught: the run shall take its temporary files with it.
        let _ = set_parent_process_death_signal(Some(Signal::TERM));
        // The parent may have gone before that was asked for.
        if getppid().is_none_or(|p| p.as_raw_nonzero().get() != parent) {
            std::process::exit(4);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The file that these tests run in is the program when it is told to run the test below alone, and after that what to do.
    pub fn as_program(mut tests: Command) -> Command {
        let this = "cli::own::tests::this_is_the_program_too";
        tests.args(["--quiet", "--nocapture", "--exact", this, "--"]);
        tests
    }

    /// Among the other tests it has nothing to do.
    #[test]
    fn this_is_the_program_too() {
        let line: Vec<OsString> = std::env::args_os().skip_while(|a| a != "--").collect();
        if !line.is_empty() {
            std::process::exit(crate::cli::obey(&line).into());
        }
    }

    #[test]
    fn the_program_answers_and_refuses() {
        let scratch = tempfile::tempdir().unwrap();
        let cloud = scratch.path().join("ball.ply");
        let line =
            |count: &str| ["sphere", "-o", cloud.to_str().unwrap(), "--count", count].map(OsString::from);
        let said = ask("phantom", line("500").into_iter());
        assert!(said.is_ok_and(|said| said.contains_key("peak_rss_bytes")));
        let refused = ask("phantom", line("no").into_iter());
        assert!(refused.is_err_and(|why| why.to_string().contains("--count")));
    }
}
