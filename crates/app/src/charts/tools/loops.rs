//! The whole loop of a stroke on a field: force, step, difference, local mesh.

use std::collections::BTreeMap;

use ::tools::curve::Along;
use ::tools::force::{Chisel, ForceStroke, Pull, nearest_surface};
use ::tools::number::{Finite, Point, Positive};
use ::tools::paint::{Layers, Paint, Substance};
use bspline::polygonize::{BlockMesh, PolygonizeOptions};
use bspline::{Aabb, Field, Frame, HierarchicalSpline};
use glam::DVec3;

use super::strokes::{SIDE, field_of};
use super::{Add, Place, Sculpture, ToolLine, ToolRun, ToolsError, summary};
use crate::charts::fields::{Tool as Ball, carved};

/// Loops of a stroke that are measured.
const LOOPS: usize = 60;
/// Radius of a tool over the knot interval of the level that it moves, at the ends of what one level serves: regions of about
/// 9³ and 18³ free coefficients.
const SMALL: f64 = 1.15;
const LARGE: f64 = 1.8;
/// Size of a tool on a scan: radius over the longest edge of its box.
const SIZE: f64 = 0.04;
/// Samples per knot interval, as force tools have them; cells of the mesh are as large.
const SAMPLES: f64 = 4.0 / 3.0;

/// Which tool.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Point,
    Curve,
    Area,
    /// A tool that moves: its region follows.
    Track,
}

impl Kind {
    const ALL: [Self; 4] = [Self::Point, Self::Curve, Self::Area, Self::Track];

    fn name(self) -> &'static str {
        match self {
            Self::Point => "point",
            Self::Curve => "curve",
            Self::Area => "area",
            Self::Track => "moving",
        }
    }

    /// A stroke that begins at a place of the surface.
    fn begin(
        self,
        field: &HierarchicalSpline<f32>,
        iso: f64,
        at: DVec3,
        radius: f64,
    ) -> Result<ForceStroke<f32>, ToolsError> {
        let walk = |length: f64| walk(field, iso, at, length * radius, 0.5 * radius);
        let (drag, r) = (1.6 * radius, Positive(radius));
        if self == Self::Track {
            let chisel = Chisel {
                along: Along::Points(walk(16.0)?),
                depth: Positive(0.8 * radius),
                radius: r,
                how: Default::default(),
            };
            return Ok(chisel.begin(field, iso, true)?);
        }
        let pull = Pull {
            along: Along::Points(match self {
                Self::Curve => walk(6.0)?,
                _ => vec![Point(at)],
            }),
            area: None,
            disc: (self == Self::Area).then_some(Positive(2.0 * radius)),
            by: None,
            way: None,
            lift: Some(Finite(drag)),
            radius: r,
            how: Default::default(),
        };
        Ok(pull.begin(field, iso)?)
    }
}

/// A way over the surface from a place of it.
fn walk(
    field: &HierarchicalSpline<f32>,
    iso: f64,
    from: DVec3,
    length: f64,
    step: f64,
) -> Result<Vec<Point>, ToolsError> {
    let (mut at, mut way, mut out) = (from, DVec3::new(0.8, 0.6, 0.0), vec![Point(from)]);
    for _ in 0..(length / step).round() as usize {
        let normal = field.value_gradient(at).1.normalize_or_zero();
        way = (way - way.dot(normal) * normal).normalize_or(normal.any_orthonormal_vector());
        at = nearest_surface(field, iso, at + step * way, 4.0 * step)?;
        out.push(Point(at));
    }
    Ok(out)
}

