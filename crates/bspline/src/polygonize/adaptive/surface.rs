//! The loops in which the surface crosses the surface of one leaf.
//!
//! The faces of a leaf are cut up by finer neighbours into minimal faces, which the leaf shares with one neighbour
//! each; the borders of those are made of minimal edges. On every minimal face each run of inside nodes is cut off
//! from the rest by one segment from crossing to crossing, as in the table of marching cubes: the rule reads the signs
//! of the face alone, so both neighbours agree. The segments join end to end into loops, and each loop gets a vertex.
//!
//! Nodes are counted in half cells from the leaf's first corner, `0 ..= 2`; a crossing is named by the sum of the two
//! nodes of its edge, `25x + 5y + z` of `0 ..= 4` each: twice its edge's middle.

use glam::DVec3;

use super::around::{Around, State};

/// Most loops of a leaf that have names of their own.
pub(super) const MAX_LOOPS: usize = 16;

/// Name of a crossing.
pub(super) type Crossing = u8;

const NAMES: usize = 125;

/// A segment of a loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    /// Minimal face, `5·(2·axis + side)`, plus 1 … 4 for a quarter.
    pub face: u8,
    pub from: Crossing,
    pub to: Crossing,
    pub of_loop: u8,
}

/// The surface of a leaf.
#[derive(Clone, Default)]
pub(super) struct LeafSurface {
    /// Segments, loop after loop, each in its order.
    pub segments: Vec<Segment>,
    pub loops: usize,
}

/// The segment that starts at each crossing: where it ends, and on which face.
struct Next {
    to: [(Crossing, u8); NAMES],
    /// Crossings whose segments belong to no loop yet.
    open: u128,
}

/// Nodes of a leaf's surface with their signs.
struct Nodes {
    /// Bits of the nodes that are there, and of those that are inside.
    known: u32,
    inside: u32,
    split_edges: u16,
    split_faces: u8,
}

const fn node(n: [usize; 3]) -> usize {
    9 * n[0] + 3 * n[1] + n[2]
}

/// Number of an edge along `axis` at the sides `u`, `v` (0 or 2) of the next axes.
const fn edge_number(axis: usize, u: usize, v: usize) -> usize {
    4 * axis + u + v / 2
}

/// The middles of a leaf's faces, by `2·axis + side`, and of its edges, by number. The cell beside the side 0 or 2 of an
/// axis stands at 0 or 2 of the 27 as well.
const FACES: [[usize; 3]; 6] = {
    let mut faces = [[0; 3]; 6];
    let mut f = 0;
    while f < 6 {
        faces[f] = placed(f / 2, f % 2 * 2, 1, 1);
        f += 1;
    }
    faces
};
const EDGES: [[usize; 3]; 12] = {
    let mut edges = [[0; 3]; 12];
    let mut e = 0;
    while e < 12 {
        edges[e] = placed(e / 4, 1, e / 2 % 2 * 2, e % 2 * 2);
        e += 1;
    }
    edges
};
/// The three cells beside each edge.
const BESIDE: [[[usize; 3]; 3]; 12] = {
    let mut beside = [[[0; 3]; 3]; 12];
    let mut e = 0;
    while e < 12 {
        let (axis, u, v) = (e / 4, e / 2 % 2 * 2, e % 2 * 2);
        beside[e] = [
            placed(axis, 1, u, 1),
            placed(axis, 1, 1, v),
            placed(axis, 1, u, v),
        ];
        e += 1;
    }
    beside
};
/// The same as bits of the 27.
const BESIDE_BITS: [u32; 12] = {
    let mut bits = [0; 12];
    let mut e = 0;
    while e < 12 {
        let [a, b, c] = BESIDE[e];
        bits[e] = 1 << node(a) | 1 << node(b) | 1 << node(c);
        e += 1;
    }
    bits
};

const fn placed(axis: usize, along: usize, u: usize, v: usize) -> [usize; 3] {
    let mut n = [0; 3];
    n[axis] = along;
    n[(axis + 1) % 3] = u;
    n[(axis + 2) % 3] = v;
    n
}

