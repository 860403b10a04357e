//! A mesh settles on its surface: even triangles, few for their error.

mod edges;
mod flips;
mod offsets;
mod relax;
mod state;

use glam::DVec3;

use self::edges::{Edges, NONE};
use self::flips::{Rule, flip};
use self::state::State;
use crate::Field;

/// How far a mesh is improved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SettleOptions {
    /// Chord error that the mesh was made for, a length: triangles far below it count alike.
    pub tolerance: f64,
    /// Rounds of relaxation and Delaunay flips.
    pub rounds: usize,
    /// Whether edges are turned to lower the error at the cost of angles, down to 20°.
    pub error_flips: bool,
    /// Whether vertices leave the surface so that the triangles lie on it on average.
    pub offsets: bool,
}

impl SettleOptions {
    /// All steps, for a mesh of this chord error.
    pub fn new(tolerance: f64) -> Self {
        Self {
            tolerance,
            rounds: 2,
            error_flips: true,
            offsets: true,
        }
    }
}

/// What was done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SettleReport {
    /// Edges turned.
    pub flips: usize,
}

/// Improves a mesh of the surface `{ f = iso }` without a change in the number of its vertices and triangles.
///
/// `fixed` vertices stay, and so do those beside them. The result depends on nothing farther than some rings
/// round a vertex, nor on the number of threads.
///
/// # Panics
/// If `fixed` does not have one entry a vertex.
pub fn settle(
    field: &dyn Field,
    iso: f64,
    positions: &mut [DVec3],
    triangles: &mut [[u32; 3]],
    fixed: &[bool],
    options: &SettleOptions,
) -> SettleReport {
    assert_eq!(positions.len(), fixed.len(), "one flag a vertex");
    let count = positions.len();
    let mut edges = Edges::new(triangles, count);
    let mut held = fixed.to_vec();
    for (t, triangle) in edges.triangles.iter().enumerate() {
        let border = (3 * t..3 * t + 3).any(|h| edges.twin[h] == NONE);
        if border || triangle.iter().any(|&v| fixed[v as usize]) {
            for &v in triangle {
                held[v as usize] = true;
            }
        }
    }
    let mut state = State {
        positions,
        normals: vec![DVec3::ZERO; count],
        held,
        tolerance: options.tolerance,
    };
    let mut report = SettleReport::default();
    relax::project(field, iso, &edges, &mut state);
    for _ in 0..options.rounds {
        relax::relax(field, iso, &edges, &mut state);
        report.flips += flip(&mut edges, &state, Rule::Delaunay);
    }
    if options.error_flips {
        report.flips += flip(&mut edges, &state, Rule::Error);
    }
    if options.offsets {
        offsets::offset(field, iso, &edges, &mut state);
    }
    report
}
