//! Where the room of a device lies in a scene.

use glam::{DQuat, DVec3};

use super::Pose;
use super::gates::Wrench;

/// Where the room of a device lies in a scene, and how large: `x_scene = shift + scale · turn · x_device`.
///
/// A force is as large in both. So a stiffness is not: `K_device = scale · K_scene`; and of a torque the lever is scaled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Workspace {
    /// Millimetres of the scene for one of the device.
    pub scale: f64,
    /// From the axes of the device to those of the scene, of length 1.
    pub turn: DQuat,
    /// Where the middle of the device's room lies in the scene, mm.
    pub shift: DVec3,
}

impl Default for Workspace {
    /// As the device has it.
    fn default() -> Self {
        Self {
            scale: 1.0,
            turn: DQuat::IDENTITY,
            shift: DVec3::ZERO,
        }
    }
}

impl Workspace {
    /// A pose of the device in the scene.
    pub fn scene_from_device(&self, device: &Pose) -> Pose {
        Pose {
            at: self.shift + self.scale * (self.turn * device.at),
            turn: self.turn * device.turn,
        }
    }

    /// Force and torque of the scene as the device gives them.
    pub fn device_from_scene(&self, scene: Wrench) -> Wrench {
        let back = self.turn.inverse();
        Wrench {
            force: back * scene.force,
            torque: back * scene.torque / self.scale,
        }
    }
}
