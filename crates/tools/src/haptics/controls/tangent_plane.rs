use glam::DVec3;

use super::super::{Contact, Felt, Obstacle, Pose, Renderer};

/// The intermediate plane of \[Adachi95\]: the solid is taken for a half-space that a slow loop finds anew from time to time.
///
/// At each refresh the force jumps by about K v² / (2 R f²), with v the speed along a surface of radius R and f the rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TangentPlane {
    /// Radius of the tool, mm.
    pub radius: f64,
    /// K, N/m.
    pub stiffness: f64,
    /// f, Hz.
    pub rate: f64,
    since: f64,
    plane: Option<(DVec3, DVec3)>,
}

impl TangentPlane {
    /// Of a tool, mm, a stiffness, N/m, and a rate, Hz.
    pub fn new(radius: f64, stiffness: f64, rate: f64) -> Self {
        Self {
            radius,
            stiffness,
            rate,
            since: 0.0,
            plane: None,
        }
    }
}

impl Renderer for TangentPlane {
    fn tick(&mut self, obstacle: &dyn Obstacle, hand: &Pose, dt: f64) -> Felt {
        self.since += dt;
        if self.plane.is_none() || self.since * self.rate >= 1.0 - 1e-9 {
            self.since = 0.0;
            let (distance, gradient) = obstacle.distance(hand.at);
            let normal = gradient.normalize_or(DVec3::Z);
            self.plane = Some((hand.at - distance * normal, normal));
        }
        let Some((foot, normal)) = self.plane else {
            return Felt::nothing(hand);
        };
        let depth = self.radius - (hand.at - foot).dot(normal);
        if depth <= 0.0 {
            return Felt::nothing(hand);
        }
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

    fn reset(&mut self) {
        self.plane = None;
    }
}
