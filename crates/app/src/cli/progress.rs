use std::io::{IsTerminal, Write};
use std::sync::{Arc, Mutex, PoisonError};

use fitting::{Cancel, Control};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::own;

/// A bar on stderr with the stage, the share done and the time left; silent where stderr is no terminal. In a run that
/// belongs to another process it prints lines for that one instead.
#[derive(Clone)]
pub enum Bar {
    /// For people.
    Drawn(ProgressBar),
    /// For the parent: what was told last.
    Told(Arc<Mutex<(&'static str, u64)>>),
}

/// Steps that stand for the whole work.
pub const STEPS: u64 = 1000;
/// Steps between two lines for the parent.
const STRIDE: u64 = 10;
/// How a line for the parent begins; no message does.
const MARK: &str = "\u{1}progress ";

impl Bar {
    /// An empty bar.
    pub fn new() -> Self {
        if own::is_bound() {
            return Self::Told(Arc::new(Mutex::new(("", 0))));
        }
        let bar = if std::io::stderr().is_terminal() {
            ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr_with_hz(10))
        } else {
            ProgressBar::hidden()
        };
        let style = ProgressStyle::with_template("{msg:26!} {bar:36} {percent:>3} %  {eta} left")
            .expect("the template is a constant that parses");
        bar.set_style(style.progress_chars("━╸─"));
        Self::Drawn(bar)
    }

    /// Shows `stage` and the share done, `0..=1`.
    pub fn show(&self, stage: &'static str, fraction: f64) {
        let step = (fraction.clamp(0.0, 1.0) * STEPS as f64) as u64;
        match self {
            Self::Drawn(bar) => {
                bar.set_message(stage);
                bar.set_position(step);
            }
            Self::Told(last) => {
                let mut last = last.lock().unwrap_or_else(PoisonError::into_inner);
                if last.0 != stage || last.1.abs_diff(step) >= STRIDE {
                    *last = (stage, step);
                    // A parent that has gone ends this process anyway.
                    let _ = writeln!(std::io::stderr().lock(), "{MARK}{step} {stage}");
                }
            }
        }
    }

    /// Shows what work under this control has done, and lets a flag stop it.
    pub fn control(&self, cancel: &Cancel) -> Control {
        let shown = self.clone();
        Control {
            cancel: cancel.clone(),
            on_progress: Box::new(move |p| shown.show(p.stage, p.fraction)),
            ..Control::default()
        }
    }

    /// Takes the bar off the screen.
    pub fn clear(&self) {
        if let Self::Drawn(bar) = self {
            bar.finish_and_clear();
        }
    }
}

/// The share done and the stage that a line of a run tells, if it tells them.
pub fn told(line: &str) -> Option<(f64, &str)> {
    let (step, stage) = line.strip_prefix(MARK)?.split_once(' ')?;
    Some((step.parse::<u64>().ok()? as f64 / STEPS as f64, stage))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_for_the_parent_are_told_from_messages() {
        assert_eq!(
            told("\u{1}progress 250 level 3: solving"),
            Some((0.25, "level 3: solving"))
        );
        assert_eq!(told("isoclay: progress 250 of it"), None);
        assert_eq!(told("\u{1}progress much of it"), None);
    }
}
