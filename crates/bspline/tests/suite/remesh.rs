//! A mesh that follows a field: after any changes it is the mesh made anew, and the cost is that of the changes.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::common::Random;
use bspline::hierarchical::{BrickKey, Corrections, Lattice, LevelCorrections, LevelEdit};
use bspline::polygonize::{
    BlockMesh, Mesh, Placement, PolygonizeError, PolygonizeOptions, check_mesh, polygonize,
};
use bspline::{Aabb, Field, Frame, HierarchicalSpline, Interval, Jet};
use glam::{DAffine3, DMat3, DVec3};

/// Centre of the ball, in coarse cells.
const CENTER: DVec3 = DVec3::new(6.0, 6.0, 3.9);

/// A ball in a box of 12 coarse cells, with two empty finer levels; it leaves the box at one side.
fn ball(world_from_lattice: DAffine3) -> HierarchicalSpline<f32> {
    let cells = [12u32; 3];
    let mut bricks: BTreeMap<BrickKey, Corrections<f32>> = BTreeMap::new();
    for n in 0..15u32.pow(3) {
        let s = [n / 225, n / 15 % 15, n % 15];
        let knot = DVec3::from_array(s.map(|s| s as f64 - 1.0));
        let value = 4.4 - (knot - CENTER).length();
        let brick = bricks
            .entry(BrickKey(s.map(|s| s / 8)))
            .or_insert_with(Corrections::empty);
        brick.set(s.map(|s| s as usize % 8), value as f32);
    }
    let coarse = bricks.into_iter().map(|(k, c)| (k, Arc::new(c))).collect();
    let lattice = Lattice {
        world_from_lattice,
        cells,
    };
    let levels = vec![coarse, LevelCorrections::new(), LevelCorrections::new()];
    HierarchicalSpline::from_corrections(lattice, 1.0, levels)
}

/// A few neighbouring functions, most of them on the finest level and near the first surface.
fn random_edit(field: &HierarchicalSpline<f32>, random: &mut Random) -> Vec<LevelEdit<f32>> {
    let level = [2, 2, 2, 2, 2, 1, 1, 0][random.below(8)];
    let n = field.lattice().cells_at(level);
    let out = (random.vector() - 0.5).normalize_or(DVec3::X) * (3.9 + random.unit());
    let near = ((CENTER + out) * (1 << level) as f64).as_uvec3().to_array();
    let first: [u32; 3] = match random.below(4) {
        0 => n.map(|n| random.below(n as usize + 3) as u32),
        _ => std::array::from_fn(|a| near[a].min(n[a] + 2)),
    };
    let size = 5.0 / (1 << level) as f64;
    (0..1 + random.below(4))
        .map(|_| LevelEdit {
            level,
            function: std::array::from_fn(|a| (first[a] + random.below(2) as u32).min(n[a] + 2)),
            delta: (size * (2.0 * random.unit() - 1.0)) as f32,
        })
        .collect()
}

/// Bits, so that zeros of both signs differ.
fn bits(mesh: &Mesh) -> (Vec<[u64; 3]>, Vec<[u64; 3]>, &[[u32; 3]]) {
    let all = |v: &[DVec3]| v.iter().map(|p| p.to_array().map(f64::to_bits)).collect();
    (all(&mesh.positions), all(&mesh.normals), &mesh.triangles)
}

fn corners(mesh: &Mesh) -> Vec<[[u64; 3]; 3]> {
    (0..mesh.triangles.len())
        .map(|t| mesh.corners(t).map(|p| p.to_array().map(f64::to_bits)))
        .collect()
}

