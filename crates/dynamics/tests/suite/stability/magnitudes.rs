//! Numbers far from one, and numbers that leave the range of the precision.

use bspline::Real;
use dynamics::constraints::{Constraint, Hold, On};
use dynamics::integrators::{AdaptiveOptions, Integrator};
use dynamics::lattice::{Lattice, Rim};
use dynamics::matter::{Matter, Quantity};
use dynamics::patch::{Patch, PatchError};
use dynamics::solve::{Method, SolverOptions, VCycleOptions};
use dynamics::springs::{Law, Neighbours, Weights};

use super::{ball, damped, painted, pull, slope};

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

/// Units in which a scene is told.
#[derive(Clone, Copy, Debug)]
struct Units {
    density: f64,
    length: f64,
    energy: f64,
    time: f64,
}

const ONE: Units = Units {
    density: 1.0,
    length: 1.0,
    energy: 1.0,
    time: 1.0,
};

#[derive(Clone, Copy, Debug, PartialEq)]
enum Held {
    Free,
    Spring,
    Hard,
}

/// Where a scene told in other units goes, and the lengths of its steps, in the units of the first.
fn told<T: Real>(u: Units, four_d: bool, held: Held, integrator: Option<Integrator>) -> Vec<f64> {
    let scale = u.length / u.density;
    let law = if four_d {
        Law::FourD { scale }
    } else {
        Law::Linear { scale }
    };
    let volume = u.length.powi(3);
    let times = |q: Quantity, by: f64| match q {
        Quantity::Constant(v) => Quantity::Constant(v * by),
        Quantity::PerSample(v) => Quantity::PerSample(v.iter().map(|v| v * by).collect()),
    };
    let of_mass = u.energy * (u.time / u.density).powi(2) / volume;
    let matter = painted(12, 30.0, ball(12));
    let matter = Matter {
        stiffness: times(matter.stiffness, u.energy / volume),
        mass: times(matter.mass, of_mass),
        damping: times(matter.damping, of_mass / u.time),
        ground: Quantity::Constant(0.01 * u.energy / (volume * u.length * u.length)),
        spring_factors: None,
    };
    let mut p = patch::<T>(matter, law, u.length, u.density);
    p.set_force(&list(&pull(12), u.energy / u.density)).unwrap();
    if held != Held::Free {
        let hold = match held {
            Held::Hard => Hold::Hard,
            _ => Hold::Spring(5.0 * u.energy / (u.length * u.length)),
        };
        let place = (5 * 12 + 6) * 12 + 5;
        let constraint = Constraint {
            label: "here".into(),
            on: On::Samples(vec![(place, 1.0)]),
            density: p.state().d[place].as_f64() + 0.25 * u.density,
            hold,
        };
        p.set_constraints(&[constraint]).unwrap();
    }
    let options = AdaptiveOptions {
        tolerance: 1e-3 * u.density,
        shortest: 1e-4 * u.time,
        longest: u.time,
        energy_gain: 0.01,
        acceleration: None,
    };
    let mut next = 0.3 * u.time;
    let mut steps = Vec::new();
    for _ in 0..5 {
        let dt = match integrator {
            Some(integrator) => p.step(integrator, 0.07 * u.time).unwrap().dt,
            None => {
                let report = p.adaptive_step(next, &options).unwrap();
                next = report.next_dt;
                report.step.dt
            }
        };
        steps.push(dt / u.time);
    }
    let energy = p.energy().total() / u.energy;
    let p = p.state().p.iter().map(|p| p.as_f64() / u.density);
    p.chain(steps).chain([energy]).collect()
}

