//! Volume fits from outside: what a caller is promised.

use bspline::{Field, HierarchicalSpline, Real};
use fitting::phantoms::{SplitMix64, head};
use fitting::volume::{Order, VolumeMethod, VolumeOptions, VolumeView, Voxels, fit_volume, otsu_threshold};
use fitting::{Control, FitError, FitReport, StopReason};
use glam::{DAffine3, DMat3, DVec3};

type Outcome<T> = Result<(HierarchicalSpline<T>, FitReport), FitError>;

const INTERPOLATE: VolumeOptions = VolumeOptions {
    method: VolumeMethod::Interpolate,
    tolerance: None,
    coefficients: None,
    max_depth: None,
    smoothing: None,
};

/// Oblique, anisotropic and mirrored, as scanners write them.
fn oblique() -> DAffine3 {
    let turn = DMat3::from_rotation_z(0.3) * DMat3::from_rotation_x(-0.2);
    DAffine3 {
        matrix3: turn * DMat3::from_diagonal(DVec3::new(-0.7, 0.9, 2.5)),
        translation: DVec3::new(90.0, -126.0, -72.0),
    }
}

fn fit<T: Real>(dims: [usize; 3], values: &[f32], options: VolumeOptions) -> Outcome<T> {
    let view = VolumeView {
        dims,
        values: values.into(),
        world_from_voxel: oblique(),
    };
    fit_volume(&view, &options, &mut Control::default())
}

/// Largest and rms difference between field and voxels, asked one by one.
fn differences<T: Real>(field: &HierarchicalSpline<T>, dims: [usize; 3], values: &[f32]) -> (f64, f64) {
    let mut largest = 0.0_f64;
    let mut sum = 0.0;
    for (i, &v) in values.iter().enumerate() {
        let voxel = [i % dims[0], i / dims[0] % dims[1], i / (dims[0] * dims[1])].map(|k| k as f64);
        let d = field.value(oblique().transform_point3(DVec3::from_array(voxel))) - f64::from(v);
        // The voxel's place in the world is rounded, by less than 1e-12 of the field's slope.
        let d = d.signum() * (d.abs() - 1e-12 * field.slope()).max(0.0);
        largest = largest.max(d.abs());
        sum += d * d;
    }
    (largest, (sum / values.len() as f64).sqrt())
}

/// The report's figures are those of the field one gets.
fn assert_honest<T: Real>(outcome: &Outcome<T>, dims: [usize; 3], values: &[f32]) {
    let (field, report) = outcome.as_ref().expect("the fit succeeds");
    let (largest, rms) = differences(field, dims, values);
    assert!(
        largest <= report.bound,
        "{largest} above the bound {}",
        report.bound
    );
    let slack = report.bound - report.max;
    assert!(
        (largest - report.max).abs() <= slack,
        "max {largest}, reported {}",
        report.max
    );
    assert!(
        (rms - report.rms).abs() <= slack,
        "rms {rms}, reported {}",
        report.rms
    );
    assert!(report.p95 <= report.max);
    assert_eq!(report.coefficients, field.coefficient_count());
    assert_eq!(report.depth + 1, field.level_count());
    assert_eq!(
        (report.input_count, report.used_count),
        (values.len(), values.len())
    );
    assert_eq!(
        report
            .leaves
            .iter()
            .map(|l| l.sample_count as usize)
            .sum::<usize>(),
        values.len()
    );
    let squares: f64 = report
        .leaves
        .iter()
        .map(|l| f64::from(l.sample_count) * f64::from(l.rms) * f64::from(l.rms))
        .sum();
    let from_leaves = (squares / values.len() as f64).sqrt();
    assert!(
        (from_leaves - report.rms).abs() <= 1e-5 * report.rms + slack,
        "leaves {from_leaves}"
    );
    let leaf_max = report.leaves.iter().fold(0.0_f32, |m, l| m.max(l.max));
    assert!((f64::from(leaf_max) - report.max).abs() <= 1e-6 * report.max);
}

