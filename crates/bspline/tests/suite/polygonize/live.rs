//! Adaptive meshes that follow a field are those made anew, and cost what changes.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use bspline::hierarchical::{BrickKey, Corrections, Lattice, LevelCorrections, LevelEdit};
use bspline::polygonize::{
    AdaptiveBlock, AdaptiveBlockMesh, AdaptiveOptions, Mesh, PolygonizeError, check_mesh,
};
use bspline::primitives::Sphere;
use bspline::{Aabb, Field, HierarchicalSpline, Interval, Jet};
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

/// A ball of radius 1.2 on coefficients of the first of three levels.
fn ball_spline(lattice: Lattice) -> HierarchicalSpline<f32> {
    let mut bricks = BTreeMap::new();
    let side = lattice.cells[0] + 3;
    for n in 0..side.pow(3) {
        let s = [n / side / side, n / side % side, n % side];
        let knot = DVec3::from_array(s.map(|s| f64::from(s) - 1.0));
        let value = 1.2 - lattice.world_from_lattice.transform_point3(knot).length();
        let brick = bricks
            .entry(BrickKey(s.map(|s| s / 8)))
            .or_insert_with(Corrections::empty);
        brick.set(s.map(|s| s as usize % 8), value as f32);
    }
    let coarse = bricks.into_iter().map(|(key, c)| (key, Arc::new(c))).collect();
    HierarchicalSpline::from_corrections(
        lattice,
        1.0,
        vec![coarse, LevelCorrections::new(), LevelCorrections::new()],
    )
}

/// What a window shows: pieces, of which it fetches those that changed.
#[derive(Default)]
struct Window(BTreeMap<AdaptiveBlock, Mesh>);

impl Window {
    fn follow(&mut self, mesh: &AdaptiveBlockMesh, changed: &[AdaptiveBlock]) {
        for block in changed {
            self.0.remove(block);
            self.0.extend(mesh.piece(*block).map(|piece| (*block, piece)));
        }
    }
}

fn corners(mesh: &Mesh) -> impl Iterator<Item = [[u64; 3]; 3]> + '_ {
    (0..mesh.triangles.len()).map(|t| mesh.corners(t).map(|p| p.to_array().map(f64::to_bits)))
}

/// A ball on three levels; strokes of any size that dent it, add balls beside it and take them away.
fn strokes(seed: u64, rounds: usize, settled: bool) {
    let mut random = Random(seed);
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_translation(DVec3::splat(-2.0))
            * DAffine3::from_scale(DVec3::splat(0.25)),
        cells: [16; 3],
    };
    let mut field = ball_spline(lattice);
    // Some frames cut the ball, some leave it open there.
    let frame = cube([2.0, 1.0, 1.1][seed as usize % 3], 5 + seed as u32 % 3);
    let region = Aabb::new(DVec3::splat(-2.0), DVec3::splat(2.0));
    let options = AdaptiveOptions {
        open: seed % 2 == 1,
        ..options(4)
    };
    let error = [0.004, 0.001][seed as usize / 2 % 2];
    let mut mesh = AdaptiveBlockMesh::new(&field, &frame, &options, error, settled).expect("a mesh");
    let mut window = Window::default();
    window.follow(&mesh, &mesh.blocks());
    for round in 1..=rounds {
        let level = [0, 1, 1, 2, 2, 2][(6.0 * random.unit()) as usize % 6];
        let n = f64::from(field.lattice().cells_at(level)[0]);
        let at = DVec3::new(random.unit(), random.unit(), random.unit());
        let out = (at - 0.5).normalize_or(DVec3::X) * (0.25 + 0.1 * random.unit());
        let size = 0.8 / f64::from(1 << level);
        let edits = (0..1 + (3.0 * random.unit()) as usize).map(|_| LevelEdit {
            level,
            function: ((out + 0.5) * n + 3.0 * random.unit())
                .to_array()
                .map(|x| x as u32),
            delta: (size * (2.0 * random.unit() - 1.0)) as f32,
        });
        let next = field.edited(&edits.collect::<Vec<_>>()).expect("edits");
        let boxes = next.changed_boxes(&field, &region);
        let update = mesh.update(&next, &boxes).expect("an update");
        window.follow(&mesh, &update.changed);
        field = next;
        if round % (rounds / 2) == 0 {
            let kept = mesh.mesh().expect("a mesh").0;
            let anew = meshed(&field, &frame, &options, error, settled).0;
            assert!(
                kept == anew,
                "seed {seed}, settled: {settled}, after {round} strokes"
            );
            let shown: Vec<_> = mesh.blocks().iter().map(|block| &window.0[block]).collect();
            assert_eq!(
                shown.len(),
                window.0.len(),
                "seed {seed}: pieces that are gone are shown"
            );
            let shown = shown.into_iter().flat_map(corners);
            assert!(
                shown.eq(corners(&anew.mesh)),
                "seed {seed}, settled: {settled}: old pieces are shown"
            );
        }
    }
}

