//! Speed of what evaluation and bounds are made of: B-splines of any degree, uniform cubic weights, restriction of
//! a brick, solids with a formula, and a tree that leaves out its far branches.

use std::hint::black_box;
use std::sync::Arc;

use bspline::basis::Basis;
use bspline::primitives::{Capsule, Cuboid, Cylinder, Gyroid, Sphere, Torus};
use bspline::restrict::{RestrictedAxis, restricted_range};
use bspline::{Aabb, Csg, Field, Frame, KnotVector, cubic};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{DVec3, dvec3};

/// Evenly spread numbers in `[0, 1)`, out of order.
fn scattered(count: usize) -> Vec<f64> {
    (0..count)
        .map(|i| (i as f64 * 0.618_033_988_749_894_9).fract())
        .collect()
}

fn basis(c: &mut Criterion) {
    let mut group = c.benchmark_group("basis");
    let parameters = scattered(1000);
    group.throughput(Throughput::Elements(1000));
    for (degree, order) in [(1, 0), (3, 0), (3, 2), (5, 3)] {
        let knots = KnotVector::clamped_uniform(degree, 50, 0.0, 1.0).expect("valid");
        group.bench_function(format!("degree-{degree}-derivatives-{order}"), |b| {
            b.iter(|| {
                parameters
                    .iter()
                    .map(|t| Basis::<f64>::at(&knots, *t, order).values()[0])
                    .sum::<f64>()
            });
        });
    }
    let single: Vec<f32> = parameters.iter().map(|t| *t as f32).collect();
    group.bench_function("uniform-cubic-value-slope-f32", |b| {
        b.iter(|| {
            single.iter().fold([0.0f32; 4], |s, t| {
                let (w, d) = (cubic::values(*t), cubic::first(*t));
                std::array::from_fn(|j| s[j] + w[j] * d[j])
            })
        });
    });
    group.finish();
}

fn bounds(c: &mut Criterion) {
    let mut group = c.benchmark_group("bounds");
    let mut brick = [0.0f32; 1331];
    (0..1331).for_each(|i| brick[i] = (i as f32 * 0.37).sin());
    for (name, a, b) in [
        ("quarter-cell", 3.3, 3.55),
        ("cell", 3.0, 4.0),
        ("half-brick", 4.0, 8.0),
        ("brick", 0.0, 8.0),
    ] {
        group.bench_function(format!("restricted-{name}"), |bench| {
            bench.iter(|| {
                let axes = [RestrictedAxis::<f32>::new(black_box(a), b); 3];
                restricted_range(&brick, &axes)
            });
        });
    }
    let solids: [(&str, Arc<dyn Field>); 5] = [
        ("sphere", Arc::new(Sphere::new(DVec3::ZERO, 1.0).expect("valid"))),
        (
            "cuboid",
            Arc::new(Cuboid::new(DVec3::ZERO, DVec3::ONE).expect("valid")),
        ),
        (
            "cylinder",
            Arc::new(Cylinder::new(-DVec3::ONE, DVec3::ONE, 0.5).expect("valid")),
        ),
        (
            "torus",
            Arc::new(Torus::new(DVec3::ZERO, DVec3::ONE, 1.0, 0.3).expect("valid")),
        ),
        (
            "gyroid",
            Arc::new(Gyroid::new(DVec3::ZERO, 1.0, 0.0).expect("valid")),
        ),
    ];
    let b = Aabb {
        min: dvec3(0.3, 0.4, -0.2),
        max: dvec3(0.5, 0.7, 0.1),
    };
    for (name, solid) in &solids {
        group.bench_function(*name, |bench| bench.iter(|| solid.bounds(black_box(&b))));
    }
    group.finish();
}

/// One value at each node of 64³ cells: a single sphere, and the union of 1 000 of which each block sees a few.
fn tree(c: &mut Criterion) {
    let sphere = |x, y, z| Arc::new(Sphere::new(dvec3(x, y, z), 0.7).expect("valid")) as Arc<dyn Field>;
    let grid = (0..1000)
        .map(|i| sphere((i / 100) as f64, (i / 10 % 10) as f64, (i % 10) as f64))
        .collect();
    let union = Csg::union(grid).expect("valid");
    let capsule = Arc::new(Capsule::new(dvec3(0.0, 5.0, 5.0), dvec3(9.0, 5.0, 5.0), 0.4).expect("valid"));
    let drilled = Csg::difference(sphere(5.0, 5.0, 5.0), vec![capsule], 0.0).expect("valid");
    let frame = Frame::over(
        &Aabb {
            min: DVec3::ZERO,
            max: DVec3::splat(9.0),
        },
        [64; 3],
    );
    let mut values = vec![0.0; 65 * 65 * 65];
    let mut group = c.benchmark_group("tree");
    group
        .sample_size(10)
        .throughput(Throughput::Elements(values.len() as u64));
    let fields: [(&str, &dyn Field); 3] = [
        ("sphere", &*sphere(5.0, 5.0, 5.0)),
        ("difference-of-2", &drilled),
        ("union-of-1000", &union),
    ];
    for (name, field) in fields {
        group.bench_function(name, |b| {
            b.iter(|| field.frame_values(&frame, [0; 3], [65; 3], &mut values))
        });
    }
    group.finish();
}

criterion_group!(benches, basis, bounds, tree);
criterion_main!(benches);
