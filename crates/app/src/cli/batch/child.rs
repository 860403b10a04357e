//! One command of this program in a process of its own, watched: what it says, how far it has come, how it ends.

use std::ffi::OsString;
use std::io::{self, BufRead, BufReader, Read};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::ExitStatus;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

use fitting::Cancel;
use rustix::process::{Pid, setpriority_pgrp};
use serde_json::{Map, Value};

use super::super::cost::peak_rss_bytes_of;
use super::super::own::{self, Run};
use super::super::progress::told;
use super::super::quantity::human_number;
use super::manifest::Reason;

/// What bounds a command.
pub struct Bounds<'a> {
    /// Ends it.
    pub cancel: &'a Cancel,
    /// When it is ended, and after how long that is.
    pub deadline: Option<(Instant, Duration)>,
    /// Where it may keep what goes away with it.
    pub scratch: &'a Path,
    /// Whether it gives way to what else is to be done: a window is used meanwhile.
    pub is_aside: bool,
}

/// Why a command has no result.
pub enum Stop {
    /// The user said so.
    Cancelled,
    /// It failed.
    Failed(Reason),
}

/// The object that a command printed, or why there is none; and the most that it held, as far as that was seen.
pub struct Ended {
    /// What came of it.
    pub said: Result<Map<String, Value>, Stop>,
    /// Bytes.
    pub peak: Option<u64>,
}

/// Time between two looks at a cancel, the clock and the memory.
const LOOK: Duration = Duration::from_millis(25);
/// How nice it is, of 0 to 19, to what else is to be done.
const ASIDE: i32 = 10;
/// Most that a command may print.
const MOST: u64 = 64 << 20;
/// Characters of a message that are kept.
const LONGEST: usize = 2000;

enum Event {
    Progress(f64, String),
    Message(String),
    Object(Vec<u8>),
}

