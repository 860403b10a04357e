//! The triangles: one polygon for each minimal edge that the surface crosses, through the leaves about it.

use glam::{DAffine3, DVec3};

use super::around::{Around, State};
use super::grid::cell_index;
use super::surface::{Crossing, crossing_at, crossing_point, middle};
use super::vertices::BlockVertices;
use crate::polygonize::PolygonizeError;
use crate::polygonize::blocks::{CELLS, NODES};

/// Vertices that no leaf has are numbered from here until all are known.
pub(super) const EXTRA: u32 = 1 << 31;

/// All vertices, by level and block, and the number of the first one of each block.
pub(super) struct Numbered<'a, F> {
    pub vertices: &'a [Vec<BlockVertices>],
    pub first: F,
    /// Coarsest cells of the frame.
    pub cells: [i32; 3],
    pub mirrored: bool,
    /// By level.
    pub grid_from_world: &'a [DAffine3],
    pub depth: usize,
    /// Leave out what lies on the frame's faces.
    pub open: bool,
}

/// The triangles of a block.
#[derive(Default)]
pub(super) struct BlockTriangles {
    pub triangles: Vec<[u32; 3]>,
    /// Further vertices, [`EXTRA`] and on: what they are, and where, in grid coordinates of the level of the block.
    pub extras: Vec<(ExtraKey, DVec3)>,
}

/// Place of a vertex that no leaf has: twice the sum of the places that it lies between, in the finest half cells.
pub(super) type ExtraKey = [i64; 6];

/// A leaf at a minimal edge.
#[derive(Clone, Copy)]
struct Leaf {
    state: State,
    /// Its block among those of its level, and the leaf in it.
    block: usize,
    local: [usize; 3],
    crossing: Crossing,
    vertex: u32,
}

/// Steps from one leaf round an edge to the next: the axis after the edge's, or the one after that, and which way.
const TURNS: [(usize, i32); 4] = [(1, 1), (2, 1), (1, -1), (2, -1)];

