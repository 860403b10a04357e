//! What may be touched of a document, round the hand.

use std::sync::Arc;

use document::State;
use glam::DVec3;
use tools::haptics::{BrickOptions, DistanceBrick, Obstacle, Surface, Together, Touch};

use super::shown::{Snapshot, mixed};

/// Places along each edge of a brick whose distances its checksum takes.
const LOOKS: u32 = 4;

/// The distances to all objects near a place.
pub struct Touchable {
    bricks: Vec<DistanceBrick>,
    /// Of the place for which it was made.
    at: DVec3,
    reach: f64,
}

impl Touchable {
    /// Of the objects of a state that have a surface, round a place of the scene.
    pub fn new(state: &State, at: DVec3, options: &BrickOptions) -> Self {
        let near = |low: DVec3, high: DVec3| {
            // Of a field that ends within reach, what lies beyond its box is known too.
            let reach = options.reach + options.band;
            (at + reach).cmpge(low).all() && (at - reach).cmple(high).all()
        };
        let bricks = state.objects().iter().filter_map(|(name, object)| {
            let iso = object.meta.iso?;
            let placed = state.placement(name).ok()?;
            let surface = Surface::new(object.field.as_field(), iso).placed(placed);
            let whole = surface.to_world(&object.field.world_box());
            near(whole.min, whole.max).then(|| DistanceBrick::new(&surface, at, options))
        });
        Self {
            bricks: bricks.collect(),
            at,
            reach: options.reach,
        }
    }

    /// The same, to be shown to other threads.
    pub fn shared(state: &State, at: DVec3, options: &BrickOptions) -> Arc<dyn Snapshot> {
        Arc::new(Self::new(state, at, options))
    }
}

impl Obstacle for Touchable {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        Together(&self.bricks).distance(p)
    }

    fn finest(&self) -> f64 {
        Together(&self.bricks).finest()
    }

    fn touch(&self, p: DVec3) -> Touch {
        Together(&self.bricks).touch(p)
    }
}

impl Snapshot for Touchable {
    /// For a third of the way to the sides: a hand at 0.15 m/s is then still inside after two steps of the simulation.
    fn covers(&self, at: DVec3) -> bool {
        (at - self.at).abs().max_element() <= self.reach / 3.0
    }

    fn checksum(&self) -> u64 {
        let mut sum = self.bricks.len() as u64;
        for brick in &self.bricks {
            let b = brick.world_box();
            let share = |n: u32| f64::from(n) / f64::from(LOOKS - 1);
            for n in 0..LOOKS.pow(3) {
                let [i, j, k] = [n % LOOKS, n / LOOKS % LOOKS, n / LOOKS / LOOKS].map(share);
                let p = b.min + DVec3::new(i, j, k) * (b.max - b.min);
                sum = mixed(sum, brick.distance(p).0.to_bits());
            }
        }
        sum
    }
}
