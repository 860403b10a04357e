//! A mesh settles on its surface: even triangles, few for their error.
//!
//! 1. Rounds of relaxation in the tangent planes, weighted so that triangles shrink where the chord error is large, each
//!    vertex brought back to the surface by a step of Newton's method, and of Delaunay flips.
//! 2. Flips that lower the error.
//! 3. Offsets: vertices leave the surface along their normals, so that the triangles lie on it on average.
//!
//! Errors of edges come from the normals at their ends, so only vertices and centroids are evaluated. On the marching-cubes
//! mesh of the fitted Stanford bunny with 195 000 triangles the 95th percentile of the error at centroids and middles
//! of edges falls from 1.88 to 0.82 (in 1e-4 of the diagonal), the angle between triangles and surface from 2.5° to
//! 1.6° rms, and the 1st percentile of the smallest angles rises from 0.8° to 21°. A third round gains 2 % more.

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
/// `fixed` vertices stay; those beside them and those at the border of an open mesh move onto the surface, no farther.
/// A vertex depends on nothing
/// farther than some rings of triangles, and of the numbering on the order alone: a part of a mesh settles, to the bit,
/// as it does in the whole, but for a strip along its border.
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
    let mut state = State {
        positions,
        normals: vec![DVec3::ZERO; count],
        held: fixed.to_vec(),
        tolerance: options.tolerance,
    };
    let mut report = SettleReport::default();
    relax::project(field, iso, &edges, &mut state);
    for (t, triangle) in edges.triangles.iter().enumerate() {
        let border = (3 * t..3 * t + 3).any(|h| edges.twin[h] == NONE);
        if border || triangle.iter().any(|&v| fixed[v as usize]) {
            for &v in triangle {
                state.held[v as usize] = true;
            }
        }
    }
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
