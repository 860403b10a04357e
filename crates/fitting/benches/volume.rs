//! Volume fits: voxels per second of the prefilter, seconds of an adaptive fit.
//!
//! `cargo bench -p fitting --bench volume`. The prefilter's figure is the whole of the interpolating coefficients from
//! `f32` voxels: conversion, three axis passes, padding; without bricks. Peers on a volume of 181 × 217 × 181 (wall
//! seconds, two threads where they can): SciPy `spline_filter` 0.16, SimpleITK 0.30.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use fitting::Control;
use fitting::phantoms::head;
use fitting::prefilter::interpolating_coefficients;
use fitting::volume::{VolumeMethod, VolumeOptions, VolumeView, fit_volume};
use glam::DAffine3;

const DIMS: [usize; 3] = [181, 217, 181];

fn prefilter(c: &mut Criterion) {
    let values = head(DIMS, 0.02, 1);
    let mut group = c.benchmark_group("prefilter");
    group
        .throughput(Throughput::Elements(values.len() as u64))
        .sample_size(10);
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads");
        group.bench_function(
            BenchmarkId::new("f32 181x217x181", format!("{threads} threads")),
            |b| {
                b.iter(|| pool.install(|| interpolating_coefficients::<f32>(DIMS, black_box(&values))));
            },
        );
    }
    group.finish();
}

fn volume_fit(c: &mut Criterion) {
    let values = head(DIMS, 0.02, 1);
    let view = VolumeView {
        dims: DIMS,
        values: (&values).into(),
        world_from_voxel: DAffine3::IDENTITY,
    };
    let mut group = c.benchmark_group("volume_fit");
    group.sample_size(10).measurement_time(Duration::from_secs(20));
    let cases = [
        (
            "interpolate",
            VolumeOptions {
                method: VolumeMethod::Interpolate,
                ..Default::default()
            },
        ),
        (
            "adaptive 0.96 M",
            VolumeOptions {
                coefficients: Some(960_000),
                ..Default::default()
            },
        ),
        (
            "adaptive 0.5 M",
            VolumeOptions {
                coefficients: Some(500_000),
                ..Default::default()
            },
        ),
        ("default", VolumeOptions::default()),
    ];
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("one thread");
    for (name, options) in cases {
        group.bench_function(name, |b| {
            b.iter(|| pool.install(|| fit_volume::<f32>(&view, &options, &mut Control::default())));
        });
    }
    group.finish();
}

criterion_group!(benches, prefilter, volume_fit);
criterion_main!(benches);
