//! One mesh from the surfaces of all blocks.

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::blocks::{BlockGrid, BlockKey, CELLS, NODES};
use super::surface::{BlockSurface, for_each_crossed_cell};
use super::table::{CaseTable, edge_place};
use super::{Mesh, PolygonizeError, PolygonizeOptions};

/// Blocks written between two looks at the caller's wish to stop.
const STRIDE: usize = 1 << 12;

/// Numbers vertices and triangles block by block and joins blocks along their shared nodes.
///
/// `surfaces` are sorted by key, so that the numbering depends on nothing else.
pub(super) fn stitch(
    grid: &BlockGrid,
    options: &PolygonizeOptions,
    surfaces: &[Arc<BlockSurface>],
    mut go_on: impl FnMut(f64) -> ControlFlow<()>,
) -> Result<Mesh, PolygonizeError> {
    let vertices: u64 = surfaces.iter().map(|s| s.t.len() as u64).sum();
    if vertices > u32::MAX as u64 {
        return Err(PolygonizeError::TooManyVertices { vertices });
    }
    let triangles: usize = surfaces.iter().map(|s| s.triangle_count as usize).sum();
    let mut mesh = Mesh {
        positions: vec![DVec3::ZERO; vertices as usize],
        normals: vec![DVec3::ZERO; if options.normals { vertices as usize } else { 0 }],
        triangles: vec![[0; 3]; triangles],
    };
    let mut next = 0;
    let first: Vec<u32> = surfaces
        .iter()
        .map(|s| {
            let own = next;
            next += s.t.len() as u32;
            own
        })
        .collect();
    let place = surfaces
        .iter()
        .enumerate()
        .map(|(n, s)| (s.key, n as u32))
        .collect();
    let all = Blocks {
        grid,
        surfaces,
        first,
        place,
    };

    let (mut positions, mut normals, mut triangles) = (
        &mut mesh.positions[..],
        &mut mesh.normals[..],
        &mut mesh.triangles[..],
    );
    let mut jobs = Vec::with_capacity(STRIDE.min(surfaces.len()));
    for start in (0..surfaces.len()).step_by(STRIDE) {
        for index in start..surfaces.len().min(start + STRIDE) {
            let surface = &surfaces[index];
            let vertices = surface.t.len();
            jobs.push(Job {
                index,
                positions: positions.split_off_mut(..vertices).expect("summed above"),
                normals: normals
                    .split_off_mut(..if options.normals { vertices } else { 0 })
                    .expect("summed above"),
                triangles: triangles
                    .split_off_mut(..surface.triangle_count as usize)
                    .expect("summed above"),
            });
        }
        jobs.par_drain(..).with_min_len(8).try_for_each_init(
            // One table for many blocks: a stale entry is never read, because each edge that a triangle names
            // is crossed and was written for that block.
            || vec![0; 3 * NODES * NODES * NODES],
            |table, mut job| {
                all.write_vertices(&mut job, table);
                all.write_triangles(&mut job, table)
            },
        )?;
        if go_on((start + STRIDE).min(surfaces.len()) as f64 / surfaces.len() as f64).is_break() {
            return Err(PolygonizeError::Cancelled);
        }
    }
    Ok(mesh)
}

/// The slices of the mesh that one block fills.
struct Job<'a> {
    index: usize,
    positions: &'a mut [DVec3],
    normals: &'a mut [DVec3],
    triangles: &'a mut [[u32; 3]],
}

/// All surfaces and where to find them.
struct Blocks<'a> {
    grid: &'a BlockGrid<'a>,
    surfaces: &'a [Arc<BlockSurface>],
    /// Index of each block's first vertex.
    first: Vec<u32>,
    place: FxHashMap<BlockKey, u32>,
}

/// Slot of an edge in a block's table of vertex indices.
#[inline(always)]
const fn slot(node: [usize; 3], axis: usize) -> usize {
    ((axis * NODES + node[0]) * NODES + node[1]) * NODES + node[2]
}

