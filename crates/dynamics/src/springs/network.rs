//! All springs of a patch: their stiffness and rest, and what they pull with.

use bspline::Real;
use bspline::vectorized;
use serde::{Deserialize, Serialize};

use super::law::{Law, length, spring};
use super::stencil::{SpringWeights, Weights};
use crate::lattice::SampleBox;
use crate::units::{binary_unit, largest, springs_in_units};

/// Rest of all springs: `Δ₀` per direction and starting sample, and how much each is scaled.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rest<T> {
    /// `Δ₀` of each spring, per direction, in units of [`SpringNetwork::length_unit`].
    pub differences: Vec<Vec<T>>,
    /// Scale of the rest lengths (4-D) or differences (linear); 1 leaves the rest state as it is.
    pub scale: Weights<T>,
}

/// Energy and stability of a state, beside the forces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpringReport {
    /// `Σ ½k(L - L₀)²`.
    pub energy: f64,
    /// Springs whose tangent was negative and is taken as 0 in the matrix.
    pub clamped: usize,
}

/// All springs of a patch under a law.
#[derive(Clone, Debug)]
pub struct SpringNetwork<T> {
    pub(super) dims: [usize; 3],
    pub(super) law: Law,
    /// `k` per direction, in `stiffness_unit`.
    pub(super) springs: Vec<SpringWeights<T>>,
    stiffness_unit: f64,
    /// Of differences of density, rest lengths and `h`.
    pub(super) length_unit: f64,
    /// `h²` per direction.
    pub(super) lengths: Vec<f64>,
    pub(super) rest: Rest<T>,
    /// Changes of the stiffness so far.
    changes: u64,
    energies: Vec<f64>,
    forces: Vec<T>,
}

/// What springs gained over an increment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct EnergyChange {
    /// Energy.
    pub energy: f64,
    /// What rounding of densities and forces may make of it.
    pub rounding: f64,
}

impl<T: Real> SpringNetwork<T> {
    /// Springs with the stiffness `springs` on samples at the distances `spacing`, at rest at the densities `d`.
    ///
    /// # Panics
    /// If `d` has another length than the lattice.
    pub fn new(
        dims: [usize; 3],
        spacing: [f64; 3],
        law: Law,
        springs: Vec<SpringWeights<T>>,
        d: &[T],
    ) -> Self {
        let exact: Vec<SpringWeights<f64>> = springs.iter().map(SpringWeights::convert).collect();
        Self::in_units(dims, spacing, law, &exact, d)
    }

    /// The same from numbers in double precision.
    pub(crate) fn in_units(
        dims: [usize; 3],
        spacing: [f64; 3],
        law: Law,
        springs: &[SpringWeights<f64>],
        d: &[T],
    ) -> Self {
        // Linear springs know no length but that of their densities.
        let unit = binary_unit(match law {
            Law::Linear { scale } => scale,
            Law::FourD { .. } => spacing.into_iter().fold(0.0, f64::max),
        });
        let length_unit = if unit > 0.0 { unit } else { 1.0 };
        let length = |s: &SpringWeights<f64>| {
            let along = |a: usize| s.direction.step[a] as f64 * spacing[a] / length_unit;
            (0..3).map(|a| along(a).powi(2)).sum()
        };
        let count: usize = dims.iter().product();
        let (stiffness_unit, scaled) = springs_in_units(springs);
        let mut out = Self {
            dims,
            law,
            lengths: springs.iter().map(length).collect(),
            rest: Rest {
                differences: vec![vec![T::zero(); count]; springs.len()],
                scale: Weights::Constant(T::one()),
            },
            springs: scaled,
            stiffness_unit,
            length_unit,
            changes: 0,
            energies: vec![0.0; dims[2]],
            forces: vec![T::zero(); dims[2]],
        };
        out.rest_at(d);
        out
    }

    /// The law.
    pub fn law(&self) -> Law {
        self.law
    }

    /// Stiffness per direction, in units of [`stiffness_unit`](Self::stiffness_unit).
    pub fn springs(&self) -> &[SpringWeights<T>] {
        &self.springs
    }

    /// The power of two in whose units the stiffness is kept; 0 if no spring has any.
    pub fn stiffness_unit(&self) -> f64 {
        self.stiffness_unit
    }

    /// The power of two in whose units lengths are kept.
    pub fn length_unit(&self) -> f64 {
        self.length_unit
    }

