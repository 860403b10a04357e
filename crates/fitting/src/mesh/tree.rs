//! A tree of boxes over triangles.

use glam::DVec3;
use rayon::prelude::*;

/// Triangles in a leaf: 2, 4 and 8 were tried on a scan of 70 000 triangles, 4 is the fastest.
const LEAF: usize = 4;
/// Triangles below which a subtree is built by one thread.
const SERIAL: usize = 4096;

/// A box of the tree. The left child of node `i` is `i + 1`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    pub min: DVec3,
    pub max: DVec3,
    /// First triangle of a leaf, right child of an inner node.
    pub first: u32,
    /// Triangles of a leaf, 0 of an inner node.
    pub count: u32,
}

impl Node {
    /// Square of the distance from `p` to the box.
    #[inline]
    pub fn distance_squared(&self, p: DVec3) -> f64 {
        (self.min - p).max(p - self.max).max(DVec3::ZERO).length_squared()
    }

    /// Whether two boxes touch.
    #[inline]
    pub fn touches(&self, min: DVec3, max: DVec3) -> bool {
        self.min.cmple(max).all() && min.cmple(self.max).all()
    }
}

/// Triangles in the order of their leaves, and the boxes above them.
#[derive(Clone, Debug)]
pub(crate) struct TriangleTree {
    pub nodes: Vec<Node>,
    /// Corners, counterclockwise seen from outside.
    pub corners: Vec<[DVec3; 3]>,
    /// Index that each triangle had in the slice given to [`TriangleTree::new`].
    pub ids: Vec<u32>,
}

impl TriangleTree {
    /// Splits at the median centroid of the longest axis, down to leaves of four. Needs at least one triangle.
    pub fn new(triangles: &[[DVec3; 3]]) -> Self {
        let centroids: Vec<DVec3> = triangles.par_iter().map(|t| (t[0] + t[1] + t[2]) / 3.0).collect();
        let mut ids: Vec<u32> = (0..triangles.len() as u32).collect();
        let blank = Node {
            min: DVec3::INFINITY,
            max: DVec3::NEG_INFINITY,
            first: 0,
            count: 0,
        };
        let mut nodes = vec![blank; node_count(ids.len())];
        fill(&mut nodes, &mut ids, [0, 0], triangles, &centroids);
        let corners = ids.iter().map(|&i| triangles[i as usize]).collect();
        Self { nodes, corners, ids }
    }
}

/// Nodes of a subtree over `n` triangles.
fn node_count(n: usize) -> usize {
    if n <= LEAF {
        1
    } else {
        1 + node_count(n / 2) + node_count(n - n / 2)
    }
}

/// Builds the subtree over `ids`; `base` are the indices of its root and of its first triangle.
fn fill(
    nodes: &mut [Node],
    ids: &mut [u32],
    base: [usize; 2],
    triangles: &[[DVec3; 3]],
    centroids: &[DVec3],
) {
    let (root, below) = nodes.split_first_mut().expect("a subtree has a root");
    if ids.len() <= LEAF {
        for &i in ids.iter() {
            for p in triangles[i as usize] {
                root.min = root.min.min(p);
                root.max = root.max.max(p);
            }
        }
        (root.first, root.count) = (base[1] as u32, ids.len() as u32);
        return;
    }
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &i in ids.iter() {
        low = low.min(centroids[i as usize]);
        high = high.max(centroids[i as usize]);
    }
    let axis = (high - low).max_position();
    let middle = ids.len() / 2;
    ids.select_nth_unstable_by(middle, |&a, &b| {
        centroids[a as usize][axis]
            .total_cmp(&centroids[b as usize][axis])
            .then(a.cmp(&b))
    });
    let serial = ids.len() < SERIAL;
    let (left_ids, right_ids) = ids.split_at_mut(middle);
    let left_count = node_count(middle);
    let (left, right) = below.split_at_mut(left_count);
    let right_at = base[0] + 1 + left_count;
    let mut do_left = || fill(left, left_ids, [base[0] + 1, base[1]], triangles, centroids);
    let mut do_right = || {
        fill(
            right,
            right_ids,
            [right_at, base[1] + middle],
            triangles,
            centroids,
        )
    };
    if serial {
        do_left();
        do_right();
    } else {
        rayon::join(do_left, do_right);
    }
    root.first = right_at as u32;
    root.min = left[0].min.min(right[0].min);
    root.max = left[0].max.max(right[0].max);
}
