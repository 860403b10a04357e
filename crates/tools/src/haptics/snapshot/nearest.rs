//! Which of some marked nodes of a grid is nearest: exact, axis by axis \[Felzenszwalb12\].
//!
//! Of several that are equally near it is the one with the least step along x, then y, then z: so the answer depends on where nodes are to
//! each other, not on where the grid's box begins.

use bspline::vectorized;

use super::grid::{Grid, STEP};
use super::region::Region;

/// The step from a node to another, at most [`FARTHEST`] on each axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Way(u32);

/// Nodes up to which ways are known.
pub const FARTHEST: usize = 120;
/// Steps are counted from here.
const MIDDLE: i32 = 128;

impl Way {
    /// To none: none is near.
    pub const NONE: Self = Self(u32::MAX);
    /// Not looked for yet.
    pub const UNKNOWN: Self = Self(u32::MAX - 1);

    fn new(step: [i32; 3]) -> Self {
        let [x, y, z] = step.map(|n| (n + MIDDLE) as u32);
        Self(x << 16 | y << 8 | z)
    }

    /// On each axis.
    pub fn step(self) -> Option<[i32; 3]> {
        let at = |shift: u32| (self.0 >> shift & 0xFF) as i32 - MIDDLE;
        (self.0 < Self::UNKNOWN.0).then(|| [at(16), at(8), at(0)])
    }

    /// Square of its length, in nodes.
    pub fn square(self) -> Option<u32> {
        self.step().map(|step| step.iter().map(|n| (n * n) as u32).sum())
    }

    /// Where it leads from a place in lists.
    pub fn from(self, slot: usize, strides: [usize; 3]) -> Option<usize> {
        self.step().map(|step| {
            let by: isize = (0..3).map(|a| step[a] as isize * strides[a] as isize).sum();
            slot.wrapping_add_signed(by)
        })
    }
}

/// Bits of a step, in a key that is less the nearer the node is.
const BITS: u32 = 10;
/// Step of none.
const ZERO: i32 = 1 << (BITS - 1);
/// Square of a distance beyond all of a grid.
const FAR: u32 = 1 << 20;
/// Most nodes of a grid on an axis.
pub const MOST: usize = 500;

/// The nearest marked node of each node of a region, if it is at most `reach` nodes away: told to `tell`, by place in lists, row by row.
pub fn near(
    grid: &Grid,
    marked: impl Fn(usize) -> bool,
    region: Region,
    reach: usize,
    mut tell: impl FnMut([usize; 3], usize, Way),
) {
    if region.is_empty() {
        return;
    }
    let reach = reach.min(FARTHEST);
    let from = region.grown(reach, grid);
    let before: [usize; 3] = std::array::from_fn(|a| region.lo[a] - from.lo[a]);
    let ([fx, fy, fz], [rx, ry, rz]) = (from.count(), region.count());
    // Along z.
    let mut squares = vec![FAR; fx * fy * rz];
    let mut along_z = vec![0i16; squares.len()];
    let mut steps = vec![None; fz];
    for (row, (_, slots)) in from.rows(grid).enumerate() {
        if !line(slots, &marked, &mut steps) {
            continue;
        }
        for z in 0..rz {
            if let Some(step) = steps[z + before[2]].filter(|step| step.unsigned_abs() as usize <= reach) {
                squares[row * rz + z] = (step * step) as u32;
                along_z[row * rz + z] = step as i16;
            }
        }
    }
    // Along y, then x.
    let mut next = vec![FAR; fx * ry * rz];
    let mut along_y = vec![0i16; next.len()];
    for x in 0..fx {
        Rows {
            count: fy,
            width: rz,
            reach,
        }
        .fold(
            &squares[x * fy * rz..][..fy * rz],
            (0..ry).map(|y| y + before[1]),
            &mut next[x * ry * rz..][..ry * rz],
            &mut along_y[x * ry * rz..][..ry * rz],
        );
    }
    let mut least = vec![FAR; rx * ry * rz];
    let mut along_x = vec![0i16; least.len()];
    Rows {
        count: fx,
        width: ry * rz,
        reach,
    }
    .fold(&next, (0..rx).map(|x| x + before[0]), &mut least, &mut along_x);
    let most = (reach * reach) as u32;
    let mut at = 0;
    for (first, slots) in region.rows(grid) {
        let [x, y] = [first[0] - from.lo[0], first[1] - region.lo[1]];
        for (z, slot) in slots.enumerate() {
            let way = if least[at] > most {
                Way::NONE
            } else {
                let dx = i32::from(along_x[at]);
                let there = (x as i32 + dx) as usize;
                let dy = i32::from(along_y[(there * ry + y) * rz + z]);
                let line = there * fy + (y + before[1]).wrapping_add_signed(dy as isize);
                Way::new([dx, dy, along_z[line * rz + z].into()])
            };
            tell([first[0], first[1], first[2] + z], slot, way);
            at += 1;
        }
    }
}

