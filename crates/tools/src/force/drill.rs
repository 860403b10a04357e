use bspline::{HierarchicalSpline, Real};
use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::path::Path;
use super::stroke::{Extent, ForceStroke};
use super::target::Target;
use super::{ForceError, How, track};
use crate::curve::Along;
use crate::number::{Point, Positive};

/// Radii by which a hole, or a bridge, is made wider than a thread.
const WIDER: f64 = 0.5;

/// A hole from a point, or a cut along a curve, as far as a vector says; or the other way round a bridge, or a seam. Paths end where they would leave
/// the solid, or meet the next.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drill {
    /// Where it begins, drawn to the nearest surface: one point, or the curve of a cut.
    pub along: Along,
    /// Direction and length.
    pub by: Point,
    /// Standard deviation of the spread of its force, a world length.
    pub radius: Positive,
    /// How it works.
    #[serde(default)]
    pub how: How,
}

impl Drill {
    /// Sets the tool on a field whose surface lies at `iso`; `grows` if it joins.
    ///
    /// # Errors
    /// Any [`ForceError`].
    pub fn begin<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
        grows: bool,
    ) -> Result<ForceStroke<T>, ForceError> {
        let places = track::along(field, iso, &self.along, self.radius.0)?;
        let targets: Result<Vec<_>, _> = places.iter().map(|place| self.target(place, grows)).collect();
        let goal = self.goal(field, iso, grows);
        ForceStroke::new(field, goal, targets?, Extent::Curve, self.radius.0, &self.how)
    }

    /// Takes the tool in hand at a place, the first of its track.
    ///
    /// # Errors
    /// Any [`ForceError`].
    pub fn hold<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
        grows: bool,
        at: DVec3,
    ) -> Result<ForceStroke<T>, ForceError> {
        let (tool, goal) = (self.clone(), self.goal(field, iso, grows));
        let make = Box::new(move |place: &track::Place| {
            let begins = place.along;
            Ok(Target {
                begins,
                ..tool.target(place, grows)?
            })
        });
        ForceStroke::walking(field, [iso, goal], make, at, self.radius.0, &self.how)
    }

    /// Density beyond the surface by as much as the hole is to be wide.
    fn goal<T: Real>(&self, field: &HierarchicalSpline<T>, iso: f64, grows: bool) -> f64 {
        let wider = WIDER * self.radius.0 * field.slope();
        if grows { iso + wider } else { iso - wider }
    }

    fn target(&self, place: &track::Place, grows: bool) -> Result<Target, ForceError> {
        let inward = if grows { -place.normal } else { place.normal };
        if self.by.0.dot(inward) >= 0.0 {
            let way = if grows { "out of" } else { "into" };
            return Err(ForceError::tool(format!(
                "by {:?} does not lead {way} the solid at {:?}; turn it round, or begin on the other side",
                self.by.0.to_array(),
                place.at.to_array(),
            )));
        }
        Ok(Target {
            weight: place.weight,
            ends_early: true,
            ..Target::single(Path::through([place.at, place.at + self.by.0])?, grows)
        })
    }
}
