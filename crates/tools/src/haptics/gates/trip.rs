//! Why all force was taken away.

use std::fmt;

/// Why all force was taken away until the user arms again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Trip {
    /// A number is not finite.
    NotFinite = 1,
    /// The hand moved, or jumped, faster than it may.
    TooFast = 2,
    /// The device has not told where it is for too long.
    Stale = 3,
    /// The device is gone.
    Gone = 4,
    /// What is sent does not reach the device.
    Writer = 5,
    /// Time did not go on.
    Clock = 6,
}

impl fmt::Display for Trip {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "a number was not finite",
            Self::TooFast => "the hand moved too fast",
            Self::Stale => "the device did not tell where it is",
            Self::Gone => "the device was gone",
            Self::Writer => "the device did not take the force",
            Self::Clock => "time did not go on",
        })
    }
}
