use bspline::Real;

use super::{Integrator, StepReport};
use crate::patch::{Patch, PatchError};
use crate::springs::EnergyChange;

/// Bounds of an adaptive step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptiveOptions {
    /// Error of the densities that one step may make, root mean square.
    pub tolerance: f64,
    /// Shortest step, in seconds; taken whatever its error. Only a step that was asked for shorter is.
    pub shortest: f64,
    /// Longest step, in seconds.
    pub longest: f64,
    /// Share of the energy that a step may create: what it holds more than before, less the work, with at least what its
    /// damping took (`ΔdᵀDΔd/Δt`, which no path of the same ends goes below).
    pub energy_gain: f64,
    /// Acceleration of a density beyond which the next step is half as long as this one [Hua04 §7]; `None` leaves it to the
    /// error.
    pub acceleration: Option<f64>,
}

/// What an adaptive step did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptiveReport {
    /// The step that was kept.
    pub step: StepReport,
    /// Steps that were tried and taken back.
    pub rejected: usize,
    /// What to try next, in seconds, between the shortest and the longest.
    pub next_dt: f64,
    /// Energy that the step created, relative to the largest of the energies before and after and the work; below 0 where
    /// the scheme damps. More than asked for only of a step that could not be shorter, and by what rounding makes.
    pub gained: f64,
}

impl AdaptiveOptions {
    /// # Errors
    /// [`PatchError::Adaptive`] for bounds that no step can keep.
    pub fn check(&self) -> Result<(), PatchError> {
        let positive = [
            ("the tolerance", self.tolerance),
            ("the shortest step", self.shortest),
            ("the longest step", self.longest),
            ("the acceleration", self.acceleration.unwrap_or(1.0)),
        ];
        let refused = |what, value, needed: &str| {
            let needed = needed.to_owned();
            Err(PatchError::Adaptive { what, value, needed })
        };
        if let Some((what, value)) = positive.into_iter().find(|(_, v)| !(v.is_finite() && *v > 0.0)) {
            return refused(what, value, "positive and finite");
        }
        if self.energy_gain.is_nan() || self.energy_gain < 0.0 {
            return refused(
                "the share of energy that a step may create",
                self.energy_gain,
                "0 or above",
            );
        }
        if self.shortest > self.longest {
            let needed = format!("at most the longest step, {} s", self.longest);
            return refused("the shortest step", self.shortest, &needed);
        }
        Ok(())
    }
}

impl<T: Real> Patch<T> {
    /// One step of TR-BDF2 of at most `dt`, shortened until its estimated error and its balance of energy keep to the
    /// options. It is never longer than `dt`, also where that is below the shortest step.
    ///
    /// # Errors
    /// [`PatchError::Adaptive`], and as [`step`](Patch::step).
    pub fn adaptive_step(
        &mut self,
        dt: f64,
        options: &AdaptiveOptions,
    ) -> Result<AdaptiveReport, PatchError> {
        options.check()?;
        if !(dt.is_finite() && dt > 0.0) {
            return Err(PatchError::TimeStep { dt });
        }
        let before = self.energy().total();
        let shortest = options.shortest.min(dt);
        let mut dt = dt.min(options.longest);
        let mut rejected = 0;
        loop {
            let step = match self.try_step(Integrator::TrBdf2, dt) {
                // A shorter one may stay within the range.
                Err(PatchError::Overflow { .. } | PatchError::Solve(_)) if dt > shortest => {
                    rejected += 1;
                    dt = (0.5 * dt).max(shortest);
                    continue;
                }
                step => step?,
            };
            let error = step.error.unwrap_or(0.0);
            let change = self.energy_change();
            let after = before + change.energy;
            let scale = before.max(after).max(step.work.abs()).max(f64::MIN_POSITIVE);
            let gained = change.energy - step.work + self.least_dissipation(dt);
            // NaN is not balanced.
            let balanced = gained <= options.energy_gain * scale + change.rounding;
            let fast = options.acceleration.is_some_and(|a| self.acceleration(dt) > a);
            // Of a method of second order the error of a step falls with its cube.
            let factor = 0.9 * libm::cbrt(options.tolerance / error);
            let accepted = error <= options.tolerance && balanced;
            if accepted || dt <= shortest {
                self.flow(dt);
                let next = dt * if fast { 0.5 } else { factor.clamp(0.2, 2.0) };
                return Ok(AdaptiveReport {
                    step,
                    rejected,
                    gained: gained / scale,
                    next_dt: next.clamp(options.shortest, options.longest),
                });
            }
            self.take_back();
            rejected += 1;
            let factor = if !balanced || !error.is_finite() {
                0.5
            } else {
                factor.clamp(0.1, 0.9)
            };
            dt = (dt * factor).max(shortest);
        }
    }

    /// What the energy grew by over the last step of TR-BDF2, from the increments. The difference of the energies before
    /// and after would hold the rounding of the densities, which may stretch the springs by more than the step does.
    fn energy_change(&mut self) -> EnergyChange {
        let work = &mut self.cache.work;
        work.moved.clear();
        let both = work.first_dx.iter().zip(&work.dx);
        work.moved.extend(both.map(|(a, b)| a.as_f64() + b.as_f64()));
        let work = &self.cache.work;
        let (before, moved) = (&work.before, &work.moved);
        let mut sum = self.material.network.energy_change(&before.d, moved);
        let (mut kinetic, mut swing) = (0.0, 0.0);
        for (i, (now, then)) in self.motion.state.w.iter().zip(&before.w).enumerate() {
            let (m, now, then) = (
                self.material.lumped.mass.at(i).as_f64(),
                now.as_f64(),
                then.as_f64(),
            );
            kinetic += m * (now - then) * (now + then);
            swing += m * now.abs() * (now.abs() + then.abs());
        }
        sum.energy += 0.5 * self.material.lumped.mass.unit * kinetic;
        sum.rounding += T::UNIT_ROUND_OFF * self.material.lumped.mass.unit * swing;
        let ground = &self.material.lumped.ground;
        if ground.unit > 0.0 {
            let (mut held, mut size) = (0.0, 0.0);
            for (i, (d, moved)) in before.d.iter().zip(moved).enumerate() {
                let (g, d, base) = (ground.at(i).as_f64(), d.as_f64(), self.motion.anchor[i].as_f64());
                held += g * moved * (0.5 * moved + (d - base));
                size += g * moved.abs() * (d.abs() + base.abs());
            }
            let unit = self.material.network.law().scale().powi(2) * ground.unit;
            sum.energy += unit * held;
            sum.rounding += T::UNIT_ROUND_OFF * unit * size;
        }
        let of_coefficient = |i: usize| work.first_x[i].as_f64() + work.x[i].as_f64();
        sum.energy += self.constraint_energy_change(&before.p, of_coefficient);
        // Both stages round, forces as well as densities.
        sum.rounding *= 4.0;
        sum
    }

    /// `ΔdᵀDΔd/Δt`, what damping takes at least from the last step to here.
    fn least_dissipation(&self, dt: f64) -> f64 {
        let terms = self.cache.work.moved.iter().enumerate();
        let sum: f64 = terms
            .map(|(i, change)| self.material.lumped.damping.value(i) * change * change)
            .sum();
        sum / dt
    }

    /// Largest mean acceleration of a density over the last step.
    fn acceleration(&self, dt: f64) -> f64 {
        let rates = self.motion.state.w.iter().zip(&self.cache.work.before.w);
        rates
            .map(|(now, then)| (*now - *then).as_f64().abs() / dt)
            .fold(0.0, f64::max)
    }
}
