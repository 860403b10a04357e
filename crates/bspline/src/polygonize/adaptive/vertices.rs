//! The vertices of a block: one for each loop of each leaf.

use glam::DVec3;

use super::around::Around;
use super::cases;
use super::grid::{Cells, Grids, NODE_COUNT, bit, cell_index, each, holds, node_index, rank};
use super::surface::{Crossing, LeafSurface, MARGIN, Segment, crossing_on, share};
use super::tree::leaves;
use crate::Field;
use crate::polygonize::blocks::{BlockKey, CELLS};
use crate::polygonize::table::edge_place;

/// Bits of a vertex's key that number the loops of its leaf.
pub(super) const LOOP_BITS: u32 = 4;
/// Bits of a vertex's key for each coordinate of its leaf.
pub(super) const PLACE_BITS: u32 = 20;

/// Newton steps that take a vertex onto the surface: two, as the second is the size of the square of the first.
pub(super) const STEPS: usize = 2;

/// The vertices of a block.
#[derive(Default)]
pub(super) struct BlockVertices {
    /// Leaves that have vertices, which are in their order.
    holding: Cells,
    /// Leaves with several loops, and how many more than one.
    more: Vec<(u16, u8)>,
    /// Leaves with several loops: their crossings with their loops, by leaf and name.
    crossings: Vec<(u16, Crossing, u8)>,
    /// Segments of leaves that share their minimal face with another segment of the same loop, by leaf.
    pub twice: Vec<(u16, Segment)>,
    pub positions: Vec<DVec3>,
    /// Names within the block, rising: number of the leaf, then of the loop.
    pub names: Vec<u16>,
    /// Vertices on the cap, which stay where they are.
    pub fixed: Vec<bool>,
}

/// What to place vertices by.
#[derive(Clone, Copy)]
pub(super) struct Placer<'a> {
    pub field: &'a dyn Field,
    pub grids: &'a Grids,
    pub iso: f64,
    /// Newton steps onto the surface, but for vertices on the cap's border: these always take [`STEPS`].
    pub steps: usize,
}

/// Buffers that a thread uses again from block to block.
#[derive(Default)]
pub(super) struct Scratch {
    surface: LeafSurface,
    answers: Vec<(f64, DVec3)>,
    cells: Vec<[i32; 3]>,
}

impl BlockVertices {
    /// The vertex of a leaf's loop that has that crossing; `None` if there is none.
    #[inline]
    pub fn vertex(&self, c: [usize; 3], crossing: impl FnOnce() -> Option<Crossing>) -> Option<u32> {
        if !holds(&self.holding, c) {
            return None;
        }
        let mut first = rank(&self.holding, c) as u32;
        if self.crossings.is_empty() {
            return Some(first);
        }
        let leaf = cell_index(c);
        let before = self.more.iter().take_while(|(l, _)| usize::from(*l) < leaf);
        first += before.map(|(_, n)| u32::from(*n)).sum::<u32>();
        Some(first + u32::from(self.loop_of(leaf, crossing()?)))
    }

    /// Which loop of a leaf a crossing belongs to.
    pub fn loop_of(&self, leaf: usize, crossing: Crossing) -> u8 {
        let at = self
            .crossings
            .binary_search_by_key(&(leaf as u16, crossing), |&(l, c, _)| (l, c));
        at.map_or(0, |n| self.crossings[n].2)
    }

    /// Number of the vertex of that name.
    pub fn find(&self, name: u16) -> Option<usize> {
        self.names.binary_search(&name).ok()
    }

    /// Whether the vertices of another version of the block are these, to the bit.
    pub fn is_same(&self, other: &Self) -> bool {
        (self.holding, &self.more, &self.crossings, &self.twice)
            == (other.holding, &other.more, &other.crossings, &other.twice)
            && (&self.names, &self.fixed) == (&other.names, &other.fixed)
            && (0..self.names.len()).all(|n| self.is_same_at(n, other, n))
    }

