//! The surface inside one block: which edges it crosses, and where.

use glam::DVec3;

use super::PolygonizeOptions;
use super::blocks::{BlockCounts, BlockGrid, BlockKey, CELLS, Edge, NODES};
use super::placement::{PlacementScratch, SampledNodes, edge_point, place_vertices};
use super::table::CaseTable;
use crate::{Field, Frame};

/// Words of [`BlockSurface::crossed`].
const WORDS: usize = 3 * CELLS;

/// The part of the surface that a block owns: a pure function of field, frame and block.
pub(super) struct BlockSurface {
    pub key: BlockKey,
    /// Inside nodes: bit `k` of row `9i + j`.
    rows: [u16; NODES * NODES],
    /// Crossed edges from the block's own nodes: word `3i + axis`, bit `8j + k`.
    crossed: [u64; WORDS],
    /// Vertices in the words before each word.
    before: [u16; WORDS],
    /// Edge parameter of each vertex, in the order of the bits of `crossed`.
    pub t: Vec<f64>,
    /// Normal at each vertex, if asked for.
    pub normals: Vec<DVec3>,
    /// Triangles of the block's cells.
    pub triangle_count: u32,
    /// What it cost.
    pub counts: BlockCounts,
}

/// Buffers that a thread uses again from block to block.
#[derive(Default)]
pub(super) struct Scratch {
    values: Vec<f64>,
    edges: Vec<Edge>,
    placement: PlacementScratch,
}

impl BlockSurface {
    /// Samples a block; no surface if none of its edges is crossed. Also counts the block's own nodes where the
    /// field is not a number.
    pub fn sample(
        field: &dyn Field,
        grid: &BlockGrid,
        options: &PolygonizeOptions,
        key: BlockKey,
        scratch: &mut Scratch,
    ) -> (Option<Self>, u32) {
        let (lo, hi) = grid.frame_nodes(key);
        let count = [0, 1, 2].map(|a| (hi[a] - lo[a] + 1) as usize);
        scratch.values.resize(count.iter().product(), 0.0);
        field.frame_values(grid.frame, lo, count, &mut scratch.values);

        let origin = grid.origin(key);
        let skip = [0, 1, 2].map(|a| (lo[a] - origin[a]) as usize);
        let mut rows = [0u16; NODES * NODES];
        let mut nan_nodes = 0;
        let places =
            (skip[0]..skip[0] + count[0]).flat_map(|i| (skip[1]..skip[1] + count[1]).map(move |j| (i, j)));
        for (row, (i, j)) in scratch.values.chunks_exact(count[2]).zip(places) {
            let mut bits = 0;
            for (k, &f) in row.iter().enumerate() {
                bits |= ((f > options.iso) as u16) << k;
            }
            rows[NODES * i + j] = bits << skip[2];
            if i < CELLS && j < CELLS {
                nan_nodes += row[..row.len().min(CELLS - skip[2])]
                    .iter()
                    .map(|f| f.is_nan() as u32)
                    .sum::<u32>();
            }
        }
        if rows.iter().all(|row| *row == 0) {
            return (None, nan_nodes);
        }
        let cells = grid.meshed_cells(key);
        let crossed = crossed_edges(&rows, cells);
        let (cells_crossed, triangle_count) = count_triangles(&rows, cells);
        let vertex_count: u32 = crossed.iter().map(|w| w.count_ones()).sum();
        if vertex_count == 0 && triangle_count == 0 {
            return (None, nan_nodes);
        }
        let mut before = [0; WORDS];
        for w in 1..WORDS {
            before[w] = before[w - 1] + crossed[w - 1].count_ones() as u16;
        }
        let mut counts = BlockCounts {
            cells_crossed,
            ..BlockCounts::default()
        };
        let Scratch {
            values,
            edges,
            placement,
        } = scratch;
        edges.clear();
        edges.extend(crossed_in_order(&crossed));
        let nodes = SampledNodes {
            skip,
            count,
            values,
            iso: options.iso,
        };
        let t = place_vertices(
            field,
            grid.frame,
            options.placement,
            origin,
            edges,
            &nodes,
            placement,
            &mut counts,
        );
        let mut surface = Self {
            key,
            rows,
            crossed,
            before,
            t,
            normals: Vec::new(),
            triangle_count,
            counts,
        };
        if options.normals {
            surface.normals = surface.find_normals(field, grid);
        }
        (Some(surface), nan_nodes)
    }

    /// Outward unit normals at the vertices.
    fn find_normals(&self, field: &dyn Field, grid: &BlockGrid) -> Vec<DVec3> {
        let positions: Vec<DVec3> = self.positions(grid).collect();
        let mut answers = vec![(0.0, DVec3::ZERO); positions.len()];
        field.values_gradients(&positions, &mut answers);
        let origin = grid.origin(self.key);
        self.edges()
            .zip(answers)
            .map(|((node, axis), (_, gradient))| {
                let at = origin[axis] + node[axis] as i64;
                let cap = at < 0 || at == grid.frame.cells[axis] as i64;
                let inside_first = self.row(node[0], node[1]) >> node[2] & 1 == 1;
                match gradient.try_normalize() {
                    Some(slope) if !cap => -slope,
                    // The cap lies in the frame's face; where the gradient vanishes, the way out of the solid
                    // is at least known along the edge.
                    _ => face_normal(grid.frame, axis) * if inside_first { 1.0 } else { -1.0 },
                }
            })
            .collect()
    }

    /// World position of the vertex of that number.
    pub fn position(&self, grid: &BlockGrid, vertex: usize) -> DVec3 {
        let (node, axis) = self.edges().nth(vertex).expect("a vertex of the block");
        edge_point(grid.frame, grid.origin(self.key), node, axis, self.t[vertex])
    }

