//! What baking keeps and changes.

use bspline::hierarchical::LevelEdit;
use bspline::{Field, HierarchicalSpline, Real};
use dynamics::region::{Cells, Region, RegionError, RegionOptions, Thresholds};
use glam::DVec3;

use super::{CELLS, Random, damped, field, lattice, off_at_samples, options, pushed};

/// Random world points of the lattice's box, some just outside the faces of the region, and whether they lie in it.
fn points(cells: Cells, count: usize) -> Vec<(DVec3, bool)> {
    let lattice = lattice();
    let width = 1.0 / (1u64 << cells.level) as f64;
    let low = DVec3::from_array(cells.first.map(f64::from)) * width;
    let high = low + DVec3::from_array(cells.count.map(f64::from)) * width;
    let (before, behind) = (low - 1e-7, high + 1e-7);
    let mut random = Random(11);
    (0..count)
        .map(|i| {
            let mut q = lattice.extent() * DVec3::new(random.unit(), random.unit(), random.unit());
            if i % 4 == 0 {
                q[i / 4 % 3] = [before, behind][i / 12 % 2][i / 4 % 3];
            }
            // Outside the lattice the field continues its face. The way through the world rounds by less than 1e-9.
            let at = q.clamp(DVec3::ZERO, lattice.extent());
            let inside = at.cmpgt(low - 1e-9).all() && at.cmplt(high + 1e-9).all();
            (lattice.world_from_lattice.transform_point3(q), inside)
        })
        .collect()
}

fn bits<T: Real>(field: &HierarchicalSpline<T>, p: DVec3) -> [u64; 4] {
    let (v, g) = field.value_gradient(p);
    [v, g.x, g.y, g.z].map(f64::to_bits)
}

#[test]
fn baking_keeps_the_old_version_to_the_bit() {
    let old = field::<f32>(3);
    let (copy, hash) = (old.clone(), old.sha256());
    let points = points(CELLS, 500);
    let before: Vec<_> = points.iter().map(|(p, _)| bits(&old, *p)).collect();
    let region = pushed(&old, CELLS, damped());
    let new = region.bake(&old).unwrap();
    assert_ne!(new.sha256(), hash);
    assert_eq!(
        region.bake(&old).unwrap().sha256(),
        new.sha256(),
        "the same input, the same bits"
    );
    // Undo takes the old version out of the drawer: every brick of it is still there, and is the one it was.
    assert_eq!(old.sha256(), hash);
    assert_eq!(old.changed_bricks(&copy).len(), 0);
    for ((p, _), b) in points.iter().zip(before) {
        assert_eq!(bits(&old, *p), b);
    }
}

fn nothing_changes_beside<T: Real>(old: &HierarchicalSpline<T>, cells: Cells) {
    let region = pushed(old, cells, damped());
    let new = region.bake(old).unwrap();
    let (mut beside, mut changed) = (0, 0);
    for (p, inside) in points(cells, 20_000) {
        let same = bits(old, p) == bits(&new, p);
        beside += usize::from(!inside);
        changed += usize::from(!same);
        assert!(same || inside, "{p}");
    }
    assert!(beside > 1000 && changed > 300, "{beside} {changed}");
}

#[test]
fn outside_the_region_not_one_bit_changes() {
    nothing_changes_beside(&field::<f32>(2), CELLS);
    nothing_changes_beside(&field::<f32>(3), CELLS);
    nothing_changes_beside(&field::<f64>(3), CELLS);
    let old = field::<f32>(3);
    let new = pushed(&old, CELLS, damped()).bake(&old).unwrap();
    // Cells 7..17, 3..12, 5..17 lie in 3·2·3 bricks, each with up to 8 below.
    let unshared = new.changed_bricks(&old).len();
    assert!(
        (18..=18 * 9).contains(&unshared),
        "{unshared} of {}",
        new.brick_count()
    );
}

#[test]
fn a_level_the_field_lacks_is_made_in_whole_bricks() {
    let old = field::<f32>(1);
    let wanted = Cells {
        level: 2,
        first: [17, 9, 18],
        count: [6, 8, 10],
    };
    let refused = Region::new(&old, wanted, damped(), &options(&old)).unwrap_err();
    assert!(
        matches!(refused, RegionError::Spills { level: 2, .. }),
        "{refused}"
    );
    let cells = wanted.widened(&old).unwrap();
    // Bricks of level 1 are 16 cells of level 2 wide; axis y has 36.
    assert_eq!((cells.first, cells.count), ([16, 0, 16], [16, 32, 16]));
    nothing_changes_beside(&old, cells);
    // Where the level is there nothing has to be widened.
    assert_eq!(CELLS.widened(&field::<f32>(2)).unwrap(), CELLS);
}

