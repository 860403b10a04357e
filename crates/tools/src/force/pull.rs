use bspline::{HierarchicalSpline, Real};
use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::extent::Extent;
use super::path::Path;
use super::stroke::ForceStroke;
use super::target::Target;
use super::{ForceError, How, area, track};
use crate::curve::Along;
use crate::number::{Finite, Point, Positive};

/// Takes hold of the surface at a point, along a curve or over an area, and brings it elsewhere. Exactly one of `by`, `way` and
/// `lift` is given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pull {
    /// Where it takes hold, drawn to the nearest surface: one point, or a curve.
    #[serde(default, skip_serializing_if = "Along::is_empty")]
    pub along: Along,
    /// Outline of an area, in place of `along`: the area within a closed curve.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub area: Option<Along>,
    /// Radius of a disc about the point, if it takes hold of an area.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub disc: Option<Positive>,
    /// How far the surface goes, a vector.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<Point>,
    /// The same on a curved way: vectors from the place of the surface, one after the other.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub way: Option<Vec<Point>>,
    /// The same along the normals of the surface, a length: out of the solid, or into it if negative. Those of an area are
    /// averaged over a radius and a half of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lift: Option<Finite>,
    /// Standard deviation of the spread of its force, a world length.
    pub radius: Positive,
    /// How it works.
    #[serde(default)]
    pub how: How,
}

impl Pull {
    /// Takes hold of a field whose surface lies at `iso`.
    ///
    /// # Errors
    /// Any [`ForceError`].
    pub fn begin<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
    ) -> Result<ForceStroke<T>, ForceError> {
        let target = |(place, normal): (&track::Place, DVec3)| {
            let way: Vec<_> = match (&self.by, &self.way, &self.lift) {
                (Some(by), None, None) => vec![by.0],
                (None, Some(way), None) => way.iter().map(|p| p.0).collect(),
                (None, None, Some(lift)) => vec![lift.0 * normal],
                _ => return Err(ForceError::tool("write exactly one of by, way and lift")),
            };
            let path = Path::through(std::iter::once(place.at).chain(way.iter().map(|w| place.at + *w)))?;
            Ok(Target {
                weight: place.weight,
                grows: path.direction(0.0).dot(place.normal) > 0.0,
                ..Target::single(path, true)
            })
        };
        let places = self.places(field, iso)?;
        let normals = match self.extent() {
            Extent::Area => area::normals(&places, self.radius.0),
            _ => places.iter().map(|place| place.normal).collect(),
        };
        let targets: Result<Vec<_>, _> = places.iter().zip(normals).map(target).collect();
        ForceStroke::new(field, iso, targets?, self.extent(), self.radius.0, &self.how)?.with_room()
    }

    /// Takes hold of a field for a hand that will say the way, its ends from the place of the surface.
    ///
    /// # Errors
    /// Any [`ForceError`].
    pub fn hold<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
    ) -> Result<ForceStroke<T>, ForceError> {
        let places = self.places(field, iso)?;
        ForceStroke::dragging(field, iso, places, self.extent(), self.radius.0, &self.how)
    }

    fn extent(&self) -> Extent {
        match (&self.area, self.disc) {
            (None, None) => Extent::Curve,
            _ => Extent::Area,
        }
    }

    /// Where it takes hold.
    fn places<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
    ) -> Result<Vec<track::Place>, ForceError> {
        let radius = self.radius.0;
        match (&self.area, self.disc, self.along.points()) {
            (Some(outline), None, []) => area::within(field, iso, outline, radius),
            (Some(_), ..) => Err(ForceError::tool(
                "an area is all there is; leave along and disc out",
            )),
            (None, None, _) => track::along(field, iso, &self.along, radius),
            (None, Some(disc), [middle]) => track::disc(field, iso, middle.0, disc.0, radius),
            (None, Some(_), _) => Err(ForceError::tool(
                "a disc has one middle; write one point for along, or leave disc out",
            )),
        }
    }
}
