//! Memory for the values of tiles, kept from one fit to the next: a megabyte that is asked for anew costs more than what
//! is done with it, as the system clears it page by page.

use std::cell::RefCell;
use std::ops::{Deref, DerefMut};

use super::tiles::{TILE, Values};

/// Most tiles whose room is kept: 4 MiB.
const MOST: usize = 1024;
/// Most rooms that a thread keeps: as many as a fit uses at once.
const ROOMS: usize = 3;

thread_local! {
    static KEPT: RefCell<Vec<Vec<Values>>> = const { RefCell::new(Vec::new()) };
}

/// Values of some tiles. At first they are what somebody else has left there.
pub(super) struct Room(Vec<Values>);

impl Room {
    /// Of `count` tiles.
    pub fn of(count: usize) -> Self {
        let kept = KEPT.with_borrow_mut(Vec::pop);
        let mut values = kept.unwrap_or_default();
        values.resize(count, [0.0; TILE * TILE * TILE]);
        Self(values)
    }
}

impl Drop for Room {
    fn drop(&mut self) {
        let values = std::mem::take(&mut self.0);
        KEPT.with_borrow_mut(|kept| {
            if kept.len() < ROOMS && values.capacity() <= MOST {
                kept.push(values);
            }
        });
    }
}

impl Deref for Room {
    type Target = [Values];
    fn deref(&self) -> &[Values] {
        &self.0
    }
}

impl DerefMut for Room {
    fn deref_mut(&mut self) -> &mut [Values] {
        &mut self.0
    }
}
