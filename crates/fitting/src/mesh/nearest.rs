//! The nearest point of a set of triangles.

use glam::DVec3;

use super::tree::TriangleTree;

/// Deepest tree: 2³² triangles halved down to four.
pub(crate) const STACK: usize = 40;

/// Which part of a triangle a point lies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Feature {
    /// A corner, by number.
    Corner(u8),
    /// The edge from the corner of this number to the next.
    Edge(u8),
    Inner,
}

/// The nearest point found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Nearest {
    /// Square of the distance.
    pub distance_squared: f64,
    pub point: DVec3,
    /// Index in the tree's order.
    pub triangle: u32,
    pub feature: Feature,
}

impl TriangleTree {
    /// Nearest point to `p`. A `hint` (a triangle likely to be near) makes the search shorter and, up to the choice
    /// between equally near triangles, changes nothing.
    pub fn nearest(&self, p: DVec3, hint: u32) -> Nearest {
        let mut best = self.candidate(p, hint);
        let mut stack = [(0u32, 0.0f64); STACK];
        stack[0] = (0, self.nodes[0].distance_squared(p));
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let (mut at, bound) = stack[height];
            if bound > best.distance_squared {
                continue;
            }
            loop {
                let node = &self.nodes[at as usize];
                if node.count > 0 {
                    for t in node.first..node.first + node.count {
                        let found = self.candidate(p, t);
                        if found.distance_squared < best.distance_squared
                            || (found.distance_squared == best.distance_squared && t < best.triangle)
                        {
                            best = found;
                        }
                    }
                    break;
                }
                let children = [at + 1, node.first];
                let bounds = children.map(|c| self.nodes[c as usize].distance_squared(p));
                let near = usize::from(bounds[1] < bounds[0]);
                if bounds[near] > best.distance_squared {
                    break;
                }
                if bounds[1 - near] <= best.distance_squared {
                    stack[height] = (children[1 - near], bounds[1 - near]);
                    height += 1;
                }
                at = children[near];
            }
        }
        best
    }

    #[inline]
    pub fn candidate(&self, p: DVec3, triangle: u32) -> Nearest {
        let (point, feature) = closest_point(p, &self.corners[triangle as usize]);
        Nearest {
            distance_squared: p.distance_squared(point),
            point,
            triangle,
            feature,
        }
    }
}

/// Nearest point of a triangle, by the seven regions of its plane [Ericson05 §5.1.5], and where on it that is.
#[inline]
pub(crate) fn closest_point(p: DVec3, &[a, b, c]: &[DVec3; 3]) -> (DVec3, Feature) {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (a, Feature::Corner(0));
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return (b, Feature::Corner(1));
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (a + ab * (d1 / (d1 - d3)), Feature::Edge(0));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return (c, Feature::Corner(2));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (a + ac * (d2 / (d2 - d6)), Feature::Edge(2));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return (
            b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6))),
            Feature::Edge(1),
        );
    }
    let share = 1.0 / (va + vb + vc);
    (a + ab * (vb * share) + ac * (vc * share), Feature::Inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantoms::SplitMix64;

    #[test]
    fn the_tree_finds_what_looking_at_all_triangles_finds() {
        let mut random = SplitMix64::new(1);
        let triangles: Vec<[DVec3; 3]> = (0..500)
            .map(|_| {
                let p = random.uniform3();
                [p, p + random.uniform3() * 0.1, p + random.uniform3() * 0.1]
            })
            .collect();
        let tree = TriangleTree::new(&triangles);
        for i in 0..500 {
            let p = random.uniform3() * 2.0 - 0.5;
            let all = triangles
                .iter()
                .map(|t| p.distance_squared(closest_point(p, t).0));
            let least = all.fold(f64::INFINITY, f64::min);
            assert_eq!(tree.nearest(p, 0).distance_squared, least);
            assert_eq!(tree.nearest(p, i).distance_squared, least, "with a hint");
        }
    }

    #[test]
    fn the_nearest_point_of_a_triangle_is_no_farther_than_any_other() {
        let mut random = SplitMix64::new(2);
        for _ in 0..200 {
            let t = [random.uniform3(), random.uniform3(), random.uniform3()];
            let p = random.uniform3() * 3.0 - 1.0;
            let (nearest, _) = closest_point(p, &t);
            for i in 0..=20 {
                for j in 0..=20 - i {
                    let (s, r) = (f64::from(i) / 20.0, f64::from(j) / 20.0);
                    let q = t[0] + (t[1] - t[0]) * s + (t[2] - t[0]) * r;
                    assert!(p.distance(nearest) <= p.distance(q) + 1e-12);
                }
            }
        }
    }
}
