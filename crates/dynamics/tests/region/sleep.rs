//! When a region sleeps, and what it may cost.

use bspline::{HierarchicalSpline, Real};
use dynamics::constraints::{Constraint, Hold, On};
use dynamics::integrators::Integrator;
use dynamics::region::{Region, RegionOptions, Thresholds};

use crate::{CELLS, damped, field, options, push};

/// A region of [`CELLS`] with the density at its middle held `away` from the field's.
fn held(field: &HierarchicalSpline<f64>, sleep: Thresholds, hold: Hold, away: f64) -> Region<f64> {
    let options = RegionOptions {
        sleep,
        ..options(field)
    };
    let mut region = Region::new(field, CELLS, damped(), &options).unwrap();
    let [nx, ny, nz] = region.patch().lattice().sample_dims();
    let middle = (nx / 2 * ny + ny / 2) * nz + nz / 2;
    let density = region.patch().state().d[middle].as_f64() + away;
    let constraint = Constraint {
        label: "middle".into(),
        on: On::Samples(vec![(middle, 1.0)]),
        density,
        hold,
    };
    region.patch_mut().set_constraints(&[constraint]).unwrap();
    region
}

const AWAKE: Thresholds = Thresholds {
    speed: 0.0,
    acceleration: 0.0,
};

/// Steps until the region sleeps.
fn settle(region: &mut Region<f64>) -> usize {
    let mut steps = 0;
    while region.step(Integrator::TrBdf2, 0.3).unwrap().is_some() {
        steps += 1;
        assert!(steps < 2000, "never falls asleep");
    }
    steps
}

#[test]
fn a_weak_constraint_spring_is_not_slept_through() {
    // The thresholds saw neither its force nor, after one step, any speed.
    let old = field::<f64>(2);
    let sleep = options(&old).sleep;
    for stiffness in [0.02, 0.2, 2.0] {
        let hold = Hold::Spring(stiffness);
        let (mut region, mut reference) = (held(&old, sleep, hold, 1.0), held(&old, AWAKE, hold, 1.0));
        let steps = settle(&mut region);
        for _ in 0..400 {
            reference.step(Integrator::TrBdf2, 0.3).unwrap();
        }
        let gap = |r: &Region<f64>| r.patch().constraint_gaps().next().unwrap();
        let (found, expected) = (1.0 - gap(&region), 1.0 - gap(&reference));
        assert!(
            steps > 3 && (found / expected - 1.0).abs() < 0.1,
            "stiffness {stiffness}: moved {found:.2e} of {expected:.2e} in {steps} steps"
        );
    }
}

#[test]
fn a_pinned_region_sleeps_once_it_rests() {
    // What a hard constraint bears is balanced by it.
    let old = field::<f64>(2);
    for away in [0.0, 0.5] {
        let mut region = held(&old, options(&old).sleep, Hold::Hard, away);
        region.set_force(&push(&region, 0.3)).unwrap();
        settle(&mut region);
        assert!(region.patch().constraint_gaps().all(|g| g.abs() < 1e-9));
        let moved = region
            .patch()
            .state()
            .p
            .iter()
            .fold(0.0_f64, |m, p| m.max(p.abs()));
        assert!(moved > 0.1, "{moved}");
        // The force that it bears does not wake it; without it the rest moves.
        region.set_force(&push(&region, 0.3)).unwrap();
        assert!(region.is_asleep());
        region
            .set_force(&vec![0.0; region.patch().state().d.len()])
            .unwrap();
        assert!(!region.is_asleep());
    }
}
