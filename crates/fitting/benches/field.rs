//! Fields written back into a box: the rows of \[Hua04\] Table 1, and the same tools at the edge of a deeper field.
//!
//! A row's working space has 128³ samples; its tool is a ball carved from the surface, as many samples across as it
//! says. One level and no look, as in the paper: new values at the samples, then coefficients.

use std::hint::black_box;
use std::sync::Arc;

use bspline::hierarchical::{BlockEdit, Change, Lattice};
use bspline::primitives::Sphere;
use bspline::{Aabb, Csg, Field, HierarchicalSpline};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use fitting::Control;
use fitting::field::{Aim, FieldFitOptions, fit_field};
use glam::{DAffine3, DVec3};

const SAMPLES: f64 = 128.0;
const RADIUS: f64 = 0.36;

/// Distance to a ball in the unit box on one level.
fn ball(cells: u32) -> HierarchicalSpline<f32> {
    let spacing = 1.0 / f64::from(cells);
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_scale(DVec3::splat(spacing)),
        cells: [cells; 3],
    };
    let n = cells as usize + 3;
    let knot = |i: usize| (i as f64 - 1.0) * spacing;
    let functions = (0..n * n * n).map(|i| DVec3::new(knot(i / n / n), knot(i / n % n), knot(i % n)));
    let values = functions.map(|p| (RADIUS - p.distance(DVec3::splat(0.5))) as f32);
    let all = BlockEdit {
        level: 0,
        first: [0; 3],
        shape: [n; 3],
        change: Change::Set(values.collect()),
    };
    HierarchicalSpline::from_corrections(lattice, 1.0, vec![Default::default()])
        .edited_blocks(&[all])
        .expect("functions of the lattice")
}

/// The fit of a ball `across` working samples wide, carved from the surface.
fn carve(field: &HierarchicalSpline<f32>, shared: &Arc<dyn Field>, across: f64, finest: usize) -> usize {
    let middle = DVec3::splat(0.5) + RADIUS * DVec3::new(0.48, 0.8, 0.36);
    let radius = 0.5 * across / SAMPLES;
    let tool = Sphere::new(middle, radius).expect("a ball of some size");
    let target = Csg::difference(shared.clone(), vec![Arc::new(tool)], 0.0).expect("finite");
    let within = Aabb::new(middle - radius, middle + radius);
    let options = FieldFitOptions {
        aim: Aim::Surface {
            iso: 0.0,
            tolerance: 0.02 / SAMPLES,
        },
        finest,
        look: false,
    };
    let fitted = fit_field(&target, field, &within, &options, &mut Control::default());
    fitted.expect("a tool beside nothing else").2.functions
}

fn table_1(c: &mut Criterion) {
    let mut group = c.benchmark_group("Hua04 Table 1");
    for (coefficients, sizes) in [(64, &[10, 20, 40][..]), (128, &[20, 40][..])] {
        let field = ball(coefficients - 3);
        let shared: Arc<dyn Field> = Arc::new(field.clone());
        for across in sizes {
            let name = BenchmarkId::new(
                format!("{coefficients}³ coefficients"),
                format!("{across}³ samples"),
            );
            group.bench_function(name, |b| {
                b.iter(|| black_box(carve(&field, &shared, f64::from(*across), 0)));
            });
        }
    }
    group.finish();
}

fn finer_levels(c: &mut Criterion) {
    let mut group = c.benchmark_group("two finer levels allowed");
    let field = ball(64);
    let shared: Arc<dyn Field> = Arc::new(field.clone());
    for across in [10, 20, 40] {
        group.bench_function(format!("{across}³ samples"), |b| {
            b.iter(|| black_box(carve(&field, &shared, f64::from(across), 2)));
        });
    }
    group.finish();
}

criterion_group!(benches, table_1, finer_levels);
criterion_main!(benches);
