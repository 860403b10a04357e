use bspline::HierarchicalSpline;
use glam::DVec3;

use super::{StudyError, walk};
use crate::curve::Along;
use crate::force::{Chisel, ForceStroke, Pull};
use crate::number::{Finite, Point, Positive};

/// Which tool makes a stroke.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StrokeKind {
    /// One path.
    Point,
    /// A curve of six radii.
    Curve,
    /// A disc of two radii.
    Area,
    /// A tool that moves along sixteen radii: its region follows.
    Track,
}

impl StrokeKind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Point, Self::Curve, Self::Area, Self::Track];

    /// Name in charts.
    pub fn name(self) -> &'static str {
        match self {
            Self::Point => "point",
            Self::Curve => "curve",
            Self::Area => "area",
            Self::Track => "moving",
        }
    }

    /// Radii that it drags the surface.
    pub fn drag(self) -> f64 {
        if self == Self::Track { 0.8 } else { 1.6 }
    }

    /// A stroke that begins at a place of the surface, out of the solid or into it.
    ///
    /// # Errors
    /// [`StudyError::Force`].
    pub fn begin(
        self,
        field: &HierarchicalSpline<f32>,
        iso: f64,
        at: DVec3,
        radius: f64,
        is_out: bool,
    ) -> Result<ForceStroke<f32>, StudyError> {
        let walk = |length: f64| walk(field, iso, at, length * radius, 0.5 * radius);
        let (drag, r) = (self.drag() * radius, Positive(radius));
        if self == Self::Track {
            let chisel = Chisel {
                along: Along::Points(walk(16.0)?),
                depth: Positive(drag),
                radius: r,
                how: Default::default(),
            };
            return Ok(chisel.begin(field, iso, is_out)?);
        }
        let pull = Pull {
            along: Along::Points(match self {
                Self::Curve => walk(6.0)?,
                _ => vec![Point(at)],
            }),
            area: None,
            disc: (self == Self::Area).then_some(Positive(2.0 * radius)),
            by: None,
            way: None,
            lift: Some(Finite(if is_out { drag } else { -drag })),
            radius: r,
            how: Default::default(),
        };
        Ok(pull.begin(field, iso)?)
    }
}
