//! What happened in a tick, in bits.

use std::ops::BitOrAssign;

use super::super::Contact;
use super::{Stage, Trip};

/// What happened in a tick, in bits. The lowest three are the [`Contact`], the next three the [`Stage`], the next three the [`Trip`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status(pub u32);

impl Status {
    /// The pose was older than two periods.
    pub const LATE_POSE: Self = Self(1 << 9);
    /// The tick came after the last force had begun to fade.
    pub const STALLED: Self = Self(1 << 10);
    /// Passivity control damped.
    pub const PASSIVITY: Self = Self(1 << 11);
    /// The force, or the torque, was larger than it may be.
    pub const CLAMPED: Self = Self(1 << 12);
    /// It changed faster than it may.
    pub const SLEWED: Self = Self(1 << 13);
    /// The device is warm: it gives less than it can.
    pub const WARM: Self = Self(1 << 14);
    /// The simulation was not heard of for long: the force fades, or comes back.
    pub const OLD_SNAPSHOT: Self = Self(1 << 15);
    /// Nothing was rendered: the device told nothing of use.
    pub const BLIND: Self = Self(1 << 16);

    /// Whether all bits of another are among its.
    pub fn has(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// The contact.
    pub(super) fn of(contact: Contact) -> Self {
        Self(match contact {
            Contact::Free => 0,
            Contact::Slides => 1,
            Contact::Sticks => 2,
            Contact::Attracted => 3,
            Contact::Inside => 4,
        })
    }

    /// The stage, and why there is no force.
    pub(super) fn at(stage: Stage) -> Self {
        Self(match stage {
            Stage::Disarmed => 0,
            Stage::Homing => 1 << 3,
            Stage::Waiting { .. } => 2 << 3,
            Stage::Ramping { .. } => 3 << 3,
            Stage::Live => 4 << 3,
            Stage::Tripped(why) => 5 << 3 | (why as u32) << 6,
        })
    }

    /// The contact that it tells of.
    pub fn contact(self) -> Contact {
        match self.0 & 7 {
            0 => Contact::Free,
            1 => Contact::Slides,
            2 => Contact::Sticks,
            3 => Contact::Attracted,
            _ => Contact::Inside,
        }
    }

    /// Why there is no force, if something took it away.
    pub fn trip(self) -> Option<Trip> {
        [
            Trip::NotFinite,
            Trip::TooFast,
            Trip::Stale,
            Trip::Gone,
            Trip::Writer,
            Trip::Clock,
        ]
        .into_iter()
        .find(|&why| why as u32 == self.0 >> 6 & 7)
    }

    /// Whether the whole force comes through.
    pub fn is_live(self) -> bool {
        self.0 >> 3 & 7 == 4
    }
}

impl BitOrAssign for Status {
    fn bitor_assign(&mut self, other: Self) {
        self.0 |= other.0;
    }
}
