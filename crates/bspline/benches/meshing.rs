//! Speed of meshing.
//!
//! `sphere/N`: the distance field of a sphere whose diameter is 0.8 of a frame of N³ cells. Throughput is in cells
//! of the frame, sampled or not. Peers on this field, sampled beforehand on a dense grid and with vertices by
//! linear interpolation, in million voxels per second at N = 256 / 512: VTK FlyingEdges 314 / 481 (2 threads),
//! 196 / 168 (1 thread), VTK SurfaceNets 203 / 177, fast-surface-nets 105 / 106, VTK MarchingCubes 64 / 73,
//! scikit-image 60 / 55, MeshLib 40 / 56 (2 threads).

use std::hint::black_box;

use bspline::polygonize::{Placement, PolygonizeOptions, check_mesh, polygonize};
use bspline::{Aabb, Field, Frame, Interval, Jet};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{DMat3, DVec3};

/// Distance to the unit sphere, positive inside.
struct Sphere;

impl Field for Sphere {
    fn value(&self, p: DVec3) -> f64 {
        1.0 - p.length()
    }
    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let r = p.length();
        (1.0 - r, -p / r)
    }
    fn jet(&self, p: DVec3) -> Jet {
        let r = p.length();
        let n = p / r;
        let outer = DMat3::from_cols(n * n.x, n * n.y, n * n.z);
        Jet {
            value: 1.0 - r,
            gradient: -n,
            hessian: (outer - DMat3::IDENTITY) * (1.0 / r),
        }
    }
    fn bounds(&self, b: &Aabb) -> Interval {
        let near = DVec3::ZERO.clamp(b.min, b.max).length();
        let far = b.min.abs().max(b.max.abs()).length();
        Interval::new(1.0 - far, 1.0 - near).widened(1e-12)
    }
}

fn meshing(c: &mut Criterion) {
    let mut group = c.benchmark_group("sphere");
    group.sample_size(10);
    for cells in [256, 512] {
        let frame = Frame::over(&Aabb::new(DVec3::splat(-1.25), DVec3::splat(1.25)), [cells; 3]);
        group.throughput(Throughput::Elements((cells as u64).pow(3)));
        for (name, placement) in [
            ("roots", Placement::RootFinding { tolerance: 1e-4 }),
            ("linear", Placement::Linear),
        ] {
            let options = PolygonizeOptions {
                placement,
                ..Default::default()
            };
            group.bench_function(format!("{name}/{cells}"), |b| {
                b.iter(|| polygonize(black_box(&Sphere), &frame, &options).expect("valid frame"));
            });
        }
    }
    group.finish();

    let frame = Frame::over(&Aabb::new(DVec3::splat(-1.25), DVec3::splat(1.25)), [256; 3]);
    let (mesh, _) = polygonize(&Sphere, &frame, &PolygonizeOptions::default()).expect("valid frame");
    let mut group = c.benchmark_group("check");
    group.sample_size(10);
    group.throughput(Throughput::Elements(mesh.triangles.len() as u64));
    group.bench_function("sphere/256", |b| b.iter(|| check_mesh(black_box(&mesh))));
    group.finish();
}

criterion_group!(benches, meshing);
criterion_main!(benches);
