use bspline::Real;

use crate::lattice::SampleBox;
use crate::patch::Prepared;
use crate::patch::{Patch, PatchError};
use crate::solve::{ITERATED, Method, SolveReport};
use crate::springs::{Law, Weights};
use crate::units::binary_unit;

/// Beyond this ratio of step sizes a factor is not tried again: four in `Δt²` costs about eight iterations.
const STALE: f64 = 4.0;
/// Residual, relative to the impulse, that a solve with an old factor may leave.
const TRUSTED: f64 = 1e-3;

/// What a step returns to its caller: the worst of its solves, the largest clamp count, the error estimate.
pub(super) type Moved = (SolveReport, usize, Option<f64>);

impl<T: Real> Patch<T> {
    /// All forces on the samples at the present state: external, springs, ground, but not damping, as multiples of
    /// `work.force_unit`. With them, of the 4-D law, the tangent `tangent·σ²kτ`. Returns the number of springs with a
    /// negative tangent.
    pub(crate) fn forces(&mut self, tangent: Option<f64>) -> usize {
        let d = &self.motion.state.d;
        let sigma2 = self.material.network.law().scale().powi(2);
        let ground = &self.material.lumped.ground;
        let unit = binary_unit(
            self.motion
                .external_size
                .max(self.material.network.force_unit())
                .max(sigma2 * ground.unit),
        );
        let unit = if unit > 0.0 { unit } else { 1.0 };
        self.cache.work.force_unit = unit;
        let force = &mut self.cache.work.force;
        let inverse = 1.0 / unit;
        for (f, e) in force.iter_mut().zip(&self.motion.external) {
            *f = T::from_f64(e.as_f64() * inverse);
        }
        let tangent = match self.material.network.law() {
            Law::FourD { .. } => tangent.map(|t| (t, &mut self.cache.matrix.springs[..])),
            Law::Linear { .. } => None,
        };
        let clamped = self.material.network.add_forces_in(unit, d, force, tangent);
        if ground.unit > 0.0 {
            let factor = T::from_f64(sigma2 * ground.unit * inverse);
            for (i, f) in force.iter_mut().enumerate() {
                *f -= factor * ground.at(i) * (d[i] - self.motion.anchor[i]);
            }
        }
        clamped
    }

    /// The power of two in whose units the matrix `M̃ + aD̃ + bK̃` is written: a factor that may still serve knows it in
    /// its own.
    pub(crate) fn matrix_unit(&self, damping: f64, stiffness: f64) -> f64 {
        if let Some(p) = self.cache.prepared.filter(|p| self.is_near(p, stiffness)) {
            return p.unit;
        }
        let sigma2 = self.material.network.law().scale().powi(2);
        let springs = self
            .material
            .network
            .stiffness_unit()
            .max(self.material.lumped.ground.unit);
        let of_springs = stiffness * sigma2 * springs;
        binary_unit(
            (self.material.lumped.mass.unit)
                .max(damping * self.material.lumped.damping.unit)
                .max(of_springs),
        )
    }

    /// Whether a factor may serve for a matrix with this stiffness: paint may be younger than it is.
    fn is_near(&self, p: &Prepared, stiffness: f64) -> bool {
        p.version.changes == self.version().changes
            && (1.0 / STALE..=STALE).contains(&(stiffness / p.stiffness))
    }

    /// Solves `(M̃ + aD̃ + bK̃) x = Aᵀg` into `work.x`, `work.dx`, which is expected to be the first share of the velocity with the
    /// second of what the first stage found; tangents of the 4-D law are those of [`forces`].
    ///
    /// [`forces`]: Self::forces
    pub(super) fn solve_step(
        &mut self,
        damping: f64,
        stiffness: f64,
        expected: [f64; 2],
    ) -> Result<SolveReport, PatchError> {
        self.solve_step_to(damping, stiffness, None, Some(expected))
    }

