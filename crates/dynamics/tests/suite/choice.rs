//! The scheme that a step chooses for itself, and when adaptive steps are rejected.

use dynamics::integrators::{AdaptiveOptions, Integrator};
use dynamics::lattice::{Lattice, Rim};
use dynamics::matter::{Matter, Quantity};
use dynamics::patch::Patch;
use dynamics::solve::SolverOptions;
use dynamics::springs::{Law, Neighbours, Weights};

const M: usize = 12;

fn painted() -> Matter {
    let mut matter = Matter::default();
    for (i, k) in matter.stiffness.paint(M * M * M).iter_mut().enumerate() {
        *k = if i % (M * M) < M * M / 3 { 10.0 } else { 1.0 };
    }
    matter
}

fn patch(coefficients: usize, rim: Rim, direct_limit: usize, matter: Matter) -> Patch<f64> {
    let lattice = Lattice::cube(coefficients, M, rim, 1.0).unwrap();
    let d: Vec<f64> = (0..M * M * M).map(|i| (i / (M * M)) as f64 - 5.2).collect();
    let options = SolverOptions {
        direct_limit,
        tolerance: Some(1e-9),
        iterations: 40,
        ..SolverOptions::default()
    };
    Patch::new(
        lattice,
        matter,
        Law::Linear { scale: 1.0 },
        Neighbours::Six,
        &d,
        options,
    )
    .unwrap()
}

#[test]
fn short_steps_are_explicit_and_long_ones_implicit_where_matter_is_painted() {
    // V-cycle and multigrid.
    for (n, rim, limit, least) in [(8, Rim::Free, 100, 4), (M, Rim::Free, 100, 4)] {
        let mut p = patch(n, rim, limit, painted());
        let bound = p.explicit_limit().unwrap();
        let choices: Vec<_> = (0..10)
            .map(|k| p.choose(0.9 * bound * f64::from(1 << k)).unwrap())
            .collect();
        let explicit = choices
            .iter()
            .filter(|c| c.integrator == Integrator::Verlet)
            .count();
        println!("{n}: explicit up to {} sub-steps", choices[explicit - 1].substeps);
        assert!(
            choices[..explicit]
                .iter()
                .all(|c| c.integrator == Integrator::Verlet)
        );
        assert!(
            choices[explicit - 1].substeps >= least,
            "{:?}",
            choices[explicit - 1]
        );
        assert!((1..10).contains(&explicit), "both sides");
        for (k, choice) in choices.iter().enumerate() {
            let cheaper = choice.explicit_work < choice.implicit_work;
            assert_eq!(cheaper, choice.integrator == Integrator::Verlet);
            if cheaper {
                assert_eq!(
                    choice.substeps,
                    ((0.9 * f64::from(1 << k) / 0.95).ceil() as usize).max(2)
                );
            }
            let dt = 0.9 * bound * f64::from(1 << k);
            let report = p.step(Integrator::Auto, dt).unwrap();
            assert_eq!(
                (report.integrator, report.substeps),
                (choice.integrator, choice.substeps)
            );
        }
    }
    // Uniform matter, and few coefficients, are solved as cheaply with springs as without.
    for (matter, n, rim) in [(Matter::default(), 8, Rim::Free), (painted(), 11, Rim::Fixed)] {
        let mut p = patch(n, rim, 1000, matter);
        let bound = p.explicit_limit().unwrap();
        assert_eq!(p.choose(0.5 * bound).unwrap().integrator, Integrator::TrBdf2);
    }
}

