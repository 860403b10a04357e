//! Speed of the orientation of clouds without normals.
//!
//! Clouds of a torus and of a hollow tetrahedron (thin walls, genus 3), clean, and of the torus with noise of 0.5 % of
//! its diagonal. Printed before: the share of normals that point outward.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use fitting::Control;
use fitting::orient::{OrientOptions, Route, orient_points};
use fitting::phantoms::{CloudOptions, Solid, sample_cloud};

fn orient(c: &mut Criterion) {
    let mut group = c.benchmark_group("orient");
    group.sample_size(10);
    for (solid, count, noise, route) in [
        (Solid::Torus, 40_000, 0.0, Route::WindingNumber),
        (Solid::Torus, 40_000, 0.02, Route::WindingNumber),
        (Solid::Torus, 160_000, 0.0, Route::WindingNumber),
        (Solid::Tetrahedron, 40_000, 0.0, Route::WindingNumber),
        (Solid::Torus, 40_000, 0.0, Route::Tagging),
    ] {
        let options = CloudOptions {
            count,
            noise,
            ..Default::default()
        };
        let cloud =
            sample_cloud(&*solid.field(), &solid.within(), &options).expect("the box holds the surface");
        let run = || {
            let options = OrientOptions { route };
            orient_points(black_box(&cloud.positions), &options, &mut Control::default()).expect("a cloud")
        };
        let o = run();
        let good = o
            .normals
            .iter()
            .zip(&cloud.normals)
            .filter(|(n, t)| n.dot(**t) > 0.0)
            .count();
        let name = format!(
            "{}/{}/{}k/noise {noise}",
            route.name(),
            solid.name(),
            count / 1000
        );
        println!("{name}: {:.3} % outward", 100.0 * good as f64 / count as f64);
        group.throughput(Throughput::Elements(count as u64));
        group.bench_function(name, |b| b.iter(run));
    }
    group.finish();
}

criterion_group!(benches, orient);
criterion_main!(benches);
