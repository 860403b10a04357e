use std::cell::LazyCell;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use bspline::polygonize::{Mesh, Placement, PolygonizeOptions};
use clap::ValueEnum;
use fitting::{Cancel, LeafIndex};
use formats::FormatError;
use glam::DVec3;

use super::cost::Cost;
use super::failure::{Failure, OrFail, Outcome};
use super::field::{FieldArgs, OpenField};
use super::mesh::Mesher;
use super::output::Output;
use super::overwrite::refuse_own_output;
use super::progress::Bar;
use super::quantity::{between, finite, human_number, positive, threads};
use super::staged::StagedFiles;
use super::summary::Summary;
use super::{interrupt, set_threads};
use crate::check::viridis;
use crate::picture::{Drawing, Part, Scene, Surface, View, clay};

/// Arguments of `isoclay picture`.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    field: FieldArgs,
    /// Picture to write (.png); - writes to standard output
    #[arg(short, long, value_name = "OUT")]
    pub output: PathBuf,
    /// Density of the surface [default: as for mesh]
    #[arg(long, value_name = "V", value_parser = finite, allow_negative_numbers = true)]
    iso: Option<f64>,
    /// Cells along the longest side of the box [default: as many as the picture shows, at most eight in a knot interval]
    #[arg(long, value_name = "N", value_parser = between::<u32>(1, 65535))]
    resolution: Option<u32>,
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", default_value = "1200x900", value_parser = size)]
    size: [usize; 2],
    /// Degrees by which the eye turns round the upright axis, from the next axis in the order x y z
    #[arg(long, value_name = "DEG", default_value_t = 0.0, value_parser = finite, allow_negative_numbers = true)]
    azimuth: f64,
    /// Degrees by which the eye stands above the horizon
    #[arg(long, value_name = "DEG", default_value_t = 15.0, value_parser = finite, allow_negative_numbers = true)]
    elevation: f64,
    /// Axis that points up
    #[arg(long, value_enum, default_value_t = Axis::Y)]
    up: Axis,
    /// How many times larger than a picture of the whole solid
    #[arg(long, value_name = "Z", default_value_t = 1.0, value_parser = zoom, allow_negative_numbers = true)]
    zoom: f64,
    /// Point in the middle of the picture, in the field's coordinates [default: the middle of the solid]
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    at: Option<DVec3>,
    /// Draw the same view once more, coloured by the error of the fit, into another PNG picture: violet is none, green the
    /// tolerance, yellow twice the tolerance or more
    #[arg(long, value_name = "OUT")]
    errors: Option<PathBuf>,
    /// Threads to work with [default: all cores]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<NonZeroUsize>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
}

/// A world axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Axis {
    /// First.
    X,
    /// Second.
    Y,
    /// Third.
    Z,
}

fn size(s: &str) -> Result<[usize; 2], String> {
    let numbers = s
        .split_once('x')
        .and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    numbers
        .filter(|n: &[usize; 2]| n.iter().all(|n| (16..=8192).contains(n)))
        .ok_or_else(|| "write width x height, each 16 to 8192: 1200x900".into())
}

fn zoom(s: &str) -> Result<f64, String> {
    match positive(s) {
        Ok(z) if (0.01..=10_000.0).contains(&z) => Ok(z),
        _ => Err("write a number from 0.01 to 10000".into()),
    }
}

fn point(s: &str) -> Result<DVec3, String> {
    let numbers: Result<Vec<f64>, String> = s.split(',').map(|n| finite(n.trim())).collect();
    match numbers.as_deref() {
        Ok(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
        Ok(_) => Err("write three numbers with commas between: 1.5,0,-2".into()),
        Err(e) => Err(format!("{e}; write three numbers with commas between: 1.5,0,-2")),
    }
}

/// What is to be drawn.
#[cfg_attr(
    not(feature = "window"),
    expect(dead_code, reason = "rays and volumes alone look beyond the triangles")
)]
pub struct Asked<'a> {
    /// Its field.
    pub open: &'a OpenField,
    /// Where its surface is.
    pub iso: f64,
    /// Its triangles.
    pub scene: Scene<'a>,
}

