use std::io::{self, Write};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use bspline::polygonize::PolygonizeOptions;
use bspline::{Field, Frame, HierarchicalSpline, Real};
use fitting::Cancel;
use formats::field::{AnyField, FieldMeta, Stored};
use serde::Serialize;

use super::cost::Cost;
use super::failure::{Failure, OrFail, Outcome};
use super::field::{OpenField, either};
use super::input::{check_output, writing};
use super::mesh::Mesher;
use super::progress::Bar;
use super::quantity::{human_count, human_number};
use super::summary::{Summary, hex, table};
use super::{interrupt, set_threads};
use crate::simulate::{Scene, SimulateError, Simulation, StepLine};

/// Arguments of `isoclay simulate`.
#[derive(clap::Args)]
pub struct Args {
    /// Scene (.toml); the guide lists what it may say
    scene: PathBuf,
    /// Field to write (.iclay)
    #[arg(short, long, value_name = "FIELD")]
    output: PathBuf,
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
    #[arg(long, value_name = "N", requires = "frames", default_value = "10")]
    every: NonZeroUsize,
    /// Threads to work with [default: all cores]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// Print one JSON object a step, and one at the end
    #[arg(long)]
    json: bool,
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
    check_output(&args.output, &["iclay"])?;
    if let Some(mesh) = &args.mesh {
        check_output(mesh, &["ply", "stl", "obj"])?;
    }
    if let Some(frames) = &args.frames {
        std::fs::create_dir_all(frames)
            .map_err(|e| anyhow::anyhow!("--frames {}: cannot be made ({e})", frames.display()))
            .or_limit()?;
    }
    set_threads(args.threads)?;
    let cancel = Cancel::new();
    interrupt::cancel_on_interrupt(&cancel)?;
    let scene = read(&args.scene)?;
    let directory = args.scene.parent().unwrap_or(Path::new(""));
    let named = directory.join(&scene.field);
    let open = OpenField::load(args.field.as_ref().unwrap_or(&named))?;
    let stage = Stage {
        args,
        scene: &scene,
        open: &open,
        iso: scene.iso.map(|i| i.0).or(open.iso()),
        cancel: &cancel,
        bar: Bar::new(),
    };
    let total = either!(&open.loaded().field, f => stage.play(f.clone()))?;
    stage.bar.clear();
    let total = Total {
        summary: total.summary.with_cost(&cost),
        ..total
    };
    print(&total, args.json)
}

/// Reads a scene; what is wrong is told with its line.
fn read(path: &Path) -> Outcome<Scene> {
    const LARGEST: u64 = 16 << 20;
    let about = |why: String| Failure::input(format!("{}: {why}", path.display()));
    let size = std::fs::metadata(path).map_err(|e| about(e.to_string()))?.len();
    if size > LARGEST {
        return Err(about(format!("has {size} bytes; a scene has at most {LARGEST}")));
    }
    let text = std::fs::read_to_string(path).map_err(|e| about(e.to_string()))?;
    toml::from_str(&text).map_err(|e| about(e.to_string().trim_end().into()))
}

/// A scene with all that its run needs.
struct Stage<'a> {
    args: &'a Args,
    scene: &'a Scene,
    open: &'a OpenField,
    iso: Option<f64>,
    cancel: &'a Cancel,
    bar: Bar,
}

impl Stage<'_> {
    fn play<T: Stored>(&self, field: HierarchicalSpline<T>) -> Outcome<Total> {
        let failed = |e: SimulateError| Failure::input(format!("{}: {e}", self.args.scene.display()));
        let mut simulation = Simulation::new(self.scene, field, self.iso).map_err(failed)?;
        let lattice = simulation.region().patch().lattice();
        let mut total = Total {
            samples: lattice.sample_count(),
            free_coefficients: lattice.coefficient_count(),
            ..Default::default()
        };
        self.frame(&simulation, 0)?;
        while !simulation.is_over() {
            interrupt::check(self.cancel)?;
            let line = simulation.step().map_err(failed)?;
            if self.args.json {
                let text = serde_json::to_string(&line).expect("a struct of plain fields is always JSON");
                writeln!(io::stdout().lock(), "{text}").or_limit()?;
            }
            total.add(&line);
            self.frame(&simulation, line.step)?;
            self.bar.show("simulating", 0.95 * simulation.progress());
        }
        let baked = simulation.baked().map_err(failed)?;
        total.summary.notes = simulation.notes().to_vec();
        if let Some(path) = &self.args.mesh {
            self.mesh(&baked, simulation.region().cells().level, path)?;
        }
        interrupt::check(self.cancel)?;
        self.bar.show("writing", 0.99);
        total.summary.field_sha256 = Some(self.save(&baked)?);
        total.summary.output = Some(self.args.output.display().to_string());
        Ok(total)
    }

    /// Writes a frame if one is due.
    fn frame<T: Real>(&self, simulation: &Simulation<T>, step: usize) -> Outcome {
        let Some(directory) = &self.args.frames else {
            return Ok(());
        };
        if !step.is_multiple_of(self.args.every.get()) {
            return Ok(());
        }
        let baked = simulation.baked().map_err(Failure::input)?;
        let path = directory.join(format!("frame-{step:05}.ply"));
        self.mesh(&baked, simulation.region().cells().level, &path)
    }

    /// Meshes a field, with two cells in every knot interval of the surface's level or the region's.
    fn mesh(&self, field: &dyn Field, level: usize, path: &Path) -> Outcome {
        let Some(iso) = self.iso else {
            return Err(Failure::usage(
                "a mesh needs the density of the surface; write iso above all tables of the scene",
            ));
        };
        let frame: Frame = self
            .open
            .frame_of_level(self.open.level_of_surface(iso).max(level));
        let mut mesher = Mesher {
            field,
            options: PolygonizeOptions {
                iso,
                ..Default::default()
            },
            cancel: self.cancel,
            bar: &self.bar,
        };
        let (mesh, ..) = mesher.on(frame)?;
        let written = formats::meshes::Mesh {
            vertices: &mesh.positions,
            triangles: &mesh.triangles,
            colors: None,
            unit: self.open.unit(),
        };
        formats::meshes::save(path, &written).map_err(writing)?;
        Ok(())
    }

    /// Writes the field with what is known of the one it was made from; returns its SHA-256.
    fn save<T: Stored>(&self, field: &HierarchicalSpline<T>) -> Outcome<String> {
        let before = &self.open.loaded().meta;
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
        formats::field::save(&self.args.output, field, &meta).map_err(writing)?;
        Ok(hex(&field.sha256()))
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
}

fn print(total: &Total, json: bool) -> Outcome {
    let text = if json {
        serde_json::to_string(total).expect("a struct of plain fields is always JSON")
    } else {
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
    };
    let mut out = io::stdout().lock();
    writeln!(out, "{text}").and_then(|()| out.flush()).or_limit()
}
