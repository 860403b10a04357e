use std::path::PathBuf;

use fitting::{Cancel, FitError};

use super::chart_output::{JsonLines, write_charts};
use super::cost::cpu_seconds;
use super::failure::{Failure, Outcome};
use super::progress::Bar;
use super::staged::{StagedFiles, publish};
use crate::charts::{Chart, mask_costs};

/// Arguments of `isoclay charts masks`.
#[derive(clap::Args)]
pub struct Args {
    /// Directory for the charts masks-NAME.svg; made if missing
    #[arg(short, long, value_name = "DIR", default_value = "docs/charts")]
    output: PathBuf,
    /// The smallest box only: takes seconds
    #[arg(long)]
    quick: bool,
    /// Print one JSON object for each way, size and mask
    #[arg(long)]
    pub json: bool,
}

/// Measures the ways to step what is left of a box, and draws them.
pub fn run(args: &Args, cancel: &Cancel) -> Outcome {
    let mut staged = StagedFiles::new("-o", &args.output)?;
    let bar = Bar::new();
    let mut json = JsonLines::new(args.json);
    let costs = mask_costs(args.quick, cpu_seconds, |cost, fraction| {
        bar.show("measuring", fraction);
        json.show(cost);
        !cancel.is_cancelled()
    });
    bar.clear();
    if cancel.is_cancelled() {
        return Err(FitError::Cancelled.into());
    }
    let costs = costs.map_err(Failure::limit)?;
    json.end()?;
    write_charts(&mut staged, "masks", Chart::of_masks(&costs))?;
    publish(staged, args.json)
}
