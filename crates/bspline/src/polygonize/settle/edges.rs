//! Which triangle lies across an edge.

use rayon::prelude::*;

/// No triangle across: the edge lies on the border of an open mesh.
pub(super) const NONE: u32 = u32::MAX;

/// Triangles with the half-edges across from theirs.
///
/// Half-edge `3t + k` runs from corner `k` of triangle `t` to the next corner.
pub(super) struct Edges<'a> {
    pub triangles: &'a mut [[u32; 3]],
    /// The half-edge along the same edge in the other triangle, or [`NONE`].
    pub twin: Vec<u32>,
    /// A half-edge that starts at each vertex, [`NONE`] for a vertex without triangles.
    pub out: Vec<u32>,
}

/// The half-edge after `h` in its triangle.
#[inline(always)]
pub(super) fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// The half-edge before `h` in its triangle.
#[inline(always)]
pub(super) fn before(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

impl<'a> Edges<'a> {
    /// # Panics
    /// If there are more half-edges than 32 bits can name.
    pub fn new(triangles: &'a mut [[u32; 3]], vertex_count: usize) -> Self {
        let half_edges = triangles.len() * 3;
        assert!(half_edges < NONE as usize, "half-edges are numbered with 32 bits");
        let mut first = vec![0u32; vertex_count + 1];
        for &v in triangles.as_flattened() {
            first[v as usize + 1] += 1;
        }
        for v in 0..vertex_count {
            first[v + 1] += first[v];
        }
        let mut outgoing = vec![0u32; half_edges];
        let mut slot = first.clone();
        for (h, &v) in triangles.as_flattened().iter().enumerate() {
            outgoing[slot[v as usize] as usize] = h as u32;
            slot[v as usize] += 1;
        }
        let corners = triangles.as_flattened();
        let end = |h: u32| corners[next(h) as usize];
        let of = |v: u32| &outgoing[first[v as usize] as usize..first[v as usize + 1] as usize];
        let twin = (0..half_edges as u32)
            .into_par_iter()
            .with_min_len(4096)
            .map(|h| {
                let start = corners[h as usize];
                of(end(h))
                    .iter()
                    .copied()
                    .find(|&g| end(g) == start)
                    .unwrap_or(NONE)
            })
            .collect();
        let out = (0..vertex_count as u32)
            .map(|v| of(v).first().copied().unwrap_or(NONE))
            .collect();
        Self { triangles, twin, out }
    }

    /// The vertex that a half-edge starts from.
    #[inline(always)]
    pub fn start(&self, h: u32) -> u32 {
        self.triangles.as_flattened()[h as usize]
    }

    /// The vertex across from a half-edge in its triangle.
    #[inline(always)]
    pub fn apex(&self, h: u32) -> u32 {
        self.start(before(h))
    }

    /// Whether an edge joins `a` and `b`; `true` where a border keeps from telling.
    pub fn joined(&self, a: u32, b: u32) -> bool {
        let first = self.out[a as usize];
        let mut h = first;
        loop {
            if self.start(next(h)) == b {
                return true;
            }
            h = self.twin[before(h) as usize];
            if h == NONE {
                return true;
            }
            if h == first {
                return false;
            }
        }
    }

    /// Number of edges at `v`; 0 at a border.
    pub fn valence(&self, v: u32) -> usize {
        let first = self.out[v as usize];
        let (mut h, mut count) = (first, 0);
        loop {
            count += 1;
            h = self.twin[before(h) as usize];
            if h == NONE {
                return 0;
            }
            if h == first {
                return count;
            }
        }
    }

    /// Turns the edge of `h` in the quadrilateral of its two triangles: `abc` and `bad` become `adc` and `bcd`.
    pub fn flip(&mut self, h: u32) {
        let g = self.twin[h as usize];
        let (a, b, c, d) = (self.start(h), self.start(g), self.apex(h), self.apex(g));
        let (bc, ca) = (self.twin[next(h) as usize], self.twin[before(h) as usize]);
        let (ad, db) = (self.twin[next(g) as usize], self.twin[before(g) as usize]);
        let (t, s) = (h / 3, g / 3);
        self.triangles[t as usize] = [a, d, c];
        self.triangles[s as usize] = [b, c, d];
        for (half, across) in [
            (3 * t, ad),
            (3 * t + 1, 3 * s + 1),
            (3 * t + 2, ca),
            (3 * s, bc),
            (3 * s + 1, 3 * t + 1),
            (3 * s + 2, db),
        ] {
            self.twin[half as usize] = across;
            if across != NONE {
                self.twin[across as usize] = half;
            }
        }
        for (v, half) in [(a, 3 * t), (b, 3 * s), (c, 3 * t + 2), (d, 3 * s + 2)] {
            self.out[v as usize] = half;
        }
    }
}