    /// Length per density, in units of lengths.
    pub(super) fn sigma(&self) -> f64 {
        self.law.scale() / self.length_unit
    }

    /// The force on a density of a spring of the unit of stiffness, stretched by the unit of length.
    pub(crate) fn force_unit(&self) -> f64 {
        self.stiffness_unit * self.law.scale() * self.length_unit
    }

    /// Changes of the stiffness so far: of what is made for it, a version.
    pub(crate) fn changes(&self) -> u64 {
        self.changes
    }

    /// Replaces the stiffness by one of the same directions.
    pub(crate) fn set_springs(&mut self, springs: &[SpringWeights<f64>]) {
        (self.stiffness_unit, self.springs) = springs_in_units(springs);
        self.changes += 1;
    }

    /// The same where it is not told as a change: solvers go on with what they have.
    pub(crate) fn paint(&mut self, springs: &[SpringWeights<f64>]) {
        (self.stiffness_unit, self.springs) = springs_in_units(springs);
    }

    /// The same of the springs that begin in a box, whose stiffness is one per spring and at most `most`.
    pub(crate) fn paint_on(&mut self, at: SampleBox, springs: &[Vec<f64>], most: f64) {
        self.set_unit(binary_unit(most).max(self.stiffness_unit));
        for (to, from) in self.springs.iter_mut().zip(springs) {
            if let Weights::Each(weights) = &mut to.weights {
                // The unit is 0 if all weights are.
                let unit = self.stiffness_unit;
                let inverse = if unit > 0.0 { 1.0 / unit } else { 0.0 };
                for (row, from) in at.rows(self.dims).zip(from.chunks_exact(at.count[2].max(1))) {
                    for (w, k) in weights[row..].iter_mut().zip(from) {
                        *w = T::from_f64(k * inverse);
                    }
                }
            }
        }
        // What was largest may be gone.
        let largest = self.springs.iter().map(|s| match &s.weights {
            Weights::Each(list) => largest(list),
            Weights::Constant(k) => k.as_f64(),
        });
        let most = largest.fold(0.0, f64::max);
        self.set_unit(binary_unit(most * self.stiffness_unit));
    }

    /// Writes the stiffness as multiples of another power of two.
    fn set_unit(&mut self, unit: f64) {
        if unit != self.stiffness_unit && self.stiffness_unit > 0.0 && unit > 0.0 {
            let factor = self.stiffness_unit / unit;
            for s in &mut self.springs {
                s.weights = s.weights.scaled(factor);
            }
        }
        self.stiffness_unit = unit;
    }

    /// The rest state.
    pub fn rest(&self) -> &Rest<T> {
        &self.rest
    }

    /// The rest state, to be changed.
    pub fn rest_mut(&mut self) -> &mut Rest<T> {
        &mut self.rest
    }

    /// Lets all springs rest at the densities `d`, which then have no spring force, exactly, where the rest scale is 1.
    ///
    /// # Panics
    /// If `d` has another length than the lattice.
    pub fn rest_at(&mut self, d: &[T]) {
        assert_eq!(d.len(), self.dims.iter().product::<usize>(), "samples");
        let sigma = T::from_f64(self.sigma());
        for (rest, s) in self.rest.differences.iter_mut().zip(&self.springs) {
            rows_of(self.dims, s.direction.step, |from, to, count| {
                for z in 0..count {
                    rest[from + z] = sigma * (d[from + z] - d[to + z]);
                }
            });
        }
    }

    /// By how much the springs of each direction differ from their rest at the densities `d`, in units of lengths.
    pub(crate) fn stretches(&self, d: &[T]) -> Vec<Vec<T>> {
        let sigma = T::from_f64(self.sigma());
        let mut all = self.rest.differences.clone();
        for (list, s) in all.iter_mut().zip(&self.springs) {
            rows_of(self.dims, s.direction.step, |from, to, count| {
                for z in 0..count {
                    list[from + z] = sigma * (d[from + z] - d[to + z]) - list[from + z];
                }
            });
        }
        all
    }

    /// Lets the springs of direction `n` rest where they differ by `stretch` at the densities `d`.
    pub(crate) fn stretch(&mut self, n: usize, d: &[T], stretch: &[T]) {
        let sigma = T::from_f64(self.sigma());
        let rest = &mut self.rest.differences[n];
        rows_of(self.dims, self.springs[n].direction.step, |from, to, count| {
            for z in 0..count {
                rest[from + z] = sigma * (d[from + z] - d[to + z]) - stretch[from + z];
            }
        });
    }