/// Draws a scene another way, in RGB bytes; none where it cannot.
pub type Draw<'a> = &'a dyn Fn(&Asked, &View) -> Outcome<Option<Vec<u8>>>;

/// Draws a field file.
pub fn run(args: &Args) -> Outcome {
    draw(args, &|_, _| Ok(None), None)
}

/// Draws a field file another way, and as ever where that cannot; from so many sides, if a number is given.
pub fn draw(args: &Args, another: Draw, turns: Option<usize>) -> Outcome {
    let cost = Cost::start();
    let cancel = interrupt::cancel();
    let source = args.field.source(&cancel)?;
    let out = match turns {
        None => Out::Picture(Output::check("-o", &args.output, &["png"], None, &[&source])?),
        Some(_) => Out::Pictures(StagedFiles::new("-o", &args.output)?),
    };
    let errors = (args.errors.as_ref())
        .map(|path| Output::check("--errors", path, &["png"], None, &[&source]))
        .transpose()?;
    if errors.as_ref().is_some_and(Output::is_stdout) {
        return Err(Failure::usage(
            "--errors -: standard output takes one picture; name a file",
        ));
    }
    if let Some(path) = &args.errors {
        refuse_own_output("--errors", path, &args.output)?;
    }
    set_threads(args.threads)?;
    let open = args.field.load_placed(&source)?;
    if args.errors.is_some() && open.report().leaves.is_empty() {
        return Err(Failure::usage(
            "--errors: the field knows of no errors, as one that was fitted does; leave it out",
        ));
    }
    let bar = Bar::new();
    let options = PolygonizeOptions {
        iso: open.iso_or(args.iso, &source)?,
        // Colours come from the normals of the field; a tenth of a cell is a quarter of a pixel.
        placement: Placement::RootFinding { tolerance: 0.1 },
        ..Default::default()
    };
    let mut mesher = Mesher {
        field: open.field(),
        options,
        cancel: &cancel,
        bar: &bar,
    };
    // Solids that are small in their box are between coarse cells.
    let mut cells = shading_cells(args.size);
    let whole = loop {
        let (whole, ..) = mesher.on(open.frame_of_resolution(cells))?;
        if !whole.triangles.is_empty() || cells >= open.finest_cells() {
            break whole;
        }
        cells *= 4;
    };
    if whole.triangles.is_empty() {
        return Err(open.no_surface(&source, options.iso));
    }
    let view = args.view(&whole);
    let cells = args.resolution.unwrap_or_else(|| cells_for(&open, &view));
    let frame = open.frame_of_resolution(cells);
    let part = Part::new(&view, &whole, frame.world_from_grid.matrix3.x_axis.length());
    let is_whole = args.zoom == 1.0 && args.at.is_none() || turns.is_some();
    let (mesh, _, frame) = if is_whole {
        mesher.on(frame)?
    } else {
        let frame = part.within(&frame).ok_or_else(|| args.nothing_there(&whole))?;
        let cut = part.cut(open.shared_field(), options.iso).or_input()?;
        Mesher {
            field: &cut,
            ..mesher
        }
        .on(frame)?
    };
    if mesh.triangles.is_empty() {
        return Err(args.nothing_there(&whole));
    }
    bar.show("drawing", 0.5);
    let asked = Asked {
        iso: options.iso,
        scene: Scene {
            field: open.field(),
            seen: surface_of(&mesh),
            shading: surface_of(&whole),
        },
        open: &open,
    };
    let output = match out {
        Out::Picture(output) => output,
        Out::Pictures(staged) => {
            let turned = args.turned(&whole, view, turns.unwrap_or(1));
            turn(&asked, &turned, another, staged, (&bar, &cancel))?;
            bar.clear();
            return Summary {
                vertices: Some(mesh.positions.len()),
                triangles: Some(mesh.triangles.len()),
                cells: Some(frame.cells),
                field_sha256: Some(open.sha256()),
                ..Default::default()
            }
            .with_cost(&cost)
            .print_of(args.output.display().to_string(), args.json);
        }
    };
    let drawing = LazyCell::new(|| Drawing::new(&asked.scene, &view));
    let (pixels, of_errors) = match (another(&asked, &view)?, errors) {
        (Some(pixels), None) => (pixels, None),
        (None, None) => (drawing.pixels(&clay), None),
        (Some(pixels), Some(output)) => {
            let of_errors = drawing.pixels(&error_color(&open));
            (pixels, Some((output, of_errors)))
        }
        (None, Some(output)) => {
            let [pixels, of_errors] = drawing.pictures([&clay, &error_color(&open)]);
            (pixels, Some((output, of_errors)))
        }
    };
    interrupt::check(&cancel)?;
    if let Some((output, pixels)) = &of_errors {
        write(output, args.size, pixels)?;
        output.finish()?;
    }
    write(&output, args.size, &pixels)?;
    bar.clear();
    Summary {
        vertices: Some(mesh.positions.len()),
        triangles: Some(mesh.triangles.len()),
        cells: Some(frame.cells),
        field_sha256: Some(open.sha256()),
        ..Default::default()
    }
    .with_cost(&cost)
    .print_after(&output, args.json)
}

