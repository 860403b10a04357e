use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::PathBuf;

use fitting::Cancel;

use super::failure::{Failure, OrFail, Outcome};
use super::fineness::failed;
use super::progress::Bar;
use super::quantity::between;
use super::staged::{StagedFiles, publish};
use crate::charts::{Chart, edit_costs};

/// Arguments of `isoclay charts edits`.
#[derive(clap::Args)]
pub struct Args {
    /// Coefficients of the largest field, about; 10 million take 2 GiB, 100 million 20 GiB
    #[arg(long, value_name = "N", default_value_t = 10_000_000, value_parser = between::<u32>(100_000, 1_000_000_000))]
    most: u32,
    /// Directory for the chart edits.svg; made if missing
    #[arg(short, long, value_name = "DIR", default_value = "docs/charts")]
    output: PathBuf,
    /// Print one JSON object for each field, and nothing else
    #[arg(long)]
    pub json: bool,
}

/// Measures fields of growing size, prints a line of JSON each, and draws them.
pub fn run(args: &Args, cancel: &Cancel) -> Outcome {
    let mut staged = StagedFiles::new("-o", &args.output)?;
    let bar = Bar::new();
    let go_on = |fraction| {
        bar.show("editing", fraction);
        if cancel.is_cancelled() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let costs = edit_costs(args.most as usize, go_on);
    bar.clear();
    let costs = costs.map_err(failed)?;
    for field in &costs {
        writeln!(io::stdout().lock(), "{}", field.json()).or_limit()?;
    }
    let svg = Chart::of_edits(&costs).svg().map_err(Failure::limit)?;
    staged.write_text("edits.svg", &svg)?;
    publish(staged, args.json)
}
