//! The exact answer where free space is the meet of half-spaces.

use glam::DVec3;
use tools::haptics::{Contact, Felt, Obstacle, Pose, Renderer};

use super::HalfSpace;

/// F = K (P(x) − x), with P the nearest place in the meet of half-spaces moved outwards by a radius. It asks no obstacle.
#[derive(Clone, Debug)]
pub struct Projection {
    pub walls: Vec<HalfSpace>,
    pub radius: f64,
    /// N/m.
    pub stiffness: f64,
}

impl Projection {
    fn depth(&self, wall: &HalfSpace, p: DVec3) -> f64 {
        self.radius - wall.distance(p).0
    }

    /// The nearest free place: on no wall, on one, or on two.
    pub fn nearest(&self, p: DVec3) -> DVec3 {
        let walls = &self.walls;
        let one = walls.iter().map(|w| p + self.depth(w, p).max(0.0) * w.normal);
        let two = walls.iter().enumerate().flat_map(|(i, a)| {
            walls[i + 1..].iter().filter_map(move |b| {
                let c = a.normal.dot(b.normal);
                let (da, db, det) = (self.depth(a, p), self.depth(b, p), 1.0 - c * c);
                (det > 1e-12).then(|| p + ((da - c * db) * a.normal + (db - c * da) * b.normal) / det)
            })
        });
        let is_free = |q: &DVec3| walls.iter().all(|w| self.depth(w, *q) < 1e-9);
        std::iter::once(p)
            .chain(one)
            .chain(two)
            .filter(is_free)
            .min_by(|a, b| (*a - p).length().total_cmp(&(*b - p).length()))
            .expect("two walls leave room")
    }
}

impl Renderer for Projection {
    fn tick(&mut self, _: &dyn Obstacle, hand: &Pose, _: f64) -> Felt {
        let at = self.nearest(hand.at);
        let contact = if at == hand.at {
            Contact::Free
        } else {
            Contact::Slides
        };
        Felt {
            force: 1e-3 * self.stiffness * (at - hand.at),
            proxy: Pose { at, turn: hand.turn },
            contact,
            ..Felt::nothing(hand)
        }
    }

    fn reset(&mut self) {}
}
