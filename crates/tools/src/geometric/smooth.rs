//! Brushes that smooth what they pass over.

use bspline::{HierarchicalSpline, Real};
use fitting::Control;
use fitting::field::FieldFitReport;
use serde::{Deserialize, Serialize};

use super::GeometricError;
use super::band::band;
use super::detail::simplified;
use super::mean::averaged;
use super::write::{Fineness, TOLERANCE, Writer};
use crate::limits::Limits;
use crate::mix::Mixed;
use crate::number::{Point, Positive};

/// What of a scan's own tolerance the mean of its densities may be off by: whole, it would leave noise where it is, which is about as large.
/// (Of a ball with noise of 30 in 1000, level 2, 21.8 become 14.4 inside for the 2.0 of the mean, and the surface is rougher than before; with an eighth
/// it is 2.4, with a 32nd no less.)
const EVENNESS: f64 = 0.125;

/// Evens a surface out: means of the density over a kernel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Smooth {
    /// The brush's way.
    pub along: Vec<Point>,
    /// It acts whole within half of this, and not at all beyond.
    pub radius: Positive,
    /// 1 to 10: standard deviation of the kernel in knot intervals of the object's detail.
    pub level: u8,
    /// Whether shapes wider than the kernel keep their volume.
    #[serde(default, rename = "keep-volume")]
    pub keep_volume: bool,
    /// As for [`Geometric`](super::Geometric).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<Positive>,
}

impl Smooth {
    /// What the brush leaves of a field whose surface lies at `iso`, and how close that is to the mean.
    ///
    /// Linear fields stay. What the smoother surface no longer needs is taken out of the field.
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
        if !(1..=10).contains(&self.level) {
            return Err(GeometricError::Shape(format!(
                "the level is {}; write 1 to 10",
                self.level
            )));
        }
        let writer = Writer { field, iso, limits };
        let (weight, reach) = band(&self.along, self.radius.0)?;
        let within = writer.within(&reach)?;
        let deviation = [f64::from(self.level); 3];
        let even = averaged(
            field,
            &within,
            writer.detail(),
            deviation,
            self.keep_volume,
            control,
        )?;
        let mixed = Mixed {
            from: field,
            to: &even,
            weight: &weight,
        };
        let fineness = Fineness {
            tolerance: self.tolerance,
            finer: Some(0),
            feature: None,
            densities: Some(EVENNESS),
        };
        let (smooth, report) = writer.written(&mixed, &within, &fineness, control)?;
        let tolerance = self.tolerance.map_or(TOLERANCE * writer.spacing(), |t| t.0);
        let slim = simplified(&smooth, &reach, tolerance, limits)?;
        Ok((slim, report))
    }
}
