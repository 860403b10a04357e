//! The octree: each level corrects the one before where the signed distance is not met.

use bspline::hierarchical::{BRICK, BrickKey, HALO};
use bspline::{Field, HierarchicalSpline, Real};
use glam::DVec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::Plan;
use super::base::{Base, KNOTS, base};
use super::distance::MeshDistance;
use super::probes::{Cell, Octants, Probe, center, child};
use crate::points::BASE_DEPTH;
use crate::points::assemble::assemble_in;
use crate::points::band::{Band, Coarser, NONE, bricks_near};
use crate::points::band_solve::{BandProblem, BandSample, BrickSamples, Weights};
use crate::points::cascade::{Level, level_bytes};
use crate::points::stencil::{Spot, gather};
use crate::{Control, FitError, FitReport, Leaf, StopReason};

/// Weight `β` of the gradient condition, in cells.
const BETA: f64 = 0.25;
/// Weight `μ` of the bending energy.
const BENDING: f64 = 1e-5;
/// Conjugate gradients stop at this relative residual, or after so many iterations.
const RESIDUAL: f64 = 0.01;
const ITERATIONS: usize = 12;
/// How far coefficients are held round the active functions: all that the cells they reach read.
const REACH: u32 = 3;
/// Weight of a condition that stands for a larger part of space than those of the level at hand, at most.
const MOST_WEIGHT: f32 = 8.0;
/// Weight of a corner of the surface: there may be many in a cell.
const LEAST_WEIGHT: f32 = 0.25;
/// Share of the tolerance that is aimed at: cells beside refined ones move a little after they were judged.
const AIM: f64 = 0.8;

/// Bytes held at once with so many bricks and probes on a level.
pub(crate) fn bytes<T>(bricks: usize, probes: usize, triangles: usize, vertices: usize) -> u64 {
    let per_probe = 3 * size_of::<Probe>() + size_of::<BandSample<T>>() + 32;
    let mesh = triangles * 600 + vertices * 64;
    level_bytes::<T>(bricks, 0) + (probes * per_probe + mesh) as u64 + (16 << 20)
}

/// Errors of a cell.
#[derive(Clone, Copy, Debug, Default)]
struct Quality {
    count: u32,
    square: f64,
    max: f64,
    /// Parts in which a probe is above what is allowed.
    over: u8,
}

impl Quality {
    fn add(&mut self, error: f64, probe: &Probe, octant: usize, plan: &Plan) {
        let distance = f64::from(probe.distance);
        if error > AIM * plan.allowed(distance, probe.in_hole) {
            self.over |= 1 << octant;
        }
        if distance <= plan.band && !probe.in_hole {
            self.count += 1;
            self.square += error * error;
            self.max = self.max.max(error);
        }
    }
}

/// A leaf before its errors are known.
struct LeafCell {
    depth: usize,
    at: [u32; 3],
    reason: StopReason,
}

/// State between levels.
struct Octree<'a> {
    mesh: &'a MeshDistance,
    plan: &'a Plan,
    /// Cells to refine on the level at hand.
    cells: Vec<Cell>,
    /// Conditions of leaves.
    settled: Vec<Probe>,
    /// Corners of the surface, where a smooth field errs most.
    corners: Vec<Probe>,
    leaves: Vec<LeafCell>,
}

pub(crate) fn fit<T: Real>(
    mesh: &MeshDistance,
    plan: &Plan,
    triangles: usize,
    vertices: usize,
    control: &mut Control,
) -> Result<(HierarchicalSpline<T>, FitReport), FitError> {
    control.step("fitting the coarse level", 0.1)?;
    let base = base(mesh);
    let mut tree = Octree {
        mesh,
        plan,
        cells: Vec::new(),
        settled: Vec::new(),
        corners: mesh.corners().map(Probe::corner).collect(),
        leaves: Vec::new(),
    };
    tree.judge_base(&base);
    let mut levels: Vec<Level<T>> = Vec::new();
    let mut coarser: Option<Band<T>> = None;
    let mut coefficients = base.grid.values.len();
    for depth in BASE_DEPTH + 1..=plan.max_depth {
        if tree.cells.is_empty() {
            break;
        }
        let share = 0.3f64.powi((plan.max_depth - depth) as i32);
        control.step("fitting finer levels", 0.2 + 0.7 * share)?;
        tree.cells
            .sort_unstable_by_key(|c| (c.at.map(|x| x / BRICK as u32), c.at));
        if let Some(reason) = tree.no_room::<T>(depth, coefficients, triangles, vertices, control) {
            tree.give_up(depth, reason);
            break;
        }
        let below = coarser.as_ref().map_or(Coarser::Full(&base.grid), Coarser::Band);
        let (band, level) = tree.refine(depth, &below);
        coefficients += level.x.len();
        levels.push(level);
        coarser = Some(band);
    }
    control.step("measuring", 0.92)?;
    let field = assemble_in(mesh.origin, mesh.scale, &base.grid, &levels);
    let report = tree.report(&field, triangles);
    Ok((field, report))
}