#[test]
fn the_explicit_choice_is_not_less_accurate() {
    for damping in [0.0, 0.2] {
        let matter = Matter {
            damping: Quantity::Constant(damping),
            ..painted()
        };
        let start = |direct_limit| {
            let mut p = patch(8, Rim::Free, direct_limit, matter.clone());
            let n = p.lattice().coefficient_count();
            let v: Vec<f64> = (0..n).map(|i| (0.02 * i as f64).sin()).collect();
            p.set_state(&vec![0.0; n], &v).unwrap();
            p
        };
        let bound = start(1000).explicit_limit().unwrap();
        for parts in [1.0, 3.0] {
            let dt = 0.9 * bound * parts;
            let run = |integrator: Integrator, fine: usize, limit: usize| {
                let mut p = start(limit);
                for _ in 0..20 * fine {
                    let report = p.step(integrator, dt / fine as f64).unwrap();
                    if integrator == Integrator::Auto {
                        assert_eq!(
                            report.integrator,
                            Integrator::Verlet,
                            "the case is about explicit steps"
                        );
                    }
                }
                p.state().d.clone()
            };
            let exact = run(Integrator::TrBdf2, 40, 1000);
            let error = |d: &[f64]| {
                d.iter()
                    .zip(&exact)
                    .map(|(a, b)| (a - b).powi(2))
                    .sum::<f64>()
                    .sqrt()
            };
            let [explicit, implicit] = [
                error(&run(Integrator::Auto, 1, 100)),
                error(&run(Integrator::TrBdf2, 1, 1000)),
            ];
            println!(
                "γ {damping}, {parts} × 0.9 of the bound: explicit {explicit:.2e}, implicit {implicit:.2e}"
            );
            assert!(explicit < 0.6 * implicit, "{explicit} {implicit}");
        }
    }
}

/// 4-D springs compressed to half their length, nearly flat: unstable, with tangents that the matrix takes as 0.
fn compressed() -> Patch<f64> {
    let lattice = Lattice::cube(11, M, Rim::Fixed, 1.0).unwrap();
    let d: Vec<f64> = (0..M * M * M).map(|i| 0.1 * (1.9 * i as f64).sin()).collect();
    let law = Law::FourD { scale: 1.0 };
    let options = SolverOptions::default();
    let mut p = Patch::new(lattice, Matter::default(), law, Neighbours::Eighteen, &d, options).unwrap();
    p.springs_mut().rest_mut().scale = Weights::Constant(2.0);
    p
}

const LOOSE: AdaptiveOptions = AdaptiveOptions {
    tolerance: 1e9,
    shortest: 1e-6,
    longest: 1e6,
    energy_gain: 0.01,
    acceleration: None,
};

#[test]
fn four_d_steps_that_create_a_hundredth_of_the_energy_are_rejected() {
    // Without the rule such steps are made: the scene is one that needs it.
    let mut p = compressed();
    let mut most = 0.0_f64;
    for _ in 0..60 {
        let before = p.energy().total();
        p.step(Integrator::TrBdf2, 4.0).unwrap();
        most = most.max(p.energy().total() / before - 1.0);
    }
    assert!(most > 0.02, "{most}");
    let mut p = compressed();
    let (mut dt, mut rejected) = (4.0, 0);
    for step in 0..60 {
        let before = p.energy().total();
        let report = p.adaptive_step(dt, &LOOSE).unwrap();
        dt = report.next_dt.min(4.0);
        rejected += report.rejected;
        let gained = p.energy().total() - before;
        assert!(
            gained <= 0.01 * before.max(before + gained),
            "step {step}: {gained} of {before}"
        );
        assert!(report.gained <= 0.01 && report.step.dt > 1e-4, "{report:?}");
    }
    println!("steps of 4 gain up to {:.0} %; {rejected} rejected", 100.0 * most);
    assert!(rejected > 0);
}

#[test]
fn accelerations_beyond_the_bound_halve_the_next_step() {
    let options = AdaptiveOptions {
        acceleration: Some(3.0),
        energy_gain: f64::INFINITY,
        shortest: 1e-3,
        ..LOOSE
    };
    let mut p = patch(11, Rim::Fixed, 1000, Matter::default());
    let mut force = vec![0.0; M * M * M];
    force[(6 * M + 6) * M + 5] = 30.0;
    p.set_force(&force).unwrap();
    let (mut dt, mut fast) = (1.0, 0);
    for _ in 0..8 {
        let before = p.state().w.clone();
        let report = p.adaptive_step(dt, &options).unwrap();
        let pairs = p.state().w.iter().zip(&before);
        let largest = pairs
            .map(|(a, b)| (a - b).abs() / report.step.dt)
            .fold(0.0, f64::max);
        let factor = report.next_dt / report.step.dt;
        assert_eq!(factor, if largest > 3.0 { 0.5 } else { 2.0 }, "{largest}");
        fast += usize::from(largest > 3.0);
        dt = report.next_dt;
    }
    assert!((1..8).contains(&fast), "both happen: {fast}");
}