/// The nearest of some nodes for every [`STEP`]th node of a grid on each axis, by its place in lists; none if there are none.
pub fn every(grid: &Grid, marked: impl Iterator<Item = [usize; 3]>) -> Vec<Option<u32>> {
    assert!(
        grid.count.iter().all(|n| *n <= MOST),
        "at most {MOST} nodes on an axis: {:?}",
        grid.count
    );
    let [nx, ny, _] = grid.count;
    let [cx, cy, cz] = grid.count.map(|n| (n - 1) / STEP + 1);
    let mut keys = vec![u32::MAX; nx * ny * cz];
    for [x, y, z] in marked {
        let row = &mut keys[(x * ny + y) * cz..][..cz];
        for (k, key) in row.iter_mut().enumerate() {
            let step = z as i32 - (k * STEP) as i32;
            *key = (*key).min(((step * step) as u32) << BITS | (step + ZERO) as u32);
        }
    }
    let squares: Vec<u32> = keys.iter().map(|k| (k >> BITS).min(FAR)).collect();
    let mut next = vec![FAR; nx * cy * cz];
    let mut along_y = vec![0i16; next.len()];
    for x in 0..nx {
        Rows {
            count: ny,
            width: cz,
            reach: ny,
        }
        .fold(
            &squares[x * ny * cz..][..ny * cz],
            (0..cy).map(|y| y * STEP),
            &mut next[x * cy * cz..][..cy * cz],
            &mut along_y[x * cy * cz..][..cy * cz],
        );
    }
    let mut least = vec![FAR; cx * cy * cz];
    let mut along_x = vec![0i16; least.len()];
    Rows {
        count: nx,
        width: cy * cz,
        reach: nx,
    }
    .fold(&next, (0..cx).map(|x| x * STEP), &mut least, &mut along_x);
    let found = |at: usize| {
        (least[at] < FAR).then(|| {
            let [x, y, z] = [at / (cy * cz), at / cz % cy, at % cz];
            let there_x = (x * STEP).wrapping_add_signed(along_x[at].into());
            let there_y = (y * STEP).wrapping_add_signed(along_y[(there_x * cy + y) * cz + z].into());
            let step = (keys[(there_x * ny + there_y) * cz + z] & ((1 << BITS) - 1)) as i32 - ZERO;
            let there_z = (z * STEP).wrapping_add_signed(step as isize);
            grid.slot([there_x, there_y, there_z]) as u32
        })
    };
    (0..least.len()).map(found).collect()
}

/// Step to the nearest marked node of a line along z; false if there is none.
fn line(slots: std::ops::Range<usize>, marked: impl Fn(usize) -> bool, steps: &mut [Option<i32>]) -> bool {
    let (start, mut last) = (slots.start, None);
    for (z, step) in steps.iter_mut().enumerate() {
        if marked(start + z) {
            last = Some(z as i32);
        }
        *step = last.map(|l| l - z as i32);
    }
    if last.is_none() {
        return false;
    }
    let mut next = None;
    for (z, step) in steps.iter_mut().enumerate().rev() {
        let z = z as i32;
        if *step == Some(0) {
            next = Some(z);
        }
        if let Some(n) = next.map(|n| n - z)
            && step.is_none_or(|s| n < -s)
        {
            *step = Some(n);
        }
    }
    true
}

/// Rows of numbers, one behind the other.
struct Rows {
    count: usize,
    width: usize,
    /// Rows to each side that count.
    reach: usize,
}

