//! The whole loop of a stroke on a field: force, step, difference, local mesh.

use ::tools::force::ForceStroke;
use ::tools::study::{Looped, StrokeKind, half_painted, mesh_about};
use bspline::Field;
use bspline::polygonize::BlockMesh;
use glam::DVec3;

use super::strokes::{SIDE, field_of};
use super::{Add, Place, Sculpture, ToolLine, ToolRun, ToolsError, summary};
use crate::charts::fields::{Tool as Ball, carved};

/// Loops of a stroke that are measured.
const LOOPS: usize = 60;

/// Makes a stroke with a mesh beside it.
fn looped(
    sculpture: &Sculpture,
    stroke: ForceStroke<f32>,
    mesh: BlockMesh,
    clock: fn() -> f64,
) -> Result<ToolLine, ToolsError> {
    let mut looped = Looped::new(sculpture, stroke, mesh);
    let mut seconds = Vec::new();
    while seconds.len() < LOOPS && !looped.is_over() {
        let start = clock();
        let difference = looped.step()?;
        seconds.push(clock() - start);
        drop(difference);
    }
    let report = looped.stroke.report();
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
        for kind in [StrokeKind::Point, StrokeKind::Curve, StrokeKind::Area] {
            // Curves and areas of large tools would leave the box.
            if kind != StrokeKind::Point && *size > 3.0 {
                continue;
            }
            let stroke = kind.begin(&sculpture.field, 0.0, at, radius, true)?;
            let mesh = mesh_about(&sculpture, at, 10.0 * radius, radius.min(interval))?;
            let line = ToolLine {
                tool: format!("{}, radius {size} intervals", kind.name()),
                drag_over_r: Some(kind.drag()),
                place: Place::Brush {
                    intervals: *size,
                    series: kind.name(),
                },
                default: true,
                ..looped(&sculpture, stroke, mesh, run.clock)?
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

/// Tools at both ends of the sizes that one level serves, even and half painted stiff, on a fitted field.
pub fn on_sculpture(sculpture: &Sculpture, run: &mut ToolRun, add: &mut Add) -> Result<(), ToolsError> {
    let sizes = sculpture.sizes();
    let at = sculpture.place()?;
    for (radius, name) in sizes.radii {
        let layers = half_painted(sculpture, at, 24.0 * radius, sizes.level)?;
        let mesh = mesh_about(sculpture, at, 30.0 * radius, sizes.interval)?;
        for kind in StrokeKind::ALL {
            for painted in [false, true] {
                run.go_on(0.9)?;
                let mut stroke = kind.begin(&sculpture.field, sculpture.iso, at, radius, true)?;
                if painted {
                    stroke = stroke.painted(&layers)?;
                }
                let samples = stroke.report().samples;
                let paint = if painted { ", painted" } else { "" };
                let line = looped(sculpture, stroke, mesh.clone(), run.clock)?;
                let line = ToolLine {
                    tool: format!("{}, {} {name}{paint}", kind.name(), sculpture.name),
                    drag_over_r: Some(kind.drag()),
                    default: true,
                    place: Place::Loop {
                        samples,
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
