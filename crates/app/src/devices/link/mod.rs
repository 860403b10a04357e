//! A device on threads of its own: one reads reports, one writes them, and the haptic thread never waits for either.
//!
//! A write may take 14 ms where it takes 0.3 ms as a rule, and a read waits by its nature. So the reader puts what it heard last
//! into a mailbox, and the writer takes from another what it is to say. What both do in a step is a function of what came and
//! of a clock, so that tests drive them in virtual time without a thread.
//!
//! The hand is left without force when the device is dropped, when it is gone, when it has said nothing for too long, when
//! nobody asked for a force for too long, when any thread of the program panics, and when a signal ends it.

mod device;
mod ends;
mod reader;
mod writer;

#[cfg(test)]
mod tests;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use super::mailbox::Mailbox;
use super::report::Sample;

pub use device::{Linked, Model};
pub use ends::leave_all;
pub use reader::Reader;
pub use writer::{Compose, Out, Writer};

/// Age of what the device told from which there is no force, s, unless it tells less often. Below the 10 ms within which it has to be
/// zero, by a step of the writer.
pub const SILENCE: f64 = 0.009;

/// What the haptic thread wants of a device: numbers whose meaning is the device's, and what they were computed from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Order {
    /// What grows with the force: currents, or shares of the largest force. Zero is no force, of every device.
    pub force: [f64; 3],
    /// Where the device was.
    pub at: [f64; 3],
    /// What the device said of itself in the sample that was answered.
    pub flags: u32,
}

/// What the threads of a device share.
#[derive(Debug, Default)]
pub struct Link {
    samples: Mailbox<6>,
    orders: Mailbox<8>,
    /// Nothing comes from the device any more.
    is_gone: AtomicBool,
    /// The threads are to end.
    must_end: AtomicBool,
    /// The writer has left the device without force.
    has_left: AtomicBool,
    taken: AtomicU64,
    rejected: AtomicU64,
    failed: AtomicU64,
}

/// Reports so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Reports that were taken.
    pub taken: u64,
    /// Reports that were too short, too long or unknown.
    pub rejected: u64,
    /// Writes that failed.
    pub failed: u64,
}

impl Link {
    fn put_sample(&self, sample: &Sample, told: f64) {
        let axes = |i: usize| {
            let half = |n: i32| u64::from(n.cast_unsigned());
            half(sample.axes[2 * i]) | half(sample.axes[2 * i + 1]) << 32
        };
        let last = u64::from(sample.buttons) | u64::from(sample.flags) << 32;
        self.samples
            .put([axes(0), axes(1), axes(2), axes(3), last, told.to_bits()]);
    }

    /// The latest sample, and when it was told.
    fn sample(&self) -> Option<(Sample, f64)> {
        let (_, words) = self.samples.get()?;
        let half = |i: usize| (words[i / 2] >> (32 * (i % 2))) as u32;
        let sample = Sample {
            axes: std::array::from_fn(|i| half(i).cast_signed()),
            buttons: half(8),
            flags: half(9),
        };
        Some((sample, f64::from_bits(words[5])))
    }

    fn put_order(&self, order: &Order, told: f64) {
        let (f, q) = (order.force.map(f64::to_bits), order.at.map(f64::to_bits));
        self.orders.put([
            f[0],
            f[1],
            f[2],
            q[0],
            q[1],
            q[2],
            order.flags.into(),
            told.to_bits(),
        ]);
    }

    /// The latest order, and when it was given.
    fn order(&self) -> Option<(Order, f64)> {
        let (_, words) = self.orders.get()?;
        let order = Order {
            force: std::array::from_fn(|i| f64::from_bits(words[i])),
            at: std::array::from_fn(|i| f64::from_bits(words[3 + i])),
            flags: words[6] as u32,
        };
        Some((order, f64::from_bits(words[7])))
    }

    fn lose(&self) {
        self.is_gone.store(true, Ordering::Release);
    }

    fn is_gone(&self) -> bool {
        self.is_gone.load(Ordering::Acquire)
    }

    fn end(&self) {
        self.must_end.store(true, Ordering::Release);
    }

    fn must_end(&self) -> bool {
        self.must_end.load(Ordering::Acquire)
    }

    fn has_left(&self) -> bool {
        self.has_left.load(Ordering::Acquire)
    }

    fn counts(&self) -> Counts {
        Counts {
            taken: self.taken.load(Ordering::Relaxed),
            rejected: self.rejected.load(Ordering::Relaxed),
            failed: self.failed.load(Ordering::Relaxed),
        }
    }
}