    /// Whether a vertex is one of another version of the block, to the bit.
    pub fn is_same_at(&self, n: usize, other: &Self, k: usize) -> bool {
        let bits = |p: DVec3| p.to_array().map(f64::to_bits);
        bits(self.positions[n]) == bits(other.positions[k]) && self.fixed[n] == other.fixed[k]
    }

    /// Leaves whose vertices differ from those of another version of the block.
    pub fn changed(&self, other: &Self) -> Cells {
        let mut found = [0; CELLS];
        let mut put = |leaf: u16| {
            let c = [leaf >> 6, leaf >> 3 & 7, leaf & 7].map(usize::from);
            found[c[0]] |= bit(c);
        };
        for (one, two) in [(self, other), (other, self)] {
            for (n, name) in one.names.iter().enumerate() {
                if !two.find(*name).is_some_and(|k| one.is_same_at(n, two, k)) {
                    put(name >> LOOP_BITS);
                }
            }
            let loops = one.crossings.iter().filter(|c| !two.crossings.contains(c));
            let twice = one.twice.iter().filter(|s| !two.twice.contains(s));
            for leaf in loops.map(|c| c.0).chain(twice.map(|s| s.0)) {
                put(leaf);
            }
        }
        found
    }

    /// Finds and places the vertices of a block.
    pub fn new(placer: &Placer, around: &Around, scratch: &mut Scratch) -> Self {
        Self::renewed(placer, around, None, scratch)
    }

    /// [`Self::new`] where of the cells of `known` all but some are as they were when its vertices were placed.
    pub fn renewed(
        placer: &Placer,
        around: &Around,
        known: Option<(&Self, &Cells)>,
        scratch: &mut Scratch,
    ) -> Self {
        let (grids, level, block) = (placer.grids, around.level, around.block);
        let own = block.key.map(|b| b * CELLS as i32);
        let cells: [i32; 3] = std::array::from_fn(|a| grids.cells(level, a));
        let leaves = leaves(block);
        let crossed = block.sample.crossed;
        let beside = around.beside_split();
        let border = grids.meets_border(level, block.key);
        let mut made = Self::default();
        scratch.cells.clear();
        let stale = known.map_or([u64::MAX; CELLS], |(_, stale)| *stale);
        let candidates: Cells = std::array::from_fn(|x| leaves[x] & (crossed[x] | beside[x]) & stale[x]);
        for c in each(candidates) {
            let cell: [i32; 3] = std::array::from_fn(|a| own[a] + c[a] as i32);
            let capped = border && (0..3).any(|a| cell[a] < 0 || cell[a] >= cells[a]);
            let case = cases::case(block.sample.case(c));
            let leaf = cell_index(c) as u16;
            if !capped && !holds(&beside, c) && case.loops == 1 && case.ambiguous == 0 {
                made.holding[c[0]] |= bit(c);
                made.push(
                    mean_of_edges(&block.sample.values, c, case.edges) + place(own),
                    leaf << LOOP_BITS,
                    false,
                );
                scratch.cells.push(cell);
                continue;
            }
            let surface = &mut scratch.surface;
            surface.find(around, c);
            if surface.loops == 0 {
                continue;
            }
            made.holding[c[0]] |= bit(c);
            for n in 0..surface.loops {
                let own_segments = || {
                    surface
                        .segments
                        .iter()
                        .filter(move |s| usize::from(s.of_loop) == n)
                };
                let points = own_segments().map(|s| crossing_on(around, c, s.from, cells));
                let at = if capped {
                    cap_vertex(placer, level, cell, cells, points)
                } else {
                    let count = own_segments().count() as f64;
                    points.map(|p| p.1).sum::<DVec3>() / count
                };
                made.push(at, leaf << LOOP_BITS | n as u16, capped);
                scratch.cells.push(cell);
            }
            if surface.loops > 1 {
                let start = made.crossings.len();
                made.crossings
                    .extend(surface.segments.iter().map(|s| (leaf, s.from, s.of_loop)));
                made.crossings[start..].sort_unstable();
                made.more.push((leaf, surface.loops as u8 - 1));
            }
            let segments = &surface.segments;
            let same = |s: &Segment, t: &Segment| s.face == t.face && s.of_loop == t.of_loop;
            let twice = segments
                .iter()
                .filter(|s| segments.iter().filter(|t| same(s, t)).count() > 1);
            made.twice.extend(twice.map(|s| (leaf, *s)));
        }
        // Leaves with one loop beside others with several need no names: the lookup gives them loop 0.
        made.place(placer, level, scratch);
        match known {
            Some((known, stale)) => made.with_others(known, stale),
            None => {
                made.positions.shrink_to_fit();
                made.names.shrink_to_fit();
                made.fixed.shrink_to_fit();
                made
            }
        }
    }

