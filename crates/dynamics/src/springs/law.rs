//! The force laws of density springs.
//!
//! A spring joins two samples at the distance `h` whose densities differ by `Δ = σ(d_i - d_j)`, a length.

use bspline::Real;
use bspline::vectorized;

use super::stencil::{SpringWeights, Weights};

/// Which law, with its scale `σ`, a length per density: without it a density could not be added to a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// `½k(Δ - Δ₀)²`: always convex.
    Linear {
        /// Length per density.
        scale: f64,
    },
    /// `½k(L - L₀)²` with `L = √(h² + Δ²)` [DIS §5.1].
    FourD {
        /// Length per density.
        scale: f64,
    },
}

impl Law {
    /// Length per density.
    pub fn scale(self) -> f64 {
        match self {
            Self::Linear { scale } | Self::FourD { scale } => scale,
        }
    }

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear { .. } => "linear",
            Self::FourD { .. } => "4-d",
        }
    }
}

/// A 4-D spring flatter than this share of its length, and shorter than at rest, is pushed the way it rests: at
/// `Δ = 0` the law itself gives no force, and rounding would choose the side.
const FLAT: f64 = 1e-3;

/// One spring: energy, force on the density of its first sample, and tangent factor `τ` in `∂²E/∂d² = σ²kτ`.
///
/// `rest` is `Δ₀`; of the 4-D law its sign is the orientation and `L₀ = s√(h² + Δ₀²)` with the rest scale `s`; of the
/// linear one `Δ₀` is scaled itself.
#[inline(always)]
fn spring<T: Real, const FOUR_D: bool>(delta: T, rest: T, rest_scale: T, h2: T) -> (T, T, T) {
    if FOUR_D {
        let length = (h2 + delta * delta).sqrt();
        let rest_length = rest_scale * (h2 + rest * rest).sqrt();
        let stretch = length - rest_length;
        let flat = T::from_f64(FLAT) * h2.sqrt();
        let pushed = delta.abs() < flat && stretch < T::zero() && rest != T::zero();
        let slope = if pushed {
            let side = if rest > T::zero() { flat } else { -flat };
            side / length
        } else {
            delta / length
        };
        let tangent = T::one() - rest_length * h2 / (length * length * length);
        (stretch * stretch, stretch * slope, tangent)
    } else {
        let stretch = delta - rest_scale * rest;
        (stretch * stretch, stretch, T::one())
    }
}

/// Rest of all springs: `Δ₀` per direction and starting sample, and how much each is scaled.
#[derive(Clone, Debug, PartialEq)]
pub struct Rest<T> {
    /// `Δ₀` of each spring, per direction.
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
    /// `k` per direction.
    pub(super) springs: Vec<SpringWeights<T>>,
    /// `h²` per direction.
    pub(super) lengths: Vec<f64>,
    pub(super) rest: Rest<T>,
    row: [Vec<T>; 2],
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
        let length = |s: &SpringWeights<T>| {
            (0..3)
                .map(|a| (s.direction.step[a] as f64 * spacing[a]).powi(2))
                .sum()
        };
        let count: usize = dims.iter().product();
        let mut out = Self {
            dims,
            law,
            lengths: springs.iter().map(length).collect(),
            rest: Rest {
                differences: vec![vec![T::zero(); count]; springs.len()],
                scale: Weights::Constant(T::one()),
            },
            springs,
            row: [vec![T::zero(); dims[2]], vec![T::zero(); dims[2]]],
        };
        out.rest_at(d);
        out
    }

    /// The law.
    pub fn law(&self) -> Law {
        self.law
    }

    /// Stiffness per direction.
    pub fn springs(&self) -> &[SpringWeights<T>] {
        &self.springs
    }

    /// Replaces the stiffness.
    ///
    /// # Panics
    /// If the directions are others.
    pub fn set_springs(&mut self, springs: Vec<SpringWeights<T>>) {
        let directions = |s: &[SpringWeights<T>]| s.iter().map(|s| s.direction.step).collect::<Vec<_>>();
        assert_eq!(
            directions(&self.springs),
            directions(&springs),
            "the same directions"
        );
        self.springs = springs;
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
        let sigma = T::from_f64(self.law.scale());
        for (rest, s) in self.rest.differences.iter_mut().zip(&self.springs) {
            rows_of(self.dims, s.direction.step, |from, to, count| {
                for z in 0..count {
                    rest[from + z] = sigma * (d[from + z] - d[to + z]);
                }
            });
        }
    }

    /// Adds the spring forces on the densities `d` to `force`.
    ///
    /// # Panics
    /// If a length is wrong.
    pub fn add_forces(&mut self, d: &[T], force: &mut [T]) -> SpringReport {
        self.evaluate(d, force, None)
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
        self.evaluate(d, force, Some((factor, tangent)))
    }

    fn evaluate(
        &mut self,
        d: &[T],
        force: &mut [T],
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
                Law::Linear { .. } => self.direction::<false>(n, d, force, weights),
                Law::FourD { .. } => self.direction::<true>(n, d, force, weights),
            };
            report.energy += one.energy;
            report.clamped += one.clamped;
        }
        report
    }

    fn direction<const FOUR_D: bool>(
        &mut self,
        n: usize,
        d: &[T],
        force: &mut [T],
        mut tangent: Option<(f64, &mut [T])>,
    ) -> SpringReport {
        let sigma = T::from_f64(self.law.scale());
        let sigma2 = self.law.scale().powi(2);
        let h2 = T::from_f64(self.lengths[n]);
        let springs = &self.springs[n];
        let rest = &self.rest.differences[n];
        let scale = &self.rest.scale;
        let [energies, forces] = &mut self.row;
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
                        let (e, f, t) = spring::<T, FOUR_D>(sigma * (a[z] - b[z]), rest[z], s, h2);
                        energies[z] = k * e;
                        forces[z] = sigma * (k * f);
                        if let Some((factor, tangent)) = &mut tangent {
                            report.clamped += usize::from(t < T::zero());
                            tangent[from + z] = T::from_f64(*factor * sigma2) * (k * t.max(T::zero()));
                        }
                    }
                    for (f, g) in force[from..from + count].iter_mut().zip(forces.iter()) {
                        *f -= *g;
                    }
                    for (f, g) in force[to..to + count].iter_mut().zip(forces.iter()) {
                        *f += *g;
                    }
                    report.energy += 0.5 * energies.iter().map(|e| e.as_f64()).sum::<f64>();
                });
            },
        );
        report
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
