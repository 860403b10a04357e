use bspline::Real;

use crate::patch::{Patch, PatchError, Prepared};
use crate::solve::{ITERATED, Method, SolveReport};
use crate::springs::{Law, Weights};

/// Beyond this ratio of step sizes a factor is not tried again: four in `Δt²` costs about eight iterations.
const STALE: f64 = 4.0;
/// Residual, relative to the impulse, that a solve with an old factor may leave.
const TRUSTED: f64 = 1e-3;

/// What a step returns to its caller: the last solve, the clamp count, the error estimate.
pub(super) type Moved = (SolveReport, usize, Option<f64>);

impl<T: Real> Patch<T> {
    /// All forces on the samples at the present state: external, springs, ground, but not damping. With them, of the
    /// 4-D law, the tangent `stiffness·σ²kτ`. Returns the number of springs with a negative tangent.
    pub(crate) fn forces(&mut self, stiffness: Option<f64>) -> usize {
        let (force, d) = (&mut self.work.force, &self.state.d);
        force.copy_from_slice(&self.external);
        let springs = match (self.network.law(), stiffness) {
            (Law::FourD { .. }, Some(factor)) => {
                self.network
                    .add_forces_and_tangent(d, force, factor, &mut self.matrix.springs)
            }
            _ => self.network.add_forces(d, force),
        };
        let sigma2 = T::from_f64(self.network.law().scale().powi(2));
        match &self.lumped.ground {
            Weights::Constant(g) if *g == T::zero() => (),
            ground => {
                for (i, f) in force.iter_mut().enumerate() {
                    *f -= ground.at(i) * sigma2 * (d[i] - self.base[i]);
                }
            }
        }
        springs.clamped
    }

    /// Solves `(M̃ + aD̃ + bK̃) x = Aᵀg` into `work.x`, `work.dx`; tangents of the 4-D law are those of [`forces`].
    ///
    /// [`forces`]: Self::forces
    pub(super) fn solve_step(&mut self, damping: f64, stiffness: f64) -> Result<SolveReport, PatchError> {
        let (version, four_d) = (self.version, matches!(self.network.law(), Law::FourD { .. }));
        let same = self
            .prepared
            .is_some_and(|p| p.version == version && p.damping == damping && p.stiffness == stiffness);
        // An old factor may solve for the matrix of another step.
        if four_d || self.filled != Some((version, damping, stiffness)) {
            self.fill_matrix(damping, stiffness);
            self.filled = Some((version, damping, stiffness));
        }
        let near = self.prepared.is_some_and(|p| {
            let ratio = stiffness / p.stiffness;
            p.version == version && (1.0 / STALE..=STALE).contains(&ratio)
        });
        self.aim_implicit(stiffness);
        // The diagonalization of constant material costs nothing to renew.
        let mut fresh = !near || (!same && self.matrix.is_uniform());
        loop {
            if fresh {
                self.prepared = None;
                self.solver.prepare(&self.matrix)?;
            }
            let work = &mut self.work;
            let report = self
                .solver
                .solve(&self.matrix, &work.g, &mut work.x, &mut work.dx);
            let residual = report.iteration.residual;
            if fresh {
                self.prepared = Some(Prepared {
                    version,
                    damping,
                    stiffness,
                    residual,
                });
                return Ok(report);
            }
            let known = self.prepared.map_or(0.0, |p| p.residual);
            // Those that iterate stop there.
            let trusted = match report.method {
                Method::VCycle | Method::SampleMultigrid => 3.0 * ITERATED,
                _ => TRUSTED,
            };
            if residual <= trusted.max(2.0 * known) && report.iteration.negative_curvature.is_none() {
                return Ok(report);
            }
            fresh = true;
        }
    }

    /// Writes `M + aD + bG` and, of the linear law, `bσ²k` into the matrix.
    fn fill_matrix(&mut self, damping: f64, stiffness: f64) {
        let scale = stiffness * self.network.law().scale().powi(2);
        let (a, b) = (T::from_f64(damping), T::from_f64(scale));
        let lumped = &self.lumped;
        let diagonal = |i: usize| lumped.mass.at(i) + a * lumped.damping.at(i) + b * lumped.ground.at(i);
        let constant = [&lumped.mass, &lumped.damping, &lumped.ground]
            .iter()
            .all(|w| matches!(w, Weights::Constant(_)));
        write(&mut self.matrix.mass, constant, self.base.len(), diagonal);
        if let Law::Linear { .. } = self.network.law() {
            for (to, from) in self.matrix.springs.iter_mut().zip(&lumped.springs) {
                let constant = matches!(from.weights, Weights::Constant(_));
                write(&mut to.weights, constant, self.base.len(), |i| {
                    b * from.weights.at(i)
                });
            }
        }
        self.matrix.refresh();
    }

    /// [DIS eq. 12] in displacement and velocity: with `p_{i-1} = p_i - Δt v` it reads
    /// `(M̃ + ½Δt D̃ + Δt² K̃) Δp = Δt M̃v - ½Δt² D̃v + Δt² Aᵀ(f_ext + f_int)`.
    pub(super) fn paper_step(&mut self, dt: f64) -> Result<Moved, PatchError> {
        let clamped = self.forces(Some(dt * dt));
        let t = T::from_f64;
        for (i, g) in self.work.g.iter_mut().enumerate() {
            let momentum = t(dt) * self.lumped.mass.at(i) - t(0.5 * dt * dt) * self.lumped.damping.at(i);
            *g = momentum * self.state.w[i] + t(dt * dt) * self.work.force[i];
        }
        self.aim(dt * dt, 1.0, 0.0);
        let report = self.solve_step(0.5 * dt, dt * dt)?;
        let (work, state) = (&self.work, &mut self.state);
        for (v, x) in state.v.iter_mut().zip(&work.x) {
            *v = *x / t(dt);
        }
        for (w, dx) in state.w.iter_mut().zip(&work.dx) {
            *w = *dx / t(dt);
        }
        self.advance();
        Ok((report, clamped, None))
    }

