use bspline::Real;

use super::implicit::Moved;
use crate::constraints::Held;
use crate::lattice::TensorWorkspace;
use crate::patch::{Patch, PatchError};
use crate::solve::{Lanczos, SolveReport, StepSolver, System, add_spring, dot};
use crate::springs::{SpringWeights, StepMatrix, Weights};

/// Share of the bound that a step may use: the bound is an estimate from below of the largest eigenvalue.
const SAFETY: f64 = 0.95;
const LANCZOS_STEPS: usize = 30;

/// `K̃`, preconditioned by the inverse of `M̃`; on a square lattice, where `A` changes nothing, `K` and `M` themselves.
struct Stiffness<'a, T> {
    stiffness: &'a StepMatrix<T>,
    /// Of constraint springs: rows on the unknowns with their stiffness.
    springs: &'a [(Vec<(usize, f64)>, f64)],
    mass: &'a StepMatrix<T>,
    solver: &'a mut StepSolver<T>,
    samples: [Vec<T>; 2],
    workspace: TensorWorkspace<T>,
}

impl<T: Real> System<T> for Stiffness<'_, T> {
    fn apply(&mut self, p: &[T], q: &mut [T]) -> f64 {
        let mut curvature = if self.solver.lattice().is_square() {
            self.stiffness.apply(p, q);
            dot(p, q)
        } else {
            let [d, s] = &mut self.samples;
            self.solver.lattice().sample(p, d, &mut self.workspace);
            self.stiffness.apply(d, s);
            self.solver.lattice().gather(s, q, &mut self.workspace);
            dot(d, s)
        };
        for (row, stiffness) in self.springs {
            curvature += add_spring(row, *stiffness, p, q);
        }
        curvature
    }

    fn precondition(&mut self, r: &[T], z: &mut [T]) {
        if self.solver.lattice().is_square() {
            for (i, (z, r)) in z.iter_mut().zip(r).enumerate() {
                *z = *r / self.mass.mass.at(i);
            }
        } else {
            self.solver.solve_coefficients(self.mass, r, z);
        }
    }
}

/// `√λ_max(M̃⁻¹K̃)` by Lanczos steps; `solver` is prepared for the mass.
pub(crate) fn largest_frequency<T: Real>(
    stiffness: &StepMatrix<T>,
    springs: &[(Vec<(usize, f64)>, f64)],
    mass: &StepMatrix<T>,
    solver: &mut StepSolver<T>,
) -> f64 {
    let samples = solver.lattice().sample_count();
    let mut lanczos = Lanczos::new(solver.lattice().coefficient_count());
    let mut system = Stiffness {
        stiffness,
        springs,
        mass,
        solver,
        samples: [vec![T::zero(); samples], vec![T::zero(); samples]],
        workspace: TensorWorkspace::new(),
    };
    lanczos.largest(&mut system, LANCZOS_STEPS).sqrt()
}

impl<T: Real> Patch<T> {
    /// The matrix `M + aD`.
    fn mass_matrix(&self, damping: f64) -> StepMatrix<T> {
        let springs = self.lumped.springs.iter().take(3).map(|s| SpringWeights {
            direction: s.direction,
            weights: Weights::Constant(T::zero()),
        });
        let a = T::from_f64(damping);
        let lumped = &self.lumped;
        let mass = match (&lumped.mass, &lumped.damping) {
            (Weights::Constant(m), Weights::Constant(c)) => Weights::Constant(*m + a * *c),
            (m, c) => Weights::Each((0..self.base.len()).map(|i| m.at(i) + a * c.at(i)).collect()),
        };
        StepMatrix::new(self.matrix.dims(), mass, springs.collect())
    }

    fn mass_solver(&mut self) -> Box<StepSolver<T>> {
        self.mass_solver.take().unwrap_or_else(|| {
            let steps = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
            Box::new(StepSolver::new(
                self.solver.lattice().clone(),
                &steps,
                self.solver.options(),
            ))
        })
    }

    /// The largest stable explicit step, `2/√λ_max(M̃⁻¹K̃)`, by Lanczos steps, without hard constraints, which only raise it; of the 4-D law with all tangent factors 1,
    /// which they never exceed. Infinite without stiffness.
    ///
    /// # Errors
    /// [`PatchError::Solve`].
    pub fn explicit_limit(&mut self) -> Result<f64, PatchError> {
        if let Some((version, limit)) = self.limit
            && version == self.version
        {
            return Ok(limit);
        }
        let mass = self.mass_matrix(0.0);
        let scale = self.network.law().scale().powi(2);
        let springs = self.lumped.springs.iter().map(|s| SpringWeights {
            direction: s.direction,
            weights: s.weights.scaled(scale),
        });
        let stiffness = StepMatrix::new(
            self.matrix.dims(),
            self.lumped.ground.scaled(scale),
            springs.collect(),
        );
        let mut solver = self.mass_solver();
        self.mass_matrix = None;
        solver.prepare(&mass)?;
        let springs = self.held.as_deref().map_or(&[][..], Held::springs);
        let largest = largest_frequency(&stiffness, springs, &mass, &mut solver);
        self.mass_solver = Some(solver);
        let limit = if largest > 0.0 {
            2.0 / largest
        } else {
            f64::INFINITY
        };
        self.limit = Some((self.version, limit));
        Ok(limit)
    }