/// Makes a stroke with a mesh beside it.
fn looped(
    sculpture: &Sculpture,
    stroke: &mut ForceStroke<f32>,
    mesh: &mut BlockMesh,
    clock: fn() -> f64,
) -> Result<ToolLine, ToolsError> {
    let whole = sculpture.field.lattice().world_box();
    let mut before = sculpture.field.clone();
    let mut seconds = Vec::new();
    while seconds.len() < LOOPS && !stroke.is_over() {
        let start = clock();
        stroke.step()?;
        let now = stroke.baked()?;
        let difference = before.difference(&now).expect("versions of one field");
        mesh.update(&now, &now.changed_boxes(&before, &whole))?;
        seconds.push(clock() - start);
        drop(difference);
        before = now;
    }
    let report = stroke.report();
    let (median, slow) = summary(seconds);
    Ok(ToolLine {
        paths: report.paths,
        sampling_factor: Some(1.0),
        law: "clay, arrive".into(),
        overshoot: Some(report.overshoot),
        steps_to_99: report.steps_to_99,
        loop_ms: median,
        slow_loop_ms: slow,
        ..ToolLine::default()
    })
}

/// A mesh about a place whose cells are as large as samples lie apart in a region of this knot interval.
fn mesh_about(sculpture: &Sculpture, at: DVec3, reach: f64, interval: f64) -> Result<BlockMesh, ToolsError> {
    let whole = sculpture.field.lattice().world_box();
    let cell = interval / SAMPLES;
    let part = Aabb {
        min: (at - reach).max(whole.min),
        max: (at + reach).min(whole.max),
    };
    let cells = ((part.max - part.min) / cell).ceil().max(DVec3::ONE);
    let frame = Frame::over(&part, cells.as_uvec3().to_array());
    let options = PolygonizeOptions {
        iso: sculpture.iso,
        ..PolygonizeOptions::default()
    };
    Ok(BlockMesh::new(&sculpture.field, &frame, &options)?.0)
}

/// Brushes of growing size on one field: how long a loop of each tool takes, and how long a ball takes to be carved.
pub fn brushes(run: &mut ToolRun, add: &mut Add) -> Result<(), ToolsError> {
    let cells = if run.quick { 48 } else { 64 };
    let half = 0.5 * SIDE;
    let interval = SIDE / f64::from(cells);
    let sculpture = Sculpture {
        name: "half-space".into(),
        field: field_of(cells, |p| half - p.z)?,
        iso: 0.0,
    };
    let at = DVec3::new(half + 0.01, half - 0.02, half);
    let sizes: &[f64] = match run.quick {
        true => &[0.6, 1.2],
        false => &[0.3, 0.42, 0.6, 0.85, 1.2, 1.7, 2.4, 3.4, 4.8],
    };
    for (i, size) in sizes.iter().enumerate() {
        run.go_on(0.67 + 0.1 * i as f64 / sizes.len() as f64)?;
        let radius = size * interval;
        for kind in [Kind::Point, Kind::Curve, Kind::Area] {
            // Curves and areas of large tools would leave the box.
            if kind != Kind::Point && *size > 3.0 {
                continue;
            }
            let mut stroke = kind.begin(&sculpture.field, 0.0, at, radius)?;
            let mut mesh = mesh_about(&sculpture, at, 10.0 * radius, radius.min(interval))?;
            let line = ToolLine {
                tool: format!("{}, radius {size} intervals", kind.name()),
                drag_over_r: Some(1.6),
                place: Place::Brush {
                    intervals: *size,
                    series: kind.name(),
                },
                default: true,
                ..looped(&sculpture, &mut stroke, &mut mesh, run.clock)?
            };
            add(line, run);
        }
        let shared: std::sync::Arc<dyn Field> = std::sync::Arc::new(sculpture.field.clone());
        let mut mesh = mesh_about(&sculpture, at, 10.0 * radius, radius.min(interval))?;
        let whole = sculpture.field.lattice().world_box();
        let mut seconds = Vec::new();
        for i in 0..9 {
            let tool = Ball {
                middle: at + 0.1 * f64::from(i) * radius * DVec3::X,
                radius,
                beside: 3.0 * interval,
                tolerance: 0.02 * interval,
                finest: 1,
            };
            let start = (run.clock)();
            let (now, _) = carved((&sculpture.field, &shared), &tool);
            mesh.update(&now, &now.changed_boxes(&sculpture.field, &whole))?;
            seconds.push((run.clock)() - start);
        }
        let (median, slow) = summary(seconds);
        let line = ToolLine {
            tool: format!("carved ball, radius {size} intervals"),
            law: "geometric".into(),
            loop_ms: median,
            slow_loop_ms: slow,
            default: true,
            place: Place::Brush {
                intervals: *size,
                series: "carved ball",
            },
            ..ToolLine::default()
        };
        add(line, run);
    }
    Ok(())
}

