//! What an edit costs, from small fields to large ones: it must not grow with the field.

use std::hint::black_box;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use bspline::hierarchical::{BlockEdit, BrickKey, Change, DenseCorrections, Lattice, LevelEdit};
use bspline::polygonize::{BlockMesh, PolygonizeError, PolygonizeOptions};
use bspline::{Aabb, Field, Frame, HierarchicalSpline};
use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use serde_json::{Map, Value};

use super::fields::{self, Tool};
use super::{Chart, Series};

/// Cells of level 0 on an axis of the box.
const CELLS: u32 = 32;
/// Radius of the ball in edges of the box.
const RADIUS: f64 = 0.36;
/// Distance from the ball within which functions of finer levels are active, in their intervals.
const BAND: f64 = 2.0;

/// Costs of one field's edits: medians, under the names that the chart gives them.
pub struct EditCosts {
    /// Active functions.
    pub coefficients: usize,
    costs: Vec<(&'static str, f64)>,
}

impl EditCosts {
    /// All figures by name.
    pub fn json(&self) -> Value {
        let costs = self.costs.iter().map(|(name, cost)| {
            let rounded = (cost * 1e3).round() / 1e3;
            ((*name).to_string(), Value::from(rounded))
        });
        let mut all = Map::from_iter([("coefficients".to_string(), self.coefficients.into())]);
        all.extend(costs);
        all.into()
    }
}

/// Measures balls of ever more levels, up to about `most` coefficients; `go_on` is told of each before it is made.
///
/// # Errors
/// [`PolygonizeError::Cancelled`] if `go_on` says so, and whatever else the mesher has against a ball.
pub fn edit_costs(
    most: usize,
    mut go_on: impl FnMut(f64) -> ControlFlow<()>,
) -> Result<Vec<EditCosts>, PolygonizeError> {
    let mut all: Vec<EditCosts> = Vec::new();
    for depth in 2.. {
        // Each level has about four times the coefficients of the one before.
        let expected = all.last().map_or(0, |last| 4 * last.coefficients);
        if expected > most.saturating_add(most / 2) {
            break;
        }
        if go_on(expected as f64 / (1.5 * most as f64)).is_break() {
            return Err(PolygonizeError::Cancelled);
        }
        all.push(measure(&Ball::new(depth))?);
    }
    Ok(all)
}

pub(super) struct Ball {
    pub field: HierarchicalSpline<f32>,
    pub level: usize,
}

impl Ball {
    /// Distance to a ball on level 0; small waves near its surface on `depth` finer levels.
    pub fn new(depth: u32) -> Self {
        let lattice = Lattice {
            world_from_lattice: DAffine3::IDENTITY,
            cells: [CELLS; 3],
        };
        let levels = (0..=depth).map(|level| {
            let n = CELLS << level;
            let bricks = (n + 2) / 8 + 1;
            let keys = (0..bricks).into_par_iter().flat_map_iter(|x| {
                (0..bricks).flat_map(move |y| (0..bricks).map(move |z| BrickKey([x, y, z])))
            });
            let full: Vec<_> = keys
                .filter_map(|key| Some((key, Arc::new(brick(level, key)?.pack()))))
                .collect();
            full.into_iter().collect()
        });
        Self {
            field: HierarchicalSpline::from_corrections(lattice, 1.0, levels.collect()),
            level: depth as usize,
        }
    }

    /// The function next to a point.
    fn function(&self, p: DVec3) -> [u32; 3] {
        let p = p * f64::from(1u32 << self.level);
        p.to_array().map(|p| p as u32 + 1)
    }

    /// Where a stroke along the surface is after `i` steps of one finest interval each.
    pub fn stroke(&self, i: usize) -> DVec3 {
        let turn = 0.4 + i as f64 * self.cell() / (RADIUS * f64::from(CELLS));
        let (u, v) = (DVec3::new(0.8, 0.0, 0.6), DVec3::new(0.36, 0.8, -0.48));
        on_ball(libm::cos(turn) * u + libm::sin(turn) * v)
    }

    /// Point number `i` of a sequence that covers the surface evenly: steps of the plastic number \[Roberts18\].
    fn scattered(i: usize) -> DVec3 {
        let [a, b] = [0.754_877_666_25, 0.569_840_290_998].map(|step| (i as f64 * step).fract());
        let (z, turn) = (2.0 * a - 1.0, std::f64::consts::TAU * b);
        let r = (1.0 - z * z).sqrt();
        on_ball(DVec3::new(r * libm::cos(turn), r * libm::sin(turn), z))
    }