fn told_alike<T: Real>(tolerance: f64, schemes: &[Option<Integrator>], units: &[Units]) {
    for four_d in [false, true] {
        for held in [Held::Free, Held::Spring, Held::Hard] {
            for &scheme in schemes {
                let expected = told::<T>(ONE, four_d, held, scheme);
                let largest = expected.iter().fold(0.0_f64, |m, p| m.max(p.abs()));
                for &u in units {
                    let found = told::<T>(u, four_d, held, scheme);
                    for (i, (a, b)) in found.iter().zip(&expected).enumerate() {
                        assert!(
                            (a - b).abs() <= tolerance * largest,
                            "{} 4-d {four_d} {held:?} {scheme:?} {u:?}: {a} {b} at {i} of {}",
                            T::NAME,
                            found.len()
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn a_scene_told_in_other_units_is_the_same_scene() {
    // Masses, stiffness, forces and volumes go through 10⁻⁷⁵ … 10⁷⁵ here.
    let mut units = Vec::new();
    for size in [1e-24, 1e25] {
        units.push(Units { density: size, ..ONE });
        units.push(Units { length: size, ..ONE });
        units.push(Units { energy: size, ..ONE });
        units.push(Units { time: size, ..ONE });
        units.push(Units {
            density: size,
            length: size,
            energy: size,
            ..ONE
        });
    }
    let schemes = [
        None,
        Some(Integrator::Paper),
        Some(Integrator::TrBdf2),
        Some(Integrator::Symplectic),
        Some(Integrator::Auto),
    ];
    told_alike::<f32>(1e-3, &schemes, &units);
    told_alike::<f64>(1e-9, &[Some(Integrator::TrBdf2)], &units);
}

#[test]
fn units_of_powers_of_two_change_no_bit() {
    let units = [
        (2f64.powi(-80), 1.0),
        (2f64.powi(83), 1.0),
        (1.0, 2f64.powi(-80)),
        (1.0, 2f64.powi(83)),
    ];
    for four_d in [false, true] {
        let expected = told::<f32>(ONE, four_d, Held::Free, Some(Integrator::TrBdf2));
        for (density, length) in units {
            let u = Units {
                density,
                length,
                ..ONE
            };
            let found = told::<f32>(u, four_d, Held::Free, Some(Integrator::TrBdf2));
            assert_eq!(found, expected, "4-d {four_d} {u:?}");
        }
    }
}

#[test]
fn springs_set_by_hand_move_the_tangent_and_the_bound() {
    // Forces knew them, the matrix of the step and the bound of explicit steps did not.
    let soft = Matter::default();
    let stiff = Matter {
        stiffness: Quantity::Constant(400.0),
        ..Matter::default()
    };
    let linear = Law::Linear { scale: 1.0 };
    let mut expected = patch::<f64>(stiff.clone(), linear, 1.0, 1.0);
    let mut found = patch::<f64>(soft, linear, 1.0, 1.0);
    found.explicit_limit().unwrap();
    found.step(Integrator::TrBdf2, 0.5).unwrap();
    let springs = stiff.lumped(expected.lattice(), Neighbours::Six).unwrap().springs;
    found.set_springs(&springs).unwrap();
    assert_eq!(
        found.explicit_limit().unwrap(),
        expected.explicit_limit().unwrap()
    );
    for p in [&mut found, &mut expected] {
        p.set_force(&pull(12)).unwrap();
        for _ in 0..5 {
            p.step(Integrator::TrBdf2, 0.5).unwrap();
        }
    }
    assert_eq!(found.state(), expected.state());
    // What cannot be is refused, and changes nothing.
    assert!(matches!(
        found.set_springs(&springs[..2]),
        Err(PatchError::Directions { .. })
    ));
    let mut bad = springs;
    for weight in [-1.0, f64::NAN, f64::INFINITY] {
        bad[1].weights = Weights::Constant(weight);
        assert!(matches!(found.set_springs(&bad), Err(PatchError::Matter(_))));
    }
    bad[1].weights = Weights::Each(vec![1.0; 5]);
    assert!(matches!(found.set_springs(&bad), Err(PatchError::Matter(_))));
    assert_eq!(
        found.explicit_limit().unwrap(),
        expected.explicit_limit().unwrap()
    );
}

#[test]
fn a_report_carries_the_worst_of_its_stages() {
    // A factor is made beside the solves. In the step between whose stages it is done, the first takes the iterations of a
    // V-cycle and the last one or two; a step of one solve ahead decides whether there is such a step.
    let options = SolverOptions {
        direct_limit: 20,
        v_cycle: VCycleOptions {
            direct_limit: 30,
            ..VCycleOptions::default()
        },
        ..SolverOptions::default()
    };
    let matter = Matter {
        damping: Quantity::Constant(0.0),
        ..painted(12, 1e3, ball(12))
    };
    let law = Law::Linear { scale: 1.0 };
    let iterations = [0, 1].map(|ahead| {
        let lattice = Lattice::<f64>::cube(11, 12, Rim::Fixed, 1.0).unwrap();
        let mut p = Patch::new(lattice, matter.clone(), law, Neighbours::Six, &slope(12), options).unwrap();
        p.set_force(&pull(12)).unwrap();
        for _ in 0..ahead {
            // Of the same matrix: c = (1 - 1/√2)Δt.
            p.step(Integrator::Paper, 1.0 - 0.5 * std::f64::consts::SQRT_2)
                .unwrap();
        }
        let direct = (0..100).find_map(|_| {
            let solve = p.step(Integrator::TrBdf2, 1.0).unwrap().solve;
            (solve.method == Method::Direct).then_some(solve.iteration.iterations)
        });
        direct.expect("the factor is done after a few steps")
    });
    println!("{iterations:?}");
    assert!(iterations.iter().min() <= Some(&2) && iterations.iter().max() > Some(&2));
}
