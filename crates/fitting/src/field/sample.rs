//! Target and field at the knots of tiles.

use std::ops::Range;

use bspline::Field;

use super::region::Region;
use super::tiles::{TILE, TileKey, Values};

/// Target and rest (`target - field`) at the knots of a run of tiles along z, from the one of `key` on; gives the number of
/// points asked for. Knots that are not sampled get the target NaN.
pub(super) fn sample(
    [target, field]: [&dyn Field; 2],
    region: &Region,
    key: TileKey,
    targets: &mut [Values],
    rests: &mut [Values],
    room: &mut Vec<f64>,
) -> u64 {
    targets.as_flattened_mut().fill(f64::NAN);
    let (lo, hi) = region.sampled();
    let last = region.last();
    let first = key.map(|k| i64::from(k) * TILE as i64);
    let size = [TILE, TILE, TILE * targets.len()];
    let start: [i64; 3] = std::array::from_fn(|a| first[a].max(lo[a]));
    let end: [i64; 3] = std::array::from_fn(|a| (first[a] + size[a] as i64 - 1).min(hi[a]));
    if (0..3).any(|a| start[a] > end[a]) {
        return 0;
    }
    // Outside of the lattice's box, where coefficients do not reach, the values go on in straight lines from inside.
    let leaves_box = (0..3).any(|a| start[a] < 0 || end[a] > last[a]);
    let from: [i64; 3] = std::array::from_fn(|a| start[a].clamp(0, (last[a] - 1).max(0)));
    let to: [i64; 3] = std::array::from_fn(|a| end[a].min(last[a]).max((from[a] + 1).min(last[a])));
    let count: [usize; 3] = std::array::from_fn(|a| (to[a] - from[a] + 1) as usize);
    let len = count.iter().product::<usize>();
    room.resize(2 * len, 0.0);
    let (target_values, field_values) = room.split_at_mut(len);
    let frame = region.frame();
    field.frame_values(&frame, from, count, field_values);
    // Most targets are this field and a tool.
    if !target.frame_values_from(field, field_values, &frame, from, count, target_values) {
        target.frame_values(&frame, from, count, target_values);
    }
    let at = |i: [i64; 3]| {
        let [x, y, z]: [usize; 3] = std::array::from_fn(|a| (i[a] - from[a]) as usize);
        (x * count[1] + y) * count[2] + z
    };
    for (n, (targets, rests)) in targets.iter_mut().zip(rests.iter_mut()).enumerate() {
        let first = [first[0], first[1], first[2] + (n * TILE) as i64];
        let [begin, stop] = [start[2].max(first[2]), end[2].min(first[2] + TILE as i64 - 1)];
        for x in start[0]..=end[0] {
            for y in start[1]..=end[1] {
                let to_row = ((x - first[0]) as usize * TILE + (y - first[1]) as usize) * TILE;
                if !leaves_box {
                    let (i, to) = (at([x, y, begin]), to_row + (begin - first[2]) as usize);
                    let len = (stop - begin + 1) as usize;
                    let (t, f) = (&target_values[i..i + len], &field_values[i..i + len]);
                    targets[to..to + len].copy_from_slice(t);
                    for (rest, (t, f)) in rests[to..to + len].iter_mut().zip(t.iter().zip(f)) {
                        *rest = t - f;
                    }
                    continue;
                }
                for z in begin..=stop {
                    let to = to_row + (z - first[2]) as usize;
                    let on = |values: &[f64]| straight([x, y, z], last, |i| values[at(i)]);
                    let (t, f) = (on(target_values), on(field_values));
                    (targets[to], rests[to]) = (t, t - f);
                }
            }
        }
        go_on(first, [start[0], start[1], begin], [end[0], end[1], stop], rests);
    }
    len as u64
}

/// Beside what is sampled, `start ..= end` of the tile that begins at `first`, the rest goes on as it is.
fn go_on(first: [i64; 3], start: [i64; 3], end: [i64; 3], rests: &mut Values) {
    const PLANE: usize = TILE * TILE;
    let [xs, ys, zs] = [0, 1, 2].map(|a| (start[a] - first[a]) as usize..(end[a] + 1 - first[a]) as usize);
    if [&xs, &ys, &zs].iter().all(|range| range.len() == TILE) {
        return;
    }
    for x in xs.clone() {
        let plane = &mut rests[x * PLANE..][..PLANE];
        for y in ys.clone() {
            let row = &mut plane[y * TILE..][..TILE];
            let ends = [row[zs.start], row[zs.end - 1]];
            row[..zs.start].fill(ends[0]);
            row[zs.end..].fill(ends[1]);
        }
        beside(plane, TILE, &ys);
    }
    beside(rests, PLANE, &xs);
}

/// Copies the first and the last of the parts `known`, each `len` long, to those before and behind.
fn beside(values: &mut [f64], len: usize, known: &Range<usize>) {
    for part in 0..known.start {
        values.copy_within(known.start * len..(known.start + 1) * len, part * len);
    }
    for part in known.end..values.len() / len {
        values.copy_within((known.end - 1) * len..known.end * len, part * len);
    }
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
