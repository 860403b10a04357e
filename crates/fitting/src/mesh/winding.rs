//! Generalized winding number of oriented triangles: `w(q) = Σ Ω_t(q) / 4π`, the solid angles of all triangles
//! (Jacobson, Kavan & Sorkine-Hornung, *Robust inside-outside segmentation using generalized winding numbers*, ACM
//! TOG 2013). Near triangles count exactly; far boxes by the first two terms of a Taylor expansion (Barill, Dickson,
//! Schmidt, Levin & Jacobson, *Fast winding numbers for soups and clouds*, ACM TOG 2018, eq. 12).

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::nearest::STACK;
use super::tree::TriangleTree;

/// A box is far when it is so many of its radii away. Errors at random points round a scan of 70 000 triangles are
/// at most 2e-3 with 2, 5e-4 with 3.
const FAR: f64 = 2.5;

/// What a box looks like from afar.
#[derive(Clone, Copy, Debug)]
struct Moments {
    center: DVec3,
    /// `(FAR · radius)²`: squared distance beyond which the expansion serves.
    reach_squared: f64,
    /// `Σ a n`, area vectors.
    dipole: DVec3,
    /// `Σ a n ⊗ (c - center)`, made symmetric; exact, since `∫(x - c) dA = 0` over a triangle.
    quadrupole: DMat3,
}

/// Triangles with the moments of their boxes.
#[derive(Clone, Debug)]
pub(crate) struct WindingTree {
    pub tree: Arc<TriangleTree>,
    moments: Vec<Moments>,
}

/// Area, centroid-weighted sums of a box, kept while moments are gathered.
struct Sums {
    area: f64,
    weighted: DVec3,
}

impl WindingTree {
    pub fn new(tree: Arc<TriangleTree>) -> Self {
        let blank = Moments {
            center: DVec3::ZERO,
            reach_squared: 0.0,
            dipole: DVec3::ZERO,
            quadrupole: DMat3::ZERO,
        };
        let mut out = Self {
            moments: vec![blank; tree.nodes.len()],
            tree,
        };
        out.gather(0);
        out
    }

    fn gather(&mut self, at: usize) -> Sums {
        let node = self.tree.nodes[at];
        let (mut sums, mut parts) = (
            Sums {
                area: 0.0,
                weighted: DVec3::ZERO,
            },
            Vec::with_capacity(4),
        );
        if node.count > 0 {
            for t in node.first..node.first + node.count {
                let [a, b, c] = self.tree.corners[t as usize];
                let vector = (b - a).cross(c - a) * 0.5;
                let area = vector.length();
                sums.area += area;
                sums.weighted += (a + b + c) * (area / 3.0);
                parts.push(((a + b + c) / 3.0, vector, DMat3::ZERO));
            }
        } else {
            for child in [at + 1, node.first as usize] {
                let below = self.gather(child);
                sums.area += below.area;
                sums.weighted += below.weighted;
                let m = &self.moments[child];
                parts.push((m.center, m.dipole, m.quadrupole));
            }
        }
        let center = if sums.area > 0.0 {
            sums.weighted / sums.area
        } else {
            (node.min + node.max) * 0.5
        };
        let mut m = Moments {
            center,
            reach_squared: FAR * FAR * (center - node.min).max(node.max - center).length_squared(),
            dipole: DVec3::ZERO,
            quadrupole: DMat3::ZERO,
        };
        for (place, dipole, quadrupole) in parts {
            let d = place - center;
            let outer = DMat3::from_cols(dipole * d.x, dipole * d.y, dipole * d.z);
            m.dipole += dipole;
            m.quadrupole += quadrupole + (outer + outer.transpose()) * 0.5;
        }
        self.moments[at] = m;
        sums
    }

    /// Winding number at `q`: 1 inside a closed outward surface, 0 outside, between them near holes.
    pub fn at(&self, q: DVec3) -> f64 {
        let mut stack = [0u32; STACK];
        let mut height = 1;
        let mut total = 0.0;
        while height > 0 {
            height -= 1;
            let at = stack[height] as usize;
            let m = &self.moments[at];
            let r = m.center - q;
            let distance_squared = r.length_squared();
            if distance_squared > m.reach_squared {
                // Σ a n · r/|r|³ + Q : ∇(r/|r|³), over 4π like the solid angles.
                let inverse = 1.0 / distance_squared;
                let trace = m.quadrupole.x_axis.x + m.quadrupole.y_axis.y + m.quadrupole.z_axis.z;
                let second = trace - 3.0 * inverse * r.dot(m.quadrupole * r);
                total += (m.dipole.dot(r) + second) * (inverse * inverse.sqrt());
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
                total += solid_angle(q, &self.tree.corners[t as usize]);
            }
        }
        total / (4.0 * PI)
    }
}

/// Signed solid angle of a triangle seen from `q`, positive from behind (van Oosterom & Strackee, *The solid angle
/// of a plane triangle*, 1983, eq. 8).
#[inline]
pub(crate) fn solid_angle(q: DVec3, corners: &[DVec3; 3]) -> f64 {
    let [a, b, c] = corners.map(|p| p - q);
    let [la, lb, lc] = [a, b, c].map(DVec3::length);
    let volume = a.dot(b.cross(c));
    let other = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * volume.atan2(other)
}
