//! Least squares on a level near the surface, without a matrix, preconditioned by its diagonal.
//!
//! Energy (unit box): `Σ_k w_k [(f(x_k) - d_k)² + β²|∇f(x_k) + n_k|²] + μ Σ_i (Δ C_i)²`, `Δ` the seven-point Laplacian
//! of the level's totals, a stencil counted where all its taps exist. Of `|∇f + n|²` the part across `n` counts by the
//! certainty of its direction: along `n`, an error of angle `θ` is one of `θ²/2` only. The unknowns are the corrections of the
//! active functions; the penalty sees the whole field, so the coarser levels' part is on the right-hand side.

use bspline::Real;
use rayon::prelude::*;

use super::band::{BRICK, BRICK_LEN, Band, HALO_LEN, NONE, STRIDES};
use super::cg::{Stop, System, conjugate_gradients};
use super::laplacian::seven_point;
use super::outcome::SolverOutcome;
#[cfg(target_arch = "x86_64")]
use super::pair::in_pairs;
use super::stencil::{Spot, gather, scatter, scatter_squares};

/// Bricks a thread takes at once; sums are over these chunks, whatever the number of threads.
const CHUNK: usize = 128;

/// Adds what `f` makes of value and cell gradient at every sample.
///
/// Out of line, where its registers are its own: within the loop over bricks the whole fit takes a seventh longer.
#[inline(never)]
fn over_samples<T: Real>(
    samples: &[BandSample<T>],
    values: &[T; HALO_LEN],
    out: &mut [T; HALO_LEN],
    f: &impl Fn(&BandSample<T>, T, [T; 3]) -> (T, [T; 3]),
) {
    let alone = in_pairs(samples, values, out, f);
    for sample in alone {
        let (v, g) = gather(values, sample.spot, STRIDES);
        let (v, g) = f(sample, v, g);
        scatter(out, sample.spot, STRIDES, v, g);
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn in_pairs<'s, T: Real>(
    samples: &'s [BandSample<T>],
    _: &[T; HALO_LEN],
    _: &mut [T; HALO_LEN],
    _: &impl Fn(&BandSample<T>, T, [T; 3]) -> (T, [T; 3]),
) -> &'s [BandSample<T>] {
    samples
}

/// A sample of a band, in the cell coordinates of its brick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BandSample<T> {
    pub spot: Spot<T>,
    pub weight: T,
    /// Weight of the gradient condition: `weight`, or 0 for a condition on the value alone.
    pub gradient_weight: T,
    /// Share of `gradient_weight` for the part of the gradient across the normal.
    pub tangential: T,
    /// Value asked for.
    pub target: T,
    /// Outward unit normal.
    pub normal: [T; 3],
}

impl<T: Real> BandSample<T> {
    /// `g`, its part across the normal by its share.
    #[inline(always)]
    fn weigh(&self, g: [T; 3]) -> [T; 3] {
        let n = self.normal;
        let along = (T::one() - self.tangential) * (n[0] * g[0] + n[1] * g[1] + n[2] * g[2]);
        [
            self.tangential * g[0] + along * n[0],
            self.tangential * g[1] + along * n[1],
            self.tangential * g[2] + along * n[2],
        ]
    }
}

/// The samples of one brick: `samples[start..end]`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BrickSamples {
    pub brick: u32,
    pub start: u32,
    pub end: u32,
}

/// Weights of a level.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weights {
    /// `β`, unit box.
    pub beta: f64,
    /// `μ`.
    pub mu: f64,
}

/// The normal equations of one band.
pub(crate) struct BandProblem<'a, T> {
    pub band: &'a Band<T>,
    pub samples: &'a [BandSample<T>],
    pub bricks: &'a [BrickSamples],
    pub weights: Weights,
    /// Index of a brick's halo among those of bricks with samples.
    place_of: Vec<u32>,
}

impl<'a, T: Real> BandProblem<'a, T> {
    pub fn new(
        band: &'a Band<T>,
        samples: &'a [BandSample<T>],
        bricks: &'a [BrickSamples],
        weights: Weights,
    ) -> Self {
        let mut place_of = vec![NONE; band.keys.len()];
        for (slot, b) in bricks.iter().enumerate() {
            place_of[b.brick as usize] = slot as u32;
        }
        Self {
            band,
            samples,
            bricks,
            weights,
            place_of,
        }
    }

    /// Corrections of the active functions that lower the energy, in band order, from zero.
    ///
    /// Stops at `tolerance` times the starting preconditioned residual, or after `limit` iterations.
    pub fn solve(&self, tolerance: f64, limit: usize) -> (Vec<T>, SolverOutcome) {
        let mut scratch = Scratch::default();
        let inverse = self.inverse_diagonal(&mut scratch);
        let r = self.descent_direction(&mut scratch);
        let mut x = vec![T::zero(); r.len()];
        let mut system = Jacobi {
            problem: self,
            inverse,
            dense: vec![T::zero(); self.band.totals.len()],
            scratch,
        };
        let stop = Stop {
            residual: tolerance,
            against: None,
            limit,
        };
        let outcome = conjugate_gradients(&mut system, &mut x, r, stop, |_| Ok(()))
            .expect("nothing here can be cancelled");
        let depth = Some(self.band.depth);
        (x, SolverOutcome { depth, ..outcome })
    }

