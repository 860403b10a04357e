//! Speed of fits to oriented points, with the error of each beside its time.
//!
//! Clouds of 35,000 points without noise, drawn from a torus and from a hollow tetrahedron with a hole in each face
//! (thin walls, edges, genus 3), fitted down to 64, 128 and 256 cells along the box; no reading, no meshing. Errors
//! are Newton distances of the points to the fitted surface in 1e-4 of the diagonal.
//!
//! Peers on a cloud of this size (Stanford bunny, 34,834 points; CPU seconds with meshing, 95th percentile of the
//! distances from the points to the mesh in the same unit): Open3D Poisson depth 8 2.9 s, 4.94; PoissonRecon depth 6
//! 1.1 s, 18.4, depth 8 3.2 s, 5.33; MeshLab APSS grid 128 0.8 s, 4.14, grid 256 5.1 s, 2.65.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use fitting::Control;
use fitting::phantoms::{CloudOptions, Solid, sample_cloud};
use fitting::points::{OrientedPoints, PointOptions, fit_points};

const POINTS: usize = 35_000;

fn points(c: &mut Criterion) {
    let mut group = c.benchmark_group("fit");
    group
        .sample_size(10)
        .throughput(Throughput::Elements(POINTS as u64));
    for solid in [Solid::Torus, Solid::Tetrahedron] {
        let options = CloudOptions {
            count: POINTS,
            ..Default::default()
        };
        let cloud =
            sample_cloud(&*solid.field(), &solid.within(), &options).expect("the box holds the surface");
        let cloud = OrientedPoints {
            positions: &cloud.positions,
            normals: &cloud.normals,
            certainty: None,
        };
        for depth in [6, 7, 8] {
            let options = PointOptions {
                max_depth: Some(depth),
                ..Default::default()
            };
            let fit = || {
                fit_points::<f32>(black_box(&cloud), &options, &mut Control::default())
                    .expect("a clean cloud")
            };
            let (field, report) = fit();
            let unit = 1e-4 * cloud.diagonal();
            println!(
                "{} of 35 k points, depth {depth}: {} coefficients, rms {:.2}, p95 {:.2}, max {:.1}",
                solid.name(),
                field.coefficient_count(),
                report.rms / unit,
                report.p95 / unit,
                report.max / unit
            );
            group.bench_function(format!("points/{}/35k/depth {depth}", solid.name()), |b| {
                b.iter(fit)
            });
        }
    }
    group.finish();
}

criterion_group!(benches, points);
criterion_main!(benches);