impl Rows {
    /// `out_i = min_j (in_j + (j − i)²)` for some rows `i`, and the step `j − i` that gives it.
    fn fold(&self, squares: &[u32], at: impl Iterator<Item = usize>, out: &mut [u32], steps: &mut [i16]) {
        let width = self.width;
        let is_empty: Vec<bool> = squares
            .chunks_exact(width)
            .map(|row| row.iter().all(|s| *s == FAR))
            .collect();
        if is_empty.iter().all(|e| *e) {
            return;
        }
        let mut keys = vec![0u32; width];
        for (n, i) in at.enumerate() {
            let own = &squares[i * width..][..width];
            let mut most = 0;
            vectorized(
                #[inline(always)]
                || {
                    for (key, square) in keys.iter_mut().zip(own) {
                        *key = square << BITS | ZERO as u32;
                        most = most.max(*square);
                    }
                },
            );
            for step in 1..=self.reach {
                let added = (step * step) as u32;
                // No number is less than 0.
                if added >= most {
                    break;
                }
                let mut is_nearer = false;
                for (j, code) in [
                    (i.checked_sub(step), ZERO as u32 - step as u32),
                    (
                        Some(i + step).filter(|j| *j < self.count),
                        ZERO as u32 + step as u32,
                    ),
                ] {
                    let Some(j) = j.filter(|j| !is_empty[*j]) else {
                        continue;
                    };
                    is_nearer = true;
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
                // Now and then will do: a step too far changes nothing.
                if is_nearer && step % 4 == 1 {
                    most = vectorized(
                        #[inline(always)]
                        || keys.iter().fold(0, |m, k| m.max(*k)) >> BITS,
                    );
                }
            }
            for (z, key) in keys.iter().enumerate() {
                let square = key >> BITS;
                if square < FAR {
                    out[n * width + z] = square;
                    steps[n * width + z] = ((key & ((1 << BITS) - 1)) as i32 - ZERO) as i16;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid {
        first: [4, -8, 0],
        count: [13, 17, 9],
        spacing: 0.5,
    };

    fn marked(slot: usize, sparse: u64) -> bool {
        (slot as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 20 & 0xFFFF_FFFF < (1u64 << 32) / sparse
    }

    fn far(a: usize, b: usize) -> u32 {
        let (a, b) = (GRID.node(a), GRID.node(b));
        (0..3).map(|i| a[i].abs_diff(b[i]).pow(2) as u32).sum()
    }

    /// Against all pairs, on a grid with few marks and with many.
    #[test]
    fn the_nearest_of_all_marks_is_found() {
        for sparse in [3u64, 40, 400, 100_000] {
            let marks: Vec<usize> = (0..GRID.len()).filter(|s| marked(*s, sparse)).collect();
            let part = Region {
                lo: [3, 2, 1],
                end: [9, 17, 6],
            };
            for (region, reach) in [(Region::whole(&GRID), 60), (part, 60), (part, 4), (part, 1)] {
                let mut count = 0;
                near(
                    &GRID,
                    |slot| marked(slot, sparse),
                    region,
                    reach,
                    |at, slot, way| {
                        assert_eq!(GRID.slot(at), slot);
                        let least = marks.iter().map(|m| far(slot, *m)).min();
                        let least = least.filter(|l| *l <= (reach * reach) as u32);
                        assert_eq!(least, way.square(), "{at:?}");
                        if let Some(there) = way.from(slot, GRID.strides()) {
                            assert!(marked(there, sparse) && Some(far(slot, there)) == least);
                        }
                        count += 1;
                    },
                );
                assert_eq!(count, region.len());
            }
            let all = every(&GRID, marks.iter().map(|m| GRID.node(*m)));
            let nodes = Region::whole(&GRID).rows(&GRID).flat_map(|(_, slots)| slots);
            let every_fourth = nodes.filter(|slot| GRID.node(*slot).iter().all(|n| n % STEP == 0));
            for (slot, found) in every_fourth.zip(all) {
                let least = marks.iter().map(|m| far(slot, *m)).min();
                assert_eq!(least, found.map(|there| far(slot, there as usize)));
            }
        }
    }
}
