use std::path::PathBuf;

use fitting::{Cancel, FitError};

use super::chart_output::{JsonLines, write_charts};
use super::cost::cpu_seconds;
use super::failure::{Failure, Outcome};
use super::progress::Bar;
use super::staged::{StagedFiles, publish};
use crate::charts::{Chart, DynamicsError, Extent, Line, Run, cost, sampling, sweep};

/// Arguments of `isoclay charts dynamics`.
#[derive(clap::Args)]
pub struct Args {
    /// Directory for the charts dynamics-NAME.svg; made if missing
    #[arg(short, long, value_name = "DIR", default_value = "docs/charts")]
    output: PathBuf,
    /// Small patches only: takes seconds
    #[arg(long, conflicts_with = "all")]
    quick: bool,
    /// All sizes up to 32 coefficients an axis, all patterns, contrasts and steps: takes hours
    #[arg(long)]
    all: bool,
    /// Print one JSON object for each configuration
    #[arg(long)]
    pub json: bool,
}

/// Measures steps, sampling and cost, and draws them.
pub fn run(args: &Args, cancel: &Cancel) -> Outcome {
    let mut staged = StagedFiles::new("-o", &args.output)?;
    let extent = match (args.quick, args.all) {
        (true, _) => Extent::Quick,
        (_, true) => Extent::All,
        _ => Extent::Charts,
    };
    let bar = Bar::new();
    let mut json = JsonLines::new(args.json);
    let mut show = |line: &Line| json.show(line);
    let mut go_on = |fraction: f64| {
        bar.show("measuring", fraction);
        !cancel.is_cancelled()
    };
    let mut run = Run {
        clock: cpu_seconds,
        go_on: &mut go_on,
        show: &mut show,
    };
    let lines = sweep(extent, &mut run).map_err(failed)?;
    let profiles = sampling(extent, &mut run).map_err(failed)?;
    let costs = cost(extent, &mut run).map_err(failed)?;
    bar.clear();
    json.end()?;
    let mut charts = Chart::of_steps(&lines);
    charts.extend(Chart::of_sampling(&profiles));
    charts.push(("cost".into(), Chart::of_cost(&costs)));
    write_charts(&mut staged, "dynamics", charts)?;
    publish(staged, args.json)
}

fn failed(e: DynamicsError) -> Failure {
    match e {
        DynamicsError::Cancelled => FitError::Cancelled.into(),
        e => Failure::limit(e),
    }
}
