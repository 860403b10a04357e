//! What the simulation shows to the other threads.

use std::sync::Arc;

use glam::DVec3;
use tools::haptics::{Moving, Obstacle, Snapshot, StrokeStep};

/// Places along each edge of a brick whose distances the checksum takes.
const LOOKS: u32 = 4;

/// What is shown from one step of the simulation to the next.
#[derive(Clone)]
pub struct Shown {
    /// Counts from 1; 0 before anything is shown.
    pub sequence: u64,
    /// What may be touched, and what that was before.
    pub snapshot: Arc<Snapshot>,
    /// Time over which one becomes the other, s: an edit is a motion.
    pub over: f64,
    /// What the hand pulls at, if it pulls: newtons and millimetres of the scene.
    pub pulled: Option<StrokeStep>,
    /// Of all of these.
    check: u64,
}

impl Shown {
    /// Nothing yet.
    pub fn nothing() -> Self {
        Self::new(0, Arc::new(Snapshot::empty()), 0.0)
    }

    /// What is shown with a number.
    pub fn new(sequence: u64, snapshot: Arc<Snapshot>, over: f64) -> Self {
        let mut shown = Self {
            sequence,
            snapshot,
            over,
            pulled: None,
            check: 0,
        };
        shown.check = shown.sum();
        shown
    }

    /// With what the hand pulls at.
    pub fn pulling(mut self, pulled: Option<StrokeStep>) -> Self {
        self.pulled = pulled;
        self.check = self.sum();
        self
    }

    /// Whether it is as it was made: no word of it belongs to another.
    pub fn is_whole(&self) -> bool {
        self.check == self.sum()
    }

    /// The same some seconds after it was first seen.
    pub fn after(&self, seconds: f64) -> Moving<'_> {
        let share = match seconds < self.over {
            true => seconds / self.over,
            false => 1.0,
        };
        self.snapshot.moving(share)
    }

    /// A number that follows from all that is told, of bricks from a fair part.
    fn sum(&self) -> u64 {
        let s = &self.snapshot;
        let words = [
            self.sequence,
            self.over.to_bits(),
            s.edit,
            s.heartbeat,
            s.parts().len() as u64,
        ];
        let place = s.at.to_array().map(f64::to_bits);
        let pulled = self.pulled.map_or([0; 2], |p| [p.number, p.force.to_bits()]);
        let mut sum = words.into_iter().chain(place).chain(pulled).fold(0, mixed);
        for part in s.parts() {
            let b = part.shape.world_box();
            let share = |n: u32| f64::from(n) / f64::from(LOOKS - 1);
            for n in 0..LOOKS.pow(3) {
                let [i, j, k] = [n % LOOKS, n / LOOKS % LOOKS, n / LOOKS / LOOKS].map(share);
                let p = b.min + DVec3::new(i, j, k) * (b.max - b.min);
                sum = mixed(sum, part.shape.distance(p).0.to_bits());
            }
        }
        sum
    }
}

/// A sum of 64 bits with one more word, in which every bit of the words counts.
fn mixed(sum: u64, word: u64) -> u64 {
    (sum ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
}

#[cfg(test)]
mod tests {
    use bspline::hierarchical::{HierarchicalSpline, Lattice};
    use glam::DAffine3;
    use tools::haptics::{Demand, SnapshotMaker, Touch, TouchedObject};
    use tools::paint::Layers;

    use super::*;

    /// Ground up to these heights, one after the other.
    fn ground<const N: usize>(heights: [f64; N]) -> [Arc<Snapshot>; N] {
        let mut maker = SnapshotMaker::new(Demand::of_ball(2.0));
        let lattice = Lattice {
            world_from_lattice: DAffine3::IDENTITY,
            cells: [24; 3],
        };
        heights.map(|height| {
            let field = HierarchicalSpline::<f32>::schoenberg(lattice, 1.0, |p| height - p.z).unwrap();
            let object = TouchedObject {
                id: 1,
                field: Arc::new(field),
                iso: 0.0,
                world_from_object: DAffine3::IDENTITY,
                layers: &Layers::default(),
                default: Touch::default(),
            };
            maker.make(DVec3::splat(12.0), &[object], 0)
        })
    }

    #[test]
    fn an_edit_comes_as_a_motion() {
        let [_, lower] = ground([12.0, 11.9]);
        let shown = Shown::new(1, lower, 0.03);
        let height = |t| 12.5 - shown.after(t).distance(DVec3::new(12.0, 12.0, 12.5)).0;
        for (t, expected) in [(0.0, 12.0), (0.015, 11.95), (0.03, 11.9), (1.0, 11.9)] {
            assert!((height(t) - expected).abs() < 1e-4, "{t} s: {}", height(t));
        }
    }

    #[test]
    fn a_word_of_another_shows() {
        let [high, low] = ground([12.0, 11.9]);
        let shown = Shown::new(7, high, 0.03);
        assert!(shown.is_whole() && Shown::nothing().is_whole());
        let torn = [
            Shown {
                sequence: 8,
                ..shown.clone()
            },
            Shown {
                snapshot: low,
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
