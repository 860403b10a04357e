//! What a patch holds of energy.

use bspline::Real;

use super::Patch;

/// Energies of a state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// `½ẇᵀMẇ` of the densities' velocities.
    pub kinetic: f64,
    /// Of the density springs.
    pub springs: f64,
    /// Of the ground springs.
    pub ground: f64,
    /// Of the constraint springs.
    pub constraints: f64,
}

impl Energy {
    /// Their sum.
    pub fn total(self) -> f64 {
        self.kinetic + self.springs + self.ground + self.constraints
    }
}

impl<T: Real> Patch<T> {
    /// Energies of the present state.
    pub fn energy(&mut self) -> Energy {
        self.cache.work.force.fill(T::zero());
        let springs = self
            .material
            .network
            .add_forces(&self.motion.state.d, &mut self.cache.work.force);
        Energy {
            kinetic: self.kinetic(),
            springs: springs.energy,
            ground: self.ground_energy(),
            constraints: self.constraint_energy(),
        }
    }

    pub(crate) fn kinetic(&self) -> f64 {
        let w = &self.motion.state.w;
        let terms = w.iter().enumerate();
        let sum: f64 = terms
            .map(|(i, w)| self.material.lumped.mass.at(i).as_f64() * w.as_f64() * w.as_f64())
            .sum();
        0.5 * self.material.lumped.mass.unit * sum
    }

    pub(crate) fn ground_energy(&self) -> f64 {
        if self.material.lumped.ground.unit == 0.0 {
            return 0.0;
        }
        let sigma2 = self.material.network.law().scale().powi(2);
        let away = self.motion.state.d.iter().zip(&self.motion.anchor).enumerate();
        let terms =
            away.map(|(i, (d, b))| self.material.lumped.ground.at(i).as_f64() * (*d - *b).as_f64().powi(2));
        0.5 * sigma2 * self.material.lumped.ground.unit * terms.sum::<f64>()
    }
}