impl Octree<'_> {
    /// Asks in the cells of the base level that the surface comes near, and marks their parts to be refined.
    fn judge_base(&mut self, base: &Base) {
        let n = 1u32 << BASE_DEPTH;
        let h = 1.0 / f64::from(n);
        // Corner of a cell: its place and what was found there.
        let corner = |at: [u32; 3], c: usize| {
            let k: [usize; 3] = std::array::from_fn(|a| at[a] as usize + (c >> (2 - a) & 1));
            let place = DVec3::from_array(k.map(|k| k as f64)) * h;
            (
                place,
                &base.knots[((k[0] + 2) * KNOTS + k[1] + 2) * KNOTS + k[2] + 2],
            )
        };
        // A crease of the distance costs the base level less than a fifth of a cell, which is allowed farther out.
        let reach = self.plan.band + h;
        let cells: Vec<Cell> = (0..n.pow(3))
            .into_par_iter()
            .filter_map(|i| {
                let at = [i / (n * n), i / n % n, i % n];
                let nearest = (0..8)
                    .map(|c| corner(at, c))
                    .min_by(|a, b| a.1.distance.total_cmp(&b.1.distance))?;
                (nearest.1.distance <= reach).then(|| Cell {
                    at,
                    center: self.mesh.at(center(at, BASE_DEPTH), Some(nearest)),
                })
            })
            .collect();
        let octants: Vec<Octants> = cells
            .par_iter()
            .map(|c| c.ask(self.mesh, BASE_DEPTH, self.plan.tolerance))
            .collect();
        let m = base.grid.width();
        let cell_of = |p: DVec3| p.to_array().map(|x| ((x * f64::from(n)) as u32).min(n - 1));
        let error = |probe: &Probe| {
            let (at, place) = (cell_of(probe.at).map(|c| c as usize), probe.at * f64::from(n));
            let spot = Spot {
                start: (at[0] * m + at[1]) * m + at[2],
                t: std::array::from_fn(|a| place[a] - at[a] as f64),
            };
            (gather(&base.grid.values, spot, [m * m, m]).0 - probe.value).abs()
        };
        let mut quality: Vec<Quality> = cells
            .par_iter()
            .zip(&octants)
            .map(|(cell, octants)| {
                let mut probes = Vec::with_capacity(16);
                octants.probes(cell, BASE_DEPTH, &mut probes);
                let mut q = Quality::default();
                for probe in &probes {
                    q.add(error(probe), probe, octant_of(probe.at, BASE_DEPTH), self.plan);
                }
                q
            })
            .collect();
        let index: FxHashMap<[u32; 3], usize> = cells.iter().map(|c| c.at).zip(0..).collect();
        for corner in &self.corners {
            if let Some(&i) = index.get(&cell_of(corner.at)) {
                quality[i].add(error(corner), corner, octant_of(corner.at, BASE_DEPTH), self.plan);
            }
        }
        self.judge(BASE_DEPTH, &cells, &octants, &quality);
    }

    /// Splits cells or makes them leaves.
    fn judge(&mut self, depth: usize, cells: &[Cell], octants: &[Octants], quality: &[Quality]) {
        let mut next = Vec::new();
        let half = 0.5f64.powi(depth as i32 + 1);
        for ((cell, octants), q) in cells.iter().zip(octants).zip(quality) {
            let is_last = depth == self.plan.max_depth;
            if q.over == 0 || is_last {
                octants.probes(cell, depth, &mut self.settled);
                self.leaves.push(LeafCell {
                    depth,
                    at: cell.at,
                    reason: if q.over == 0 {
                        StopReason::Tolerance
                    } else {
                        StopReason::Depth
                    },
                });
                continue;
            }
            let mut kept = Vec::new();
            octants.probes(cell, depth, &mut kept);
            for (o, found) in octants.found.iter().enumerate() {
                // Parts that the band passes through belong to it whole.
                if q.over >> o & 1 == 1 || found.distance <= self.plan.band + 0.87 * half {
                    next.push(Cell {
                        at: child(cell.at, o),
                        center: *found,
                    });
                } else {
                    self.settled.push(kept[o]);
                }
            }
        }
        self.cells = next;
    }

    /// Why the level of `depth` cannot be begun, if it cannot.
    fn no_room<T: Real>(
        &self,
        depth: usize,
        coefficients: usize,
        triangles: usize,
        vertices: usize,
        control: &Control,
    ) -> Option<StopReason> {
        if self.plan.coefficients.is_some_and(|limit| coefficients >= limit) {
            return Some(StopReason::Budget);
        }
        control.memory_limit?;
        let at: Vec<[u32; 3]> = self.cells.iter().map(|c| c.at).collect();
        let bricks = bricks_near(depth, &at, REACH).0.len();
        let probes = 16 * self.cells.len() + self.settled.len();
        control
            .reserve(bytes::<T>(bricks, probes, triangles, vertices))
            .is_err()
            .then_some(StopReason::Memory)
    }

    /// The cells that would have been refined are leaves of the level above.
    fn give_up(&mut self, depth: usize, reason: StopReason) {
        let mut above: Vec<[u32; 3]> = self.cells.iter().map(|c| c.at.map(|x| x / 2)).collect();
        above.sort_unstable();
        above.dedup();
        self.leaves.extend(above.into_iter().map(|at| LeafCell {
            depth: depth - 1,
            at,
            reason,
        }));
        let size = 0.5f64.powi(depth as i32);
        let cells = std::mem::take(&mut self.cells);
        self.settled.extend(
            cells
                .iter()
                .map(|c| Probe::new(center(c.at, depth), &c.center, size)),
        );
    }

    /// Fits the corrections of one level, and judges its cells.
    fn refine<T: Real>(&mut self, depth: usize, coarser: &Coarser<'_, T>) -> (Band<T>, Level<T>) {
        let cells = std::mem::take(&mut self.cells);
        let octants: Vec<Octants> = cells
            .par_iter()
            .map(|c| c.ask(self.mesh, depth, self.plan.tolerance))
            .collect();
        let at: Vec<[u32; 3]> = cells.iter().map(|c| c.at).collect();
        let mut band = Band::around_reaching(depth, &at, REACH, coarser);
        let conditions = self.conditions(depth, &band, &cells, &octants);
        let problem = BandProblem::new(
            &band,
            &conditions.samples,
            &conditions.bricks,
            Weights {
                beta: BETA * 0.5f64.powi(depth as i32),
                mu: BENDING,
            },
        );
        let (x, _) = problem.solve(RESIDUAL, ITERATIONS);
        band.add_active(&x);
        let quality = self.quality(depth, &band, &conditions, cells.len());
        self.judge(depth, &cells, &octants, &quality);
        let level = Level {
            keys: band.keys.clone(),
            masks: band.masks.clone(),
            x,
        };
        (band, level)
    }

    /// All conditions in cells whose coefficients the band holds: those of its own cells, and those of leaves round
    /// them, which keep the tails of the corrections in place.
    fn conditions<T: Real>(
        &self,
        depth: usize,
        band: &Band<T>,
        cells: &[Cell],
        octants: &[Octants],
    ) -> Conditions<T> {
        let n = (1u64 << depth) as f64;
        let near = near_masks(depth, band, cells);
        let index: FxHashMap<[u32; 3], u32> = cells.iter().map(|c| c.at).zip(0..).collect();
        let own_size = 0.5f64.powi(depth as i32 + 1) as f32;
        let place = |probe: &Probe| -> Option<(u64, Probe, u32)> {
            let at = (probe.at * n)
                .to_array()
                .map(|x| (x as u32).min((1 << depth) - 1));
            let brick = band.find(BrickKey(at.map(|c| c / BRICK as u32)))?;
            let local = at.map(|c| c as usize % BRICK);
            let is_near = near[brick][local[0]] >> (BRICK * local[1] + local[2]) & 1 == 1;
            let slot = (local[0] * BRICK + local[1]) * BRICK + local[2];
            let owner = index.get(&at).copied().unwrap_or(NONE);
            is_near.then_some(((brick * BRICK.pow(3) + slot) as u64, *probe, owner))
        };
        let mut placed: Vec<(u64, Probe, u32)> = cells
            .par_iter()
            .zip(octants)
            .flat_map_iter(|(cell, octants)| {
                let mut probes = Vec::with_capacity(16);
                octants.probes(cell, depth, &mut probes);
                probes.iter().filter_map(place).collect::<Vec<_>>()
            })
            .collect();
        placed.par_extend(self.settled.par_iter().filter_map(place));
        placed.par_extend(self.corners.par_iter().filter_map(place));
        placed.par_sort_by_key(|p| p.0);
        let mut out = Conditions {
            samples: Vec::with_capacity(placed.len()),
            bricks: Vec::new(),
            probes: Vec::with_capacity(placed.len()),
        };
        for (key, probe, owner) in placed {
            let brick = (key / BRICK.pow(3) as u64) as u32;
            if out.bricks.last().is_none_or(|b: &BrickSamples| b.brick != brick) {
                let start = out.samples.len() as u32;
                out.bricks.push(BrickSamples {
                    brick,
                    start,
                    end: start,
                });
            }
            let slot = (key % BRICK.pow(3) as u64) as usize;
            let local = [slot / 64, slot / 8 % 8, slot % 8];
            let corner = band.keys[brick as usize].0;
            let q = probe.at * n;
            let weight = (probe.size / own_size).powi(3).clamp(LEAST_WEIGHT, MOST_WEIGHT);
            let has_gradient = probe.normal != [0.0; 3];
            out.samples.push(BandSample {
                spot: Spot {
                    start: (local[0] * HALO + local[1]) * HALO + local[2],
                    t: std::array::from_fn(|a| {
                        T::from_f64(q[a] - (corner[a] as usize * BRICK + local[a]) as f64)
                    }),
                },
                weight: T::from_f64(f64::from(weight)),
                gradient_weight: T::from_f64(if has_gradient { f64::from(weight) } else { 0.0 }),
                tangential: T::one(),
                target: T::from_f64(probe.value),
                normal: probe.normal.map(|c| T::from_f64(f64::from(c))),
            });
            out.bricks.last_mut().expect("just made").end += 1;
            out.probes.push((probe, owner));
        }
        out
    }

    /// Errors of the cells of a solved level, one entry a cell.
    fn quality<T: Real>(
        &self,
        depth: usize,
        band: &Band<T>,
        conditions: &Conditions<T>,
        cell_count: usize,
    ) -> Vec<Quality> {
        let errors: Vec<f64> = conditions
            .bricks
            .par_iter()
            .flat_map_iter(|b| {
                let mut values = [T::zero(); HALO * HALO * HALO];
                band.halo(&band.totals, b.brick as usize, &mut values);
                let samples = &conditions.samples[b.start as usize..b.end as usize];
                samples
                    .iter()
                    .map(|s| {
                        (gather(&values, s.spot, [HALO * HALO, HALO]).0 - s.target)
                            .as_f64()
                            .abs()
                    })
                    .collect::<Vec<_>>()
            })
            .collect();
        let mut out = vec![Quality::default(); cell_count];
        for ((probe, owner), error) in conditions.probes.iter().zip(errors) {
            if *owner != NONE {
                out[*owner as usize].add(error, probe, octant_of(probe.at, depth), self.plan);
            }
        }
        out
    }

    /// Errors of the finished field at the conditions of the leaves.
    fn report<T: Real>(&self, field: &HierarchicalSpline<T>, triangles: usize) -> FitReport {
        let scale = self.mesh.scale;
        let errors: Vec<f64> = self
            .settled
            .par_iter()
            .with_min_len(1024)
            .map(|p| (field.value(self.mesh.origin + p.at * scale) - p.value * scale).abs())
            .collect();
        let index: FxHashMap<(usize, [u32; 3]), usize> =
            self.leaves.iter().map(|l| (l.depth, l.at)).zip(0..).collect();
        let levels: Vec<usize> = (BASE_DEPTH..=self.plan.max_depth).rev().collect();
        let mut sums = vec![(0u32, 0.0f64, 0.0f64); self.leaves.len()];
        let mut in_band = Vec::new();
        for (probe, &error) in self.settled.iter().zip(&errors) {
            if f64::from(probe.distance) > self.plan.band || probe.in_hole {
                continue;
            }
            in_band.push(error);
            let leaf = levels.iter().find_map(|&depth| {
                let n = (1u64 << depth) as f64;
                index.get(&(depth, (probe.at * n).to_array().map(|x| x as u32)))
            });
            if let Some(&leaf) = leaf {
                let sum = &mut sums[leaf];
                *sum = (sum.0 + 1, sum.1 + error * error, sum.2.max(error));
            }
        }
        let tolerance = self.plan.tolerance * scale;
        let leaves = self.leaves.iter().zip(sums).map(|(leaf, (count, square, max))| {
            let rms = (square / f64::from(count.max(1))).sqrt();
            let moved = leaf.reason == StopReason::Tolerance && max > tolerance;
            Leaf {
                level: (leaf.depth - BASE_DEPTH) as u8,
                cell: leaf.at,
                sample_count: count,
                rms: rms as f32,
                max: max as f32,
                reason: if moved {
                    StopReason::Neighbours
                } else {
                    leaf.reason
                },
            }
        });
        let count = in_band.len().max(1);
        let rms = (in_band.iter().map(|e| e * e).sum::<f64>() / count as f64).sqrt();
        let max = in_band.iter().copied().fold(0.0, f64::max);
        let p95 = if in_band.is_empty() {
            0.0
        } else {
            *in_band
                .select_nth_unstable_by((count - 1) * 95 / 100, f64::total_cmp)
                .1
        };
        FitReport {
            input_count: triangles,
            used_count: triangles,
            coefficients: field.coefficient_count(),
            depth: BASE_DEPTH + field.level_count() - 1,
            rms,
            p95,
            max,
            bound: max + field.rounding_bound(),
            noise: None,
            tolerance,
            smoothing: BENDING,
            leaves: leaves.collect(),
            left_out: Vec::new(),
            signs: None,
            notes: Vec::new(),
        }
    }
}

