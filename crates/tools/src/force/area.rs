//! Areas that a user outlines.

use std::collections::BTreeMap;

use bspline::{HierarchicalSpline, Real};
use glam::{DVec2, DVec3};

use super::ForceError;
use super::track::{DENSITY, OPEN, Place, few, grabbed, stops};
use crate::curve::Along;

/// Cells, on each axis, by which the share of a place in an area is counted.
const SHARES: f64 = 4.0;
/// Share of the distance of places within which inner ones keep off the rim.
const OFF: f64 = 0.6;
/// Radii over which the normals of an area are averaged, as a standard deviation, and beyond which a place counts no more.
const EVEN: f64 = 1.5;
const FAR: f64 = 4.5;

/// An outline seen along the normal of the plane that it lies in about.
pub struct Flat {
    middle: DVec3,
    axes: [DVec3; 2],
    /// Corners in order, each once.
    corners: Vec<DVec2>,
}

impl Flat {
    /// That of a line; the end is joined to the start.
    pub fn new(line: &[DVec3]) -> Result<Self, ForceError> {
        let mut corners = line.to_vec();
        corners.dedup();
        if corners.len() > 1 && corners.first() == corners.last() {
            corners.pop();
        }
        let middle = corners.iter().sum::<DVec3>() / corners.len().max(1) as f64;
        let next = |i: usize| corners[(i + 1) % corners.len()] - middle;
        let normal: DVec3 = (0..corners.len())
            .map(|i| (corners[i] - middle).cross(next(i)))
            .sum();
        let size = corners.iter().fold(0.0_f64, |m, p| m.max(p.distance(middle)));
        // Twice the area.
        if corners.len() < 3 || normal.length() <= 1e-6 * size * size {
            return Err(ForceError::tool(
                "the outline of the area encloses nothing; write three points or more, round about it",
            ));
        }
        let (u, v) = normal.normalize().any_orthonormal_pair();
        let flat = |p: &DVec3| DVec2::new((*p - middle).dot(u), (*p - middle).dot(v));
        let found = Self {
            corners: corners.iter().map(flat).collect(),
            middle,
            axes: [u, v],
        };
        match found.crosses_itself() {
            true => Err(ForceError::tool(
                "the outline of the area crosses itself; draw it once round",
            )),
            false => Ok(found),
        }
    }

    fn sides(&self) -> impl Iterator<Item = [DVec2; 2]> + '_ {
        let n = self.corners.len();
        (0..n).map(move |i| [self.corners[i], self.corners[(i + 1) % n]])
    }

    fn crosses_itself(&self) -> bool {
        let sides: Vec<[DVec2; 2]> = self.sides().collect();
        let turn = |a: DVec2, b: DVec2, c: DVec2| (b - a).perp_dot(c - a);
        let cross = |[a, b]: [DVec2; 2], [c, d]: [DVec2; 2]| {
            turn(a, b, c) * turn(a, b, d) < 0.0 && turn(c, d, a) * turn(c, d, b) < 0.0
        };
        (0..sides.len()).any(|i| (0..i).any(|j| cross(sides[i], sides[j])))
    }

    pub fn at(&self, p: DVec2) -> DVec3 {
        self.middle + p.x * self.axes[0] + p.y * self.axes[1]
    }

    pub fn flat(&self, p: DVec3) -> DVec2 {
        DVec2::new(
            (p - self.middle).dot(self.axes[0]),
            (p - self.middle).dot(self.axes[1]),
        )
    }

    /// Whether a place lies within, and its distance from the outline.
    pub fn place(&self, p: DVec2) -> (bool, f64) {
        let (mut is_in, mut near) = (false, f64::INFINITY);
        for [a, b] in self.sides() {
            let side = b - a;
            let share = ((p - a).dot(side) / side.length_squared()).clamp(0.0, 1.0);
            near = near.min(p.distance(a + share * side));
            if (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * side.x {
                is_in = !is_in;
            }
        }
        (is_in, near)
    }

    /// Corners of the box about it.
    pub fn bounds(&self) -> [DVec2; 2] {
        let all = self.corners.iter();
        all.fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[low, high], p| {
            [low.min(*p), high.max(*p)]
        })
    }
}

