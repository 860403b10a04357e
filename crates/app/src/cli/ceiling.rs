//! The user's ceiling on memory.
//!
//! Fits and readers estimate what they need before they take it, and say what is missing. What no estimate foresees, the
//! system refuses: beyond the ceiling it gives no more memory, and the program ends with exit code 4.

use std::sync::OnceLock;

use fitting::{Control, FitError};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use super::cost::{data_bytes, rss_bytes};
use super::end;
use super::failure::{Failure, OrFail, Outcome};
use super::quantity::{Memory, human_bytes};
#[cfg(feature = "window")]
use crate::view::BUDGET;

static CEILING: OnceLock<Memory> = OnceLock::new();

/// What the process may hold above the ceiling, in all: pages of the program itself, stacks, and room that the allocator
/// cannot give back.
const SLACK: u64 = 10 << 20;
/// Share of the ceiling that may be lost between blocks.
const LOST: f64 = 0.05;
/// What the program holds before it has read anything.
pub const PROGRAM: u64 = 12 << 20;
/// What a process holds that only watches others, with the figures of some thousand inputs.
const OVERSEER: u64 = 32 << 20;
/// With less no file at all can be fitted.
const LEAST: u64 = 32 << 20;
/// Addresses of a thread's stack, of which it holds hardly any memory.
const STACK: u64 = 2 << 20;

/// Has the system refuse memory beyond `ceiling`, and names it to [`limit`]. To be called before any thread of the pool
/// runs.
///
/// # Errors
/// Exit code 4 if the program alone holds more, or the system sets no such limit.
pub fn hold(ceiling: Memory) -> Outcome {
    let (Some(data), Some(resident)) = (data_bytes(), rss_bytes()) else {
        return Err(Failure::limit(
            "--memory: this system does not tell what a process holds",
        ));
    };
    let total = (ceiling.0 as f64 * (1.0 + LOST)) as u64 + SLACK;
    let Some(left) = total.checked_sub(resident) else {
        return Err(Failure::limit(format!(
            "--memory {}: the program alone holds {}; raise --memory",
            human_bytes(ceiling.0),
            human_bytes(resident)
        )));
    };
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get() as u64);
    let old = getrlimit(Resource::Data);
    let limit = Rlimit {
        current: Some((data + left + threads * STACK).min(old.maximum.unwrap_or(u64::MAX))),
        maximum: old.maximum,
    };
    setrlimit(Resource::Data, limit)
        .map_err(|e| anyhow::anyhow!("--memory: the system refuses the limit ({e})"))
        .or_limit()?;
    let _ = CEILING.set(ceiling);
    Ok(())
}

/// What each of `jobs` processes may be told to hold, so that all of them and this one stay below `whole` together, slack
/// included; `None` if that is too little to work with.
pub fn share(whole: Memory, jobs: usize) -> Option<Memory> {
    let of_one = (whole.0.checked_sub(OVERSEER)? / jobs as u64).checked_sub(SLACK)?;
    let told = (of_one as f64 / (1.0 + LOST)) as u64;
    (told >= LEAST).then_some(Memory(told))
}

/// Ends the program because an allocation of `size` bytes was refused. Comes back only if there is no memory for the end
/// either.
pub fn out_of_memory(size: usize) {
    // The end needs some itself.
    if limit().is_some() {
        let maximum = getrlimit(Resource::Data).maximum;
        let _ = setrlimit(
            Resource::Data,
            Rlimit {
                current: maximum,
                maximum,
            },
        );
    }
    let held = rss_bytes().map_or_else(String::new, |held| format!("holds {} and ", human_bytes(held)));
    let work = format!("the work {held}needs {} more", human_bytes(size as u64));
    end::now(Failure::limit(match limit() {
        Some(ceiling) => format!(
            "--memory {}: {work}; raise --memory, or ask for less: a coarser result, or a part of the input",
            human_bytes(ceiling.0)
        ),
        None => format!(
            "the system gives no more memory: {work}; free some, or give --memory, within which the work is planned"
        ),
    }))
}

/// The ceiling of the whole process, if the user gave one.
pub fn limit() -> Option<Memory> {
    CEILING.get().copied()
}

/// What a process beside this one may hold: what is left of the user's ceiling, and no more than three quarters of what the system can
/// spare, if either is known.
#[cfg(feature = "window")]
pub fn of_another() -> Option<Memory> {
    let left = limit().map(|Memory(most)| most.saturating_sub(rss_bytes().unwrap_or(0)).max(LEAST));
    let spare = spare_bytes().map(|spare| (spare / 4 * 3).max(LEAST));
    left.into_iter().chain(spare).min().map(Memory)
}

/// What bricks on a graphics card may take, which is often this process's own memory: a quarter of the user's ceiling, if there is one.
#[cfg(feature = "window")]
pub fn of_bricks() -> u64 {
    limit().map_or(BUDGET, |Memory(most)| BUDGET.min(most / 4))
}

/// Bytes that the system can give without swapping.
#[cfg(feature = "window")]
fn spare_bytes() -> Option<u64> {
    let told = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = told.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim_end().parse().ok()?;
    Some(kib << 10)
}

/// Whether the process holds more than it may: for work that looks up now and then and can say what it was.
pub fn is_exceeded() -> bool {
    match (limit(), rss_bytes()) {
        (Some(Memory(limit)), Some(resident)) => resident > limit,
        _ => false,
    }
}

/// A memory limit in terms of the whole process, which is what the user gave.
pub fn explain(e: FitError, control: &Control) -> Failure {
    match (&e, control.memory_limit, limit()) {
        (FitError::MemoryLimit { needed, limit }, Some(_), Some(Memory(given))) => {
            // Rounded up, so that what is advised suffices.
            let enough = (given + needed.saturating_sub(*limit)).div_ceil(1 << 20);
            Failure::limit(format!(
                "the fit needs about {}, and --memory {} leaves it {} beside the program and the input; raise --memory to \
                 {enough}MiB or lower --max-depth",
                human_bytes(*needed),
                human_bytes(given),
                human_bytes(*limit),
            ))
        }
        _ => e.into(),
    }
}
