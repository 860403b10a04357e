//! Panels round the scene: one file each.

mod document;
mod menu;
mod path_box;
mod start;
mod status;
mod tools;

pub use document::document;
pub use menu::menu;
pub use path_box::{PathBox, path_box};
pub use start::start;
pub use status::status;
pub use tools::{RADII, tools};