#[test]
fn interpolation_reproduces_cubics_in_the_whole_box() {
    // 18 does not fill its last coarse cell, 21 does: the padding must not show.
    let dims = [18, 21, 7];
    let cubic = |p: DVec3| {
        let q = p / 10.0;
        1.0 + q.x * q.y * q.y - 2.0 * q.z * q.z * q.z + q.x * q.x * q.x + 0.5 * q.y * q.z
    };
    // Thousandths become integers, so that the voxels hold the cubic exactly in f32.
    let values: Vec<f32> = (0..dims.iter().product::<usize>())
        .map(|i| {
            let p = [i % dims[0], i / dims[0] % dims[1], i / (dims[0] * dims[1])].map(|k| k as f64);
            (1000.0 * cubic(DVec3::from_array(p))).round() as f32
        })
        .collect();
    let exact = |p: DVec3| 1000.0 * cubic(p);
    let (field, report) = fit::<f64>(dims, &values, INTERPOLATE).unwrap();
    let scale = values.iter().fold(0.0_f32, |m, v| m.max(v.abs())) as f64;
    let mut random = SplitMix64::new(3);
    for _ in 0..20_000 {
        let q = DVec3::new(
            random.uniform() * (dims[0] - 1) as f64,
            random.uniform() * (dims[1] - 1) as f64,
            random.uniform() * (dims[2] - 1) as f64,
        );
        let got = field.value(oblique().transform_point3(q));
        assert!(
            (got - exact(q)).abs() < 1e-10 * scale,
            "at {q}: {got}, {}",
            exact(q)
        );
    }
    assert!(report.max < 1e-10 * scale);
}

#[test]
fn interpolation_meets_every_voxel() {
    for dims in [[33, 20, 17], [30, 1, 25], [3, 2, 9], [1, 1, 1]] {
        let values = head(dims, 0.05, 11);
        let outcome = fit::<f32>(dims, &values, INTERPOLATE);
        assert_honest(&outcome, dims, &values);
        let report = outcome.unwrap().1;
        // Rounding of f32, amplified by up to 3 per axis, a few times over.
        assert!(report.max < 2e-5, "{dims:?}: {}", report.max);
        assert!(report.leaves.iter().all(|l| l.reason == StopReason::Tolerance));
        assert!(report.solves.is_empty(), "nothing is iterated");
        let outcome = fit::<f64>(dims, &values, INTERPOLATE);
        assert_honest(&outcome, dims, &values);
        assert!(outcome.unwrap().1.max < 1e-13);
    }
}

#[test]
fn budget_is_spent_and_reported_honestly() {
    let dims = [50, 61, 47];
    let values = head(dims, 0.0, 0);
    for coefficients in [6_000, 20_000] {
        let options = VolumeOptions {
            coefficients: Some(coefficients),
            ..Default::default()
        };
        let outcome = fit::<f32>(dims, &values, options);
        assert_honest(&outcome, dims, &values);
        let report = outcome.unwrap().1;
        assert_eq!(report.coefficients, coefficients);
        // Two exchanges lie between three joint solves of so many iterations; the functions are too many for them to end.
        assert_eq!(
            report.solves.iter().map(|s| s.iterations).collect::<Vec<_>>(),
            [15, 12, 20]
        );
        assert!(
            report
                .solves
                .iter()
                .all(|s| s.depth.is_none() && s.residual < 1.0 && !s.is_converged)
        );
        assert_honest(&fit::<f64>(dims, &values, options), dims, &values);
    }
}

#[test]
fn more_coefficients_never_fit_worse() {
    let dims = [40, 44, 36];
    let values = head(dims, 0.0, 0);
    let mut last = f64::INFINITY;
    for coefficients in [64, 200, 1_000, 4_000, 16_000, 60_000, 10_000_000] {
        let options = VolumeOptions {
            coefficients: Some(coefficients),
            ..Default::default()
        };
        let outcome = fit::<f32>(dims, &values, options);
        assert_honest(&outcome, dims, &values);
        let report = outcome.unwrap().1;
        assert!(report.coefficients <= coefficients);
        assert!(report.rms <= last, "{coefficients}: {} after {last}", report.rms);
        last = report.rms;
    }
    assert!(
        last < 1e-3,
        "with one function per voxel hardly anything is left: {last}"
    );
}