/// Compares now and then; returns the cells looked at for an edit, in units of those for the whole.
fn follows(
    frame: &Frame,
    map: DAffine3,
    options: &PolygonizeOptions,
    edits: usize,
    stop: usize,
    seed: u64,
) -> f64 {
    let mut random = Random(seed);
    let mut field = ball(map);
    let within = frame.world_box([-1; 3], frame.cells.map(|n| n as i64 + 1));
    let (mut blocks, first) = BlockMesh::new(&field, frame, options).unwrap();
    let (mut sampled, mut shapes) = (0, std::collections::BTreeSet::new());
    for n in 1..=edits {
        let next = field.edited(&random_edit(&field, &mut random)).unwrap();
        let boxes = next.changed_boxes(&field, &within);
        let update = blocks.update(&next, &boxes).unwrap();
        sampled += update.report.cells_sampled;
        assert_eq!(update.report.unsound_blocks, 0);
        field = next;
        if n % stop == 0 {
            let (anew, _) = polygonize(&field, frame, options).unwrap();
            let kept = blocks.mesh().unwrap();
            assert!(bits(&kept) == bits(&anew), "after {n} edits");
            let pieces = blocks.blocks().map(|b| blocks.piece(b).unwrap().unwrap());
            let pieces: Vec<_> = pieces.flat_map(|piece| corners(&piece)).collect();
            assert!(pieces == corners(&anew), "pieces after {n} edits");
            let check = check_mesh(&anew);
            assert!(options.open || check.is_closed_manifold(), "{check:?}");
            shapes.insert((check.components, check.euler_characteristic, check.triangles));
        }
    }
    assert!(shapes.len() > 2, "the edits did nothing: {shapes:?}");
    sampled as f64 / edits as f64 / first.cells_sampled as f64
}

#[test]
fn a_mesh_after_a_thousand_edits_is_the_one_made_anew() {
    let map = DAffine3::from_scale_rotation_translation(
        DVec3::new(0.5, 0.7, 0.6),
        glam::DQuat::IDENTITY,
        DVec3::new(3.0, -2.0, 1.0),
    );
    // Two cells to each finest knot interval, capped, with normals.
    let frame = Frame {
        world_from_grid: map * DAffine3::from_scale(DVec3::splat(1.0 / 8.0)),
        cells: [96; 3],
    };
    let options = PolygonizeOptions {
        normals: true,
        ..Default::default()
    };
    let share = follows(&frame, map, &options, 1000, 125, 1);
    assert!(share < 0.15, "an edit costs {share} of the whole");
}

#[test]
fn turned_frames_larger_and_smaller_than_the_box_are_followed() {
    let oblique = DAffine3::from_mat3_translation(
        DMat3::from_cols(
            DVec3::new(1.0, 0.2, 0.0),
            DVec3::new(-0.3, 0.8, 0.1),
            DVec3::new(0.1, 0.0, -1.1),
        ),
        DVec3::new(10.0, -20.0, 5.0),
    );
    let whole = ball(oblique).lattice().world_box();
    let larger = Aabb::new(whole.min - 1.7, whole.max + 1.3);
    let smaller = Aabb::new(whole.center() - 4.6, whole.center() + 4.2);
    for (n, region) in [larger, smaller].into_iter().enumerate() {
        for (open, placement) in [
            (false, Placement::RootFinding { tolerance: 1e-4 }),
            (true, Placement::Linear),
        ] {
            let options = PolygonizeOptions {
                open,
                placement,
                iso: 0.2,
                ..Default::default()
            };
            follows(
                &Frame::over(&region, [57, 64, 75]),
                oblique,
                &options,
                60,
                15,
                n as u64 + 2,
            );
        }
    }
}

/// Another field inside of a box.
struct Patched<'a>(&'a dyn Field, &'a dyn Field, Aabb);

impl Patched<'_> {
    fn at(&self, p: DVec3) -> &dyn Field {
        let inside = p.cmpge(self.2.min).all() && p.cmple(self.2.max).all();
        if inside { self.1 } else { self.0 }
    }
}

impl Field for Patched<'_> {
    fn value(&self, p: DVec3) -> f64 {
        self.at(p).value(p)
    }
    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        self.at(p).value_gradient(p)
    }
    fn jet(&self, p: DVec3) -> Jet {
        self.at(p).jet(p)
    }
    fn bounds(&self, b: &Aabb) -> Interval {
        self.0.bounds(b).hull(self.1.bounds(b))
    }
}

