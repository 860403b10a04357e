//! What an edit costs, from small fields to large ones: it must not grow with the field.

use std::hint::black_box;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use bspline::hierarchical::{BlockEdit, Change};
use bspline::polygonize::{
    AdaptiveBlockMesh, AdaptiveOptions, BlockMesh, PolygonizeError, PolygonizeOptions,
};
use bspline::{Aabb, Field, Frame};
use glam::{DAffine3, DVec3};
use serde_json::{Map, Value};

use super::ball::{Ball, CELLS, median, middle};
use super::fields::{self, Tool};
use super::{Chart, Series};

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

const OF_LATTICE: &str = "functions next to the ball are the lattice's";

fn measure(ball: &Ball) -> Result<EditCosts, PolygonizeError> {
    let field = &ball.field;
    let edit = |p: DVec3| ball.edit(p, 0.01);
    let block = |i: usize| BlockEdit {
        level: ball.level,
        first: ball.function(ball.stroke(i)).map(|f| f - 12),
        shape: [24; 3],
        change: Change::Add(vec![0.001 * ball.cell() as f32; 24 * 24 * 24]),
    };
    let one = |i: usize| field.edited(&[edit(ball.stroke(i))]).expect(OF_LATTICE);
    let scattered: Vec<_> = (0..10_000).map(|i| edit(ball.scattered(i))).collect();
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
    let [live, live_edit] = remeshed_adaptively(ball, false)?;
    let [settled, settled_edit] = remeshed_adaptively(ball, true)?;
    costs.push(("remesh20_live_us", live));
    costs.push(("remesh20_settled_ms", settled / 1e3));
    costs.push(("remesh_edit_live_us", live_edit));
    costs.push(("remesh_edit_settled_ms", settled_edit / 1e3));
    let tools = [("tool10_ms", 10.0), ("tool20_ms", 20.0), ("tool40_ms", 40.0)];
    costs.extend(tools.map(|(name, across)| (name, carved(ball, across))));
    costs.extend(questions(ball));
    Ok(EditCosts {
        coefficients: field.coefficient_count(),
        costs,
    })
}

/// Box of 20 cells of the finest level at step `i` of a stroke: 5 by 2 by 2, from the middle of one to that of another.
fn twenty_cells(ball: &Ball, i: usize) -> Aabb {
    let size = ball.cell();
    let middle = (ball.stroke(i) / size).floor() + 0.5;
    let reach = DVec3::new(2.0, 0.5, 0.5);
    Aabb::new((middle - reach) * size, (middle + reach) * size)
}

/// Microseconds to mesh 20 cells again.
fn remeshed(ball: &Ball) -> Result<f64, PolygonizeError> {
    let cells = CELLS << ball.level;
    let frame = Frame {
        world_from_grid: DAffine3::from_scale(DVec3::splat(f64::from(CELLS) / f64::from(cells))),
        cells: [cells; 3],
    };
    let (mut mesh, _) = BlockMesh::new(&ball.field, &frame, &PolygonizeOptions::default())?;
    remeshing(ball, |changed| mesh.update(&ball.field, &[changed]).map(drop))
}

/// Microseconds to mesh again, in a mesh that follows the surface, of cells as small as the field's: 20 cells, and where
/// an edit of one coefficient changed values or bounds.
fn remeshed_adaptively(ball: &Ball, settled: bool) -> Result<[f64; 2], PolygonizeError> {
    let frame = Frame {
        world_from_grid: DAffine3::IDENTITY,
        cells: [CELLS; 3],
    };
    let options = AdaptiveOptions {
        depth: ball.level,
        detection: ball.level,
        ..Default::default()
    };
    let error = 0.02 * ball.cell();
    let mut mesh = AdaptiveBlockMesh::new(&ball.field, &frame, &options, error, settled)?;
    let of_cells = remeshing(ball, |changed| mesh.update(&ball.field, &[changed]).map(drop))?;
    let within = ball.field.lattice().world_box();
    let mut field = ball.field.clone();
    let times = (0..50).map(|i| {
        let edited = field
            .edited(&[ball.edit(ball.stroke(i), 0.05)])
            .expect(OF_LATTICE);
        let changed = edited.changed_boxes(&field, &within);
        field = edited;
        let start = Instant::now();
        mesh.update(&field, &changed)?;
        Ok(start.elapsed().as_secs_f64() * 1e6)
    });
    Ok([of_cells, middle(times.collect::<Result<_, _>>()?)])
}

/// Median time of 50 updates, microseconds.
fn remeshing(
    ball: &Ball,
    mut update: impl FnMut(Aabb) -> Result<(), PolygonizeError>,
) -> Result<f64, PolygonizeError> {
    let times = (0..50).map(|i| {
        let changed = twenty_cells(ball, i);
        let start = Instant::now();
        update(changed)?;
        Ok(start.elapsed().as_secs_f64() * 1e6)
    });
    Ok(middle(times.collect::<Result<_, _>>()?))
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
