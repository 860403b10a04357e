//! What formulas compute with: numbers, numbers with their slope, and intervals.

use bspline::Interval;
use glam::DVec3;

/// A function of one number.
#[derive(Clone, Copy, Debug)]
pub enum Unary {
    Negate,
    Abs,
    Sqrt,
    Exp,
    Ln,
    Sin,
    Cos,
}

/// A function of two; comparisons give 1 or 0.
#[derive(Clone, Copy, Debug)]
pub enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Min,
    Max,
    Less,
    Greater,
}

/// What a formula can be evaluated in.
pub trait Number: Copy {
    fn of(value: f64) -> Self;
    fn unary(f: Unary, a: Self) -> Self;
    fn binary(f: Binary, a: Self, b: Self) -> Self;
}

impl Number for f64 {
    fn of(value: f64) -> Self {
        value
    }

    fn unary(f: Unary, a: f64) -> f64 {
        match f {
            Unary::Negate => -a,
            Unary::Abs => a.abs(),
            Unary::Sqrt => a.sqrt(),
            Unary::Exp => libm::exp(a),
            Unary::Ln => libm::log(a),
            Unary::Sin => libm::sin(a),
            Unary::Cos => libm::cos(a),
        }
    }

    fn binary(f: Binary, a: f64, b: f64) -> f64 {
        match f {
            Binary::Add => a + b,
            Binary::Subtract => a - b,
            Binary::Multiply => a * b,
            Binary::Divide => a / b,
            Binary::Power => libm::pow(a, b),
            Binary::Min => a.min(b),
            Binary::Max => a.max(b),
            Binary::Less => f64::from(a < b),
            Binary::Greater => f64::from(a > b),
        }
    }
}

/// A value and its gradient by place.
#[derive(Clone, Copy, Debug)]
pub struct Slope {
    pub value: f64,
    pub gradient: DVec3,
}

impl Number for Slope {
    fn of(value: f64) -> Self {
        Self {
            value,
            gradient: DVec3::ZERO,
        }
    }

    fn unary(f: Unary, a: Self) -> Self {
        let value = f64::unary(f, a.value);
        let slope = match f {
            Unary::Negate => -1.0,
            Unary::Abs => a.value.signum(),
            Unary::Sqrt => 0.5 / value,
            Unary::Exp => value,
            Unary::Ln => 1.0 / a.value,
            Unary::Sin => libm::cos(a.value),
            Unary::Cos => -libm::sin(a.value),
        };
        Self {
            value,
            gradient: a.gradient * slope,
        }
    }

    fn binary(f: Binary, a: Self, b: Self) -> Self {
        let value = f64::binary(f, a.value, b.value);
        // A slope that does not count has not to be finite.
        let times = |g: DVec3, slope: f64| if g == DVec3::ZERO { g } else { g * slope };
        let gradient = match f {
            Binary::Add => a.gradient + b.gradient,
            Binary::Subtract => a.gradient - b.gradient,
            Binary::Multiply => times(a.gradient, b.value) + times(b.gradient, a.value),
            Binary::Divide => times(a.gradient, 1.0 / b.value) - times(b.gradient, value / b.value),
            Binary::Power => {
                let by_base = b.value * libm::pow(a.value, b.value - 1.0);
                times(a.gradient, by_base) + times(b.gradient, value * libm::log(a.value))
            }
            Binary::Min if a.value <= b.value => a.gradient,
            Binary::Max if a.value >= b.value => a.gradient,
            Binary::Min | Binary::Max => b.gradient,
            Binary::Less | Binary::Greater => DVec3::ZERO,
        };
        Self { value, gradient }
    }
}

impl Number for Interval {
    fn of(value: f64) -> Self {
        Interval::point(value)
    }

    fn unary(f: Unary, a: Self) -> Self {
        let rising = |of: fn(f64) -> f64| rounded(of(a.lo), of(a.hi));
        match f {
            Unary::Negate => -a,
            Unary::Abs => a.abs(),
            // Sums of squares may come out below 0 by a rounding.
            Unary::Sqrt if a.lo >= -f64::MIN_POSITIVE => Self::new(a.lo.max(0.0), a.hi.max(0.0)).sqrt(),
            Unary::Exp => rising(libm::exp),
            Unary::Ln if a.lo > 0.0 => rising(libm::log),
            // Not a number somewhere.
            Unary::Sqrt | Unary::Ln => Self::EVERYTHING,
            Unary::Sin | Unary::Cos => {
                // Neither changes faster than the angle.
                let middle = 0.5 * (a.lo + a.hi);
                let reach = 0.5 * a.width() * (1.0 + 1e-12) + 1e-12 * (1.0 + middle.abs());
                match reach.is_finite() {
                    true => {
                        let around = Self::point(f64::unary(f, middle)).widened(reach);
                        Self::new(around.lo.max(-1.0), around.hi.min(1.0))
                    }
                    false => Self::new(-1.0, 1.0),
                }
            }
        }
    }

    fn binary(f: Binary, a: Self, b: Self) -> Self {
        let truth = |always: bool, never: bool| match (always, never) {
            (true, _) => Self::point(1.0),
            (_, true) => Self::point(0.0),
            _ => Self::new(0.0, 1.0),
        };
        let found = match f {
            Binary::Add => a + b,
            Binary::Subtract => a - b,
            Binary::Multiply => a * b,
            Binary::Divide if b.lo > 0.0 || b.hi < 0.0 => a * rounded(1.0 / b.hi, 1.0 / b.lo),
            Binary::Divide => Self::EVERYTHING,
            Binary::Power => power(a, b),
            Binary::Min => a.min(b),
            Binary::Max => a.max(b),
            Binary::Less => truth(a.hi < b.lo, a.lo >= b.hi),
            Binary::Greater => truth(a.lo > b.hi, a.hi <= b.lo),
        };
        match found.lo.is_nan() || found.hi.is_nan() {
            true => Self::EVERYTHING,
            false => found,
        }
    }
}

/// `{ aᵇ }`.
fn power(a: Interval, b: Interval) -> Interval {
    let corners = |a: Interval, b: Interval| {
        let all = [(a.lo, b.lo), (a.lo, b.hi), (a.hi, b.lo), (a.hi, b.hi)].map(|(a, b)| libm::pow(a, b));
        let lo = all.into_iter().fold(f64::INFINITY, f64::min);
        let hi = all.into_iter().fold(f64::NEG_INFINITY, f64::max);
        rounded(lo, hi)
    };
    // For positive bases it rises or falls with each of the two.
    if a.lo > 0.0 {
        return corners(a, b);
    }
    let n = b.lo;
    if b.lo != b.hi || n.fract() != 0.0 || n < 0.0 {
        return Interval::EVERYTHING;
    }
    match n % 2.0 == 0.0 {
        true => {
            let found = corners(a.abs(), b);
            Interval::new(found.lo.max(0.0), found.hi)
        }
        false => corners(a, b),
    }
}

/// The interval between two values that may be off by a few roundings.
fn rounded(a: f64, b: f64) -> Interval {
    if a.is_nan() || b.is_nan() {
        return Interval::EVERYTHING;
    }
    let (lo, hi) = (a.min(b), a.max(b));
    Interval::new(
        (lo - 1e-14 * lo.abs()).next_down(),
        (hi + 1e-14 * hi.abs()).next_up(),
    )
}
