//! What the simulation shows to the other threads.

use std::sync::Arc;

use glam::DVec3;
use tools::haptics::{Obstacle, Touch};

/// What may be touched at one moment, with a number that tells whether it is whole.
pub trait Snapshot: Obstacle {
    /// A number that follows from all that it tells, or from a fair part.
    fn checksum(&self) -> u64;
}

/// Nothing to touch.
pub struct Nothing;

impl Obstacle for Nothing {
    fn distance(&self, _: DVec3) -> (f64, DVec3) {
        (f64::INFINITY, DVec3::Z)
    }

    fn finest(&self) -> f64 {
        f64::INFINITY
    }
}

impl Snapshot for Nothing {
    fn checksum(&self) -> u64 {
        0
    }
}

/// What is shown from one step of the simulation to the next: what was and what comes, so that an edit is a motion.
#[derive(Clone)]
pub struct Shown {
    /// Counts from 1; 0 before anything is shown.
    pub sequence: u64,
    /// What was.
    pub from: Arc<dyn Snapshot>,
    /// What comes.
    pub to: Arc<dyn Snapshot>,
    /// Time over which one becomes the other, s.
    pub over: f64,
    /// Of all of these.
    check: u64,
}

impl Shown {
    /// Nothing yet.
    pub fn nothing() -> Self {
        let nothing: Arc<dyn Snapshot> = Arc::new(Nothing);
        Self::new(0, nothing.clone(), nothing, 0.0)
    }

    /// What is shown with a number.
    pub fn new(sequence: u64, from: Arc<dyn Snapshot>, to: Arc<dyn Snapshot>, over: f64) -> Self {
        let mut shown = Self {
            sequence,
            from,
            to,
            over,
            check: 0,
        };
        shown.check = shown.sum();
        shown
    }

    /// Whether it is as it was made: no word of it belongs to another.
    pub fn is_whole(&self) -> bool {
        self.check == self.sum()
    }

    fn sum(&self) -> u64 {
        let words = [
            self.sequence,
            self.from.checksum(),
            self.to.checksum(),
            self.over.to_bits(),
        ];
        words.into_iter().fold(0, mixed)
    }

    /// The same some seconds after it was first seen.
    pub fn after(&self, seconds: f64) -> Moment<'_> {
        let share = match seconds < self.over {
            true => seconds / self.over,
            false => 1.0,
        };
        Moment { shown: self, share }
    }
}

/// What is shown at a moment.
pub struct Moment<'a> {
    shown: &'a Shown,
    share: f64,
}

impl Obstacle for Moment<'_> {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        if self.share >= 1.0 {
            return self.shown.to.distance(p);
        }
        let (was, was_gradient) = self.shown.from.distance(p);
        let (comes, gradient) = self.shown.to.distance(p);
        // Beyond one of them there is no way between: only what is nearer is known.
        if !(was.is_finite() && comes.is_finite()) {
            return if was < comes {
                (was, was_gradient)
            } else {
                (comes, gradient)
            };
        }
        (
            was + self.share * (comes - was),
            was_gradient + self.share * (gradient - was_gradient),
        )
    }

    fn finest(&self) -> f64 {
        self.shown.from.finest().min(self.shown.to.finest())
    }

    fn touch(&self, p: DVec3) -> Touch {
        self.shown.to.touch(p)
    }
}

/// A sum of 64 bits with one more word, in which every bit of the words counts (FNV-1a, word by word).
pub fn mixed(sum: u64, word: u64) -> u64 {
    (sum ^ word).wrapping_mul(0x0100_0000_01b3).rotate_left(29)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Plane(f64);

    impl Obstacle for Plane {
        fn distance(&self, p: DVec3) -> (f64, DVec3) {
            (p.z - self.0, DVec3::Z)
        }

        fn finest(&self) -> f64 {
            1.0
        }
    }

    impl Snapshot for Plane {
        fn checksum(&self) -> u64 {
            self.0.to_bits()
        }
    }

    #[test]
    fn an_edit_comes_as_a_motion() {
        let shown = Shown::new(1, Arc::new(Plane(0.0)), Arc::new(Plane(-0.1)), 0.03);
        let height = |t| shown.after(t).distance(DVec3::ZERO).0;
        assert_eq!([height(0.0), height(0.03), height(1.0)], [0.0, 0.1, 0.1]);
        assert!((height(0.015) - 0.05).abs() < 1e-12);
        // From nothing on there is no way: it is there at once, and gone at the end only.
        let first = Shown::new(1, Arc::new(Nothing), Arc::new(Plane(0.0)), 0.03);
        assert_eq!(first.after(0.0).distance(DVec3::Z).0, 1.0);
    }

    #[test]
    fn a_word_of_another_shows() {
        let shown = Shown::new(7, Arc::new(Plane(0.0)), Arc::new(Plane(-0.1)), 0.03);
        assert!(shown.is_whole() && Shown::nothing().is_whole());
        let other = Shown::new(8, Arc::new(Plane(0.0)), Arc::new(Plane(-0.2)), 0.03);
        let torn = [
            Shown {
                sequence: 8,
                ..shown.clone()
            },
            Shown {
                to: other.to.clone(),
                ..shown.clone()
            },
            Shown {
                from: other.to.clone(),
                ..shown.clone()
            },
            Shown {
                over: 0.02,
                ..shown.clone()
            },
        ];
        assert!(torn.iter().all(|torn| !torn.is_whole()));
    }
}