#[test]
fn tolerance_holds_in_every_leaf() {
    let dims = [49, 38, 41];
    for (values, tolerances) in [
        (head(dims, 0.0, 0), [0.1, 0.02, 0.004]),
        (head(dims, 0.05, 5), [0.1, 0.06, 0.02]),
    ] {
        let mut last = 0;
        for tolerance in tolerances {
            let options = VolumeOptions {
                tolerance: Some(tolerance),
                ..Default::default()
            };
            let outcome = fit::<f32>(dims, &values, options);
            assert_honest(&outcome, dims, &values);
            let report = outcome.unwrap().1;
            for leaf in &report.leaves {
                assert!(f64::from(leaf.rms) <= tolerance, "{tolerance}: {leaf:?}");
                assert_eq!(leaf.reason, StopReason::Tolerance);
            }
            assert!(report.coefficients > last, "a smaller tolerance costs more");
            last = report.coefficients;
        }
    }
}

#[test]
fn leaves_above_the_tolerance_say_why() {
    let dims = [49, 38, 41];
    let values = head(dims, 0.0, 0);
    let depth = VolumeOptions {
        tolerance: Some(0.01),
        max_depth: Some(1),
        ..Default::default()
    };
    let budget = VolumeOptions {
        tolerance: Some(0.01),
        coefficients: Some(5_000),
        ..Default::default()
    };
    for (options, expected) in [(depth, StopReason::Depth), (budget, StopReason::Budget)] {
        let outcome = fit::<f32>(dims, &values, options);
        assert_honest(&outcome, dims, &values);
        let report = outcome.unwrap().1;
        let missed = report.leaves.iter().filter(|l| f64::from(l.rms) > 0.01).count();
        assert!(missed > 0, "the test asks for too little");
        for leaf in &report.leaves {
            let reason = if f64::from(leaf.rms) > 0.01 {
                expected
            } else {
                StopReason::Tolerance
            };
            assert_eq!(leaf.reason, reason, "{leaf:?}");
        }
        assert!(
            report.notes.iter().any(|n| n.contains(&format!("{missed} of"))),
            "{:?}",
            report.notes
        );
        assert!(options.coefficients.is_none_or(|k| report.coefficients <= k));
        assert!(options.max_depth.is_none_or(|d| report.depth <= d));
    }
}

#[test]
fn noise_is_estimated_and_not_fitted() {
    let dims = [64, 60, 56];
    let noise = 0.05;
    let values = head(dims, noise, 42);
    let report = fit::<f32>(dims, &values, VolumeOptions::default()).unwrap().1;
    let found = report.noise.expect("the default looks at the noise");
    assert!((found / noise - 1.0).abs() < 0.1, "found {found}");
    assert!(report.rms > 0.8 * noise, "{} fits the noise", report.rms);
    // Hardly more than the clean head needs for residuals of the same size.
    let clean = VolumeOptions {
        tolerance: Some(0.8 * noise),
        ..Default::default()
    };
    let needed = fit::<f32>(dims, &head(dims, 0.0, 0), clean)
        .unwrap()
        .1
        .coefficients;
    assert!(
        report.coefficients < 2 * needed,
        "{} coefficients, clean {needed}",
        report.coefficients
    );
    assert!(report.leaves.iter().all(|l| f64::from(l.rms) <= report.tolerance));
    assert!(report.leaves.iter().any(|l| l.reason == StopReason::Noise));
}

#[test]
fn clean_data_gets_half_a_percent_of_its_range() {
    let dims = [64, 60, 56];
    let values = head(dims, 0.0, 0);
    let report = fit::<f32>(dims, &values, VolumeOptions::default()).unwrap().1;
    // What little is taken for noise (the rims) does not decide.
    assert!(1.25 * report.noise.unwrap() < 0.004, "{:?}", report.noise);
    let mut sorted = values;
    sorted.sort_by(f32::total_cmp);
    let percentile = |p: f64| f64::from(sorted[(p * (sorted.len() - 1) as f64).round() as usize]);
    let expected = 0.005 * (percentile(0.99) - percentile(0.01));
    assert!(
        (report.tolerance - expected).abs() < 1e-12,
        "{}, not {expected}",
        report.tolerance
    );
    assert!(report.leaves.iter().all(|l| f64::from(l.rms) <= expected));
}

