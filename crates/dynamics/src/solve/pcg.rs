//! Preconditioned conjugate gradients for the increment of a step.

use bspline::Real;

use super::band_cholesky::BandCholesky;
use super::dot::dot;
use crate::lattice::{Lattice, TensorWorkspace};
use crate::springs::StepMatrix;

/// A symmetric positive definite system.
pub trait System<T> {
    /// `q = Hp`; returns `pᵀq`.
    fn apply(&mut self, p: &[T], q: &mut [T]) -> f64;
    /// `z ≈ H⁻¹ r`, symmetric and positive definite.
    fn precondition(&mut self, r: &[T], z: &mut [T]);
    /// The factor that [`precondition`](Self::precondition) solves with, if that is all it does.
    fn factor(&self) -> Option<&BandCholesky<T>> {
        None
    }
    /// Told that the solution moved by `alpha` along the `p` that [`apply`](Self::apply) had last.
    fn moved(&mut self, _alpha: T) {}
    /// Takes out of a residual what constraints bear.
    fn project(&self, _r: &mut [T]) {}
    /// Whether the preconditioner may be off by rounding, or of one matrix before: directions then take Polak and Ribière's
    /// form, which bears that.
    fn is_flexible(&self) -> bool {
        false
    }
}

/// An approximate inverse of `AᵀSA`, symmetric and positive definite.
pub trait Preconditioner<T: Real> {
    /// `z ≈ (AᵀSA)⁻¹ r`.
    fn apply(&mut self, s: &StepMatrix<T>, r: &[T], z: &mut [T]);

    /// The factor whose halves, one after the other, are this inverse, if it is that of a factor.
    fn factor(&self) -> Option<&BandCholesky<T>> {
        None
    }
}

impl<T: Real> Preconditioner<T> for BandCholesky<T> {
    fn apply(&mut self, _: &StepMatrix<T>, r: &[T], z: &mut [T]) {
        z.copy_from_slice(r);
        self.solve(z);
    }

    fn factor(&self) -> Option<&BandCholesky<T>> {
        Some(self)
    }
}

/// No preconditioner: `z = r`. What the source paper does.
#[cfg(feature = "study")]
#[derive(Clone, Copy, Debug, Default)]
pub struct Unpreconditioned;

#[cfg(feature = "study")]
impl<T: Real> Preconditioner<T> for Unpreconditioned {
    fn apply(&mut self, _: &StepMatrix<T>, r: &[T], z: &mut [T]) {
        z.copy_from_slice(r);
    }
}

/// `AᵀSA` with any preconditioner.
pub struct CoefficientSystem<'a, T, P> {
    /// Gives `A`.
    pub lattice: &'a Lattice<T>,
    /// `S`.
    pub matrix: &'a StepMatrix<T>,
    /// The approximate inverse.
    pub preconditioner: &'a mut P,
    /// Two vectors on the samples.
    pub samples: &'a mut [Vec<T>; 2],
    /// Scratch.
    pub workspace: &'a mut TensorWorkspace<T>,
}

impl<T: Real, P: Preconditioner<T>> System<T> for CoefficientSystem<'_, T, P> {
    fn apply(&mut self, p: &[T], q: &mut [T]) -> f64 {
        let [d, s] = &mut *self.samples;
        self.lattice.sample(p, d, self.workspace);
        self.matrix.apply(d, s);
        self.lattice.gather(s, q, self.workspace);
        dot(d, s)
    }

    fn precondition(&mut self, r: &[T], z: &mut [T]) {
        self.preconditioner.apply(self.matrix, r, z);
    }

    fn factor(&self) -> Option<&BandCholesky<T>> {
        self.preconditioner.factor()
    }
}

/// What a solve did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PcgReport {
    /// Iterations made.
    pub iterations: usize,
    /// `‖b - Hx‖/‖b‖`, where `b` is the impulse.
    pub residual: f64,
    /// Curvature `pᵀHp` that was not positive, if one was met; the solve ended there.
    pub negative_curvature: Option<f64>,
}

/// `y += a x`.
pub(super) fn add_scaled<T: Real>(y: &mut [T], a: T, x: &[T]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += a * *x;
    }
}

/// The vectors of the iteration.
#[derive(Clone, Debug)]
pub struct ConjugateGradients<T> {
    pub(super) r: Vec<T>,
    z: Vec<T>,
    p: Vec<T>,
    pub(super) q: Vec<T>,
    /// The residual before, of flexible systems.
    last: Vec<T>,
}

impl<T: Real> ConjugateGradients<T> {
    /// For systems of `n` unknowns.
    pub fn new(n: usize) -> Self {
        let zeros = || vec![T::zero(); n];
        Self {
            r: zeros(),
            z: zeros(),
            p: zeros(),
            q: zeros(),
            last: Vec::new(),
        }
    }

    /// Solves `Hx = b` from `x = 0`, at most `cap` iterations, until the residual falls below `tolerance` times the
    /// impulse `b`.
    pub fn solve(
        &mut self,
        system: &mut impl System<T>,
        b: &[T],
        x: &mut [T],
        cap: usize,
        tolerance: f64,
    ) -> PcgReport {
        x.fill(T::zero());
        self.r.copy_from_slice(b);
        let impulse = dot(b, b).sqrt();
        if impulse == 0.0 {
            return PcgReport::default();
        }
        self.go_on(system, x, [impulse, 1.0], cap, tolerance)
    }

    /// The residual to go on from.
    pub(super) fn residual_mut(&mut self) -> &mut [T] {
        &mut self.r
    }

    /// The same from an `x` whose residual stands in `r`, the share `residual` of `impulse`, until it falls below
    /// `tolerance`.
    pub(super) fn go_on(
        &mut self,
        system: &mut impl System<T>,
        x: &mut [T],
        [impulse, residual]: [f64; 2],
        cap: usize,
        tolerance: f64,
    ) -> PcgReport {
        let Self { r, z, p, q, last } = self;
        let flexible = system.is_flexible();
        if flexible {
            last.resize(r.len(), T::zero());
        }
        let mut report = PcgReport {
            residual,
            ..PcgReport::default()
        };
        let mut before = 1.0;
        while report.iterations < cap && report.residual > tolerance {
            system.precondition(r, z);
            let rz = dot(r, z);
            if report.iterations == 0 {
                p.copy_from_slice(z);
            } else {
                let beta = if flexible {
                    ((rz - dot(last, z)) / before).max(0.0)
                } else {
                    rz / before
                };
                let beta = T::from_f64(beta);
                for (p, z) in p.iter_mut().zip(z.iter()) {
                    *p = *z + beta * *p;
                }
            }
            before = rz;
            let curvature = system.apply(p, q);
            if !(curvature > 0.0 && rz > 0.0) {
                report.negative_curvature = Some(curvature.min(rz));
                break;
            }
            let alpha = T::from_f64(rz / curvature);
            if flexible {
                last.copy_from_slice(r);
            }
            add_scaled(x, alpha, p);
            system.moved(alpha);
            add_scaled(r, -alpha, q);
            system.project(r);
            report.iterations += 1;
            report.residual = dot(r, r).sqrt() / impulse;
        }
        report
    }
}
