//! Tensor splines: evaluation, and insertion of knots.
//!
//! `eval` is by point, random ones in a block of 32³ coefficients of the working precision, degree in the name; `grid`
//! by node; `insert` by new coefficient: one knot into each of the three axes, and every span of all axes split in two.

use std::hint::black_box;

use bspline::{Aabb, Field, Frame, KnotVector, TensorSpline};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{DAffine3, DVec3};

fn random(state: &mut u64) -> f64 {
    *state = state
        .wrapping_mul(6364136223846793005)
        .wrapping_add(1442695040888963407);
    (*state >> 11) as f64 / (1u64 << 53) as f64
}

/// `n³` random coefficients on random knots between 0 and 1.
fn spline(degree: usize, n: usize) -> TensorSpline<f32> {
    let mut seed = 1;
    let knots = [0; 3].map(|_| {
        let mut inner: Vec<f64> = (0..n - degree - 1).map(|_| random(&mut seed)).collect();
        inner.sort_by(f64::total_cmp);
        let ends = |u: f64| std::iter::repeat_n(u, degree + 1);
        KnotVector::new(degree, ends(0.0).chain(inner).chain(ends(1.0)).collect()).expect("sorted")
    });
    let coefficients = (0..n * n * n).map(|_| random(&mut seed) as f32 - 0.5).collect();
    TensorSpline::new(knots, coefficients, DAffine3::IDENTITY, 1.0).expect("a valid spline")
}

fn eval(c: &mut Criterion) {
    let mut seed = 2;
    let points: Vec<DVec3> = (0..10_000)
        .map(|_| DVec3::new(random(&mut seed), random(&mut seed), random(&mut seed)))
        .collect();
    let mut group = c.benchmark_group("eval");
    group.throughput(Throughput::Elements(points.len() as u64));
    for degree in [1, 2, 3, 5] {
        let f = spline(degree, 32);
        group.bench_function(format!("value/{degree}"), |b| {
            b.iter(|| points.iter().map(|p| f.value(*p)).sum::<f64>());
        });
        let mut out = vec![(0.0, DVec3::ZERO); points.len()];
        group.bench_function(format!("value_gradient/{degree}"), |b| {
            b.iter(|| f.values_gradients(black_box(&points), &mut out));
        });
    }
    group.finish();

    let mut group = c.benchmark_group("grid");
    let frame = Frame::over(&Aabb::new(DVec3::ZERO, DVec3::ONE), [63; 3]);
    let mut out = vec![0.0; 64 * 64 * 64];
    group.throughput(Throughput::Elements(out.len() as u64));
    for degree in [1, 3, 5] {
        let f = spline(degree, 32);
        group.bench_function(format!("{degree}"), |b| {
            b.iter(|| f.frame_values(black_box(&frame), [0; 3], [64; 3], &mut out));
        });
    }
    group.finish();
}

fn insert(c: &mut Criterion) {
    let mut group = c.benchmark_group("insert");
    group.sample_size(20);
    for degree in [2, 3, 5] {
        let f = spline(degree, 32);
        let one = |f: &TensorSpline<f32>| {
            (0..3).fold(f.clone(), |f, a| {
                f.insert_knot(a, 0.37).expect("inside the domain")
            })
        };
        let all = |f: &TensorSpline<f32>| {
            (0..3).fold(f.clone(), |f, a| f.refined(a, 2).expect("spans with a length"))
        };
        for (name, finer) in [("one", &one as &dyn Fn(&_) -> TensorSpline<f32>), ("all", &all)] {
            group.throughput(Throughput::Elements(finer(&f).coefficients().len() as u64));
            group.bench_function(format!("{name}/{degree}"), |b| b.iter(|| finer(black_box(&f))));
        }
    }
    group.finish();
}

criterion_group!(benches, eval, insert);
criterion_main!(benches);
