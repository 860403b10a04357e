//! One solve: from the impulses on the samples to the increments of coefficients and densities.

use bspline::Real;

use super::dot::dot;
use super::painted::{Dynamic, Painted, active};
use super::pcg::{CoefficientSystem, PcgReport};
use super::report::{ITERATED, Method, SolveReport};
use super::step_solver::StepSolver;
use super::systems::{SampleSystem, Sampled};
use crate::sparse::Projected;
use crate::springs::StepMatrix;
use crate::units::{binary_unit, largest};

/// Residual, in units of rounding of single precision, at which solves by a factor stop.
const EXACT: f64 = 64.0;

/// The same of fast diagonalization. On coefficients the residual is mostly that of combinations that hardly move a
/// sample: one iteration leaves up to 2000 units of it in single precision, and increments of the samples that are wrong
/// by a few units.
const DIAGONALIZED: f64 = 4096.0;

/// What a cycle may leave that solves in place of a factor, of [`ITERATED`]: with all of it a mass contrast of 10⁴ gains 10⁻⁵ of its
/// energy a step.
const AS_A_FACTOR: f64 = 1.0 / 64.0;

/// What an iteration that begins where nothing accelerates may leave of what does. Beside the impulse alone a short step would leave all of it,
/// and always to the same side: at a fiftieth of the usual step a motion lost a third to two thirds of its energy.
const OF_ACCELERATION: f64 = 0.02;

/// Most iterations of a solve that is asked for more than a step needs.
const MOST_ITERATIONS: usize = 64;

/// Impulses whose squares, and those of their residuals, are far from the ends of the range of single precision.
const ORDINARY: std::ops::Range<f64> = 1e-6..1e12;

impl<T: Real> StepSolver<T> {
    /// The increment `x` of the coefficients and `dx = A x` of the densities under the impulses `g` on the samples, for
    /// the matrix prepared last or one near it.
    ///
    /// # Panics
    /// If a length is wrong.
    pub fn solve(&mut self, s: &StepMatrix<T>, g: &[T], x: &mut [T], dx: &mut [T]) -> SolveReport {
        self.solve_to(s, g, x, dx, None, false)
    }

    /// The same to a residual, if one is asked for; in more iterations than steps take if it is less than theirs. Where `x` and
    /// `dx` hold what is `expected`, an iteration without constraints begins there if that is better than nothing, and every one leaves little of
    /// what that misses.
    pub(crate) fn solve_to(
        &mut self,
        s: &StepMatrix<T>,
        g: &[T],
        x: &mut [T],
        dx: &mut [T],
        asked: Option<f64>,
        expected: bool,
    ) -> SolveReport {
        let usual = self.tolerance();
        let (tolerance, cap) = match asked {
            Some(asked) if asked < usual => (asked, MOST_ITERATIONS.max(self.options.iterations)),
            asked => (asked.unwrap_or(usual), self.options.iterations),
        };
        if self.inverse.is_some() {
            self.b.copy_from_slice(g);
        } else {
            self.lattice.gather(g, &mut self.b, &mut self.workspace);
            if let Some(mask) = &self.mask {
                mask.hold(&mut self.b);
            }
        }
        // Solved for an impulse of about one, whose squares no precision loses.
        let unit = self.impulse_unit();
        if unit != 1.0 {
            for b in &mut self.b {
                *b = T::from_f64(b.as_f64() / unit);
            }
            if let Some(border) = &mut self.border {
                border.scale(1.0 / unit);
            }
        }
        let solved_by = self.method;
        let iteration = if let Some(inverse) = &mut self.inverse {
            let preconditioner = active(self.method, &mut self.painted, &mut self.diagonalization);
            let mut system = SampleSystem {
                matrix: s,
                preconditioner: &mut Dynamic(preconditioner),
            };
            let report = match &mut self.border {
                Some(border) => border.solve(&mut self.iteration, &mut system, &self.b, dx, cap, tolerance),
                None => self.iteration.solve(&mut system, &self.b, dx, cap, tolerance),
            };
            inverse.apply(dx, x);
            report
        } else {
            let from = expected.then(|| self.expect(s, g, unit, x, dx)).flatten();
            let tolerance = from.map_or(tolerance, |[_, left]| {
                let least = EXACT * T::UNIT_ROUND_OFF;
                tolerance.min(least.max(OF_ACCELERATION * left))
            });
            let begin = from.filter(|_| self.border.is_none());
            let report = self.iterate(s, x, Some(dx), begin, cap, tolerance);
            if solved_by == Method::Direct {
                self.keep_up(s, report.iterations);
            } else if let (Painted::Background(background), Method::VCycle) = (&mut self.painted, solved_by) {
                let matrix = self
                    .painted_for
                    .as_ref()
                    .expect("prepared before the first solve");
                background.advance(matrix, report.iterations <= self.options.quick);
                self.settle_method();
                if self.method != solved_by {
                    self.renew_border();
                }
            }
            report
        };
        if unit != 1.0 {
            if let Some(border) = &mut self.border {
                border.scale(unit);
            }
            for x in x.iter_mut().chain(dx) {
                *x = T::from_f64(x.as_f64() * unit);
            }
        }
        SolveReport {
            method: solved_by,
            iteration,
        }
    }

