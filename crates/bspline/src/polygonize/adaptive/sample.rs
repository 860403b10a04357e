//! What a block knows of the field.

use glam::DVec3;

use super::grid::{Cells, Grids, NODE_COUNT, bit, each, holds, node_index, octant_of_set, octant_with, rank};
use crate::polygonize::blocks::{BlockKey, CELLS, NODES};
use crate::{Field, Interval, Jet};

/// Buffers that a thread uses again from block to block.
#[derive(Default)]
pub(super) struct Scratch {
    pub values: Vec<f64>,
    pub points: Vec<DVec3>,
    /// Crossed cells by number, with the bounds of their errors.
    pub owners: Vec<(u16, f32)>,
    pub jets: Vec<Jet>,
}

/// What to judge cells by.
#[derive(Clone, Copy)]
pub(super) struct Judge<'a> {
    pub field: &'a dyn Field,
    pub grids: &'a Grids,
    pub iso: f64,
    /// Of errors up to this an upper bound will do.
    pub least: f64,
    /// Level at which a hidden piece is looked for no longer.
    pub detection: usize,
}

impl Judge<'_> {
    /// Bounds over `count` cells from `lo`, as tight as it takes to tell on which side they lie.
    pub fn bounds(&self, level: usize, lo: [i32; 3], count: i32) -> Interval {
        let (lo, hi) = self.grids.clipped(level, lo, count);
        let frame = &self.grids.frames[level];
        self.field.frame_bounds_about(frame, lo, hi, self.iso)
    }
}

/// A pure function of field, frames, level and block, but for how many cells have been judged.
#[derive(Clone)]
pub(super) struct Sample {
    /// Inside nodes: bit `k` of row `9i + j`. Nodes beyond the frame are outside.
    pub rows: [u16; NODES * NODES],
    /// `f - iso` at the nodes, 0 beyond the frame.
    pub values: [f32; NODE_COUNT],
    /// Cells that have corners on both sides.
    pub crossed: Cells,
    /// Chord errors of the crossed cells, in their order, world length.
    pub errors: Box<[f32]>,
    /// Judged cells that may hold surface though their corners are on one side.
    pub hidden: Cells,
    /// Cells judged.
    pub judged: Cells,
    /// Judged cells of which only an upper bound of the error is known.
    pub bounded: Cells,
    /// Judged cells of which only a lower bound of the error is known.
    pub guessed: Cells,
    /// Largest guess of each octant (`4x + 2y + z`).
    pub guesses: [f32; 8],
    /// Octants whose cells without surface were judged by bounds of values alone.
    pub coarse: u8,
    /// Judged cells that may hold a crease.
    pub creased: Cells,
    /// Nodes where the field is not a number.
    pub nan_nodes: u32,
}

impl Default for Sample {
    /// Nothing known.
    fn default() -> Self {
        Self {
            rows: [0; NODES * NODES],
            values: [0.0; NODE_COUNT],
            crossed: [0; CELLS],
            errors: Box::default(),
            hidden: [0; CELLS],
            judged: [0; CELLS],
            bounded: [0; CELLS],
            guessed: [0; CELLS],
            guesses: [0.0; 8],
            coarse: 0,
            creased: [0; CELLS],
            nan_nodes: 0,
        }
    }
}

impl Sample {
    /// Samples the nodes of a block of which nothing is known.
    pub fn fill(&mut self, judge: &Judge, level: usize, key: BlockKey, scratch: &mut Scratch) {
        let nodes = judge
            .grids
            .clipped(level, key.map(|b| b * CELLS as i32), CELLS as i32);
        self.refill(judge, level, key, nodes, 0xff, scratch);
    }