#[test]
fn any_box_of_any_field_can_change() {
    // Jumps at the faces of the box, which lie on nodes, between them, and on the borders of blocks: the surface runs
    // along them.
    let sphere = |r| bspline::primitives::Sphere::new(DVec3::new(0.1, 0.2, 0.0), r).unwrap();
    let (small, large) = (sphere(0.9), sphere(1.3));
    let frame = Frame::over(&Aabb::new(DVec3::splat(-2.0), DVec3::splat(2.0)), [64; 3]);
    let options = PolygonizeOptions::default();
    let mut random = Random(11);
    for round in 0..40 {
        let mut corner = || {
            (0..3)
                .map(|_| (random.below(65) as f64 - 32.0) / 16.0)
                .collect::<Vec<_>>()
        };
        let (a, b) = (DVec3::from_slice(&corner()), DVec3::from_slice(&corner()));
        let off = if round % 2 == 0 { 0.0 } else { 0.01 };
        let changed = Aabb::new(a.min(b) - off, a.max(b) + off);
        let patched = Patched(&small, &large, changed);
        let (mut blocks, _) = BlockMesh::new(&small, &frame, &options).unwrap();
        let start = blocks.mesh().unwrap();
        let update = blocks.update(&patched, &[changed]).unwrap();
        let anew = polygonize(&patched, &frame, &options).unwrap().0;
        assert!(bits(&blocks.mesh().unwrap()) == bits(&anew), "{changed:?}");
        // Only the blocks named have changed.
        let (whole, _) = BlockMesh::new(&small, &frame, &options).unwrap();
        for block in whole
            .blocks()
            .filter(|b| update.changed.binary_search(b).is_err())
        {
            assert!(whole.piece(block) == blocks.piece(block));
        }
        blocks.update(&small, &[changed]).unwrap();
        assert!(
            bits(&blocks.mesh().unwrap()) == bits(&start),
            "back from {changed:?}"
        );
    }
}

#[test]
fn refused_and_empty_updates_leave_the_mesh_as_it_is() {
    let sphere = |r| bspline::primitives::Sphere::new(DVec3::ZERO, r).unwrap();
    let frame = Frame::over(&Aabb::new(DVec3::splat(-2.0), DVec3::splat(2.0)), [64; 3]);
    let mut options = PolygonizeOptions::default();
    let (mut blocks, report) = BlockMesh::new(&sphere(0.5), &frame, &options).unwrap();
    let before = blocks.mesh().unwrap();
    let far = Aabb::new(DVec3::splat(5.0), DVec3::splat(6.0));
    assert_eq!(
        blocks.update(&sphere(0.5), &[far]).unwrap().report.cells_sampled,
        0
    );
    assert!(blocks.update(&sphere(0.5), &[]).unwrap().changed.is_empty());
    let nan = Aabb {
        min: DVec3::NAN,
        max: DVec3::NAN,
    };
    // What is not known may be anywhere: everything is looked at again.
    let all = blocks.update(&sphere(0.5), &[nan]).unwrap().report;
    assert_eq!(all.blocks, report.blocks);
    assert!(bits(&blocks.mesh().unwrap()) == bits(&before));

    options.max_blocks = report.blocks as usize + 50;
    let (mut blocks, _) = BlockMesh::new(&sphere(0.5), &frame, &options).unwrap();
    let whole = Aabb::new(DVec3::splat(-2.0), DVec3::splat(2.0));
    let refused = blocks.update(&sphere(1.9), &[whole]).err();
    assert!(matches!(refused, Some(PolygonizeError::TooManyBlocks { .. })));
    let cancelled = blocks.update_with(&sphere(0.6), &[whole], &mut |_| std::ops::ControlFlow::Break(()));
    assert_eq!(cancelled.err(), Some(PolygonizeError::Cancelled));
    assert!(bits(&blocks.mesh().unwrap()) == bits(&before));
}
