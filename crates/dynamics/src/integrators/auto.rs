//! Which scheme a step takes when it may choose.
//!
//! Of a mode of frequency `ω` a step of TR-BDF2 misses `0.0404(ωΔt)³` in phase and size, a step of the Verlet scheme
//! `0.0417(ωΔt)³`; `N` Verlet sub-steps miss `1/N²` of that. With as many sub-steps as its bound asks for, and two at
//! least, the explicit scheme is more accurate than the implicit step, so the cheaper one is taken. (A single one may miss
//! up to 7 % more near the bound.)
//! What they cost is counted in operations, not in time: the same input takes the same scheme on every machine.

use bspline::Real;

use super::Integrator;
use crate::lattice::Lattice;
use crate::patch::{Patch, PatchError};
use crate::solve::Method;
use crate::springs::{Law, Weights};

/// The scheme for a step, and what both would cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// [`Integrator::Verlet`] or [`Integrator::TrBdf2`].
    pub integrator: Integrator,
    /// Sub-steps of the explicit scheme; 1 of the implicit one.
    pub substeps: usize,
    /// Operations of the explicit sub-steps.
    pub explicit_work: f64,
    /// Operations of the implicit step.
    pub implicit_work: f64,
}

/// Iterations that a V-cycle or multigrid takes to its default tolerance, as measured at contrasts from 10² to 10⁴.
const ITERATED: f64 = 4.0;
/// Those with which the mass alone is solved to rounding; the cap.
const TO_ROUNDING: f64 = 8.0;

/// Operations of the parts of a step.
struct Work {
    coefficients: f64,
    samples: f64,
    springs: f64,
    /// Of `A` or its transpose.
    sampling: f64,
    /// Sum of the coefficients along the axes.
    edges: f64,
    /// Half-bandwidths of the matrices on the coefficients and on the samples.
    bands: [f64; 2],
    square: bool,
}

impl Work {
    fn new<T: Real>(lattice: &Lattice<T>, springs: usize) -> Self {
        Self::on(lattice.coefficient_dims(), lattice.sample_dims(), springs)
    }

    fn on(coefficients: [usize; 3], samples: [usize; 3], springs: usize) -> Self {
        let [nx, ny, nz] = coefficients.map(|n| n as f64);
        let [mx, my, mz] = samples.map(|m| m as f64);
        Self {
            coefficients: nx * ny * nz,
            samples: mx * my * mz,
            springs: springs as f64,
            sampling: 8.0 * (nx * ny * mz + nx * my * mz + mx * my * mz),
            edges: nx + ny + nz,
            bands: [(4.0 * ny + 3.0) * nz + 3.0, (my + 1.0) * mz + 1.0],
            square: coefficients == samples,
        }
    }

    /// Spring forces.
    fn forces(&self, law: Law) -> f64 {
        let each = match law {
            Law::Linear { .. } => 8.0,
            Law::FourD { .. } => 25.0,
        };
        each * self.springs * self.samples
    }

    /// One application of a preconditioner.
    fn precondition(&self, method: Method) -> f64 {
        let n = self.coefficients;
        let diagonalization = 4.0 * n * self.edges;
        match method {
            Method::FastDiagonalization => diagonalization,
            Method::Direct => 4.0 * n * self.bands[0],
            Method::SampleDirect => 4.0 * self.samples * self.bands[1],
            // Six smoothing steps and a residual with 27 weights, on all levels.
            Method::SampleMultigrid => 430.0 * self.samples,
            // Four diagonalizations, five matrices, and inverses of 125² twice for half of n/27 blocks.
            _ => 4.0 * diagonalization + 5.0 * self.matrix() + 1150.0 * n,
        }
    }

    /// Making the solver: lists, and what the method needs. That a factor may be made beside the steps changes nothing.
    fn preparation(&self, method: Method, factor: bool) -> f64 {
        let (n, lists) = (self.coefficients, 60.0 * self.samples);
        let cycle = 60.0 * (self.matrix() + 4.0 * n * self.edges);
        let of = |method| match method {
            Method::FastDiagonalization => 0.0,
            Method::Direct => 1150.0 * n + n * self.bands[0] * self.bands[0],
            Method::SampleDirect => self.samples * self.bands[1] * self.bands[1],
            Method::SampleMultigrid => 3000.0 * self.samples,
            _ => cycle,
        };
        let beside = if factor && method == Method::VCycle {
            of(Method::Direct)
        } else {
            0.0
        };
        lists + of(method) + beside
    }

