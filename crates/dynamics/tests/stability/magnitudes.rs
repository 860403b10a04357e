//! Numbers far from one, and numbers that leave the range of the precision.

use bspline::Real;
use dynamics::integrators::{AdaptiveOptions, Integrator};
use dynamics::lattice::{Lattice, Rim};
use dynamics::matter::{Matter, Quantity};
use dynamics::patch::Patch;
use dynamics::solve::SolverOptions;
use dynamics::springs::{Law, Neighbours};

use crate::{ball, damped, painted, pull, slope};

const ALL: [Integrator; 4] = [
    Integrator::Paper,
    Integrator::Symplectic,
    Integrator::Verlet,
    Integrator::TrBdf2,
];

fn list<T: Real>(v: &[f64], factor: f64) -> Vec<T> {
    v.iter().map(|v| T::from_f64(v * factor)).collect()
}

fn patch<T: Real>(matter: Matter, law: Law, spacing: f64, density: f64) -> Patch<T> {
    let lattice = Lattice::cube(11, 12, Rim::Fixed, spacing).unwrap();
    let neighbours = match law {
        Law::Linear { .. } => Neighbours::Six,
        Law::FourD { .. } => Neighbours::Eighteen,
    };
    let d = list(&slope(12), density);
    Patch::new(lattice, matter, law, neighbours, &d, SolverOptions::default()).unwrap()
}

#[test]
fn densities_beyond_the_square_root_of_the_range_move_alike() {
    // Their squares are 0 or infinite in single precision: the region stood still, or became NaN.
    for integrator in ALL {
        let run = |size: f64| {
            let mut p = patch::<f32>(painted(12, 30.0, ball(12)), Law::Linear { scale: 1.0 }, 1.0, size);
            p.set_force(&list(&pull(12), size)).unwrap();
            for _ in 0..6 {
                p.step(integrator, 0.1).unwrap();
            }
            let p = &p.state().p;
            p.iter().map(|p| p.as_f64() / size).collect::<Vec<_>>()
        };
        let expected = run(1.0);
        let largest = expected.iter().fold(0.0_f64, |m, p| m.max(p.abs()));
        for size in [1e-24, 1e25] {
            for (found, p) in run(size).iter().zip(&expected) {
                assert!(
                    (found - p).abs() < 1e-4 * largest,
                    "{integrator:?} {size:e}: {found} {p}"
                );
            }
        }
    }
}

#[test]
fn a_state_that_leaves_the_range_ends_the_step_with_an_error() {
    for integrator in ALL {
        let mut p = patch::<f32>(damped(), Law::Linear { scale: 1.0 }, 1.0, 1.0);
        p.step(integrator, 0.1).unwrap();
        let before = p.state().clone();
        p.set_force(&vec![f32::MAX; 12 * 12 * 12]).unwrap();
        let refused = (0..200).find_map(|_| p.step(integrator, 0.3).err());
        let refused = refused.expect("a force without bound").to_string();
        assert!(p.state().d.iter().chain(&p.state().w).all(|d| d.is_finite()));
        println!("{integrator:?}: {refused}");
        // It goes on from where it was.
        p.set_force(&[0.0; 12 * 12 * 12]).unwrap();
        let n = before.p.len();
        p.set_state(&vec![0.0; n], &vec![0.0; n]).unwrap();
        p.step(integrator, 0.1).unwrap();
        assert_eq!(p.state().d, before.d);
    }
}

#[test]
fn rounding_is_not_taken_for_energy() {
    // Densities of thousands, whose rounding stretches springs by more than the pull does.
    let options = AdaptiveOptions {
        tolerance: 1e-2,
        shortest: 1e-6,
        longest: 1.0,
        energy_gain: 0.01,
        acceleration: None,
    };
    fn steps<T: Real>(slope: f64, law: Law, options: &AdaptiveOptions) -> (usize, f64) {
        let mut p = patch::<T>(
            Matter {
                damping: Quantity::Constant(0.3),
                ..Matter::default()
            },
            law,
            1.0,
            slope,
        );
        p.set_force(&list(&pull(12), 1.0)).unwrap();
        let (mut time, mut dt, mut count) = (0.0, 0.1, 0);
        let mut shortest = f64::INFINITY;
        while time < 5.0 && count < 500 {
            let report = p.adaptive_step(dt, options).unwrap();
            time += report.step.dt;
            shortest = shortest.min(report.step.dt);
            dt = report.next_dt;
            count += 1;
        }
        (count, shortest)
    }
    for slope in [1.0, 30.0, 300.0, 3000.0] {
        for law in [Law::Linear { scale: 1.0 }, Law::FourD { scale: 1.0 }] {
            let (single, double) = (
                steps::<f32>(slope, law, &options),
                steps::<f64>(slope, law, &options),
            );
            println!("{law:?} {slope}: {single:?} {double:?}");
            assert!(
                single.0 <= double.0 + 3 && single.1 > 0.5 * double.1,
                "{law:?} slope {slope}: {single:?} against {double:?}"
            );
        }
    }
}
