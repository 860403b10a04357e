//! The error of the increment, which the residual of a step hides: what the default reaches, and what fails.

use dynamics::lattice::Rim;
use dynamics::solve::VCycleOptions;
use dynamics::springs::Neighbours;
use dynamics::study::{Configuration, Outcome, Pattern, Reference, Solver};

const BASE: Configuration = Configuration {
    coefficients: 10,
    samples: 15,
    rim: Rim::Free,
    pattern: Pattern::Uniform,
    contrast: 1.0,
    mass_contrast: 1.0,
    dt_over_limit: 30.0,
    neighbours: Neighbours::Six,
    four_d: false,
};

fn default_f32(c: Configuration) -> Outcome {
    let reference = Reference::new(c).unwrap();
    assert!(
        reference.residual < 1e-12,
        "{c:?}: reference {:.0e}",
        reference.residual
    );
    let outcome = reference.judge::<f32>(Solver::Default, 8).unwrap();
    assert!(outcome.iterations <= 8);
    outcome
}

#[test]
fn uniform_material_is_exact_in_two_iterations() {
    for (coefficients, samples, rim) in [
        (5, 10, Rim::Free),
        (10, 10, Rim::Free),
        (10, 15, Rim::Free),
        (15, 15, Rim::Free),
        (15, 20, Rim::Free),
        (15, 20, Rim::Fixed),
    ] {
        for dt_over_limit in [0.1, 30.0] {
            let c = Configuration {
                coefficients,
                samples,
                rim,
                dt_over_limit,
                ..BASE
            };
            let reference = Reference::new(c).unwrap();
            let single = reference.judge::<f32>(Solver::Default, 2).unwrap();
            assert!(single.increment_error < 1e-5, "{c:?}: {single:?}");
            let double = reference.judge::<f64>(Solver::Default, 2).unwrap();
            assert!(double.increment_error < 1e-10, "{c:?}: {double:?}");
        }
    }
}

#[test]
fn small_regions_are_solved_at_any_contrast() {
    // Up to 10³ free coefficients by a factor; the bar is 0.1 %.
    for (coefficients, samples, rim) in [
        (5, 10, Rim::Free),
        (10, 10, Rim::Free),
        (10, 15, Rim::Free),
        (15, 15, Rim::Free),
        (15, 20, Rim::Fixed),
    ] {
        for pattern in [Pattern::Plate, Pattern::Bone, Pattern::Random] {
            for (contrast, mass_contrast) in [(1e4, 1.0), (1e6, 1.0), (1e4, 1e4)] {
                let c = Configuration {
                    coefficients,
                    samples,
                    rim,
                    pattern,
                    contrast,
                    mass_contrast,
                    ..BASE
                };
                let outcome = default_f32(c);
                assert!(outcome.increment_error < 1e-4, "{c:?}: {outcome:?}");
            }
        }
    }
}

#[test]
fn large_regions_are_solved_in_eight_iterations() {
    // The bars: 0.3 % at a contrast of 100, 1 % at 10³, 3 % at 10⁴; at 15/20 of the steps while a factor is made.
    for (coefficients, samples) in [(17, 17), (15, 20)] {
        for pattern in [Pattern::StiffBall, Pattern::Plate, Pattern::Bone, Pattern::Random] {
            for (contrast, bar) in [(1e2, 3e-3), (1e3, 1e-2), (1e4, 3e-2)] {
                let c = Configuration {
                    coefficients,
                    samples,
                    pattern,
                    contrast,
                    ..BASE
                };
                let reference = Reference::new(c).unwrap();
                let bridge = reference.judge::<f32>(Solver::Bridge, 8).unwrap();
                assert!(bridge.increment_error < bar, "{c:?}: {bridge:?}");
            }
        }
    }
}

#[test]
fn blocks_reach_what_rings_beside_a_thin_wall() {
    // The wall is two samples thick. 24/32 stands for 32/32, whose reference takes ten times as long.
    let c = Configuration {
        coefficients: 24,
        samples: 32,
        rim: Rim::Fixed,
        pattern: Pattern::Bone,
        contrast: 1e4,
        ..BASE
    };
    let reference = Reference::new(c).unwrap();
    let options = VCycleOptions::default();
    let outcome = reference.judge_cycle::<f32>(options, 8).unwrap();
    assert!(outcome.increment_error < 1e-3, "{outcome:?}");
    // One damped step over them does not reach it.
    let once = VCycleOptions {
        block_degree: 1,
        ..options
    };
    let once = reference.judge_cycle::<f32>(once, 8).unwrap();
    assert!(once.increment_error > 2.0 * outcome.increment_error, "{once:?}");
}