#[test]
fn thread_count_does_not_change_a_bit() {
    // More than two slabs of planes and several chunks of every reduction.
    let dims = [70, 66, 110];
    let values = head(dims, 0.02, 9);
    let all = [
        INTERPOLATE,
        VolumeOptions {
            coefficients: Some(40_000),
            ..Default::default()
        },
        VolumeOptions {
            tolerance: Some(0.03),
            ..Default::default()
        },
        VolumeOptions::default(),
    ];
    for options in all {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let (field, report) = pool.install(|| fit::<f32>(dims, &values, options)).unwrap();
            (field.sha256(), report)
        };
        let one = run(1);
        assert_eq!(run(2), one, "2 threads, {options:?}");
        assert_eq!(run(8), one, "8 threads, {options:?}");
    }
}

/// To a tolerance, too, smoothing costs no coefficients: what it takes away is not asked for again.
#[test]
fn smoothing_of_a_fit_to_a_tolerance_takes_coefficients_away() {
    let dims = [40, 40, 40];
    for seed in 0..4 {
        let values = head(dims, 0.05, seed);
        let mut last = (usize::MAX, f64::INFINITY, 0.0);
        for smoothing in [None, Some(0.1), Some(0.5), Some(2.0)] {
            let options = VolumeOptions {
                tolerance: Some(0.03),
                smoothing,
                ..Default::default()
            };
            let (field, report) = fit::<f32>(dims, &values, options).unwrap();
            // Differences of second order between voxels, of the field as it is evaluated.
            let bend: f64 = (1..dims[0] - 1)
                .flat_map(|x| (0..dims[1]).map(move |y| (x, y)))
                .map(|(x, y)| {
                    let at = |x: usize| {
                        field.value(oblique().transform_point3(DVec3::new(x as f64, y as f64, 20.0)))
                    };
                    (at(x - 1) - 2.0 * at(x) + at(x + 1)).powi(2)
                })
                .sum();
            let now = (report.coefficients, bend, report.rms);
            assert!(
                now.0 < last.0 && now.1 < last.1 && now.2 > last.2,
                "seed {seed}, {smoothing:?}: {now:?} after {last:?}"
            );
            let over = report.leaves.iter().filter(|l| f64::from(l.rms) > 0.03);
            assert!(over.clone().all(|l| l.reason == StopReason::Smoothing));
            assert_eq!(
                over.count() > 0,
                report.notes.iter().any(|n| n.contains("above the tolerance"))
            );
            last = now;
        }
    }
}

#[test]
fn smoothing_shrinks_detail() {
    let dims = [40, 40, 40];
    let values = head(dims, 0.05, 1);
    let energy = |smoothing| {
        let options = VolumeOptions {
            coefficients: Some(12_000),
            smoothing,
            ..Default::default()
        };
        let (field, report) = fit::<f32>(dims, &values, options).unwrap();
        let detail = field.corrections(field.level_count() - 1);
        let sum: f64 = detail
            .values()
            .flat_map(|c| c.values())
            .map(|&c| f64::from(c) * f64::from(c))
            .sum();
        (sum, report.rms)
    };
    let (none, some) = (energy(None), energy(Some(1.0)));
    assert!(some.0 < 0.5 * none.0, "detail {} of {}", some.0, none.0);
    assert!(some.1 > none.1, "and the residual pays for it");
}

#[test]
fn constant_volume_is_exact_and_small() {
    for value in [0.0, -1024.0, 0.1, 1e30, 1e-30] {
        let dims = [40, 17, 23];
        let values = vec![value; dims.iter().product()];
        let outcome = fit::<f32>(dims, &values, VolumeOptions::default());
        assert_honest(&outcome, dims, &values);
        let (field, report) = outcome.unwrap();
        assert_eq!(report.depth, 0);
        assert!(report.coefficients <= 13 * 7 * 9, "{}", report.coefficients);
        assert!(report.max <= 1e-14 * f64::from(value.abs()), "{}", report.max);
        assert!(field.slope() > 0.0);
    }
}

