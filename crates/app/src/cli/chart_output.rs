//! Where charts and their figures go.

use std::io::{self, Write};

use serde::Serialize;

use super::failure::{Failure, OrFail, Outcome};
use super::staged::StagedFiles;
use crate::charts::Chart;

/// Figures as they come, one JSON object a line, where they are asked for.
pub struct JsonLines {
    asked: bool,
    closed: Option<io::Error>,
}

impl JsonLines {
    /// Prints nothing if not asked.
    pub fn new(asked: bool) -> Self {
        Self { asked, closed: None }
    }

    /// Prints a line. What goes wrong is told [at the end](Self::end).
    pub fn show(&mut self, line: &impl Serialize) {
        if self.asked && self.closed.is_none() {
            let text = serde_json::to_string(line).expect("a struct of plain fields is always JSON");
            self.closed = writeln!(io::stdout().lock(), "{text}").err();
        }
    }

    /// # Errors
    /// That a line could not be written.
    pub fn end(self) -> Outcome {
        self.closed.map_or(Ok(()), Err).or_limit()
    }
}

/// Draws charts into SUBJECT-NAME.svg.
pub fn write_charts(
    staged: &mut StagedFiles,
    subject: &str,
    charts: impl IntoIterator<Item = (impl std::fmt::Display, Chart)>,
) -> Outcome {
    for (name, chart) in charts {
        let svg = chart.svg().map_err(Failure::limit)?;
        staged.write_text(&format!("{subject}-{name}.svg"), &svg)?;
    }
    Ok(())
}
