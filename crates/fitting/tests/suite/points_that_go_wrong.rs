//! Clouds that cannot be fitted, that need a repair, and fits that are stopped.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};

use crate::common::{cloud, fit, oriented, to_depth};
use bspline::{Field, HierarchicalSpline};
use fitting::phantoms::{CloudOptions, SampledCloud, Solid, SplitMix64};
use fitting::points::{LEAST_COEFFICIENTS, PointOptions, fit_points};
use fitting::{Cancel, Control, FitError, FitReport, StopReason};
use glam::DVec3;

/// A ball of 4000 points in which something is wrong.
fn spoiled(spoil: impl FnOnce(&mut SampledCloud)) -> SampledCloud {
    let mut samples = cloud(
        Solid::Sphere,
        &CloudOptions {
            count: 4000,
            ..CloudOptions::default()
        },
    );
    spoil(&mut samples);
    samples
}

fn refusal(samples: &SampledCloud) -> FitError {
    fit::<f32>(samples, &to_depth(6)).expect_err("a cloud that cannot be fitted")
}

#[test]
fn all_normals_zero_is_refused_with_the_remedy() {
    let error = refusal(&spoiled(|c| c.normals.fill(DVec3::ZERO)));
    assert!(error.to_string().contains("outward normals"), "{error}");
}

#[test]
fn too_few_points_are_refused() {
    for count in [0, 1, 9] {
        let error = refusal(&spoiled(|c| {
            c.positions.truncate(count);
            c.normals.truncate(count);
        }));
        assert_eq!(
            error,
            FitError::NotEnoughSamples {
                found: count,
                needed: 10
            }
        );
    }
}

#[test]
fn all_points_equal_is_refused() {
    let error = refusal(&spoiled(|c| c.positions.fill(DVec3::new(1.0, 2.0, 3.0))));
    assert!(matches!(error, FitError::Degenerate(_)), "{error}");
}

#[test]
fn collinear_points_are_refused() {
    let error = refusal(&spoiled(|c| {
        for (i, p) in c.positions.iter_mut().enumerate() {
            *p = DVec3::new(1.0, 2.0, -1.0) * i as f64;
        }
    }));
    assert!(error.to_string().contains("line"), "{error}");
}

#[test]
fn one_outlier_at_ten_million_is_left_out_and_told() {
    let samples = spoiled(|c| c.positions[17] = DVec3::splat(1e7));
    let (field, report) = fit::<f32>(&samples, &to_depth(6)).expect("the rest is a ball");
    assert_eq!(report.used_count, report.input_count - 1);
    assert!(
        report.notes.iter().any(|n| n.contains("left out")),
        "{:?}",
        report.notes
    );
    assert!(report.rms < 1e-3 && field.lattice().world_box().size().x < 3.0);
}

#[test]
fn points_that_are_not_numbers_are_left_out_and_told() {
    let samples = spoiled(|c| {
        c.positions[3].x = f64::NAN;
        c.positions[4].y = f64::INFINITY;
        c.normals[5].z = f64::NAN;
        c.positions[6] = DVec3::splat(1e300);
    });
    let (_, report) = fit::<f32>(&samples, &to_depth(6)).expect("the rest is a ball");
    assert_eq!(report.used_count, report.input_count - 4);
    assert!(report.rms < 1e-3);
}

#[test]
fn every_point_twice_gives_the_same_surface() {
    let samples = spoiled(|c| {
        c.positions.extend_from_within(..);
        c.normals.extend_from_within(..);
    });
    let (_, report) = fit::<f32>(&samples, &to_depth(7)).expect("a ball, twice");
    assert!(report.rms < 1e-3, "{}", report.rms);
}

#[test]
fn flat_points_are_a_surface_too() {
    let samples = spoiled(|c| {
        for (p, n) in c.positions.iter_mut().zip(&mut c.normals) {
            p.z = 0.0;
            *n = DVec3::Z;
        }
    });
    let (field, report) = fit::<f32>(&samples, &to_depth(6)).expect("a disk");
    assert!(report.rms < 1e-3, "{}", report.rms);
    assert!(field.value(DVec3::new(0.0, 0.0, 0.1)) < 0.0);
    assert!(field.value(DVec3::new(0.0, 0.0, -0.1)) > 0.0);
}

#[test]
fn normals_that_contradict_each_other_give_finite_numbers() {
    let samples = spoiled(|c| {
        for n in c.normals.iter_mut().step_by(2) {
            *n = -*n;
        }
    });
    let (field, report) = fit::<f32>(&samples, &to_depth(7)).expect("a field, if not a ball");
    assert!(report.rms.is_finite() && field.value(DVec3::ZERO).is_finite());
}

