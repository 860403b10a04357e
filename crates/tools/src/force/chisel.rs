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
use crate::number::Positive;

/// A groove along a track, or a ridge: short paths along the normals, all of one length \[Hua04 §6.1\]. The depth counts from the
/// surface as it is when the stroke begins, so that standing still, or crossing the track, goes no deeper.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Chisel {
    /// The track, drawn to the nearest surface: a curve, or one point.
    pub along: Along,
    /// Depth of the groove, or height of the ridge, a world length.
    pub depth: Positive,
    /// Standard deviation of the spread of its force, a world length.
    pub radius: Positive,
    /// How it works.
    #[serde(default)]
    pub how: How,
}

impl Chisel {
    /// Sets the tool on a field whose surface lies at `iso`; `grows` if it squirts.
    ///
    /// # Errors
    /// Any [`ForceError`].
    pub fn begin<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
        grows: bool,
    ) -> Result<ForceStroke<T>, ForceError> {
        self.tracked(iso, grows).begin(field)
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
        self.tracked(iso, grows).hold(field, at)
    }

    fn tracked(&self, iso: f64, grows: bool) -> Tracked<'_> {
        let tool = self.clone();
        Tracked {
            along: &self.along,
            radius: self.radius.0,
            how: &self.how,
            extent: Extent::Track,
            densities: [iso, iso],
            make: Box::new(move |place| tool.target(place, grows)),
        }
    }

    fn target(&self, place: &Place, grows: bool) -> Result<Target, ForceError> {
        let way = if grows { self.depth.0 } else { -self.depth.0 };
        Ok(Target {
            weight: place.weight,
            begins: place.along,
            ..Target::single(Path::through([place.at, place.at + way * place.normal])?, grows)
        })
    }
}
