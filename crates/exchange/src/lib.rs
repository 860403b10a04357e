//! The latest value from one thread to another, without waiting.
//!
//! There are three slots: one is the publisher's, one the reader's, and the third is exchanged for one's own: a publisher puts a
//! value into its slot and exchanges that for the third, a reader exchanges its slot for the third where that is fresh. So each
//! takes one atomic step, whatever the other does, and neither ever sees a slot that the other has.
//!
//! ```
//! let (mut publisher, mut reader) = exchange::latest(|| 0);
//! assert!(!reader.refresh());
//! publisher.publish(1);
//! publisher.publish(2);
//! assert!(reader.refresh());
//! assert_eq!(*reader.get(), 2);
//! ```
//!
//! A reader never frees a value: [`Publisher::publish`] gives back an old one that nobody reads any more. So the publisher frees
//! what it made, and a reader that must not wait for the allocator does not.
//!
//! It is a crate of its own so that its model can be checked by loom without building the program anew under `--cfg loom`: `RUSTFLAGS="--cfg
//! loom" cargo test -p exchange --lib --target-dir target/loom`.

mod cell;

#[cfg(not(loom))]
use std::sync::{
    Arc,
    atomic::{AtomicU8, Ordering},
};

#[cfg(loom)]
use loom::sync::{
    Arc,
    atomic::{AtomicU8, Ordering},
};

use cell::UnsafeCell;

/// The bits of [`Slots::third`] that are the number of a slot.
const SLOT: u8 = 0b11;
/// The bit that says that the third slot was published and not yet taken.
const FRESH: u8 = 0b100;

/// The slots of an exchange.
struct Slots<T> {
    slots: [UnsafeCell<T>; 3],
    /// The slot that is neither the publisher's nor the reader's, and whether it is fresh.
    third: AtomicU8,
}

// SAFETY: each slot is at any time the publisher's, the reader's, or the third, and only its owner reaches it. Owners change by an
// exchange that acquires and releases. So a value is reached by one thread at a time, which is what `Send` allows.
unsafe impl<T: Send> Sync for Slots<T> {}

/// The end that publishes.
pub struct Publisher<T> {
    shared: Arc<Slots<T>>,
    own: u8,
}

/// The end that reads.
pub struct Reader<T> {
    shared: Arc<Slots<T>>,
    own: u8,
}

/// The two ends of an exchange. `make` makes three values to begin with, of which the reader has one.
///
/// What is still in the slots is freed by the end that is dropped last.
pub fn latest<T: Send>(mut make: impl FnMut() -> T) -> (Publisher<T>, Reader<T>) {
    let shared = Arc::new(Slots {
        slots: [make(), make(), make()].map(UnsafeCell::new),
        third: AtomicU8::new(1),
    });
    let publisher = Publisher {
        shared: shared.clone(),
        own: 0,
    };
    (publisher, Reader { shared, own: 2 })
}

impl<T> Slots<T> {
    /// Gives a slot away for the third; what that is, and whether it is fresh.
    fn exchange(&self, given: u8) -> (u8, bool) {
        let third = self.third.swap(given, Ordering::AcqRel);
        (third & SLOT, third & FRESH != 0)
    }
}

impl<T> Publisher<T> {
    /// Makes a value the latest. Gives back one that was published before, or was there to begin with, and that nobody reads.
    pub fn publish(&mut self, value: T) -> T {
        let slot = &self.shared.slots[usize::from(self.own)];
        // SAFETY: the slot is the publisher's, of which there is one, and it is borrowed mutably here.
        let old = slot.with_mut(|slot| std::mem::replace(unsafe { &mut *slot }, value));
        self.own = self.shared.exchange(self.own | FRESH).0;
        old
    }
}

impl<T> Reader<T> {
    /// Turns to the latest value; whether that is another than before.
    pub fn refresh(&mut self) -> bool {
        // Without a fresh one the exchange would bring an old one back. Only the publisher sets the bit and only this end takes it
        // away, so it is still there at the exchange.
        if self.shared.third.load(Ordering::Relaxed) & FRESH == 0 {
            return false;
        }
        self.own = self.shared.exchange(self.own).0;
        true
    }

    /// The value that it turned to last.
    pub fn get(&self) -> &T {
        let slot = &self.shared.slots[usize::from(self.own)];
        // SAFETY: the slot is the reader's, of which there is one; it is given away only by `refresh`, which borrows the reader
        // mutably and so ends all borrows from here.
        slot.with(|slot| unsafe { &*slot })
    }
}

#[cfg(all(test, not(loom)))]
mod tests;

#[cfg(all(test, loom))]
mod model;
