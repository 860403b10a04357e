//! Distances to a mesh, winding numbers, and the fit of its signed distance.

#[allow(dead_code, reason = "the tests use the rest")]
#[path = "../tests/suite/common/meshes.rs"]
mod meshes;

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use fitting::Control;
use fitting::mesh::{MeshDistance, MeshOptions, fit_mesh};
use fitting::phantoms::SplitMix64;
use glam::DVec3;

fn mesh_distance(c: &mut Criterion) {
    let mesh = meshes::torus(188);
    let mut group = c.benchmark_group("mesh_distance");
    group.sample_size(10);
    let triangles = mesh.triangles.len();
    group.bench_function(format!("prepare/{triangles}"), |b| {
        b.iter(|| MeshDistance::new(&mesh.vertices, &mesh.triangles).expect("a torus"));
    });
    let (solid, _) = MeshDistance::new(&mesh.vertices, &mesh.triangles).expect("a torus");
    let mut random = SplitMix64::new(1);
    let points: Vec<DVec3> = (0..1000).map(|_| (random.uniform3() * 2.0 - 1.0) * 1.6).collect();
    group.bench_function(format!("distance/1000/{triangles}"), |b| {
        b.iter(|| points.iter().map(|p| solid.distance(*p)).sum::<f64>());
    });
    group.bench_function(format!("winding_number/1000/{triangles}"), |b| {
        b.iter(|| points.iter().map(|p| solid.winding_number(*p)).sum::<f64>());
    });
    for tolerance in [0.002, 0.0005] {
        let options = MeshOptions {
            tolerance: Some(tolerance),
            ..Default::default()
        };
        group.bench_function(format!("fit/{tolerance}/{triangles}"), |b| {
            b.iter(|| {
                let control = &mut Control::default();
                black_box(fit_mesh::<f32>(
                    &mesh.vertices,
                    &mesh.triangles,
                    &options,
                    control,
                ))
                .expect("a torus")
            });
        });
    }
    group.finish();
}

criterion_group!(benches, mesh_distance);
criterion_main!(benches);
