use std::sync::Arc;

use bspline::primitives::{Capsule, Cuboid, Cylinder, Primitive, PrimitiveError, Sphere, Torus};
use bspline::{Aabb, Csg, Field};
use glam::{DAffine3, DQuat, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use super::chain::{Leg, Rival};
use super::swept::{Pose, Search, Swept};
use crate::formula_solid::FormulaSolid;
use crate::number::{Point, Positive};
use crate::others::Others;

/// A solid about its centre. Lengths are those of the world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Shape {
    /// A ball.
    Sphere {
        /// Its radius.
        radius: Positive,
    },
    /// A box along the axes.
    Box {
        /// Its edges.
        size: [Positive; 3],
    },
    /// A cylinder.
    Cylinder {
        /// Direction of its axis; any length.
        axis: Point,
        /// Its radius.
        radius: Positive,
        /// From one end to the other.
        height: Positive,
    },
    /// A cylinder whose ends are half balls.
    Capsule {
        /// Direction of its axis; any length.
        axis: Point,
        /// Its radius.
        radius: Positive,
        /// From the centre of one half ball to that of the other.
        height: Positive,
    },
    /// A ring.
    Torus {
        /// Direction of its axis; any length.
        axis: Point,
        /// From the centre to that of the tube.
        major: Positive,
        /// Radius of the tube.
        minor: Positive,
    },
    /// Where a formula of `x`, `y` and `z`, 0 in its middle, is above 0.
    Formula {
        /// As scenes write them.
        text: String,
        /// Edges of the box about the middle in which it counts.
        size: [Positive; 3],
    },
    /// Another object; its middle is that of its field's box.
    Object {
        /// Its name.
        name: String,
    },
}

/// Distances, positive inside, that together make a tool on its way, and a box about them.
pub(super) type Solids = (Vec<Arc<dyn Field>>, Aabb);

/// A shape about the origin.
enum Kind {
    /// One whose distance is known, so that it can sweep; within this of the origin.
    Known(Primitive, f64),
    /// Any field, in a box.
    Any(Arc<dyn Field>, Aabb),
}

impl Shape {
    /// Radius of the smallest ball that touches opposite sides of it.
    pub(super) fn feature(&self) -> f64 {
        match self {
            Self::Sphere { radius } | Self::Capsule { radius, .. } => radius.0,
            Self::Box { size } | Self::Formula { size, .. } => {
                0.5 * size.iter().fold(f64::INFINITY, |least, edge| least.min(edge.0))
            }
            Self::Cylinder { radius, height, .. } => radius.0.min(0.5 * height.0),
            Self::Torus { minor, .. } => minor.0,
            // Of these nobody knows.
            Self::Object { .. } => f64::INFINITY,
        }
    }

    /// The tool on its way from pose to pose, or at each of them alone.
    pub(super) fn solids(&self, poses: &[Pose], is_each: bool, others: &Others) -> Result<Solids, String> {
        let (solid, size) = match self.kind(others)? {
            Kind::Known(solid, size) => (solid, size),
            Kind::Any(field, b) => return at_places(&field, &b, poses, is_each),
        };
        let (Some(first), Some(last)) = (poses.first(), poses.last()) else {
            return Err("along has no place; write at least one point".into());
        };
        let mut solids: Vec<Arc<dyn Field>> = Vec::new();
        let legs = poses.windows(2).filter(|leg| leg[0] != leg[1]);
        if is_each || first == last && legs.clone().next().is_none() {
            for pose in poses {
                solids.push(placed(&solid, pose)?);
            }
        } else {
            for leg in legs {
                solids.push(self.leg(&solid, size, [leg[0], leg[1]])?);
            }
        }
        // A box that is never turned reaches no further than its faces.
        let half = match self {
            Self::Box { size } if poses.iter().all(|pose| pose.turn == DQuat::IDENTITY) => {
                0.5 * DVec3::from_array(size.map(|s| s.0))
            }
            _ => DVec3::splat(size),
        };
        let ends = poses.iter().flat_map(|pose| [pose.at - half, pose.at + half]);
        let reach = Aabb::about(ends).expect("a place");
        match reach.min.is_finite() && reach.max.is_finite() {
            true => Ok((solids, reach)),
            false => Err("the tool reaches beyond all numbers; make it smaller".into()),
        }
    }

    /// A solid whose distance is known between two poses.
    fn leg(&self, solid: &Primitive, size: f64, [from, to]: [Pose; 2]) -> Result<Arc<dyn Rival>, String> {
        Ok(match self {
            // However it is turned, a ball is a ball.
            Self::Sphere { radius } if from.at == to.at => {
                let ball: Primitive = Sphere::new(from.at, radius.0).map_err(|e| e.to_string())?.into();
                Arc::new(ball)
            }
            Self::Sphere { radius } => {
                Arc::new(Capsule::new(from.at, to.at, radius.0).map_err(|e| e.to_string())?)
            }
            _ => {
                let search = Search::Distance {
                    is_convex: !matches!(solid, Primitive::Torus(_)),
                };
                Arc::new(Swept::new(Arc::new(solid.clone()), size, [from, to], search))
            }
        })
    }

