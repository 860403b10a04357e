//! Preconditioned conjugate gradients for the increment of a step.

use bspline::Real;

use super::dot::dot;
use crate::lattice::{Lattice, TensorWorkspace};
use crate::springs::StepMatrix;

/// An approximate inverse of `AᵀSA`, symmetric and positive definite.
pub trait Preconditioner<T> {
    /// `z ≈ (AᵀSA)⁻¹ r`.
    fn apply(&mut self, s: &StepMatrix<T>, r: &[T], z: &mut [T]);
}

/// No preconditioner: `z = r`. What the source paper does.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unpreconditioned;

impl<T: Real> Preconditioner<T> for Unpreconditioned {
    fn apply(&mut self, _: &StepMatrix<T>, r: &[T], z: &mut [T]) {
        z.copy_from_slice(r);
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
    r: Vec<T>,
    z: Vec<T>,
    p: Vec<T>,
    q: Vec<T>,
    d: Vec<T>,
    s: Vec<T>,
    workspace: TensorWorkspace<T>,
}

impl<T: Real> ConjugateGradients<T> {
    /// For systems on a lattice.
    pub fn new(lattice: &Lattice<T>) -> Self {
        let (n, m) = (lattice.coefficient_count(), lattice.sample_count());
        let zeros = |n: usize| vec![T::zero(); n];
        Self {
            r: zeros(n),
            z: zeros(n),
            p: zeros(n),
            q: zeros(n),
            d: zeros(m),
            s: zeros(m),
            workspace: TensorWorkspace::new(),
        }
    }

    /// Solves `AᵀSA x = b` from `x = 0`, at most `cap` iterations, until the residual falls below `tolerance` times
    /// the impulse `b`. Also writes the increment of the densities, `dx = A x`.
    pub fn solve(
        &mut self,
        lattice: &Lattice<T>,
        matrix: &StepMatrix<T>,
        preconditioner: &mut impl Preconditioner<T>,
        b: &[T],
        x: &mut [T],
        dx: &mut [T],
        cap: usize,
        tolerance: f64,
    ) -> PcgReport {
        let Self {
            r,
            z,
            p,
            q,
            d,
            s,
            workspace,
        } = self;
        x.fill(T::zero());
        dx.fill(T::zero());
        r.copy_from_slice(b);
        let impulse = dot(b, b).sqrt();
        let mut report = PcgReport::default();
        if impulse == 0.0 {
            return report;
        }
        report.residual = 1.0;
        let mut before = 1.0;
        while report.iterations < cap && report.residual > tolerance {
            preconditioner.apply(matrix, r, z);
            let rz = dot(r, z);
            if report.iterations == 0 {
                p.copy_from_slice(z);
            } else {
                let beta = T::from_f64(rz / before);
                for (p, z) in p.iter_mut().zip(z.iter()) {
                    *p = *z + beta * *p;
                }
            }
            before = rz;
            lattice.sample(p, d, workspace);
            matrix.apply(d, s);
            let curvature = dot(d, s);
            if !(curvature > 0.0 && rz > 0.0) {
                report.negative_curvature = Some(curvature.min(rz));
                break;
            }
            lattice.gather(s, q, workspace);
            let alpha = T::from_f64(rz / curvature);
            add_scaled(x, alpha, p);
            add_scaled(dx, alpha, d);
            add_scaled(r, -alpha, q);
            report.iterations += 1;
            report.residual = dot(r, r).sqrt() / impulse;
        }
        report
    }
}
