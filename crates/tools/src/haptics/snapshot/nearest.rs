//! Which of some marked nodes of a grid is nearest to each node: exact, axis by axis \[Felzenszwalb12\].

use bspline::vectorized;

use super::grid::Grid;

/// No node.
pub const NONE: u32 = u32::MAX;

/// Bits of the step to a node, in a key that is less the nearer the node is.
const BITS: u32 = 9;
/// Step of none.
const ZERO: i32 = 1 << (BITS - 1);
/// Square of a distance beyond all of a grid.
const FAR: u32 = 1 << 20;

/// Steps after which a row is asked whether nearer ones can be left.
const LOOK: u32 = 4;

/// Most nodes of a grid on an axis.
pub const MOST: usize = ZERO as usize;

/// Lists in the order of the grid: for each node the marked one that is nearest to it, by its place in the lists.
///
/// Of several that are equally near, the one with the least step along x, then y, then z: so the answer depends on where nodes
/// are to each other, not on where the grid's box begins.
pub fn nearest(grid: &Grid, marked: impl Fn(usize) -> bool) -> Vec<u32> {
    let [nx, ny, nz] = grid.count;
    assert!(
        grid.count.iter().all(|n| *n <= MOST),
        "at most {MOST} nodes on an axis: {:?}",
        grid.count
    );
    let along_z = lines(grid, marked);
    let mut squares: Vec<u32> = along_z
        .iter()
        .map(|s| s.map_or(FAR, |s| (s * s) as u32))
        .collect();
    let [stride_x, stride_y, _] = grid.strides();
    let mut next = squares.clone();
    let mut along_y = vec![0i16; grid.len()];
    for x in 0..nx {
        let plane = x * stride_x..(x + 1) * stride_x;
        rows(
            &squares[plane.clone()],
            ny,
            stride_y,
            &mut next[plane.clone()],
            &mut along_y[plane],
        );
    }
    std::mem::swap(&mut squares, &mut next);
    let mut along_x = vec![0i16; grid.len()];
    rows(&squares, nx, stride_x, &mut next, &mut along_x);
    let mut found = vec![NONE; grid.len()];
    for x in 0..nx {
        for y in 0..ny {
            for z in 0..nz {
                let slot = grid.slot([x, y, z]);
                if next[slot] >= FAR {
                    continue;
                }
                let there = slot.wrapping_add_signed(isize::from(along_x[slot]) * stride_x as isize);
                let there = there.wrapping_add_signed(isize::from(along_y[there]) * stride_y as isize);
                let step = along_z[there].expect("a line that has a marked node");
                found[slot] = there.wrapping_add_signed(step as isize) as u32;
            }
        }
    }
    found
}

/// Step to the nearest marked node on a node's own line along z.
fn lines(grid: &Grid, marked: impl Fn(usize) -> bool) -> Vec<Option<i32>> {
    let nz = grid.count[2];
    let mut steps = vec![None; grid.len()];
    for start in (0..grid.len()).step_by(nz) {
        let mut last = None;
        for z in 0..nz as i32 {
            let slot = start + z as usize;
            if marked(slot) {
                last = Some(z);
            }
            steps[slot] = last.map(|l: i32| l - z);
        }
        let mut next = None;
        for z in (0..nz as i32).rev() {
            let slot = start + z as usize;
            if steps[slot] == Some(0) {
                next = Some(z);
            }
            if let Some(n) = next.map(|n| n - z)
                && steps[slot].is_none_or(|s: i32| n < -s)
            {
                steps[slot] = Some(n);
            }
        }
    }
    steps
}

/// `out_i = min_j (in_j + (j − i)²)` of rows of `width` numbers, and the step `j − i` that gives it.
fn rows(squares: &[u32], count: usize, width: usize, out: &mut [u32], steps: &mut [i16]) {
    let mut keys = vec![0u32; width];
    for i in 0..count {
        let own = &squares[i * width..][..width];
        vectorized(
            #[inline(always)]
            || {
                for (key, square) in keys.iter_mut().zip(own) {
                    *key = square << BITS | ZERO as u32;
                }
            },
        );
        let mut most = 0;
        for step in 1..count as u32 {
            let added = step * step;
            // No number is less than 0. Now and then will do: a step too far changes nothing.
            if step % LOOK == 1 {
                most = vectorized(
                    #[inline(always)]
                    || keys.iter().fold(0, |m, k| m.max(*k)) >> BITS,
                );
            }
            if added >= most {
                break;
            }
            for (j, code) in [
                (i.checked_sub(step as usize), ZERO as u32 - step),
                (Some(i + step as usize).filter(|j| *j < count), ZERO as u32 + step),
            ] {
                let Some(j) = j else { continue };
                let row = &squares[j * width..][..width];
                vectorized(
                    #[inline(always)]
                    || {
                        for (key, square) in keys.iter_mut().zip(row) {
                            *key = (*key).min((square + added) << BITS | code);
                        }
                    },
                );
            }
        }
        for (z, key) in keys.iter().enumerate() {
            out[i * width + z] = key >> BITS;
            steps[i * width + z] = ((key & ((1 << BITS) - 1)) as i32 - ZERO) as i16;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against all pairs, on a grid with few marks and with many.
    #[test]
    fn the_nearest_of_all_marks_is_found() {
        let grid = Grid {
            first: [3, -7, 0],
            count: [11, 14, 9],
            spacing: 0.5,
        };
        for sparse in [3u64, 40, 400, 100_000] {
            let marked = |slot: usize| {
                (slot as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 20 & 0xFFFF_FFFF < (1u64 << 32) / sparse
            };
            let marks: Vec<usize> = (0..grid.len()).filter(|s| marked(*s)).collect();
            let far = |a: usize, b: usize| {
                let (a, b) = (grid.node(a), grid.node(b));
                (0..3).map(|i| a[i].abs_diff(b[i]).pow(2)).sum::<usize>()
            };
            for (slot, found) in nearest(&grid, marked).into_iter().enumerate() {
                let least = marks.iter().map(|m| far(slot, *m)).min();
                assert_eq!(
                    least,
                    (found != NONE).then(|| far(slot, found as usize)),
                    "{slot}"
                );
            }
        }
    }
}
