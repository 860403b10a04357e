//! Preconditioned conjugate gradients \[Hestenes52\], the one loop that all solves of a fit go through.

use super::outcome::SolverOutcome;
use crate::FitError;

/// A symmetric positive semidefinite system with its preconditioner `M`, and the arithmetic of its vectors. Each system has
/// its own order of summation, the same at any number of threads.
pub(crate) trait System {
    type Vector: Clone;

    /// `image = A p`.
    fn apply(&mut self, p: &Self::Vector, image: &mut Self::Vector);
    /// `z = M⁻¹ r`; returns `r·z`.
    fn precondition(&mut self, r: &Self::Vector, z: &mut Self::Vector) -> f64;
    fn dot(&self, a: &Self::Vector, b: &Self::Vector) -> f64;
    /// `y += a x`.
    fn add(&self, y: &mut Self::Vector, a: f64, x: &Self::Vector);
    /// `p = z + b p`.
    fn turn(&self, p: &mut Self::Vector, b: f64, z: &Self::Vector);
}

/// When a solve ends.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stop {
    /// Residual relative to that of the start, in the norm of the preconditioner; 0 for none.
    pub residual: f64,
    /// `r·M⁻¹r` that the residual is relative to, if not that of the start.
    pub against: Option<f64>,
    /// Most iterations.
    pub limit: usize,
}

/// Improves `x`, whose residual `b - A x` is `r`. `proceed` is asked before every iteration.
///
/// Functions that several levels can express make a system singular but consistent; conjugate gradients do not mind. The
/// energy falls in every step.
///
/// # Errors
/// What `proceed` says.
pub(crate) fn conjugate_gradients<S: System>(
    system: &mut S,
    x: &mut S::Vector,
    mut r: S::Vector,
    stop: Stop,
    mut proceed: impl FnMut(usize) -> Result<(), FitError>,
) -> Result<SolverOutcome, FitError> {
    let mut z = r.clone();
    let mut energy = system.precondition(&r, &mut z);
    let start = stop.against.unwrap_or(energy);
    let goal = stop.residual * stop.residual * start;
    let (mut p, mut image) = (z.clone(), z.clone());
    let mut iterations = 0;
    while iterations < stop.limit && energy > goal {
        proceed(iterations)?;
        system.apply(&p, &mut image);
        let curvature = system.dot(&p, &image);
        if curvature <= 0.0 {
            break;
        }
        let alpha = energy / curvature;
        system.add(x, alpha, &p);
        system.add(&mut r, -alpha, &image);
        let next = system.precondition(&r, &mut z);
        system.turn(&mut p, next / energy, &z);
        energy = next;
        iterations += 1;
    }
    Ok(SolverOutcome {
        depth: None,
        iterations,
        residual: if start > 0.0 { (energy / start).sqrt() } else { 0.0 },
        goal: (stop.residual > 0.0).then_some(stop.residual),
        is_converged: energy <= goal && energy.is_finite(),
    })
}
