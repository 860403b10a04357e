//! The nearest triangles to eight places at once.

use bspline::vectorized;
use glam::DVec3;

use super::nearest::{Nearest, STACK};
use super::tree::{Node, TriangleTree};

/// Places of a packet.
pub(crate) const PLACES: usize = 8;
type Lanes = [f64; PLACES];

/// A box is opened if it comes so near, in squares of the distance to the nearest triangle known: the rounding of both may
/// not decide which of equally near triangles is found.
const SLACK: f64 = 1.0 + 1e-12;

/// Squared sine of an angle of a triangle below which it is taken for its edges: its plane is not known any more.
const SLIVER: f64 = 1e-16;

/// Places, one array an axis.
struct Packet {
    x: Lanes,
    y: Lanes,
    z: Lanes,
}

impl TriangleTree {
    /// Nearest points to places that lie near each other. A `hint` (a triangle likely to be near) makes the search
    /// shorter and changes nothing.
    pub fn nearest_of_eight(&self, places: &[DVec3; PLACES], hint: u32) -> [Nearest; PLACES] {
        let packet = Packet {
            x: places.map(|p| p.x),
            y: places.map(|p| p.y),
            z: places.map(|p| p.z),
        };
        let found = vectorized(
            #[inline(always)]
            || search(self, &packet, hint),
        );
        std::array::from_fn(|l| self.candidate(places[l], found[l]))
    }
}

/// The nearest triangle to each place; of equally near ones the first in the tree.
#[inline(always)]
fn search(tree: &TriangleTree, places: &Packet, hint: u32) -> [u32; PLACES] {
    let mut best = to_triangle(places, &tree.corners[hint as usize]);
    let mut found = [hint; PLACES];
    let mut stack = [0u32; STACK];
    let mut height = 1;
    while height > 0 {
        height -= 1;
        let mut at = stack[height];
        if !any_below(&to_node(places, &tree.nodes[at as usize]), &best) {
            continue;
        }
        loop {
            let node = &tree.nodes[at as usize];
            if node.count > 0 {
                for t in node.first..node.first + node.count {
                    let corners @ [a, b, c] = &tree.corners[t as usize];
                    // A fifth of the cost of the triangle itself, and most are farther than what is known.
                    let around = to_box(places, a.min(*b).min(*c), a.max(*b).max(*c));
                    if !any_below(&around, &best) {
                        continue;
                    }
                    let d = to_triangle(places, corners);
                    for l in 0..PLACES {
                        let nearer = d[l] < best[l] || (d[l] == best[l] && t < found[l]);
                        best[l] = if nearer { d[l] } else { best[l] };
                        found[l] = if nearer { t } else { found[l] };
                    }
                }
                break;
            }
            let children = [at + 1, node.first];
            let bounds = [
                to_node(places, &tree.nodes[children[0] as usize]),
                to_node(places, &tree.nodes[children[1] as usize]),
            ];
            let near = usize::from(sum(&bounds[1]) < sum(&bounds[0]));
            let is_open = [any_below(&bounds[0], &best), any_below(&bounds[1], &best)];
            if is_open[1 - near] {
                if !is_open[near] {
                    at = children[1 - near];
                    continue;
                }
                stack[height] = children[1 - near];
                height += 1;
            } else if !is_open[near] {
                break;
            }
            at = children[near];
        }
    }
    found
}

#[inline(always)]
fn sum(d: &Lanes) -> f64 {
    ((d[0] + d[1]) + (d[2] + d[3])) + ((d[4] + d[5]) + (d[6] + d[7]))
}

#[inline(always)]
fn any_below(bound: &Lanes, best: &Lanes) -> bool {
    let mut any = false;
    for l in 0..PLACES {
        any |= bound[l] <= best[l] * SLACK;
    }
    any
}

#[inline(always)]
fn to_node(p: &Packet, node: &Node) -> Lanes {
    to_box(p, node.min, node.max)
}

/// Squares of the distances to a box.
#[inline(always)]
fn to_box(p: &Packet, low: DVec3, high: DVec3) -> Lanes {
    // A loop: closures of `from_fn` are compiled for the baseline.
    let mut out = [0.0; PLACES];
    for l in 0..PLACES {
        let x = (low.x - p.x[l]).max(p.x[l] - high.x).max(0.0);
        let y = (low.y - p.y[l]).max(p.y[l] - high.y).max(0.0);
        let z = (low.z - p.z[l]).max(p.z[l] - high.z).max(0.0);
        out[l] = x * x + y * y + z * z;
    }
    out
}

