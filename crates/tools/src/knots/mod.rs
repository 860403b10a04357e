//! Fields on knot vectors of their own: blocks whose knots lie close where they are to be fine.
//!
//! Force tools, paint, holds, places and the insertion of knots work on such a field as it is. What works by levels, all
//! other tools, writes it in levels first and says so.

mod block;
mod levels;
mod refine;
mod stroke;

pub use block::block;
pub use levels::in_levels;
