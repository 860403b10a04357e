//! Tools whose paths begin along a track, each made of its place.

use bspline::{HierarchicalSpline, Real};
use glam::DVec3;

use super::extent::Extent;
use super::hand::Make;
use super::stroke::ForceStroke;
use super::{ForceError, How, track};
use crate::curve::Along;

/// Such a tool.
pub struct Tracked<'a> {
    pub along: &'a Along,
    pub radius: f64,
    pub how: &'a How,
    pub extent: Extent,
    /// Densities of the surface, and of where the paths bring it.
    pub densities: [f64; 2],
    pub make: Make,
}

impl Tracked<'_> {
    /// Sets the tool on a field.
    pub fn begin<T: Real>(self, field: &HierarchicalSpline<T>) -> Result<ForceStroke<T>, ForceError> {
        let [iso, goal] = self.densities;
        let places = track::along(field, iso, self.along, self.radius)?;
        let targets: Result<Vec<_>, _> = places.iter().map(self.make).collect();
        ForceStroke::new(field, goal, targets?, self.extent, self.radius, self.how)
    }

    /// Takes it in hand at a place, the first of its track.
    pub fn hold<T: Real>(
        self,
        field: &HierarchicalSpline<T>,
        at: DVec3,
    ) -> Result<ForceStroke<T>, ForceError> {
        ForceStroke::walking(field, self.densities, self.make, at, self.radius, self.how)
    }
}
