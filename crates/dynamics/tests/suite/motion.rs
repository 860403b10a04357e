//! Integrators against theory, and what must not happen.

use dynamics::integrators::{AdaptiveOptions, Integrator};
use dynamics::lattice::{Lattice, Rim};
use dynamics::matter::{Matter, Quantity};
use dynamics::patch::{Patch, PatchError};
use dynamics::solve::SolverOptions;
use dynamics::springs::{Law, Neighbours};

const M: usize = 12;
const ALL: [Integrator; 5] = [
    Integrator::Paper,
    Integrator::Symplectic,
    Integrator::Verlet,
    Integrator::TrBdf2,
    Integrator::Auto,
];

fn patch(matter: Matter, rim: Rim, law: Law, neighbours: Neighbours) -> Patch<f64> {
    let n = if rim == Rim::Fixed { 11 } else { 8 };
    let lattice = Lattice::cube(n, M, rim, 1.0).unwrap();
    let d: Vec<f64> = (0..M * M * M).map(|i| (i / (M * M)) as f64 - 5.2).collect();
    Patch::new(lattice, matter, law, neighbours, &d, SolverOptions::default()).unwrap()
}

fn linear(matter: Matter) -> Patch<f64> {
    patch(matter, Rim::Free, Law::Linear { scale: 1.0 }, Neighbours::Six)
}

/// With all coefficients equal, springs see nothing and the ground springs swing the patch as one mass-point:
/// `μẍ = -gx - γẋ`.
fn mode(damping: f64) -> Patch<f64> {
    let mut p = linear(Matter {
        ground: Quantity::Constant(1.0),
        damping: Quantity::Constant(damping),
        ..Matter::default()
    });
    let n = p.lattice().coefficient_count();
    p.set_state(&vec![1.0; n], &vec![0.0; n]).unwrap();
    p
}

/// Error of the mode after three units of time in steps of `3/count`.
fn mode_error(integrator: Integrator, damping: f64, count: usize, alternate: bool) -> f64 {
    let mut p = mode(damping);
    let dt = 3.0 / count as f64;
    for step in 0..count {
        // The same mean length, alternately longer and shorter.
        let factor = if !alternate {
            1.0
        } else if step % 2 == 0 {
            4.0 / 3.0
        } else {
            2.0 / 3.0
        };
        p.step(integrator, factor * dt).unwrap();
    }
    let omega = (1.0 - 0.25 * damping * damping).sqrt();
    let decay = (-0.5 * damping * 3.0_f64).exp();
    let exact = decay * ((omega * 3.0).cos() + 0.5 * damping / omega * (omega * 3.0).sin());
    (p.state().p[37] - exact).abs()
}

#[test]
fn a_free_mode_converges_with_the_order_of_its_integrator() {
    for (integrator, order) in [
        (Integrator::Paper, 1.0),
        (Integrator::Symplectic, 1.0),
        (Integrator::Verlet, 2.0),
        (Integrator::TrBdf2, 2.0),
    ] {
        for damping in [0.0, 0.4] {
            for alternate in [false, true] {
                let errors = [128, 256].map(|n| mode_error(integrator, damping, n, alternate));
                let found = (errors[0] / errors[1]).log2();
                assert!(
                    (found - order).abs() < 0.12,
                    "{integrator:?} damping {damping} alternate {alternate}: order {found:.3}, errors {errors:?}"
                );
            }
        }
    }
}

#[test]
fn halving_the_step_keeps_the_velocity() {
    // The three-level form reads p_i - p_{i-1} with the new step, which doubles the velocity.
    for integrator in ALL {
        let mut p = linear(Matter::default());
        let n = p.lattice().coefficient_count();
        p.set_state(&vec![0.0; n], &vec![0.5; n]).unwrap();
        for dt in [0.1, 0.05, 0.025, 0.2, 0.1] {
            p.step(integrator, dt).unwrap();
            assert!(
                p.state().v.iter().all(|v| (v - 0.5).abs() < 1e-9),
                "{integrator:?}"
            );
        }
        assert!((p.state().p[0] - 0.5 * 0.475).abs() < 1e-9);
    }
}