    /// Scales what is expected, and writes its residual into the iteration: the impulse, and the share of it that is left, if
    /// that is less than all.
    fn expect(
        &mut self,
        s: &StepMatrix<T>,
        g: &[T],
        unit: f64,
        x: &mut [T],
        dx: &mut [T],
    ) -> Option<[f64; 2]> {
        if unit != 1.0 {
            for x in x.iter_mut().chain(dx.iter_mut()) {
                *x = T::from_f64(x.as_f64() / unit);
            }
        }
        let [_, pushed] = &mut self.samples;
        s.apply(dx, pushed);
        let inverse = T::from_f64(1.0 / unit);
        for (p, g) in pushed.iter_mut().zip(g) {
            *p = *g * inverse - *p;
        }
        let left = self.iteration.residual_mut();
        self.lattice.gather(pushed, left, &mut self.workspace);
        if let Some(mask) = &self.mask {
            mask.hold(left);
        }
        let (impulse, left) = (dot(&self.b, &self.b).sqrt(), dot(left, left).sqrt());
        (left < impulse).then_some([impulse, left / impulse])
    }

    /// Residual at which steps stop.
    pub(crate) fn tolerance(&self) -> f64 {
        self.options.tolerance.unwrap_or(match self.method {
            // A cycle more leaves a twentieth, so that what cycles leave is mostly far less than they may.
            Method::VCycle if self.painted.is_smoothed() => 0.25 * ITERATED,
            Method::VCycle if self.painted.is_in_place_of_a_factor() => AS_A_FACTOR * ITERATED,
            Method::VCycle | Method::SampleMultigrid => ITERATED,
            Method::Direct if matches!(self.painted, Painted::Background(_)) => ITERATED,
            // Double precision is for references: there coefficients that hardly move a sample count too.
            _ if T::UNIT_ROUND_OFF < 1e-10 => 16.0 * T::UNIT_ROUND_OFF,
            Method::FastDiagonalization => DIAGONALIZED * T::UNIT_ROUND_OFF,
            _ => EXACT * T::UNIT_ROUND_OFF,
        })
    }

    /// The power of two that the impulses are divided by; 1 where they are of ordinary size, which saves two passes and
    /// changes no bit.
    fn impulse_unit(&self) -> f64 {
        let size = largest(&self.b).max(self.border.as_ref().map_or(0.0, |b| b.size()));
        if size == 0.0 || ORDINARY.contains(&size) {
            1.0
        } else {
            binary_unit(size)
        }
    }

    /// The same without constraints for forces `b` on the coefficients, of lattices with fewer coefficients than samples.
    pub(crate) fn solve_coefficients(&mut self, s: &StepMatrix<T>, b: &[T], x: &mut [T]) {
        debug_assert!(self.inverse.is_none());
        self.b.copy_from_slice(b);
        if let Some(mask) = &self.mask {
            mask.hold(&mut self.b);
        }
        self.iterate(
            s,
            x,
            None,
            None,
            self.options.iterations,
            16.0 * T::UNIT_ROUND_OFF,
        );
    }

    /// Solves for the right-hand side in `self.b`: with constraints if the samples are asked for too, and `from` what is in
    /// `x`, with the impulse and the share of it that is left.
    fn iterate(
        &mut self,
        s: &StepMatrix<T>,
        x: &mut [T],
        dx: Option<&mut [T]>,
        from: Option<[f64; 2]>,
        cap: usize,
        tolerance: f64,
    ) -> PcgReport {
        let preconditioner = active(self.method, &mut self.painted, &mut self.diagonalization);
        let mask = self.mask.as_deref();
        let system = CoefficientSystem {
            lattice: &self.lattice,
            matrix: s,
            preconditioner: &mut Dynamic(preconditioner),
            samples: &mut self.samples,
            workspace: &mut self.workspace,
        };
        match (dx, &mut self.border) {
            (None, _) => {
                let mut system = Projected { system, mask };
                self.iteration.solve(&mut system, &self.b, x, cap, tolerance)
            }
            (Some(dx), None) => {
                if from.is_none() {
                    dx.fill(T::zero());
                }
                let system = Sampled { system, dx };
                let mut system = Projected { system, mask };
                match from {
                    Some(from) => self.iteration.go_on(&mut system, x, from, cap, tolerance),
                    None => self.iteration.solve(&mut system, &self.b, x, cap, tolerance),
                }
            }
            (Some(dx), Some(border)) => {
                let mut system = Projected { system, mask };
                let report = border.solve(&mut self.iteration, &mut system, &self.b, x, cap, tolerance);
                self.lattice.sample(x, dx, &mut self.workspace);
                report
            }
        }
    }
}
