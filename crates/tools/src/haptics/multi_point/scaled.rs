//! Tools that are told in the lengths of the hand.

use glam::DVec3;

use super::super::{Felt, Obstacle, Pose, Renderer, Touch};

/// A renderer in millimetres of the hand, for a scene of which a millimetre of the hand is `scale`. A tool of many points is as large in the hand at every
/// zoom so, and its steps and tolerances with it. Forces are the same in both.
#[derive(Clone, Debug)]
pub struct Scaled<R> {
    /// In the lengths of the hand; its stiffness is that at the hand.
    pub renderer: R,
    /// Lengths of the scene for one of the hand, above 0.
    pub scale: f64,
}

/// What may be touched, as small as the hand sees it.
struct Seen<'a> {
    obstacle: &'a dyn Obstacle,
    scale: f64,
}

impl Obstacle for Seen<'_> {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        let (distance, gradient) = self.obstacle.distance(self.scale * p);
        (distance / self.scale, gradient)
    }

    fn finest(&self) -> f64 {
        self.obstacle.finest() / self.scale
    }

    fn touch(&self, p: DVec3) -> Touch {
        let touch = self.obstacle.touch(self.scale * p);
        Touch {
            stiffness: self.scale * touch.stiffness,
            ..touch
        }
    }
}

impl<R: Renderer> Renderer for Scaled<R> {
    fn tick(&mut self, obstacle: &dyn Obstacle, hand: &Pose, dt: f64) -> Felt {
        let scale = self.scale;
        let seen = Seen { obstacle, scale };
        let own = Pose {
            at: hand.at / scale,
            ..*hand
        };
        let felt = self.renderer.tick(&seen, &own, dt);
        Felt {
            torque: scale * felt.torque,
            proxy: Pose {
                at: scale * felt.proxy.at,
                ..felt.proxy
            },
            ..felt
        }
    }

    fn reset(&mut self) {
        self.renderer.reset();
    }
}
