//! The conditions of one level, and the errors of its cells.

use bspline::Real;
use glam::DVec3;
use rayon::prelude::*;

use super::Plan;
use super::judge::Quality;
use super::probes::{Cell, Octants, Probe, cell_of};
use crate::level::band::{BRICK, Band, HALO_LEN, Key, STRIDES, halo_start, key_of, slot_of};
use crate::level::band_problem::{BandSample, BrickSamples};
use crate::level::stencil::{Spot, gather, gather_value};

/// Weight of a condition that stands for a larger part of space than those of the level at hand, at most.
const MOST_WEIGHT: f32 = 8.0;
/// Weight of a corner of the surface, where a smooth field errs most. On the bunny 95 % of the corners are within 1.5 u
/// with 0.25, 1.0 u with 6, 0.9 u with 12, all of the surface within 0.82, 0.87 and 0.85 u; with 20 it gets worse.
const CORNER_WEIGHT: f32 = 10.0;

/// Conditions of one level, brick by brick.
pub(super) struct Conditions<T> {
    pub samples: Vec<BandSample<T>>,
    pub bricks: Vec<BrickSamples>,
}

/// What else there is to ask than the cells of the level themselves.
pub(super) struct Around<'a> {
    /// Conditions of leaves, which keep the tails of the corrections in place.
    pub settled: &'a [Probe],
    /// Corners of the surface, where a smooth field errs most.
    pub corners: &'a [Probe],
}

/// Place of a point in its cell of a brick's halo.
fn spot<T: Real>(at: DVec3, cell: [u32; 3], depth: usize) -> Spot<T> {
    let q = at * (1u64 << depth) as f64;
    Spot {
        start: halo_start(cell),
        t: std::array::from_fn(|a| T::from_f64(q[a] - f64::from(cell[a]))),
    }
}

fn sample<T: Real>(probe: &Probe, depth: usize) -> BandSample<T> {
    let own_size = 0.5f32.powi(depth as i32 + 1);
    let weight = match probe.size {
        0.0 => CORNER_WEIGHT,
        size => (size / own_size).powi(3).min(MOST_WEIGHT),
    };
    let weight = T::from_f64(f64::from(weight));
    let has_gradient = probe.normal != [0.0; 3];
    BandSample {
        spot: spot(probe.at, cell_of(probe.at, depth), depth),
        weight,
        gradient_weight: if has_gradient { weight } else { T::zero() },
        tangential: T::one(),
        target: T::from_f64(f64::from(probe.value)),
        normal: probe.normal.map(|c| T::from_f64(f64::from(c))),
    }
}

/// Probes brick by brick, in their order.
struct Placed<'a> {
    /// Where those of each brick start, and the end.
    starts: Vec<u32>,
    probes: Vec<&'a Probe>,
}

impl<'a> Placed<'a> {
    fn new(probes: &[&'a Probe], brick_of: &[Option<u32>], bricks: usize) -> Self {
        let mut starts = vec![0u32; bricks + 1];
        for brick in brick_of.iter().flatten() {
            starts[*brick as usize + 1] += 1;
        }
        for brick in 0..bricks {
            starts[brick + 1] += starts[brick];
        }
        let mut next = starts.clone();
        let count = starts[bricks] as usize;
        let mut placed = probes[..count].to_vec();
        for (probe, brick) in probes.iter().zip(brick_of) {
            if let Some(brick) = brick {
                let slot = &mut next[*brick as usize];
                placed[*slot as usize] = probe;
                *slot += 1;
            }
        }
        Self {
            starts,
            probes: placed,
        }
    }

    fn of_brick(&self, brick: usize) -> impl Iterator<Item = &'a Probe> {
        let [start, end] = [self.starts[brick], self.starts[brick + 1]];
        self.probes[start as usize..end as usize].iter().copied()
    }
}

/// The cells of each brick: `cells` are sorted brick by brick.
pub(super) fn by_brick(cells: &[Cell]) -> Vec<(Key, std::ops::Range<usize>)> {
    let mut out = Vec::new();
    let mut start = 0;
    for group in cells.chunk_by(|a, b| key_of(a.at) == key_of(b.at)) {
        out.push((key_of(group[0].at), start..start + group.len()));
        start += group.len();
    }
    out
}

