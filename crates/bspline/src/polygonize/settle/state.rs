//! What is known of the vertices while a mesh settles.

use glam::DVec3;

/// Positions, normals and which vertices may move.
pub(super) struct State<'a> {
    pub positions: &'a mut [DVec3],
    /// Outward unit normals of the field; zero where none was asked for yet.
    pub normals: Vec<DVec3>,
    /// Vertices that stay where they are.
    pub held: Vec<bool>,
    /// Chord error that the mesh was made for.
    pub tolerance: f64,
}

/// Height of the arc over the chord from `p` to `q` whose ends have the normals `m` and `n`, positive where the surface
/// bulges outward: `(q − p)·(n − m)/8`, from the cubic through both ends along their tangents.
#[inline(always)]
fn arc(p: DVec3, q: DVec3, m: DVec3, n: DVec3) -> f64 {
    (q - p).dot(n - m) * 0.125
}

/// Magnitude of the height of the arc.
#[inline(always)]
pub(super) fn sagitta(p: DVec3, q: DVec3, m: DVec3, n: DVec3) -> f64 {
    arc(p, q, m, n).abs()
}
