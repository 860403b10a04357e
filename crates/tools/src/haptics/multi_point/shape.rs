//! What a tool's surface is: its distance, and points on it.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::carved::Carved;

/// A shape in the tool's own axes, about their origin; all but those that are carved are convex.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Shape {
    /// A sphere.
    Ball(f64),
    /// An outline in x and y, drawn out along z by a half length to both sides.
    Drawn(Outline, f64),
    /// The same with the outline in y and z, drawn out along x.
    Flat(Outline, f64),
    /// A part of an object.
    Carved(Arc<Carved>),
}

/// A convex polygon of 1 to 4 corners, counter-clockwise, widened by a radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Outline {
    corners: [DVec2; 4],
    count: usize,
    radius: f64,
}

impl Outline {
    pub fn new(corners: &[DVec2], radius: f64) -> Self {
        let mut all = [DVec2::ZERO; 4];
        all[..corners.len()].copy_from_slice(corners);
        Self {
            corners: all,
            count: corners.len(),
            radius,
        }
    }

    pub fn rectangle(half: DVec2, radius: f64) -> Self {
        let h = half;
        Self::new(&[-h, DVec2::new(h.x, -h.y), h, DVec2::new(-h.x, h.y)], radius)
    }

    fn corner(&self, i: usize) -> DVec2 {
        self.corners[i % self.count]
    }

    /// Signed distance and its gradient.
    fn distance(&self, p: DVec2) -> (f64, DVec2) {
        let (mut nearest, mut away) = (f64::INFINITY, DVec2::X);
        let mut inside = self.count > 2;
        for i in 0..self.count {
            let (a, b) = (self.corner(i), self.corner(i + 1));
            let side = b - a;
            let along = if self.count > 1 {
                (p - a).dot(side) / side.length_squared()
            } else {
                0.0
            };
            let from = p - (a + along.clamp(0.0, 1.0) * side);
            inside &= side.perp_dot(p - a) >= 0.0;
            if from.length_squared() < nearest {
                nearest = from.length_squared();
                // On the polygon itself: outwards.
                away = from
                    .try_normalize()
                    .unwrap_or(DVec2::new(side.y, -side.x).normalize_or(DVec2::X));
            }
        }
        let d = nearest.sqrt();
        if inside && d > 0.0 {
            (-d - self.radius, -away)
        } else {
            (d - self.radius, away)
        }
    }

    /// Points on the outline, its corners among them, no further apart than `spacing` along it.
    fn walk(&self, spacing: f64) -> Vec<DVec2> {
        let mut points = Vec::new();
        for i in 0..self.count {
            let (before, at, after) = (
                self.corner(i + self.count - 1),
                self.corner(i),
                self.corner(i + 1),
            );
            // Round the corner, then along the side.
            let normal = |a: DVec2, b: DVec2| DVec2::new(b.y - a.y, a.x - b.x).normalize_or(DVec2::X);
            let (from, to) = (normal(before, at), normal(at, after));
            let turn = match self.count {
                1 => std::f64::consts::TAU,
                2 => std::f64::consts::PI,
                _ => libm::atan2(from.perp_dot(to), from.dot(to)),
            };
            if self.radius > 0.0 {
                let parts = (turn * self.radius / spacing).ceil().max(1.0) as usize;
                for k in 0..parts + usize::from(self.count > 1) {
                    let angle = turn * k as f64 / parts as f64;
                    points
                        .push(at + self.radius * DVec2::new(libm::cos(angle), libm::sin(angle)).rotate(from));
                }
            } else {
                points.push(at);
            }
            let parts = ((after - at).length() / spacing).ceil() as usize;
            for k in 1..parts {
                points.push(at.lerp(after, k as f64 / parts as f64) + self.radius * to);
            }
        }
        points
    }
}

/// Even steps over −half to half, both ends among them.
fn steps(half: f64, spacing: f64) -> impl Iterator<Item = f64> + Clone {
    let parts = (2.0 * half / spacing).ceil().max(1.0) as usize;
    (0..=parts).map(move |k| half * (2.0 * k as f64 / parts as f64 - 1.0))
}

impl Shape {
    /// Signed distance to the surface, positive outside, and its gradient of length 1.
    pub fn distance(&self, p: DVec3) -> (f64, DVec3) {
        match *self {
            Self::Carved(ref carved) => carved.distance(p),
            Self::Ball(radius) => {
                let length = p.length();
                let n = if length > 0.0 { p / length } else { DVec3::Z };
                (length - radius, n)
            }
            Self::Drawn(outline, half) => {
                let (across, n) = outline.distance(p.truncate());
                let (along, side) = (p.z.abs() - half, p.z.signum());
                if across > 0.0 && along > 0.0 {
                    let d = (across * across + along * along).sqrt();
                    (d, (n * across).extend(side * along) / d)
                } else if across > along {
                    (across, n.extend(0.0))
                } else {
                    (along, DVec3::new(0.0, 0.0, side))
                }
            }
            Self::Flat(outline, half) => {
                let (d, n) = Self::Drawn(outline, half).distance(DVec3::new(p.y, p.z, p.x));
                (d, DVec3::new(n.z, n.x, n.y))
            }
        }
    }

