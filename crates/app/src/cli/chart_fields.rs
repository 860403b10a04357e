use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::PathBuf;

use fitting::Cancel;

use super::failure::{Failure, OrFail, Outcome};
use super::interrupt;
use super::progress::Bar;
use super::staged::{StagedFiles, publish};
use crate::charts::{Chart, field_fit_costs};

/// Arguments of `isoclay charts fields`.
#[derive(clap::Args)]
pub struct Args {
    /// Directory for the chart fields.svg; made if missing
    #[arg(short, long, value_name = "DIR", default_value = "docs/charts")]
    output: PathBuf,
    /// Print one JSON object for each tool, and nothing else
    #[arg(long)]
    pub json: bool,
}

/// Measures tools on fields of three sizes, prints a line of JSON each, and draws them.
pub fn run(args: &Args, cancel: &Cancel) -> Outcome {
    let mut staged = StagedFiles::new("-o", &args.output)?;
    let bar = Bar::new();
    let costs = field_fit_costs(|fraction| {
        bar.show("carving", fraction);
        match cancel.is_cancelled() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    });
    bar.clear();
    interrupt::check(cancel)?;
    let costs = costs.unwrap_or_default();
    for tool in &costs {
        writeln!(io::stdout().lock(), "{}", tool.json()).or_limit()?;
    }
    let svg = Chart::of_field_fits(&costs).svg().map_err(Failure::limit)?;
    staged.write_text("fields.svg", &svg)?;
    publish(staged, args.json)
}
