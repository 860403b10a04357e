use std::path::PathBuf;

use fitting::{Cancel, FitError};
use formats::field::AnyField;

use super::chart_output::{JsonLines, write_charts};
use super::cost::cpu_seconds;
use super::failure::{Failure, Outcome};
use super::field::OpenField;
use super::progress::Bar;
use super::source::{FIELDS, Source};
use super::staged::{StagedFiles, publish};
use crate::charts::{Sculpture, ToolLine, ToolRun, ToolsError, tool_costs};

/// Arguments of `isoclay charts tools`.
#[derive(clap::Args)]
pub struct Args {
    /// Fields (.iclay) on which loops of force tools are timed beside the built-in scenes
    fields: Vec<PathBuf>,
    /// Directory for the charts tools-NAME.svg; made if missing
    #[arg(short, long, value_name = "DIR", default_value = "docs/charts")]
    output: PathBuf,
    /// Small scenes only: takes seconds
    #[arg(long)]
    quick: bool,
    /// Print one JSON object for each tool and setting
    #[arg(long)]
    pub json: bool,
}

/// Measures force tools, and draws them.
pub fn run(args: &Args, cancel: &Cancel) -> Outcome {
    let mut staged = StagedFiles::new("-o", &args.output)?;
    let open = |path: &PathBuf| {
        let source = Source::open(path, None, FIELDS, cancel)?;
        let open = OpenField::load(&source)?;
        let iso = open.iso_or(None, &source)?;
        let field = match open.levels()? {
            AnyField::F32(field) => field.clone(),
            AnyField::F64(_) => {
                return Err(Failure::input(format!(
                    "{}: force tools work in single precision; fit it with --precision f32",
                    source.name()
                )));
            }
        };
        let name = path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        Ok(Sculpture { name, field, iso })
    };
    let sculptures: Vec<Sculpture> = args.fields.iter().map(open).collect::<Outcome<_>>()?;
    let bar = Bar::new();
    let mut json = JsonLines::new(args.json);
    let mut show = |line: &ToolLine| json.show(line);
    let mut go_on = |fraction: f64| {
        bar.show("pulling", fraction);
        !cancel.is_cancelled()
    };
    let costs = tool_costs(
        &sculptures,
        &mut ToolRun {
            quick: args.quick,
            clock: cpu_seconds,
            go_on: &mut go_on,
            show: &mut show,
        },
    );
    bar.clear();
    let costs = costs.map_err(|e| match e {
        ToolsError::Cancelled => FitError::Cancelled.into(),
        e => Failure::limit(e),
    })?;
    json.end()?;
    write_charts(&mut staged, "tools", costs.charts())?;
    publish(staged, args.json)
}