    /// The nearest place of the surface; of a part of an object one that is near, and none where the part ends.
    pub fn project(&self, p: DVec3) -> Option<DVec3> {
        if let Self::Carved(carved) = self {
            return carved.project(p);
        }
        let (d, n) = self.distance(p);
        Some(p - d * n)
    }

    /// Points on the surface, edges and corners among them, about `spacing` apart. Parts of objects have theirs from these.
    pub fn points(&self, spacing: f64) -> Vec<DVec3> {
        match *self {
            Self::Carved(_) => Vec::new(),
            Self::Ball(radius) => {
                // Golden spiral; each point has a hexagon of √3/2 spacing² to itself.
                let area = 4.0 * std::f64::consts::PI * radius * radius;
                let count = (area / (0.866 * spacing * spacing)).ceil().max(6.0) as usize;
                let golden = std::f64::consts::PI * (3.0 - 5.0f64.sqrt());
                let at = |k: usize| {
                    let z = 1.0 - (2 * k + 1) as f64 / count as f64;
                    let (ring, angle) = ((1.0 - z * z).sqrt(), golden * k as f64);
                    radius * DVec3::new(ring * libm::cos(angle), ring * libm::sin(angle), z)
                };
                (0..count).map(at).collect()
            }
            Self::Drawn(outline, half) => {
                let rim = outline.walk(spacing);
                let mut points: Vec<_> = steps(half, spacing)
                    .flat_map(|z| rim.iter().map(move |p| p.extend(z)))
                    .collect();
                let reach = rim.iter().fold(DVec2::ZERO, |most, p| most.max(p.abs()));
                let across = steps(reach.x, spacing)
                    .flat_map(|x| steps(reach.y, spacing).map(move |y| DVec2::new(x, y)));
                let within = across.filter(|p| outline.distance(*p).0 < -0.4 * spacing);
                points.extend(within.flat_map(|p| [p.extend(-half), p.extend(half)]));
                points
            }
            Self::Flat(outline, half) => {
                let drawn = Self::Drawn(outline, half).points(spacing);
                drawn.iter().map(|p| DVec3::new(p.z, p.x, p.y)).collect()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> [Shape; 5] {
        let triangle = [DVec2::new(0.0, -4.0), DVec2::new(1.0, 4.0), DVec2::new(-1.0, 4.0)];
        [
            Shape::Ball(5.0),
            Shape::Drawn(Outline::rectangle(DVec2::new(3.0, 2.0), 0.0), 4.0),
            Shape::Drawn(Outline::new(&[DVec2::ZERO], 3.0), 6.0),
            Shape::Drawn(Outline::rectangle(DVec2::new(3.0, 6.0), 2.0), 0.5),
            Shape::Drawn(Outline::new(&triangle, 0.0), 8.0),
        ]
    }

    #[test]
    fn points_lie_on_the_surface_and_leave_no_hole() {
        for shape in all() {
            let points = shape.points(1.0);
            assert!(
                points.iter().all(|p| shape.distance(*p).0.abs() < 1e-12),
                "{shape:?}"
            );
            // Whatever place of the surface: a point is near. Squares of side 1 have half diagonals of 0.71.
            for k in 0..20_000 {
                let f = |n: f64| 20.0 * ((f64::from(k) * n).fract() - 0.5);
                let p = DVec3::new(f(0.754_877_67), f(0.569_840_29), f(0.438_579_21));
                let p = shape.project(p).expect("a whole shape");
                let near = points.iter().map(|q| q.distance(p)).fold(f64::INFINITY, f64::min);
                assert!(near < 1.0, "{shape:?} {p} {near}");
            }
        }
    }

    #[test]
    fn gradients_match_central_differences() {
        for shape in all() {
            for k in 0..2000 {
                let f = |n: f64| 20.0 * ((f64::from(k) * n).fract() - 0.5);
                let p = DVec3::new(f(0.754_877_67), f(0.569_840_29), f(0.438_579_21));
                let (_, g) = shape.distance(p);
                let e = 1e-6;
                let slope = |axis: DVec3| {
                    (shape.distance(p + e * axis).0 - shape.distance(p - e * axis).0) / (2.0 * e)
                };
                let measured = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
                // On ridges inside the sides differ; there the difference is shorter.
                assert!(
                    measured.length() < 1.0 - 1e-3 || (measured - g).length() < 1e-4,
                    "{shape:?} {p}"
                );
            }
        }
    }
}