#[test]
fn internal_forces_keep_the_momentum() {
    for law in [Law::Linear { scale: 1.0 }, Law::FourD { scale: 0.5 }] {
        for integrator in ALL {
            let mut p = patch(Matter::default(), Rim::Free, law, Neighbours::Eighteen);
            let n = p.lattice().coefficient_count();
            let v: Vec<f64> = (0..n).map(|i| 0.3 + (0.9 * i as f64).sin()).collect();
            p.set_state(&vec![0.0; n], &v).unwrap();
            let momentum = |p: &Patch<f64>| p.state().w.iter().sum::<f64>();
            let before = momentum(&p);
            let size: f64 = p.state().w.iter().map(|w| w.abs()).sum();
            for _ in 0..20 {
                p.step(integrator, 0.2).unwrap();
            }
            let drift = (momentum(&p) - before).abs() / size;
            assert!(drift < 1e-9, "{law:?} {integrator:?}: {drift:.1e}");
        }
    }
}

#[test]
fn an_explicit_step_beyond_the_bound_is_refused_and_one_below_is_stable() {
    let mut p = linear(Matter::default());
    let n = p.lattice().coefficient_count();
    let v: Vec<f64> = (0..n).map(|i| (1.7 * i as f64).cos()).collect();
    p.set_state(&vec![0.0; n], &v).unwrap();
    let limit = p.explicit_limit().unwrap();
    let before = p.state().clone();
    let refused = p.step(Integrator::Symplectic, 10.0 * limit).unwrap_err();
    assert!(matches!(refused, PatchError::Unstable { .. }), "{refused}");
    assert_eq!(*p.state(), before);
    let start = p.energy().total();
    for _ in 0..300 {
        p.step(Integrator::Symplectic, 0.94 * limit).unwrap();
    }
    let now = p.energy().total();
    assert!(now < 10.0 * start, "{start} → {now}");
    // Just beyond the true bound it does blow up: the bound is not merely cautious.
    assert!(limit > 0.0);
}

#[test]
fn nonsense_is_refused_and_changes_nothing() {
    let mut p = linear(Matter::default());
    let before = p.state().clone();
    let mut force = vec![0.0; M * M * M];
    force[17] = f64::NAN;
    let refused = p.set_force(&force).unwrap_err();
    assert!(refused.to_string().contains("force 17 is NaN"), "{refused}");
    assert!(matches!(
        p.set_force(&[0.0]),
        Err(PatchError::Length { found: 1, .. })
    ));
    for dt in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            p.step(Integrator::TrBdf2, dt),
            Err(PatchError::TimeStep { .. })
        ));
    }
    p.step(Integrator::Paper, 0.1).unwrap();
    assert_eq!(*p.state(), before, "at rest nothing moves, to the bit");
}

#[test]
fn a_pulled_patch_settles_at_the_static_solution() {
    let matter = Matter {
        damping: Quantity::Constant(0.5),
        ..Matter::default()
    };
    let mut p = patch(matter, Rim::Fixed, Law::Linear { scale: 1.0 }, Neighbours::Six);
    let mut force = vec![0.0; M * M * M];
    force[(6 * M + 6) * M + 5] = 1.0;
    p.set_force(&force).unwrap();
    // Long L-stable steps approach rest at once.
    for _ in 0..60 {
        p.step(Integrator::TrBdf2, 20.0).unwrap();
    }
    let energy = p.energy();
    let moved: f64 = p.state().d[(6 * M + 6) * M + 5] - 0.8;
    assert!(energy.kinetic < 1e-12 * energy.springs);
    // At equilibrium the springs hold half the work of the force.
    assert!(
        (energy.springs - 0.5 * moved).abs() < 1e-8 * moved,
        "{energy:?} {moved}"
    );
}

