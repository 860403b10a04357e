//! What may be touched, while a simulation changes it.

use std::sync::Arc;

use super::super::{Blend, Obstacle, Pose};

/// How a state comes in place of the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// At once.
    Steps,
    /// Over a period of the simulation.
    Blended,
}

type Make<'a> = Box<dyn FnMut(f64, &Pose) -> Arc<dyn Obstacle> + 'a>;

/// An obstacle that is made anew at the rate of a simulation, from its time and where the hand is.
pub struct World<'a> {
    make: Make<'a>,
    /// Hz; 0 for one that stays.
    rate: f64,
    change: Change,
    made: u64,
    since: f64,
    old: Arc<dyn Obstacle>,
    new: Arc<dyn Obstacle>,
}

impl<'a> World<'a> {
    /// One that stays.
    pub fn still(obstacle: impl Obstacle + 'static) -> Self {
        Self::shared(Arc::new(obstacle))
    }

    /// One that stays, and that others have as well.
    pub fn shared(obstacle: Arc<dyn Obstacle>) -> Self {
        let same = Arc::clone(&obstacle);
        Self {
            make: Box::new(move |_, _| Arc::clone(&same)),
            rate: 0.0,
            change: Change::Steps,
            made: 0,
            since: 0.0,
            old: Arc::clone(&obstacle),
            new: obstacle,
        }
    }

    /// One that is made at times 0, 1/rate, 2/rate …, rate in Hz, with the hand where it is.
    pub fn changing(
        rate: f64,
        change: Change,
        start: &Pose,
        mut make: impl FnMut(f64, &Pose) -> Arc<dyn Obstacle> + 'a,
    ) -> Self {
        let first = make(0.0, start);
        Self {
            make: Box::new(make),
            rate,
            change,
            made: 0,
            since: 0.0,
            old: Arc::clone(&first),
            new: first,
        }
    }

    /// Lets time pass up to `now`, s.
    pub(super) fn advance(&mut self, now: f64, hand: &Pose) {
        // A tick's rounding must not put an edit off by a tick.
        let due = ((now + 1e-9) * self.rate).floor() as u64;
        if due > self.made {
            self.made = due;
            self.since = due as f64 / self.rate;
            self.old = std::mem::replace(&mut self.new, (self.make)(self.since, hand));
        }
    }

    /// Shows the obstacle of a time and how old it is, s.
    pub(super) fn show<T>(&self, now: f64, look: impl FnOnce(&dyn Obstacle, f64) -> T) -> T {
        let age = if self.rate > 0.0 {
            (now - self.since).max(0.0)
        } else {
            0.0
        };
        let share = (age * self.rate).min(1.0);
        if self.change == Change::Blended && self.made > 0 && share < 1.0 {
            let blend = Blend {
                from: &*self.old,
                to: &*self.new,
                share,
            };
            look(&blend, age)
        } else {
            look(&*self.new, age)
        }
    }
}
