//! Speed of meshing a fitted field: the scan of `data/bunny.obj.gz` and a torus, 512 cells along the box, vertices by
//! root finding.
//!
//! Throughput counts the cells of the frame, sampled or not: a field that knows its own bounds need not look at them
//! all. Peers get the field on a dense grid of 512³ and place vertices by linear interpolation; in million voxels per
//! second, sampling not counted: VTK FlyingEdges 481 (2 threads), 168 (1 thread), VTK SurfaceNets 177,
//! fast-surface-nets 106, VTK MarchingCubes 73, MeshLib 56 (2 threads), scikit-image 55.

use std::hint::black_box;
use std::path::Path;

use bspline::polygonize::{PolygonizeOptions, polygonize};
use bspline::{Field, Frame, HierarchicalSpline};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use fitting::Control;
use fitting::phantoms::{CloudOptions, Solid, sample_cloud};
use fitting::points::{OrientedPoints, PointOptions, fit_points};
use formats::ReadLimits;
use glam::{DAffine3, DVec3};

const CELLS: u32 = 512;

fn fit(positions: &[DVec3], normals: &[DVec3], depth: usize) -> HierarchicalSpline<f32> {
    let cloud = OrientedPoints {
        positions,
        normals,
        certainty: None,
    };
    let options = PointOptions {
        max_depth: Some(depth),
        ..Default::default()
    };
    fit_points(&cloud, &options, &mut Control::default())
        .expect("a clean cloud")
        .0
}

fn bunny(depth: usize) -> HierarchicalSpline<f32> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/bunny.obj.gz");
    let cloud = formats::points::read(&path, &ReadLimits::default()).expect("a scan of the repository");
    fit(
        &cloud.positions,
        cloud.normals.as_ref().expect("it has faces"),
        depth,
    )
}

fn torus(depth: usize) -> HierarchicalSpline<f32> {
    let options = CloudOptions {
        count: 35_000,
        ..Default::default()
    };
    let cloud =
        sample_cloud(&*Solid::Torus.field(), &Solid::Torus.within(), &options).expect("a torus in a box");
    fit(&cloud.positions, &cloud.normals, depth)
}

/// User and system seconds of this process, all threads; in steps of 10 ms. `None` where `/proc` does not tell.
fn cpu_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // Fields 14 and 15, counted behind the name in brackets, which may hold spaces.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let ticks: f64 = fields.next()?.parse::<f64>().ok()? + fields.next()?.parse::<f64>().ok()?;
    Some(ticks / 100.0)
}

fn meshing(c: &mut Criterion) {
    let mut group = c.benchmark_group("mesh");
    group.sample_size(10);
    for (name, field) in [
        ("bunny/depth 7", bunny(7)),
        ("bunny/depth 8", bunny(8)),
        ("torus/depth 7", torus(7)),
    ] {
        let lattice = field.lattice();
        let step = lattice.extent() / f64::from(CELLS);
        let frame = Frame {
            world_from_grid: lattice.world_from_lattice * DAffine3::from_scale(step),
            cells: [CELLS; 3],
        };
        let mesh =
            || polygonize(black_box(&field), &frame, &PolygonizeOptions::default()).expect("a valid frame");
        let (surface, report) = mesh();
        // To first order, in cells: how well the vertices solve f = 0.
        let worst = surface
            .positions
            .iter()
            .map(|p| field.value_gradient(*p))
            .map(|(f, g)| f.abs() / g.length().max(1e-3) / frame.world_from_grid.matrix3.x_axis.length())
            .fold(0.0, f64::max);
        println!(
            "{name}: {} triangles, {:.2} % of the empty cells culled, vertices off by at most {worst:.1e} cells",
            surface.triangles.len(),
            100.0 * report.culled_share(),
        );
        group.throughput(Throughput::Elements(u64::from(CELLS).pow(3)));
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("threads");
            // On a machine with other work the wall clock says little.
            let rounds = 8;
            let before = cpu_seconds();
            (0..rounds).for_each(|_| drop(pool.install(mesh)));
            if let (Some(before), Some(after)) = (before, cpu_seconds()) {
                let each = (after - before) / f64::from(rounds);
                println!(
                    "{name}, {threads} threads: {each:.3} CPU s, {:.0} Mvoxel per CPU second",
                    f64::from(CELLS).powi(3) * 1e-6 / each
                );
            }
            group.bench_function(format!("{name}/{CELLS} cells/{threads} threads"), |b| {
                b.iter(|| pool.install(mesh));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, meshing);
criterion_main!(benches);
