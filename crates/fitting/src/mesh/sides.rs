//! What lies on the two sides of a triangle.

use glam::DVec3;

use super::winding::WindingTree;

/// How far from a triangle its two sides are looked at, unit box.
const ASIDE: f64 = 1e-7;

/// Sides of a triangle at one of its points.
pub(super) struct Sides {
    /// Winding number in front of and behind it.
    front: f64,
    back: f64,
}

impl Sides {
    pub fn at(winding: &WindingTree, p: DVec3, normal: DVec3) -> Self {
        Self {
            front: winding.at(p + normal * ASIDE),
            back: winding.at(p - normal * ASIDE),
        }
    }

    /// Mean of the two.
    pub fn middle(&self) -> f64 {
        0.5 * (self.front + self.back)
    }

    /// Whether the solid is behind it and nothing in front.
    pub fn is_boundary(&self) -> bool {
        self.back > 0.5 && self.front <= 0.5
    }
}