    /// The matrix of a step.
    fn matrix(&self) -> f64 {
        let stencil = (2.0 + 4.0 * self.springs) * self.samples;
        stencil + if self.square { 0.0 } else { 2.0 * self.sampling }
    }

    /// Forces, their gathering, the solve, and what it means on the samples.
    fn solve(&self, law: Law, method: Method, iterations: f64) -> f64 {
        let to_samples = if self.square {
            2.0 * self.coefficients * self.edges
        } else {
            2.0 * self.sampling
        };
        self.forces(law) + to_samples + iterations * (self.precondition(method) + self.matrix())
    }
}

/// Operations of a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Operations {
    /// Of one solve, with all that a step does round it.
    pub solve: f64,
    /// Of making the solver.
    pub preparation: f64,
    /// Of all forces on the coefficients.
    pub look: f64,
}

impl<T: Real> Patch<T> {
    /// What steps cost.
    pub(crate) fn operations(&self) -> Operations {
        let lattice = self.lattice();
        self.operations_on(lattice.coefficient_dims(), lattice.sample_dims())
    }

    /// What they would cost on a part of this patch.
    pub(crate) fn operations_on(&self, coefficients: [usize; 3], samples: [usize; 3]) -> Operations {
        let work = Work::on(coefficients, samples, self.material.network.springs().len());
        let count: usize = coefficients.iter().product();
        let options = self.cache.solver.options();
        let method = options.method(self.is_even(), count, coefficients == samples);
        let factor = count <= options.background_limit;
        // A factor beside the steps takes the place of the cycle.
        let solving = match method {
            Method::VCycle if factor => Method::Direct,
            other => other,
        };
        let iterations = match solving {
            Method::VCycle | Method::SampleMultigrid => ITERATED,
            _ => 1.0,
        };
        let law = self.material.network.law();
        Operations {
            solve: work.solve(law, solving, iterations),
            preparation: work.preparation(method, factor),
            look: work.forces(law) + 2.0 * work.sampling,
        }
    }

    /// Whether there is a solver for the matter as it is.
    pub(crate) fn has_solver(&self) -> bool {
        let now = self.version();
        let of_mass = self.cache.mass_matrix.as_ref().is_some_and(|m| m.0 == now);
        of_mass || self.cache.prepared.is_some_and(|p| p.version == now)
    }

    /// Whether the matrix of a step is the same everywhere.
    fn is_even(&self) -> bool {
        let springs = self.material.network.springs();
        let constant = |w: &Weights<T>| matches!(w, Weights::Constant(_));
        self.has_even_mass()
            && self.material.lumped.ground.is_constant()
            && springs.len() == 3
            && springs.iter().all(|s| constant(&s.weights))
            && matches!(self.material.network.law(), Law::Linear { .. })
    }

    fn has_even_mass(&self) -> bool {
        self.material.mask.is_none()
            && self.material.lumped.mass.is_constant()
            && self.material.lumped.damping.is_constant()
    }

    /// What [`Integrator::Auto`] takes for a step of `dt` seconds: explicit sub-steps within their bound where they cost
    /// fewer operations than one implicit step, which is then no more accurate. Costs the
    /// [bound](Self::explicit_limit), once after each change of the matter.
    ///
    /// Not counted are factors and cycles made after painting.
    ///
    /// # Errors
    /// [`PatchError::TimeStep`], [`PatchError::Solve`].
    pub fn choose(&mut self, dt: f64) -> Result<Choice, PatchError> {
        if !(dt.is_finite() && dt > 0.0) {
            return Err(PatchError::TimeStep { dt });
        }
        let parts = self.explicit_parts(dt)?;
        let law = self.material.network.law();
        let work = Work::new(self.lattice(), self.material.network.springs().len());
        let solve = |uniform: bool, rough: f64| {
            let lattice = self.lattice();
            let options = self.cache.solver.options();
            let method = options.method(uniform, lattice.coefficient_count(), lattice.is_square());
            let iterations = match method {
                Method::VCycle | Method::SampleMultigrid => rough,
                _ => 1.0,
            };
            work.solve(law, method, iterations)
        };
        let kicks = if self.material.lumped.damping.unit == 0.0 {
            parts + 1.0
        } else {
            2.0 * parts
        };
        let explicit_work = kicks * solve(self.has_even_mass(), TO_ROUNDING);
        let implicit_work = 2.0 * solve(self.is_even(), ITERATED);
        let explicit = explicit_work < implicit_work;
        Ok(Choice {
            integrator: if explicit {
                Integrator::Verlet
            } else {
                Integrator::TrBdf2
            },
            substeps: if explicit { parts as usize } else { 1 },
            explicit_work,
            implicit_work,
        })
    }
}
