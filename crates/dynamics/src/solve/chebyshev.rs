//! The Chebyshev iteration on a part of a spectrum.

/// Weights of the iteration whose eigenvalues lie within `delta` of `theta`: of the correction before, and of the preconditioned
/// residual, for one step after the other.
pub(super) struct Chebyshev {
    theta: f64,
    delta: f64,
    /// Ratio of the last two polynomials at 0, before the first step that of the first two.
    rho: Option<f64>,
}

impl Chebyshev {
    pub fn new(theta: f64, delta: f64) -> Self {
        Self {
            theta,
            delta,
            rho: None,
        }
    }
}

impl Iterator for Chebyshev {
    type Item = (f64, f64);

    fn next(&mut self) -> Option<(f64, f64)> {
        let sigma = self.theta / self.delta;
        let Some(rho) = self.rho else {
            self.rho = Some(1.0 / sigma);
            return Some((0.0, 1.0 / self.theta));
        };
        let next = 1.0 / (2.0 * sigma - rho);
        self.rho = Some(next);
        Some((next * rho, 2.0 * next / self.delta))
    }
}