#[test]
fn strokes_of_any_size_are_followed_and_shown_to_the_bit_at_any_thread_count() {
    for seed in 0..20 {
        let threads = [1, 2, 8][seed as usize % 3];
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads start").install(|| {
            strokes(seed, 24, false);
            strokes(seed, 12, true);
        });
    }
}

#[test]
fn an_update_costs_what_changed_and_not_the_mesh() {
    // Balls of ever more cells of one size, all of them on the last level, and one stroke of four cells.
    let costs = [32, 64].map(|cells: u32| {
        let lattice = Lattice {
            world_from_lattice: DAffine3::from_translation(DVec3::splat(-2.0))
                * DAffine3::from_scale(DVec3::splat(4.0 / f64::from(cells))),
            cells: [cells; 3],
        };
        let field = ball_spline(lattice);
        let middle = 1.2 * DVec3::new(0.83, 0.41, 0.37).normalize();
        let spacing = 2.0 / f64::from(cells);
        let function = ((middle + 2.0) / spacing + 1.5).as_uvec3();
        let edit = LevelEdit {
            level: 1,
            function: function.to_array(),
            delta: 0.2 / cells as f32,
        };
        let next = field.edited(&[edit]).expect("an edit");
        // Where the function is not zero.
        let first = (function.as_dvec3() - 3.0) * spacing - 2.0;
        let changed = Aabb::new(first, first + 4.0 * spacing);
        let frame = cube(2.0, cells / 2);
        // Between what cells of the last two levels keep to.
        let error = 0.8 / f64::from(cells * cells);
        [false, true].map(|settled| {
            let mut mesh =
                AdaptiveBlockMesh::new(&field, &frame, &options(2), error, settled).expect("a mesh");
            let whole = mesh.mesh().expect("a mesh").0.mesh.triangles.len();
            let update = mesh.update(&next, &[changed]).expect("an update");
            assert!(!update.changed.is_empty());
            (whole, update)
        })
    });
    for form in 0..2 {
        let [(small, first), (large, last)] = costs.each_ref().map(|c| &c[form]);
        assert!(2 * large > 7 * small && 4 * last.settled < *large);
        for (few, many) in [
            (first.sampled, last.sampled),
            (first.placed, last.placed),
            (first.drawn, last.drawn),
            (first.settled, last.settled),
            (first.changed.len(), last.changed.len()),
        ] {
            assert!(many <= 2 * few, "{first:?} grows to {last:?}");
        }
    }
}

/// A field that counts the points at which its gradient is asked for.
struct Asked(Sphere, AtomicUsize);

impl Field for Asked {
    fn value(&self, p: DVec3) -> f64 {
        self.0.value(p)
    }
    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        self.1.fetch_add(1, Ordering::Relaxed);
        self.0.value_gradient(p)
    }
    fn jet(&self, p: DVec3) -> Jet {
        self.0.jet(p)
    }
    fn bounds(&self, b: &Aabb) -> Interval {
        self.0.bounds(b)
    }
}

/// Vertices are placed cell by cell: those of the 20 blocks that such a box meets with their neighbours' are a thousand.
#[test]
fn a_change_of_one_cell_asks_for_vertices_next_to_it_alone() {
    let sphere = Sphere::new(DVec3::ZERO, 0.7).expect("a sphere");
    let field = Asked(sphere, AtomicUsize::new(0));
    let frame = cube(1.0, 8);
    let mut mesh = AdaptiveBlockMesh::new(&field, &frame, &options(3), 1e-4, false).expect("a mesh");
    let cell = 2.0 / 64.0;
    for direction in [DVec3::X, DVec3::ONE, DVec3::new(0.3, -0.8, 0.5)] {
        let corner = (0.7 * direction.normalize() / cell).floor() * cell;
        let before = field.1.load(Ordering::Relaxed);
        let update = mesh
            .update(&field, &[Aabb::new(corner, corner + cell)])
            .expect("an update");
        let asked = field.1.load(Ordering::Relaxed) - before;
        assert!(update.placed > 0 && asked > 0);
        // Two steps each; a sheet of 5 by 5 cells, of two levels or where three faces meet.
        assert!(asked <= 2 * 100, "{asked} points");
    }
}

#[test]
fn an_update_that_failed_is_made_up_for() {
    let field = |radius| Sphere::new(DVec3::ZERO, radius).expect("a sphere");
    let few = AdaptiveOptions {
        max_blocks: 400,
        ..options(4)
    };
    let frame = cube(1.0, 8);
    let mut mesh = AdaptiveBlockMesh::new(&field(0.1), &frame, &few, 1e-4, true).expect("a mesh");
    let all = [Aabb::new(DVec3::splat(-1.0), DVec3::splat(1.0))];
    let refused = mesh.update(&field(0.9), &all).err();
    assert_eq!(refused, Some(PolygonizeError::TooManyBlocks { limit: 400 }));
    assert!(mesh.blocks().is_empty());
    let corner = [Aabb::new(DVec3::splat(0.9), DVec3::splat(1.0))];
    mesh.update(&field(0.15), &corner).expect("few blocks");
    let anew = meshed(&field(0.15), &frame, &few, 1e-4, true).0;
    assert!(mesh.mesh().expect("a mesh").0 == anew);
}
