//! One block's triangles on their own.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::blocks::{BlockGrid, BlockKey, CELLS, NODES};
use super::surface::{BlockSurface, for_each_crossed_cell};
use super::table::{CaseTable, edge_place};
use super::{Mesh, PolygonizeError};

/// See [`super::BlockMesh::piece`].
pub(super) fn piece(
    grid: &BlockGrid,
    surfaces: &BTreeMap<BlockKey, Arc<BlockSurface>>,
    block: BlockKey,
) -> Result<Option<Mesh>, PolygonizeError> {
    let find = |key: BlockKey| surfaces.get(&key).map(|s| &**s);
    let Some(surface) = find(block) else {
        return Ok(None);
    };
    let mut mesh = Mesh::default();
    // Number in the piece of the vertex on each edge; the neighbours' follow the own ones as they are met.
    let mut number = vec![u32::MAX; 3 * NODES * NODES * NODES];
    let slot = |node: [usize; 3], axis: usize| ((axis * NODES + node[0]) * NODES + node[1]) * NODES + node[2];
    mesh.positions.extend(surface.positions(grid));
    mesh.normals.extend(&surface.normals);
    for (n, (node, axis)) in surface.edges().enumerate() {
        number[slot(node, axis)] = n as u32;
    }
    let mut vertex = |mesh: &mut Mesh, node: [usize; 3], axis: usize| {
        let number = &mut number[slot(node, axis)];
        if *number == u32::MAX {
            let beyond = node.map(|n| n / CELLS);
            let neighbour = find([0, 1, 2].map(|a| block[a] + beyond[a] as i32));
            let (neighbour, local) = neighbour
                .and_then(|s| Some((s, s.vertex_on(node.map(|n| n % CELLS), axis)? as usize)))
                .ok_or(PolygonizeError::InconsistentField { block })?;
            *number = mesh.positions.len() as u32;
            mesh.positions.push(neighbour.position(grid, local));
            mesh.normals.extend(neighbour.normals.get(local));
        }
        Ok(*number)
    };
    let mirrored = grid.frame.world_from_grid.matrix3.determinant() < 0.0;
    let cases = CaseTable::get();
    let mut result = Ok(());
    for_each_crossed_cell(
        |i, j| surface.row(i, j),
        grid.meshed_cells(block),
        |cell, case| {
            for corners in cases.triangles(case) {
                let found = corners.map(|e| {
                    let (axis, at) = edge_place(e as usize);
                    vertex(&mut mesh, [0, 1, 2].map(|a| cell[a] + at[a]), axis)
                });
                match found {
                    [Ok(a), Ok(b), Ok(c)] => {
                        mesh.triangles.push(if mirrored { [a, c, b] } else { [a, b, c] })
                    }
                    [a, b, c] => result = a.and(b).and(c).map(|_| ()),
                }
            }
        },
    );
    result.map(|()| Some(mesh))
}
