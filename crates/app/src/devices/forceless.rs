//! What devices can do that push nobody.

use tools::haptics::Abilities;

/// Damping that stands for no loop, N s/m: what is shown as force comes back to nobody, so no stiffness shakes the device.
const DAMPING: f64 = 20.0;

/// A device without force that tells its smallest way, mm, the time between two poses, s, and half the width of its room, mm.
pub fn abilities(name: &str, resolution: f64, period: f64, reach: f64) -> Abilities {
    Abilities {
        name: name.into(),
        force: 0.0,
        continuous_force: 0.0,
        torque: 0.0,
        damping: DAMPING,
        stiffness: f64::INFINITY,
        resolution,
        period,
        delay: 0.0,
        reach,
    }
}