/// Stiffness of ten on one side of a place, within reach of it.
fn half_painted(sculpture: &Sculpture, at: DVec3, reach: f64, detail: usize) -> Result<Layers, ToolsError> {
    let paint = Paint {
        layer: Substance::Stiffness,
        brush: None,
        formula: Some(format!("1 + 9 * (x < {:.17})", at.x)),
        curve: None,
        of_stiffness: None,
    };
    let within = Aabb {
        min: at - reach,
        max: at + reach,
    };
    let layer = paint.apply(&sculpture.field, &Layers::new(), detail, &within)?;
    Ok(BTreeMap::from([(Substance::Stiffness, layer)]))
}

/// Tools at both ends of the sizes that one level serves, even and half painted stiff, on a fitted field.
pub fn on_sculpture(sculpture: &Sculpture, run: &mut ToolRun, add: &mut Add) -> Result<(), ToolsError> {
    let whole = sculpture.field.lattice().world_box();
    let spacing = sculpture.field.lattice().spacing(0).max_element();
    let edge = (whole.max - whole.min).max_element();
    let level = (LARGE * spacing / (SIZE * edge)).log2().round().max(0.0) as usize;
    let interval = spacing / (1u64 << level) as f64;
    let at = place(sculpture)?;
    for (size, name) in [(SMALL, "15/20"), (LARGE, "24/32")] {
        let radius = size * interval;
        let layers = half_painted(sculpture, at, 24.0 * radius, level)?;
        let mesh = mesh_about(sculpture, at, 30.0 * radius, interval)?;
        for kind in Kind::ALL {
            for painted in [false, true] {
                run.go_on(0.9)?;
                let mut stroke = kind.begin(&sculpture.field, sculpture.iso, at, radius)?;
                if painted {
                    stroke = stroke.painted(&layers)?;
                }
                let paint = if painted { ", painted" } else { "" };
                let line = looped(sculpture, &mut stroke, &mut mesh.clone(), run.clock)?;
                let line = ToolLine {
                    tool: format!("{}, {} {name}{paint}", kind.name(), sculpture.name),
                    drag_over_r: Some(if kind == Kind::Track { 0.8 } else { 1.6 }),
                    default: true,
                    place: Place::Loop {
                        samples: stroke.report().samples,
                        series: format!("{}{paint}", kind.name()),
                    },
                    ..line
                };
                add(line, run);
            }
        }
    }
    Ok(())
}

/// The place of the surface, seen from six sides, that is farthest from the walls of the box.
fn place(sculpture: &Sculpture) -> Result<DVec3, ToolsError> {
    let whole = sculpture.field.lattice().world_box();
    let (middle, half) = (0.5 * (whole.min + whole.max), 0.5 * (whole.max - whole.min));
    let ways = [
        DVec3::Z,
        DVec3::Y,
        DVec3::X,
        DVec3::NEG_Z,
        DVec3::NEG_Y,
        DVec3::NEG_X,
    ];
    let found = ways.into_iter().filter_map(|way| {
        let length = half.dot(way.abs());
        let outer = (0..64).map(|i| middle + (1.0 - f64::from(i) / 64.0) * length * way);
        let first = { outer }.find(|p| sculpture.field.value(*p) > sculpture.iso)?;
        nearest_surface(&sculpture.field, sculpture.iso, first, 0.1 * length).ok()
    });
    let room = |p: &DVec3| (*p - whole.min).min(whole.max - *p).min_element();
    { found }
        .max_by(|a, b| room(a).total_cmp(&room(b)))
        .ok_or_else(|| ToolsError::NoSurface(sculpture.name.clone()))
}