    /// The same to a residual, if one is asked for, however many iterations that takes.
    pub(crate) fn solve_step_to(
        &mut self,
        damping: f64,
        stiffness: f64,
        residual: Option<f64>,
        mut expected: Option<[f64; 2]>,
    ) -> Result<SolveReport, PatchError> {
        let (version, four_d) = (
            self.version(),
            matches!(self.material.network.law(), Law::FourD { .. }),
        );
        let unit = self.matrix_unit(damping, stiffness);
        let same = self
            .cache
            .prepared
            .is_some_and(|p| p.version == version && p.damping == damping && p.stiffness == stiffness);
        // An old factor may solve for the matrix of another step.
        let filled = Some((version, damping, stiffness, unit));
        if four_d || self.cache.filled != filled {
            self.fill_matrix(damping, stiffness, unit);
            self.cache.filled = filled;
        }
        let near = self.cache.prepared.is_some_and(|p| self.is_near(&p, stiffness));
        self.aim_implicit(stiffness / unit);
        // The diagonalization of constant material costs nothing to renew.
        let uniform = self.cache.matrix.is_uniform();
        let diagonalized = self.cache.solver.method() == Method::FastDiagonalization;
        let mut fresh = !near || (!same && (uniform || diagonalized));
        // A factor of matter before the last paint is no more than that.
        let painted = self.cache.prepared.is_some_and(|p| p.version != version);
        // What follows paint does so for the matrix that it was made for; for another step it is made anew.
        let follows = !fresh && painted && self.cache.solver.follows_paint();
        let of_this_step = |p: Prepared| p.damping == damping && p.stiffness == stiffness;
        let mut at =
            (follows && self.cache.prepared.is_some_and(of_this_step)).then_some(self.cache.painted_on);
        fresh |= follows;
        loop {
            if fresh {
                self.cache.prepared = None;
                self.cache.painted_on = SampleBox::default();
                match at.take() {
                    Some(at) => self.cache.solver.repaint(&self.cache.matrix, at)?,
                    None => self.cache.solver.prepare(&self.cache.matrix)?,
                }
            }
            let usual = self.cache.solver.tolerance();
            let asked = match residual {
                Some(residual) => Some(residual.min(usual)),
                None => (painted && !fresh).then_some(ITERATED),
            };
            // One solve with its own factor finds all, whatever it begins with.
            let exact = (fresh || same && !four_d) && self.cache.solver.method() != Method::VCycle;
            let expected = expected.take().filter(|_| !exact);
            if let Some([dt, share]) = expected {
                self.expect(dt, share);
            }
            let work = &mut self.cache.work;
            let report = self.cache.solver.solve_to(
                &self.cache.matrix,
                &work.g,
                &mut work.x,
                &mut work.dx,
                asked,
                expected.is_some(),
            );
            let left = report.iteration.residual;
            let known = self.cache.prepared.map_or(0.0, |p| p.residual);
            // Those that iterate stop there.
            let trusted = match report.method {
                Method::VCycle | Method::SampleMultigrid => 3.0 * ITERATED,
                _ => TRUSTED,
            };
            let solved = left <= trusted.max(2.0 * known) && report.iteration.negative_curvature.is_none();
            // Beside the paint, what followed it may still be of tangents that have changed since.
            let anew = fresh && self.cache.solver.is_made_for(&self.cache.matrix);
            if fresh && (solved || anew) {
                self.cache.prepared = Some(Prepared {
                    version,
                    damping,
                    stiffness,
                    unit,
                    residual: left,
                });
                return Ok(report.checked()?);
            }
            if solved {
                return Ok(report);
            }
            fresh = true;
        }
    }

