use std::num::NonZeroUsize;
use std::path::PathBuf;

use bspline::polygonize::PolygonizeOptions;
use clap::ValueEnum;
use glam::DVec3;

use super::cost::Cost;
use super::failure::Outcome;
use super::field::OpenField;
use super::input::{check_output, writing};
use super::mesh::Mesher;
use super::progress::Bar;
use super::quantity::finite;
use super::summary::Summary;
use super::{interrupt, set_threads};
use crate::picture::{Scene, View, draw};

/// Arguments of `isoclay picture`.
#[derive(clap::Args)]
pub struct Args {
    /// Field (.iclay)
    field: PathBuf,
    /// Picture to write (.png)
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Density of the surface [default: as for mesh]
    #[arg(long, value_name = "V", value_parser = finite, allow_negative_numbers = true)]
    iso: Option<f64>,
    /// Cells along the longest side of the box [default: two cells per knot interval of the finest level that a tenth of the surface lies on]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65535))]
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
    /// Threads to work with [default: all cores]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
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

/// Draws a field file.
pub fn run(args: &Args) -> Outcome {
    let cost = Cost::start();
    check_output(&args.output, &["png"])?;
    set_threads(args.threads)?;
    let cancel = interrupt::cancel();
    let open = OpenField::load(&args.field)?;
    let bar = Bar::new();
    let options = PolygonizeOptions {
        iso: open.iso_or(args.iso, &args.field)?,
        ..Default::default()
    };
    let frame = match args.resolution {
        Some(n) => open.frame_of_resolution(n),
        None => open.frame_of_surface(options.iso).0,
    };
    let (mesh, _, frame) = Mesher {
        field: open.field(),
        options,
        cancel: &cancel,
        bar: &bar,
    }
    .on(frame)?;
    if mesh.triangles.is_empty() {
        return Err(open.no_surface(&args.field, options.iso));
    }
    bar.show("drawing", 0.5);
    let scene = Scene {
        field: open.field(),
        positions: &mesh.positions,
        triangles: &mesh.triangles,
    };
    let pixels = draw(&scene, &args.view());
    interrupt::check(&cancel)?;
    let [width, height] = args.size.map(|n| n as u32);
    formats::atomic::replace(&args.output, |out| {
        let mut encoder = png::Encoder::new(out, width, height);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header()?;
        Ok(writer.write_image_data(&pixels)?)
    })
    .map_err(writing)?;
    bar.clear();
    Summary {
        vertices: Some(mesh.positions.len()),
        triangles: Some(mesh.triangles.len()),
        cells: Some(frame.cells),
        field_sha256: Some(open.sha256()),
        output: Some(args.output.display().to_string()),
        ..Default::default()
    }
    .with_cost(&cost)
    .print(args.json)
}

impl Args {
    fn view(&self) -> View {
        let (up, front, side) = match self.up {
            Axis::X => (DVec3::X, DVec3::Y, DVec3::Z),
            Axis::Y => (DVec3::Y, DVec3::Z, DVec3::X),
            Axis::Z => (DVec3::Z, DVec3::X, DVec3::Y),
        };
        let (a, e) = (self.azimuth.to_radians(), self.elevation.to_radians());
        let toward_eye = (front * a.cos() + side * a.sin()) * e.cos() + up * e.sin();
        View {
            size: self.size,
            up,
            toward_eye,
        }
    }
}
