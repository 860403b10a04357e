use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Instant;

use bspline::polygonize::Mesh;
use bspline::{HierarchicalSpline, Real};
use fitting::Cancel;
use formats::Unit;
use formats::field::{AnyField, FieldMeta, Stored};
use serde::Serialize;
use tools::paint::Layers;
use tools::scene::{Scene, SimulateError, Simulation, StepLine};

use super::cost::Cost;
use super::failure::{Failure, Outcome};
use super::field::{self, OpenField, either};
use super::fineness::{self, Fineness};
use super::mesh_output::MESHES;
use super::output::Output;
use super::overwrite::refuse_own_input;
use super::progress::Bar;
use super::quantity::{count, human_count, human_number, threads};
use super::source::{FIELDS, Source};
use super::staged::StagedFiles;
use super::summary::{self, Summary, table};
use super::{interrupt, set_threads};

/// Arguments of `isoclay simulate`.
#[derive(clap::Args)]
pub struct Args {
    /// Scene (.toml), - reads standard input; docs/guide.md lists what it may say
    scene: PathBuf,
    /// Field to write (.iclay); - writes to standard output
    #[arg(short, long, value_name = "FIELD")]
    pub output: PathBuf,
    /// Field to move in place of the one that the scene names
    #[arg(long, value_name = "FIELD")]
    field: Option<PathBuf>,
    /// Also write the surface at the end: .ply, .stl, .obj, .glb, .gltf, .3mf or .wrl
    #[arg(long, value_name = "OUT")]
    mesh: Option<PathBuf>,
    /// Also write the surface along the way, as frame-00000.ply and so on; the directory is made if missing
    #[arg(long, value_name = "DIR")]
    frames: Option<PathBuf>,
    /// Steps from one frame to the next
    #[arg(long, value_name = "N", requires = "frames", default_value = "10", value_parser = count)]
    every: NonZeroUsize,
    /// Threads to work with [default: all cores]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<NonZeroUsize>,
    /// Print one JSON object for each step, and one at the end
    #[arg(long)]
    pub json: bool,
}

/// What a step did, and how long it took.
#[derive(Serialize)]
struct Timed<'a> {
    #[serde(flatten)]
    line: &'a StepLine,
    /// By the wall clock.
    seconds: f64,
}

/// What all steps did.
#[derive(Default, Serialize)]
struct Total {
    steps: usize,
    steps_awake: usize,
    simulated_seconds: f64,
    samples: usize,
    free_coefficients: usize,
    most_iterations: usize,
    worst_residual: f64,
    clamped: usize,
    work: f64,
    max_change: f64,
    #[serde(flatten)]
    summary: Summary,
}

/// Runs a scene and writes the field that it leaves.
pub fn run(args: &Args) -> Outcome {
    let cost = Cost::start();
    let cancel = interrupt::cancel();
    let script = Source::open(&args.scene, Some("toml"), "scenes .toml", &cancel)?;
    let output = Output::check("-o", &args.output, &["iclay"], None, &[&script])?;
    let mesh = (args.mesh.as_ref())
        .map(|mesh| Output::check("--mesh", mesh, &MESHES, None, &[&script]))
        .transpose()?;
    if output.is_stdout() && mesh.as_ref().is_some_and(Output::is_stdout) {
        return Err(Failure::usage(
            "--mesh -: standard output takes the field already (-o -); name a file for one of them",
        ));
    }
    let frames = (args.frames.as_ref())
        .map(|frames| StagedFiles::new("--frames", frames))
        .transpose()?;
    let scene = read(&script)?;
    let field = match (&args.field, &scene.field) {
        (Some(field), _) => Source::open(field, None, FIELDS, &cancel)?.under("--field"),
        (None, Some(field)) => {
            let directory = args.scene.parent().unwrap_or(Path::new(""));
            Source::open(&directory.join(field), None, FIELDS, &cancel)?
        }
        (None, None) => {
            return Err(Failure::input(format!(
                "{}: names no field to move; give --field FIELD, or begin it with the line field = \"FIELD.iclay\"",
                script.name()
            )));
        }
    };
    refuse_own_input("-o", &field, &args.output)?;
    set_threads(args.threads)?;
    let open = OpenField::load(&field)?;
    let mut stage = Stage {
        args,
        name: script.name(),
        output: &output,
        mesh: mesh.as_ref(),
        frames,
        scene: &scene,
        open: &open,
        iso: scene.iso.map(|i| i.0).or(open.iso()),
        cancel: &cancel,
        bar: Bar::new(),
    };
    let total = either!(open.levels()?, f => stage.play(f.clone()))?;
    stage.bar.clear();
    if let Some(mesh) = &mesh {
        mesh.finish()?;
    }
    output.finish()?;
    let total = Total {
        summary: Summary {
            output: Some(output.name()),
            ..total.summary.with_cost(&cost)
        },
        ..total
    };
    let is_taken = output.is_stdout() || mesh.as_ref().is_some_and(Output::is_stdout);
    summary::print(&total.text(args.json), is_taken)
}

