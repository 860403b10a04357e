//! Lines of numbers, in and out.

mod columns;
mod read;
mod write;

pub(super) use columns::{Apart, Columns};
pub use read::parse_xyz;
pub(super) use read::{Line, parse, parse_columns};
pub(super) use write::write;