    /// Width of a cell of the finest level.
    pub fn cell(&self) -> f64 {
        1.0 / f64::from(1u32 << self.level)
    }
}

fn on_ball(direction: DVec3) -> DVec3 {
    let edge = f64::from(CELLS);
    DVec3::splat(0.5 * edge) + RADIUS * edge * direction
}

/// Functions of one brick of the ball; none if there are none.
fn brick(level: u32, key: BrickKey) -> Option<DenseCorrections<f32>> {
    let n = CELLS << level;
    let (middle, radius) = (DVec3::splat(f64::from(n) / 2.0), RADIUS * f64::from(n));
    let height = |knot: DVec3| radius - (knot - middle).length();
    let centre = DVec3::from_array(key.0.map(|k| f64::from(8 * k) + 2.5));
    if level > 0 && height(centre).abs() > 3.5 * 3f64.sqrt() + BAND {
        return None;
    }
    let mut corrections = DenseCorrections::empty();
    for slot in 0..512u32 {
        let at = [slot / 64, slot / 8 % 8, slot % 8];
        let function: [u32; 3] = std::array::from_fn(|a| 8 * key.0[a] + at[a]);
        if function.iter().any(|&f| f >= n + 3) {
            continue;
        }
        let height = height(DVec3::from_array(function.map(f64::from)) - 1.0);
        let value = match level {
            0 => height,
            _ if height.abs() > BAND => continue,
            _ => 0.05 * libm::sin(f64::from(7 * function[0] + 3 * function[1])) / f64::from(1u32 << level),
        };
        corrections.set(at.map(|a| a as usize), value as f32);
    }
    (corrections.mask != [0; 8]).then_some(corrections)
}

/// Median of `count` runs, microseconds; `run` is told its number and returns what it takes to drop, which is not timed.
pub(super) fn median<R>(count: usize, mut run: impl FnMut(usize) -> R) -> f64 {
    let times = (0..count).map(|i| {
        let start = Instant::now();
        let kept = black_box(run(i));
        let time = start.elapsed().as_secs_f64() * 1e6;
        drop(kept);
        time
    });
    middle(times.collect())
}

fn middle(mut times: Vec<f64>) -> f64 {
    times.sort_unstable_by(f64::total_cmp);
    times[times.len() / 2]
}

fn measure(ball: &Ball) -> Result<EditCosts, PolygonizeError> {
    let field = &ball.field;
    let edit = |p: DVec3| LevelEdit {
        level: ball.level,
        function: ball.function(p),
        delta: 0.01 * ball.cell() as f32,
    };
    let block = |i: usize| BlockEdit {
        level: ball.level,
        first: ball.function(ball.stroke(i)).map(|f| f - 12),
        shape: [24; 3],
        change: Change::Add(vec![0.001 * ball.cell() as f32; 24 * 24 * 24]),
    };
    const OF_LATTICE: &str = "functions next to the ball are the lattice's";
    let one = |i: usize| field.edited(&[edit(ball.stroke(i))]).expect(OF_LATTICE);
    let scattered: Vec<_> = (0..10_000).map(|i| edit(Ball::scattered(i))).collect();
    // The first hash is that of the whole field.
    black_box(field.sha256());
    let edited: Vec<_> = (0..50).map(one).collect();
    let within = field.lattice().world_box();
    let mut costs = vec![
        ("edit_one_us", median(200, one)),
        (
            "edit_block24_us",
            median(20, |i| field.edited_blocks(&[block(i)]).expect(OF_LATTICE)),
        ),
        (
            "edit_scattered_1e4_ms",
            median(5, |_| field.edited(&scattered).expect(OF_LATTICE)) / 1e3,
        ),
        (
            "difference_us",
            median(50, |i| {
                field.difference(&edited[i]).expect("versions of one field")
            }),
        ),
        (
            "changed_boxes_us",
            median(50, |i| edited[i].changed_boxes(field, &within)),
        ),
        ("hash_us", median(50, |i| edited[i].sha256())),
    ];
    let drops = edited.into_iter().map(|version| {
        let start = Instant::now();
        drop(version);
        start.elapsed().as_secs_f64() * 1e6
    });
    costs.push(("drop_us", middle(drops.collect())));
    costs.push(("remesh20_us", remeshed(ball)?));
    let tools = [("tool10_ms", 10.0), ("tool20_ms", 20.0), ("tool40_ms", 40.0)];
    costs.extend(tools.map(|(name, across)| (name, carved(ball, across))));
    costs.extend(questions(ball));
    Ok(EditCosts {
        coefficients: field.coefficient_count(),
        costs,
    })
}

/// Microseconds to mesh 20 cells again.
fn remeshed(ball: &Ball) -> Result<f64, PolygonizeError> {
    let cells = CELLS << ball.level;
    let frame = Frame {
        world_from_grid: DAffine3::from_scale(DVec3::splat(f64::from(CELLS) / f64::from(cells))),
        cells: [cells; 3],
    };
    let (mut mesh, _) = BlockMesh::new(&ball.field, &frame, &PolygonizeOptions::default())?;
    let size = frame.world_from_grid.matrix3.x_axis.x;
    let mut times = Vec::new();
    for i in 0..50 {
        // 5 by 2 by 2 cells, from the middle of one to that of another.
        let middle = (ball.stroke(i) / size).floor() + 0.5;
        let reach = DVec3::new(2.0, 0.5, 0.5);
        let changed = Aabb::new((middle - reach) * size, (middle + reach) * size);
        let start = Instant::now();
        black_box(mesh.update(&ball.field, &[changed])?);
        times.push(start.elapsed().as_secs_f64() * 1e6);
    }
    Ok(middle(times))
}

/// Milliseconds to carve a ball `across` finest cells wide, and to write the result back.
fn carved(ball: &Ball, across: f64) -> f64 {
    let field: Arc<dyn Field> = Arc::new(ball.field.clone());
    let tool = |i: usize| Tool {
        middle: ball.stroke(i),
        radius: 0.5 * across * ball.cell(),
        beside: 0.0,
        tolerance: 0.05 * ball.cell(),
        finest: ball.level,
    };
    median(15, |i| fields::carved((&ball.field, &field), &tool(i))) / 1e3
}

/// What it costs to lay out the bricks round a tool, and to ask them.
fn questions(ball: &Ball) -> Vec<(&'static str, f64)> {
    const ASKED: usize = 1000;
    let field = &ball.field;
    let reach = 12.0 * ball.cell();
    let around = |i: usize| Aabb::new(ball.stroke(i) - reach, ball.stroke(i) + reach);
    let local = field.local(&around(0));
    // A tool that moves a tenth of a cell at a time.
    let step = 0.1 * ball.cell();
    let path: Vec<DVec3> = (0..ASKED)
        .map(|i| ball.stroke(0) + step * ((i % 100) as f64 - 50.0) * DVec3::new(0.6, 0.5, 0.4))
        .collect();
    let each = |ask: &dyn Fn(DVec3) -> f64| {
        let all = median(21, |_| path.iter().map(|p| ask(*p)).sum::<f64>());
        all / ASKED as f64
    };
    let half = 0.5 * ball.cell();
    let ahead = DVec3::new(0.7, -0.5, 0.4) * ball.cell();
    vec![
        ("local_field_us", median(50, |i| field.local(&around(i)))),
        (
            "value_gradient_local_ns",
            1e3 * each(&|p| local.value_gradient(p).0),
        ),
        (
            "gradient_bounds_us",
            each(&|p| local.gradient_bounds(&Aabb::new(p - half, p + half))[0].lo),
        ),
        ("bounds_along_us", each(&|p| local.bounds_along(p, p + ahead).lo)),
    ]
}

impl Chart {
    /// Costs against the size of the field.
    pub fn of_edits(all: &[EditCosts]) -> Self {
        let names = all.first().into_iter().flat_map(|first| &first.costs);
        let series = names.enumerate().map(|(i, (name, _))| {
            let (label, unit) = name.rsplit_once('_').unwrap_or((name, "us"));
            let in_us = match unit {
                "ms" => 1e3,
                "ns" => 1e-3,
                _ => 1.0,
            };
            let points = all
                .iter()
                .map(|c| (c.coefficients as f64, c.costs[i].1 * in_us, String::new()));
            Series {
                name: label.replace('_', " "),
                points: points.collect(),
            }
        });
        Self {
            title: "edits and questions: their time against the size of the field".into(),
            x_title: "coefficients of the field".into(),
            y_title: "time, µs".into(),
            depth: 1e-7,
            series: series.collect(),
            is_joined: true,
        }
    }
}