impl Nodes {
    fn new(around: &Around, c: [usize; 3]) -> Self {
        let sample = &around.block.sample;
        let mut nodes = Self {
            known: 0,
            inside: 0,
            split_edges: 0,
            split_faces: 0,
        };
        let case = sample.case(c);
        for corner in 0..8usize {
            let at = [corner >> 2, corner >> 1 & 1, corner & 1];
            nodes.put(node(at.map(|x| 2 * x)), case >> corner & 1 == 1);
        }
        let cell = c.map(|c| c as i32);
        let split = around.split_about(c);
        let take = |nodes: &mut Self, n: [usize; 3], out: [usize; 3]| {
            let beside = std::array::from_fn(|a| cell[a] + out[a] as i32 - 1);
            let fine = std::array::from_fn(|a| 2 * cell[a] + n[a] as i32);
            nodes.put(node(n), around.fine_node(beside, fine).0);
        };
        for (f, face) in FACES.into_iter().enumerate() {
            if split >> node(face) & 1 == 1 {
                nodes.split_faces |= 1 << f;
                take(&mut nodes, face, face);
            }
        }
        for (e, edge) in EDGES.into_iter().enumerate() {
            if split & BESIDE_BITS[e] != 0 {
                nodes.split_edges |= 1 << e;
                let found = BESIDE[e].into_iter().find(|n| split >> node(*n) & 1 == 1);
                take(&mut nodes, edge, found.expect("one of the bits is set"));
            }
        }
        nodes
    }

    fn put(&mut self, node: usize, inside: bool) {
        self.known |= 1 << node;
        self.inside |= u32::from(inside) << node;
    }

    /// Whether nodes lie on both sides.
    fn is_crossed(&self) -> bool {
        self.inside != 0 && self.inside != self.known
    }

    /// Whether the edge between two corners of a face has a node in its middle.
    fn is_split(&self, axis: usize, u: usize, v: usize) -> bool {
        self.split_edges >> edge_number(axis, u, v) & 1 == 1
    }
}

impl LeafSurface {
    /// Finds the loops of the leaf `c` of the block.
    pub fn find(&mut self, around: &Around, c: [usize; 3]) {
        self.segments.clear();
        self.loops = 0;
        let nodes = Nodes::new(around, c);
        if !nodes.is_crossed() {
            return;
        }
        let mut next = Next {
            to: [(0, 0); NAMES],
            open: 0,
        };
        for axis in 0..3 {
            for side in 0..2 {
                cut_face(&nodes, axis, side, &mut next);
            }
        }
        while next.open != 0 {
            let mut from = next.open.trailing_zeros() as usize;
            while next.open >> from & 1 == 1 {
                next.open &= !(1 << from);
                let (to, face) = next.to[from];
                self.segments.push(Segment {
                    face,
                    from: from as Crossing,
                    to,
                    of_loop: self.loops.min(MAX_LOOPS - 1) as u8,
                });
                from = usize::from(to);
            }
            self.loops += 1;
        }
        self.loops = self.loops.min(MAX_LOOPS);
    }
}

/// Cuts one face, whole or in quarters.
fn cut_face(nodes: &Nodes, axis: usize, side: usize, next: &mut Next) {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let at = |i: usize, j: usize| placed(axis, 2 * side, i, j);
    let face = 5 * (2 * axis + side) as u8;
    let ring = [[0, 0], [2, 0], [2, 2], [0, 2]];
    let order = |k: usize| if side == 1 { k % 4 } else { (4 - k % 4) % 4 };
    let corner = |k: usize| ring[order(k)];
    let middle = |k: usize| {
        let (a, b) = (corner(k), corner(k + 1));
        [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2]
    };
    if nodes.split_faces >> (2 * axis + side) & 1 == 1 {
        for k in 0..4 {
            let quarter = [corner(k), middle(k), [1, 1], middle(k + 3)];
            cut(nodes, &quarter.map(|[i, j]| at(i, j)), face + 1 + k as u8, next);
        }
        return;
    }
    let mut ring_nodes = [[0; 3]; 8];
    let mut count = 0;
    for k in 0..4 {
        let (a, b) = (corner(k), corner(k + 1));
        ring_nodes[count] = at(a[0], a[1]);
        count += 1;
        // An edge of the face runs along u or v, at fixed sides of the other two axes.
        let is_split = if a[0] != b[0] {
            // Along u; the next axes of u are v and the face's own.
            nodes.is_split(u, a[1], 2 * side)
        } else {
            nodes.is_split(v, 2 * side, a[0])
        };
        if is_split {
            let m = middle(k);
            ring_nodes[count] = at(m[0], m[1]);
            count += 1;
        }
    }
    cut(nodes, &ring_nodes[..count], face, next);
}

/// Cuts each run of inside nodes round a minimal face off from the rest.
fn cut(nodes: &Nodes, ring: &[[usize; 3]], face: u8, next: &mut Next) {
    let n = ring.len();
    let count = ring.iter().filter(|p| nodes.inside >> node(**p) & 1 == 1).count();
    if count == 0 || count == n {
        return;
    }
    let inside = |k: usize| nodes.inside >> node(ring[k % n]) & 1 == 1;
    let crossing = |k: usize| {
        let (a, b) = (ring[k % n], ring[(k + 1) % n]);
        25 * (a[0] + b[0]) + 5 * (a[1] + b[1]) + a[2] + b[2]
    };
    for start in 0..n {
        if !inside(start + n - 1) && inside(start) {
            let mut last = start;
            while inside(last + 1) {
                last += 1;
            }
            let from = crossing(start + n - 1);
            next.to[from] = (crossing(last) as Crossing, face);
            next.open |= 1 << from;
        }
    }
}

