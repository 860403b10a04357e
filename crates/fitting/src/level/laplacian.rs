//! The penalty of a band: the seven-point Laplacian.

use bspline::Real;

use super::band::{Band, NONE};
use super::brick::{BRICK, BRICK_LEN};

/// Seven-point Laplacian (its own transpose) of an array of bricks, at the slots of one brick.
pub(super) fn seven_point<T: Real>(band: &Band<T>, dense: &[T], brick: usize, out: &mut [T]) {
    const LAST: usize = BRICK - 1;
    let nothing = [T::zero(); BRICK_LEN];
    let of = |brick: u32| -> &[T; BRICK_LEN] {
        match brick {
            NONE => &nothing,
            b => dense[b as usize * BRICK_LEN..][..BRICK_LEN]
                .try_into()
                .expect("a whole brick"),
        }
    };
    let own = of(brick as u32);
    // The bricks behind and ahead on each axis.
    let beside = |octant: usize| [band.behind[brick][octant], band.ahead[brick][octant]].map(of);
    let (along_x, along_y, along_z) = (beside(4), beside(2), beside(1));
    // Rows of four as they lie in memory: put into one larger array first, they would be read before they are written.
    let row = |values: &[T; BRICK_LEN], x: usize, y: usize| -> [T; BRICK] {
        std::array::from_fn(|z| values[(x * BRICK + y) * BRICK + z])
    };
    let six = T::from_f64(6.0);
    for x in 0..BRICK {
        for y in 0..BRICK {
            let at = row(own, x, y);
            let [low_x, high_x] = [
                if x == 0 {
                    row(along_x[0], LAST, y)
                } else {
                    row(own, x - 1, y)
                },
                if x == LAST {
                    row(along_x[1], 0, y)
                } else {
                    row(own, x + 1, y)
                },
            ];
            let [low_y, high_y] = [
                if y == 0 {
                    row(along_y[0], x, LAST)
                } else {
                    row(own, x, y - 1)
                },
                if y == LAST {
                    row(along_y[1], x, 0)
                } else {
                    row(own, x, y + 1)
                },
            ];
            let low_z = [row(along_z[0], x, y)[LAST], at[0], at[1], at[2]];
            let high_z = [at[1], at[2], at[3], row(along_z[1], x, y)[0]];
            let to = &mut out[(x * BRICK + y) * BRICK..][..BRICK];
            for z in 0..BRICK {
                to[z] = ((low_x[z] + high_x[z]) + (low_y[z] + high_y[z]))
                    + ((low_z[z] + high_z[z]) - six * at[z]);
            }
        }
    }
}
