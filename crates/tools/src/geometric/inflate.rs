//! A brush that lifts a surface along its normals, or lowers it.

use bspline::{Aabb, Field, Frame, HierarchicalSpline, Real, TensorSpline};
use fitting::Control;
use fitting::field::FieldFitReport;
use glam::{DAffine3, DQuat, DVec3};
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

/// Times that a way is halved: an eighth of what the part would need is a step.
const HALVINGS: u32 = 3;

/// Places at which it is looked whether what is on the other side of a part comes through, about.
const LOOKED: f64 = (1u64 << 17) as f64;

/// Share of their distance that they lie beside the corners of the box: in the middle of a part, which is easily a plane of knots, nothing moves.
const ASIDE: f64 = 0.25;
/// Of them so many by the noise of a scan.
const CHANCE: usize = 8;

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
        self.raised(field, iso, self.by.0, HALVINGS, limits, control)
    }

    /// The same by another length. Where so much of it would bring through what is on the other side of a part, it goes half the way twice, up to
    /// so many `halvings`.
    fn raised<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
        by: f64,
        halvings: u32,
        limits: &Limits,
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<T>, FieldFitReport), GeometricError> {
        let writer = Writer { field, iso, limits };
        let (weight, reach) = band(&self.along, self.radius.0)?;
        let within = writer.within(&reach)?;
        let finest = field.finest_in(&within).max(writer.detail());
        let shortest = field.lattice().spacing(finest).min_element();
        let deviation = BLUR * by.abs();
        // Knots far closer than the mean is wide tell no more of it.
        let wide = |level: &usize| field.lattice().spacing(*level).max_element() <= 0.5 * deviation;
        let level = (writer.detail()..finest).find(wide).unwrap_or(finest);
        let spacing = field.lattice().spacing(level);
        let knots = within.widened(REACH * deviation).size() / spacing;
        let mean = match knots.x * knots.y * knots.z > PLACES {
            true => sampled(field, &within, deviation, PLACES, control)?,
            false => {
                let deviation = spacing.to_array().map(|spacing| deviation / spacing);
                averaged(field, &within, level, deviation, false, control)?
            }
        };
        let lift = Lift { mean, weight, by };
        let lifted = Moved::new(field, lift, 1e-4 * self.radius.0);
        if halvings > 0 && comes_through(field, &lifted, iso, by > 0.0, &within, shortest) {
            let (half, _) = self.raised(field, iso, 0.5 * by, halvings - 1, limits, control)?;
            return self.raised(&half, iso, 0.5 * by, halvings - 1, limits, control);
        }
        let fineness = Fineness {
            tolerance: self.tolerance,
            finer: self.finer,
            feature: None,
            densities: Some(1.0),
        };
        writer.written(&lifted, &within, &fineness, control)
    }
}

/// Whether some of the solid, or of what is outside it where that is to grow, would be lost by what is to make it larger.
fn comes_through(
    field: &dyn Field,
    lifted: &dyn Field,
    iso: f64,
    grows: bool,
    within: &Aabb,
    spacing: f64,
) -> bool {
    let size = within.size();
    let step = (0.5 * spacing).max(libm::cbrt(size.x * size.y * size.z / LOOKED));
    let count = (size / step).ceil().to_array().map(|n| n as usize + 1);
    let frame = Frame {
        world_from_grid: DAffine3::from_scale_rotation_translation(
            DVec3::splat(step),
            DQuat::IDENTITY,
            within.min + ASIDE * step,
        ),
        cells: count.map(|n| n as u32),
    };
    let [before, after] = [field, lifted].map(|field| {
        let mut values = vec![0.0; count.iter().product()];
        field.frame_values(&frame, [0; 3], count, &mut values);
        values
    });
    let lost = before.iter().zip(&after).filter(|(before, after)| match grows {
        true => **before > iso && **after < iso,
        false => **before < iso && **after > iso,
    });
    lost.count() > CHANCE
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
