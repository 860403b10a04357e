//! What the mouse does to the solid.

use glam::DVec3;
use serde_json::{Value, json};
use tools::session::Stroke;

/// The tools of the palette.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Takes clay away.
    Carve,
    /// Lays clay on.
    Add,
    /// Evens out.
    Smooth,
    /// Lifts the surface, or lowers it.
    Inflate,
    /// Pushes in along the normal.
    Push,
    /// Pulls the surface by forces.
    Pull,
    /// Carries a part along.
    Grab,
    /// Cuts a groove by forces.
    Chisel,
    /// Makes the material stiffer, or softer.
    Stiffen,
}

impl Kind {
    /// All, in the order of the palette.
    pub const ALL: [Self; 9] = [
        Self::Carve,
        Self::Add,
        Self::Smooth,
        Self::Inflate,
        Self::Push,
        Self::Pull,
        Self::Grab,
        Self::Chisel,
        Self::Stiffen,
    ];

    /// On its button.
    pub fn name(self) -> &'static str {
        match self {
            Self::Carve => "Carve",
            Self::Add => "Add",
            Self::Smooth => "Smooth",
            Self::Inflate => "Inflate",
            Self::Push => "Push",
            Self::Pull => "Pull",
            Self::Grab => "Grab",
            Self::Chisel => "Chisel",
            Self::Stiffen => "Stiffen",
        }
    }

    /// Under the pointer: what it does, and what Ctrl makes of it.
    pub fn hint(self) -> &'static str {
        match self {
            Self::Carve => "Takes clay away along the way of the mouse. Ctrl: lays clay on",
            Self::Add => "Lays clay on along the way of the mouse. Ctrl: takes clay away",
            Self::Smooth => "Evens out bumps and noise",
            Self::Inflate => "Lifts the surface. Ctrl: lowers it",
            Self::Push => "Pushes the surface in, deeper the longer. Ctrl: draws it out",
            Self::Pull => "Takes hold of the surface and pulls it by forces: painted stiffness counts",
            Self::Grab => "Carries along what lies within the radius, with all its detail",
            Self::Chisel => "Cuts a groove by forces. Ctrl: lays a ridge",
            Self::Stiffen => "Paints the material stiffer against forces. Ctrl: softer",
        }
    }

    /// Key that chooses it.
    pub fn key(self) -> egui::Key {
        match self {
            Self::Carve => egui::Key::C,
            Self::Add => egui::Key::A,
            Self::Smooth => egui::Key::S,
            Self::Inflate => egui::Key::I,
            Self::Push => egui::Key::P,
            Self::Pull => egui::Key::U,
            Self::Grab => egui::Key::G,
            Self::Chisel => egui::Key::H,
            Self::Stiffen => egui::Key::T,
        }
    }
}

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
}

impl Tool {
    /// Whether it takes hold where it begins, and goes with the mouse from there; others follow the surface.
    pub fn takes_hold(&self) -> bool {
        matches!(self.kind, Kind::Pull | Kind::Grab)
    }

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

    /// How deep it works.
    fn depth(&self) -> f64 {
        (0.05 + 0.95 * self.strength) * self.radius
    }

    /// The stroke that it begins at a place of the surface.
    pub fn stroke(&self, at: DVec3) -> Stroke {
        let (r, sign) = (self.radius, if self.inverted { -1.0 } else { 1.0 });
        let ball = || json!({ "shape": { "sphere": { "radius": r } }, "along": [] });
        let brush = |key: &str, value: Value| json!({ "along": [], "radius": r, key: value });
        let stroke = match (self.kind, self.inverted) {
            (Kind::Carve, false) | (Kind::Add, true) => json!({ "carve": ball() }),
            (Kind::Carve, true) | (Kind::Add, false) => json!({ "add": ball() }),
            (Kind::Smooth, _) => {
                let level = 1.0 + (4.0 * self.strength).round();
                json!({ "smooth": brush("level", (level as u32).into()) })
            }
            (Kind::Inflate, _) => json!({ "inflate": brush("by", (sign * 0.3 * self.depth()).into()) }),
            (Kind::Push, _) => {
                let speed = 0.05 * self.depth();
                json!({ "push": { "along": [], "radius": r, "speed": speed, "force": sign } })
            }
            // The bump of a pull is some three times as wide as the spread of its force.
            (Kind::Pull, _) => json!({ "pull": { "along": [at.to_array()], "radius": r / 3.0 } }),
            (Kind::Grab, _) => {
                json!({ "move": { "motion": { "grab": { "along": [], "radius": r } } } })
            }
            (Kind::Chisel, false) => json!({ "chisel": self.groove() }),
            (Kind::Chisel, true) => json!({ "squirt": self.groove() }),
            (Kind::Stiffen, _) => {
                let value = libm::exp2(sign * 4.0 * self.strength);
                let brush = json!({ "value": value, "along": [], "radius": r });
                json!({ "paint": { "layer": "stiffness", "brush": brush } })
            }
        };
        serde_json::from_value(stroke).expect("the palette's strokes are strokes")
    }

    fn groove(&self) -> Value {
        json!({ "along": [], "depth": 0.5 * self.depth(), "radius": 0.5 * self.radius })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tool_begins_a_stroke() {
        for kind in Kind::ALL {
            for inverted in [false, true] {
                for strength in [0.0, 0.5, 1.0] {
                    let tool = Tool {
                        kind,
                        radius: 1.5,
                        strength,
                        inverted,
                    };
                    let stroke = tool.stroke(DVec3::ONE);
                    assert!(stroke.tool().is_ok(), "{tool:?}: {:?}", stroke.tool().err());
                }
            }
        }
    }

    #[test]
    fn no_two_tools_have_one_key() {
        for (n, one) in Kind::ALL.iter().enumerate() {
            assert!(Kind::ALL[..n].iter().all(|other| other.key() != one.key()));
        }
    }
}
