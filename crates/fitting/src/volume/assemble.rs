//! From coefficients in the order of the volume (x fastest) to bricks (z fastest).

use std::sync::Arc;

use bspline::Real;
use bspline::hierarchical::{BRICK, BrickKey, Corrections, DenseCorrections, LevelCorrections};
use rayon::prelude::*;

use super::active::ActiveSet;

/// Bricks of one level, `scale` times the packed coefficients.
pub(crate) fn sparse_bricks<T: Real>(active: &ActiveSet, packed: &[T], scale: T) -> LevelCorrections<T> {
    let [nx, ny, nz] = active.size();
    assemble([nx, ny, nz], |bz, layer| {
        for z in bz * BRICK..((bz + 1) * BRICK).min(nz) {
            for y in 0..ny {
                let range = active.row(y, z);
                let row = &mut layer[y / BRICK * nx.div_ceil(BRICK)..];
                for (&x, &c) in active.x(range.clone()).iter().zip(&packed[range]) {
                    let x = x as usize;
                    row[x / BRICK]
                        .get_or_insert_with(DenseCorrections::empty)
                        .set([x % BRICK, y % BRICK, z % BRICK], c * scale);
                }
            }
        }
    })
}

/// Bricks of a level all of whose functions are active; `dense` has `size` entries, x fastest.
pub(crate) fn full_bricks<T: Real>(size: [usize; 3], dense: &[T], scale: T) -> LevelCorrections<T> {
    let [nx, ny, nz] = size;
    assemble(size, |bz, layer| {
        for z in bz * BRICK..((bz + 1) * BRICK).min(nz) {
            for y in 0..ny {
                let line = &dense[(z * ny + y) * nx..(z * ny + y + 1) * nx];
                let bit = 1 << (BRICK * (y % BRICK) + z % BRICK);
                let slot = y % BRICK * BRICK + z % BRICK;
                let bricks = &mut layer[y / BRICK * nx.div_ceil(BRICK)..];
                for (brick, piece) in bricks.iter_mut().zip(line.chunks(BRICK)) {
                    let brick = brick.get_or_insert_with(DenseCorrections::empty);
                    for (x, &c) in piece.iter().enumerate() {
                        brick.mask[x] |= bit;
                        brick.values[x * BRICK * BRICK + slot] = c * scale;
                    }
                }
            }
        }
    })
}

/// Fills layers of bricks of equal z side by side; `fill` gets the layer's number and its bricks, x fastest.
fn assemble<T: Real>(
    size: [usize; 3],
    fill: impl Fn(usize, &mut [Option<DenseCorrections<T>>]) + Sync,
) -> LevelCorrections<T> {
    let [bx, by, bz] = size.map(|n| n.div_ceil(BRICK));
    let layers: Vec<Vec<(BrickKey, Arc<Corrections<T>>)>> = (0..bz)
        .into_par_iter()
        .map(|z| {
            let mut layer: Vec<Option<DenseCorrections<T>>> = (0..bx * by).map(|_| None).collect();
            fill(z, &mut layer);
            let key = |i: usize| BrickKey([(i % bx) as u32, (i / bx) as u32, z as u32]);
            layer
                .into_iter()
                .enumerate()
                .filter_map(|(i, c)| Some((key(i), Arc::new(c?.pack()))))
                .collect()
        })
        .collect();
    layers.into_iter().flatten().collect()
}