/// Squares of the distances to a triangle: to its plane for places over it, else to the nearest of its edges.
#[inline(always)]
fn to_triangle(p: &Packet, &[a, b, c]: &[DVec3; 3]) -> Lanes {
    let edges = [b - a, c - b, a - c];
    let normal = edges[0].cross(-edges[2]);
    let squares = [
        edges[0].length_squared(),
        edges[1].length_squared(),
        edges[2].length_squared(),
    ];
    let square = normal.length_squared();
    let longest = squares[0].max(squares[1]).max(squares[2]);
    let is_flat = square > SLIVER * longest * longest;
    let over_plane = if is_flat { 1.0 / square } else { 0.0 };
    let starts = [a, b, c];
    // Normals of the edges in the plane, inwards.
    let inward = [
        normal.cross(edges[0]),
        normal.cross(edges[1]),
        normal.cross(edges[2]),
    ];
    let mut inverse = [0.0; 3];
    for e in 0..3 {
        inverse[e] = if squares[e] > 0.0 { 1.0 / squares[e] } else { 0.0 };
    }
    let mut out = [0.0; PLACES];
    for l in 0..PLACES {
        let mut nearest = f64::INFINITY;
        let mut is_over = is_flat;
        for e in 0..3 {
            let (x, y, z) = (p.x[l] - starts[e].x, p.y[l] - starts[e].y, p.z[l] - starts[e].z);
            let t = (x * edges[e].x + y * edges[e].y + z * edges[e].z) * inverse[e];
            let t = t.clamp(0.0, 1.0);
            let (u, v, w) = (x - t * edges[e].x, y - t * edges[e].y, z - t * edges[e].z);
            let d = u * u + v * v + w * w;
            nearest = if d < nearest { d } else { nearest };
            is_over &= x * inward[e].x + y * inward[e].y + z * inward[e].z >= 0.0;
        }
        let height = (p.x[l] - a.x) * normal.x + (p.y[l] - a.y) * normal.y + (p.z[l] - a.z) * normal.z;
        let plane = height * height * over_plane;
        out[l] = if is_over && plane < nearest {
            plane
        } else {
            nearest
        };
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantoms::SplitMix64;

    #[test]
    fn eight_at_once_find_what_each_finds_alone() {
        let mut random = SplitMix64::new(6);
        let triangles: Vec<[DVec3; 3]> = (0..700)
            .map(|i| {
                let p = random.uniform3();
                // Some are slivers.
                let width = if i % 10 == 0 { 1e-10 } else { 0.1 };
                let along = random.uniform3() * 0.1;
                [p, p + along, p + along * 0.7 + random.uniform3() * width]
            })
            .collect();
        let tree = TriangleTree::new(&triangles);
        for i in 0..300 {
            let middle = random.uniform3() * 2.0 - 0.5;
            let spread = 0.1f64.powi(i % 4);
            let places = [(); PLACES].map(|()| middle + random.uniform3() * spread);
            let found = tree.nearest_of_eight(&places, (i as u32 * 7) % 700);
            for (p, n) in places.iter().zip(found) {
                let alone = tree.nearest(*p, 0).distance_squared.sqrt();
                assert!((n.distance_squared.sqrt() - alone).abs() <= 1e-9, "{p}");
            }
        }
    }

    /// On the planes of symmetry of a box two or four faces are equally near.
    #[test]
    fn the_hint_does_not_decide_between_equally_near_triangles() {
        let corner = |i: usize| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64) * 0.3 + 0.1;
        let quads = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let triangles: Vec<[DVec3; 3]> = quads
            .iter()
            .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]])
            .map(|t| t.map(corner))
            .collect();
        let tree = TriangleTree::new(&triangles);
        let mut random = SplitMix64::new(9);
        for _ in 0..100 {
            let places = [(); PLACES].map(|()| {
                let p = random.uniform3() * 0.3 + 0.1;
                DVec3::new(p.x, p.x, if random.uniform() < 0.5 { p.z } else { 0.25 })
            });
            let found = tree.nearest_of_eight(&places, 0);
            for hint in 1..12 {
                assert_eq!(tree.nearest_of_eight(&places, hint), found, "{places:?}");
            }
        }
    }
}