#[test]
fn a_factor_made_beside_the_steps_solves_at_any_contrast() {
    // 3375 coefficients; the bar is 0.1 %, of masses and slack springs too, which leave a V-cycle at several per cent.
    for (pattern, contrast, mass_contrast) in [
        (Pattern::Bone, 1e4, 1.0),
        (Pattern::HalfSpace, 1e4, 1e4),
        (Pattern::SoftBall, 1e2, 1.0),
    ] {
        let c = Configuration {
            coefficients: 15,
            samples: 20,
            pattern,
            contrast,
            mass_contrast,
            ..BASE
        };
        for slack in [false, true] {
            let reference = if slack {
                Reference::with_slack_springs(c).unwrap()
            } else {
                Reference::new(c).unwrap()
            };
            let outcome = reference.judge::<f32>(Solver::Default, 8).unwrap();
            assert_eq!((outcome.method, outcome.iterations), ("direct", 1));
            assert!(outcome.increment_error < 1e-3, "{c:?} {slack}: {outcome:?}");
        }
    }
}

#[test]
fn the_limits_of_masses_and_slack_springs_are_known() {
    // Far beyond what is asked of stiffness alone; no factor, so that the cycle has to do it.
    let c = Configuration {
        coefficients: 15,
        samples: 20,
        pattern: Pattern::Plate,
        contrast: 1e4,
        ..BASE
    };
    let heavy = Reference::new(Configuration {
        mass_contrast: 1e4,
        ..c
    });
    for reference in [heavy, Reference::with_slack_springs(c)] {
        let outcome = reference.unwrap().judge::<f32>(Solver::Bridge, 8).unwrap();
        assert!(outcome.increment_error < 0.3, "{outcome:?}");
    }
}

#[test]
fn four_d_tangents_with_eighteen_springs_are_solved() {
    for (coefficients, samples) in [(10, 15), (15, 20)] {
        for pattern in [Pattern::Uniform, Pattern::StiffBall, Pattern::Random] {
            let c = Configuration {
                coefficients,
                samples,
                pattern,
                contrast: 100.0,
                neighbours: Neighbours::Eighteen,
                four_d: true,
                ..BASE
            };
            let outcome = default_f32(c);
            assert!(outcome.increment_error < 1e-2, "{c:?}: {outcome:?}");
        }
    }
}

#[test]
fn plain_conjugate_gradients_lock_a_stiff_solid() {
    let c = Configuration {
        pattern: Pattern::StiffBall,
        contrast: 1e4,
        ..BASE
    };
    let reference = Reference::new(c).unwrap();
    let plain = reference.judge::<f64>(Solver::Plain, 8).unwrap();
    assert!(plain.increment_error > 0.5, "{plain:?}");
    // Uniform material: two iterations are some tens of per cent wrong.
    let reference = Reference::new(BASE).unwrap();
    let plain = reference.judge::<f64>(Solver::Plain, 2).unwrap();
    assert!(plain.increment_error > 0.2, "{plain:?}");
}

#[test]
fn scaled_diagonalization_fails_where_the_cycle_does_not() {
    for (pattern, contrast, bar) in [(Pattern::StiffBall, 1e2, 0.05), (Pattern::Bone, 1e4, 0.4)] {
        let c = Configuration {
            coefficients: 15,
            samples: 20,
            pattern,
            contrast,
            ..BASE
        };
        let reference = Reference::new(c).unwrap();
        let scaled = reference.judge::<f64>(Solver::ScaledDiagonalization, 8).unwrap();
        let cycle = reference.judge::<f64>(Solver::Default, 8).unwrap();
        assert!(scaled.increment_error > bar, "{scaled:?}");
        assert!(
            cycle.increment_error < 0.05 * scaled.increment_error,
            "{cycle:?} {scaled:?}"
        );
    }
}