    /// Writes `M + aD + bG` and, of the linear law, `bσ²k` into the matrix, as multiples of `unit`.
    pub(crate) fn fill_matrix(&mut self, damping: f64, stiffness: f64, unit: f64) {
        let scale = stiffness * self.material.network.law().scale().powi(2);
        let lumped = &self.material.lumped;
        let parts = [
            (&lumped.mass, 1.0),
            (&lumped.damping, damping),
            (&lumped.ground, scale),
        ];
        let constant = parts.iter().all(|(w, _)| w.is_constant());
        let parts = parts.map(|(w, factor)| (w, T::from_f64(factor * w.unit / unit)));
        let diagonal = |i: usize| {
            let [m, d, g] = parts.each_ref().map(|(w, factor)| *factor * w.at(i));
            m + d + g
        };
        write(
            &mut self.cache.matrix.mass,
            constant,
            self.motion.base.len(),
            diagonal,
        );
        if let Law::Linear { .. } = self.material.network.law() {
            let b = T::from_f64(scale * self.material.network.stiffness_unit() / unit);
            for (to, from) in self
                .cache
                .matrix
                .springs
                .iter_mut()
                .zip(self.material.network.springs())
            {
                if let (Weights::Each(to), Weights::Each(from)) = (&mut to.weights, &from.weights) {
                    to.iter_mut().zip(from).for_each(|(to, from)| *to = b * *from);
                    continue;
                }
                let constant = matches!(from.weights, Weights::Constant(_));
                write(&mut to.weights, constant, self.motion.base.len(), |i| {
                    b * from.weights.at(i)
                });
            }
        }
        self.cache.matrix.refresh();
    }

    /// [Hua04 eq. 12] in displacement and velocity: with `p_{i-1} = p_i - Δt v` it reads
    /// `(M̃ + ½Δt D̃ + Δt² K̃) Δp = Δt M̃v - ½Δt² D̃v + Δt² Aᵀ(f_ext + f_int)`.
    pub(super) fn paper_step(&mut self, dt: f64) -> Result<Moved, PatchError> {
        let (a, b) = (0.5 * dt, dt * dt);
        let unit = self.matrix_unit(a, b);
        let clamped = self.forces(Some(b / unit));
        let work = &mut self.cache.work;
        let (mass, damping) = (&self.material.lumped.mass, &self.material.lumped.damping);
        let (kept, lost) = (dt * mass.unit / unit, a * dt * damping.unit / unit);
        let pushed = b * work.force_unit / unit;
        for (i, g) in work.g.iter_mut().enumerate() {
            let momentum = kept * mass.at(i).as_f64() - lost * damping.at(i).as_f64();
            *g = T::from_f64(momentum * self.motion.state.w[i].as_f64() + pushed * work.force[i].as_f64());
        }
        self.aim(b / unit, 1.0, 0.0);
        let report = self.solve_step(a, b, [dt, 0.0])?;
        let (work, state) = (&self.cache.work, &mut self.motion.state);
        let rate = |x: T| T::from_f64(x.as_f64() / dt);
        for (v, x) in state.v.iter_mut().zip(&work.x) {
            *v = rate(*x);
        }
        for (w, dx) in state.w.iter_mut().zip(&work.dx) {
            *w = rate(*dx);
        }
        self.advance();
        Ok((report, clamped, None))
    }

    /// What a solve finds if nothing accelerates.
    fn expect(&mut self, dt: f64, share: f64) {
        let (work, state) = (&mut self.cache.work, &self.motion.state);
        let lists = [
            (&mut work.x, &state.v, &work.first_x),
            (&mut work.dx, &state.w, &work.first_dx),
        ];
        for (to, rates, first) in lists {
            for ((to, v), first) in to.iter_mut().zip(rates).zip(first) {
                *to = T::from_f64(dt * v.as_f64() + share * first.as_f64());
            }
        }
    }

