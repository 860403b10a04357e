//! Solids that carve a field or are added to it.
//!
//! The tool and the field become one by CSG \[Hua04 eqs. 3, 4\], `max(f, g)` to add and `min(f, 2c − g)` to carve, and the result
//! is written back into the coefficients that it touches by [`fitting::field::fit_field`]. A distance `d` of the tool counts as `c + d·|∇f|`, so
//! that depths and blends are lengths on any field.

mod band;
mod block;
mod chain;
mod detail;
mod inflate;
mod mean;
mod motion;
mod moved;
mod paste;
mod push;
mod shape;
mod smooth;
mod sweep;
mod swept;
mod write;

use std::sync::Arc;

use bspline::csg::Rounding;
use bspline::{Aabb, Csg, Field, HierarchicalSpline, Real};
use fitting::field::FieldFitReport;
use fitting::{Control, FitError};
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

pub(crate) use band::band;
pub use block::block;
pub(crate) use block::{ROOM, check_lengths, rounded};
pub use detail::{Refine, Simplify};
pub use inflate::Inflate;
pub use motion::{Motion, Move, Origin, reflection};
pub use paste::{Copy, Cut, Paste};
pub use push::Push;
pub use shape::Shape;
pub use smooth::Smooth;
pub use sweep::Sweep;
use swept::Pose;
pub use write::TOLERANCE;
pub(crate) use write::affordable;
use write::{Fineness, Writer};

use crate::face::Face;
use crate::limits::Limits;
use crate::number::{NonNegative, Point, Positive};
use crate::others::Others;
use crate::warp::WarpError;

/// What a geometric tool does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Operation {
    /// Takes the tool out of the solid.
    Carve,
    /// Adds the tool to the solid.
    Add,
}

/// A geometric tool and its way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Geometric {
    /// The solid.
    pub shape: Shape,
    /// Where its centre goes, in the world of the object: one place or more. It sweeps all between them.
    pub along: Vec<Point>,
    /// How it is turned at each place: the axis of the turn, as long as its angle in degrees. As it is if missing; one for
    /// all, or one a place.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub turn: Vec<Point>,
    /// Whether it acts at each place alone and sweeps nothing between.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub each: bool,
    /// Width over which the crease is rounded, a world length; 0 leaves it as sharp as the field can be.
    #[serde(default)]
    pub blend: NonNegative,
    /// Distance from the true surface that may stay off the creases, a world length; a fiftieth of the finest knot interval if
    /// missing.
    pub tolerance: Option<Positive>,
    /// Levels finer than the object's detail that may be added; if missing one, and as many more as show the thinnest part.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finer: Option<u8>,
}

