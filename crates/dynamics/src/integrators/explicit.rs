use bspline::Real;

use super::implicit::Moved;
use crate::constraints::Held;
use crate::lattice::TensorWorkspace;
use crate::patch::{Patch, PatchError};
use crate::solve::{Lanczos, SolveReport, StepSolver, System, add_spring, dot};
use crate::springs::{SpringWeights, StepMatrix, Weights};
use crate::units::binary_unit;

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
            let curvature = dot(d, s);
            self.solver.hold(q);
            curvature
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
    lanczos.ends(&mut system, LANCZOS_STEPS)[1].sqrt()
}

impl<T: Real> Patch<T> {
    /// The power of two in whose units `M + aD` is written.
    fn mass_unit(&self, damping: f64) -> f64 {
        binary_unit(
            self.material
                .lumped
                .mass
                .unit
                .max(damping * self.material.lumped.damping.unit),
        )
    }

    /// The matrix `M + aD`, in its unit.
    pub(crate) fn mass_matrix(&self, damping: f64) -> StepMatrix<T> {
        let springs = self
            .material
            .network
            .springs()
            .iter()
            .take(3)
            .map(|s| SpringWeights {
                direction: s.direction,
                weights: Weights::Constant(T::zero()),
            });
        let (m, c) = (&self.material.lumped.mass, &self.material.lumped.damping);
        let unit = self.mass_unit(damping);
        let factors = [m.unit / unit, damping * c.unit / unit].map(T::from_f64);
        let one = |i: usize| factors[0] * m.at(i) + factors[1] * c.at(i);
        let mass = if m.is_constant() && c.is_constant() {
            Weights::Constant(one(0))
        } else {
            Weights::Each((0..self.motion.base.len()).map(one).collect())
        };
        StepMatrix::new(self.cache.matrix.dims(), mass, springs.collect())
    }

    pub(crate) fn mass_solver(&mut self) -> Box<StepSolver<T>> {
        self.cache.mass_solver.take().unwrap_or_else(|| {
            let steps = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
            let own = &self.cache.solver;
            let mut solver = StepSolver::new(own.lattice().clone(), &steps, own.options());
            solver.set_mask(self.material.mask.clone());
            Box::new(solver)
        })
    }

    /// The largest stable explicit step, `2/√λ_max(M̃⁻¹K̃)`, by Lanczos steps, without hard constraints, which only raise
    /// it; of the 4-D law with all tangent factors 1, which they never exceed. Infinite without stiffness.
    ///
    /// # Errors
    /// [`PatchError::Solve`].
    pub fn explicit_limit(&mut self) -> Result<f64, PatchError> {
        let now = self.version();
        if let Some((version, limit)) = self.cache.limit
            && version == now
        {
            return Ok(limit);
        }
        let mass = self.mass_matrix(0.0);
        let sigma2 = self.material.network.law().scale().powi(2);
        let held = self.material.held.as_deref().map_or(&[][..], Held::springs);
        let stiffest = held.iter().fold(0.0_f64, |m, (_, k)| m.max(k / sigma2));
        let ground = &self.material.lumped.ground;
        let unit = binary_unit(
            self.material
                .network
                .stiffness_unit()
                .max(ground.unit)
                .max(stiffest),
        );
        if unit == 0.0 {
            self.cache.limit = Some((now, f64::INFINITY));
            return Ok(f64::INFINITY);
        }
        let springs = self.material.network.springs().iter().map(|s| SpringWeights {
            direction: s.direction,
            weights: s.weights.scaled(self.material.network.stiffness_unit() / unit),
        });
        let stiffness = StepMatrix::new(
            self.cache.matrix.dims(),
            ground.weights.scaled(ground.unit / unit),
            springs.collect(),
        );
        let held = held.iter().map(|(row, k)| (row.clone(), k / (sigma2 * unit)));
        let held: Vec<_> = held.collect();
        let mut solver = self.mass_solver();
        self.cache.mass_matrix = None;
        solver.prepare(&mass)?;
        let largest = largest_frequency(&stiffness, &held, &mass, &mut solver);
        self.cache.mass_solver = Some(solver);
        // (λ in units of its own) · σ²·(unit of stiffness)/(unit of mass)
        let largest = largest * (sigma2 * unit / self.mass_unit(0.0)).sqrt();
        let limit = if largest > 0.0 {
            2.0 / largest
        } else {
            f64::INFINITY
        };
        self.cache.limit = Some((now, limit));
        Ok(limit)
    }

    /// Refuses steps beyond the bound.
    pub(super) fn check_explicit(&mut self, dt: f64) -> Result<(), PatchError> {
        let limit = SAFETY * self.explicit_limit()?;
        if limit.is_nan() || dt > limit {
            return Err(PatchError::Unstable { dt, limit });
        }
        Ok(())
    }

