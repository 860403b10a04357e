//! The latest value from one thread to another, without waiting and without locks.

use std::sync::atomic::{AtomicU64, Ordering, fence};

/// Places among which the writer changes. A reader is disturbed only if the writer comes round while it copies.
const SLOTS: usize = 4;

/// Times that a reader begins again before it is content with what it had.
const TRIES: usize = 4;

/// Holds the latest `N` words that one thread put there. Only one thread may put.
///
/// Several threads may get, which the exchange of the three threads does not allow: what a device told is looked at by the haptic
/// thread and by the one that writes. A writer that was stopped in the middle of a put disturbs nobody: it is in a slot that is not announced yet. So a reader
/// takes a bounded number of steps, whatever the other does.
#[derive(Debug)]
pub struct Mailbox<const N: usize> {
    /// Number of the last put, from 1; 0 before the first.
    newest: AtomicU64,
    slots: [Slot<N>; SLOTS],
}

#[derive(Debug)]
struct Slot<const N: usize> {
    /// Number of the put whose words these are; 0 while they change.
    number: AtomicU64,
    words: [AtomicU64; N],
}

impl<const N: usize> Default for Mailbox<N> {
    fn default() -> Self {
        let word = || AtomicU64::new(0);
        let slot = || Slot {
            number: word(),
            words: std::array::from_fn(|_| word()),
        };
        Self {
            newest: word(),
            slots: std::array::from_fn(|_| slot()),
        }
    }
}

impl<const N: usize> Mailbox<N> {
    /// Replaces the value.
    pub fn put(&self, words: [u64; N]) {
        let number = self.newest.load(Ordering::Relaxed) + 1;
        let slot = &self.slots[number as usize % SLOTS];
        slot.number.store(0, Ordering::Relaxed);
        // Who reads one of the new words also sees that the slot changes.
        fence(Ordering::Release);
        for (place, word) in slot.words.iter().zip(words) {
            place.store(word, Ordering::Relaxed);
        }
        slot.number.store(number, Ordering::Release);
        self.newest.store(number, Ordering::Release);
    }

    /// The latest value and its number, which grows with every put. None before the first put, and where the other thread put
    /// several while this one copied, each time that it tried: whoever asks keeps what they had.
    pub fn get(&self) -> Option<(u64, [u64; N])> {
        for _ in 0..TRIES {
            let number = self.newest.load(Ordering::Acquire);
            if number == 0 {
                return None;
            }
            let slot = &self.slots[number as usize % SLOTS];
            if slot.number.load(Ordering::Acquire) != number {
                continue;
            }
            let words = std::array::from_fn(|i| slot.words[i].load(Ordering::Relaxed));
            fence(Ordering::Acquire);
            if slot.number.load(Ordering::Relaxed) == number {
                return Some((number, words));
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;

    #[test]
    fn the_latest_of_several_is_got_as_often_as_one_asks() {
        let mailbox = Mailbox::<2>::default();
        assert_eq!(mailbox.get(), None);
        for n in 1..=9 {
            mailbox.put([n, n * n]);
        }
        assert_eq!(mailbox.get(), Some((9, [9, 81])));
        assert_eq!(mailbox.get(), Some((9, [9, 81])));
    }

    #[test]
    fn no_value_is_torn_and_none_comes_after_a_later_one() {
        const COUNT: u64 = 200_000;
        let (mailbox, is_done) = (Mailbox::<8>::default(), AtomicBool::new(false));
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for n in 1..=COUNT {
                    mailbox.put(std::array::from_fn(|i| {
                        n.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ i as u64
                    }));
                }
                is_done.store(true, Ordering::Release);
            });
            let mut last = 0;
            while last < COUNT {
                let was_done = is_done.load(Ordering::Acquire);
                let Some((number, words)) = mailbox.get() else {
                    continue;
                };
                assert!(number >= last);
                for (i, word) in words.iter().enumerate() {
                    assert_eq!(*word, number.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ i as u64);
                }
                last = number;
                assert!(!was_done || last == COUNT);
            }
        });
    }
}
