//! Generalized winding number of oriented triangles: `w(q) = Σ Ω_t(q) / 4π`, the solid angles of all triangles
//! \[Jacobson13\]. Near triangles count exactly; far boxes by the first three terms of a Taylor expansion \[Barill18\].

use std::f64::consts::PI;
use std::sync::Arc;

use glam::DVec3;

use super::moments::Moments;
use super::nearest::STACK;
use super::topology::area_vector;
use super::tree::TriangleTree;

/// A box is far when it is so many of its radii away. Largest error and cost at points round a scan of 70 000
/// triangles, against the sum over all: 1.5 1.6e-2, 5.6 µs; 2 4.0e-3, 7.9 µs; 2.5 1.6e-3, 12.8 µs.
const FAR: f64 = 2.0;

/// Triangles with the moments of their boxes.
#[derive(Clone, Debug)]
pub(crate) struct WindingTree {
    pub tree: Arc<TriangleTree>,
    /// `(FAR · radius)²` of each box: squared distance from its centre beyond which the expansion serves.
    reach_squared: Vec<f64>,
    moments: Vec<Moments>,
}

/// Sums of a box that its parent needs.
struct Sums {
    area: f64,
    /// Centroids times areas.
    weighted: DVec3,
    radius: f64,
}

impl WindingTree {
    pub fn new(tree: Arc<TriangleTree>) -> Self {
        let mut out = Self {
            reach_squared: vec![0.0; tree.nodes.len()],
            moments: vec![Moments::default(); tree.nodes.len()],
            tree,
        };
        out.gather(0);
        out
    }

    fn gather(&mut self, at: usize) -> Sums {
        let node = self.tree.nodes[at];
        let mut sums = Sums {
            area: 0.0,
            weighted: DVec3::ZERO,
            radius: 0.0,
        };
        let mut parts = Vec::with_capacity(4);
        if node.count > 0 {
            for t in node.first..node.first + node.count {
                let corners = &self.tree.corners[t as usize];
                let vector = area_vector(corners);
                let part = Moments::of_triangle(corners, vector);
                sums.area += vector.length();
                sums.weighted += part.center * vector.length();
                let radius = corners
                    .iter()
                    .map(|p| p.distance(part.center))
                    .fold(0.0, f64::max);
                parts.push((part, radius));
            }
        } else {
            for child in [at + 1, node.first as usize] {
                let below = self.gather(child);
                sums.area += below.area;
                sums.weighted += below.weighted;
                parts.push((self.moments[child], below.radius));
            }
        }
        let center = if sums.area > 0.0 {
            sums.weighted / sums.area
        } else {
            (node.min + node.max) * 0.5
        };
        let mut whole = Moments::about(center);
        for (part, radius) in &parts {
            sums.radius = sums.radius.max(radius + part.center.distance(center));
            whole.add(part);
        }
        let to_corner = (center - node.min).max(node.max - center).length();
        sums.radius = sums.radius.min(to_corner);
        self.reach_squared[at] = (FAR * sums.radius).powi(2);
        self.moments[at] = whole;
        sums
    }

    /// Winding number at `q`: 1 inside a closed outward surface, 0 outside, between them near holes.
    pub fn at(&self, q: DVec3) -> f64 {
        let mut stack = [0u32; STACK];
        let mut height = 1;
        let (mut afar, mut near) = (0.0, Turn::default());
        while height > 0 {
            height -= 1;
            let at = stack[height] as usize;
            let m = &self.moments[at];
            let r = m.center - q;
            if r.length_squared() > self.reach_squared[at] {
                afar += m.solid_angle(r);
                continue;
            }
            let node = &self.tree.nodes[at];
            if node.count == 0 {
                stack[height] = node.first;
                stack[height + 1] = at as u32 + 1;
                height += 2;
                continue;
            }
            for t in node.first..node.first + node.count {
                let (re, im) = half_solid_angle(q, &self.tree.corners[t as usize]);
                near.add(re, im);
            }
        }
        afar / (4.0 * PI) + near.turns()
    }
}

/// A complex number whose argument is half the signed solid angle of a triangle seen from `q`, positive from behind
/// [Oosterom83 eq. 8].
#[inline]
fn half_solid_angle(q: DVec3, corners: &[DVec3; 3]) -> (f64, f64) {
    let [a, b, c] = corners.map(|p| p - q);
    let [la, lb, lc] = [a, b, c].map(DVec3::length);
    let volume = a.dot(b.cross(c));
    let other = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    (other, volume)
}

/// A sum of angles, as a product of complex numbers and whole turns: one arctangent for all triangles.
struct Turn {
    re: f64,
    im: f64,
    whole: f64,
}

impl Default for Turn {
    fn default() -> Self {
        Self {
            re: 1.0,
            im: 0.0,
            whole: 0.0,
        }
    }
}

impl Turn {
    #[inline]
    fn add(&mut self, re: f64, im: f64) {
        let (x, y) = (self.re * re - self.im * im, self.re * im + self.im * re);
        let size = x.abs() + y.abs();
        if size == 0.0 {
            // Seen from a corner a triangle has no solid angle.
            return;
        }
        // Two angles of one sign that end up with the other have passed π.
        let (before, added, after) = (self.im >= 0.0, im >= 0.0, y >= 0.0);
        if before == added && after != before {
            self.whole += if before { 1.0 } else { -1.0 };
        }
        (self.re, self.im) = (x / size, y / size);
    }

    /// The sum over 2π. The arctangent is one that gives the same bits on every machine.
    fn turns(&self) -> f64 {
        self.whole + libm::atan2(self.im, self.re) / (2.0 * PI)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantoms::SplitMix64;

    /// Triangles that close nothing: every error shows.
    fn soup(count: usize) -> Vec<[DVec3; 3]> {
        let mut random = SplitMix64::new(3);
        (0..count)
            .map(|_| {
                let p = random.uniform3();
                [p, p + random.uniform3() * 0.1, p + random.uniform3() * 0.1]
            })
            .collect()
    }

    #[test]
    fn the_tree_gives_the_sum_of_the_solid_angles() {
        let triangles = soup(3000);
        let tree = WindingTree::new(Arc::new(TriangleTree::new(&triangles)));
        let mut random = SplitMix64::new(4);
        for _ in 0..200 {
            let q = random.uniform3() * 2.0 - 0.5;
            let angle = |t| {
                let (re, im) = half_solid_angle(q, t);
                im.atan2(re) / (2.0 * PI)
            };
            let sum: f64 = triangles.iter().map(angle).sum();
            assert!((tree.at(q) - sum).abs() < 5e-3 * sum.abs().max(1.0), "{q}");
        }
    }

    #[test]
    fn angles_add_up_over_whole_turns() {
        let mut turn = Turn::default();
        let mut sum = 0.0;
        let mut random = SplitMix64::new(5);
        for i in 0..1000 {
            // Up for a while, then down.
            let angle = (random.uniform() - 0.2) * if i < 500 { 3.0 } else { -3.0 };
            turn.add(5.0 * angle.cos(), 5.0 * angle.sin());
            sum += angle;
            assert!((turn.turns() - sum / (2.0 * PI)).abs() < 1e-11);
        }
    }
}
