//! How warm the motors are.

use glam::DVec3;

/// Time in which motors take the warmth of a load, s: windings of small motors, without their housing.
const TIME: f64 = 30.0;
/// Share of the allowed warmth up to which the whole force is given.
const COOL: f64 = 0.5;
/// Share of the continuous force that is left at the allowed warmth.
const LEFT: f64 = 0.95;

/// The I²t limit: a mean of F² with the motors' time, as a share θ of what the continuous force F_c makes,
/// `dθ/dt = (F²/F_c² − θ)/τ`. The largest force falls from that of the device at θ = ½ to 0.95 F_c at θ = 1, on a line: so it has
/// no steps, and under any load it ends below F_c, where `θ = (F/F_c)²` meets that line.
#[derive(Clone, Debug)]
pub struct Thermal {
    force: f64,
    /// 0 if unknown, then there is no limit.
    continuous: f64,
    warmth: f64,
}

impl Thermal {
    /// Of a device that gives a force, and for ever another, N.
    pub fn new(force: f64, continuous: f64) -> Self {
        Self {
            force,
            continuous,
            warmth: 0.0,
        }
    }

    /// A force was on the hand for a time.
    pub fn passed(&mut self, force: DVec3, dt: f64) {
        if self.continuous > 0.0 {
            let load = force.length_squared() / (self.continuous * self.continuous);
            self.warmth += (load - self.warmth) * (dt / TIME).min(1.0);
        }
    }

    /// Largest force now, N.
    pub fn limit(&self) -> f64 {
        let left = LEFT * self.continuous;
        if self.continuous <= 0.0 || left >= self.force {
            return self.force;
        }
        let share = ((self.warmth - COOL) / (1.0 - COOL)).clamp(0.0, 1.0);
        self.force + share * (left - self.force)
    }
}