    /// Adds the spring forces on the densities `d` to `force`.
    ///
    /// # Panics
    /// If a length is wrong.
    pub fn add_forces(&mut self, d: &[T], force: &mut [T]) -> SpringReport {
        self.evaluate::<true>(d, force, self.force_unit(), None)
    }

    /// The same, and writes `factor·σ²kτ` with `τ` clamped to `≥ 0` as the weights of a step matrix.
    ///
    /// # Panics
    /// If a length is wrong, or the weights are not one per spring.
    pub fn add_forces_and_tangent(
        &mut self,
        d: &[T],
        force: &mut [T],
        factor: f64,
        tangent: &mut [SpringWeights<T>],
    ) -> SpringReport {
        self.evaluate::<true>(d, force, self.force_unit(), Some((factor, tangent)))
    }

    /// The same forces as multiples of `unit`, and the tangent if it is asked for, without the energy; returns the springs
    /// with a negative tangent.
    pub(crate) fn add_forces_in(
        &mut self,
        unit: f64,
        d: &[T],
        force: &mut [T],
        tangent: Option<(f64, &mut [SpringWeights<T>])>,
    ) -> usize {
        if self.stiffness_unit == 0.0 && tangent.is_none() {
            return 0;
        }
        self.evaluate::<false>(d, force, self.force_unit() / unit, tangent)
            .clamped
    }

    fn evaluate<const ENERGY: bool>(
        &mut self,
        d: &[T],
        force: &mut [T],
        force_factor: f64,
        mut tangent: Option<(f64, &mut [SpringWeights<T>])>,
    ) -> SpringReport {
        let count: usize = self.dims.iter().product();
        assert_eq!(d.len(), count, "samples");
        assert_eq!(force.len(), count, "samples");
        let mut report = SpringReport::default();
        for n in 0..self.springs.len() {
            let weights = match &mut tangent {
                Some((factor, t)) => match &mut t[n].weights {
                    Weights::Each(w) => Some((*factor, &mut w[..])),
                    Weights::Constant(_) => panic!("tangents are one per spring"),
                },
                None => None,
            };
            let one = match self.law {
                Law::Linear { .. } => self.direction::<false, ENERGY>(n, d, force, force_factor, weights),
                Law::FourD { .. } => self.direction::<true, ENERGY>(n, d, force, force_factor, weights),
            };
            report.energy += one.energy;
            report.clamped += one.clamped;
        }
        report
    }

    fn direction<const FOUR_D: bool, const ENERGY: bool>(
        &mut self,
        n: usize,
        d: &[T],
        force: &mut [T],
        force_factor: f64,
        tangent: Option<(f64, &mut [T])>,
    ) -> SpringReport {
        let sigma = T::from_f64(self.sigma());
        let force_factor = T::from_f64(force_factor);
        let sigma2k = self.law.scale().powi(2) * self.stiffness_unit;
        let mut tangent = tangent.map(|(factor, t)| (T::from_f64(factor * sigma2k), t));
        let h2 = T::from_f64(self.lengths[n]);
        let springs = &self.springs[n];
        let rest = &self.rest.differences[n];
        let scale = &self.rest.scale;
        let (energies, forces) = (&mut self.energies, &mut self.forces);
        let mut report = SpringReport::default();
        vectorized(
            #[inline(always)]
            || {
                rows_of(self.dims, springs.direction.step, |from, to, count| {
                    let (a, b) = (&d[from..from + count], &d[to..to + count]);
                    let rest = &rest[from..from + count];
                    let (energies, forces) = (&mut energies[..count], &mut forces[..count]);
                    for z in 0..count {
                        let k = springs.weights.at(from + z);
                        let s = scale.at(from + z);
                        let delta = sigma * (a[z] - b[z]);
                        let (stretch, slope, t) = spring::<T, FOUR_D>(delta, rest[z], s, h2);
                        forces[z] = force_factor * (k * (stretch * slope));
                        if ENERGY {
                            energies[z] = k.as_f64() * (stretch.as_f64() * stretch.as_f64());
                        }
                        if let Some((factor, tangent)) = &mut tangent {
                            report.clamped += usize::from(t < T::zero());
                            tangent[from + z] = *factor * (k * t.max(T::zero()));
                        }
                    }
                    for (f, g) in force[from..from + count].iter_mut().zip(forces.iter()) {
                        *f -= *g;
                    }
                    for (f, g) in force[to..to + count].iter_mut().zip(forces.iter()) {
                        *f += *g;
                    }
                    if ENERGY {
                        report.energy += energies.iter().sum::<f64>();
                    }
                });
            },
        );
        report.energy *= 0.5 * self.energy_unit();
        report
    }

