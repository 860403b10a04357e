use std::sync::Arc;

use bspline::primitives::{Capsule, Cuboid, Cylinder, PrimitiveError, Sphere, Torus};
use bspline::{Aabb, Field};
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::number::{Point, Positive};

/// A solid about its centre. Lengths are those of the world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Shape {
    /// A ball.
    Sphere {
        /// Its radius.
        radius: Positive,
    },
    /// A box along the axes of the world.
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
}

impl Shape {
    /// Distances, positive inside, that together make the tool on its way, and a box about them.
    pub(super) fn solids(&self, places: &[DVec3]) -> Result<(Vec<Arc<dyn Field>>, Aabb), String> {
        if places.is_empty() {
            return Err("along has no place; write at least one point".into());
        }
        let mut solids = Vec::new();
        let mut put = |solid: Result<Arc<dyn Field>, PrimitiveError>| {
            solids.push(solid.map_err(|e| e.to_string())?);
            Ok::<_, String>(())
        };
        let reach = match self {
            Self::Sphere { radius } => {
                let mut last: Option<DVec3> = None;
                for &at in places {
                    put(match last.replace(at).filter(|from| *from != at) {
                        Some(from) => Capsule::new(from, at, radius.0).map(shared),
                        None => Sphere::new(at, radius.0).map(shared),
                    })?;
                }
                DVec3::splat(radius.0)
            }
            Self::Box { size } => {
                let half = 0.5 * DVec3::from_array(size.map(|s| s.0));
                places
                    .iter()
                    .try_for_each(|&at| put(Cuboid::new(at, half).map(shared)))?;
                half
            }
            Self::Cylinder { axis, radius, height } => {
                let half = half_of(axis, height)?;
                for &at in places {
                    put(Cylinder::new(at - half, at + half, radius.0).map(shared))?;
                }
                half.abs() + radius.0
            }
            Self::Capsule { axis, radius, height } => {
                let half = half_of(axis, height)?;
                for &at in places {
                    put(Capsule::new(at - half, at + half, radius.0).map(shared))?;
                }
                half.abs() + radius.0
            }
            Self::Torus { axis, major, minor } => {
                for &at in places {
                    put(Torus::new(at, axis.0, major.0, minor.0).map(shared))?;
                }
                DVec3::splat(major.0 + minor.0)
            }
        };
        let low = places.iter().copied().reduce(DVec3::min).expect("a place") - reach;
        let high = places.iter().copied().reduce(DVec3::max).expect("a place") + reach;
        match low.is_finite() && high.is_finite() {
            true => Ok((solids, Aabb::new(low, high))),
            false => Err("the tool reaches beyond all numbers; make it smaller".into()),
        }
    }
}

fn shared<F: Field + 'static>(solid: F) -> Arc<dyn Field> {
    Arc::new(solid)
}

fn half_of(axis: &Point, height: &Positive) -> Result<DVec3, String> {
    let direction = axis.0.try_normalize().ok_or_else(|| {
        format!(
            "axis {:?} gives no direction; write one that is not zero",
            axis.0.to_array()
        )
    })?;
    Ok(direction * (0.5 * height.0))
}
