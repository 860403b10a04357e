use bspline::Real;
use serde::{Deserialize, Serialize};

use super::Law;
use super::law::length;
use super::network::{SpringNetwork, rows_of};
use crate::patch::{Patch, PatchError, finite};

/// Whether springs keep their rest lengths.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Plasticity<T> {
    /// They do.
    #[default]
    Elastic,
    /// All follow the present lengths at a rate per second: by `1 - e^{-λΔt}` of what is missing after a step of `Δt`.
    Clay {
        /// `λ`.
        rate: f64,
    },
    /// The same where a tool works: the rate of a spring is multiplied by the mean weight of its samples.
    Kernel {
        /// `λ` where the weight is 1.
        rate: f64,
        /// A weight from 0 to 1 per sample, z fastest.
        weights: Vec<T>,
    },
}

impl<T: Real> Patch<T> {
    /// Whether springs keep their rest lengths from the next step on.
    ///
    /// # Errors
    /// [`PatchError::Rate`] of a negative or infinite rate, [`PatchError::Weight`] of a weight that is not between 0 and
    /// 1, [`PatchError::Length`]; all stays as it was then.
    pub fn set_plasticity(&mut self, plasticity: Plasticity<T>) -> Result<(), PatchError> {
        if let Plasticity::Clay { rate } | Plasticity::Kernel { rate, .. } = &plasticity
            && !(rate.is_finite() && *rate >= 0.0)
        {
            return Err(PatchError::Rate { rate: *rate });
        }
        if let Plasticity::Kernel { weights, .. } = &plasticity {
            finite("weight", weights, self.motion.base.len())?;
            let outside = |w: &T| !(0.0..=1.0).contains(&w.as_f64());
            if let Some(index) = weights.iter().position(outside) {
                let value = weights[index].as_f64();
                return Err(PatchError::Weight { index, value });
            }
        }
        self.material.plasticity = plasticity;
        Ok(())
    }

    /// Whether springs keep their rest lengths.
    pub fn plasticity(&self) -> &Plasticity<T> {
        &self.material.plasticity
    }

    /// Lets the rest lengths follow for `dt` seconds.
    pub(crate) fn flow(&mut self, dt: f64) {
        match &self.material.plasticity {
            Plasticity::Elastic => (),
            Plasticity::Clay { rate } => self
                .material
                .network
                .relax(&self.motion.state.d, -libm::expm1(-rate * dt)),
            Plasticity::Kernel { rate, weights } => {
                self.material
                    .network
                    .relax_under(&self.motion.state.d, weights, rate * dt);
            }
        }
    }
}

/// `√(L² - h²)`, 0 where `L` is shorter.
fn leg<T: Real>(h2: T, length: T) -> T {
    let h = h2.sqrt();
    ((length - h).max(T::zero())).sqrt() * (length + h).sqrt()
}

impl<T: Real> SpringNetwork<T> {
    /// Moves all rest lengths towards the present ones by the share `share`, `0..=1`; no spring gains energy by it.
    ///
    /// # Panics
    /// If `d` has another length than the lattice.
    pub fn relax(&mut self, d: &[T], share: f64) {
        let share = T::from_f64(share);
        self.relax_by(d, |_, _| share);
    }

    /// The same by `1 - e^{-aw}`, `w` the mean of the weights of a spring's samples.
    ///
    /// # Panics
    /// If `d` or the weights have another length than the lattice.
    pub fn relax_under(&mut self, d: &[T], weights: &[T], a: f64) {
        assert_eq!(weights.len(), d.len(), "weights");
        self.relax_by(d, |i, j| {
            let w = 0.5 * (weights[i] + weights[j]).as_f64();
            T::from_f64(-libm::expm1(-a * w))
        });
    }

    fn relax_by(&mut self, d: &[T], share: impl Fn(usize, usize) -> T) {
        assert_eq!(d.len(), self.dims.iter().product::<usize>(), "samples");
        let sigma = T::from_f64(self.sigma());
        let four_d = matches!(self.law, Law::FourD { .. });
        let scale = &self.rest.scale;
        let springs = self.springs.iter().zip(&self.lengths);
        for (rest, (spring, h2)) in self.rest.differences.iter_mut().zip(springs) {
            let h2 = T::from_f64(*h2);
            rows_of(self.dims, spring.direction.step, |from, to, count| {
                for z in 0..count {
                    let share = share(from + z, to + z);
                    let now = sigma * (d[from + z] - d[to + z]);
                    let rest = &mut rest[from + z];
                    let s = scale.at(from + z);
                    *rest = if share == T::zero() || s <= T::zero() {
                        *rest
                    } else if four_d {
                        // L₀ follows L and lies the way the spring does. Differences would pass through zero and
                        // stretch a spring that is turned inside out.
                        let before = s * length(h2, *rest);
                        let scaled = (before + share * (length(h2, now) - before)) / s;
                        let size = leg(h2, scaled);
                        if now < T::zero() { -size } else { size }
                    } else {
                        *rest + share * (now / s - *rest)
                    };
                }
            });
        }
    }
}
