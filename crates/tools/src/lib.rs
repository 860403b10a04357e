//! What a hand can do to a field. So far scripted [scenes](scene): kernels, paint, levels and formulas of matter; force tools,
//! geometric tools and haptics are not built yet.

pub mod scene;
