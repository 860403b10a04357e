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
    let (lo, hi) = region.sampled();
    let last = region.last();
    let first = key.map(|k| i64::from(k) * TILE as i64);
    let size = [TILE, TILE, TILE * targets.len()];
    let start: [i64; 3] = std::array::from_fn(|a| first[a].max(lo[a]));
    let end: [i64; 3] = std::array::from_fn(|a| (first[a] + size[a] as i64 - 1).min(hi[a]));
    let is_whole = (0..3).all(|a| end[a] - start[a] + 1 == size[a] as i64);
    if !is_whole {
        targets.as_flattened_mut().fill(f64::NAN);
    }
    if (0..3).any(|a| start[a] > end[a]) {
        rests.as_flattened_mut().fill(0.0);
        return 0;
    }
    // Outside of the lattice's box, where coefficients do not reach, the values go on in straight lines from inside.
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
        let (inner_begin, inner_stop) = (begin.max(0), stop.min(last[2]));
        for x in start[0]..=end[0] {
            for y in start[1]..=end[1] {
                let to_row = ((x - first[0]) as usize * TILE + (y - first[1]) as usize) * TILE;
                let to = |z: i64| to_row + (z - first[2]) as usize;
                if inner_begin <= inner_stop {
                    let row = to(inner_begin)..to(inner_stop) + 1;
                    let (t, r) = (&mut targets[row.clone()], &mut rests[row]);
                    if (0..=last[0]).contains(&x) && (0..=last[1]).contains(&y) {
                        let known = at([x, y, inner_begin]);
                        let known = known..known + t.len();
                        put_row([t, r], [&target_values[known.clone()], &field_values[known]]);
                    } else {
                        let rows = columns([x, y], last);
                        let rows = rows.map(|([x, y], weight)| (at([x, y, inner_begin]), weight));
                        straight_row(rows.clone(), target_values, t);
                        straight_row(rows, field_values, r);
                        r.iter_mut().zip(t).for_each(|(r, t)| *r = *t - *r);
                    }
                }
                for z in (begin..inner_begin.min(stop + 1)).chain((inner_stop + 1).max(begin)..stop + 1) {
                    let on = |values: &[f64]| straight([x, y, z], last, |i| values[at(i)]);
                    let (t, f) = (on(target_values), on(field_values));
                    (targets[to(z)], rests[to(z)]) = (t, t - f);
                }
            }
        }
        go_on(first, [start[0], start[1], begin], [end[0], end[1], stop], rests);
    }
    len as u64
}

/// Target and rest of a row from the values of target and field.
#[inline(always)]
fn put_row([targets, rests]: [&mut [f64]; 2], [target, field]: [&[f64]; 2]) {
    // Most rows are whole: a loop of a known length.
    if let (Ok(targets), Ok(rests)) = (targets.try_into(), rests.try_into()) {
        let (targets, rests): (&mut [f64; TILE], &mut [f64; TILE]) = (targets, rests);
        let (target, field) = (&target[..TILE], &field[..TILE]);
        for z in 0..TILE {
            (targets[z], rests[z]) = (target[z], target[z] - field[z]);
        }
        return;
    }
    for (((to, rest), target), field) in targets.iter_mut().zip(rests).zip(target).zip(field) {
        (*to, *rest) = (*target, target - field);
    }
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
fn straight([x, y, z]: [i64; 3], last: [i64; 3], value: impl Fn([i64; 3]) -> f64) -> f64 {
    let mut sum = 0.0;
    for ([x, y], weight) in columns([x, y], last) {
        for (z, wz) in weights(z, last[2]) {
            if wz != 0.0 {
                sum += weight * wz * value([x, y, z]);
            }
        }
    }
    sum
}

/// [`straight`] of a row along z: `rows` says where those inside begin that it continues, and what they weigh.
fn straight_row(rows: impl Iterator<Item = (usize, f64)>, values: &[f64], out: &mut [f64]) {
    out.fill(0.0);
    for (first, weight) in rows {
        let row = &values[first..first + out.len()];
        out.iter_mut().zip(row).for_each(|(o, v)| *o += weight * v);
    }
}

/// The rows along z inside of which a row is a continuation, and what they weigh.
fn columns([x, y]: [i64; 2], last: [i64; 3]) -> impl Iterator<Item = ([i64; 2], f64)> + Clone {
    let ys = weights(y, last[1]);
    let all = weights(x, last[0])
        .into_iter()
        .flat_map(move |(x, wx)| ys.map(|(y, wy)| ([x, y], wx * wy)));
    all.filter(|(_, weight)| *weight != 0.0)
}

/// The knots in `0 ..= last` whose values one outside continues, and what they weigh; of one inside itself.
fn weights(knot: i64, last: i64) -> [(i64, f64); 2] {
    let face = knot.clamp(0, last);
    let steps = (knot - face).abs() as f64;
    let inner = if knot < 0 { 1.min(last) } else { (last - 1).max(0) };
    [(face, 1.0 + steps), (inner, -steps)]
}
