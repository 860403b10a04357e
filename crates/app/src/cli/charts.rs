use std::ffi::OsString;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use fitting::Cancel;
use fitting::phantoms::Solid;
use formats::Kind;
use serde_json::Value;

#[cfg(feature = "window")]
use super::chart_window;
use super::failure::{Failure, OrFail, Outcome};
use super::interrupt;
use super::own;
use super::phantom::Name;
use super::progress::Bar;
use super::quantity::between;
use super::source::{SAMPLES, Source, scratch};
use super::staged::{StagedFiles, publish};
use super::{
    chart_all, chart_dynamics, chart_edits, chart_fields, chart_haptics, chart_masks, chart_mesh,
    chart_orient, chart_tools,
};
use crate::charts::{Chart, Configuration, Input, Measurement, Scene, noise, outliers, sweeps};

/// Arguments of `isoclay charts`.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    subject: Subject,
}

#[derive(clap::Subcommand)]
enum Subject {
    /// Error of fits against their time and memory, over tolerance, depth, smoothing and precision
    Fit(FitArgs),
    /// How many normals are estimated wrongly, against the time that their estimation takes
    Orient(chart_orient::Args),
    /// Error of a step's increment against its time, over solvers, laws, schemes and steps; sampling; cost by size
    Dynamics(chart_dynamics::Args),
    /// Error and time of steps of regions that are no box, over the ways to solve them, sizes and masks
    Masks(chart_masks::Args),
    /// Distance of meshes from the surface of their field against triangles and time
    Mesh(chart_mesh::Args),
    /// Time of edits, and of what follows from them, against the size of the field
    Edits(chart_edits::Args),
    /// Time of writing a tool's work back into a field, against the size of its box
    Fields(chart_fields::Args),
    /// Force tools: exactness of integrals, sampling and number of paths against the error; times of whole loops
    Tools(chart_tools::Args),
    /// Touch: accuracy of contact against the cost of a tick, over snapshots, searches and methods; scenes; sizes of fields
    Haptics(chart_haptics::Args),
    /// The window: time to show a dab of a tool, and to draw, against the size of the field
    #[cfg(feature = "window")]
    Window(chart_window::Args),
    /// All of these with their usual inputs, each in a process of its own: takes an hour and more
    All(chart_all::Args),
    /// Noise against the resolution chosen and the error, and outliers against the error with and without --robust
    Hard(HardArgs),
}

#[derive(clap::Args)]
struct HardArgs {
    /// Phantom to add noise and outliers to
    #[arg(default_value = "gyroid", value_parser = solids())]
    solid: Solid,
    /// Directory for the charts noise-NAME.svg and outliers-NAME.svg; made if missing
    #[arg(short, long, value_name = "DIR", default_value = "docs/charts")]
    output: PathBuf,
}

/// Names of solids, as clouds are made of them.
fn solids() -> impl TypedValueParser<Value = Solid> {
    PossibleValuesParser::new(Solid::ALL.map(Solid::name)).try_map(|name| {
        Solid::ALL
            .into_iter()
            .find(|s| s.name() == name)
            .ok_or("no solid")
    })
}

#[derive(clap::Args)]
struct FitArgs {
    /// Clouds and volumes to fit: files, or phantom:NAME and phantom:NAME:NOISE for 50 000 points of a phantom,
    /// whose errors are measured against its true surface
    #[arg(default_values = ["phantom:gyroid", "phantom:tetrahedron:0.5%", "data/bunny.obj.gz", "data/head.nii.gz"])]
    inputs: Vec<String>,
    /// Directory for the charts fit-NAME-time.svg and fit-NAME-memory.svg; made if missing
    #[arg(short, long, value_name = "DIR", default_value = "docs/charts")]
    output: PathBuf,
    /// Runs of each configuration, of which the median time is shown
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = between::<u8>(1, 255))]
    runs: u8,
    /// Print one JSON object for each configuration
    #[arg(long)]
    json: bool,
}

