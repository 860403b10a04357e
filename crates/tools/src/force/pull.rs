use bspline::{HierarchicalSpline, Real};
use serde::{Deserialize, Serialize};

use super::path::Path;
use super::stroke::{Extent, ForceStroke};
use super::target::Target;
use super::{ForceError, How, track};
use crate::number::{Finite, Point, Positive};

/// Takes hold of the surface at a point, along a curve or over a disc, and brings it elsewhere. Exactly one of `by`, `way` and
/// `lift` is given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pull {
    /// Where it takes hold, drawn to the nearest surface: one point, or a polyline.
    pub along: Vec<Point>,
    /// Radius of a disc about the point, if it takes hold of an area.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub disc: Option<Positive>,
    /// How far the surface goes, a vector.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<Point>,
    /// The same on a curved way: vectors from the place of the surface, one after the other.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub way: Option<Vec<Point>>,
    /// The same along the normals of the surface, a length: out of the solid, or into it if negative.
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
        let target = |place: &track::Place| {
            let way: Vec<_> = match (&self.by, &self.way, &self.lift) {
                (Some(by), None, None) => vec![by.0],
                (None, Some(way), None) => way.iter().map(|p| p.0).collect(),
                (None, None, Some(lift)) => vec![lift.0 * place.normal],
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
        let targets: Result<Vec<_>, _> = places.iter().map(target).collect();
        ForceStroke::new(field, iso, targets?, self.extent(), self.radius.0, &self.how)
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
        match self.disc {
            Some(_) => Extent::Area,
            None => Extent::Curve,
        }
    }

    /// Where it takes hold.
    fn places<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
    ) -> Result<Vec<track::Place>, ForceError> {
        let radius = self.radius.0;
        let points: Vec<_> = self.along.iter().map(|p| p.0).collect();
        match (self.disc, &points[..]) {
            (None, _) => track::along(field, iso, &points, radius),
            (Some(disc), [middle]) => track::disc(field, iso, *middle, disc.0, radius),
            (Some(_), _) => Err(ForceError::tool(format!(
                "a disc has one middle, and along has {} points; write one, or leave disc out",
                points.len()
            ))),
        }
    }
}
