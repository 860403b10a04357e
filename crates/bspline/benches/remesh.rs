//! A mesh that follows an edit, beside the mesh made anew.
//!
//! A ball of 256 finest knot intervals across in a box of 320, with a second level all over its surface and 512 cells of
//! mesh to the box's 320 intervals. `edit` adds one coefficient of the finest level; `compare` finds what has changed;
//! `follow` meshes those blocks again; `number` joins all blocks to one mesh; `anew` is the whole.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::sync::Arc;

use bspline::hierarchical::{BrickKey, Corrections, Lattice, LevelEdit};
use bspline::polygonize::{BlockMesh, PolygonizeOptions, polygonize};
use bspline::{Field, Frame, HierarchicalSpline};
use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DAffine3, DVec3};

const CELLS: u32 = 160;

/// Distance to the ball on the coarse level, small waves near its surface on the fine one.
fn ball() -> HierarchicalSpline<f32> {
    let levels = [0, 1].map(|level: u32| {
        let mut bricks: BTreeMap<BrickKey, Corrections<f32>> = BTreeMap::new();
        let n = (CELLS << level) + 3;
        for s in (0..n * n * n).map(|s| [s / n / n, s / n % n, s % n]) {
            let knot = (DVec3::from_array(s.map(f64::from)) - 1.0) / f64::from(1 << level);
            let height = 64.0 - (knot - 80.0).length();
            if level == 0 || height.abs() < 2.0 {
                let wave = 0.05 * (f64::from(s[0]) * 0.7).sin() * (f64::from(s[1]) * 0.9).sin();
                let brick = bricks
                    .entry(BrickKey(s.map(|s| s / 8)))
                    .or_insert_with(Corrections::empty);
                brick.set(
                    s.map(|s| s as usize % 8),
                    if level == 0 { height } else { wave } as f32,
                );
            }
        }
        bricks.into_iter().map(|(k, c)| (k, Arc::new(c))).collect()
    });
    let lattice = Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [CELLS; 3],
    };
    HierarchicalSpline::from_corrections(lattice, 1.0, levels.into())
}

fn remesh(c: &mut Criterion) {
    let field = ball();
    let frame = Frame {
        world_from_grid: DAffine3::from_scale(DVec3::splat(f64::from(CELLS) / 512.0)),
        cells: [512; 3],
    };
    let options = PolygonizeOptions::default();
    // On the surface, in the middle of a brick.
    let edit = [LevelEdit {
        level: 1,
        function: [36, 164, 164],
        delta: 0.1,
    }];
    let edited = field.edited(&edit).expect("a function of the field");
    let within = field.lattice().world_box();
    let boxes = edited.changed_boxes(&field, &within);
    let (blocks, report) = BlockMesh::new(&field, &frame, &options).expect("a valid frame");
    let follow = || {
        let mut blocks = blocks.clone();
        let update = blocks.update(&edited, black_box(&boxes)).expect("few blocks");
        (blocks, update)
    };
    let (followed, update) = follow();
    println!(
        "{} bricks, {} of them new; {} blocks, {} of them new; {} cells sampled, {} for the whole",
        field.brick_count(),
        edited.changed_bricks(&field).len(),
        report.blocks,
        update.changed.len(),
        update.report.cells_sampled,
        report.cells_sampled
    );
    let mut group = c.benchmark_group("remesh");
    group.sample_size(10);
    group.bench_function("edit", |b| b.iter(|| field.edited(black_box(&edit))));
    group.bench_function("compare", |b| {
        b.iter(|| edited.changed_boxes(black_box(&field), &within));
    });
    group.bench_function("follow", |b| b.iter(follow));
    group.bench_function("piece", |b| {
        b.iter(|| followed.piece(black_box(update.changed[0])))
    });
    group.bench_function("number", |b| b.iter(|| followed.mesh()));
    group.bench_function("anew", |b| {
        b.iter(|| polygonize(black_box(&edited), &frame, &options));
    });
    group.finish();
}

criterion_group!(benches, remesh);
criterion_main!(benches);