    /// `p += x`, `d += dx`.
    fn advance(&mut self) {
        let (work, state) = (&mut self.cache.work, &mut self.motion.state);
        for (p, x) in state.p.iter_mut().zip(&work.x) {
            *p += *x;
        }
        let mut done = 0.0;
        for ((d, dx), f) in state.d.iter_mut().zip(&work.dx).zip(&self.motion.external) {
            *d += *dx;
            done += dx.as_f64() * f.as_f64();
        }
        work.work += done;
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
        let unit = self.matrix_unit(c, c * c);
        let of_mass = self.material.lumped.mass.unit / unit;
        let clamped = self.forces(Some(c * c / unit));
        let work = &mut self.cache.work;
        let of_force = c * c * work.force_unit / unit;
        for (i, g) in work.g.iter_mut().enumerate() {
            let momentum =
                of_mass * self.material.lumped.mass.at(i).as_f64() * self.motion.state.w[i].as_f64();
            *g = T::from_f64(2.0 * (c * momentum + of_force * work.force[i].as_f64()));
        }
        self.aim(2.0 * c * c / unit, 1.0, 0.0);
        let first = self.solve_step(c, c * c, [2.0 * c, 0.0])?;
        let rate = |x: T, v: T| T::from_f64(x.as_f64() / c - v.as_f64());
        let (work, state) = (&mut self.cache.work, &mut self.motion.state);
        for (v, x) in state.v.iter_mut().zip(&work.x) {
            *v = rate(*x, *v);
        }
        for (w, dx) in state.w.iter_mut().zip(&work.dx) {
            *w = rate(*dx, *w);
        }
        self.advance();
        std::mem::swap(&mut self.cache.work.first_x, &mut self.cache.work.x);
        std::mem::swap(&mut self.cache.work.first_dx, &mut self.cache.work.dx);
        // The factor may have been renewed, in another unit.
        let unit = self.matrix_unit(c, c * c);
        let of_mass = self.material.lumped.mass.unit / unit;
        let of_damping = c * self.material.lumped.damping.unit / unit;
        let clamped = clamped.max(self.forces(Some(c * c / unit)));
        let work = &mut self.cache.work;
        let of_force = c * c * work.force_unit / unit;
        for (i, g) in work.g.iter_mut().enumerate() {
            let m = of_mass * self.material.lumped.mass.at(i).as_f64();
            let damping = of_damping * self.material.lumped.damping.at(i).as_f64();
            let velocity = (1.0 + beta) * self.motion.state.w[i].as_f64() - beta * work.before.w[i].as_f64();
            let first = beta * work.first_dx[i].as_f64();
            *g = T::from_f64(c * (m * velocity) + (m + damping) * first + of_force * work.force[i].as_f64());
        }
        self.aim(c * c / unit, 1.0, 0.0);
        let second = self.solve_step(c, c * c, [c, beta])?;
        let error = self.tr_bdf2_finish(dt, gamma, beta, c);
        Ok((first.and(second), clamped, Some(error)))
    }

    /// Velocities and positions after the second stage, and the error: the difference to the third-order companion
    /// \[Hosea96\], root mean square over the
    /// samples.
    fn tr_bdf2_finish(&mut self, dt: f64, gamma: f64, beta: f64, c: f64) -> f64 {
        let w = std::f64::consts::SQRT_2 / 4.0;
        let difference = [
            w - (1.0 - w) / 3.0,
            w - (3.0 * w + 1.0) / 3.0,
            gamma / 2.0 - gamma / 6.0,
        ];
        let (work, state) = (&self.cache.work, &mut self.motion.state);
        let rate = |x: T, first: T| T::from_f64((x.as_f64() - beta * first.as_f64()) / c);
        for ((v, x), first) in state.v.iter_mut().zip(&work.x).zip(&work.first_x) {
            *v = rate(*x, *first);
        }
        let mut error = 0.0;
        for (i, v) in state.w.iter_mut().enumerate() {
            let after = rate(work.dx[i], work.first_dx[i]);
            let rates = [work.before.w[i], *v, after];
            let one: f64 = difference.iter().zip(rates).map(|(e, w)| e * w.as_f64()).sum();
            error += (dt * one).powi(2);
            *v = after;
        }
        self.advance();
        (error / self.motion.base.len() as f64).sqrt()
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
