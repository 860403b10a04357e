//! The force laws of density springs.
//!
//! A spring joins two samples at the distance `h` whose densities differ by `Δ = σ(d_i - d_j)`, a length.

use bspline::Real;
use serde::{Deserialize, Serialize};

/// Which law, with its scale `σ`, a length per density: without it a density could not be added to a distance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Law {
    /// `½k(Δ - Δ₀)²`: always convex.
    Linear {
        /// Length per density.
        scale: f64,
    },
    /// `½k(L - L₀)²` with `L = √(h² + Δ²)` [Hua04 §5.1].
    FourD {
        /// Length per density.
        scale: f64,
    },
}

impl Law {
    /// Length per density.
    pub fn scale(self) -> f64 {
        match self {
            Self::Linear { scale } | Self::FourD { scale } => scale,
        }
    }

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear { .. } => "linear",
            Self::FourD { .. } => "4-d",
        }
    }
}

/// A 4-D spring flatter than this share of its length, and shorter than at rest, is pushed the way it rests: at
/// `Δ = 0` the law itself gives no force, and rounding would choose the side.
const FLAT: f64 = 1e-3;

/// Beyond this many units a difference is the length of its spring, to rounding; its square might not be a number.
const FAR: f64 = 1e9;

/// `√(h² + Δ²)`.
#[inline(always)]
pub(super) fn length<T: Real>(h2: T, delta: T) -> T {
    let far = delta.abs() > T::from_f64(FAR);
    let root = (h2 + delta * delta).sqrt();
    if far { delta.abs() } else { root }
}

/// One spring: how far it is stretched, by which slope that acts on the density of its first sample, and the tangent
/// factor `τ` in `∂²E/∂d² = σ²kτ`.
///
/// `rest` is `Δ₀`; of the 4-D law its sign is the orientation and `L₀ = s√(h² + Δ₀²)` with the rest scale `s`; of the
/// linear one `Δ₀` is scaled itself.
#[inline(always)]
pub(super) fn spring<T: Real, const FOUR_D: bool>(delta: T, rest: T, rest_scale: T, h2: T) -> (T, T, T) {
    if FOUR_D {
        let now = length(h2, delta);
        let rest_length = rest_scale * length(h2, rest);
        let stretch = now - rest_length;
        let flat = T::from_f64(FLAT) * h2.sqrt();
        let pushed = delta.abs() < flat && stretch < T::zero() && rest != T::zero();
        let slope = if pushed {
            let side = if rest > T::zero() { flat } else { -flat };
            side / now
        } else {
            delta / now
        };
        let tangent = T::one() - rest_length * h2 / (now * now * now);
        (stretch, slope, tangent)
    } else {
        (delta - rest_scale * rest, T::one(), T::one())
    }
}
