//! Ways of contact that are known to fail, for tests to prove that they can: nobody should feel with them.

mod penalty;
mod tangent_plane;

pub use penalty::Penalty;
pub use tangent_plane::TangentPlane;
