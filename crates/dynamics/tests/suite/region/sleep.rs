//! How a solid is let go, and when it sleeps.

use bspline::{HierarchicalSpline, Real};
use dynamics::constraints::{Constraint, Hold, On};
use dynamics::integrators::Integrator;
use dynamics::matter::{Matter, Quantity};
use dynamics::region::{Region, RegionOptions, Thresholds};
use dynamics::springs::{Law, Neighbours, Weights};

use super::{CELLS, INTEGRATORS, damped, field, options, push, pushed, state_bits};

#[test]
fn released_clay_stays_to_the_bit() {
    let old = field::<f32>(3);
    for law in [Law::Linear { scale: 1.0 }, Law::FourD { scale: 0.8 }] {
        let matter = Matter {
            ground: Quantity::Constant(0.2),
            ..damped()
        };
        let options = RegionOptions {
            law,
            neighbours: Neighbours::Eighteen,
            ..options(&old)
        };
        let mut region = Region::new(&old, CELLS, matter, &options).unwrap();
        region.patch_mut().springs_mut().rest_mut().scale = Weights::Constant(1.1);
        region.set_force(&push(&region, 0.2)).unwrap();
        for _ in 0..3 {
            region.step(Integrator::TrBdf2, 0.1).unwrap();
        }
        let before: Vec<f32> = region.patch().state().d.clone();
        let clay = region.release_clay(&old).unwrap();
        assert_ne!(clay.sha256(), old.sha256());
        assert!(region.is_asleep());
        let at_rest = state_bits(&region);
        // What the steps moved them to is now read off the field: the same to a few units of rounding.
        let after = region.patch().state().d.iter().zip(&before);
        assert!(after.clone().all(|(a, b)| (a - b).abs() < 2e-5));
        assert!(after.clone().any(|(a, b)| a != b), "kept what it had accumulated");
        for integrator in INTEGRATORS {
            for _ in 0..4 {
                region.wake();
                region.step(integrator, 0.01).unwrap().expect("awake");
            }
        }
        assert!(region.is_asleep());
        assert_eq!(state_bits(&region), at_rest, "{law:?}");
        assert_eq!(region.bake(&clay).unwrap().sha256(), clay.sha256());
        assert_eq!(region.patch_mut().energy().total(), 0.0);
    }
}

#[test]
fn a_released_elastic_solid_returns() {
    let old = field::<f64>(2);
    let mut region = pushed(&old, CELLS, damped());
    let largest = |r: &Region<f64>| r.patch().state().p.iter().fold(0.0f64, |m, p| m.max(p.abs()));
    let away = largest(&region);
    region.release_elastic();
    let mut steps = 0;
    while region.step(Integrator::TrBdf2, 0.3).unwrap().is_some() {
        steps += 1;
        assert!(steps < 1000, "never falls asleep");
    }
    let left = largest(&region);
    assert!(
        away > 0.1 && left < 0.02 * away,
        "{left:.1e} of {away:.1e} after {steps}"
    );
}

#[test]
fn sleep_changes_no_bit_and_ends_with_a_force() {
    let old = field::<f32>(2);
    let mut region = Region::new(&old, CELLS, damped(), &options(&old)).unwrap();
    assert!(region.is_asleep(), "cut at rest");
    let none = state_bits(&region);
    assert!(region.step(Integrator::TrBdf2, 0.3).unwrap().is_none());
    region.set_force(&push(&region, 1e-6)).unwrap();
    assert!(region.is_asleep(), "a force below the threshold");
    let force = push(&region, 0.1);
    region.set_force(&force).unwrap();
    assert!(!region.is_asleep());
    let mut steps = 0;
    while region.step(Integrator::TrBdf2, 0.3).unwrap().is_some() {
        steps += 1;
        assert!(steps < 1000, "never falls asleep under a force that is balanced");
    }
    let held = state_bits(&region);
    assert_ne!(held, none);
    assert_eq!(region.step_work(Integrator::TrBdf2), 0);
    // The force that it has balanced does not wake it, another one does.
    region.set_force(&force).unwrap();
    for _ in 0..10 {
        assert!(region.step(Integrator::Paper, 0.3).unwrap().is_none());
    }
    assert_eq!(state_bits(&region), held);
    region.set_force(&vec![0.0; force.len()]).unwrap();
    assert!(region.step(Integrator::TrBdf2, 0.3).unwrap().is_some());
}

#[test]
fn a_swinging_solid_does_not_fall_asleep() {
    let old = field::<f64>(2);
    let mut region = pushed(&old, CELLS, Matter::default());
    region.release_elastic();
    // Many turning points and passes through the balance.
    for _ in 0..300 {
        assert!(region.step(Integrator::TrBdf2, 0.05).unwrap().is_some());
    }
}

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
        // Off by what the threshold of the acceleration allows at a frequency of one.
        assert!(
            steps > 3 && (found - expected).abs() < 0.1 * expected + sleep.acceleration,
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
