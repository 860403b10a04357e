//! Lines of numbers, in and out.

mod read;
mod write;

pub(super) use read::parse;
pub use read::parse_xyz;
pub(super) use write::write;