impl Args {
    /// Whether figures are printed as JSON.
    pub fn json(&self) -> bool {
        match &self.subject {
            Subject::Fit(a) => a.json,
            Subject::Dynamics(a) => a.json,
            Subject::Masks(a) => a.json,
            Subject::Edits(a) => a.json,
            Subject::Fields(a) => a.json,
            Subject::Tools(a) => a.json,
            Subject::Haptics(a) => a.json,
            #[cfg(feature = "window")]
            Subject::Window(a) => a.json,
            Subject::Orient(_) | Subject::Mesh(_) | Subject::Hard(_) | Subject::All(_) => false,
        }
    }
}

/// Runs the sweeps and draws the charts.
pub fn run(args: &Args) -> Outcome {
    let cancel = interrupt::cancel();
    match &args.subject {
        Subject::Fit(args) => fits(args, &cancel),
        Subject::Orient(args) => chart_orient::run(args, &cancel),
        Subject::Dynamics(args) => chart_dynamics::run(args, &cancel),
        Subject::Masks(args) => chart_masks::run(args, &cancel),
        Subject::Mesh(args) => chart_mesh::run(args, &cancel),
        Subject::Edits(args) => chart_edits::run(args, &cancel),
        Subject::Fields(args) => chart_fields::run(args, &cancel),
        Subject::Tools(args) => chart_tools::run(args, &cancel),
        Subject::Haptics(args) => chart_haptics::run(args, &cancel),
        #[cfg(feature = "window")]
        Subject::Window(args) => chart_window::run(args, &cancel),
        Subject::Hard(args) => hard(args, &cancel),
        Subject::All(args) => chart_all::run(args, &cancel),
    }
}

/// Draws what noise and outliers do to a phantom.
fn hard(args: &HardArgs, cancel: &Cancel) -> Outcome {
    let mut staged = StagedFiles::new("-o", &args.output)?;
    let solid = args.solid;
    let scene = Scene::new(solid).ok_or_else(|| Failure::input("the phantom has no surface"))?;
    let bar = Bar::new();
    let show = |fraction| bar.show("fitting", fraction);
    for (kind, chart) in [
        ("noise", noise(&scene, solid.name(), show)),
        ("outliers", outliers(&scene, solid.name(), show)),
    ] {
        interrupt::check(cancel)?;
        let svg = chart?.svg().map_err(Failure::limit)?;
        staged.write_text(&format!("{kind}-{}.svg", solid.name()), &svg)?;
        bar.clear();
    }
    publish(staged, false)
}

fn fits(args: &FitArgs, cancel: &Cancel) -> Outcome {
    let scratch = scratch("the runs")?;
    for input in &args.inputs {
        let mut staged = StagedFiles::new("-o", &args.output)?;
        let subject = match input.strip_prefix("phantom:") {
            Some(phantom) => Prepared::phantom(phantom, scratch.path())?,
            None => Prepared::file(Path::new(input))?,
        };
        let configurations = sweeps(subject.kind);
        let bar = Bar::new();
        let mut measured = Vec::new();
        for (i, configuration) in configurations.iter().enumerate() {
            interrupt::check(cancel)?;
            bar.show("fitting", i as f64 / configurations.len() as f64);
            let m = subject.measure(configuration, args.runs, scratch.path())?;
            if args.json {
                writeln!(io::stdout().lock(), "{}", m.json(&subject.name)).or_limit()?;
            }
            measured.push(m);
        }
        bar.clear();
        for (suffix, x_title, key, unit) in [
            (
                "time",
                "processor time of the whole process, s",
                "cpu_seconds",
                1.0,
            ),
            (
                "memory",
                "peak memory of the whole process, MiB",
                "peak_rss_bytes",
                1048576.0,
            ),
        ] {
            let title = format!("{}: {}", subject.name, subject.title);
            let chart = Chart::of_fit(title, x_title, key, unit, subject.y_title.clone(), &measured);
            let svg = chart.svg().map_err(Failure::limit)?;
            staged.write_text(&format!("fit-{}-{suffix}.svg", subject.name), &svg)?;
        }
        publish(staged, args.json)?;
    }
    Ok(())
}

/// What is fitted, and what the errors are measured at.
struct Prepared {
    kind: Input,
    name: String,
    title: String,
    y_title: String,
    fitted: PathBuf,
    measured: PathBuf,
}

