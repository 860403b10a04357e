use bspline::{KnotVector, TensorSpline};
use glam::{DAffine3, DVec3};

use super::*;
use crate::ReadLimits;
use crate::Unit;
use crate::field::SourceKind;

fn sample() -> (TensorSpline<f32>, FieldMeta) {
    let knots = [
        KnotVector::new(3, vec![0.0, 0.0, 0.0, 0.0, 0.1, 0.7, 2.0, 2.0, 2.0, 2.0]).unwrap(),
        KnotVector::clamped_uniform(2, 3, -1.0, 1.0).unwrap(),
        KnotVector::uniform(1, 4, 0.0, 1.0).unwrap(),
    ];
    let count = knots.iter().map(KnotVector::coefficient_count).product::<usize>();
    let coefficients = (0..count).map(|i| (i as f32 * 0.37).sin()).collect();
    let map = DAffine3::from_rotation_translation(glam::DQuat::from_rotation_x(0.3), DVec3::Y);
    let meta = FieldMeta {
        source: SourceKind::Other,
        unit: Unit::Millimetre,
        density_unit: "mm".into(),
        iso: Some(0.25),
        report: "{}".into(),
        notes: vec!["one".into(), "two".into()],
        provenance: "{\"a\":1}".into(),
        ..FieldMeta::default()
    };
    (TensorSpline::new(knots, coefficients, map, 0.5).unwrap(), meta)
}

#[test]
fn a_spline_comes_back_to_the_bit_with_what_stands_beside_it() {
    let (spline, meta) = sample();
    let bytes = encode_knots(&spline, &meta).unwrap();
    let (again, beside) = decode_knots::<f32>(&bytes, &ReadLimits::default()).unwrap();
    assert_eq!(again.sha256(), spline.sha256());
    assert_eq!(beside, meta);
}

#[test]
fn a_difference_comes_back_and_leads_both_ways() {
    let (old, _) = sample();
    let mut coefficients = old.coefficients().to_vec();
    coefficients[7] = -0.0;
    coefficients[40] = 3.0;
    let new = old.with_coefficients(coefficients).unwrap();
    let diff = old.difference(&new).unwrap();
    let bytes = encode_knots_difference(&diff).unwrap();
    let again = decode_knots_difference::<f32>(&bytes, &ReadLimits::default()).unwrap();
    assert_eq!(again, diff);
    assert_eq!(old.applied(&again).unwrap().sha256(), new.sha256());
    assert_eq!(new.applied(&again.reversed()).unwrap().sha256(), old.sha256());
    assert!(new.applied(&again).is_err());
    assert!(old.difference(&old).unwrap().is_empty());
}

/// Cut at any byte, or with any byte flipped, both are refused; none panics.
#[test]
fn damaged_bytes_are_refused() {
    let (spline, meta) = sample();
    let moved = spline
        .with_coefficients(spline.coefficients().iter().map(|c| c + 1.0).collect())
        .unwrap();
    let whole = encode_knots(&spline, &meta).unwrap();
    let diff = encode_knots_difference(&spline.difference(&moved).unwrap()).unwrap();
    let limits = ReadLimits::default();
    for n in 0..whole.len() {
        assert!(decode_knots::<f32>(&whole[..n], &limits).is_err(), "{n}");
        let mut flipped = whole.clone();
        flipped[n] ^= 0x10;
        assert!(decode_knots::<f32>(&flipped, &limits).is_err(), "{n}");
    }
    for n in 0..diff.len() {
        assert!(
            decode_knots_difference::<f32>(&diff[..n], &limits).is_err(),
            "{n}"
        );
        let mut flipped = diff.clone();
        flipped[n] ^= 0x10;
        assert!(decode_knots_difference::<f32>(&flipped, &limits).is_err(), "{n}");
    }
    let little = ReadLimits { max_bytes: 500 };
    assert!(matches!(
        decode_knots::<f32>(&whole, &little),
        Err(Fault::Limit { .. })
    ));
    assert!(decode_knots::<f64>(&whole, &limits).is_err());
}
