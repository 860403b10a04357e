//! Which regions can be cut out of a field.

use std::collections::BTreeMap;

use bspline::HierarchicalSpline;
use dynamics::lattice::LatticeError;
use dynamics::matter::Matter;
use dynamics::patch::PatchError;
use dynamics::region::{Cells, Region, RegionError, RegionOptions};
use dynamics::springs::Neighbours;
use glam::{DMat3, DVec3};

use super::{CELLS, damped, field, lattice, options, push, pushed};

#[test]
fn cells_that_are_not_cubic_are_sampled_in_world_lengths() {
    let mut lattice = lattice();
    lattice.world_from_lattice.matrix3 = DMat3::from_diagonal(DVec3::new(1.0, 1.0, -2.0));
    let flat = HierarchicalSpline::<f64>::from_corrections(lattice, 1.0, vec![BTreeMap::new()]);
    let cells = Cells {
        level: 0,
        first: [0; 3],
        count: [9, 8, 7],
    };
    let mut options = RegionOptions {
        samples_per_cell: [2.0, 2.0, 4.0],
        neighbours: Neighbours::Eighteen,
        ..RegionOptions::of(&flat, 0)
    };
    let region = Region::new(&flat, cells, Matter::default(), &options).unwrap();
    assert_eq!(region.patch().lattice().spacing(), [0.5; 3]);
    assert_eq!(region.patch().lattice().sample_dims(), [19, 17, 29]);
    options.samples_per_cell = [2.0; 3];
    let refused = Region::new(&flat, cells, Matter::default(), &options).unwrap_err();
    assert!(
        matches!(refused, RegionError::Patch(PatchError::NotCubic { .. })),
        "{refused}"
    );
    options.neighbours = Neighbours::Six;
    let region = Region::new(&flat, cells, Matter::default(), &options).unwrap();
    assert_eq!(region.patch().lattice().spacing(), [0.5, 0.5, 1.0]);
}

#[test]
fn regions_that_cannot_be_are_refused() {
    let old = field::<f32>(2);
    let make =
        |cells: Cells, options: &RegionOptions| Region::new(&old, cells, damped(), options).map(|_| ());
    let good = options(&old);
    let with = |first, count| Cells {
        level: 1,
        first,
        count,
    };
    let refused = [
        make(with([0; 3], [4, 3, 4]), &good),
        make(with([20, 0, 0], [5, 5, 5]), &good),
        make(with([u32::MAX, 0, 0], [5, 5, 5]), &good),
        make(Cells { level: 60, ..CELLS }, &good),
    ];
    assert!(matches!(
        refused[0],
        Err(RegionError::TooFewCells { axis: 1, count: 3 })
    ));
    assert!(matches!(
        refused[1],
        Err(RegionError::Outside {
            axis: 0,
            cells: 24,
            ..
        })
    ));
    assert!(matches!(refused[2], Err(RegionError::Outside { axis: 0, .. })));
    assert!(matches!(refused[3], Err(RegionError::Edit(_))));
    let mut options = good;
    for value in [f64::NAN, 0.0, -1.0] {
        options.samples_per_cell[2] = value;
        assert!(matches!(
            make(CELLS, &options),
            Err(RegionError::SamplesPerCell { axis: 2, .. })
        ));
    }
    options.samples_per_cell[2] = 1e300;
    assert!(matches!(make(CELLS, &options), Err(RegionError::TooLarge { .. })));
    options.samples_per_cell[2] = 0.2;
    let few = make(CELLS, &options);
    assert!(matches!(
        few,
        Err(RegionError::Lattice(LatticeError::TooFewSamples { axis: 2, .. }))
    ));
    let huge = Cells {
        level: 9,
        first: [0; 3],
        count: [4000; 3],
    };
    assert!(matches!(
        make(huge, &good),
        Err(RegionError::TooLarge { what: "cells", .. })
    ));

    let mut sheared = lattice();
    sheared.world_from_lattice.matrix3.x_axis.y += 0.1;
    let other = HierarchicalSpline::<f32>::from_corrections(sheared, 1.0, vec![BTreeMap::new()]);
    let cells = Cells {
        level: 0,
        first: [0; 3],
        count: [8; 3],
    };
    let refused = Region::new(&other, cells, damped(), &good).map(|_| ());
    assert!(matches!(refused, Err(RegionError::Sheared { .. })));
    let region = pushed(&old, CELLS, damped());
    assert!(matches!(region.bake(&other), Err(RegionError::OtherLattice)));
    assert!(matches!(region.bake(&field(1)), Err(RegionError::Spills { .. })));
    let mut force = push(&region, 1.0);
    force[3] = f32::NAN;
    assert!(region.clone().set_force(&force).is_err());
}