fn baked_field_is_the_patch<T: Real>(tolerance: f64) {
    for levels in [2, 3] {
        let old = field::<T>(levels);
        let region = pushed(&old, CELLS, damped());
        let new = region.bake(&old).unwrap();
        let [nx, ny, nz] = region.patch().lattice().sample_dims();
        let [worst, moved] = off_at_samples(&region, &old, &new);
        assert_eq!(region.patch().state().d.len(), nx * ny * nz);
        // The field is about 12 at most: tens of units of rounding, of the steps too.
        assert!(
            worst < tolerance && moved > 0.1,
            "{levels} levels: {worst:.1e} of {moved:.1e}"
        );
    }
}

#[test]
fn the_field_inside_is_that_of_the_patch() {
    baked_field_is_the_patch::<f32>(2e-5);
    baked_field_is_the_patch::<f64>(1e-13);
}

#[test]
fn finer_levels_are_carried_along() {
    let (fine, coarse) = (field::<f64>(3), field::<f64>(2));
    let region = pushed(&fine, CELLS, damped());
    let (new, new_coarse) = (region.bake(&fine).unwrap(), region.bake(&coarse).unwrap());
    assert_eq!(new.corrections(2), fine.corrections(2));
    let mut worst = 0.0f64;
    for (p, _) in points(CELLS, 4000) {
        let (detail, change) = (
            fine.value(p) - coarse.value(p),
            new_coarse.value(p) - coarse.value(p),
        );
        worst = worst.max((new.value(p) - coarse.value(p) - change - detail).abs());
    }
    assert!(worst < 1e-13, "{worst:.1e}");
}

#[test]
fn baking_is_smooth_across_the_rim() {
    let old = field::<f64>(2);
    let new = pushed(&old, CELLS, damped()).bake(&old).unwrap();
    // Of a change that is C² the second derivative along the axis vanishes at the face as the distance does.
    let q = |x: f64| {
        lattice()
            .world_from_lattice
            .transform_point3(DVec3::new(x, 3.9, 5.6))
    };
    let axis = lattice().world_from_lattice.matrix3.x_axis.normalize();
    let bend = |x: f64| {
        axis.dot((new.jet(q(x)).hessian - old.jet(q(x)).hessian) * axis)
            .abs()
    };
    let (near, far) = (bend(3.5 + 1e-6), bend(3.8));
    assert!(far > 1e-3 && near < 1e-4 * far, "{near:.1e} {far:.1e}");
}

#[test]
fn regions_of_one_field_add_up() {
    let old = field::<f64>(2);
    let cells = |first: [u32; 3]| Cells {
        level: 1,
        first,
        count: [8; 3],
    };
    let (a, b) = (
        pushed(&old, cells([3, 2, 3]), damped()),
        pushed(&old, cells([8, 4, 6]), damped()),
    );
    let both = b.bake(&a.bake(&old).unwrap()).unwrap();
    let alone = [a.bake(&old).unwrap(), b.bake(&old).unwrap()];
    for (p, _) in points(cells([3, 2, 3]), 2000) {
        let sum: f64 = alone.iter().map(|f| f.value(p) - old.value(p)).sum();
        assert!((both.value(p) - old.value(p) - sum).abs() < 1e-12);
    }
}

#[test]
fn a_region_finer_than_the_field_starts_from_the_same_values() {
    let old = field::<f64>(1);
    let edited = old
        .edited(&[LevelEdit {
            level: 0,
            function: [5; 3],
            delta: 0.5,
        }])
        .unwrap();
    let cells = Cells {
        level: 1,
        first: [8, 0, 8],
        count: [8, 16, 8],
    }
    .widened(&edited)
    .unwrap();
    let sleep = Thresholds {
        speed: 0.0,
        acceleration: 0.0,
    };
    let region = Region::new(
        &edited,
        cells,
        damped(),
        &RegionOptions {
            sleep,
            ..options(&edited)
        },
    )
    .unwrap();
    let [_, ny, nz] = region.patch().lattice().sample_dims();
    for (i, d) in region.patch().state().d.iter().enumerate() {
        let p = region.sample_position([i / nz / ny, i / nz % ny, i % nz]);
        assert!((edited.value(p) - d).abs() < 1e-13);
    }
    // Nothing moved: nothing is baked.
    assert_eq!(region.bake(&edited).unwrap().sha256(), edited.sha256());
}
