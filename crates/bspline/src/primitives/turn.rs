//! Sine and cosine of an angle in turns, the same bits on every machine.
//!
//! The platform's own functions differ between machines in the last bit; a phantom must not.

use crate::Interval;

/// `(sin 2πt, cos 2πt)`, right to 2·10⁻¹⁶ plus 2π times the rounding of `t`.
pub(super) fn sin_cos(t: f64) -> (f64, f64) {
    let quarter = (4.0 * t).round();
    // Exact: both are multiples of the last place of t, and close.
    let x = (t - 0.25 * quarter) * std::f64::consts::TAU;
    let x2 = x * x;
    // Taylor series on |x| <= π/4: the terms left out are below 5e-17.
    const SIN: [f64; 8] = [
        1.0,
        -1.0 / 6.0,
        1.0 / 120.0,
        -1.0 / 5040.0,
        1.0 / 362_880.0,
        -1.0 / 39_916_800.0,
        1.0 / 6_227_020_800.0,
        -1.0 / 1_307_674_368_000.0,
    ];
    const COS: [f64; 9] = [
        1.0,
        -1.0 / 2.0,
        1.0 / 24.0,
        -1.0 / 720.0,
        1.0 / 40_320.0,
        -1.0 / 3_628_800.0,
        1.0 / 479_001_600.0,
        -1.0 / 87_178_291_200.0,
        1.0 / 20_922_789_888_000.0,
    ];
    let sum = |c: &[f64]| c.iter().rev().fold(0.0, |s, c| s * x2 + c);
    let (s, c) = (x * sum(&SIN), sum(&COS));
    match quarter.rem_euclid(4.0) as u8 {
        0 => (s, c),
        1 => (c, -s),
        2 => (-s, -c),
        _ => (-c, s),
    }
}

/// Ranges of `sin 2πt` and `cos 2πt` over `[lo, hi]`, without the rounding of `lo` and `hi`.
pub(super) fn ranges(t: Interval) -> [Interval; 2] {
    let (at_lo, at_hi) = (sin_cos(t.lo), sin_cos(t.hi));
    // Whether a point n + phase, n whole, lies in the interval; rounding only ever finds one more.
    let reaches = |phase: f64| {
        let slack = 1e-15 * (1.0 + t.lo.abs().max(t.hi.abs()));
        (t.hi + slack - phase).floor() >= (t.lo - slack - phase).ceil()
    };
    let range = |a: f64, b: f64, top: f64, bottom: f64| {
        let slack = 4.0 * f64::EPSILON;
        Interval::new(
            if reaches(bottom) {
                -1.0
            } else {
                (a.min(b) - slack).max(-1.0)
            },
            if reaches(top) {
                1.0
            } else {
                (a.max(b) + slack).min(1.0)
            },
        )
        .widened(slack)
    };
    [
        range(at_lo.0, at_hi.0, 0.25, 0.75),
        range(at_lo.1, at_hi.1, 0.0, 0.5),
    ]
}