    /// Least number of equal parts of `dt`, two or more, that are all within the bound.
    pub(super) fn explicit_parts(&mut self, dt: f64) -> Result<f64, PatchError> {
        let limit = SAFETY * self.explicit_limit()?;
        // Rounding of the quotient must not leave parts beyond the bound.
        Ok((dt / limit * (1.0 + 1e-12)).ceil().max(2.0))
    }

    /// `v += Δt (M̃ + ΔtD̃)⁻¹ Aᵀ(f - Dw)`, `p += Δt v`.
    pub(super) fn symplectic_step(&mut self, dt: f64) -> Result<Moved, PatchError> {
        self.check_explicit(dt)?;
        self.aim(dt / self.mass_unit(dt), 1.0 / dt, 1.0);
        let (report, clamped) = self.kick(dt, dt)?;
        self.drift(dt);
        Ok((report, clamped, None))
    }

    /// `parts` steps of the velocity Verlet scheme: half a kick, the drift, half a kick; kicks of neighbouring steps
    /// are one where nothing damps. In each the damping is that of the mean velocity, which keeps the bound.
    pub(super) fn verlet_steps(&mut self, dt: f64, parts: usize) -> Result<Moved, PatchError> {
        let h = dt / parts as f64;
        self.check_explicit(h)?;
        let merge = self.material.lumped.damping.unit == 0.0;
        let mut worst: Option<(SolveReport, usize)> = None;
        let mut kicked = |(report, clamped): (SolveReport, usize)| {
            let (before, most) = worst.unwrap_or((report, clamped));
            worst = Some((before.and(report), most.max(clamped)));
        };
        let mut kick = 0.5 * h;
        for part in 0..parts {
            // Hard constraints are met by the drift, then by the velocity.
            self.aim(kick / self.mass_unit(0.5 * kick), 1.0 / h, 1.0);
            kicked(self.kick(kick, 0.5 * kick)?);
            self.drift(h);
            if merge && part + 1 < parts {
                kick = h;
                continue;
            }
            kick = 0.5 * h;
            self.aim(kick / self.mass_unit(0.5 * kick), 0.0, 1.0);
            kicked(self.kick(kick, 0.5 * kick)?);
        }
        let (report, clamped) = worst.expect("there is a first part");
        Ok((report, clamped, None))
    }

    /// `p += Δt v`.
    fn drift(&mut self, dt: f64) {
        let state = &mut self.motion.state;
        let grown = |d: T, w: T| T::from_f64(d.as_f64() + dt * w.as_f64());
        for (p, v) in state.p.iter_mut().zip(&state.v) {
            *p = grown(*p, *v);
        }
        let mut done = 0.0;
        for ((d, w), f) in state.d.iter_mut().zip(&state.w).zip(&self.motion.external) {
            *d = grown(*d, *w);
            done += w.as_f64() * f.as_f64();
        }
        self.cache.work.work += dt * done;
    }

    /// `v += Δt (M̃ + aD̃)⁻¹ Aᵀ(f - Dw)`: the damping of the velocity after the kick with `a = Δt`, of the mean one with
    /// `a = Δt/2`.
    fn kick(&mut self, dt: f64, damping: f64) -> Result<(SolveReport, usize), PatchError> {
        let clamped = self.forces(None);
        let unit = self.mass_unit(damping);
        let lost = dt * self.material.lumped.damping.unit / unit;
        let pushed = dt * self.cache.work.force_unit / unit;
        for (i, g) in self.cache.work.g.iter_mut().enumerate() {
            let damped = lost * self.material.lumped.damping.at(i).as_f64() * self.motion.state.w[i].as_f64();
            *g = T::from_f64(pushed * self.cache.work.force[i].as_f64() - damped);
        }
        let mut solver = self.mass_solver();
        if let (Some(held), None) = (&self.material.held, solver.border_mut()) {
            solver.set_border(Some(held.border(false)));
            self.cache.mass_matrix = None;
        }
        if let (Some(held), Some(border)) = (&self.material.held, solver.border_mut()) {
            held.aim(border);
        }
        let version = self.version();
        let kept = self
            .cache
            .mass_matrix
            .take()
            .filter(|m| (m.0, m.1) == (version, damping));
        let (matrix, prepared) = match kept {
            Some((.., matrix)) => (matrix, Ok(())),
            None => {
                let matrix = self.mass_matrix(damping);
                let prepared = solver.prepare(&matrix);
                (matrix, prepared)
            }
        };
        let work = &mut self.cache.work;
        let report = prepared.map(|()| solver.solve(&matrix, &work.g, &mut work.x, &mut work.dx));
        self.cache.mass_solver = Some(solver);
        let report = report?;
        self.cache.mass_matrix = Some((version, damping, matrix));
        let state = &mut self.motion.state;
        for (v, x) in state.v.iter_mut().zip(&work.x) {
            *v += *x;
        }
        for (w, dx) in state.w.iter_mut().zip(&work.dx) {
            *w += *dx;
        }
        Ok((report.checked()?, clamped))
    }
}