    /// Writes a vector over active functions into an array of bricks.
    fn expand(&self, active: &[T], dense: &mut [T]) {
        for (b, values) in dense.chunks_exact_mut(BRICK_LEN).enumerate() {
            self.band.for_active(b, |slot, at| values[slot] = active[at]);
        }
    }

    fn gradient_weight(&self) -> T {
        T::from_f64((self.weights.beta * (1u64 << self.band.depth) as f64).powi(2))
    }

    /// `Hx` on the active functions, for `x` given in bricks.
    fn apply(&self, dense: &[T], scratch: &mut Scratch<T>, out: &mut [T]) {
        let gw = self.gradient_weight();
        self.data_halos(
            dense,
            &mut scratch.halos,
            #[inline(always)]
            |sample, v, g| {
                let slope = sample.gradient_weight * gw;
                let [x, y, z] = sample.weigh(g);
                (sample.weight * v, [slope * x, slope * y, slope * z])
            },
        );
        self.laplacians(dense, &mut scratch.laplacians);
        self.gather(scratch, T::one(), out);
    }

    /// Half the negative gradient of the energy at the prolonged field.
    fn descent_direction(&self, scratch: &mut Scratch<T>) -> Vec<T> {
        let gw = self.gradient_weight();
        let h = T::from_f64(0.5f64.powi(self.band.depth as i32));
        self.data_halos(
            &self.band.totals,
            &mut scratch.halos,
            #[inline(always)]
            |sample, v, [x, y, z]| {
                let slope = sample.gradient_weight * gw;
                let n = sample.normal;
                let [x, y, z] = sample.weigh([x + h * n[0], y + h * n[1], z + h * n[2]]);
                (
                    sample.weight * (v - sample.target),
                    [slope * x, slope * y, slope * z],
                )
            },
        );
        self.laplacians(&self.band.totals, &mut scratch.laplacians);
        let mut out = vec![T::zero(); self.band.active_count()];
        self.gather(scratch, -T::one(), &mut out);
        out
    }

    /// What the samples of every brick add to its halo: `f` makes it of value and cell gradient of `dense` at a sample.
    fn data_halos(
        &self,
        dense: &[T],
        halos: &mut Vec<T>,
        f: impl Fn(&BandSample<T>, T, [T; 3]) -> (T, [T; 3]) + Sync,
    ) {
        let (mut values, f) = ([T::zero(); HALO_LEN], &f);
        self.halos(halos, move |brick, samples, out| {
            self.band.halo(dense, brick, &mut values);
            over_samples(samples, &values, out, f);
        });
    }

    /// Fills the halo of every brick with samples by `fill`, which is given the brick, its samples and the halo, all zero.
    fn halos(
        &self,
        halos: &mut Vec<T>,
        fill: impl FnMut(usize, &[BandSample<T>], &mut [T; HALO_LEN]) + Clone + Sync + Send,
    ) {
        halos.resize(self.bricks.len() * HALO_LEN, T::zero());
        halos
            .par_chunks_mut(CHUNK * HALO_LEN)
            .zip(self.bricks.par_chunks(CHUNK))
            .for_each(|(halos, bricks)| {
                let mut fill = fill.clone();
                let (halos, _) = halos.as_chunks_mut::<HALO_LEN>();
                for (out, b) in halos.iter_mut().zip(bricks) {
                    out.fill(T::zero());
                    let samples = &self.samples[b.start as usize..b.end as usize];
                    fill(b.brick as usize, samples, out);
                }
            });
    }

    /// `Δ dense` at every slot whose stencil is complete, else 0.
    fn laplacians(&self, dense: &[T], out: &mut Vec<T>) {
        out.resize(dense.len(), T::zero());
        out.par_chunks_mut(CHUNK * BRICK_LEN)
            .enumerate()
            .for_each(|(chunk, out)| {
                for (i, out) in out.chunks_exact_mut(BRICK_LEN).enumerate() {
                    let brick = chunk * CHUNK + i;
                    seven_point(self.band, dense, brick, out);
                    self.clear_incomplete(brick, out);
                }
            });
    }

    /// Stencils centred on the first or last function of the box lack a tap.
    fn clear_incomplete(&self, brick: usize, out: &mut [T]) {
        let last = (1usize << self.band.depth) + 2;
        let key = self.band.keys[brick].map(|k| k as usize * BRICK);
        if key.iter().all(|&k| k > 0 && k + BRICK <= last) {
            return;
        }
        for (slot, value) in out.iter_mut().enumerate() {
            let [x, y, z] = [slot / BRICK / BRICK, slot / BRICK % BRICK, slot % BRICK];
            let s = [key[0] + x, key[1] + y, key[2] + z];
            if s.iter().any(|&s| s == 0 || s >= last) {
                *value = T::zero();
            }
        }
    }