/// Which part of its cell on the grid of `depth` a point lies in: `4x + 2y + z`.
fn octant_of(at: DVec3, depth: usize) -> usize {
    let part = (at * (2u64 << depth) as f64).to_array().map(|x| x as usize & 1);
    4 * part[0] + 2 * part[1] + part[2]
}

/// Conditions of one level, brick by brick.
struct Conditions<T> {
    samples: Vec<BandSample<T>>,
    bricks: Vec<BrickSamples>,
    /// Each with the cell it lies in, or [`NONE`] if that is a leaf.
    probes: Vec<(Probe, u32)>,
}

/// Cells, brick by brick, within two of a refined one: those that its functions reach. Word `x`, bit `8y + z`.
fn near_masks<T: Real>(depth: usize, band: &Band<T>, cells: &[Cell]) -> Vec<[u64; BRICK]> {
    let mut masks = vec![[0u64; BRICK]; band.keys.len()];
    let last = (1u32 << depth) - 1;
    let size = BRICK as u32;
    for cell in cells {
        let low = cell.at.map(|c| c.saturating_sub(2));
        let high = cell.at.map(|c| (c + 2).min(last));
        for x in low[0] / size..=high[0] / size {
            for y in low[1] / size..=high[1] / size {
                for z in low[2] / size..=high[2] / size {
                    let key = [x, y, z];
                    let brick = band
                        .find(BrickKey(key))
                        .expect("the band reaches round its cells");
                    let from: [u32; 3] = std::array::from_fn(|a| low[a].max(key[a] * size) % size);
                    let to: [u32; 3] = std::array::from_fn(|a| high[a].min(key[a] * size + size - 1) % size);
                    let run = (2u64 << to[2]) - (1 << from[2]);
                    for i in from[0]..=to[0] {
                        for j in from[1]..=to[1] {
                            masks[brick][i as usize] |= run << (size * j);
                        }
                    }
                }
            }
        }
    }
    masks
}
