use std::collections::BTreeMap;

use bspline::hierarchical::BrickDiff;
use bspline::polygonize::{BlockMesh, PolygonizeOptions};
use bspline::{Aabb, Field, Frame, HierarchicalSpline};
use glam::DVec3;

use super::{Sculpture, StudyError};
use crate::force::ForceStroke;
use crate::paint::{Layers, Paint, Substance};

/// Samples per knot interval, as force tools have them; cells of the mesh are as large.
const SAMPLES: f64 = 4.0 / 3.0;

/// A stroke with a mesh beside it.
pub struct Looped {
    /// The stroke.
    pub stroke: ForceStroke<f32>,
    /// The surface of the field as it is now.
    pub mesh: BlockMesh,
    before: HierarchicalSpline<f32>,
    whole: Aabb,
}

impl Looped {
    /// A stroke that has not begun on a field, and the mesh of that field.
    pub fn new(sculpture: &Sculpture, stroke: ForceStroke<f32>, mesh: BlockMesh) -> Self {
        Self {
            stroke,
            mesh,
            before: sculpture.field.clone(),
            whole: sculpture.field.lattice().world_box(),
        }
    }

    /// Whether nothing is left to do.
    pub fn is_over(&self) -> bool {
        self.stroke.is_over()
    }

    /// Force, step, difference for undo, local mesh.
    ///
    /// # Errors
    /// [`StudyError`].
    pub fn step(&mut self) -> Result<BrickDiff<f32>, StudyError> {
        self.stroke.step()?;
        let now = self.stroke.baked()?;
        let difference = self.before.difference(&now)?;
        self.mesh
            .update(&now, &now.changed_boxes(&self.before, &self.whole))?;
        self.before = now;
        Ok(difference)
    }
}

/// A mesh about a place whose cells are as large as samples lie apart in a region of this knot interval.
///
/// # Errors
/// [`StudyError::Mesh`].
pub fn mesh_about(
    sculpture: &Sculpture,
    at: DVec3,
    reach: f64,
    interval: f64,
) -> Result<BlockMesh, StudyError> {
    let whole = sculpture.field.lattice().world_box();
    let cell = interval / SAMPLES;
    let part = Aabb {
        min: (at - reach).max(whole.min),
        max: (at + reach).min(whole.max),
    };
    let cells = ((part.max - part.min) / cell).ceil().max(DVec3::ONE);
    let frame = Frame::over(&part, cells.as_uvec3().to_array());
    let options = PolygonizeOptions {
        iso: sculpture.iso,
        ..PolygonizeOptions::default()
    };
    Ok(BlockMesh::new(&sculpture.field, &frame, &options)?.0)
}

/// Stiffness of ten on one side of a place, within reach of it.
///
/// # Errors
/// [`StudyError::Paint`].
pub fn half_painted(
    sculpture: &Sculpture,
    at: DVec3,
    reach: f64,
    detail: usize,
) -> Result<Layers, StudyError> {
    let paint = Paint {
        layer: Substance::Stiffness,
        brush: None,
        formula: Some(format!("1 + 9 * (x < {:.17})", at.x)),
        curve: None,
        of_stiffness: None,
    };
    let within = Aabb {
        min: at - reach,
        max: at + reach,
    };
    let layer = paint.apply(&sculpture.field, &Layers::new(), detail, &within)?;
    Ok(BTreeMap::from([(Substance::Stiffness, layer)]))
}
