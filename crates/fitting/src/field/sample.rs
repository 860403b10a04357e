//! Target and field at the knots of a tile.

use bspline::Field;

use super::region::Region;
use super::tiles::{TILE, TileKey, Values};

/// Target and rest (`target - field`) at the knots of a tile; gives the number of points asked for. Knots that are not
/// sampled get the target NaN.
pub(super) fn sample(
    [target, field]: [&dyn Field; 2],
    region: &Region,
    key: TileKey,
    targets: &mut Values,
    rests: &mut Values,
) -> u64 {
    targets.fill(f64::NAN);
    let (lo, hi) = region.sampled();
    let last = region.last();
    let first = key.map(|k| i64::from(k) * TILE as i64);
    let start: [i64; 3] = std::array::from_fn(|a| first[a].max(lo[a]));
    let end: [i64; 3] = std::array::from_fn(|a| (first[a] + TILE as i64 - 1).min(hi[a]));
    if (0..3).any(|a| start[a] > end[a]) {
        return 0;
    }
    // Outside of the lattice's box, where coefficients do not reach, the values go on in straight lines from inside.
    let leaves_box = (0..3).any(|a| start[a] < 0 || end[a] > last[a]);
    let from: [i64; 3] = std::array::from_fn(|a| start[a].clamp(0, (last[a] - 1).max(0)));
    let to: [i64; 3] = std::array::from_fn(|a| end[a].min(last[a]).max((from[a] + 1).min(last[a])));
    let count: [usize; 3] = std::array::from_fn(|a| (to[a] - from[a] + 1) as usize);
    let len = count.iter().product::<usize>();
    let mut target_values = [0.0; (TILE + 2) * (TILE + 2) * (TILE + 2)];
    let mut field_values = target_values;
    let (target_values, field_values) = (&mut target_values[..len], &mut field_values[..len]);
    let frame = region.frame();
    target.frame_values(&frame, from, count, target_values);
    field.frame_values(&frame, from, count, field_values);
    let at = |i: [i64; 3]| {
        let [x, y, z]: [usize; 3] = std::array::from_fn(|a| (i[a] - from[a]) as usize);
        (x * count[1] + y) * count[2] + z
    };
    for x in start[0]..=end[0] {
        for y in start[1]..=end[1] {
            let to_row = ((x - first[0]) as usize * TILE + (y - first[1]) as usize) * TILE;
            for z in start[2]..=end[2] {
                let to = to_row + (z - first[2]) as usize;
                let (t, f) = match leaves_box {
                    false => {
                        let i = at([x, y, z]);
                        (target_values[i], field_values[i])
                    }
                    true => {
                        let on = |values: &[f64]| straight([x, y, z], last, |i| values[at(i)]);
                        (on(target_values), on(field_values))
                    }
                };
                targets[to] = t;
                rests[to] = t - f;
            }
        }
    }
    // Beside what is sampled the rest goes on as it is.
    if (0..3).any(|a| start[a] > first[a] || end[a] < first[a] + TILE as i64 - 1) {
        for i in 0..rests.len() {
            let at = [i / TILE / TILE, i / TILE % TILE, i % TILE];
            let [x, y, z] = std::array::from_fn(|a| {
                let knot = first[a] + at[a] as i64;
                (knot.clamp(start[a], end[a]) - first[a]) as usize
            });
            rests[i] = rests[(x * TILE + y) * TILE + z];
        }
    }
    len as u64
}

/// Value at a knot, outside `0 ..= last` continued linearly on each axis.
fn straight(knot: [i64; 3], last: [i64; 3], value: impl Fn([i64; 3]) -> f64) -> f64 {
    let weights: [[(i64, f64); 2]; 3] = std::array::from_fn(|a| {
        let face = knot[a].clamp(0, last[a]);
        let steps = (knot[a] - face).abs() as f64;
        let inner = if knot[a] < 0 {
            1.min(last[a])
        } else {
            (last[a] - 1).max(0)
        };
        [(face, 1.0 + steps), (inner, -steps)]
    });
    let mut sum = 0.0;
    for (x, wx) in weights[0] {
        for (y, wy) in weights[1] {
            for (z, wz) in weights[2] {
                let weight = wx * wy * wz;
                if weight != 0.0 {
                    sum += weight * value([x, y, z]);
                }
            }
        }
    }
    sum
}