    /// Samples the nodes from `lo` to `hi` again, none if one of these is beyond the other, and forgets what is known of
    /// the cells of the octants `stale`: those that have these nodes, or are one cell away from them.
    pub fn refill(
        &mut self,
        judge: &Judge,
        level: usize,
        key: BlockKey,
        (lo, hi): ([i64; 3], [i64; 3]),
        stale: u8,
        scratch: &mut Scratch,
    ) {
        let grids = judge.grids;
        let origin = key.map(|b| b * CELLS as i32);
        if (0..3).all(|a| lo[a] <= hi[a]) {
            let count: [usize; 3] = std::array::from_fn(|a| (hi[a] - lo[a] + 1) as usize);
            let skip: [usize; 3] = std::array::from_fn(|a| (lo[a] - i64::from(origin[a])) as usize);
            scratch.values.resize(count.iter().product(), 0.0);
            judge
                .field
                .frame_values(&grids.frames[level], lo, count, &mut scratch.values);
            let known = !(((1 << count[2]) - 1) << skip[2]);
            for (n, row) in scratch.values.chunks_exact(count[2]).enumerate() {
                let (i, j) = (n / count[1] + skip[0], n % count[1] + skip[1]);
                let start = node_index([i, j, skip[2]]);
                let mut bits = 0;
                for (k, (&f, out)) in row.iter().zip(&mut self.values[start..]).enumerate() {
                    bits |= ((f > judge.iso) as u16) << k;
                    *out = (f - judge.iso) as f32;
                }
                let row = &mut self.rows[NODES * i + j];
                *row = *row & known | bits << skip[2];
            }
            self.nan_nodes = self.values.iter().map(|f| u32::from(f.is_nan())).sum();
        }
        let crossed = self.find_crossed();
        let before = std::mem::replace(&mut self.crossed, crossed);
        let known = std::mem::take(&mut self.errors);
        for octant in (0..8).filter(|o| stale >> o & 1 == 1) {
            let all = octant_of_set(&[u64::MAX; CELLS], octant);
            for x in 0..CELLS {
                for set in [
                    &mut self.hidden,
                    &mut self.judged,
                    &mut self.bounded,
                    &mut self.creased,
                ] {
                    set[x] &= !all[x];
                }
                self.guessed[x] = self.guessed[x] & !all[x] | self.crossed[x] & all[x];
            }
            self.guesses[octant] = 0.0;
        }
        self.coarse &= !stale;
        let errors = each(self.crossed).map(|c| match stale >> octant_with(c) & 1 {
            0 => known[rank(&before, c)],
            _ => self.guess(judge, level, key, c),
        });
        self.errors = errors.collect();
        for (c, guess) in each(self.crossed).zip(&self.errors) {
            let octant = octant_with(c);
            if stale >> octant & 1 == 1 {
                self.guesses[octant] = self.guesses[octant].max(*guess);
            }
        }
    }

    /// Chord error of a cell, world length: infinite for one that hides surface, 0 without surface.
    pub fn error(&self, c: [usize; 3]) -> f32 {
        if holds(&self.crossed, c) {
            self.errors[rank(&self.crossed, c)]
        } else if holds(&self.hidden, c) {
            f32::INFINITY
        } else {
            0.0
        }
    }

    /// The error of a crossed cell, to be changed.
    pub fn error_mut(&mut self, c: [usize; 3]) -> &mut f32 {
        &mut self.errors[rank(&self.crossed, c)]
    }

    /// Judged ones of `cells` whose errors are larger than this.
    pub fn larger(&self, cells: &Cells, error: f32) -> Cells {
        let mut found: Cells = std::array::from_fn(|x| cells[x] & self.judged[x] & self.hidden[x]);
        for (c, own) in each(self.crossed).zip(&self.errors) {
            if *own > error {
                found[c[0]] |= bit(c) & cells[c[0]] & self.judged[c[0]];
            }
        }
        found
    }

    /// Whether a node is inside.
    #[inline(always)]
    pub fn is_inside(&self, n: [usize; 3]) -> bool {
        self.rows[NODES * n[0] + n[1]] >> n[2] & 1 == 1
    }

    /// Case of a cell: bit `4x + 2y + z` says that the corner is inside.
    #[inline(always)]
    pub fn case(&self, c: [usize; 3]) -> usize {
        let pair = |i: usize, j: usize| (self.rows[NODES * (c[0] + i) + c[1] + j] >> c[2] & 3) as usize;
        pair(0, 0) | pair(0, 1) << 2 | pair(1, 0) << 4 | pair(1, 1) << 6
    }

    fn find_crossed(&self) -> Cells {
        std::array::from_fn(|x| {
            (0..CELLS).fold(0, |word, y| {
                let at = NODES * x + y;
                let r = [at, at + 1, at + NODES, at + NODES + 1].map(|n| self.rows[n]);
                let (any, all) = (r[0] | r[1] | r[2] | r[3], r[0] & r[1] & r[2] & r[3]);
                let open = (any | any >> 1) & !(all & all >> 1) & 0xff;
                word | u64::from(open) << (CELLS * y)
            })
        })
    }

    /// Values at the corners of a cell, in the order of the bits of [`Self::case`].
    pub fn corners(&self, c: [usize; 3]) -> [f32; 8] {
        let at = node_index(c);
        let v = |o: usize| self.values[at + o];
        const X: usize = NODES * NODES;
        [
            v(0),
            v(1),
            v(NODES),
            v(NODES + 1),
            v(X),
            v(X + 1),
            v(X + NODES),
            v(X + NODES + 1),
        ]
    }
}
