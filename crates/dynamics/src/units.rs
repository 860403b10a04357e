//! Powers of two in which lists are kept: no magnitude of what a patch is made of leaves the range of single precision
//! then, and no bit of a number within it changes.

use bspline::Real;
use bspline::vectorized;

use crate::springs::{SpringWeights, Weights};

/// The power of two at or below `x`; 0 of 0.
pub(crate) fn binary_unit(x: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff << 52;
    if x >= f64::MIN_POSITIVE {
        f64::from_bits(x.to_bits() & EXPONENT)
    } else if x > 0.0 {
        f64::MIN_POSITIVE
    } else {
        0.0
    }
}

/// Largest absolute value; NaN is passed over.
pub(crate) fn largest<T: Real>(list: &[T]) -> f64 {
    const LANES: usize = 16;
    let (chunks, rest) = list.as_chunks::<LANES>();
    let mut lanes = [T::zero(); LANES];
    vectorized(
        #[inline(always)]
        || {
            for chunk in chunks {
                for l in 0..LANES {
                    let size = chunk[l].abs();
                    lanes[l] = if size > lanes[l] { size } else { lanes[l] };
                }
            }
        },
    );
    let all = lanes.iter().chain(rest);
    all.fold(0.0, |m, v| m.max(v.as_f64().abs()))
}

/// Weights as multiples of a power of two; the unit of weights that are all 0 is 0.
#[derive(Clone, Debug)]
pub(crate) struct InUnits<T> {
    pub unit: f64,
    pub weights: Weights<T>,
}

impl<T: Real> InUnits<T> {
    pub fn new(weights: &Weights<f64>) -> Self {
        let unit = binary_unit(weights.range().1);
        Self {
            unit,
            weights: in_unit(weights, unit),
        }
    }

    /// The multiple of the unit at `i`.
    #[inline(always)]
    pub fn at(&self, i: usize) -> T {
        self.weights.at(i)
    }

    /// The weight itself.
    #[inline(always)]
    pub fn value(&self, i: usize) -> f64 {
        self.unit * self.weights.at(i).as_f64()
    }

    pub fn is_constant(&self) -> bool {
        matches!(self.weights, Weights::Constant(_))
    }
}

/// Weights as multiples of `unit`.
pub(crate) fn in_unit<T: Real>(weights: &Weights<f64>, unit: f64) -> Weights<T> {
    weights.scaled(if unit > 0.0 { 1.0 / unit } else { 1.0 })
}

/// Springs as multiples of their common power of two.
pub(crate) fn springs_in_units<T: Real>(springs: &[SpringWeights<f64>]) -> (f64, Vec<SpringWeights<T>>) {
    let largest = springs.iter().fold(0.0_f64, |m, s| m.max(s.weights.range().1));
    let unit = binary_unit(largest);
    let scaled = springs.iter().map(|s| SpringWeights {
        direction: s.direction,
        weights: in_unit(&s.weights, unit),
    });
    (unit, scaled.collect())
}
