//! The penalty of a band: the seven-point Laplacian.

use bspline::Real;

use super::band::{BRICK, BRICK_LEN, Band, NONE};

/// Seven-point Laplacian (its own transpose) of an array of bricks, at the slots of one brick.
pub(super) fn seven_point<T: Real>(band: &Band<T>, dense: &[T], brick: usize, out: &mut [T]) {
    const W: usize = BRICK + 2;
    let mut padded = [T::zero(); W * W * W];
    let own = &dense[brick * BRICK_LEN..(brick + 1) * BRICK_LEN];
    for x in 0..BRICK {
        for y in 0..BRICK {
            let to = ((x + 1) * W + y + 1) * W + 1;
            padded[to..to + BRICK].copy_from_slice(&own[(x * BRICK + y) * BRICK..][..BRICK]);
        }
    }
    let face = |neighbour: u32| match neighbour {
        NONE => None,
        b => Some(&dense[b as usize * BRICK_LEN..(b as usize + 1) * BRICK_LEN]),
    };
    const LAST: usize = BRICK - 1;
    let (behind, ahead) = (band.behind[brick], band.ahead[brick]);
    for (neighbour, layer, at) in [(behind[4], LAST, 0), (ahead[4], 0, W - 1)] {
        if let Some(values) = face(neighbour) {
            for y in 0..BRICK {
                let to = (at * W + y + 1) * W + 1;
                padded[to..to + BRICK].copy_from_slice(&values[(layer * BRICK + y) * BRICK..][..BRICK]);
            }
        }
    }
    for (neighbour, layer, at) in [(behind[2], LAST, 0), (ahead[2], 0, W - 1)] {
        if let Some(values) = face(neighbour) {
            for x in 0..BRICK {
                let to = ((x + 1) * W + at) * W + 1;
                padded[to..to + BRICK].copy_from_slice(&values[(x * BRICK + layer) * BRICK..][..BRICK]);
            }
        }
    }
    for (neighbour, layer, at) in [(behind[1], LAST, 0), (ahead[1], 0, W - 1)] {
        if let Some(values) = face(neighbour) {
            for x in 0..BRICK {
                for y in 0..BRICK {
                    padded[((x + 1) * W + y + 1) * W + at] = values[(x * BRICK + y) * BRICK + layer];
                }
            }
        }
    }
    let six = T::from_f64(6.0);
    for x in 0..BRICK {
        for y in 0..BRICK {
            let at = ((x + 1) * W + y + 1) * W + 1;
            let row = &mut out[(x * BRICK + y) * BRICK..][..BRICK];
            for z in 0..BRICK {
                let i = at + z;
                row[z] = ((padded[i - W * W] + padded[i + W * W]) + (padded[i - W] + padded[i + W]))
                    + ((padded[i - 1] + padded[i + 1]) - six * padded[i]);
            }
        }
    }
}