/// Places half a radius apart within an outline, the outer ones on it, each drawn to the surface. The weight of a place is the part of
/// the area that is nearest to it; the rim stands for half a radius more.
pub fn within<T: Real>(
    field: &HierarchicalSpline<T>,
    iso: f64,
    outline: &Along,
    radius: f64,
) -> Result<Vec<Place>, ForceError> {
    let mut line = outline
        .line(&field.lattice().world_box())
        .map_err(ForceError::Tool)?;
    if line.first() != line.last() {
        line.push(line[0]);
    }
    let flat = Flat::new(&line)?;
    let apart = radius / DENSITY;
    let [low, high] = flat.bounds();
    let size = high - low;
    few(size.x * size.y / (apart * apart))?;
    let (rim, _) = stops(&line, radius)?;
    let mut places: Vec<(DVec2, DVec3, f64)> = rim
        .iter()
        .map(|stop| (flat.flat(stop.at), stop.at, OPEN * radius * stop.weight))
        .collect();
    // Rows of triangles about the middle of the box.
    let height = 0.75_f64.sqrt() * apart;
    let rows = (0.5 * size.y / height).ceil() as i64;
    let columns = (0.5 * size.x / apart).ceil() as i64 + 1;
    let middle = 0.5 * (low + high);
    for row in -rows..=rows {
        let shift = if row.rem_euclid(2) == 1 { 0.5 } else { 0.0 };
        for column in -columns..=columns {
            let p = middle + DVec2::new((column as f64 + shift) * apart, row as f64 * height);
            let (is_in, near) = flat.place(p);
            if is_in && near >= OFF * apart {
                places.push((p, flat.at(p), 0.0));
            }
        }
    }
    share_out(&flat, apart, &mut places);
    let drawn = places.into_iter().map(|(_, p, weight)| {
        let (at, normal) = grabbed(field, iso, p, radius)?;
        Ok(Place {
            at,
            normal,
            weight,
            along: 0.0,
        })
    });
    drawn.collect()
}

/// Normals of the places of an area, averaged over what lies about each by what it stands for. Paths along the normals themselves
/// would fan out or cross on uneven ground, as no smooth force moves it.
pub fn normals(places: &[Place], radius: f64) -> Vec<DVec3> {
    let bin = |p: DVec3| (p / (FAR * radius)).floor().to_array().map(|c| c as i64);
    let mut bins: BTreeMap<[i64; 3], Vec<&Place>> = BTreeMap::new();
    for place in places {
        bins.entry(bin(place.at)).or_default().push(place);
    }
    let mean = |place: &Place| {
        let [x, y, z] = bin(place.at);
        let about = (0..27).filter_map(|n| bins.get(&[x + n / 9 - 1, y + n / 3 % 3 - 1, z + n % 3 - 1]));
        let near = about.flatten().map(|other| {
            let off = place.at.distance(other.at) / (EVEN * radius);
            other.weight * libm::exp(-0.5 * off * off) * other.normal
        });
        near.sum::<DVec3>().normalize_or(place.normal)
    };
    places.iter().map(mean).collect()
}

/// Adds to the weight of each place the part of the area that is nearest to it.
fn share_out(flat: &Flat, apart: f64, places: &mut [(DVec2, DVec3, f64)]) {
    let bin = |p: DVec2| [(p.x / apart).floor() as i64, (p.y / apart).floor() as i64];
    let mut bins: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
    for (i, (p, ..)) in places.iter().enumerate() {
        bins.entry(bin(*p)).or_default().push(i);
    }
    let [low, high] = flat.bounds();
    let cells = (SHARES * (high - low) / apart).ceil();
    let cell = (high - low) / cells;
    for x in 0..cells.x as usize {
        for y in 0..cells.y as usize {
            let p = low + cell * DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            if !flat.place(p).0 {
                continue;
            }
            let [bx, by] = bin(p);
            let near = (-2..=2).flat_map(|i| (-2..=2).map(move |j| [bx + i, by + j]));
            let near = near.filter_map(|b| bins.get(&b)).flatten();
            let far = |i: usize| places[i].0.distance_squared(p);
            if let Some(nearest) = near.copied().min_by(|a, b| far(*a).total_cmp(&far(*b))) {
                places[nearest].2 += cell.x * cell.y;
            }
        }
    }
}
