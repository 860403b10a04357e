//! Tools that push and pull: forces along paths, on a solid that moves by the equations of [`dynamics`].
//!
//! A tool is a set of paths. Each begins where it crosses the surface now and ends where the surface is to go; its force is
//! `F = α∫(c − s)dc` over unsigned arc length \[Hua04 eq. 7\], so it fades as the surface arrives, and turns round beyond. Spread
//! by a [`Filter`] of the tool's radius, a world length, over the samples near the path, it does not depend on the sampling.
//! How large it has to be is no number of the user's but what the [`Rule`] asks for, implicit in the step: that no path is
//! short of anything at its end, or a stated multiple of what unpainted matter would need.
//!
//! With `T` the total force of a path, `e = I/ℓ` the mean that it is short of, `J` its spread and `J̃` the mean of the field
//! over it, a step solves `(J̃ᵀH⁻¹J + diag(s))ΔT = e − J̃ᵀy − ψsT` ([`system`]), `y` what the step does with the forces at hand, `ψ`
//! how soft their paths stay for these (`Extent::kept_soft`).

mod area;
mod bend;
mod chisel;
mod crumbs;
mod drill;
mod extent;
mod extrude;
mod filter;
mod ground;
mod hand;
mod holding;
mod led;
mod path;
mod pull;
pub mod quadrature;
mod report;
mod rough;
mod row;
mod spread;
mod stage;
mod step;
mod stroke;
mod system;
mod target;
mod tool;
mod toward;
mod track;
mod tracked;
mod within;

pub use bend::Bend;
pub use chisel::Chisel;
pub(crate) use crumbs::swept;
pub use drill::Drill;
pub use extent::Extent;
pub use extrude::Extrude;
pub use filter::Filter;
pub use holding::Holding;
pub use path::{Path, first_crossing, nearest_surface};
pub use pull::Pull;
pub use report::{Arrival, ForceReport, Told};
pub use stroke::ForceStroke;
pub use target::{Span, Target};
pub use tool::ForceTool;
pub(crate) use tool::released;

use dynamics::patch::PatchError;
use dynamics::region::RegionError;
use fitting::FitError;
use serde::{Deserialize, Serialize};

use crate::number::Positive;

/// What the solid does with its shape.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Solid {
    /// Rest lengths follow while the tool acts; the shape stays, to the bit.
    #[default]
    Clay,
    /// It springs back when it is let go: the stroke leaves the field as it was.
    Elastic,
}

/// How large the forces are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Rule {
    /// As large as it takes for every path to arrive, whatever is painted. Elastic solids: at `b/(1 + b)` of the way.
    #[default]
    Arrive,
    /// `2b` times what unpainted matter needs for the mean over a path: stiff parts stay behind.
    Compliance,
    /// `α` times the integral over the path \[Hua04 eq. 7\].
    Raw(Positive),
}

/// How a force tool works, beside its paths.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct How {
    /// How the force is spread.
    pub filter: Filter,
    /// Whether the shape stays; that of the object if missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solid: Option<Solid>,
    /// How large it is.
    pub rule: Rule,
    /// `b`: 15 of clay and 4 of elastic solids if missing.
    pub gain: Option<Positive>,
}

impl How {
    /// Whether the shape stays.
    pub fn solid(&self) -> Solid {
        self.solid.unwrap_or_default()
    }
}

/// Why a force tool cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ForceError {
    /// A value of the tool makes no sense.
    #[error("{0}")]
    Tool(String),
    /// No surface is near.
    #[error(
        "no surface lies within {reach} of {at:?}; move the point to the surface, or use a tool with a larger radius"
    )]
    Nowhere {
        /// The place.
        at: [f64; 3],
        /// How far it was looked for.
        reach: f64,
    },
    /// The tool reaches out of the field.
    #[error(
        "the tool goes to {at:?}, and the field reaches from {field:?}; stay within, or start from a field with more room"
    )]
    Outside {
        /// The place.
        at: [f64; 3],
        /// Corners of the field's box.
        field: [[f64; 3]; 2],
    },
    /// The part that would move cannot be cut out or put back.
    #[error("the part of the field about the tool: {0}")]
    Region(#[from] RegionError),
    /// A step failed.
    #[error(transparent)]
    Step(#[from] PatchError),
    /// The user said stop.
    #[error(transparent)]
    Cancelled(FitError),
}

impl ForceError {
    fn tool(why: impl Into<String>) -> Self {
        Self::Tool(why.into())
    }

    /// Whether the user said stop.
    pub fn is_cancelled(&self) -> bool {
        matches!(self, Self::Cancelled(_))
    }
}