    /// Adds the vertices of another version of the block but for those of some cells.
    fn with_others(self, other: &Self, but: &Cells) -> Self {
        let is_kept = |leaf: u16| {
            let c = [leaf >> 6, leaf >> 3 & 7, leaf & 7].map(usize::from);
            !holds(but, c)
        };
        let mut both = Self {
            holding: std::array::from_fn(|x| self.holding[x] | other.holding[x] & !but[x]),
            ..Self::default()
        };
        let kept = (0..other.names.len()).filter(|n| is_kept(other.names[*n] >> LOOP_BITS));
        let mut from: Vec<(&Self, usize)> = kept.map(|n| (other, n)).collect();
        from.extend((0..self.names.len()).map(|n| (&self, n)));
        from.sort_unstable_by_key(|(of, n)| of.names[*n]);
        for (of, n) in from {
            both.push(of.positions[n], of.names[n], of.fixed[n]);
        }
        both.more = joined(&other.more, &self.more, |m| m.0, is_kept);
        both.crossings = joined(&other.crossings, &self.crossings, |c| c.0, is_kept);
        both.twice = joined(&other.twice, &self.twice, |s| s.0, is_kept);
        both
    }

    fn push(&mut self, at: DVec3, name: u16, fixed: bool) {
        self.positions.push(at);
        self.names.push(name);
        self.fixed.push(fixed);
    }

    /// Moves the vertices, given in the grid's coordinates, onto the surface and into the world.
    fn place(&mut self, placer: &Placer, level: usize, scratch: &mut Scratch) {
        let frame = &placer.grids.frames[level];
        let grid_from_world = frame.world_from_grid.inverse();
        let longest = 0.5 * placer.grids.size(level).max_element();
        let starts = self.positions.clone();
        for p in &mut self.positions {
            *p = frame.world_from_grid.transform_point3(*p);
        }
        project(
            placer,
            &mut self.positions,
            &self.fixed,
            longest,
            &mut scratch.answers,
        );
        for (n, p) in self.positions.iter_mut().enumerate() {
            if self.fixed[n] {
                continue;
            }
            // Kept in its leaf, so that the triangles do not pass through each other.
            let q = grid_from_world.transform_point3(*p);
            let low = place(scratch.cells[n]) + MARGIN;
            let high = place(scratch.cells[n]) + (1.0 - MARGIN);
            if q != q.clamp(low, high) {
                let start = starts[n].clamp(low, high);
                let way = q - start;
                let share = (0..3)
                    .map(|a| match way[a] {
                        w if w > 0.0 => (high[a] - start[a]) / w,
                        w if w < 0.0 => (low[a] - start[a]) / w,
                        _ => 1.0,
                    })
                    .fold(1.0, f64::min);
                let q = start + way * share.clamp(0.0, 1.0);
                *p = frame.world_from_grid.transform_point3(q);
            }
        }
    }
}

/// What is said of the leaves kept, and of others, in the order of the leaves.
fn joined<E: Copy>(old: &[E], new: &[E], leaf: impl Fn(&E) -> u16, is_kept: impl Fn(u16) -> bool) -> Vec<E> {
    let kept = old.iter().filter(|e| is_kept(leaf(e)));
    let mut both: Vec<E> = kept.chain(new).copied().collect();
    // Those of a leaf stay in their order.
    both.sort_by_key(leaf);
    both
}