    /// The solid on its way from pose to pose, leg by leg, and the radius of a ball that holds it. Formulas sweep too.
    pub(super) fn legs(&self, poses: &[Pose]) -> Result<(Vec<Leg>, f64), String> {
        if let Self::Object { name } = self {
            return Err(format!(
                "the object {name:?} does not sweep; add or carve it at places, or sweep a formula"
            ));
        }
        let kind = self.kind(&Others::default())?;
        let leg = |from: Pose, to: Pose| {
            let solid: Arc<dyn Rival> = match &kind {
                Kind::Known(solid, size) => self.leg(solid, *size, [from, to])?,
                Kind::Any(field, b) => {
                    let size = 0.5 * b.size().length();
                    Arc::new(Swept::new(field.clone(), size, [from, to], Search::Any))
                }
            };
            Ok(Leg {
                from: from.at,
                to: to.at,
                solid,
            })
        };
        let pairs = poses.windows(2).filter(|pair| pair[0] != pair[1]);
        let mut legs = pairs
            .map(|pair| leg(pair[0], pair[1]))
            .collect::<Result<Vec<_>, String>>()?;
        if legs.is_empty() {
            legs.push(leg(poses[0], poses[0])?);
        }
        let size = match &kind {
            Kind::Known(_, size) => *size,
            Kind::Any(_, b) => 0.5 * b.size().length(),
        };
        Ok((legs, size))
    }

    fn kind(&self, others: &Others) -> Result<Kind, String> {
        match self {
            Self::Formula { text, size } => {
                let half = 0.5 * DVec3::from_array(size.map(|s| s.0));
                let b = Aabb::new(-half, half);
                let limit = Cuboid::new(DVec3::ZERO, half).map_err(|e| e.to_string())?;
                let formula = FormulaSolid::new(text, &b)?;
                let both = Csg::intersection(vec![Arc::new(formula), Arc::new(limit)]);
                Ok(Kind::Any(Arc::new(both.map_err(|e| e.to_string())?), b))
            }
            Self::Object { name } => {
                let (field, b) = others.get(name)?;
                let center = b.center();
                let moved = Csg::affine(field, DAffine3::from_translation(-center));
                let own = Aabb::new(b.min - center, b.max - center);
                Ok(Kind::Any(Arc::new(moved.map_err(|e| e.to_string())?), own))
            }
            _ => {
                let (solid, size) = self.known().map_err(|e| e.to_string())?;
                Ok(Kind::Known(solid, size))
            }
        }
    }

    /// The solid about the origin, and the radius of a ball that holds it.
    ///
    /// # Panics
    /// For formulas and objects.
    fn known(&self) -> Result<(Primitive, f64), PrimitiveError> {
        let ends = |axis: &Point, height: &Positive| {
            let half = direction(axis)? * (0.5 * height.0);
            Ok((-half, half))
        };
        Ok(match self {
            Self::Sphere { radius } => (Sphere::new(DVec3::ZERO, radius.0)?.into(), radius.0),
            Self::Box { size } => {
                let half = 0.5 * DVec3::from_array(size.map(|s| s.0));
                (Cuboid::new(DVec3::ZERO, half)?.into(), half.length())
            }
            Self::Cylinder { axis, radius, height } => {
                let (from, to) = ends(axis, height)?;
                let size = DVec2::new(0.5 * height.0, radius.0).length();
                (Cylinder::new(from, to, radius.0)?.into(), size)
            }
            Self::Capsule { axis, radius, height } => {
                let (from, to) = ends(axis, height)?;
                (
                    Capsule::new(from, to, radius.0)?.into(),
                    0.5 * height.0 + radius.0,
                )
            }
            Self::Torus { axis, major, minor } => {
                let ring = Torus::new(DVec3::ZERO, axis.0, major.0, minor.0)?;
                (ring.into(), major.0 + minor.0)
            }
            Self::Formula { .. } | Self::Object { .. } => unreachable!("they are no primitives"),
        })
    }
}

fn placed(solid: &Primitive, pose: &Pose) -> Result<Arc<dyn Field>, String> {
    let placed = Csg::affine(Arc::new(solid.clone()), pose.map()).map_err(|e| e.to_string())?;
    Ok(Arc::new(placed))
}

/// Any field at places, each alone.
fn at_places(field: &Arc<dyn Field>, b: &Aabb, poses: &[Pose], is_each: bool) -> Result<Solids, String> {
    if poses.len() > 1 && !is_each {
        return Err("formulas and objects do not sweep here; write each = true, or one place, or use sweep for a formula".into());
    }
    let mut reach: Option<Aabb> = None;
    let mut solids: Vec<Arc<dyn Field>> = Vec::new();
    for pose in poses {
        let placed = Csg::affine(field.clone(), pose.map()).map_err(|e| e.to_string())?;
        solids.push(Arc::new(placed));
        let own = b.transformed(&pose.map());
        reach = Some(reach.map_or(own, |r| r.hull(own)));
    }
    let reach = reach.ok_or("along has no place; write at least one point")?;
    Ok((solids, reach))
}

fn direction(axis: &Point) -> Result<DVec3, PrimitiveError> {
    axis.0.try_normalize().ok_or_else(|| PrimitiveError::NoDirection {
        name: "axis",
        length: axis.0.length(),
    })
}