impl<F: Fn(usize, usize) -> u32> Numbered<'_, F> {
    /// Makes the triangles of the minimal edges that a block owns.
    pub fn triangles(&self, around: &Around, out: &mut BlockTriangles) -> Result<(), PolygonizeError> {
        let rows = &around.block.sample.rows;
        let row = |i: usize, j: usize| rows[NODES * i + j];
        for i in 0..NODES {
            for j in 0..NODES {
                let own = row(i, j);
                let mut edges = |axis: usize, mut bits: u16| {
                    while bits != 0 {
                        let k = bits.trailing_zeros() as usize;
                        bits &= bits - 1;
                        self.polygon(around, [i, j, k], axis, own >> k & 1 == 1, out)?;
                    }
                    Ok(())
                };
                if i < CELLS {
                    edges(0, own ^ row(i + 1, j))?;
                }
                if j < CELLS {
                    edges(1, own ^ row(i, j + 1))?;
                }
                edges(2, (own ^ own >> 1) & 0xff)?;
            }
        }
        Ok(())
    }

    /// The polygon of the edge from node `n` of a block along `axis`, if it is a minimal edge that the block owns.
    fn polygon(
        &self,
        around: &Around,
        n: [usize; 3],
        axis: usize,
        inside_first: bool,
        out: &mut BlockTriangles,
    ) -> Result<(), PolygonizeError> {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let places: [[i32; 3]; 4] = [[-1, -1], [0, -1], [0, 0], [-1, 0]].map(|[du, dv]| {
            let mut c = n.map(|n| n as i32);
            c[u] += du;
            c[v] += dv;
            c
        });
        let states = places.map(|c| around.state(c));
        let Some(owner) = states.iter().position(|s| *s == State::Leaf) else {
            return Ok(());
        };
        let is_own = places[owner].iter().all(|c| (0..CELLS as i32).contains(c));
        if !is_own || states.contains(&State::Split) {
            return Ok(());
        }
        let origin = around.block.key.map(|b| b * CELLS as i32);
        if self.open {
            let ends = [0, 1].map(|step| {
                (0..3).all(|a| {
                    let at = origin[a] + n[a] as i32 + if a == axis { step } else { 0 };
                    (0..=self.cells[a] << around.level).contains(&at)
                })
            });
            if ends != [true; 2] {
                return Ok(());
            }
        }
        let inconsistent = || PolygonizeError::InconsistentField {
            block: around.block.key,
        };
        // Twice the middle of the edge, in half cells from the block's first node.
        let mut middle = n.map(|n| 4 * n as i32);
        middle[axis] += 2;
        let mut ring = [None; 4];
        for (k, c) in places.into_iter().enumerate() {
            ring[k] = self.leaf(around, c, states[k], middle);
        }
        let mut leaves = [ring[0].ok_or_else(inconsistent)?; 4];
        for k in 1..4 {
            leaves[k] = ring[k].ok_or_else(inconsistent)?;
        }
        let mut sides = [None; 4];
        let mut any = false;
        for k in 0..4 {
            let next = leaves[(k + 1) % 4];
            if leaves[k].vertex != next.vertex {
                let (turn, way) = TURNS[k];
                sides[k] = self.doubled(around, &leaves[k], &next, (axis + turn) % 3, way, &mut out.extras);
                any |= sides[k].is_some();
            }
        }
        let forward = inside_first != self.mirrored;
        let mut triangle = |a: u32, b: u32, c: u32| {
            out.triangles.push(if forward { [a, b, c] } else { [a, c, b] });
        };
        if any {
            let owner = leaves[owner];
            let point = crossing_point(
                around,
                owner.local,
                owner.crossing,
                self.level_cells(around.level),
            );
            let at = self.code(around.level, around.block.key, owner.local, owner.crossing);
            let center = EXTRA + out.extras.len() as u32;
            // Drawn from the edge, on which the vertex of a leaf beyond the frame may stand.
            let corners = leaves.map(|l| self.position(around, &l)).iter().sum::<DVec3>() / 4.0;
            let amid = self.grid_from_world[around.level].transform_point3(corners);
            out.extras
                .push(([at[0], at[1], at[2], -1, -1, -1], 0.5 * (point + amid)));
            let mut corners = Vec::with_capacity(8);
            for k in 0..4 {
                if leaves[k].vertex != leaves[(k + 3) % 4].vertex {
                    corners.push(leaves[k].vertex);
                }
                corners.extend(sides[k]);
            }
            for k in 0..corners.len() {
                triangle(center, corners[k], corners[(k + 1) % corners.len()]);
            }
            return Ok(());
        }
        let [a, b, c, d] = leaves.map(|l| l.vertex);
        // A leaf on two sides of the edge.
        if let Some(k) = (0..4).find(|k| leaves[*k].vertex == leaves[(k + 1) % 4].vertex) {
            let at = |i: usize| leaves[(k + i) % 4].vertex;
            triangle(at(1), at(2), at(3));
            return Ok(());
        }
        // Leaves across the edge from each other share no more than it if one of them is no larger.
        let is_fine = |k: usize| leaves[k].state == State::Leaf;
        let (first, second) = (is_fine(0) || is_fine(2), is_fine(1) || is_fine(3));
        let length = |k: usize| {
            self.position(around, &leaves[k])
                .distance_squared(self.position(around, &leaves[k + 2]))
        };
        if first && (!second || length(0) <= length(1)) {
            triangle(a, b, c);
            triangle(a, c, d);
        } else {
            triangle(a, b, d);
            triangle(b, c, d);
        }
        Ok(())
    }

    fn level_cells(&self, level: usize) -> [i32; 3] {
        self.cells.map(|n| n << level)
    }

    fn vertices_of(&self, around: &Around, leaf: &Leaf) -> &BlockVertices {
        let level = around.level - usize::from(leaf.state == State::Coarse);
        &self.vertices[level][leaf.block]
    }

    fn position(&self, around: &Around, leaf: &Leaf) -> DVec3 {
        let level = around.level - usize::from(leaf.state == State::Coarse);
        let first = (self.first)(level, leaf.block);
        self.vertices[level][leaf.block].positions[(leaf.vertex - first) as usize]
    }

    /// The leaf that holds the cell `c` of the block's level, and its vertex for the crossing on the edge of that
    /// middle (twice, in half cells from the block's first node).
    fn leaf(&self, around: &Around, c: [i32; 3], state: State, middle: [i32; 3]) -> Option<Leaf> {
        let level = around.level;
        let (level, (block, local), crossing) = if state == State::Coarse {
            // The coarse cell and its half cells are twice as large.
            let key = around.block.key;
            let from: [i32; 3] = std::array::from_fn(|a| {
                let place = middle[a] + 4 * CELLS as i32 * key[a];
                let cell = (CELLS as i32 * key[a] + c[a]) >> 1;
                place / 2 - 4 * cell
            });
            (level.checked_sub(1)?, around.find_coarse(c)?, from)
        } else {
            let from = std::array::from_fn(|a| middle[a] - 4 * c[a]);
            (level, around.find(c)?, from)
        };
        let crossing = crossing_at(crossing)?;
        let vertex = self.vertices[level][block].vertex(local, || Some(crossing))?;
        Some(Leaf {
            state,
            block,
            local,
            crossing,
            vertex: (self.first)(level, block) + vertex,
        })
    }

    /// Place of a crossing in the finest half cells, doubled.
    fn code(&self, level: usize, key: [i32; 3], local: [usize; 3], crossing: Crossing) -> [i64; 3] {
        let m = middle(crossing);
        std::array::from_fn(|a| {
            let cell = CELLS as i32 * key[a] + local[a] as i32;
            (4 * i64::from(cell) + i64::from(m[a])) << (self.depth - level)
        })
    }

    /// The vertex to put into the side between two leaves of a polygon, if their vertices are joined through their
    /// common face twice: in the middle of the segment that the side crosses.
    fn doubled(
        &self,
        around: &Around,
        a: &Leaf,
        b: &Leaf,
        axis: usize,
        way: i32,
        extras: &mut Vec<(ExtraKey, DVec3)>,
    ) -> Option<u32> {
        let (small, large, way) = if a.state == State::Leaf {
            (a, b, way)
        } else {
            (b, a, -way)
        };
        let own = self.vertices_of(around, small);
        if own.twice.is_empty() {
            return None;
        }
        let level = around.level - usize::from(small.state == State::Coarse);
        let block = &around.tree[level][small.block];
        let leaf = cell_index(small.local) as u16;
        let face = 5 * (2 * axis as u8 + u8::from(way > 0));
        let on_face = || own.twice.iter().filter(|(l, s)| *l == leaf && s.face == face);
        let segment = on_face()
            .map(|(_, s)| s)
            .find(|s| s.from == small.crossing || s.to == small.crossing)?;
        let other = self.vertices_of(around, large);
        let large_level = around.level - usize::from(large.state == State::Coarse);
        let large_block = &around.tree[large_level][large.block];
        let loop_in_large = |crossing: Crossing| {
            let place = self.code(level, block.key, small.local, crossing);
            let from: [i32; 3] = std::array::from_fn(|i| {
                let cell = CELLS as i32 * large_block.key[i] + large.local[i] as i32;
                ((place[i] >> (self.depth - large_level)) - 4 * i64::from(cell)) as i32
            });
            crossing_at(from).map(|c| other.loop_of(cell_index(large.local), c))
        };
        let mine = loop_in_large(small.crossing);
        let is_doubled = on_face().any(|(_, s)| {
            s.from != segment.from && s.of_loop == segment.of_loop && loop_in_large(s.from) == mine
        });
        if !is_doubled {
            return None;
        }
        let inner = Around::new(around.tree, level, block);
        let cells = self.level_cells(level);
        let ends = [segment.from, segment.to];
        let [p, q] = ends.map(|c| crossing_point(&inner, small.local, c, cells));
        let scale = ((around.level - level) as f64).exp2();
        let [mut s, mut t] = ends.map(|c| self.code(level, block.key, small.local, c));
        if t < s {
            (s, t) = (t, s);
        }
        // Off the straight line, on which the vertex of a leaf may lie that has these two crossings only.
        let mut center = DVec3::from_array(std::array::from_fn(|a| {
            f64::from(CELLS as i32 * block.key[a] + small.local[a] as i32) + 0.5
        }));
        center[axis] += if way > 0 { 0.5 } else { -0.5 };
        let at = 0.75 * (0.5 * (p + q)) + 0.25 * center;
        extras.push(([s[0], s[1], s[2], t[0], t[1], t[2]], at * scale));
        Some(EXTRA + extras.len() as u32 - 1)
    }
}