impl Blocks<'_> {
    /// A block's vertices; their indices go into the table.
    fn write_vertices(&self, job: &mut Job, table: &mut [u32]) {
        let surface = &self.surfaces[job.index];
        for (n, (node, axis)) in surface.edges().enumerate() {
            table[slot(node, axis)] = self.first[job.index] + n as u32;
        }
        for (position, p) in job.positions.iter_mut().zip(surface.positions(self.grid)) {
            *position = p;
        }
        job.normals.copy_from_slice(&surface.normals);
    }

    /// Triangles of a block's cells, after completing the table with the neighbours' vertices.
    fn write_triangles(&self, job: &mut Job, table: &mut [u32]) -> Result<(), PolygonizeError> {
        let surface = &self.surfaces[job.index];
        let cells = self.grid.meshed_cells(surface.key);
        self.borrow_vertices(surface, cells, table)?;
        let edges: [usize; 12] = std::array::from_fn(|e| {
            let (axis, at) = edge_place(e);
            slot(at, axis)
        });
        let mirrored = self.grid.frame.world_from_grid.matrix3.determinant() < 0.0;
        let cases = CaseTable::get();
        let mut out = job.triangles.iter_mut();
        for_each_crossed_cell(
            |i, j| surface.row(i, j),
            cells,
            |cell, case| {
                let base = slot(cell, 0);
                for corners in cases.triangles(case) {
                    let [a, b, c] = corners.map(|e| table[base + edges[e as usize]]);
                    *out.next().expect("counted while sampling") =
                        if mirrored { [a, c, b] } else { [a, b, c] };
                }
            },
        );
        Ok(())
    }

    /// Puts the vertices on edges that start at the nodes shared with the next blocks into the table.
    fn borrow_vertices(
        &self,
        surface: &BlockSurface,
        cells: [usize; 3],
        table: &mut [u32],
    ) -> Result<(), PolygonizeError> {
        let mut neighbours: [Option<Option<u32>>; 8] = [None; 8];
        let mut borrow = |node: [usize; 3], axis: usize| {
            let beyond = node.map(|n| n / CELLS);
            let which = &mut neighbours[4 * beyond[0] + 2 * beyond[1] + beyond[2]];
            let found = *which.get_or_insert_with(|| {
                let key = [0, 1, 2].map(|a| surface.key[a] + beyond[a] as i32);
                self.place.get(&key).copied()
            });
            let vertex = found.and_then(|index| {
                let local = self.surfaces[index as usize].vertex_on(node.map(|n| n % CELLS), axis)?;
                Some(self.first[index as usize] + local)
            });
            table[slot(node, axis)] =
                vertex.ok_or(PolygonizeError::InconsistentField { block: surface.key })?;
            Ok(())
        };
        let mut each = |i: usize, j: usize, axis: usize, mut bits: u16| {
            while bits != 0 {
                borrow([i, j, bits.trailing_zeros() as usize], axis)?;
                bits &= bits - 1;
            }
            Ok(())
        };
        let nodes = ((1u32 << (cells[2] + 1)) - 1) as u16;
        for i in 0..=cells[0] {
            for j in 0..=cells[1] {
                let row = surface.row(i, j);
                // Along the last axis only node 8 is shared, unless the whole row is.
                let last = 1 << CELLS;
                let (row_shared_x, row_shared_y) = (i == CELLS, j == CELLS);
                if i < cells[0] {
                    let crossed = (row ^ surface.row(i + 1, j)) & nodes;
                    each(i, j, 0, if row_shared_y { crossed } else { crossed & last })?;
                }
                if j < cells[1] {
                    let crossed = (row ^ surface.row(i, j + 1)) & nodes;
                    each(i, j, 1, if row_shared_x { crossed } else { crossed & last })?;
                }
                if row_shared_x || row_shared_y {
                    each(i, j, 2, (row ^ row >> 1) & (nodes >> 1))?;
                }
            }
        }
        Ok(())
    }
}
