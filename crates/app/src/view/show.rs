//! What is shown beside the solids themselves.

use serde::{Deserialize, Serialize};

use super::Stereo;

/// What is shown beside the solids themselves; kept from one window to the next.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Show {
    /// Sides of the triangles.
    pub wireframe: bool,
    /// A surface of another density, looked through.
    pub second: bool,
    /// What colours tell.
    pub tint: Tint,
    /// Cells of the fit.
    pub cells: Cells,
    /// The points that were fitted.
    pub points: bool,
    /// How long things are.
    pub scale_bar: bool,
    /// Arrows of forces.
    pub forces: bool,
    /// A grid below, and the axes.
    pub floor: bool,
    /// Whether each eye has a picture of its own.
    pub stereo: Stereo,
}

/// What the colours of the surface tell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Tint {
    /// Nothing but painted stiffness.
    #[default]
    Off,
    /// The error of the fit.
    Errors,
    /// Painted stiffness under a fingertip.
    Touch,
    /// Painted friction.
    Friction,
}

/// How cells of a fit are coloured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cells {
    /// Not at all: there are none.
    #[default]
    Off,
    /// By how often they were halved.
    Level,
    /// By their error.
    Error,
}

impl Default for Show {
    /// What is cheap and in nobody's way.
    fn default() -> Self {
        Self {
            wireframe: false,
            second: false,
            tint: Tint::Off,
            cells: Cells::Off,
            points: false,
            scale_bar: true,
            forces: true,
            floor: false,
            stereo: Stereo::default(),
        }
    }
}
