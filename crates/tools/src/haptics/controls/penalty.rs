use super::super::{Contact, Felt, Obstacle, Pose, Renderer};

/// The penalty method: F = K (r − φ) n at the hand, without memory.
///
/// What has no memory cannot know on which side of a sheet the tool was; and where φ is no distance, or has an edge, the force
/// is none of a potential and creates energy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Penalty {
    /// Radius of the tool, mm.
    pub radius: f64,
    /// K, N/m.
    pub stiffness: f64,
}

impl Renderer for Penalty {
    fn tick(&mut self, obstacle: &dyn Obstacle, hand: &Pose, _: f64) -> Felt {
        let (distance, gradient) = obstacle.distance(hand.at);
        let depth = self.radius - distance;
        let Some(normal) = gradient.try_normalize().filter(|_| depth > 0.0) else {
            return Felt::nothing(hand);
        };
        Felt {
            force: 1e-3 * self.stiffness * depth * normal,
            proxy: Pose {
                at: hand.at + depth * normal,
                turn: hand.turn,
            },
            contact: Contact::Slides,
            ..Felt::nothing(hand)
        }
    }

    fn reset(&mut self) {}
}