/// Reads a scene; what is wrong is told with its line.
fn read(script: &Source) -> Outcome<Scene> {
    parsed(&text(script)?).map_err(|e| Failure::input(format!("{}: {e}", script.name())))
}

/// The scene that a text says; the message has the line of what is wrong.
pub fn parsed(text: &str) -> Result<Scene, String> {
    toml::from_str(text).map_err(|e| e.to_string().trim_end().into())
}

/// The text of a scene.
pub fn text(script: &Source) -> Outcome<String> {
    const LARGEST: u64 = 16 << 20;
    let path = script.path();
    let about = |why: String| Failure::input(format!("{}: {why}", script.name()));
    let size = std::fs::metadata(path)
        .map_err(|e| about(format!("{e}; check the path")))?
        .len();
    if size > LARGEST {
        return Err(about(format!(
            "has {size} bytes, and a scene at most {LARGEST}; is this the right file?"
        )));
    }
    std::fs::read_to_string(path).map_err(|e| about(e.to_string()))
}

/// A scene with all that its run needs.
struct Stage<'a> {
    args: &'a Args,
    /// What the user calls the scene.
    name: &'a str,
    output: &'a Output,
    mesh: Option<&'a Output>,
    frames: Option<StagedFiles>,
    scene: &'a Scene,
    open: &'a OpenField,
    iso: Option<f64>,
    cancel: &'a Cancel,
    bar: Bar,
}