#[test]
fn a_cancelled_fit_stops() {
    let samples = spoiled(|_| ());
    let mut control = Control::default();
    let cancel = control.cancel.clone();
    // Cancelled from within, at the third report.
    let mut reports = 0;
    control.on_progress = Box::new(move |_| {
        reports += 1;
        if reports == 3 {
            cancel.cancel();
        }
    });
    let result = fit_points::<f32>(&oriented(&samples), &PointOptions::default(), &mut control);
    assert_eq!(result.err(), Some(FitError::Cancelled));
}

#[test]
fn progress_never_falls() {
    let samples = cloud(
        Solid::Torus,
        &CloudOptions {
            noise: 0.01,
            ..CloudOptions::default()
        },
    );
    let mut control = Control::default();
    let mut last = 0.0;
    control.on_progress = Box::new(move |p| {
        assert!(
            p.fraction >= last && p.fraction <= 1.0,
            "{} after {last}",
            p.fraction
        );
        last = p.fraction;
    });
    fit_points::<f32>(&oriented(&samples), &PointOptions::default(), &mut control).expect("a noisy cloud");
}

#[test]
fn a_memory_ceiling_stops_the_refinement_or_refuses() {
    let samples = cloud(Solid::Torus, &CloudOptions::default());
    let under = |limit: u64| {
        let mut control = Control {
            memory_limit: Some(limit),
            ..Control::default()
        };
        let options = PointOptions {
            tolerance: Some(1e-7),
            ..to_depth(9)
        };
        fit_points::<f32>(&oriented(&samples), &options, &mut control)
    };
    let (_, report) = under(40 << 20).expect("the coarse levels fit in");
    assert!(report.leaves.iter().any(|l| l.reason == StopReason::Memory));
    assert!(report.depth < 9);
    assert!(matches!(under(1 << 20), Err(FitError::MemoryLimit { .. })));
}

/// Budgets just above the least, between levels and on them: never exceeded, and mostly used.
#[test]
fn a_budget_of_coefficients_is_kept_and_spent() {
    let all = [
        (Solid::Torus, 0.0, &[LEAST_COEFFICIENTS, 43_000, 60_000][..]),
        (Solid::Gyroid, 0.02, &[47_123]),
    ];
    for (solid, noise, budgets) in all {
        let options = CloudOptions {
            noise,
            count: 6000,
            ..CloudOptions::default()
        };
        let samples = cloud(solid, &options);
        for &budget in budgets {
            let options = PointOptions {
                coefficients: Some(budget),
                tolerance: Some(1e-7),
                ..PointOptions::default()
            };
            let (field, report) = fit::<f32>(&samples, &options).expect("a budget above the least");
            assert_eq!(field.coefficient_count(), report.coefficients);
            assert!(
                report.coefficients <= budget,
                "{} of {budget}",
                report.coefficients
            );
            if report.leaves.iter().any(|l| l.reason == StopReason::Budget) {
                assert!(
                    report.coefficients + 64 > budget,
                    "only {} of {budget}",
                    report.coefficients
                );
            }
        }
    }
}

#[test]
fn limits_below_the_first_grid_are_refused_by_name() {
    let samples = spoiled(|_| ());
    for (name, options) in [
        (
            "coefficients",
            PointOptions {
                coefficients: Some(LEAST_COEFFICIENTS - 1),
                ..PointOptions::default()
            },
        ),
        ("max_depth", to_depth(5)),
        ("max_depth", to_depth(17)),
    ] {
        let error = fit::<f32>(&samples, &options).expect_err("out of range");
        assert!(
            matches!(error, FitError::Option { option, .. } if option == name),
            "{error:?}"
        );
        let least = if name == "coefficients" {
            "42875"
        } else {
            "from 6 to 16"
        };
        assert!(error.to_string().contains(least), "{error}");
    }
    assert_eq!(LEAST_COEFFICIENTS, 42_875);
}