    /// Refuses steps beyond the bound.
    pub(super) fn check_explicit(&mut self, dt: f64) -> Result<(), PatchError> {
        let limit = SAFETY * self.explicit_limit()?;
        if dt > limit {
            return Err(PatchError::Unstable { dt, limit });
        }
        Ok(())
    }

    /// Least number of equal parts of `dt` that are all within the bound.
    pub(super) fn explicit_parts(&mut self, dt: f64) -> Result<f64, PatchError> {
        let limit = SAFETY * self.explicit_limit()?;
        // Rounding of the quotient must not leave parts beyond the bound.
        Ok((dt / limit * (1.0 + 1e-12)).ceil().max(1.0))
    }

    /// `v += Δt (M̃ + ΔtD̃)⁻¹ Aᵀ(f - Dw)`, `p += Δt v`.
    pub(super) fn symplectic_step(&mut self, dt: f64) -> Result<Moved, PatchError> {
        self.check_explicit(dt)?;
        self.aim(dt, 1.0 / dt, 1.0);
        let (report, clamped) = self.kick(dt, dt)?;
        self.drift(dt);
        Ok((report, clamped, None))
    }

    /// `parts` steps of the velocity Verlet scheme: half a kick, the drift, half a kick; kicks of neighbouring steps
    /// are one where nothing damps. In each the damping is that of the mean velocity, which keeps the bound.
    pub(super) fn verlet_steps(&mut self, dt: f64, parts: usize) -> Result<Moved, PatchError> {
        let h = dt / parts as f64;
        self.check_explicit(h)?;
        let merge = matches!(&self.lumped.damping, Weights::Constant(c) if *c == T::zero());
        let mut kick = 0.5 * h;
        let mut clamped = 0;
        for part in 0..parts {
            // Hard constraints are met by the drift, then by the velocity.
            self.aim(kick, 1.0 / h, 1.0);
            clamped = clamped.max(self.kick(kick, 0.5 * kick)?.1);
            self.drift(h);
            if merge && part + 1 < parts {
                kick = h;
                continue;
            }
            kick = 0.5 * h;
            self.aim(kick, 0.0, 1.0);
            let (report, count) = self.kick(kick, 0.5 * kick)?;
            clamped = clamped.max(count);
            if part + 1 == parts {
                return Ok((report, clamped, None));
            }
        }
        unreachable!("there is a last part")
    }

    /// `p += Δt v`.
    fn drift(&mut self, dt: f64) {
        let (state, t) = (&mut self.state, T::from_f64(dt));
        for (p, v) in state.p.iter_mut().zip(&state.v) {
            *p += t * *v;
        }
        for (d, w) in state.d.iter_mut().zip(&state.w) {
            *d += t * *w;
        }
    }

    /// `v += Δt (M̃ + aD̃)⁻¹ Aᵀ(f - Dw)`: the damping of the velocity after the kick with `a = Δt`, of the mean one with
    /// `a = Δt/2`.
    fn kick(&mut self, dt: f64, damping: f64) -> Result<(SolveReport, usize), PatchError> {
        let clamped = self.forces(None);
        let t = T::from_f64;
        for (i, g) in self.work.g.iter_mut().enumerate() {
            *g = t(dt) * (self.work.force[i] - self.lumped.damping.at(i) * self.state.w[i]);
        }
        let mut solver = self.mass_solver();
        if let (Some(held), None) = (&self.held, solver.border_mut()) {
            solver.set_border(Some(held.border(false)));
            self.mass_matrix = None;
        }
        if let (Some(held), Some(border)) = (&self.held, solver.border_mut()) {
            held.aim(border);
        }
        let kept = self
            .mass_matrix
            .take()
            .filter(|m| (m.0, m.1) == (self.version, damping));
        let (matrix, prepared) = match kept {
            Some((.., matrix)) => (matrix, Ok(())),
            None => {
                let matrix = self.mass_matrix(damping);
                let prepared = solver.prepare(&matrix);
                (matrix, prepared)
            }
        };
        let work = &mut self.work;
        let report = prepared.map(|()| solver.solve(&matrix, &work.g, &mut work.x, &mut work.dx));
        self.mass_solver = Some(solver);
        let report = report?;
        self.mass_matrix = Some((self.version, damping, matrix));
        let state = &mut self.state;
        for (v, x) in state.v.iter_mut().zip(&work.x) {
            *v += *x;
        }
        for (w, dx) in state.w.iter_mut().zip(&work.dx) {
            *w += *dx;
        }
        Ok((report, clamped))
    }
}