    /// World positions of the vertices.
    pub fn positions(&self, grid: &BlockGrid) -> impl Iterator<Item = DVec3> {
        let (frame, origin) = (grid.frame, grid.origin(self.key));
        self.edges()
            .zip(&self.t)
            .map(move |((node, axis), t)| edge_point(frame, origin, node, axis, *t))
    }

    /// Edges with a vertex, in the order of the vertices.
    pub fn edges(&self) -> impl Iterator<Item = Edge> {
        crossed_in_order(&self.crossed)
    }

    /// Number among this block's vertices of the one on the edge from an own node; `None` if the edge is not
    /// crossed.
    pub fn vertex_on(&self, node: [usize; 3], axis: usize) -> Option<u32> {
        let (word, bit) = (3 * node[0] + axis, CELLS * node[1] + node[2]);
        let mask = self.crossed[word];
        let below = (mask & ((1 << bit) - 1)).count_ones();
        (mask >> bit & 1 == 1).then_some(self.before[word] as u32 + below)
    }

    /// Inside nodes of row `(i, j)`, one bit each along the last axis.
    #[inline(always)]
    pub fn row(&self, i: usize, j: usize) -> u16 {
        self.rows[NODES * i + j]
    }

    /// Whether the surface crosses an edge among the nodes shared with the neighbour in `direction` (each -1, 0
    /// or 1), so that the neighbour must be meshed too.
    pub fn runs_into(&self, direction: [i32; 3], cells: [usize; 3]) -> bool {
        let span = |a: usize| match direction[a] {
            -1 => (0, 0),
            0 => (0, cells[a]),
            _ => (CELLS, CELLS),
        };
        let ((i0, i1), (j0, j1), (k0, k1)) = (span(0), span(1), span(2));
        let mask = (((1u32 << (k1 + 1)) - 1) & !((1 << k0) - 1)) as u16;
        let (mut any, mut all) = (0, mask);
        for i in i0..=i1 {
            for j in j0..=j1 {
                any |= self.row(i, j);
                all &= self.row(i, j);
            }
        }
        any & mask != 0 && all != mask
    }
}

/// The edges of a block's bit words in order.
fn crossed_in_order(crossed: &[u64; WORDS]) -> impl Iterator<Item = Edge> {
    crossed.iter().enumerate().flat_map(|(w, &word)| {
        let mut bits = word;
        std::iter::from_fn(move || {
            let bit = bits.trailing_zeros() as usize;
            bits &= bits.wrapping_sub(1);
            (bit < 64).then_some(([w / 3, bit / CELLS, bit % CELLS], w % 3))
        })
    })
}

/// Crossed edges from own nodes, of which only those in the meshed cells or on their border count.
fn crossed_edges(rows: &[u16; NODES * NODES], cells: [usize; 3]) -> [u64; WORDS] {
    let mut crossed = [0; WORDS];
    let nodes = cells.map(|n| CELLS.min(n + 1));
    let low = |n: usize| (1u16 << n) - 1;
    for i in 0..nodes[0] {
        for j in 0..nodes[1] {
            let at = NODES * i + j;
            let row = rows[at];
            let mut put = |axis: usize, bits: u16| crossed[3 * i + axis] |= (bits as u64) << (CELLS * j);
            if i < cells[0] {
                put(0, (row ^ rows[at + NODES]) & low(nodes[2]));
            }
            if j < cells[1] {
                put(1, (row ^ rows[at + 1]) & low(nodes[2]));
            }
            put(2, (row ^ row >> 1) & low(cells[2]));
        }
    }
    crossed
}

/// Calls `visit` with each crossed cell of a block and its case, in index order.
#[inline(always)]
pub(super) fn for_each_crossed_cell(
    row: impl Fn(usize, usize) -> u16,
    cells: [usize; 3],
    mut visit: impl FnMut([usize; 3], usize),
) {
    let meshed = (1u16 << cells[2]) - 1;
    for i in 0..cells[0] {
        for j in 0..cells[1] {
            let (a, b, c, d) = (row(i, j), row(i, j + 1), row(i + 1, j), row(i + 1, j + 1));
            let (any, all) = (a | b | c | d, a & b & c & d);
            let mut open = (any | any >> 1) & !(all & all >> 1) & meshed;
            while open != 0 {
                let k = open.trailing_zeros() as usize;
                open &= open - 1;
                // Corner bit 4x + 2y + z holds the node (x, y, z): two bits from each row.
                let pair = |row: u16| (row >> k & 3) as usize;
                let case = pair(a) | pair(b) << 2 | pair(c) << 4 | pair(d) << 6;
                visit([i, j, k], case);
            }
        }
    }
}

/// Crossed cells and triangles of a block.
fn count_triangles(rows: &[u16; NODES * NODES], cells: [usize; 3]) -> (u32, u32) {
    let table = CaseTable::get();
    let (mut crossed, mut triangles) = (0, 0);
    for_each_crossed_cell(
        |i, j| rows[NODES * i + j],
        cells,
        |_, case| {
            crossed += 1;
            triangles += table.count(case);
        },
    );
    (crossed, triangles)
}

/// Unit normal of the frame's faces across an axis, on the side of the axis.
fn face_normal(frame: &Frame, axis: usize) -> DVec3 {
    let m = frame.world_from_grid.matrix3;
    let normal = m.col((axis + 1) % 3).cross(m.col((axis + 2) % 3)).normalize();
    normal * normal.dot(m.col(axis)).signum()
}
