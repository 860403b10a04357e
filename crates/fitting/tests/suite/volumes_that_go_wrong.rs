//! Volume fits that cannot or must not succeed: a clear error, never a panic.

use fitting::phantoms::head;
use fitting::volume::{VolumeMethod, VolumeOptions, VolumeView, fit_volume};
use fitting::{Control, FitError, StopReason};
use glam::{DAffine3, DVec3};

const INTERPOLATE: VolumeOptions = VolumeOptions {
    method: VolumeMethod::Interpolate,
    tolerance: None,
    coefficients: None,
    max_depth: None,
    smoothing: None,
};

fn refusal(dims: [usize; 3], values: &[f32], options: VolumeOptions) -> FitError {
    fit_volume::<f32>(
        &VolumeView {
            dims,
            values: values.into(),
            world_from_voxel: DAffine3::IDENTITY,
        },
        &options,
        &mut Control::default(),
    )
    .map(|_| ())
    .expect_err("refused")
}

#[test]
fn empty_volume_is_refused() {
    for dims in [[0, 0, 0], [0, 4, 4], [4, 4, 0]] {
        let expected = FitError::NotEnoughSamples { found: 0, needed: 1 };
        assert_eq!(refusal(dims, &[], VolumeOptions::default()), expected);
    }
}

#[test]
fn values_that_do_not_match_the_dimensions_are_refused() {
    for dims in [[2, 2, 2], [usize::MAX, 2, 2], [7, 1, 2]] {
        let text = refusal(dims, &[0.0; 7], VolumeOptions::default()).to_string();
        assert!(text.contains("7 values"), "{text}");
    }
}

#[test]
fn voxels_that_are_no_numbers_are_named() {
    let dims = [9, 8, 7];
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 3e38] {
        let mut values = head(dims, 0.0, 0);
        (values[4 + 9 * (2 + 8 * 3)], values[500]) = (bad, bad);
        for options in [VolumeOptions::default(), INTERPOLATE] {
            let text = refusal(dims, &values, options).to_string();
            assert!(text.contains("voxel (4, 2, 3)"), "{text}");
            assert!(bad == 3e38 || text.contains("2 of 504"), "{text}");
        }
    }
}

#[test]
fn map_that_cannot_be_inverted_is_refused() {
    let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
    let view = VolumeView {
        dims: [2, 2, 2],
        values: (&[0.0; 8][..]).into(),
        world_from_voxel: flat,
    };
    let result = fit_volume::<f32>(&view, &VolumeOptions::default(), &mut Control::default());
    assert!(matches!(result, Err(FitError::Degenerate(text)) if text.contains("inverted")));
}

#[test]
fn options_out_of_range_or_at_odds_are_refused() {
    let adaptive = VolumeOptions::default();
    let cases = [
        (
            "tolerance",
            VolumeOptions {
                tolerance: Some(0.0),
                ..adaptive
            },
        ),
        (
            "tolerance",
            VolumeOptions {
                tolerance: Some(f64::NAN),
                ..adaptive
            },
        ),
        (
            "coefficients",
            VolumeOptions {
                coefficients: Some(63),
                ..adaptive
            },
        ),
        (
            "smoothing",
            VolumeOptions {
                smoothing: Some(-1.0),
                ..adaptive
            },
        ),
        (
            "tolerance",
            VolumeOptions {
                tolerance: Some(0.1),
                ..INTERPOLATE
            },
        ),
        (
            "max_depth",
            VolumeOptions {
                max_depth: Some(1),
                ..INTERPOLATE
            },
        ),
    ];
    for (name, options) in cases {
        let error = refusal([4, 4, 4], &[1.0; 64], options);
        assert!(
            matches!(error, FitError::Option { option, .. } if option == name),
            "{name}: {error:?}"
        );
    }
}

#[test]
fn memory_ceiling_is_obeyed() {
    let dims = [60, 60, 60];
    let values = head(dims, 0.0, 0);
    let view = VolumeView {
        dims,
        values: (&values).into(),
        world_from_voxel: DAffine3::IDENTITY,
    };
    let run = |options: VolumeOptions, limit: u64| {
        let mut control = Control {
            memory_limit: Some(limit),
            ..Default::default()
        };
        fit_volume::<f32>(&view, &options, &mut control)
    };
    for options in [VolumeOptions::default(), INTERPOLATE] {
        assert!(
            matches!(run(options, 1 << 20), Err(FitError::MemoryLimit { limit, .. }) if limit == 1 << 20)
        );
        assert!(run(options, 1 << 30).is_ok());
    }
    // Enough for the arrays, not for every function the tolerance asks for.
    let tight = VolumeOptions {
        tolerance: Some(1e-4),
        ..Default::default()
    };
    let FitError::MemoryLimit { needed, .. } = run(tight, 1).map(|_| ()).unwrap_err() else {
        panic!()
    };
    let report = run(tight, needed).unwrap().1;
    assert!(
        report.leaves.iter().any(|l| l.reason == StopReason::Memory),
        "{:?}",
        report.notes
    );
}

#[test]
fn cancelled_fit_stops_at_once() {
    let dims = [40, 40, 40];
    let values = head(dims, 0.02, 0);
    let view = VolumeView {
        dims,
        values: (&values).into(),
        world_from_voxel: DAffine3::IDENTITY,
    };
    for options in [VolumeOptions::default(), INTERPOLATE] {
        for steps in 0..3 {
            let mut control = Control::default();
            let (cancel, mut left) = (control.cancel.clone(), steps);
            control.on_progress = Box::new(move |_| {
                if left == 0 {
                    cancel.cancel();
                }
                left -= 1;
            });
            let result = fit_volume::<f32>(&view, &options, &mut control);
            assert!(matches!(result, Err(FitError::Cancelled)), "after {steps} steps");
        }
    }
}
