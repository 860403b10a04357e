use std::sync::Arc;

use bspline::primitives::{Capsule, Sphere};
use bspline::{Aabb, Csg, Field};
use glam::DVec3;

use super::GeometricError;
use crate::mix::Faded;
use crate::number::Point;

/// Share of the radius of a brush within which it acts with all its strength.
pub(super) const FULL: f64 = 0.5;

/// What a round brush covers on its way: 1 within half its radius, 0 beyond it; and a box about it.
///
/// # Errors
/// [`GeometricError::Shape`] for a way without a place.
pub(crate) fn band(along: &[Point], radius: f64) -> Result<(Faded, Aabb), GeometricError> {
    let places: Vec<DVec3> = along.iter().map(|p| p.0).collect();
    let Some(&first) = places.first() else {
        let why = "along has no place; write at least one point";
        return Err(GeometricError::Shape(why.into()));
    };
    let mut solids: Vec<Arc<dyn Field>> = Vec::new();
    for leg in places.windows(2).filter(|leg| leg[0] != leg[1]) {
        let leg = Capsule::new(leg[0], leg[1], radius).map_err(GeometricError::shape)?;
        solids.push(Arc::new(leg));
    }
    if solids.is_empty() {
        solids.push(Arc::new(
            Sphere::new(first, radius).map_err(GeometricError::shape)?,
        ));
    }
    let cover = Csg::union(solids).map_err(GeometricError::shape)?;
    let reach = Aabb::about(places).expect("a place").widened(radius);
    Ok((Faded::new(Arc::new(cover), 0.0, (1.0 - FULL) * radius), reach))
}
