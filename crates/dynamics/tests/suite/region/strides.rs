//! Regions whose knots lie farther apart than the cells.

use bspline::{HierarchicalSpline, Real};
use dynamics::integrators::Integrator;
use dynamics::region::{Cells, Region, RegionError, RegionOptions, Viewer};

use super::{damped, field, off_at_samples, options, push, state_bits};

const STRIDE: [u32; 3] = [2, 1, 4];
const CELLS: Cells = Cells {
    level: 2,
    first: [8, 3, 12],
    count: [18, 9, 24],
};

fn strided<T: Real>(field: &HierarchicalSpline<T>) -> RegionOptions {
    RegionOptions {
        stride: STRIDE,
        samples_per_cell: STRIDE.map(|s| 4.0 / 3.0 / f64::from(s)),
        ..options(field)
    }
}

/// A region in motion.
fn moving<T: Real>(field: &HierarchicalSpline<T>, parts_sleep: bool) -> Region<T> {
    let mut region = Region::new(field, CELLS, damped(), &strided(field)).unwrap();
    region.set_parts_sleep(parts_sleep);
    region.set_force(&push(&region, 0.3)).unwrap();
    for _ in 0..8 {
        let report = region.step(Integrator::TrBdf2, 0.3).unwrap();
        report.expect("awake under a force");
    }
    region
}

/// At the samples the patch says what the field is, from its own knots.
fn keeps_to_the_patch<T: Real>(tolerance: f64) {
    let old = field::<T>(3);
    let mut region = moving(&old, false);
    assert_eq!(region.patch().lattice().coefficient_dims(), [6, 6, 3]);
    let new = region.bake(&old).unwrap();
    let [worst, most] = off_at_samples(&region, &old, &new);
    assert!(worst < tolerance && most > 0.1, "{worst:.1e} of {most:.1e}");
    // What a viewer is told is what is baked.
    let change = region.change_since(&mut Viewer::default()).unwrap();
    let coefficients = |field: &HierarchicalSpline<T>| {
        let count = change.count.map(|c| c as usize);
        field
            .level_coefficients(change.level, change.first, count)
            .unwrap()
    };
    let baked = coefficients(&new).into_iter().zip(coefficients(&old));
    for (told, (new, old)) in change.values.iter().zip(baked) {
        assert!((told.as_f64() - (new - old).as_f64()).abs() < tolerance);
    }
    // Let go, it goes on from there.
    let left = region.release_clay(&old).unwrap();
    assert_eq!(left.sha256(), new.sha256());
    assert_eq!(region.bake(&left).unwrap().sha256(), new.sha256());
}

#[test]
fn knots_farther_apart_than_cells_are_baked_exactly() {
    keeps_to_the_patch::<f32>(2e-5);
    keeps_to_the_patch::<f64>(1e-13);
}

#[test]
fn a_region_on_such_knots_moves_along() {
    let old = field::<f64>(3);
    let region = moving(&old, false);
    let [by_x, by_y, _] = STRIDE.map(|s| 3 * s);
    let cells = Cells {
        first: [CELLS.first[0] + by_x, CELLS.first[1] + by_y, CELLS.first[2]],
        ..CELLS
    };
    let (_, moved) = region.moved(&old, cells, damped()).unwrap();
    let [nx, ny, nz] = region.patch().lattice().coefficient_dims();
    let v = &region.patch().state().v;
    let mut fastest = 0.0_f64;
    for (i, kept) in moved.patch().state().v.iter().enumerate() {
        let [x, y, z] = [i / nz / ny + 3, i / nz % ny + 3, i % nz];
        let was = if x < nx && y < ny {
            v[(x * ny + y) * nz + z]
        } else {
            0.0
        };
        assert_eq!(*kept, was);
        fastest = fastest.max(was.abs());
    }
    assert!(fastest > 1e-3, "{fastest}");
}

#[test]
fn such_regions_are_written_down() {
    let old = field::<f32>(3);
    for parts_sleep in [false, true] {
        let mut region = moving(&old, parts_sleep);
        let mut again = Region::restore(&region.snapshot()).unwrap();
        for r in [&mut region, &mut again] {
            r.step(Integrator::TrBdf2, 0.1).unwrap();
        }
        assert_eq!(state_bits(&region), state_bits(&again));
        assert_eq!(
            region.bake(&old).unwrap().sha256(),
            again.bake(&old).unwrap().sha256()
        );
    }
}

#[test]
fn strides_that_leave_knots_between_cells_are_refused() {
    let old = field::<f32>(3);
    for (stride, axis) in [
        ([3, 1, 1], 0),
        ([1, 2, 1], 1),
        ([1, 1, 8], 2),
        ([0, 1, 1], 0),
        ([2, 1, 16], 2),
    ] {
        let options = RegionOptions {
            stride,
            ..options(&old)
        };
        let refused = Region::new(&old, CELLS, damped(), &options).unwrap_err();
        let is_told = matches!(refused, RegionError::Stride { axis: told, .. } if told == axis);
        assert!(is_told, "{stride:?}: {refused}");
    }
}
