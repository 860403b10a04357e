//! What a device is and tells, whatever drives it.

use glam::DVec3;

use super::Pose;

/// What a device can do. Lengths and forces are the device's own, not those of a scene that is shown larger.
#[derive(Clone, Debug, PartialEq)]
pub struct Abilities {
    /// Name for people.
    pub name: String,
    /// Largest force, N; 0 of devices that only tell where they are.
    pub force: f64,
    /// Force that it holds for ever, N, 0 if unknown.
    pub continuous_force: f64,
    /// Largest torque, N mm; 0 without.
    pub torque: f64,
    /// Damping of its own, N s/m.
    pub damping: f64,
    /// Largest stiffness that its makers allow, N/m; infinite if unknown.
    pub stiffness: f64,
    /// Smallest way that it tells, mm.
    pub resolution: f64,
    /// Time between two poses, s.
    pub period: f64,
    /// Time from a pose to the force for it, beyond the half period that a held force is late, s.
    pub delay: f64,
    /// Half the width of the room in which it moves, mm.
    pub reach: f64,
}

/// What a device told last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Where the hand is, in the device's room.
    pub pose: Pose,
    /// Buttons that are down, from the lowest bit.
    pub buttons: u32,
    /// Time since it was told, s.
    pub age: f64,
}

/// Why a device is of no use.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DeviceError {
    /// It was unplugged, or never there.
    #[error("{0} is gone; plug it in again")]
    Gone(String),
    /// It has not told where it is yet.
    #[error("{0} has not told where it is yet")]
    Silent(String),
    /// The system refuses it.
    #[error("{device} cannot be opened: {why}")]
    Refused {
        /// Which.
        device: String,
        /// The reason, with what helps.
        why: String,
    },
}

/// A device as the haptic thread sees it: nothing here waits, allocates or locks. Dropped, it leaves the hand without force.
pub trait Device: Send {
    /// What it can do.
    fn abilities(&self) -> &Abilities;

    /// What it told last.
    ///
    /// # Errors
    /// [`DeviceError`].
    fn read(&mut self) -> Result<Reading, DeviceError>;

    /// Sets the force on the hand, N, and the torque, N mm, until the next call.
    ///
    /// # Errors
    /// [`DeviceError`].
    fn send(&mut self, force: DVec3, torque: DVec3) -> Result<(), DeviceError>;
}
