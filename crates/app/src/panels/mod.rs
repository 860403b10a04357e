//! Panels round the scene: one file each.

mod constraints;
mod document;
mod log;
mod measure;
mod menu;
mod modes;
mod path_box;
mod picture;
mod profile;
mod show;
mod slices;
mod start;
mod status;
mod surface;
mod tools;
mod touch;

pub use constraints::{constraints, next_pin};
pub use document::document;
pub use log::log;
pub use measure::measure;
pub use menu::menu;
pub use modes::{modes, next_mode};
pub use path_box::{PathBox, path_box};
pub use picture::{Shots, picture};
pub use show::show;
pub use slices::{Slices, slice_beside, slices};
pub use start::start;
pub use status::status;
pub use surface::{Densities, surface};
pub use tools::{RADII, tools};
pub use touch::{TouchWish, touch};
