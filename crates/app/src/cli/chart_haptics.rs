use std::path::PathBuf;

use fitting::{Cancel, FitError};

use super::chart_output::{JsonLines, write_charts};
use super::failure::Outcome;
use super::progress::Bar;
use super::staged::{StagedFiles, publish};
use crate::charts::{HapticLine, HapticRun, haptic_costs};

/// Arguments of `isoclay charts haptics`.
#[derive(clap::Args)]
pub struct Args {
    /// Directory for the charts haptics-NAME.svg; made if missing
    #[arg(short, long, value_name = "DIR", default_value = "docs/charts")]
    output: PathBuf,
    /// Small sizes only: takes seconds
    #[arg(long)]
    quick: bool,
    /// Print one JSON object for each scene and model
    #[arg(long)]
    pub json: bool,
}

/// Measures touch, and draws it.
pub fn run(args: &Args, cancel: &Cancel) -> Outcome {
    let mut staged = StagedFiles::new("-o", &args.output)?;
    let bar = Bar::new();
    let mut json = JsonLines::new(args.json);
    let mut show = |line: &HapticLine| json.show(line);
    let mut go_on = |fraction: f64| {
        bar.show("touching", fraction);
        !cancel.is_cancelled()
    };
    let costs = haptic_costs(&mut HapticRun {
        quick: args.quick,
        go_on: &mut go_on,
        show: &mut show,
    });
    bar.clear();
    let costs = costs.map_err(|_| FitError::Cancelled)?;
    json.end()?;
    write_charts(&mut staged, "haptics", costs.charts())?;
    publish(staged, args.json)
}