    /// `p += x`, `d += dx`.
    pub(super) fn advance(&mut self) {
        let (work, state) = (&self.work, &mut self.state);
        for (p, x) in state.p.iter_mut().zip(&work.x) {
            *p += *x;
        }
        for (d, dx) in state.d.iter_mut().zip(&work.dx) {
            *d += *dx;
        }
    }

    /// Both stages have the matrix `M̃ + cD̃ + c²K̃`, `c = (1 - 1/√2)Δt`.
    ///
    /// With `δ` the change of the coefficients over a stage and `F` the forces without damping where it starts:
    /// stage 1 `(…)δ = 2cM̃v + 2c²F`, `v ← δ/c - v`; stage 2, with the change `e` of the first and
    /// `β = (1-γ)²/(γ(2-γ))`, `(…)δ = cM̃((1+β)v₁ - βv₀) + (M̃ + cD̃)βe + c²F₁`, `v ← (δ - βe)/c`.
    pub(super) fn tr_bdf2_step(&mut self, dt: f64) -> Result<Moved, PatchError> {
        let gamma = 2.0 - std::f64::consts::SQRT_2;
        let beta = (1.0 - gamma).powi(2) / (gamma * (2.0 - gamma));
        let c = 0.5 * gamma * dt;
        let t = T::from_f64;
        let mut clamped = self.forces(Some(c * c));
        for (i, g) in self.work.g.iter_mut().enumerate() {
            *g =
                t(2.0 * c) * (self.lumped.mass.at(i) * self.state.w[i]) + t(2.0 * c * c) * self.work.force[i];
        }
        self.aim(2.0 * c * c, 1.0, 0.0);
        self.solve_step(c, c * c)?;
        let (work, state) = (&mut self.work, &mut self.state);
        for (v, x) in state.v.iter_mut().zip(&work.x) {
            *v = *x / t(c) - *v;
        }
        for (w, dx) in state.w.iter_mut().zip(&work.dx) {
            *w = *dx / t(c) - *w;
        }
        std::mem::swap(&mut work.first_x, &mut work.x);
        std::mem::swap(&mut work.first_dx, &mut work.dx);
        for (p, x) in state.p.iter_mut().zip(&work.first_x) {
            *p += *x;
        }
        for (d, dx) in state.d.iter_mut().zip(&work.first_dx) {
            *d += *dx;
        }
        clamped = clamped.max(self.forces(Some(c * c)));
        let work = &mut self.work;
        for (i, g) in work.g.iter_mut().enumerate() {
            let (m, damping) = (self.lumped.mass.at(i), self.lumped.damping.at(i));
            let velocity = t(1.0 + beta) * self.state.w[i] - t(beta) * work.before.w[i];
            let first = t(beta) * work.first_dx[i];
            *g = t(c) * (m * velocity) + (m + t(c) * damping) * first + t(c * c) * work.force[i];
        }
        self.aim(c * c, 1.0, 0.0);
        let report = self.solve_step(c, c * c)?;
        let error = self.tr_bdf2_finish(dt, gamma, beta, c);
        Ok((report, clamped, Some(error)))
    }

    /// Velocities and positions after the second stage, and the error: the difference to the third-order companion
    /// [M. E. Hosea and L. F. Shampine, *Analysis and implementation of TR-BDF2*, 1996], root mean square over the
    /// samples.
    fn tr_bdf2_finish(&mut self, dt: f64, gamma: f64, beta: f64, c: f64) -> f64 {
        let t = T::from_f64;
        let w = std::f64::consts::SQRT_2 / 4.0;
        let difference = [
            w - (1.0 - w) / 3.0,
            w - (3.0 * w + 1.0) / 3.0,
            gamma / 2.0 - gamma / 6.0,
        ];
        let (work, state) = (&self.work, &mut self.state);
        for ((v, x), first) in state.v.iter_mut().zip(&work.x).zip(&work.first_x) {
            *v = (*x - t(beta) * *first) / t(c);
        }
        let mut error = 0.0;
        for (i, v) in state.w.iter_mut().enumerate() {
            let after = (work.dx[i] - t(beta) * work.first_dx[i]) / t(c);
            let rates = [work.before.w[i], *v, after];
            let one: f64 = difference.iter().zip(rates).map(|(e, w)| e * w.as_f64()).sum();
            error += (dt * one).powi(2);
            *v = after;
        }
        self.advance();
        (error / self.base.len() as f64).sqrt()
    }
}

/// Writes weights in place where the form stays the same.
fn write<T: Real>(to: &mut Weights<T>, constant: bool, count: usize, f: impl Fn(usize) -> T) {
    if constant {
        *to = Weights::Constant(f(0));
        return;
    }
    if let Weights::Constant(_) = to {
        *to = Weights::Each(vec![T::zero(); count]);
    }
    if let Weights::Each(w) = to {
        for (i, w) in w.iter_mut().enumerate() {
            *w = f(i);
        }
    }
}
