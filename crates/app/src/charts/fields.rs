//! What it costs to write a tool's work back into a field: it goes with the tool's box, not with the field.

use std::ops::ControlFlow;
use std::sync::Arc;

use bspline::hierarchical::{BlockEdit, Change, Lattice};
use bspline::primitives::Sphere;
use bspline::{Aabb, Csg, Field, HierarchicalSpline};
use fitting::Control;
use fitting::field::{Aim, FieldFitOptions, FieldFitReport, fit_field};
use glam::{DAffine3, DVec3};
use serde_json::{Value, json};

use super::ball::{Ball, median};
use super::{Chart, Series};

/// Finest levels of the balls on whose surface tools work.
const DEPTHS: [u32; 3] = [2, 4, 6];
/// Widths of the tools, in finest knot intervals.
const ACROSS: [f64; 7] = [5.0, 10.0, 20.0, 30.0, 40.0, 60.0, 80.0];
/// Finest intervals from a tool to the faces of its box.
const BESIDE: f64 = 6.0;
/// Times of \[Hua04\] Table 1 on the machine of its time: coefficients on an axis, samples across the tool, milliseconds.
const TABLE_1: [(u32, f64, f64); 5] = [
    (64, 10.0, 0.4),
    (64, 20.0, 3.0),
    (64, 40.0, 23.5),
    (128, 20.0, 8.3),
    (128, 40.0, 59.8),
];
/// Samples of its working space on an axis.
const SAMPLES: f64 = 128.0;
/// Runs of which the median is taken.
const RUNS: usize = 15;

/// One tool on one field.
pub struct FieldFitCost {
    /// Active functions of the field.
    coefficients: usize,
    /// Finest knot intervals across the tool's box.
    intervals: f64,
    milliseconds: f64,
    samples: u64,
    changed_bricks: usize,
    /// What \[Hua04\] needs for it, if it is a row of its Table 1.
    paper: Option<f64>,
}

impl FieldFitCost {
    /// All figures by name.
    pub fn json(&self) -> Value {
        let rounded = |x: f64| (x * 1e4).round() / 1e4;
        json!({
            "coefficients": self.coefficients,
            "box_intervals": rounded(self.intervals),
            "fit_ms": rounded(self.milliseconds),
            "samples": self.samples,
            "changed_bricks": self.changed_bricks,
            "bound_ms": rounded(self.bound()),
            "paper_ms": self.paper,
        })
    }

    /// 5 µs for each changed brick and 50 ns for each sample, in milliseconds.
    fn bound(&self) -> f64 {
        5e-3 * self.changed_bricks as f64 + 50e-6 * self.samples as f64
    }
}

/// Measures tools on balls of three sizes, then the rows of \[Hua04\] Table 1; `go_on` is told of each field before it is
/// made. None if it says to stop.
pub fn field_fit_costs(mut go_on: impl FnMut(f64) -> ControlFlow<()>) -> Option<Vec<FieldFitCost>> {
    let mut all = Vec::new();
    for (i, depth) in DEPTHS.into_iter().enumerate() {
        if go_on(i as f64 / 4.0).is_break() {
            return None;
        }
        let ball = Ball::new(depth);
        let shared: Arc<dyn Field> = Arc::new(ball.field.clone());
        for across in ACROSS {
            let radius = 0.5 * across * ball.cell();
            let tool = |i: usize| Tool {
                middle: ball.stroke(i),
                radius,
                beside: BESIDE * ball.cell(),
                tolerance: 0.02 * ball.cell(),
                finest: ball.level,
            };
            let intervals = across + 2.0 * BESIDE;
            all.push(cost((&ball.field, &shared), intervals, None, tool));
        }
    }
    for (coefficients, across, paper) in TABLE_1 {
        let cells = coefficients - 3;
        if go_on(0.9).is_break() {
            return None;
        }
        let (field, radius) = (one_level(cells), 0.36);
        let shared: Arc<dyn Field> = Arc::new(field.clone());
        let tool = |i: usize| {
            let turn = 0.3 + 0.02 * i as f64;
            let (sin, cos) = (libm::sin(turn), libm::cos(turn));
            Tool {
                middle: DVec3::splat(0.5) + radius * DVec3::new(0.8 * cos, sin, 0.6 * cos),
                radius: 0.5 * across / SAMPLES,
                beside: 0.0,
                tolerance: 0.02 / SAMPLES,
                finest: 0,
            }
        };
        let intervals = across * f64::from(cells) / SAMPLES;
        all.push(cost((&field, &shared), intervals, Some(paper), tool));
    }
    Some(all)
}