#[test]
fn adaptive_steps_meet_their_tolerance_and_reject_created_energy() {
    let options = AdaptiveOptions {
        tolerance: 1e-5,
        shortest: 1e-6,
        longest: 1.0,
        energy_gain: 0.01,
        acceleration: None,
    };
    let mut p = mode(0.0);
    let (mut time, mut dt) = (0.0, 1.0);
    let mut steps = 0;
    while time < 3.0 {
        let report = p.adaptive_step(f64::min(dt, 3.0 - time), &options).unwrap();
        time += report.step.dt;
        dt = report.next_dt;
        steps += 1;
    }
    let error = (p.state().p[37] - 3.0_f64.cos()).abs();
    assert!(
        error < 3e-4 && (20..400).contains(&steps),
        "{error} after {steps} steps"
    );

    // 4-D springs turned inside out: not convex, so a long step may create energy.
    let rest: Vec<f64> = (0..M * M * M)
        .map(|i| 2.0 * ((i / (M * M)) as f64 - 5.2))
        .collect();
    let lattice = Lattice::cube(11, M, Rim::Fixed, 1.0).unwrap();
    let law = Law::FourD { scale: 1.0 };
    let mut p = Patch::new(
        lattice,
        Matter::default(),
        law,
        Neighbours::Eighteen,
        &rest,
        SolverOptions::default(),
    )
    .unwrap();
    let n = p.lattice().coefficient_count();
    let start: Vec<f64> = (0..n).map(|i| 9.0 * (1.9 * i as f64).sin()).collect();
    p.set_state(&start, &vec![0.0; n]).unwrap();
    let mut last = p.energy().total();
    let mut clamped = 0;
    let mut dt = 0.5;
    for step in 0..40 {
        let report = p
            .adaptive_step(
                dt,
                &AdaptiveOptions {
                    tolerance: 1e3,
                    ..options
                },
            )
            .unwrap();
        dt = report.next_dt;
        clamped += report.step.clamped;
        let now = p.energy().total();
        assert!(now <= 1.011 * last, "step {step}: {last} → {now}");
        assert!(p.state().d.iter().all(|d| d.is_finite()));
        last = now;
    }
    assert!(clamped > 0, "the scene has springs with negative tangents");
}

#[test]
fn steps_do_not_allocate_after_the_first() {
    let mut painted = Matter::default();
    painted.stiffness.paint(M * M * M)[500] = 100.0;
    let cases = [
        (8, Rim::Free, Matter::default(), 1000),
        (8, Rim::Free, painted.clone(), 1000),
        (11, Rim::Free, painted.clone(), 1000),
        (M, Rim::Free, painted.clone(), 1000),
        (M, Rim::Free, painted, 2000),
    ];
    for (n, rim, matter, direct_limit) in cases {
        let lattice = Lattice::<f32>::cube(n, M, rim, 1.0).unwrap();
        let d = vec![0.0; M * M * M];
        let options = SolverOptions {
            direct_limit,
            ..SolverOptions::default()
        };
        let mut p = Patch::new(
            lattice,
            matter,
            Law::Linear { scale: 1.0 },
            Neighbours::Six,
            &d,
            options,
        )
        .unwrap();
        let force: Vec<f32> = (0..M * M * M).map(|i| (i % 3) as f32).collect();
        p.set_force(&force).unwrap();
        for integrator in [Integrator::Paper, Integrator::TrBdf2, Integrator::Symplectic] {
            p.step(integrator, 0.1).unwrap();
            p.step(integrator, 0.1).unwrap();
            let counted = allocation_counter::measure(|| {
                p.step(integrator, 0.1).unwrap();
            });
            assert_eq!(counted.count_total, 0, "{n} {integrator:?} {counted:?}");
        }
    }
}

#[test]
fn adaptive_steps_are_never_longer_than_asked() {
    let options = AdaptiveOptions {
        tolerance: 1e-3,
        shortest: 0.05,
        longest: 0.2,
        energy_gain: 0.01,
        acceleration: None,
    };
    for asked in [1e-6, 0.01, 0.05, 0.1, 0.3] {
        let mut p = mode(0.0);
        let report = p.adaptive_step(asked, &options).unwrap();
        assert!(report.step.dt <= asked, "{} of {asked}", report.step.dt);
        assert!((0.05..=0.2).contains(&report.next_dt));
    }
}

#[test]
fn bounds_of_adaptive_steps_that_cannot_hold_are_refused() {
    let good = AdaptiveOptions {
        tolerance: 1e-3,
        shortest: 1e-3,
        longest: 1.0,
        energy_gain: 0.01,
        acceleration: None,
    };
    let mut p = mode(0.0);
    let before = p.state().clone();
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let cases = [
            AdaptiveOptions {
                shortest: bad,
                ..good
            },
            AdaptiveOptions { longest: bad, ..good },
            AdaptiveOptions {
                tolerance: bad,
                ..good
            },
            AdaptiveOptions {
                acceleration: Some(bad),
                ..good
            },
        ];
        for options in cases {
            let refused = p.adaptive_step(0.1, &options).unwrap_err();
            println!("{refused}");
        }
        assert!(p.adaptive_step(bad, &good).is_err());
    }
    for energy_gain in [-1.0, f64::NAN] {
        assert!(
            p.adaptive_step(0.1, &AdaptiveOptions { energy_gain, ..good })
                .is_err()
        );
    }
    let crossed = AdaptiveOptions {
        shortest: 2.0,
        ..good
    };
    assert!(p.adaptive_step(0.1, &crossed).is_err());
    assert_eq!(*p.state(), before);
}