/// What is written.
enum Out {
    Picture(Output),
    Pictures(StagedFiles),
}

/// Share of a picture that a solid fills at most while it turns.
const FILLED: f64 = 0.94;

/// Draws a scene from several sides, into files that appear together.
fn turn(
    asked: &Asked,
    views: &[View],
    another: Draw,
    mut staged: StagedFiles,
    (bar, cancel): (&Bar, &Cancel),
) -> Outcome {
    for (n, view) in views.iter().enumerate() {
        bar.show("drawing", n as f64 / views.len() as f64);
        let pixels = match another(asked, view)? {
            Some(pixels) => pixels,
            None => Drawing::new(&asked.scene, view).pixels(&clay),
        };
        interrupt::check(cancel)?;
        staged.write(&format!("{n:04}.png"), |path| png_file(path, view.size, &pixels))?;
    }
    staged.publish().map(drop)
}

fn write(output: &Output, size: [usize; 2], pixels: &[u8]) -> Outcome {
    png_file(output.path(), size, pixels).map_err(|e| output.writing(e))
}

/// Writes RGB bytes, rows from the top.
///
/// # Errors
/// That the file cannot be written.
pub fn png_file(path: &Path, size: [usize; 2], pixels: &[u8]) -> Result<(), FormatError> {
    let [width, height] = size.map(|n| n as u32);
    formats::atomic::replace(path, |out| {
        let mut encoder = png::Encoder::new(out, width, height);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header()?;
        Ok(writer.write_image_data(pixels)?)
    })
}

/// Colours by the rms residual of the leaf that holds a point; grey where there is none.
fn error_color(open: &OpenField) -> impl Fn(DVec3) -> DVec3 + Sync {
    let report = open.report();
    let index = LeafIndex::new(open.lattice(), &report.leaves);
    // An interpolating fit aims at no tolerance.
    let middle = if report.tolerance > 0.0 {
        report.tolerance
    } else {
        0.5 * report.max
    };
    move |p| {
        let leaf = index.find(p).map(|i| &report.leaves[i]);
        match leaf.filter(|l| l.sample_count > 0) {
            Some(leaf) => {
                let share = f64::from(leaf.rms) / (2.0 * middle).max(f64::MIN_POSITIVE);
                DVec3::from_array(viridis(share).map(f64::from)) / 255.0
            }
            None => NO_DATA,
        }
    }
}

