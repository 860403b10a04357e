//! Closed triangle meshes of iso-surfaces.
//!
//! [`polygonize`] makes the surface `{ f = iso }` of a field over the cells of a [`Frame`] into triangles whose
//! normals point out of the solid `{ f > iso }`. The mesh is an oriented 2-manifold without duplicate or degenerate
//! triangles, closed unless it is asked to stay open at the frame's box; [`check_mesh`] tells it of any mesh.
//! Positions are in world coordinates, double precision.
//!
//! A node counts as inside if `f > iso`, strictly; where the field is not a number it counts as outside.
//!
//! The work is done in blocks of 8³ cells:
//!
//! 1. the octree of blocks is searched for those that the field's bounds cannot exclude;
//! 2. each of them is sampled, and its vertices are placed by root finding along the crossed edges;
//! 3. vertices and triangles are numbered in the order of the blocks and joined over block borders.
//!
//! [`BlockMesh`] keeps the surfaces of the blocks, so that after a change of the field steps 1 and 2 are repeated for
//! the blocks that it touches only; the mesh is then the one made anew, to the bit.
//!
//! Steps 1 and 2 depend on the field, the frame and the block alone, and the order of blocks on their place, so the
//! mesh has the same bits at any number of threads. Memory grows with the surface.
//!
//! ```
//! # use bspline::{Aabb, Field, Frame, Interval, Jet};
//! # use glam::{DMat3, DVec3};
//! # struct Ball;
//! # impl Field for Ball {
//! #     fn value(&self, p: DVec3) -> f64 { 1.0 - p.length_squared() }
//! #     fn value_gradient(&self, p: DVec3) -> (f64, DVec3) { (self.value(p), -2.0 * p) }
//! #     fn jet(&self, p: DVec3) -> Jet {
//! #         Jet { value: self.value(p), gradient: -2.0 * p, hessian: DMat3::from_diagonal(DVec3::splat(-2.0)) }
//! #     }
//! #     fn bounds(&self, _: &Aabb) -> Interval { Interval::EVERYTHING }
//! # }
//! use bspline::polygonize::{PolygonizeOptions, check_mesh, polygonize};
//!
//! let frame = Frame::over(&Aabb::new(DVec3::splat(-1.5), DVec3::splat(1.5)), [30; 3]);
//! let (mesh, _report) = polygonize(&Ball, &frame, &PolygonizeOptions::default())?;
//! let check = check_mesh(&mesh);
//! assert!(check.is_closed_manifold());
//! assert!((check.volume - 4.0 / 3.0 * std::f64::consts::PI).abs() < 0.05);
//! # Ok::<(), bspline::polygonize::PolygonizeError>(())
//! ```

mod adaptive;
mod block_mesh;
mod blocks;
mod check;
mod crossings;
mod mesh;
mod options;
mod piece;
mod placement;
mod roots;
mod sampling;
mod settle;
mod stitch;
mod surface;
mod table;

use std::ops::ControlFlow;

use self::blocks::MAX_CELLS;
use crate::{Field, Frame};

pub use self::adaptive::{
    AdaptiveBlock, AdaptiveBlockMesh, AdaptiveMesh, AdaptiveMesher, AdaptiveOptions, AdaptiveReport,
    AdaptiveUpdate,
};
pub use self::block_mesh::{BlockMesh, BlockUpdate};
pub use self::check::{MeshCheck, check_mesh};
pub use self::crossings::self_intersections;
pub use self::mesh::Mesh;
pub use self::options::{MeshReport, Placement, PolygonizeError, PolygonizeOptions};
pub use self::settle::{SettleOptions, SettleReport, settle};

/// The surface `{ f = iso }` over the cells of `frame`.
///
/// # Errors
/// Any [`PolygonizeError`] but `Cancelled`.
pub fn polygonize(
    field: &dyn Field,
    frame: &Frame,
    options: &PolygonizeOptions,
) -> Result<(Mesh, MeshReport), PolygonizeError> {
    polygonize_with(field, frame, options, &mut |_| ControlFlow::Continue(()))
}

/// [`polygonize`] with a caller who looks on: `progress` is told the share of the work that is done, never falling,
/// from the calling thread, at least every few thousand blocks, and may break the work off.
///
/// # Errors
/// Any [`PolygonizeError`].
pub fn polygonize_with(
    field: &dyn Field,
    frame: &Frame,
    options: &PolygonizeOptions,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<(Mesh, MeshReport), PolygonizeError> {
    let (blocks, report) = BlockMesh::new_with(field, frame, options, &mut |done| progress(0.8 * done))?;
    let mesh = blocks.mesh_with(&mut |done| progress(0.8 + 0.2 * done))?;
    Ok((mesh, report))
}

fn validate(frame: &Frame, options: &PolygonizeOptions) -> Result<(), PolygonizeError> {
    if frame.cells.iter().any(|&n| n == 0 || n > MAX_CELLS) {
        return Err(PolygonizeError::Cells {
            cells: frame.cells,
            max: MAX_CELLS,
        });
    }
    let map = &frame.world_from_grid;
    let determinant = map.matrix3.determinant();
    if !map.is_finite() || !determinant.is_normal() {
        return Err(PolygonizeError::Frame { determinant });
    }
    if !options.iso.is_finite() {
        return Err(PolygonizeError::Iso { iso: options.iso });
    }
    match options.placement {
        Placement::RootFinding { tolerance } if !(tolerance > 0.0 && tolerance <= 0.1) => {
            Err(PolygonizeError::Tolerance { tolerance })
        }
        _ => Ok(()),
    }
}
