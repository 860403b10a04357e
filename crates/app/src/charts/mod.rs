//! Speed against accuracy: sweeps over the options, and their charts.

mod ball;
mod dynamics;
mod edits;
mod fields;
mod fit;
mod haptics;
mod hard;
mod masks;
mod meshes;
mod noise;
mod orient;
mod outliers;
mod plot;
mod tools;
#[cfg(feature = "window")]
mod window;

pub use dynamics::{DynamicsError, Extent, Line, Run, cost, sampling, sweep};
pub use edits::edit_costs;
pub use fields::field_fit_costs;
pub use fit::{Configuration, Input, Measurement, sweeps};
pub use haptics::{HapticLine, HapticRun, haptic_costs};
pub use hard::Scene;
pub use masks::mask_costs;
pub use meshes::{MeshSubject, MeshTrial};
pub use noise::noise;
pub use orient::Oriented;
pub use outliers::outliers;
pub use plot::{Chart, Series};
pub use tools::{Sculpture, ToolLine, ToolRun, ToolsError, tool_costs};
#[cfg(feature = "window")]
pub use window::window_costs;
