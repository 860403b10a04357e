//! Pieces of the solid, or holes in it, that no sample speaks for.

use bspline::{Field, Frame};
use glam::{DAffine3, DVec3};

/// A 6-connected component of the sign of a field on a grid of cells, none of which holds a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnsupportedComponent {
    /// Whether it is a piece of the solid (a false solid) or of its complement (a false cavity).
    pub is_inside: bool,
    /// Cells in it.
    pub cell_count: usize,
    /// World position of one of its cells.
    pub at: DVec3,
}

/// Components of `{f > iso}` and of its complement, by the sign at the centres of the cells of `frame`, that
/// hold none of `samples`, each counted half a cell to both sides of the surface. In the order of their first cell.
///
/// Memory: 6 bytes a cell.
pub fn unsupported_components(
    field: &dyn Field,
    iso: f64,
    frame: &Frame,
    samples: &[DVec3],
) -> Vec<UnsupportedComponent> {
    let [nx, ny, nz] = frame.cells.map(|n| n as usize);
    let centres = Frame {
        world_from_grid: frame.world_from_grid * DAffine3::from_translation(DVec3::splat(0.5)),
        ..*frame
    };
    let index = |x: usize, y: usize, z: usize| (x * ny + y) * nz + z;
    let mut inside = vec![false; nx * ny * nz];
    let mut slab = vec![0.0; ny * nz];
    for x in 0..nx {
        field.frame_values(&centres, [x as i64, 0, 0], [1, ny, nz], &mut slab);
        for (cell, value) in inside[index(x, 0, 0)..].iter_mut().zip(&slab) {
            *cell = *value > iso;
        }
    }
    let grid_from_world = frame.world_from_grid.inverse();
    let mut has_sample = vec![false; inside.len()];
    // A sample on the surface speaks for both sides of it, whichever of them its cell's centre is on.
    let half = frame.world_from_grid.matrix3.x_axis.length() * 0.5;
    let sides = samples.iter().flat_map(|&p| {
        let step = field.value_gradient(p).1.normalize_or_zero() * half;
        [p, p - step, p + step]
    });
    for p in sides {
        let q = grid_from_world.transform_point3(p).floor();
        let within = q.cmpge(DVec3::ZERO).all() && q.x < nx as f64 && q.y < ny as f64 && q.z < nz as f64;
        if within {
            has_sample[index(q.x as usize, q.y as usize, q.z as usize)] = true;
        }
    }
    let mut seen = vec![false; inside.len()];
    let mut stack = Vec::new();
    let mut out = Vec::new();
    for start in 0..inside.len() {
        if std::mem::replace(&mut seen[start], true) {
            continue;
        }
        let (mut cell_count, mut supported) = (0, false);
        stack.push(start);
        while let Some(cell) = stack.pop() {
            cell_count += 1;
            supported |= has_sample[cell];
            let (x, y, z) = (cell / (ny * nz), cell / nz % ny, cell % nz);
            let mut visit = |neighbour: usize| {
                if inside[neighbour] == inside[start] && !std::mem::replace(&mut seen[neighbour], true) {
                    stack.push(neighbour);
                }
            };
            if x > 0 {
                visit(cell - ny * nz);
            }
            if x + 1 < nx {
                visit(cell + ny * nz);
            }
            if y > 0 {
                visit(cell - nz);
            }
            if y + 1 < ny {
                visit(cell + nz);
            }
            if z > 0 {
                visit(cell - 1);
            }
            if z + 1 < nz {
                visit(cell + 1);
            }
        }
        if !supported {
            let (x, y, z) = (start / (ny * nz), start / nz % ny, start % nz);
            let at = frame
                .world_from_grid
                .transform_point3(DVec3::new(x as f64, y as f64, z as f64) + 0.5);
            out.push(UnsupportedComponent {
                is_inside: inside[start],
                cell_count,
                at,
            });
        }
    }
    out
}
