//! Rest lengths that follow: how fast, where, and what it costs in energy.

use dynamics::integrators::{AdaptiveOptions, Integrator};
use dynamics::lattice::{Lattice, Rim};
use dynamics::matter::{Matter, Quantity};
use dynamics::patch::{Patch, PatchError};
use dynamics::solve::SolverOptions;
use dynamics::springs::{Law, Neighbours, Plasticity, Weights};

const M: usize = 12;
const LAWS: [Law; 2] = [Law::Linear { scale: 0.7 }, Law::FourD { scale: 0.7 }];

fn noise(seed: usize) -> Vec<f64> {
    (0..M * M * M)
        .map(|i| (1.3 * (i * 7 + seed * 131) as f64).sin() + 0.2 * (i / (M * M)) as f64)
        .collect()
}

/// One coefficient is free.
fn patch(law: Law, damping: f64, mass: f64) -> Patch<f64> {
    let lattice = Lattice::cube(7, M, Rim::Fixed, 1.0).unwrap();
    let matter = Matter {
        damping: Quantity::Constant(damping),
        mass: Quantity::Constant(mass),
        ..Matter::default()
    };
    Patch::new(
        lattice,
        matter,
        law,
        Neighbours::Eighteen,
        &noise(1),
        SolverOptions::default(),
    )
    .unwrap()
}

#[test]
fn what_is_missing_decays_at_the_rate() {
    let mut p = patch(LAWS[0], 0.0, 1.0);
    p.set_state(&[1.0], &[0.0]).unwrap();
    let (d, first) = (p.state().d.clone(), p.energy().springs);
    // Energy is quadratic in what is missing: e^{-2λt}.
    for _ in 0..10 {
        p.springs_mut().relax(&d, -(-0.05_f64).exp_m1());
    }
    let left = p.energy().springs / first;
    assert!((left / (-1.0_f64).exp() - 1.0).abs() < 1e-12, "{left}");
    p.springs_mut().relax(&d, 1.0);
    assert!(p.energy().springs < 1e-28 * first);
}

#[test]
fn relaxing_creates_no_energy() {
    for law in LAWS {
        for scale in [0.5, 1.0, 1.4] {
            for share in [0.01, 0.3, 1.0] {
                let mut p = patch(law, 0.0, 1.0);
                // Among these springs are flattened ones and ones turned inside out.
                p.springs_mut().rest_at(&noise(2));
                p.springs_mut().rest_mut().scale = Weights::Constant(scale);
                let d = p.state().d.clone();
                let mut last = p.energy().springs;
                let first = last;
                for _ in 0..5 {
                    p.springs_mut().relax(&d, share);
                    let now = p.energy().springs;
                    assert!(
                        now <= last * (1.0 + 1e-12),
                        "{law:?} {scale} {share}: {last} → {now}"
                    );
                    last = now;
                }
                assert!(last < 0.99 * first, "{law:?} {scale} {share}: {first} → {last}");
            }
        }
    }
}

#[test]
fn clay_creeps_as_a_maxwell_body() {
    // With damping γ and stiffness k a force F ends in the speed F/(γ + k/λ).
    let (damping, rate) = (2.0, 3.0);
    let mut p = patch(LAWS[0], damping, 1e-3);
    p.set_state(&[1.0], &[1.0]).unwrap();
    let energy = p.energy();
    // ½kp², ½mv²; the damping is to the mass as γ to μ.
    let (k, c) = (2.0 * energy.springs, 2.0 * energy.kinetic / 1e-3 * damping);
    p.set_state(&[0.0], &[0.0]).unwrap();
    p.set_plasticity(Plasticity::Clay { rate }).unwrap();
    p.set_force(&[1.0; M * M * M]).unwrap();
    let force = {
        let mut b = [0.0];
        p.lattice().gather(
            &[1.0; M * M * M],
            &mut b,
            &mut dynamics::lattice::TensorWorkspace::new(),
        );
        b[0]
    };
    let expected = force / (c + k / rate);
    let dt = 0.02 / rate;
    for _ in 0..400 {
        p.step(Integrator::TrBdf2, dt).unwrap();
    }
    let speed = p.state().v[0];
    assert!((speed / expected - 1.0).abs() < 0.01, "{speed} {expected}");
    // Elastic, it stands.
    p.set_plasticity(Plasticity::Elastic).unwrap();
    for _ in 0..100 {
        p.step(Integrator::TrBdf2, 20.0).unwrap();
    }
    assert!(p.state().v[0].abs() < 1e-6 * expected);
}

#[test]
fn under_a_kernel_only_what_it_covers_yields() {
    for law in LAWS {
        let mut p = patch(law, 1.0, 1.0);
        let weights: Vec<f64> = (0..M * M * M)
            .map(|i| if i / (M * M) < 6 { 0.0 } else { 1.0 })
            .collect();
        p.set_plasticity(Plasticity::Kernel { rate: 1.0, weights })
            .unwrap();
        p.set_state(&[1.0], &[0.0]).unwrap();
        let before = p.springs().rest().clone();
        p.step(Integrator::Paper, 0.1).unwrap();
        let (mut kept, mut moved) = (0, 0);
        for (a, b) in before.differences[0]
            .iter()
            .zip(&p.springs().rest().differences[0])
            .enumerate()
            .map(|(i, d)| {
                assert!(i / (M * M) >= 5 || d.0.to_bits() == d.1.to_bits(), "{i}");
                d
            })
        {
            kept += usize::from(a == b);
            moved += usize::from(a != b);
        }
        assert!(kept >= 5 * M * M && moved > 2 * M * M, "{kept} {moved}");
    }
}

#[test]
fn a_step_that_is_taken_back_leaves_the_rest_where_it_was() {
    let options = |longest| AdaptiveOptions {
        tolerance: 1e-4,
        shortest: 1e-4,
        longest,
        energy_gain: 0.01,
        acceleration: None,
    };
    let run = |dt: f64| {
        let mut p = patch(LAWS[0], 0.1, 1.0);
        p.set_plasticity(Plasticity::Clay { rate: 1.0 }).unwrap();
        p.set_state(&[1.0], &[0.0]).unwrap();
        let report = p.adaptive_step(dt, &options(10.0)).unwrap();
        (report, p.springs().rest().clone(), p.state().clone())
    };
    let (long, rest, state) = run(10.0);
    assert!(long.rejected > 0, "{long:?}");
    let (short, same_rest, same_state) = run(long.step.dt);
    assert_eq!(short.rejected, 0);
    assert_eq!((rest, state), (same_rest, same_state));
}

#[test]
fn rates_and_weights_that_are_none_are_refused() {
    let mut p = patch(LAWS[0], 0.0, 1.0);
    for rate in [-1.0, f64::NAN, f64::INFINITY] {
        let refused = p.set_plasticity(Plasticity::Clay { rate });
        assert!(matches!(refused, Err(PatchError::Rate { .. })));
    }
    let mut weights = vec![0.5; M * M * M];
    weights[9] = 1.5;
    let refused = p.set_plasticity(Plasticity::Kernel { rate: 1.0, weights });
    assert!(matches!(refused, Err(PatchError::Weight { index: 9, .. })));
    let refused = p.set_plasticity(Plasticity::Kernel {
        rate: 1.0,
        weights: vec![1.0; 3],
    });
    assert!(matches!(refused, Err(PatchError::Length { found: 3, .. })));
    assert_eq!(*p.plasticity(), Plasticity::Elastic);
}