#[test]
fn thin_and_tiny_volumes_fit() {
    for dims in [
        [1, 1, 1],
        [2, 1, 1],
        [1, 3, 2],
        [40, 30, 1],
        [1, 50, 50],
        [3, 3, 3],
        [4, 5, 6],
    ] {
        let values = head(dims, 0.1, 2);
        for options in [
            VolumeOptions {
                tolerance: Some(0.02),
                ..Default::default()
            },
            VolumeOptions {
                coefficients: Some(4_000),
                ..Default::default()
            },
            VolumeOptions::default(),
        ] {
            let outcome = fit::<f32>(dims, &values, options);
            assert_honest(&outcome, dims, &values);
            let report = outcome.unwrap().1;
            if let Some(t) = options.tolerance {
                assert!(
                    report.leaves.iter().all(|l| f64::from(l.rms) <= t),
                    "{dims:?} {:?}",
                    report.leaves
                );
            }
        }
    }
}

#[test]
fn huge_and_minute_densities_neither_overflow_nor_vanish() {
    let dims = [30, 31, 32];
    let clean = head(dims, 0.0, 0);
    for scale in [1e30_f32, 1e-30] {
        let values: Vec<f32> = clean.iter().map(|v| v * scale).collect();
        let options = VolumeOptions {
            coefficients: Some(8_000),
            ..Default::default()
        };
        let outcome = fit::<f32>(dims, &values, options);
        assert_honest(&outcome, dims, &values);
        let reference = fit::<f32>(dims, &clean, options).unwrap().1.rms;
        let relative = outcome.unwrap().1.rms / f64::from(scale);
        assert!(
            (relative / reference - 1.0).abs() < 1e-2,
            "{relative} {reference}"
        );
        assert_honest(&fit::<f32>(dims, &values, INTERPOLATE), dims, &values);
    }
}

#[test]
fn progress_rises_to_one() {
    let dims = [40, 40, 40];
    let values = head(dims, 0.02, 0);
    let view = VolumeView {
        dims,
        values: (&values).into(),
        world_from_voxel: oblique(),
    };
    for options in [
        VolumeOptions::default(),
        VolumeOptions {
            coefficients: Some(9_000),
            ..Default::default()
        },
        VolumeOptions {
            coefficients: Some(3_000),
            tolerance: Some(1e-3),
            ..Default::default()
        },
        INTERPOLATE,
    ] {
        let (sender, receiver) = std::sync::mpsc::channel();
        let mut control = Control {
            on_progress: Box::new(move |p| sender.send(p.fraction).expect("received below")),
            ..Default::default()
        };
        fit_volume::<f32>(&view, &options, &mut control).unwrap();
        drop(control);
        let fractions: Vec<f64> = receiver.iter().collect();
        assert!(fractions.windows(2).all(|w| w[0] <= w[1]), "{fractions:?}");
        assert_eq!(fractions.last(), Some(&1.0));
        assert!(fractions.len() < 400);
    }
}

#[test]
fn neither_type_nor_order_of_the_voxels_shows_in_a_bit() {
    let dims = [21, 34, 17];
    let [nx, ny, nz] = dims;
    let whole: Vec<i16> = head(dims, 0.02, 4)
        .iter()
        .map(|v| (v * 1000.0) as i16 - 300)
        .collect();
    let turned: Vec<i16> = (0..whole.len())
        .map(|i| whole[i / (ny * nz) + nx * (i / nz % ny + ny * (i % nz))])
        .collect();
    let floats = |v: &[i16]| -> Vec<f32> { v.iter().map(|&v| f32::from(v)).collect() };
    let (whole_floats, turned_floats) = (floats(&whole), floats(&turned));
    let stored = [
        Voxels::F32(&whole_floats, Order::XFastest),
        Voxels::F32(&turned_floats, Order::ZFastest),
        Voxels::I16(&whole, Order::XFastest),
        Voxels::I16(&turned, Order::ZFastest),
    ];
    for options in [VolumeOptions::default(), INTERPOLATE] {
        let [first, others @ ..] = stored.map(|values| {
            let view = VolumeView {
                dims,
                values,
                world_from_voxel: oblique(),
            };
            let (field, report) = fit_volume::<f32>(&view, &options, &mut Control::default()).unwrap();
            (field.sha256(), report, otsu_threshold(values))
        });
        for other in others {
            assert_eq!(other, first);
        }
    }
}
