//! What the mouse does to the solid.

mod boxed;
mod kind;
mod made;
mod settings;
mod stroke;

pub use boxed::surface_within;
pub use kind::{Group, Kind, Use};
pub use made::{Drawn, turned};
pub use settings::{Filter, Settings, Solid};
pub use stroke::Start;

use glam::DVec3;

/// A tool as it is set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tool {
    /// Which.
    pub kind: Kind,
    /// How far it reaches, a length of the object's world.
    pub radius: f64,
    /// From 0 to 1.
    pub strength: f64,
    /// Whether it does the opposite.
    pub inverted: bool,
    /// What else can be said of it.
    pub settings: Settings,
}

impl Tool {
    /// Where its middle is when it touches a place of the surface with an outward normal.
    pub fn middle(&self, at: DVec3, normal: DVec3) -> DVec3 {
        // A ball goes in, or stands out, by the depth.
        let sunk = self.radius - self.depth();
        match (self.kind, self.inverted) {
            (Kind::Carve, false) | (Kind::Add, true) => at + sunk * normal,
            (Kind::Carve, true) | (Kind::Add, false) => at - sunk * normal,
            _ => at,
        }
    }

    /// As a pen makes it that is pressed so hard, 0 to 1.
    pub fn pressed(&self, press: f64) -> Self {
        let strength = press * self.strength;
        Self { strength, ..*self }
    }

    /// How deep it works.
    fn depth(&self) -> f64 {
        (0.05 + 0.95 * self.strength) * self.radius
    }

    /// 1, or -1 where it does the opposite.
    fn sign(&self) -> f64 {
        if self.inverted { -1.0 } else { 1.0 }
    }
}

#[cfg(test)]
mod tests;