/// Why a geometric tool cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum GeometricError {
    /// A value of the tool makes no solid.
    #[error("{0}")]
    Shape(String),
    /// The tool lies beside the field.
    #[error(
        "the tool reaches from {tool:?}, and the field from {field:?}; move the tool, or choose another object"
    )]
    Outside {
        /// Corners of the tool's box.
        tool: [[f64; 3]; 2],
        /// Corners of the field's box.
        field: [[f64; 3]; 2],
    },
    /// The tool lies beside the region that it is limited to.
    #[error(
        "the tool reaches from {tool:?}, and within lets it act from {region:?}; move the tool, or widen within"
    )]
    Beside {
        /// Corners of the tool's box.
        tool: [[f64; 3]; 2],
        /// Corners of what is left of the field's box.
        region: [[f64; 3]; 2],
    },
    /// The solid would be cut off.
    #[error(
        "the solid would leave the box of its field at {at:?}, which cannot grow there: the solid is cut off at that face, or the \
         box would become too large; let the tool end before"
    )]
    Leaves {
        /// Where.
        at: [f64; 3],
        /// Through which face.
        face: Face,
    },
    /// A brush is far from the surface that it is to act on.
    #[error("no surface lies within {reach} of {at:?}; bring the brush to the surface, or take a wider one")]
    Nowhere {
        /// Where it is.
        at: [f64; 3],
        /// How far it looks.
        reach: f64,
    },
    /// A motion makes no sense.
    #[error(transparent)]
    Warp(#[from] WarpError),
    /// The result cannot be written back.
    #[error(transparent)]
    Fit(#[from] FitError),
}

impl GeometricError {
    pub(crate) fn shape(error: impl std::fmt::Display) -> Self {
        Self::Shape(error.to_string())
    }
}

impl Geometric {
    fn poses(&self) -> Result<Vec<Pose>, String> {
        let (places, turns) = (self.along.len(), self.turn.len());
        if turns > 1 && turns != places {
            return Err(format!(
                "there are {places} places and {turns} turns; write one turn for all, or one for each place"
            ));
        }
        let turn = |n: usize| {
            self.turn
                .get(n)
                .or(self.turn.first())
                .map_or(DVec3::ZERO, |t| t.0)
        };
        let places = self.along.iter().enumerate();
        let pose = |(n, at): (usize, &Point)| {
            Ok(Pose {
                at: at.0,
                turn: rotation_of(turn(n))?,
            })
        };
        places.map(pose).collect()
    }

    /// What the tool leaves of a field whose surface lies at `iso`, and how close it is.
    ///
    /// Beyond the tool's box, which ends a few knot intervals beside the tool and its blend, no coefficient changes.
    ///
    /// # Errors
    /// Any [`GeometricError`].
    pub fn apply<T: Real>(
        &self,
        operation: Operation,
        field: &HierarchicalSpline<T>,
        iso: f64,
        others: &Others,
        limits: &Limits,
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<T>, FieldFitReport), GeometricError> {
        let poses = self.poses().map_err(GeometricError::Shape)?;
        let solids = self.shape.solids(&poses, self.each, others);
        let (solids, reach) = solids.map_err(GeometricError::Shape)?;
        let fineness = Fineness {
            tolerance: self.tolerance,
            finer: self.finer,
            feature: Some(self.shape.feature()),
            densities: None,
        };
        let combined = Combined {
            operation,
            solids,
            reach,
            blend: self.blend.0,
        };
        combined.written(&Writer { field, iso, limits }, &fineness, control)
    }
}

/// Solids that are carved from a field or added to it.
struct Combined {
    operation: Operation,
    /// Distances, positive inside.
    solids: Vec<Arc<dyn Field>>,
    /// A box about them.
    reach: Aabb,
    /// Width of the rounded crease.
    blend: f64,
}

impl Combined {
    fn written<T: Real>(
        self,
        writer: &Writer<T>,
        fineness: &Fineness,
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<T>, FieldFitReport), GeometricError> {
        let Writer { field, iso, .. } = *writer;
        let reach = self.reach.widened(self.blend);
        let within = writer.within(&reach)?;
        if self.operation == Operation::Carve && field.bounds(&reach).hi < iso {
            // In air there is nothing to take away.
            return Ok((field.clone(), FieldFitReport::default()));
        }
        let slope = field.slope();
        let solid: Arc<dyn Field> = Arc::new(field.clone());
        let tools: Result<Vec<Arc<dyn Field>>, _> = self
            .solids
            .into_iter()
            .map(|tool| Csg::sum(vec![(slope, tool)], iso).map(|tool| Arc::new(tool) as Arc<dyn Field>))
            .collect();
        let tools = tools.map_err(GeometricError::shape)?;
        let rounding = Rounding::Bounded {
            range: self.blend * slope,
        };
        let target: Arc<dyn Field> = match (self.operation, self.blend > 0.0) {
            (Operation::Carve, false) => {
                Arc::new(Csg::difference(solid, tools, iso).map_err(GeometricError::shape)?)
            }
            (Operation::Carve, true) => {
                Csg::smooth_difference(solid, tools, rounding, iso).map_err(GeometricError::shape)?
            }
            (Operation::Add, is_smooth) => {
                let all = [vec![solid], tools].concat();
                match is_smooth {
                    false => Arc::new(Csg::union(all).map_err(GeometricError::shape)?),
                    true => Csg::smooth_union(all, rounding, iso).map_err(GeometricError::shape)?,
                }
            }
        };
        writer.written(&*target, &within, fineness, control)
    }
}

/// A turn given by its axis, as long as the angle in degrees.
///
/// # Errors
/// A sentence for an angle beyond all numbers.
pub(crate) fn rotation_of(turn: DVec3) -> Result<DQuat, String> {
    let angle = turn.length().to_radians();
    if !angle.is_finite() {
        return Err(format!(
            "the turn {:?} is too long to be an angle; write the axis as long as the angle in degrees",
            turn.to_array()
        ));
    }
    let axis = turn.normalize_or_zero();
    let (sine, cosine) = (libm::sin(0.5 * angle), libm::cos(0.5 * angle));
    Ok(DQuat::from_xyzw(
        axis.x * sine,
        axis.y * sine,
        axis.z * sine,
        cosine,
    ))
}