impl<T: Real> Conditions<T> {
    /// All conditions in cells whose coefficients the band holds: those of its own cells, and those round them.
    pub fn new(
        depth: usize,
        band: &Band<T>,
        cells: &[Cell],
        octants: &[Octants],
        around: &Around<'_>,
    ) -> Self {
        let near = near_masks(depth, band, cells);
        let place = |probe: &Probe| -> Option<u32> {
            let cell = cell_of(probe.at, depth);
            let brick = band.find(key_of(cell))?;
            (near[brick] >> slot_of(cell) & 1 == 1).then_some(brick as u32)
        };
        let others: Vec<&Probe> = around.settled.iter().chain(around.corners).collect();
        let brick_of: Vec<Option<u32>> = others.par_iter().map(|probe| place(probe)).collect();
        let others = Placed::new(&others, &brick_of, band.keys.len());
        let mut own = vec![0..0; band.keys.len()];
        for (key, range) in by_brick(cells) {
            own[band.find(key).expect("the band reaches round its cells")] = range;
        }
        let found: Vec<Vec<BandSample<T>>> = (0..band.keys.len())
            .into_par_iter()
            .map(|brick| {
                let mut probes = Vec::new();
                for i in own[brick].clone() {
                    cells[i].conditions(&octants[i], depth, &mut probes);
                }
                let own = probes.iter().map(|p| sample(p, depth));
                own.chain(others.of_brick(brick).map(|p| sample(p, depth)))
                    .collect()
            })
            .collect();
        let mut out = Self {
            samples: Vec::with_capacity(found.iter().map(Vec::len).sum()),
            bricks: Vec::new(),
        };
        for (brick, samples) in found.into_iter().enumerate() {
            if !samples.is_empty() {
                let start = out.samples.len() as u32;
                out.samples.extend(samples);
                out.bricks.push(BrickSamples {
                    brick: brick as u32,
                    start,
                    end: out.samples.len() as u32,
                });
            }
        }
        out
    }
}

/// Errors of the cells of a solved level, one entry a cell.
pub(super) fn qualities<T: Real>(
    depth: usize,
    band: &Band<T>,
    cells: &[Cell],
    octants: &[Octants],
    corners: &[Probe],
    plan: &Plan,
) -> Vec<Quality> {
    let n = (1u64 << depth) as f64;
    let mut cornered: Vec<(Key, u32)> = corners
        .par_iter()
        .zip(0u32..corners.len() as u32)
        .map(|(c, i)| (key_of(cell_of(c.at, depth)), i))
        .collect();
    cornered.par_sort_unstable();
    by_brick(cells)
        .into_par_iter()
        .flat_map_iter(|(key, range)| {
            let mut values = [T::zero(); HALO_LEN];
            let brick = band.find(key).expect("the band reaches round its cells");
            band.halo(&band.totals, brick, &mut values);
            let field = |at: DVec3, cell: [u32; 3]| {
                let (v, g) = gather(&values, spot(at, cell, depth), STRIDES);
                (v.as_f64(), DVec3::from_array(g.map(|g| g.as_f64() * n)))
            };
            let first = range.start;
            let quality = |i: usize| {
                let own = cells[i].at;
                let value = |at| gather_value(&values, spot(at, own, depth), STRIDES).as_f64();
                Quality::of(&cells[i], &octants[i], depth, plan, value, |at| field(at, own))
            };
            let mut out: Vec<Quality> = range.map(quality).collect();
            let start = cornered.partition_point(|c| c.0 < key);
            for (_, i) in cornered[start..].iter().take_while(|c| c.0 == key) {
                let at = corners[*i as usize].at;
                let cell = cell_of(at, depth);
                let own = &cells[first..first + out.len()];
                if let Ok(i) = own.binary_search_by_key(&cell, |c| c.at) {
                    out[i].corners.add(field(at, cell));
                }
            }
            out
        })
        .collect()
}

/// The same of the base level: `field` gives value and gradient anywhere.
pub(super) fn base_qualities(
    depth: usize,
    cells: &[Cell],
    octants: &[Octants],
    plan: &Plan,
    field: impl Fn(DVec3) -> (f64, DVec3) + Sync,
) -> Vec<Quality> {
    cells
        .par_iter()
        .zip(octants)
        .map(|(cell, octants)| Quality::of(cell, octants, depth, plan, |at| field(at).0, &field))
        .collect()
}

/// Cells, brick by brick, within two of a refined one: those that its functions reach.
fn near_masks<T: Real>(depth: usize, band: &Band<T>, cells: &[Cell]) -> Vec<u64> {
    let mut masks = vec![0u64; band.keys.len()];
    let last = (1u32 << depth) - 1;
    let size = BRICK as u32;
    for cell in cells {
        let low = cell.at.map(|c| c.saturating_sub(2));
        let high = cell.at.map(|c| (c + 2).min(last));
        for x in low[0] / size..=high[0] / size {
            for y in low[1] / size..=high[1] / size {
                for z in low[2] / size..=high[2] / size {
                    let key = [x, y, z];
                    let brick = band.find(key).expect("the band reaches round its cells");
                    let from: [u32; 3] = std::array::from_fn(|a| low[a].max(key[a] * size) % size);
                    let to: [u32; 3] = std::array::from_fn(|a| high[a].min(key[a] * size + size - 1) % size);
                    let run = (2u64 << to[2]) - (1 << from[2]);
                    for i in from[0]..=to[0] {
                        for j in from[1]..=to[1] {
                            masks[brick] |= run << (size * (size * i + j));
                        }
                    }
                }
            }
        }
    }
    masks
}
