use bspline::{Field, HierarchicalSpline, Real};
use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::extent::Extent;
use super::path::Path;
use super::stroke::ForceStroke;
use super::target::Target;
use super::track::{Place, within};
use super::tracked::Tracked;
use super::{ForceError, How};
use crate::curve::Along;
use crate::number::{Point, Positive};

/// Radii by which a hole, or a bridge, is made wider than a thread.
const WIDER: f64 = 0.5;
/// The same as a share of what densities differ by, at most.
const MOST_WIDER: f64 = 0.5;
/// Radii in front of a hole at which its densities are asked for.
const AHEAD: [f64; 3] = [1.0, 2.0, 3.0];

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
        let lines = self.along.lines(&field.lattice().world_box());
        let places = lines.map_err(ForceError::Tool)?.concat();
        self.tracked(field, iso, grows, &places).begin(field)
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
        self.tracked(field, iso, grows, &[at]).hold(field, at)
    }

    fn tracked<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
        grows: bool,
        places: &[DVec3],
    ) -> Tracked<'_> {
        let tool = self.clone();
        Tracked {
            along: &self.along,
            radius: self.radius.0,
            how: &self.how,
            extent: Extent::Curve,
            densities: [iso, self.goal(field, iso, grows, places)],
            make: Box::new(move |place| tool.target(place, grows)),
        }
    }

    /// Density beyond the surface by as much as the hole is to be wide; but no more than half of what the density in front of it differs by from
    /// that of the surface. A scan falls off within its edges, and a goal beyond its air would be met nowhere.
    fn goal<T: Real>(&self, field: &HierarchicalSpline<T>, iso: f64, grows: bool, places: &[DVec3]) -> f64 {
        let sign = if grows { 1.0 } else { -1.0 };
        let back = -self.by.0.normalize_or_zero() * self.radius.0;
        let differs = |p: &DVec3| {
            let before = AHEAD.map(|radii| *p + radii * back);
            let before = before.into_iter().filter(|p| within(field, *p).is_ok());
            let differs = before.map(|p| sign * (field.value(p) - iso));
            differs.reduce(f64::max).filter(|differs| *differs > 0.0)
        };
        let least = places.iter().filter_map(differs).fold(f64::INFINITY, f64::min);
        let wider = WIDER * self.radius.0 * field.slope();
        iso + sign * wider.min(MOST_WIDER * least)
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
