use std::io::IsTerminal;

use fitting::{Cancel, Control};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A bar on stderr with the stage, the share done and the time left; silent where stderr is no terminal.
#[derive(Clone)]
pub struct Bar(ProgressBar);

/// Steps that stand for the whole work.
const STEPS: u64 = 1000;

impl Bar {
    /// An empty bar.
    pub fn new() -> Self {
        let bar = if std::io::stderr().is_terminal() {
            ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr_with_hz(10))
        } else {
            ProgressBar::hidden()
        };
        let style = ProgressStyle::with_template("{msg:26!} {bar:36} {percent:>3} %  {eta} left")
            .expect("the template is a constant that parses");
        bar.set_style(style.progress_chars("━╸─"));
        Self(bar)
    }

    /// Shows `stage` and the share done, `0..=1`.
    pub fn show(&self, stage: &'static str, fraction: f64) {
        self.0.set_message(stage);
        self.0
            .set_position((fraction.clamp(0.0, 1.0) * STEPS as f64) as u64);
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
        self.0.finish_and_clear();
    }
}
