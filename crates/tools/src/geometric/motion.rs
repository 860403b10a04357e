//! Moves: the solid carried along by a motion of space.

use std::sync::Arc;

use bspline::primitives::HalfSpace;
use bspline::{Aabb, Csg, HierarchicalSpline, Real};
use fitting::Control;
use fitting::field::FieldFitReport;
use glam::{DAffine3, DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::GeometricError;
use super::write::{Fineness, Writer};
use crate::limits::{Limits, Region};
use crate::mix::{Faded, Mixed};
use crate::number::{Finite, NonNegative, Point, Positive};
use crate::warp::{Warp, WarpError, Warped};

/// A motion and how closely it is followed. Angles are degrees, lengths those of the world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Move {
    /// Where everything goes.
    pub motion: Motion,
    /// As for [`Geometric`](super::Geometric).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<Positive>,
    /// As for [`Geometric`](super::Geometric).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finer: Option<u8>,
}

/// Where everything goes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Motion {
    /// A hand takes hold and goes along a path.
    Grab {
        /// Places of the hand.
        along: Vec<Point>,
        /// What lies further from the hand stays; what lies nearer comes along in part.
        radius: Positive,
        /// What lies nearer than this comes along whole; 0 if missing.
        #[serde(default)]
        rigid: NonNegative,
    },
    /// One side is turned about a hinge.
    Bend {
        /// Middle of the hinge.
        at: Point,
        /// Direction of the hinge's pin; it turns anticlockwise as seen from its tip.
        axis: Point,
        /// To the side that turns.
        direction: Point,
        /// By how much.
        angle: Finite,
        /// Length over which the bend is spread.
        length: Positive,
    },
    /// One side, or a ball, is turned about an axis through it.
    Twist {
        /// Where it begins; middle of the ball.
        at: Point,
        /// To the side that turns; anticlockwise as seen from its tip.
        axis: Point,
        /// By how much.
        angle: Finite,
        /// Length along the axis over which the twist grows.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        length: Option<Positive>,
        /// Instead: radius of the ball beyond which nothing turns.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        radius: Option<Positive>,
    },
    /// A box is carried to another place.
    Shift {
        /// What is carried whole.
        region: Region,
        /// By how much.
        by: Point,
        /// What lies within this of the box comes along in part.
        blend: Positive,
    },
    /// One side becomes the mirror image of the other.
    Mirror {
        /// A place on the mirror.
        at: Point,
        /// To the side that is copied.
        normal: Point,
        /// Width over which the two are blended; two of the finest knot intervals if missing.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        blend: Option<Positive>,
    },
}

impl Move {
    /// What the motion leaves of a field whose surface lies at `iso`, and how close it is.
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
        let writer = Writer { field, iso, limits };
        let fineness = Fineness {
            tolerance: self.tolerance,
            finer: self.finer,
            feature: None,
            densities: Some(1.0),
        };
        if let Motion::Mirror { at, normal, blend } = &self.motion {
            return mirrored(&writer, at.0, normal.0, *blend, &fineness, control);
        }
        let warp = self.motion.warp(&field.lattice().world_box())?;
        let within = writer.within(&warp.reach())?;
        let warped = Warped::new(Arc::new(field.clone()), warp);
        writer.written(&warped, &within, &fineness, control)
    }
}

/// Where what is now at a place came from by a motion.
#[derive(Clone, Debug)]
pub enum Origin {
    /// Through a motion of space.
    Warp(Warp),
    /// From the other side of a mirror.
    Mirror {
        /// The reflection.
        map: DAffine3,
        /// A place on the mirror.
        at: DVec3,
        /// To the side that is copied.
        normal: DVec3,
    },
}

impl Origin {
    /// The place that what is now at `p` came from; `p` to the bit where nothing moved.
    pub fn back(&self, p: DVec3) -> DVec3 {
        match self {
            Self::Warp(warp) => warp.back(p),
            Self::Mirror { map, at, normal } => match (p - at).dot(*normal) < 0.0 {
                true => map.transform_point3(p),
                false => p,
            },
        }
    }

    /// The place where what was at `p` is now; of a mirror `p`, since its other side is covered by the copy.
    pub fn forth(&self, p: DVec3) -> DVec3 {
        match self {
            Self::Warp(warp) => warp.forth(p),
            Self::Mirror { .. } => p,
        }
    }