/// Newton steps onto the surface, none longer than `longest`.
fn project(
    placer: &Placer,
    positions: &mut [DVec3],
    fixed: &[bool],
    longest: f64,
    answers: &mut Vec<(f64, DVec3)>,
) {
    answers.resize(positions.len(), (0.0, DVec3::ZERO));
    for _ in 0..placer.steps {
        placer.field.values_gradients(positions, answers);
        for ((p, (f, g)), fixed) in positions.iter_mut().zip(answers.iter()).zip(fixed) {
            let square = g.length_squared();
            let step = *g * ((placer.iso - f) / square);
            let length = step.length();
            if !fixed && length.is_finite() {
                *p += step * (longest / length).min(1.0);
            }
        }
    }
}

fn place(cell: [i32; 3]) -> DVec3 {
    DVec3::from_array(cell.map(f64::from))
}

/// Key of the vertex with that name in the block `key` of a level.
pub(super) fn key_of(depth: usize, level: usize, key: BlockKey, name: u16) -> u64 {
    let (leaf, number) = (name >> LOOP_BITS, name & ((1 << LOOP_BITS) - 1));
    let cell = [leaf >> 6, leaf >> 3 & 7, leaf & 7];
    let place = (0..3).fold(0, |place, a| {
        let cell = i64::from(key[a]) * CELLS as i64 + i64::from(cell[a]);
        place << PLACE_BITS | ((cell << (depth - level)) + (1 << depth)) as u64
    });
    place << LOOP_BITS | u64::from(number)
}

/// Mean of the crossings of a leaf's edges, from the block's first node.
fn mean_of_edges(values: &[f32; NODE_COUNT], c: [usize; 3], edges: u16) -> DVec3 {
    let (mut sum, mut count) = ([0.0f64; 3], 0.0);
    let mut bits = edges;
    while bits != 0 {
        let (axis, at) = edge_place(bits.trailing_zeros() as usize);
        bits &= bits - 1;
        let low: [usize; 3] = std::array::from_fn(|a| c[a] + at[a]);
        let mut high = low;
        high[axis] += 1;
        let (v, w) = (values[node_index(low)], values[node_index(high)]);
        for a in 0..3 {
            sum[a] += low[a] as f64;
        }
        sum[axis] += share(f64::from(v), f64::from(w));
        count += 1.0;
    }
    DVec3::from_array(sum) / count
}

/// Where the vertex of a leaf beyond the frame stands, in grid coordinates: on the border of the cap, if it runs
/// through the leaf, else amid the nodes of the cap.
fn cap_vertex(
    placer: &Placer,
    level: usize,
    cell: [i32; 3],
    cells: [i32; 3],
    points: impl Iterator<Item = (Option<DVec3>, DVec3)>,
) -> DVec3 {
    let (border, nodes): (Vec<Option<DVec3>>, Vec<DVec3>) = points.unzip();
    let border: Vec<DVec3> = border.into_iter().flatten().collect();
    let mean = |points: &[DVec3]| points.iter().sum::<DVec3>() / points.len() as f64;
    if border.is_empty() {
        return mean(&nodes);
    }
    let start = mean(&border);
    // Along the frame's face only.
    let free = DVec3::from_array(std::array::from_fn(|a| {
        f64::from(u8::from(0 <= cell[a] && cell[a] < cells[a]))
    }));
    let frame = &placer.grids.frames[level];
    let m = frame.world_from_grid.matrix3;
    let mut p = start;
    for _ in 0..STEPS {
        let (f, g) = placer
            .field
            .value_gradient(frame.world_from_grid.transform_point3(p));
        let slope = m.transpose() * g * free;
        let step = slope * ((placer.iso - f) / slope.length_squared());
        if step.is_finite() {
            p += step.clamp_length_max(0.5);
        }
    }
    let kept = p.clamp(place(cell) + MARGIN, place(cell) + (1.0 - MARGIN));
    DVec3::select(free.cmpeq(DVec3::ONE), kept, start)
}