/// Colour of surface that no sample speaks for.
const NO_DATA: DVec3 = DVec3::splat(0.6);

impl Args {
    /// The same view from so many sides, evenly round the upright axis: all of one scale, that all of them fit.
    fn turned(&self, whole: &Mesh, first: View, count: usize) -> Vec<View> {
        let middle = whole.bounding_box().map_or(first.center, |b| b.center());
        let center = self.at.unwrap_or(middle);
        let side = |n: usize| self.view_turned(whole, 360.0 * n as f64 / count as f64);
        let views: Vec<View> = (0..count).map(side).collect();
        let reach = |view: &View| {
            let ways = whole.positions.iter().map(|p| (view.axes * (p - middle)).abs());
            let most = ways.fold(DVec3::splat(f64::MIN_POSITIVE), DVec3::max);
            let [w, h] = view.size.map(|n| 0.5 * FILLED * n as f64);
            f64::min(w / most.x, h / most.y)
        };
        let scale = views.iter().map(reach).fold(f64::INFINITY, f64::min);
        let turned = views.into_iter().map(|view| View {
            center,
            pixels_per_length: scale * self.zoom,
            ..view
        });
        turned.collect()
    }

    fn view(&self, whole: &Mesh) -> View {
        self.view_turned(whole, 0.0)
    }

    fn view_turned(&self, whole: &Mesh, degrees: f64) -> View {
        let (up, front, side) = match self.up {
            Axis::X => (DVec3::X, DVec3::Y, DVec3::Z),
            Axis::Y => (DVec3::Y, DVec3::Z, DVec3::X),
            Axis::Z => (DVec3::Z, DVec3::X, DVec3::Y),
        };
        let (a, e) = ((self.azimuth + degrees).to_radians(), self.elevation.to_radians());
        let toward_eye = (front * a.cos() + side * a.sin()) * e.cos() + up * e.sin();
        let fitting = View::of(&surface_of(whole), self.size, toward_eye, up);
        View {
            center: self.at.unwrap_or(fitting.center),
            pixels_per_length: fitting.pixels_per_length * self.zoom,
            ..fitting
        }
    }

    fn nothing_there(&self, whole: &Mesh) -> Failure {
        let corners = whole.bounding_box().map(|b| [b.min, b.max]).unwrap_or_default();
        let [low, high] = corners.map(|p| p.to_array().map(human_number).join(", "));
        let at = self
            .at
            .map_or(String::new(), |p| format!("--at {},{},{} ", p.x, p.y, p.z));
        Failure::usage(format!(
            "{at}--zoom {}: no part of the solid is in the picture; it lies between ({low}) and ({high}); choose another point or a \
             smaller zoom",
            self.zoom
        ))
    }
}

/// Cells along the longest side of the box of the mesh that casts shadows: most of the time of a small picture goes there, and
/// at 240 pixels the shadows of 48 and of 128 look alike.
fn shading_cells(size: [usize; 2]) -> u32 {
    (size[0].max(size[1]) as u32 / 5).clamp(32, 128)
}
/// Side of a cell in pixels: an arc of a radius of ten of them is left by a twelfth of a pixel.
const CELL_PIXELS: f64 = 2.5;

/// Cells along the longest side of the box that the picture can show.
fn cells_for(open: &OpenField, view: &View) -> u32 {
    let sides = open.lattice().spacing(0) * open.lattice().extent();
    let shown = (sides.max_element() * view.pixels_per_length / CELL_PIXELS).ceil();
    let finest = open.frame_of_subdivision(8).cells.into_iter().max().unwrap_or(1);
    (shown as u32).clamp(16, finest.clamp(16, 65535))
}

fn surface_of(mesh: &Mesh) -> Surface<'_> {
    Surface {
        positions: &mesh.positions,
        triangles: &mesh.triangles,
    }
}