/// Runs `isoclay COMMAND --json ...`; `show` is told the stage and the share done.
pub fn ask(command: &str, arguments: &[OsString], bounds: &Bounds, show: &dyn Fn(&str, f64)) -> Ended {
    let fail = |e: io::Error| Ended {
        said: Err(Stop::Failed(Reason {
            stage: command.into(),
            exit_code: None,
            signal: None,
            message: format!("no process can be started for it ({e}); lower --jobs"),
        })),
        peak: None,
    };
    let (run, pipes) = match start(command, arguments, bounds.scratch) {
        Ok(started) => started,
        Err(e) => return fail(e),
    };
    if bounds.is_aside {
        // Where that cannot be said, it takes its half.
        let _ = setpriority_pgrp(Pid::from_raw(run.id as i32), ASIDE);
    }
    // Where memory runs out, the system shall rather end a fit than the batch.
    let _ = std::fs::write(format!("/proc/{}/oom_score_adj", run.id), "500");
    let (mut peak, mut lines, mut object, mut stopped) = (None, Vec::new(), Vec::new(), None);
    std::thread::scope(|scope| {
        let (send, events) = mpsc::channel();
        let of_errors = send.clone();
        let (stdout, stderr) = (pipes.stdout, pipes.stderr);
        scope.spawn(move || {
            for line in BufReader::new(stderr.take(MOST))
                .split(b'\n')
                .map_while(Result::ok)
            {
                let line = String::from_utf8_lossy(&line).into_owned();
                let event = match told(&line) {
                    Some((fraction, stage)) => Event::Progress(fraction, stage.into()),
                    None => Event::Message(line),
                };
                let _ = of_errors.send(event);
            }
        });
        scope.spawn(move || {
            let mut all = Vec::new();
            let _ = stdout.take(MOST).read_to_end(&mut all);
            let _ = send.send(Event::Object(all));
        });
        let mut looked = Instant::now();
        loop {
            match events.recv_timeout(LOOK) {
                Ok(Event::Progress(fraction, stage)) => show(&stage, fraction),
                Ok(Event::Message(line)) => lines.push(line),
                Ok(Event::Object(all)) => object = all,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if looked.elapsed() < LOOK {
                continue;
            }
            looked = Instant::now();
            peak = peak.max(peak_rss_bytes_of(run.id));
            if stopped.is_none() {
                stopped = stop(command, bounds, looked);
                if stopped.is_some() {
                    run.kill();
                }
            }
        }
    });
    let status = loop {
        match run.try_wait() {
            Ok(Some(status)) => break status,
            Err(e) => return fail(e),
            Ok(None) => {}
        }
        // It has closed what it prints to, but may still hang.
        if stopped.is_none() {
            stopped = stop(command, bounds, Instant::now());
        }
        if stopped.is_some() {
            run.kill();
        }
        std::thread::sleep(Duration::from_micros(200));
    };
    let object = last_object(&object);
    let said = match (stopped, object) {
        (Some(stop), _) => Err(stop),
        (None, Some(object)) if status.success() => {
            peak = peak.max(object.get("peak_rss_bytes").and_then(Value::as_u64));
            Ok(object)
        }
        (None, object) => Err(Stop::Failed(reason(command, status, object, &lines))),
    };
    Ended { said, peak }
}

fn start(command: &str, arguments: &[OsString], scratch: &Path) -> io::Result<(Run, own::Printed)> {
    let mut process = own::program()?;
    process
        .arg(command)
        .arg("--json")
        .args(arguments)
        .env("TMPDIR", scratch);
    // Ctrl-C at the terminal is for the batch alone, which ends its runs itself.
    process.process_group(0);
    own::bind(&mut process);
    Run::start(&mut process)
}

fn stop(command: &str, bounds: &Bounds, now: Instant) -> Option<Stop> {
    if bounds.cancel.is_cancelled() {
        return Some(Stop::Cancelled);
    }
    late(command, bounds.deadline, now).map(Stop::Failed)
}

/// The reason if the time is over.
pub fn late(stage: &str, deadline: Option<(Instant, Duration)>, now: Instant) -> Option<Reason> {
    let (_, limit) = deadline.filter(|(end, _)| now >= *end)?;
    Some(Reason {
        stage: stage.into(),
        exit_code: None,
        signal: None,
        message: format!(
            "was not done after {} s and was ended; raise --time-limit",
            human_number(limit.as_secs_f64())
        ),
    })
}

/// The object on the last line.
fn last_object(printed: &[u8]) -> Option<Map<String, Value>> {
    let last = printed.trim_ascii().rsplit(|b| *b == b'\n').next()?;
    serde_json::from_slice(last).ok()
}

fn reason(command: &str, status: ExitStatus, object: Option<Map<String, Value>>, lines: &[String]) -> Reason {
    let said = object.and_then(|o| Some(o.get("message")?.as_str()?.to_owned()));
    let panicked = lines.iter().position(|l| l.contains("panicked at"));
    let message = match (status.signal(), panicked, said) {
        (_, Some(at), _) => format!(
            "the program itself is at fault: {}; please report it with this file",
            lines[at..]
                .iter()
                .take(2)
                .map(|l| l.trim())
                .collect::<Vec<_>>()
                .join(" ")
        ),
        (Some(9), ..) => {
            "was ended by the system (signal 9), as it does where memory runs out; give --memory, or lower \
                          --jobs"
                .into()
        }
        (Some(signal), ..) => format!(
            "the process fell (signal {signal}): the program itself is at fault; please report it with this file"
        ),
        (None, None, Some(said)) => said,
        (None, None, None) => {
            let text = lines.join(" ");
            let text = text.trim();
            format!(
                "the process ended with {} and no word of why{}",
                status.code().unwrap_or(-1),
                if text.is_empty() {
                    String::new()
                } else {
                    format!(": {text}")
                }
            )
        }
    };
    Reason {
        stage: command.into(),
        exit_code: status.code(),
        signal: status.signal(),
        message: message.chars().take(LONGEST).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_end_has_a_reason() {
        let of = |raw: i32, said: Option<&str>, lines: &[&str]| {
            let object = said.map(|s| Map::from_iter([("message".into(), s.into())]));
            let lines: Vec<String> = lines.iter().map(|l| l.to_string()).collect();
            reason("fit", ExitStatus::from_raw(raw), object, &lines)
        };
        let bad = of(3 << 8, Some("a.ply: is empty"), &["isoclay: a.ply: is empty"]);
        assert_eq!(
            (bad.exit_code, bad.signal, &bad.message[..]),
            (Some(3), None, "a.ply: is empty")
        );
        let killed = of(9, None, &[]);
        assert_eq!((killed.exit_code, killed.signal), (None, Some(9)));
        assert!(killed.message.contains("memory"));
        assert!(of(11, None, &[]).message.contains("signal 11"));
        let panicked = of(
            101 << 8,
            None,
            &["", "thread 'main' panicked at a.rs:1:2:", "index out of bounds"],
        );
        assert!(panicked.message.contains("a.rs:1:2: index out of bounds"));
        assert!(of(7 << 8, None, &["word"]).message.ends_with("why: word"));
        assert!(of(7 << 8, None, &["x"; 10_000]).message.len() <= LONGEST);
    }

    #[test]
    fn the_last_line_counts() {
        assert_eq!(last_object(b"{\"a\":1}\n{\"b\":2}\n").unwrap()["b"], 2);
        assert!(last_object(b"").is_none() && last_object(b"[1]").is_none());
    }
}
