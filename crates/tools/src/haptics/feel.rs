//! What a hand tells and what it feels.

use glam::{DQuat, DVec3};

use super::Obstacle;

/// Where a tool is, and how it is turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Its handle point, mm.
    pub at: DVec3,
    /// Turn from the tool's own axes to the world's, of length 1.
    pub turn: DQuat,
}

impl Pose {
    /// At a place, not turned.
    pub fn at(at: DVec3) -> Self {
        Self {
            at,
            turn: DQuat::IDENTITY,
        }
    }

    /// Whether all numbers are finite.
    pub fn is_finite(&self) -> bool {
        self.at.is_finite() && self.turn.is_finite()
    }
}

/// What a tool has to do with the solid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contact {
    /// Nothing.
    Free,
    /// It rests on the surface without friction, or slides over it.
    Slides,
    /// Friction holds it where it is.
    Sticks,
    /// The solid holds it by the magnetic band, without pressure.
    Attracted,
    /// A force tool pulls the solid.
    Pulls,
    /// It is inside the solid and feels nothing until it is clear.
    Inside,
}

/// What is felt in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Felt {
    /// Force on the hand, N.
    pub force: DVec3,
    /// Torque on the hand about the handle point, N mm.
    pub torque: DVec3,
    /// Where the tool would be if the hand could not push it into the solid.
    pub proxy: Pose,
    /// What it has to do with the solid.
    pub contact: Contact,
}

impl Felt {
    /// Nothing: the tool is where the hand is.
    pub fn nothing(hand: &Pose) -> Self {
        Self {
            force: DVec3::ZERO,
            torque: DVec3::ZERO,
            proxy: *hand,
            contact: Contact::Free,
        }
    }
}

/// Turns poses into forces, tick by tick.
pub trait Renderer: Send {
    /// One tick of `dt` seconds with the hand at a pose, which is finite.
    fn tick(&mut self, obstacle: &dyn Obstacle, hand: &Pose, dt: f64) -> Felt;

    /// Forgets the contact: the next tick begins where the hand is then, and where that is inside the solid it gives no force until
    /// it is clear. For tools that begin, and objects that jump.
    fn reset(&mut self);
}