    /// `sign · (data + μ Δᵀ Laplacians)` on the active functions.
    fn gather(&self, scratch: &Scratch<T>, sign: T, out: &mut [T]) {
        let mu = T::from_f64(self.weights.mu);
        let chunks = split_by_offsets(out, &self.band.offsets, CHUNK);
        chunks.into_par_iter().enumerate().for_each(|(chunk, out)| {
            let first = chunk * CHUNK;
            let base = self.band.offsets[first];
            let (mut data, mut penalty) = ([T::zero(); BRICK_LEN], [T::zero(); BRICK_LEN]);
            for brick in first..(first + CHUNK).min(self.band.keys.len()) {
                if self.band.masks[brick] == 0 {
                    continue;
                }
                self.band
                    .collect_halos(&scratch.halos, &self.place_of, brick, &mut data);
                seven_point(self.band, &scratch.laplacians, brick, &mut penalty);
                self.band.for_active(brick, |slot, at| {
                    out[at - base] = sign * (data[slot] + mu * penalty[slot]);
                });
            }
        });
    }

    fn inverse_diagonal(&self, scratch: &mut Scratch<T>) -> Vec<T> {
        let gw = self.gradient_weight();
        self.halos(&mut scratch.halos, |_, samples, out| {
            for sample in samples {
                let slope = sample.gradient_weight * gw;
                let along = (T::one() - sample.tangential) * slope;
                let squares = sample.normal.map(|n| sample.tangential * slope + along * n * n);
                scatter_squares(out, sample.spot, STRIDES, sample.weight, squares);
            }
        });
        scratch.laplacians.resize(self.band.totals.len(), T::zero());
        let mut diagonal = vec![T::zero(); self.band.active_count()];
        self.gather(scratch, T::one(), &mut diagonal);
        // Δᵀ Δ: 6² from the stencil's own centre, 1 from each of six neighbours'. Where the box cuts some off
        // this is an overestimate, which a preconditioner may be.
        let penalty = T::from_f64(42.0 * self.weights.mu);
        for d in &mut diagonal {
            *d = T::one() / (*d + penalty + T::min_positive_value());
        }
        diagonal
    }
}

/// A band's problem with the inverse of its diagonal, and what an application needs.
struct Jacobi<'p, 'a, T> {
    problem: &'p BandProblem<'a, T>,
    inverse: Vec<T>,
    /// A vector written into an array of bricks.
    dense: Vec<T>,
    scratch: Scratch<T>,
}

impl<T: Real> System for Jacobi<'_, '_, T> {
    type Vector = Vec<T>;

    fn apply(&mut self, p: &Vec<T>, image: &mut Vec<T>) {
        self.problem.expand(p, &mut self.dense);
        self.problem.apply(&self.dense, &mut self.scratch, image);
    }

    fn precondition(&mut self, r: &Vec<T>, z: &mut Vec<T>) -> f64 {
        for ((z, r), w) in z.iter_mut().zip(r).zip(&self.inverse) {
            *z = *r * *w;
        }
        let w = &self.inverse;
        lane_sum(r.len(), |i| r[i].as_f64() * r[i].as_f64() * w[i].as_f64())
    }

    fn dot(&self, a: &Vec<T>, b: &Vec<T>) -> f64 {
        lane_sum(a.len(), |i| a[i].as_f64() * b[i].as_f64())
    }

    fn add(&self, y: &mut Vec<T>, a: f64, x: &Vec<T>) {
        let a = T::from_f64(a);
        for (y, x) in y.iter_mut().zip(x) {
            *y += a * *x;
        }
    }

    fn turn(&self, p: &mut Vec<T>, b: f64, z: &Vec<T>) {
        let b = T::from_f64(b);
        for (p, z) in p.iter_mut().zip(z) {
            *p = *z + b * *p;
        }
    }
}

#[derive(Default)]
struct Scratch<T> {
    halos: Vec<T>,
    laplacians: Vec<T>,
}

/// The slices of `values` that belong to each chunk of `chunk` bricks.
fn split_by_offsets<'v, T>(values: &'v mut [T], offsets: &[usize], chunk: usize) -> Vec<&'v mut [T]> {
    let bricks = offsets.len() - 1;
    let mut rest = values;
    let mut parts = Vec::with_capacity(bricks.div_ceil(chunk));
    for first in (0..bricks).step_by(chunk) {
        let len = offsets[(first + chunk).min(bricks)] - offsets[first];
        let (part, tail) = rest.split_at_mut(len);
        parts.push(part);
        rest = tail;
    }
    parts
}

/// Sums run over fixed lanes, so that they do not depend on the vector width, and accumulate in f64.
fn lane_sum(n: usize, term: impl Fn(usize) -> f64) -> f64 {
    const LANES: usize = 8;
    let mut lanes = [0.0; LANES];
    for i in (0..n - n % LANES).step_by(LANES) {
        for (l, lane) in lanes.iter_mut().enumerate() {
            *lane += term(i + l);
        }
    }
    let tail: f64 = (n - n % LANES..n).map(term).sum();
    lanes.iter().sum::<f64>() + tail
}
