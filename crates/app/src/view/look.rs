//! How a scene is looked at.

use glam::DVec3;

use super::{Camera, Show};

/// How the scene is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// From where.
    pub camera: Camera,
    /// A place and a direction: what lies before it, that way, is cut off.
    pub cut: Option<(DVec3, DVec3)>,
    /// Whether painted stiffness shows.
    pub paint: bool,
    /// How solids become pixels.
    pub mode: Mode,
    /// Densities that are black and white, where densities are shown.
    pub density: [f64; 2],
    /// What is behind all.
    pub paper: Paper,
    /// What is shown beside the solids.
    pub show: Show,
    /// Width of lines, as a share of the picture's height.
    pub line: f32,
}

/// Width of lines in pictures without a window, as a share of the height.
pub const LINE: f32 = 1.25 / 800.0;

/// How solids become pixels.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, clap::ValueEnum,
)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// By the triangles of their surfaces
    #[default]
    Mesh,
    /// By lines to the surface of the spline itself
    Rays,
    /// As mist, denser where the density is higher
    Volume,
}

/// What is behind all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paper {
    /// Of the window.
    Dark,
    /// Of pictures.
    Light,
}

impl Paper {
    /// Linear light, above and below.
    pub fn light(self) -> [[f32; 4]; 2] {
        match self {
            Self::Dark => [[0.10, 0.11, 0.125, 1.0], [0.035, 0.038, 0.045, 1.0]],
            Self::Light => [[0.852, 0.873, 0.893, 1.0], [0.453, 0.463, 0.475, 1.0]],
        }
    }
}