/// A ball to be carved, and how.
pub(super) struct Tool {
    pub middle: DVec3,
    pub radius: f64,
    /// From the ball to the faces of its box.
    pub beside: f64,
    pub tolerance: f64,
    pub finest: usize,
}

/// `field` (the same twice) without a ball.
pub(super) fn carved(
    (field, shared): (&HierarchicalSpline<f32>, &Arc<dyn Field>),
    tool: &Tool,
) -> (HierarchicalSpline<f32>, FieldFitReport) {
    let ball = Sphere::new(tool.middle, tool.radius).expect("a ball of some size");
    let target = Csg::difference(shared.clone(), vec![Arc::new(ball)], 0.0).expect("finite");
    let reach = tool.radius + tool.beside;
    let within = Aabb::new(tool.middle - reach, tool.middle + reach);
    let options = FieldFitOptions {
        aim: Aim::Surface {
            iso: 0.0,
            tolerance: tool.tolerance,
        },
        finest: tool.finest,
        look: false,
    };
    let fitted = fit_field(&target, field, &within, &options, &mut Control::default());
    let (field, _, report) = fitted.expect("a tool beside nothing else");
    (field, report)
}

fn cost(
    fields: (&HierarchicalSpline<f32>, &Arc<dyn Field>),
    intervals: f64,
    paper: Option<f64>,
    tool: impl Fn(usize) -> Tool,
) -> FieldFitCost {
    let microseconds = median(RUNS, |i| carved(fields, &tool(i)));
    let (field, report) = carved(fields, &tool(RUNS / 2));
    FieldFitCost {
        coefficients: fields.0.coefficient_count(),
        intervals,
        milliseconds: microseconds / 1e3,
        samples: report.samples,
        changed_bricks: field.changed_bricks(fields.0).len(),
        paper,
    }
}

/// Distance to a ball in the unit box on one level.
fn one_level(cells: u32) -> HierarchicalSpline<f32> {
    let spacing = 1.0 / f64::from(cells);
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_scale(DVec3::splat(spacing)),
        cells: [cells; 3],
    };
    let n = cells as usize + 3;
    let knot = |i: usize| (i as f64 - 1.0) * spacing;
    let functions = (0..n * n * n).map(|i| DVec3::new(knot(i / n / n), knot(i / n % n), knot(i % n)));
    let all = BlockEdit {
        level: 0,
        first: [0; 3],
        shape: [n; 3],
        change: Change::Set(
            functions
                .map(|p| (0.36 - p.distance(DVec3::splat(0.5))) as f32)
                .collect(),
        ),
    };
    HierarchicalSpline::from_corrections(lattice, 1.0, vec![Default::default()])
        .edited_blocks(&[all])
        .expect("functions of the lattice")
}

impl Chart {
    /// Time against the size of the tool's box.
    pub fn of_field_fits(all: &[FieldFitCost]) -> Self {
        let points = |keep: &dyn Fn(&&FieldFitCost) -> bool, y: &dyn Fn(&FieldFitCost) -> f64| {
            let kept = all.iter().filter(keep);
            kept.map(|c| (c.intervals, y(c), String::new()))
                .collect::<Vec<_>>()
        };
        let mut sizes: Vec<usize> = (all.iter().filter(|c| c.paper.is_none()))
            .map(|c| c.coefficients)
            .collect();
        sizes.dedup();
        let mut series: Vec<Series> = (sizes.iter())
            .map(|size| Series {
                name: format!("{:.1} M coefficients", *size as f64 / 1e6),
                points: points(&|c| c.coefficients == *size && c.paper.is_none(), &|c| {
                    c.milliseconds
                }),
            })
            .collect();
        if let Some(largest) = sizes.last() {
            series.push(Series {
                name: "5 µs a changed brick and 50 ns a sample".into(),
                points: points(
                    &|c| c.coefficients == *largest && c.paper.is_none(),
                    &FieldFitCost::bound,
                ),
            });
        }
        for cells in [64, 128] {
            let size = (cells + 3usize).pow(3);
            let is_row = |c: &&FieldFitCost| c.paper.is_some() && c.coefficients == size;
            series.push(Series {
                name: format!("one level of {cells}³"),
                points: points(&is_row, &|c| c.milliseconds),
            });
            series.push(Series {
                name: format!("the same in [Hua04], 2004, {cells}³"),
                points: points(&is_row, &|c| c.paper.unwrap_or(0.0)),
            });
        }
        Self {
            title: "a carved ball written back: time against the size of its box".into(),
            x_title: "finest knot intervals across the box".into(),
            y_title: "time, ms".into(),
            depth: 1e-7,
            series,
            is_joined: true,
        }
    }
}
