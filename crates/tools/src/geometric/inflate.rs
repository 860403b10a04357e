//! A brush that lifts a surface along its normals, or lowers it.

use bspline::{Aabb, Field, HierarchicalSpline, Real, TensorSpline};
use fitting::Control;
use fitting::field::FieldFitReport;
use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::GeometricError;
use super::band::band;
use super::mean::{REACH, averaged, sampled};
use super::moved::{Displacement, Moved};
use super::write::{Fineness, Writer};
use crate::limits::Limits;
use crate::mix::Faded;
use crate::number::{Finite, Point, Positive};

/// Standard deviation of the mean whose slope tells the way, over the way's length: a surface is found from as far as it is to go, where the density
/// of a scan itself is even but for noise.
const BLUR: f64 = 0.5;

/// Places that such a mean is taken from, at most.
const PLACES: f64 = (1u64 << 25) as f64;

/// Lifts a surface by a length, or lowers it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Inflate {
    /// The brush's way.
    pub along: Vec<Point>,
    /// It acts whole within half of this, and not at all beyond.
    pub radius: Positive,
    /// By how much; negative lengths lower.
    pub by: Finite,
    /// As for [`Geometric`](super::Geometric).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<Positive>,
    /// As for [`Geometric`](super::Geometric).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finer: Option<u8>,
}

impl Inflate {
    /// What the brush leaves of a field whose surface lies at `iso`, and how close that is: each place takes the value that lies
    /// `by` behind it along the slope of a mean of the field.
    ///
    /// Matter moves as far as its surface does, whatever its profile: `f + h·|∇f|`, the same to first order, fails where `h` is more than the edge of
    /// a scan is wide.
    ///
    /// # Errors
    /// Any [`GeometricError`].
    pub fn apply<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
        limits: &Limits,
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<T>, FieldFitReport), GeometricError> {
        if self.by.0.abs() > self.radius.0 {
            return Err(GeometricError::Shape(format!(
                "by is {}, more than the radius {}; take a wider brush, or several strokes",
                self.by.0, self.radius.0
            )));
        }
        let writer = Writer { field, iso, limits };
        let (weight, reach) = band(&self.along, self.radius.0)?;
        let within = writer.within(&reach)?;
        let finest = field.finest_in(&within).max(writer.detail());
        let spacing = field.lattice().spacing(finest);
        let deviation = BLUR * self.by.0.abs();
        let knots = within.widened(REACH * deviation).size() / spacing;
        let mean = match knots.x * knots.y * knots.z > PLACES {
            true => sampled(field, &within, deviation, PLACES, control)?,
            false => {
                let deviation = spacing.to_array().map(|spacing| deviation / spacing);
                averaged(field, &within, finest, deviation, false, control)?
            }
        };
        let lift = Lift {
            mean,
            weight,
            by: self.by.0,
        };
        let lifted = Moved::new(field, lift, 1e-4 * self.radius.0);
        let fineness = Fineness {
            tolerance: self.tolerance,
            finer: self.finer,
            feature: None,
            densities: true,
        };
        writer.written(&lifted, &within, &fineness, control)
    }
}

/// Out of the solid, where the brush acts.
struct Lift {
    mean: TensorSpline<f64>,
    weight: Faded,
    by: f64,
}

impl Displacement for Lift {
    fn at(&self, p: DVec3) -> DVec3 {
        match self.weight.value(p) {
            0.0 => DVec3::ZERO,
            weight => -self.by * weight * self.mean.value_gradient(p).1.normalize_or_zero(),
        }
    }

    fn most(&self) -> f64 {
        self.by.abs()
    }

    fn reaches(&self, b: &Aabb) -> bool {
        self.weight.bounds(b).hi > 0.0
    }
}
