use bspline::{Field, HierarchicalSpline, Real};
use glam::DVec3;

use super::ForceError;
use super::path::{Path, nearest_surface};
use crate::curve::Along;

/// Paths per radius of a tool, along a curve and across an area.
pub const DENSITY: f64 = 2.0;
/// Radii in which a place has to have the surface.
const NEAR: f64 = 4.0;
/// Radii that a free end of a curve, or the rim of an area, stands for beside its share.
pub const OPEN: f64 = 0.5;
/// Cosine of the turn from which on a curve has a corner.
pub(super) const CORNER: f64 = 0.9;
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

/// Places along curves, half a radius apart at most, each drawn to the surface; of single points these.
pub fn along<T: Real>(
    field: &HierarchicalSpline<T>,
    iso: f64,
    along: &Along,
    radius: f64,
) -> Result<Vec<Place>, ForceError> {
    let lines = along.lines(&field.lattice().world_box());
    let (mut places, mut gone) = (Vec::new(), 0.0);
    for line in lines.map_err(ForceError::Tool)? {
        let (stops, length) = stops(&line, radius)?;
        few(places.len() as f64 + stops.len() as f64)?;
        for stop in stops {
            let (at, normal) = grabbed(field, iso, stop.at, radius)?;
            places.push(Place {
                at,
                normal,
                weight: stop.weight,
                along: gone + stop.along,
            });
        }
        gone += length;
    }
    Ok(places)
}

/// A place of a line, before it is drawn to the surface.
pub struct Stop {
    pub at: DVec3,
    /// Length that it stands for.
    pub weight: f64,
    /// Arc length.
    pub along: f64,
}

/// Places along a polyline, half a radius apart at most, and its length; one that ends where it begins is closed.
pub fn stops(line: &[DVec3], radius: f64) -> Result<(Vec<Stop>, f64), ForceError> {
    if line.iter().all(|p| *p == line[0]) {
        let only = Stop {
            at: line[0],
            weight: 1.0,
            along: 0.0,
        };
        return Ok((vec![only], 0.0));
    }
    let path = Path::through(line.iter().copied())?;
    let length = path.length();
    let is_closed = line.len() > 3 && line[0] == line[line.len() - 1];
    // Corners get places of their own.
    let corners: Vec<(f64, f64)> = path.corners(CORNER).collect();
    let mut stops = vec![(0.0, 1.0)];
    let mut from = 0.0;
    let end = if is_closed {
        path.direction(0.0).dot(path.direction(length))
    } else {
        1.0
    };
    for (to, turn) in corners.into_iter().chain([(length, end)]) {
        let count = (DENSITY * (to - from) / radius).ceil();
        few(stops.len() as f64 + count)?;
        stops.extend((1..=count as usize).map(|i| (from + (to - from) * i as f64 / count, 1.0)));
        let last = stops.len() - 1;
        stops[last].1 = turn;
        from = to;
    }
    stops[0].1 = end;
    let (stops, turns): (Vec<f64>, Vec<f64>) = stops.into_iter().unzip();
    let last = stops.len() - 1;
    let stop = |i: usize| {
        let width = 0.5 * (stops[(i + 1).min(last)] - stops[i.saturating_sub(1)]);
        let beside = match (is_closed, i) {
            (true, 0) => 0.5 * (stops[last] - stops[last - 1]),
            (false, i) if i == 0 || i == last => OPEN * radius,
            _ => 0.0,
        };
        Stop {
            at: path.at(stops[i]),
            // One that turns back on itself is two ends.
            weight: width + beside + OPEN * radius * (1.0 - turns[i]),
            along: stops[i],
        }
    };
    let count = if is_closed { last } else { last + 1 };
    Ok(((0..count).map(stop).collect(), length))
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

pub fn few(count: f64) -> Result<(), ForceError> {
    match count <= MOST {
        true => Ok(()),
        false => Err(ForceError::tool(format!(
            "the tool would have {count:.0} paths, half a radius apart; make it smaller or its radius larger"
        ))),
    }
}
