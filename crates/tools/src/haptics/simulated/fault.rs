//! What breaks.

use glam::DVec3;

/// A fault of a device while it lasts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// When it begins, s.
    pub from: f64,
    /// When it is over, s.
    pub until: f64,
    /// What it is.
    pub kind: FaultKind,
}

/// What a fault does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultKind {
    /// The pose is not a number.
    NotANumber,
    /// No new pose is told: the last one grows old.
    Frozen,
    /// The pose is told so much beside the true one, mm.
    Jump(DVec3),
    /// The device is gone; so is its current.
    Unplugged,
    /// Forces sent do not arrive, and the last one stays.
    WriterStalls,
}