impl Prepared {
    /// `NAME` or `NAME:NOISE`.
    fn phantom(phantom: &str, scratch: &Path) -> Outcome<Self> {
        let (name, noise) = phantom
            .split_once(':')
            .map_or((phantom, None), |(name, noise)| (name, Some(noise)));
        let (fitted, measured) = (scratch.join("fitted.ply"), scratch.join("measured.ply"));
        if Name::from_str(name, false).is_err() {
            let names: Vec<String> = Name::value_variants()
                .iter()
                .filter_map(|n| Some(n.to_possible_value()?.get_name().to_string()))
                .filter(|n| n != "head")
                .collect();
            return Err(Failure::usage(format!(
                "phantom:{phantom}: is no phantom; write phantom:NAME or phantom:NAME:NOISE, NAME one of {}",
                names.join(", ")
            )));
        }
        let make = |path: &Path, options: &[&str]| {
            let fixed = [name, "--count", "50000", "-o"].map(OsString::from).into_iter();
            own::ask(
                "phantom",
                fixed
                    .chain([path.into()])
                    .chain(options.iter().map(OsString::from)),
            )
        };
        make(&fitted, &noise.map_or(vec![], |n| vec!["--noise", n]))?;
        // Other points of the true surface.
        make(&measured, &["--seed", "2"])?;
        let noisy = noise.map_or(String::new(), |n| format!(" with noise of {n}"));
        Ok(Self {
            kind: Input::Cloud,
            name: if noise.is_some() {
                format!("{name}-noisy")
            } else {
                name.into()
            },
            title: format!("50 000 points{noisy}; rms distance from the true surface"),
            y_title: "rms distance (the solid is about 2 across)".into(),
            fitted,
            measured,
        })
    }

    fn file(path: &Path) -> Outcome<Self> {
        let file = path
            .file_name()
            .map(|n| n.to_string_lossy().into_owned())
            .unwrap_or_default();
        let name = file.split('.').next().unwrap_or("input").to_string();
        let source = Source::open(path, None, SAMPLES, &Cancel::new())?;
        let kind = formats::detect(path).map_err(|e| source.reading(e))?;
        if let Kind::Volume(_) = kind {
            return Ok(Self {
                kind: Input::Volume,
                name,
                title: "rms residual at the voxels".into(),
                y_title: "rms residual, density".into(),
                fitted: path.into(),
                measured: path.into(),
            });
        }
        Ok(Self {
            kind: Input::Cloud,
            name,
            title: "rms distance at its points".into(),
            y_title: "rms distance, unit of the file".into(),
            fitted: path.into(),
            measured: path.into(),
        })
    }

    /// Fits as often as told, each time in a process of its own, and takes the median of the costs.
    fn measure(&self, configuration: &Configuration, runs: u8, scratch: &Path) -> Outcome<Measurement> {
        let field = scratch.join("field.iclay");
        let mut fits = Vec::new();
        for _ in 0..runs {
            let options = configuration
                .options
                .iter()
                .flat_map(|(o, v)| [o.to_string(), v.clone()]);
            let arguments = [
                self.fitted.clone().into_os_string(),
                "-o".into(),
                field.clone().into_os_string(),
            ];
            fits.push(own::ask(
                "fit",
                arguments.into_iter().chain(options.map(Into::into)),
            )?);
        }
        let mut fit = fits[0].clone();
        for key in ["seconds", "cpu_seconds", "peak_rss_bytes"] {
            let mut all: Vec<f64> = fits.iter().filter_map(|f| f.get(key)?.as_f64()).collect();
            all.sort_by(f64::total_cmp);
            let median = all.get(all.len() / 2).copied();
            // Whole numbers stay whole.
            let value = if key.ends_with("bytes") {
                median.map(|m| m as u64).into()
            } else {
                Value::from(median)
            };
            fit.insert(key.into(), value);
        }
        fit.remove("output");
        let check = own::ask(
            "check",
            [field.into_os_string(), self.measured.clone().into_os_string()].into_iter(),
        )?;
        let figure = |key: &str| check.get(key).and_then(Value::as_f64).unwrap_or(f64::NAN);
        Ok(Measurement {
            configuration: configuration.clone(),
            rms: figure("rms"),
            p95: figure("p95"),
            fit,
        })
    }
}