    /// A box outside which nothing moves; infinite where a motion has no end.
    pub fn reach(&self) -> Aabb {
        match self {
            Self::Warp(warp) => warp.reach(),
            Self::Mirror { .. } => Aabb {
                min: DVec3::NEG_INFINITY,
                max: DVec3::INFINITY,
            },
        }
    }
}

impl Motion {
    /// Where all that lies in a box comes from.
    ///
    /// # Errors
    /// Any [`GeometricError`] of the motion.
    pub fn origin(&self, within: &Aabb) -> Result<Origin, GeometricError> {
        Ok(match self {
            Self::Mirror { at, normal, .. } => Origin::Mirror {
                map: reflection(at.0, normal.0)?,
                at: at.0,
                normal: normal.0,
            },
            _ => Origin::Warp(self.warp(within)?),
        })
    }

    /// The motion of all that lies in a box.
    ///
    /// # Errors
    /// [`WarpError`]; a mirror is none.
    pub fn warp(&self, within: &Aabb) -> Result<Warp, WarpError> {
        match self {
            Self::Grab { along, radius, rigid } => {
                let along: Vec<_> = along.iter().map(|p| p.0).collect();
                Warp::grab(&along, rigid.0, radius.0)
            }
            Self::Bend {
                at,
                axis,
                direction,
                angle,
                length,
            } => Warp::bend(at.0, axis.0, direction.0, angle.0.to_radians(), length.0, within),
            Self::Twist {
                at,
                axis,
                angle,
                length,
                radius,
            } => match (length, radius) {
                (Some(length), None) => Warp::twist(at.0, axis.0, angle.0.to_radians(), length.0),
                (None, Some(radius)) => Warp::swirl(at.0, axis.0, angle.0.to_radians(), radius.0),
                _ => Err(WarpError::new(
                    "a twist takes a length along its axis or the radius of a ball: exactly one of them",
                )),
            },
            Self::Shift { region, by, blend } => {
                let region = region.aabb().map_err(WarpError::new)?;
                Warp::shift(&region, by.0, blend.0)
            }
            Self::Mirror { .. } => Err(WarpError::new("a mirror is no motion")),
        }
    }
}

/// The field with the side of a plane that `normal` points to copied to the other.
fn mirrored<T: Real>(
    writer: &Writer<T>,
    at: DVec3,
    normal: DVec3,
    blend: Option<Positive>,
    fineness: &Fineness,
    control: &mut Control,
) -> Result<(HierarchicalSpline<T>, FieldFitReport), GeometricError> {
    let map = reflection(at, normal)?;
    let field = writer.field;
    let other = Csg::affine(Arc::new(field.clone()), map).map_err(GeometricError::shape)?;
    let width = blend.map_or(2.0 * writer.spacing(), |b| b.0);
    let behind = HalfSpace::new(at, normal).map_err(GeometricError::shape)?;
    let weight = Faded::new(Arc::new(behind), -0.5 * width, 0.5 * width);
    let mixed = Mixed {
        from: field,
        to: &other,
        weight: &weight,
    };
    let whole = field.lattice().world_box();
    let within = writer.within(&part_behind(&whole, at, normal, width))?;
    writer.written(&mixed, &within, fineness, control)
}

/// A box about the part of `b` behind a plane, or up to `margin` before it.
fn part_behind(b: &Aabb, at: DVec3, normal: DVec3, margin: f64) -> Aabb {
    let n = normal.normalize_or_zero();
    // Only along an axis a plane cuts a box off.
    let axis = n.abs().max_position();
    let mut part = *b;
    if 1.0 - n[axis].abs() < 1e-12 {
        match n[axis] > 0.0 {
            true => part.max[axis] = (at[axis] + margin).clamp(b.min[axis], b.max[axis]),
            false => part.min[axis] = (at[axis] - margin).clamp(b.min[axis], b.max[axis]),
        }
    }
    part
}

/// The reflection in a plane.
///
/// # Errors
/// [`GeometricError::Shape`] for a normal without direction.
pub fn reflection(at: DVec3, normal: DVec3) -> Result<DAffine3, GeometricError> {
    let n = normal.try_normalize().ok_or_else(|| {
        let normal = normal.to_array();
        GeometricError::Shape(format!(
            "normal {normal:?} gives no direction; write one that is not zero"
        ))
    })?;
    let matrix = DMat3::IDENTITY - DMat3::from_cols(n * n.x, n * n.y, n * n.z) * 2.0;
    Ok(DAffine3::from_mat3_translation(matrix, n * (2.0 * n.dot(at))))
}
