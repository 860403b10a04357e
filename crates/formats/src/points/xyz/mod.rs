//! Lines of numbers, in and out.

mod read;
mod write;

pub use read::parse_xyz;
pub(super) use read::{Line, parse};
pub(super) use write::write;
