//! What a hand can do to a field: scripted [scenes](scene) of forces, matter and constraints, and [geometric] tools that carve and
//! add. A [session] is a row of strokes; each uses one [tool]. Haptics are not built yet.

pub mod force;
pub mod geometric;
pub mod number;
pub mod paint;
pub mod scene;
pub mod session;
pub mod tool;
