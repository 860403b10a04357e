//! How far a batch has come: a line for all of it and one for each input under way, with the time left.

use std::io::{IsTerminal, Write};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::json;

use super::super::end::print_quietly;
use super::super::progress::STEPS;
use super::super::quantity::human_number;
use super::gather::Item;
use super::manifest::{Entry, State};

/// What an input takes besides what its bytes take, in bytes: the start of its processes and its first grid.
const START: f64 = (64 << 10) as f64;

/// Work done and to do, in bytes.
#[derive(Clone, Debug, Default)]
struct Work {
    total: f64,
    done: f64,
    /// Weight and share of the inputs under way, one a job.
    under_way: Vec<(f64, f64)>,
    count: usize,
}

impl Work {
    /// The share done of what had to be done.
    fn fraction(&self) -> f64 {
        let partly: f64 = self.under_way.iter().map(|(w, f)| w * f).sum();
        if self.total > 0.0 {
            ((self.done + partly) / self.total).clamp(0.0, 1.0)
        } else {
            1.0
        }
    }

    /// Time that the rest takes at the pace so far; none before there is one.
    fn left(&self, elapsed: Duration) -> Option<Duration> {
        let f = self.fraction();
        let left = elapsed.as_secs_f64() * (1.0 - f) / f;
        (f > 0.0 && left.is_finite()).then(|| Duration::try_from_secs_f64(left).unwrap_or(Duration::MAX))
    }
}

/// What is shown. On a terminal bars on stderr; elsewhere a line for each input that has ended, as text on stderr or as
/// an object on stdout.
pub struct Board {
    work: Mutex<Work>,
    start: Instant,
    count: usize,
    json: bool,
    bars: Option<(ProgressBar, Vec<ProgressBar>, MultiProgress)>,
}

fn weight(item: &Item) -> f64 {
    START + item.bytes as f64
}

impl Board {
    /// A board for these inputs and so many jobs.
    pub fn new<'a>(items: impl Iterator<Item = &'a Item>, jobs: usize, json: bool) -> Self {
        let weights: Vec<f64> = items.map(weight).collect();
        let bars = std::io::stderr().is_terminal().then(|| {
            let all = MultiProgress::with_draw_target(ProgressDrawTarget::stderr_with_hz(10));
            let style = |template: &str| {
                ProgressStyle::with_template(template)
                    .expect("the template is a constant that parses")
                    .progress_chars("━╸─")
            };
            let whole = all.add(ProgressBar::new(STEPS));
            whole.set_style(style("{prefix:26!} {bar:36} {percent:>3} %  {msg}"));
            let each = (0..jobs)
                .map(|_| {
                    let bar = all.add(ProgressBar::new(STEPS));
                    bar.set_style(style("{prefix:26!} {bar:36} {percent:>3} %  {msg}"));
                    bar
                })
                .collect();
            (whole, each, all)
        });
        Self {
            work: Mutex::new(Work {
                total: weights.iter().sum(),
                under_way: vec![(0.0, 0.0); jobs],
                ..Work::default()
            }),
            start: Instant::now(),
            count: weights.len(),
            json,
            bars,
        }
    }

    fn work(&self) -> MutexGuard<'_, Work> {
        self.work.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// An input of a job is under way.
    pub fn show(&self, job: usize, item: &Item, stage: &str, fraction: f64) {
        let mut work = self.work();
        work.under_way[job] = (weight(item), fraction.clamp(0.0, 1.0));
        if let Some((_, each, _)) = &self.bars {
            let name = item.path.file_name().unwrap_or_default().to_string_lossy();
            // Control characters of a name would draw on the screen.
            each[job].set_prefix(
                name.chars()
                    .map(|c| if c.is_control() { '?' } else { c })
                    .collect::<String>(),
            );
            each[job].set_message(stage.to_owned());
            each[job].set_position((fraction * STEPS as f64) as u64);
        }
        self.draw(&work);
    }

    /// An input has ended; `is_kept` if it was done before.
    pub fn ended(&self, job: usize, item: &Item, entry: &Entry, is_kept: bool) {
        let mut work = self.work();
        work.count += 1;
        work.under_way[job] = (0.0, 0.0);
        // What was done before tells nothing of the pace.
        if is_kept {
            work.total -= weight(item);
        } else {
            work.done += weight(item);
        }
        self.draw(&work);
        let line = text(&work, self.count, entry, is_kept);
        if self.json {
            let object = json!({
                "ended": work.count,
                "of": self.count,
                "input": entry.input,
                "state": entry.state,
                "kept": is_kept,
                "reason": entry.failure.as_ref().map(|f| &f.message),
                "seconds": entry.seconds,
                "seconds_left": work.left(self.start.elapsed()).map(|t| t.as_secs_f64()),
            });
            print_quietly(&object.to_string());
        } else {
            match &self.bars {
                Some((.., all)) => drop(all.println(line)),
                None => drop(writeln!(std::io::stderr().lock(), "{line}")),
            }
        }
    }

    fn draw(&self, work: &Work) {
        if let Some((whole, ..)) = &self.bars {
            whole.set_prefix(format!("{} of {} inputs", work.count, self.count));
            whole.set_position((work.fraction() * STEPS as f64) as u64);
            whole.set_message(
                work.left(self.start.elapsed())
                    .map_or_else(String::new, |t| format!("{} left", time(t))),
            );
        }
    }

    /// Takes the bars off the screen.
    pub fn clear(&self) {
        if let Some((_, _, all)) = &self.bars {
            let _ = all.clear();
        }
    }
}

/// A line for an input that has ended, without what would move a terminal's cursor.
fn text(work: &Work, count: usize, entry: &Entry, is_kept: bool) -> String {
    let figure = |key: &str| entry.fit.get(key).and_then(serde_json::Value::as_f64);
    let ended = match (&entry.state, &entry.failure) {
        (State::Done, _) if is_kept => "was done before".into(),
        (State::Done, _) => format!(
            "error rms {}, {:.2} s",
            figure("rms").map_or("unknown".into(), human_number),
            entry.seconds
        ),
        (State::Failed, reason) => format!("FAILED: {}", reason.as_ref().map_or("", |r| r.message.as_str())),
    };
    let digits = count.to_string().len();
    format!("{:>digits$} of {count}  {}  {ended}", work.count, entry.input)
        .chars()
        .map(|c| if c.is_control() { '?' } else { c })
        .collect()
}

fn time(t: Duration) -> String {
    let s = t.as_secs();
    match s {
        0..60 => format!("{s} s"),
        60..3600 => format!("{} min {:02} s", s / 60, s % 60),
        _ => format!("{} h {:02} min", s / 3600, s % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_left_follows_the_pace_of_the_work_done() {
        let mut work = Work {
            total: 100.0,
            under_way: vec![(0.0, 0.0); 2],
            ..Work::default()
        };
        assert_eq!(work.left(Duration::from_secs(5)), None, "no pace yet");
        work.under_way = vec![(40.0, 0.25), (20.0, 0.5)];
        assert_eq!(work.left(Duration::from_secs(5)), Some(Duration::from_secs(20)));
        work.under_way = vec![(0.0, 0.0); 2];
        work.done = 100.0;
        assert_eq!(work.left(Duration::from_secs(5)), Some(Duration::ZERO));
        work.total = 0.0;
        assert_eq!(work.fraction(), 1.0, "all was done before");
    }

    #[test]
    fn times_for_people() {
        let of = |s| time(Duration::from_secs(s));
        assert_eq!([of(7), of(61), of(7260)], ["7 s", "1 min 01 s", "2 h 01 min"]);
    }
}
