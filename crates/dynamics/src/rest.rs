//! A patch at rest: how far from it, and making the present shape the one that rests.

use bspline::Real;

use crate::patch::Patch;
use crate::springs::Weights;

impl<T: Real> Patch<T> {
    /// Makes the present densities the ones the patch was cut at, as [`rest_at`](Self::rest_at) does.
    pub fn rest_here(&mut self) {
        let d = std::mem::take(&mut self.motion.state.d);
        self.rest_at(d);
    }

    /// What a patch is that is cut at the densities `d` with the same matter: rest := `d` with rest scale 1, also of the
    /// ground springs, velocity := 0, force := 0, `p` := 0, and nothing left of the solves before. Constraints are let go:
    /// they were made for the field as it was. Matter, springs and plasticity stay.
    ///
    /// No force is left, exactly, so later steps change no bit.
    pub(crate) fn rest_at(&mut self, d: Vec<T>) {
        if !self.constraints().is_empty() {
            self.material.held = None;
            self.material.changes += 1;
        }
        self.cache.begin_again();
        self.material.network.rest_mut().scale = Weights::Constant(T::one());
        self.material.network.rest_at(&d);
        self.motion.base.copy_from_slice(&d);
        self.motion.anchor.copy_from_slice(&d);
        self.motion.state.d = d;
        self.motion.state.p.fill(T::zero());
        self.write_force(|external| external.fill(T::zero()));
        self.stop();
    }

    /// Velocity := 0.
    pub(crate) fn stop(&mut self) {
        self.motion.state.v.fill(T::zero());
        self.motion.state.w.fill(T::zero());
    }

    /// `σ√(2E/M)` with the kinetic energy `E` and the mass `M` of all samples: a length per second.
    pub(crate) fn mean_speed(&self) -> f64 {
        let count = self.motion.state.d.len();
        let masses: f64 = match &self.material.lumped.mass.weights {
            Weights::Constant(m) => m.as_f64() * count as f64,
            Weights::Each(m) => m.iter().map(|m| m.as_f64()).sum(),
        };
        let mass = self.material.lumped.mass.unit * masses;
        self.material.network.law().scale() * (2.0 * self.kinetic() / mass).sqrt()
    }

    /// Largest `σ|Aᵀf|/(AᵀM1)` over the free coefficients: a length per second squared, the acceleration of matter that
    /// hangs together only within the support of a coefficient. `f` are all forces but damping, those of constraint
    /// springs and what hard constraints bear included. NaN if one is.
    pub(crate) fn unbalanced(&mut self) -> f64 {
        let scale = self.material.network.law().scale();
        let larger = |m: f64, a: f64| if m.is_nan() || a <= m { m } else { a };
        scale * self.unbalanced_each().fold(0.0, larger)
    }

    /// The same of each coefficient, without `σ`.
    pub(crate) fn unbalanced_each(&mut self) -> impl Iterator<Item = f64> + '_ {
        self.forces(None);
        let unit = self.cache.work.force_unit;
        let (mut force, mut gathered) = (
            std::mem::take(&mut self.cache.work.force),
            std::mem::take(&mut self.cache.work.first_x),
        );
        if self.lattice().is_square() {
            self.balance(unit, &mut force);
        }
        let lattice = self.cache.solver.lattice();
        lattice.gather(&force, &mut gathered, &mut self.cache.workspace);
        if !lattice.is_square() {
            self.balance(unit, &mut gathered);
        }
        if let Some(mask) = &self.material.mask {
            mask.hold(&mut gathered);
        }
        let work = &mut self.cache.work;
        (work.force, work.first_x) = (force, gathered);
        for (i, m) in work.first_dx.iter_mut().enumerate() {
            *m = self.material.lumped.mass.at(i);
        }
        let lattice = self.cache.solver.lattice();
        lattice.gather(&work.first_dx, &mut work.x, &mut self.cache.workspace);
        let pairs = work.first_x.iter().zip(&work.x);
        let factor = unit / self.material.lumped.mass.unit;
        pairs.map(move |(f, m)| factor * (f.as_f64().abs() / m.as_f64()))
    }

    /// Rates of the samples from those of the coefficients.
    pub(crate) fn sample_velocities(&mut self) {
        let (lattice, state) = (self.cache.solver.lattice(), &mut self.motion.state);
        lattice.sample(&state.v, &mut state.w, &mut self.cache.workspace);
    }
}
