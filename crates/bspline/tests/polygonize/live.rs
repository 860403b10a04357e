//! Adaptive meshes that follow a field are those made anew, and cost what changes.

use std::collections::BTreeMap;
use std::sync::Arc;

use bspline::hierarchical::{BrickKey, Corrections, Lattice, LevelCorrections, LevelEdit};
use bspline::polygonize::{AdaptiveBlockMesh, AdaptiveOptions, check_mesh};
use bspline::{Aabb, Field, HierarchicalSpline};
use glam::{DAffine3, DVec3};

use super::adaptive::{meshed, options};
use super::cube;
use super::fields::Random;

#[test]
fn a_mesh_that_followed_edits_is_the_one_made_anew() {
    let mut random = Random(3);
    let frame = cube(2.0, 6);
    let region = Aabb::new(DVec3::splat(-2.0), DVec3::splat(2.0));
    let iso = AdaptiveOptions {
        iso: 0.05,
        ..options(5)
    };
    // Dents and bumps of compact support on a ball: sums of cubic functions, on the finest level of a spline.
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_translation(DVec3::splat(-2.0))
            * DAffine3::from_scale(DVec3::splat(0.25)),
        cells: [16; 3],
    };
    let mut field = ball_spline(lattice);
    let live = |field: &dyn Field, settled| {
        AdaptiveBlockMesh::new(field, &frame, &iso, 0.002, settled).expect("a mesh")
    };
    let [mut mesh, mut calm] = [false, true].map(|settled| live(&field, settled));
    let (mut placed, mut whole) = (0, 0);
    let mut strokes = Vec::new();
    let rounds = 1000;
    for round in 1..=rounds {
        let n = field.lattice().cells_at(1)[0] as f64;
        let out =
            DVec3::new(random.unit() - 0.5, random.unit() - 0.5, random.unit() - 0.5).normalize_or(DVec3::X);
        let near = (DVec3::splat(0.5 * n) + out * 0.3 * n).round();
        let edit = LevelEdit {
            level: 1,
            function: near.to_array().map(|x| x as u32),
            delta: (0.4 * (random.unit() - 0.5)) as f32,
        };
        let next = field.edited(&[edit]).expect("an edit");
        let boxes = next.changed_boxes(&field, &region);
        placed += mesh.update(&next, &boxes).expect("an update").placed;
        strokes.extend(boxes);
        if round % 10 == 0 {
            calm.update(&next, &std::mem::take(&mut strokes))
                .expect("an update");
        }
        whole += mesh.block_count();
        field = next;
        if round % 100 == 0 {
            for (kept, settled) in [(&mesh, false), (&calm, true)] {
                let kept = kept.mesh().expect("a mesh").0;
                let anew = live(&field, settled).mesh().expect("a mesh").0;
                let once = meshed(&field, &frame, &iso, 0.002, settled).0;
                assert!(
                    kept == anew && kept == once,
                    "after {round} edits, settled: {settled}"
                );
                assert!(check_mesh(&kept.mesh).is_closed_manifold());
            }
        }
    }
    assert!(placed * 2 < whole, "{placed} of {whole} blocks placed anew");
}

/// A ball of radius 1.2 on coefficients of two levels.
fn ball_spline(lattice: Lattice) -> HierarchicalSpline<f32> {
    let mut bricks = BTreeMap::new();
    for n in 0..19u32.pow(3) {
        let s = [n / 361, n / 19 % 19, n % 19];
        let knot = DVec3::from_array(s.map(|s| f64::from(s) - 1.0));
        let value = 1.2 - lattice.world_from_lattice.transform_point3(knot).length();
        let brick = bricks
            .entry(BrickKey(s.map(|s| s / 8)))
            .or_insert_with(Corrections::empty);
        brick.set(s.map(|s| s as usize % 8), value as f32);
    }
    let coarse = bricks.into_iter().map(|(key, c)| (key, Arc::new(c))).collect();
    HierarchicalSpline::from_corrections(lattice, 1.0, vec![coarse, LevelCorrections::new()])
}
