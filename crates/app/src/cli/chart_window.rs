use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::PathBuf;

use fitting::Cancel;

use super::failure::{Failure, OrFail, Outcome};
use super::interrupt;
use super::progress::Bar;
use super::staged::{StagedFiles, publish};
use crate::charts::{Chart, window_costs};
use crate::view::Card;

/// Arguments of `isoclay charts window`.
#[derive(clap::Args)]
pub struct Args {
    /// Directory for the chart window.svg; made if missing
    #[arg(short, long, value_name = "DIR", default_value = "docs/charts")]
    output: PathBuf,
    /// Print one JSON object for each field, and nothing else
    #[arg(long)]
    pub json: bool,
}

/// Measures what the window shows of fields of several sizes, prints a line of JSON each, and draws them.
pub fn run(args: &Args, cancel: &Cancel) -> Outcome {
    let mut staged = StagedFiles::new("-o", &args.output)?;
    let card = Card::open().map_err(Failure::limit)?;
    let bar = Bar::new();
    let costs = window_costs(&card, |fraction| {
        bar.show("drawing", fraction);
        match cancel.is_cancelled() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    });
    bar.clear();
    interrupt::check(cancel)?;
    let costs = costs.map_err(Failure::limit)?.unwrap_or_default();
    for field in &costs {
        let mut line = field.json();
        line["card"] = card.name.clone().into();
        writeln!(io::stdout().lock(), "{line}").or_limit()?;
    }
    let svg = Chart::of_window(&costs).svg().map_err(Failure::limit)?;
    staged.write_text("window.svg", &svg)?;
    publish(staged, args.json)
}