impl Stage<'_> {
    fn play<T: Stored>(&mut self, field: HierarchicalSpline<T>) -> Outcome<Total> {
        let name = self.name;
        let failed = |e: SimulateError| Failure::input(format!("{name}: {e}"));
        let mut simulation = Simulation::new(self.scene, field, self.iso, &Layers::new()).map_err(failed)?;
        let lattice = simulation.region().patch().lattice();
        let mut total = Total {
            samples: lattice.sample_count(),
            free_coefficients: lattice.coefficient_count(),
            ..Default::default()
        };
        self.frame(&simulation, 0)?;
        while !simulation.is_over() {
            interrupt::check(self.cancel)?;
            let start = Instant::now();
            let line = simulation.step().map_err(failed)?;
            if self.args.json {
                let timed = Timed {
                    line: &line,
                    seconds: start.elapsed().as_secs_f64(),
                };
                let text = serde_json::to_string(&timed).expect("a struct of plain fields is always JSON");
                let is_taken = self.output.is_stdout() || self.mesh.is_some_and(Output::is_stdout);
                summary::print(&text, is_taken)?;
            }
            total.add(&line);
            self.frame(&simulation, line.step)?;
            self.bar.show("simulating", 0.95 * simulation.progress());
        }
        let baked = simulation.baked().map_err(failed)?;
        total.summary.notes = simulation.notes().to_vec();
        if let Some(frames) = self.frames.take() {
            frames.publish()?;
        }
        if let Some(output) = self.mesh {
            let mesh = self.surface(&baked, &mut total.summary.notes)?;
            formats::meshes::save(output.path(), &written(&mesh, self.open.unit()))
                .map_err(|e| output.writing(e))?;
        }
        interrupt::check(self.cancel)?;
        self.bar.show("writing", 0.99);
        total.summary.field_sha256 = Some(self.save(&baked)?);
        Ok(total)
    }

    /// Writes a frame if one is due.
    fn frame<T: Real>(&mut self, simulation: &Simulation<T>, step: usize) -> Outcome {
        if self.frames.is_none() || !step.is_multiple_of(self.args.every.get()) {
            return Ok(());
        }
        let baked = simulation.baked().map_err(Failure::input)?;
        let mesh = self.surface(&baked, &mut Vec::new())?;
        let unit = self.open.unit();
        if let Some(frames) = &mut self.frames {
            frames.write(&format!("frame-{step:05}.ply"), |path| {
                formats::meshes::save(path, &written(&mesh, unit))
            })?;
        }
        Ok(())
    }

    /// Meshes what became of the field, as finely as `mesh` would.
    fn surface<T: Real>(&self, field: &HierarchicalSpline<T>, notes: &mut Vec<String>) -> Outcome<Mesh> {
        let Some(iso) = self.iso else {
            return Err(Failure::usage(
                "a mesh needs the density of the surface; write iso above all tables of the scene",
            ));
        };
        let made = fineness::mesh(
            self.open,
            field,
            field.level_count(),
            iso,
            true,
            Fineness::OfTheFit,
            notes,
            self.cancel,
            &self.bar,
        )?;
        Ok(made.mesh)
    }

    /// Writes the field with what is known of the one it was made from; returns its SHA-256.
    fn save<T: Stored>(&self, field: &HierarchicalSpline<T>) -> Outcome<String> {
        let before = self.open.meta();
        let options: Vec<String> = std::env::args().skip(1).collect();
        let mut notes = before.notes.clone();
        notes.push("moved by a scene; its errors and leaves are those of the fit before".into());
        let meta = FieldMeta {
            notes,
            provenance: serde_json::json!({
                "program": concat!("isoclay ", env!("CARGO_PKG_VERSION")),
                "scene": self.args.scene.file_name().map(|n| n.to_string_lossy()),
                "arguments": options,
                "field_sha256": self.open.sha256(),
                "field": serde_json::from_str::<serde_json::Value>(&before.provenance).ok(),
            })
            .to_string(),
            ..before.clone()
        };
        field::save_as(self.output, field, &meta)
    }
}

fn written(mesh: &Mesh, unit: Unit) -> formats::meshes::Mesh<'_> {
    formats::meshes::Mesh {
        vertices: &mesh.positions,
        triangles: &mesh.triangles,
        colors: None,
        unit,
    }
}

impl Total {
    fn add(&mut self, line: &StepLine) {
        self.steps = line.step;
        self.steps_awake += usize::from(line.awake);
        self.simulated_seconds = line.time;
        self.most_iterations = self.most_iterations.max(line.iterations);
        self.worst_residual = self.worst_residual.max(line.residual);
        self.clamped = self.clamped.max(line.clamped);
        self.work = line.work;
        self.max_change = line.max_change;
    }

    fn text(&self, json: bool) -> String {
        let total = self;
        if json {
            return serde_json::to_string(total).expect("a struct of plain fields is always JSON");
        }
        let rows = [
            (
                "simulated",
                format!("{} s", human_number(total.simulated_seconds)),
            ),
            ("steps", human_count(total.steps)),
            ("  awake", human_count(total.steps_awake)),
            ("samples", human_count(total.samples)),
            ("free coefficients", human_count(total.free_coefficients)),
            ("most iterations", human_count(total.most_iterations)),
            ("worst residual", human_number(total.worst_residual)),
            ("springs clamped", human_count(total.clamped)),
            ("work", human_number(total.work)),
            ("density changed by", human_number(total.max_change)),
        ];
        table(rows.into_iter().chain(total.summary.rows()), &total.summary.notes)
    }
}
