//! What is kept of a tick.

use super::gates::Status;

/// What is kept of a tick: 80 bytes, without padding. Lengths are those of the scene, forces those on the hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct TickRecord {
    /// Number of the tick.
    pub tick: u64,
    /// What happened.
    pub status: Status,
    /// Buttons that are down.
    pub buttons: u32,
    /// Where the hand is, mm.
    pub hand: [f32; 3],
    /// Where the proxy is, mm.
    pub proxy: [f32; 3],
    /// What was sent, N.
    pub force: [f32; 3],
    /// Length of the force that was wished, N.
    pub wished: f32,
    /// Energy that the hand has put in and not got back, J.
    pub energy: f32,
    /// Time since the tick before, s.
    pub dt: f32,
    /// Torque that was wished, N mm, in the axes of the force: few devices give any.
    pub torque: [f32; 3],
    /// Length of the torque that was sent, N mm.
    pub torque_sent: f32,
}

const _: () = assert!(size_of::<TickRecord>() == 80);
