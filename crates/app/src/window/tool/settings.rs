//! What can be said of a tool besides its radius and strength; each tool looks at what it has.

use serde_json::{Value, json};

use super::{Kind, Use};

/// How the force of a tool is spread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// As a bell.
    #[default]
    Gaussian,
    /// Alike all over.
    Constant,
    /// As a ball.
    Spherical,
    /// As a cylinder about the way.
    Cylindrical,
    /// As a cone.
    Conical,
}

impl Filter {
    /// All, with their names: those of scripts, capitalized.
    pub const ALL: [(Self, &str); 5] = [
        (Self::Gaussian, "Gaussian"),
        (Self::Constant, "Constant"),
        (Self::Spherical, "Spherical"),
        (Self::Cylindrical, "Cylindrical"),
        (Self::Conical, "Conical"),
    ];
}

/// A solid that is put on, taken out or carried along.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Solid {
    /// A ball.
    #[default]
    Ball,
    /// A box.
    Box,
    /// A cylinder along the normal.
    Cylinder,
    /// A cylinder with round ends.
    Capsule,
    /// A ring about the normal.
    Ring,
}

impl Solid {
    /// All, with their names.
    pub const ALL: [(Self, &str); 5] = [
        (Self::Ball, "Ball"),
        (Self::Box, "Box"),
        (Self::Cylinder, "Cylinder"),
        (Self::Capsule, "Capsule"),
        (Self::Ring, "Ring"),
    ];

    /// As scripts write it, of a radius and a height, its axis the third.
    pub fn shape(self, radius: f64, height: f64) -> Value {
        let axis = [0.0, 0.0, 1.0];
        match self {
            Self::Ball => json!({ "sphere": { "radius": radius } }),
            Self::Box => json!({ "box": { "size": [2.0 * radius, 2.0 * radius, height] } }),
            Self::Cylinder => json!({ "cylinder": { "axis": axis, "radius": radius, "height": height } }),
            Self::Capsule => json!({ "capsule": { "axis": axis, "radius": radius, "height": height } }),
            Self::Ring => {
                json!({ "torus": { "axis": axis, "major": radius, "minor": (0.25 * height).min(0.9 * radius) } })
            }
        }
    }
}

/// What can be said of a tool besides its radius and strength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Part of the radius over which it fades, 0 to 1.
    pub falloff: f64,
    /// Width over which a crease is rounded, radii.
    pub blend: f64,
    /// Way of the mouse from step to step, radii.
    pub spacing: f64,
    /// How a force is spread.
    pub filter: Filter,
    /// Whether stiff parts stay behind, as far as they are stiffer.
    pub gives_way: bool,
    /// Whether the solid springs back when it is let go; as the object is if missing.
    pub elastic: Option<bool>,
    /// Whether shapes wider than the brush keep their volume as they are smoothed.
    pub keeps_volume: bool,
    /// Of bends and twists, degrees.
    pub angle: f64,
    /// What is stamped or carried.
    pub solid: Solid,
    /// Its height over its radius.
    pub height: f64,
    /// Whether it turns with its way.
    pub follows: bool,
    /// Stiffness of the spring of a held line over that of the solid; none holds the line still.
    pub spring: Option<f64>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            falloff: 1.0,
            blend: 0.0,
            spacing: 0.2,
            filter: Filter::Gaussian,
            gives_way: false,
            elastic: None,
            keeps_volume: false,
            angle: 30.0,
            solid: Solid::Ball,
            height: 2.0,
            follows: true,
            spring: None,
        }
    }
}

impl Kind {
    /// Whether it is spread by a filter, and moves the solid by forces.
    pub fn is_force(self) -> bool {
        matches!(
            self,
            Self::Pull
                | Self::Pad
                | Self::Crest
                | Self::Plateau
                | Self::Chisel
                | Self::Squirt
                | Self::Drill
                | Self::Join
                | Self::Extrude
                | Self::Flex
        )
    }

    /// Whether it leaves a crease, which can be rounded.
    pub fn has_blend(self) -> bool {
        matches!(self, Self::Carve | Self::Add | Self::Stamp | Self::Sweep)
    }

    /// What its falloff is, if it has one.
    pub fn falloff(self) -> Option<&'static str> {
        match self {
            Self::Grab => {
                Some("Part of the radius that comes along less and less; the rest comes along whole")
            }
            Self::Stiffen
            | Self::Mass
            | Self::Damping
            | Self::RestLength
            | Self::SurfaceStiffness
            | Self::Friction => Some("Part of the radius over which the paint fades"),
            _ => None,
        }
    }

    /// Whether it puts a solid somewhere.
    pub fn has_solid(self) -> bool {
        matches!(self, Self::Stamp | Self::Sweep)
    }

    /// Whether it turns by an angle.
    pub fn has_angle(self) -> bool {
        matches!(self, Self::Bend | Self::Flex | Self::Twist | Self::Whirl)
    }

    /// Whether it matters how hard a pen is pressed on the way.
    pub fn has_press(self) -> bool {
        self.by() == Use::Brush && self.has_strength() && !matches!(self, Self::Chisel | Self::Squirt)
    }

    /// Whether its strength makes a difference.
    pub fn has_strength(self) -> bool {
        !matches!(
            self,
            Self::Grab
                | Self::Pull
                | Self::Pad
                | Self::Drill
                | Self::Join
                | Self::Trim
                | Self::Shift
                | Self::Mirror
                | Self::Cut
                | Self::Copy
                | Self::Paste
                | Self::Lasso
                | Self::PinLine
                | Self::PinBox
                | Self::PinOutline
        ) && !self.has_angle()
    }
}
