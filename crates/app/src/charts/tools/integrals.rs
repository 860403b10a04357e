//! What it costs to integrate a density along a path, by the exactness asked for.

use std::hint::black_box;

use ::tools::force::quadrature::{Tolerance, integrate};
use bspline::{Field, HierarchicalSpline};
use glam::DVec3;

use super::ToolLine;
use super::strokes::{SIDE, field_of};

/// A rule on a path.
pub struct Quadrature {
    /// Which field and rule.
    pub series: String,
    /// Values of the density that it takes.
    pub values: usize,
    /// Error of the force over the force.
    pub error: f64,
    pub milliseconds: f64,
    pub default: bool,
    word: String,
}

impl Quadrature {
    pub(super) fn line(&self) -> ToolLine {
        ToolLine {
            tool: format!("integral, {}{}", self.series, self.word),
            paths: 1,
            law: "integral".into(),
            profile_error: Some(self.error),
            loop_ms: Some(self.milliseconds),
            default: self.default,
            ..ToolLine::default()
        }
    }

    /// The exactness that was asked for.
    pub fn word(&self) -> String {
        self.word.trim_start_matches([',', ' ']).to_owned()
    }
}

/// Times that a rule is run to be timed.
const AGAIN: usize = 50;
/// Exactness asked of the adaptive rule; force tools ask for 1e-4, or the mean to 1e-5 of the fall over the path.
const ASKED: [f64; 6] = [1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8];

/// The adaptive rule, and those of equal steps, where the integral is known: along a chord of a ball, and through a plate, in
/// whose middle the distance has a crease; and on splines of both.
pub fn quadratures(clock: fn() -> f64) -> Vec<Quadrature> {
    let (from, to) = (0.0, 5.0);
    let middle = DVec3::splat(0.5 * SIDE);
    let along = DVec3::new(0.6, 0.48, 0.64);
    let (radius, beside, first) = (6.0, 1.4f64, 4.0);
    let start = middle + beside * DVec3::new(-0.8, 0.36, 0.48) + first * along;
    // ∫(|p| - R), with |p|² = b² + t² on the chord.
    let integral = |t: f64| {
        let p = beside.hypot(t);
        0.5 * (t * p + beside.powi(2) * (t / beside).asinh()) - radius * t
    };
    let ball_exact = integral(first + to) - integral(first + from);
    let ball = |p: DVec3| radius - p.distance(middle);
    // 1.6 thick; the path begins 0.9 below its middle.
    let (thick, below) = (0.8, 0.9);
    let plate = |p: DVec3| thick - (p.z - 0.5 * SIDE).abs();
    let foot = middle - below * DVec3::Z;
    let crease = below / along.z;
    let plate_exact = along.z * 0.5 * (crease.powi(2) + (to - crease).powi(2)) - thick * (to - from);
    let mut out = Vec::new();
    let mut all = |name: &str, exact: f64, f: &dyn Fn(f64) -> f64| {
        let mut add =
            |series: String, word: String, default, rule: &dyn Fn(&mut dyn FnMut(f64) -> f64) -> f64| {
                let mut values = 0;
                let found = rule(&mut |s| {
                    values += 1;
                    f(s)
                });
                let start = clock();
                for _ in 0..AGAIN {
                    black_box(rule(&mut |s| f(black_box(s))));
                }
                out.push(Quadrature {
                    series,
                    word,
                    values,
                    error: (found / exact - 1.0).abs(),
                    milliseconds: 1e3 * (clock() - start) / AGAIN as f64,
                    default,
                });
            };
        for relative in ASKED {
            let tolerance = Tolerance {
                relative,
                mean: if relative == 1e-4 { 1e-5 } else { 0.0 },
            };
            let word = format!(", {relative:.0e}");
            add(format!("{name}: adaptive"), word, relative == 1e-4, &|f| {
                integrate(f, from, to, tolerance).value
            });
        }
        for n in [2usize, 5, 15, 45, 135, 405] {
            let h = (to - from) / n as f64;
            add(format!("{name}: midpoints"), format!(", {n}"), false, &|f| {
                (0..n).map(|i| h * f(from + (i as f64 + 0.5) * h)).sum()
            });
        }
    };
    let on_ball = |s: f64| start + s * along;
    let on_plate = |s: f64| foot + s * along;
    all("ball", ball_exact, &|s| -ball(on_ball(s)));
    all("plate", plate_exact, &|s| -plate(on_plate(s)));
    let spline = |density: &dyn Fn(DVec3) -> f64| -> HierarchicalSpline<f32> {
        field_of(24, density).expect("a field of a distance")
    };
    let (ball, plate) = (spline(&ball), spline(&plate));
    let value = |s: f64| -ball.value(on_ball(s));
    all("ball in splines", simpson(&value, from, to), &value);
    let value = |s: f64| -plate.value(on_plate(s));
    all("plate in splines", simpson(&value, from, to), &value);
    out
}

/// On so many steps that only rounding is left.
fn simpson(f: &dyn Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    const STEPS: usize = 1 << 15;
    let h = (to - from) / STEPS as f64;
    let weight = |i: usize| match i {
        0 | STEPS => 1.0,
        i if i % 2 == 1 => 4.0,
        _ => 2.0,
    };
    let sum: f64 = (0..=STEPS).map(|i| weight(i) * f(from + i as f64 * h)).sum();
    sum * h / 3.0
}
