use bspline::{HierarchicalSpline, Real};
use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::extent::Extent;
use super::path::Path;
use super::stroke::ForceStroke;
use super::target::Target;
use super::track::Place;
use super::tracked::Tracked;
use super::{ForceError, How};
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
        self.tracked(field, iso, grows).begin(field)
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
        self.tracked(field, iso, grows).hold(field, at)
    }

    fn tracked<T: Real>(&self, field: &HierarchicalSpline<T>, iso: f64, grows: bool) -> Tracked<'_> {
        let tool = self.clone();
        Tracked {
            along: &self.along,
            radius: self.radius.0,
            how: &self.how,
            extent: Extent::Curve,
            densities: [iso, self.goal(field, iso, grows)],
            make: Box::new(move |place| tool.target(place, grows)),
        }
    }

    /// Density beyond the surface by as much as the hole is to be wide.
    fn goal<T: Real>(&self, field: &HierarchicalSpline<T>, iso: f64, grows: bool) -> f64 {
        let wider = WIDER * self.radius.0 * field.slope();
        if grows { iso + wider } else { iso - wider }
    }

    fn target(&self, place: &Place, grows: bool) -> Result<Target, ForceError> {
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
            begins: place.along,
            ends_early: true,
            ..Target::single(Path::through([place.at, place.at + self.by.0])?, grows)
        })
    }
}
