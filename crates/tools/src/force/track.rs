use bspline::{Field, HierarchicalSpline, Real};
use glam::DVec3;

use super::ForceError;
use super::path::{Path, nearest_surface};

/// Paths per radius of a tool, along a curve and across an area.
pub const DENSITY: f64 = 2.0;
/// Radii in which a place has to have the surface.
const NEAR: f64 = 4.0;
/// Radii that a free end of a curve, or the rim of an area, stands for beside its share.
pub(super) const OPEN: f64 = 0.5;
/// Cosine of the turn from which on a curve has a corner.
const CORNER: f64 = 0.9;
/// Most paths of a tool.
pub(super) const MOST: f64 = 20_000.0;

/// A place of a tool on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    pub at: DVec3,
    /// Out of the solid, unit.
    pub normal: DVec3,
    pub weight: f64,
    /// Arc length along the track.
    pub along: f64,
}

/// The surface nearest to a place.
pub fn grabbed<T: Real>(
    field: &HierarchicalSpline<T>,
    iso: f64,
    p: DVec3,
    radius: f64,
) -> Result<(DVec3, DVec3), ForceError> {
    within(field, p)?;
    let at = nearest_surface(field, iso, p, NEAR * radius)?;
    let (_, gradient) = field.value_gradient(at);
    let normal = (-gradient).try_normalize();
    normal.map(|n| (at, n)).ok_or(ForceError::Nowhere {
        at: p.to_array(),
        reach: NEAR * radius,
    })
}

/// Refuses places beside the field.
pub fn within<T: Real>(field: &HierarchicalSpline<T>, p: DVec3) -> Result<(), ForceError> {
    let q = field.lattice_from_world().transform_point3(p);
    if q.cmpge(DVec3::ZERO).all() && q.cmple(field.lattice().extent()).all() {
        return Ok(());
    }
    let whole = field.lattice().world_box();
    Err(ForceError::Outside {
        at: p.to_array(),
        field: [whole.min.to_array(), whole.max.to_array()],
    })
}

/// Places along a polyline, half a radius apart at most, each drawn to the surface; of a single point that one.
pub fn along<T: Real>(
    field: &HierarchicalSpline<T>,
    iso: f64,
    points: &[DVec3],
    radius: f64,
) -> Result<Vec<Place>, ForceError> {
    let first = *points
        .first()
        .ok_or_else(|| ForceError::tool("along has no place; write at least one point"))?;
    let place = |p: DVec3, weight, along| {
        let (at, normal) = grabbed(field, iso, p, radius)?;
        Ok(Place {
            at,
            normal,
            weight,
            along,
        })
    };
    if points.iter().all(|p| *p == first) {
        return Ok(vec![place(first, 1.0, 0.0)?]);
    }
    let path = Path::through(points.iter().copied())?;
    // Corners get places of their own.
    let ends: Vec<f64> = path.corners(CORNER).collect();
    let mut stops = vec![0.0];
    for (from, to) in std::iter::once(0.0)
        .chain(ends.iter().copied())
        .zip(ends.iter().copied().chain([path.length()]))
    {
        let count = (DENSITY * (to - from) / radius).ceil();
        few(stops.len() as f64 + count)?;
        stops.extend((1..=count as usize).map(|i| from + (to - from) * i as f64 / count));
    }
    let last = stops.len() - 1;
    (0..=last)
        .map(|i| {
            let width = 0.5 * (stops[(i + 1).min(last)] - stops[i.saturating_sub(1)]);
            let open = if i == 0 || i == last { OPEN * radius } else { 0.0 };
            place(path.at(stops[i]), width + open, stops[i])
        })
        .collect()
}

/// Places on rings about the middle of a disc that touches the surface, the last on its rim, each drawn to the surface.
pub fn disc<T: Real>(
    field: &HierarchicalSpline<T>,
    iso: f64,
    middle: DVec3,
    size: f64,
    radius: f64,
) -> Result<Vec<Place>, ForceError> {
    use std::f64::consts::{PI, TAU};
    let (at, normal) = grabbed(field, iso, middle, radius)?;
    let (u, v) = normal.any_orthonormal_pair();
    let rings = (DENSITY * size / radius).ceil();
    few(PI * rings * rings)?;
    let width = size / rings;
    let mut places = vec![Place {
        at,
        normal,
        weight: PI * (0.5 * width).powi(2),
        along: 0.0,
    }];
    for ring in 1..=rings as usize {
        let r = ring as f64 * width;
        let count = (TAU * r * DENSITY / radius).ceil().max(6.0);
        let is_rim = ring == rings as usize;
        let outer = if is_rim { r } else { r + 0.5 * width };
        let open = if is_rim { OPEN * radius * TAU * r } else { 0.0 };
        let area = PI * (outer.powi(2) - (r - 0.5 * width).powi(2)) + open;
        for i in 0..count as usize {
            let angle = TAU * i as f64 / count;
            let p = at + r * (libm::cos(angle) * u + libm::sin(angle) * v);
            let (at, normal) = grabbed(field, iso, p, radius)?;
            places.push(Place {
                at,
                normal,
                weight: area / count,
                along: 0.0,
            });
        }
    }
    Ok(places)
}

fn few(count: f64) -> Result<(), ForceError> {
    match count <= MOST {
        true => Ok(()),
        false => Err(ForceError::tool(format!(
            "the tool would have {count:.0} paths, half a radius apart; make it smaller or its radius larger"
        ))),
    }
}