/// The flag is looked at in every stage, also in the fits inside of others, which show no progress of their own.
#[test]
fn a_cancel_is_heard_in_every_stage() {
    let samples = cloud(
        Solid::Cup,
        &CloudOptions {
            count: 6000,
            noise: 0.02,
            ..CloudOptions::default()
        },
    );
    for robust in [false, true] {
        let options = PointOptions {
            robust,
            ..PointOptions::default()
        };
        let stages = Arc::new(Mutex::new(BTreeSet::new()));
        let seen = Arc::clone(&stages);
        let mut control = Control {
            on_progress: Box::new(move |p| {
                seen.lock().unwrap().insert(p.stage);
            }),
            ..Control::default()
        };
        fit_points::<f32>(&oriented(&samples), &options, &mut control).expect("nobody cancels");
        let stages: Vec<&str> = stages.lock().unwrap().iter().copied().collect();
        assert!(stages.contains(&"choosing the smoothing"), "{stages:?}");
        for stage in stages {
            let cancel = Cancel::new();
            let (flag, after) = (cancel.clone(), Arc::new(Mutex::new(0)));
            let steps = Arc::clone(&after);
            let mut control = Control {
                on_progress: Box::new(move |p| {
                    if p.stage == stage {
                        flag.cancel();
                    }
                    if flag.is_cancelled() {
                        *steps.lock().unwrap() += 1;
                    }
                }),
                cancel,
                memory_limit: None,
            };
            let outcome = fit_points::<f32>(&oriented(&samples), &options, &mut control);
            if stage != "measuring" {
                assert_eq!(outcome.err(), Some(FitError::Cancelled), "{stage}");
            }
            assert_eq!(*after.lock().unwrap(), 1, "{stage}: the work went on");
        }
    }
}

/// A robust fit of points that no neighbour speaks for ends with all of them, and says so.
#[test]
fn a_robust_fit_survives_points_that_all_contradict_each_other() {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let corner = |i: usize| {
        let (a, b) = ([1.0, -1.0][i & 1], golden * [1.0, -1.0][i >> 1 & 1]);
        [
            DVec3::new(0.0, a, b),
            DVec3::new(a, b, 0.0),
            DVec3::new(b, 0.0, a),
        ][i / 4]
    };
    let icosahedron: Vec<DVec3> = (0..12).map(corner).collect();
    let mut random = SplitMix64::new(3);
    let dust: Vec<DVec3> = (0..3000).map(|_| random.uniform3()).collect();
    let mut anyhow = |n: usize| (0..n).map(|_| random.normal3()).collect::<Vec<_>>();
    let clouds = [
        (icosahedron.clone(), icosahedron.clone()),
        (icosahedron, anyhow(12)),
        (dust, anyhow(3000)),
    ];
    for (positions, normals) in clouds {
        let (field, report) = fitted_robustly(positions, normals).expect("weights that stay");
        assert!(field.value(DVec3::splat(0.4)).is_finite() && report.rms.is_finite());
        assert!(report.used_count >= 10, "{}", report.used_count);
    }
}

/// Small clouds without sense: each ends with a field or an error, robust or not.
#[test]
fn small_clouds_without_sense_end_with_a_field_or_an_error() {
    let mut random = SplitMix64::new(8);
    let mut anyhow = |n: usize| (0..n).map(|_| random.normal3()).collect::<Vec<DVec3>>();
    let sphere: Vec<DVec3> = anyhow(60).iter().map(|p| p.normalize()).collect();
    let on_axes = |ps: Vec<DVec3>, axes: DVec3| ps.iter().map(|p| *p * axes).collect::<Vec<_>>();
    let pairs = |ps: &[DVec3]| [ps, ps].concat();
    let facing_away = [sphere.clone(), sphere.iter().map(|n| -*n).collect()].concat();
    let with_dust = [sphere.clone(), anyhow(60)].concat();
    let clouds = [
        ("ten", anyhow(10), anyhow(10)),
        ("line", on_axes(anyhow(40), DVec3::X), anyhow(40)),
        (
            "nearly a line",
            on_axes(anyhow(40), DVec3::new(1.0, 1e-6, 1e-6)),
            anyhow(40),
        ),
        (
            "plane",
            on_axes(anyhow(60), DVec3::new(1.0, 1.0, 0.0)),
            anyhow(60),
        ),
        ("two spots", (0..40).map(|i| sphere[i % 2]).collect(), anyhow(40)),
        (
            "tiny",
            on_axes(sphere.clone(), DVec3::splat(1e-30)),
            sphere.clone(),
        ),
        (
            "far",
            sphere.iter().map(|p| *p * 1e-3 + 1e6).collect(),
            sphere.clone(),
        ),
        ("pairs", pairs(&sphere), facing_away),
        ("half dust", with_dust.clone(), with_dust),
    ];
    for (name, positions, normals) in clouds {
        if let Ok((field, report)) = fitted_robustly(positions, normals) {
            let inside = field.value(field.lattice().world_box().center());
            assert!(inside.is_finite() && report.rms.is_finite(), "{name}");
        }
    }
}

fn fitted_robustly(
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
) -> Result<(HierarchicalSpline<f32>, FitReport), FitError> {
    let samples = SampledCloud {
        positions,
        normals,
        holes: Vec::new(),
    };
    let options = PointOptions {
        robust: true,
        ..to_depth(6)
    };
    fit::<f32>(&samples, &options)
}
