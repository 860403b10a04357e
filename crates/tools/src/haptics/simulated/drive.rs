//! What a rig ticks.

use glam::DVec3;

use super::super::gates::Trip;
use super::super::{DeviceError, Felt, Obstacle, Pose, Reading, Renderer, Servo};

/// From what a device told to what is sent to it.
pub trait Drive {
    /// One tick, `dt` seconds after the one before, with an obstacle that is `age` seconds old.
    fn tick(
        &mut self,
        told: Result<&Reading, &DeviceError>,
        obstacle: &dyn Obstacle,
        age: f64,
        dt: f64,
    ) -> Felt;

    /// The device did not take what was sent.
    fn refused(&mut self, why: &DeviceError) {
        let _ = why;
    }
}

/// A renderer and the limit of a device's force, without any gate: what stability is asked of first.
pub struct Bare {
    /// The renderer.
    pub renderer: Box<dyn Renderer>,
    /// Largest force, N.
    pub force: f64,
}

impl Drive for Bare {
    /// Nothing where nothing was told.
    fn tick(
        &mut self,
        told: Result<&Reading, &DeviceError>,
        obstacle: &dyn Obstacle,
        _: f64,
        dt: f64,
    ) -> Felt {
        match told {
            Ok(reading) if reading.pose.is_finite() => {
                let mut felt = self.renderer.tick(obstacle, &reading.pose, dt);
                felt.force = felt.force.clamp_length_max(self.force);
                felt
            }
            _ => Felt::nothing(&Pose::at(DVec3::ZERO)),
        }
    }
}

impl Drive for Servo {
    /// Force and torque are those that the gates let through, in the axes of the device; the proxy is in the scene.
    fn tick(
        &mut self,
        told: Result<&Reading, &DeviceError>,
        obstacle: &dyn Obstacle,
        age: f64,
        dt: f64,
    ) -> Felt {
        let tick = self.tick(told, obstacle, age, dt);
        Felt {
            force: tick.wrench.force,
            torque: tick.wrench.torque,
            ..tick.felt
        }
    }

    fn refused(&mut self, why: &DeviceError) {
        self.trip(match why {
            DeviceError::Gone(_) => Trip::Gone,
            DeviceError::Silent(_) | DeviceError::Refused { .. } => Trip::Writer,
        });
    }
}