    /// Multiplies the weights of springs by their tangent factors `max(τ, 0)` at the densities `d`.
    pub(crate) fn scale_by_tangent(&self, d: &[T], springs: &mut [SpringWeights<f64>]) {
        let sigma = self.sigma();
        for (n, s) in springs.iter_mut().enumerate() {
            let (h2, rest) = (self.lengths[n], &self.rest.differences[n]);
            let mut weights = vec![0.0; d.len()];
            rows_of(self.dims, s.direction.step, |from, to, count| {
                for z in 0..count {
                    let delta = sigma * (d[from + z].as_f64() - d[to + z].as_f64());
                    let (rest, scale) = (rest[from + z].as_f64(), self.rest.scale.at(from + z).as_f64());
                    let (_, _, t) = spring::<f64, true>(delta, rest, scale, h2);
                    weights[from + z] = s.weights.at(from + z) * t.max(0.0);
                }
            });
            s.weights = Weights::Each(weights);
        }
    }

    /// Of a spring of the unit of stiffness, twice, stretched by the unit of length.
    fn energy_unit(&self) -> f64 {
        self.stiffness_unit * self.length_unit * self.length_unit
    }

    /// What the springs gain when the densities `d` grow by `moved`, summed from what each spring gains: the difference of
    /// two energies would be that of their rounding where densities are large and increments small.
    pub(crate) fn energy_change(&self, d: &[T], moved: &[f64]) -> EnergyChange {
        let sigma = self.sigma();
        let four_d = matches!(self.law, Law::FourD { .. });
        let mut sum = EnergyChange::default();
        for ((springs, rest), h2) in self.springs.iter().zip(&self.rest.differences).zip(&self.lengths) {
            rows_of(self.dims, springs.direction.step, |from, to, count| {
                for z in 0..count {
                    let (i, j) = (from + z, to + z);
                    let k = springs.weights.at(i).as_f64();
                    let (a, b) = (d[i].as_f64(), d[j].as_f64());
                    // As the forces have it.
                    let before = (T::from_f64(sigma) * (d[i] - d[j])).as_f64();
                    let grown = sigma * (moved[i] - moved[j]);
                    let (rest, s) = (rest[i].as_f64(), self.rest.scale.at(i).as_f64());
                    let (change, size) = if four_d {
                        let now = |delta: f64| length(*h2, delta);
                        let (l, l1, rest) = (now(before), now(before + grown), s * now(rest));
                        let longer = grown * (2.0 * before + grown) / (l + l1);
                        (0.5 * longer * (l + l1 - 2.0 * rest), l + rest)
                    } else {
                        let stretch = before - s * rest;
                        let size = before.abs() + (s * rest).abs();
                        ((stretch + 0.5 * grown) * grown, size)
                    };
                    let size = size + sigma * (a.abs() + b.abs());
                    sum.energy += k * change;
                    sum.rounding += k * size * grown.abs();
                }
            });
        }
        let unit = self.energy_unit();
        sum.energy *= unit;
        sum.rounding *= T::UNIT_ROUND_OFF * unit;
        sum
    }
}

/// Calls `f(from, to, count)` for every stretch of springs of one direction that start in one row: springs join the
/// samples `from + z` and `to + z`, `z < count`.
#[inline(always)]
pub(super) fn rows_of(
    [mx, my, mz]: [usize; 3],
    [dx, dy, dz]: [isize; 3],
    mut f: impl FnMut(usize, usize, usize),
) {
    let (here, there) = ((-dz).max(0) as usize, dz.max(0) as usize);
    let count = mz.saturating_sub(here + there);
    for i in 0..mx {
        let i2 = i.wrapping_add_signed(dx);
        for j in 0..my {
            let j2 = j.wrapping_add_signed(dy);
            if i2 < mx && j2 < my && count > 0 {
                f((i * my + j) * mz + here, (i2 * my + j2) * mz + there, count);
            }
        }
    }
}