/// Twice the middle of a crossing's edge, in half cells from the leaf's first corner.
pub(super) fn middle(crossing: Crossing) -> [i32; 3] {
    [crossing / 25, crossing / 5 % 5, crossing % 5].map(i32::from)
}

/// Name of the crossing at that place; `None` if it is not on a leaf.
pub(super) fn crossing_at(middle: [i32; 3]) -> Option<Crossing> {
    let known = middle.iter().all(|m| (0..=4).contains(m));
    known.then(|| (25 * middle[0] + 5 * middle[1] + middle[2]) as Crossing)
}

/// The two nodes of a crossing's edge, in half cells: whole edges have even middles all round.
pub(super) fn ends(crossing: Crossing) -> [[i32; 3]; 2] {
    let m = middle(crossing);
    // A half edge has one odd coordinate; a whole edge runs along the one axis where it is 2.
    match m.iter().position(|x| x % 2 == 1) {
        Some(axis) => {
            let (mut a, mut b) = (m, m);
            a[axis] -= 1;
            b[axis] += 1;
            [a.map(|x| x / 2), b.map(|x| x / 2)]
        }
        None => {
            let axis = m.iter().position(|x| *x == 2).expect("an edge has a direction");
            let (mut a, mut b) = (m.map(|x| x / 2), m.map(|x| x / 2));
            a[axis] = 0;
            b[axis] = 2;
            [a, b]
        }
    }
}

/// Where the straight line through the values at a crossing's ends crosses the surface, in grid coordinates of the
/// level of `around`; `c` is the leaf. `None`, with the last node within, of an edge that leaves the frame.
pub(super) fn crossing_on(
    around: &Around,
    c: [usize; 3],
    crossing: Crossing,
    cells: [i32; 3],
) -> (Option<DVec3>, DVec3) {
    let own = around.block.key.map(|b| 8 * b);
    let base: [i32; 3] = std::array::from_fn(|a| own[a] + c[a] as i32);
    let [a, b] = ends(crossing);
    let at = |n: [i32; 3]| DVec3::from_array(std::array::from_fn(|i| f64::from(2 * base[i] + n[i]) * 0.5));
    let is_in = |n: [i32; 3]| (0..3).all(|i| (0..=2 * cells[i]).contains(&(2 * base[i] + n[i])));
    let (p, q) = (at(a), at(b));
    match (is_in(a), is_in(b)) {
        (true, true) => {
            let [v, w] = [a, b].map(|n| f64::from(value(around, c, n)));
            let point = p + (q - p) * share(v, w);
            (Some(point), point)
        }
        (true, false) => (None, p),
        _ => (None, q),
    }
}

/// The place of [`crossing_on`].
pub(super) fn crossing_point(around: &Around, c: [usize; 3], crossing: Crossing, cells: [i32; 3]) -> DVec3 {
    crossing_on(around, c, crossing, cells).1
}

/// Where along an edge with the values `v`, `w` at its ends the surface crosses: never at an end, which other edges
/// have too.
#[inline(always)]
pub(super) fn share(v: f64, w: f64) -> f64 {
    let t = v / (v - w);
    if t.is_finite() {
        t.clamp(MARGIN, 1.0 - MARGIN)
    } else {
        0.5
    }
}

/// Share of an edge that crossings, and vertices of a leaf, keep from its ends: no two vertices are then one point.
pub(super) const MARGIN: f64 = 1.0 / 256.0;

/// Value at a node of a leaf's surface, in half cells from its first corner.
fn value(around: &Around, c: [usize; 3], n: [i32; 3]) -> f32 {
    if n.iter().all(|x| x % 2 == 0) {
        let corner = std::array::from_fn(|a| c[a] + n[a] as usize / 2);
        return around.block.sample.values[super::grid::node_index(corner)];
    }
    let cell = c.map(|c| c as i32);
    let fine = std::array::from_fn(|a| 2 * cell[a] + n[a]);
    // The cells that have the node: beside the leaf wherever the node is at its side.
    for pick in 0..8 {
        let beside: [i32; 3] = std::array::from_fn(|a| {
            let out = if n[a] == 1 { 0 } else { n[a] - 1 };
            cell[a] + if pick >> a & 1 == 1 { out } else { 0 }
        });
        if around.state(beside) == State::Split {
            return around.fine_node(beside, fine).1;
        }
    }
    0.0
}
