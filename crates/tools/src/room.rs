//! Boxes of fields that grow when a stroke needs more room.

use bspline::{Aabb, Field, Frame, HierarchicalSpline};
use glam::DVec3;

use crate::face::Face;
use crate::tool::Canvas;

/// Share of the cells along an axis by which a box grows at once.
const SHARE: u32 = 8;

/// Most cells of a box along an axis on the finest level, as files have it.
const MOST_CELLS: u64 = 1 << 30;

/// Points across a face at which it is asked for solid that was cut off there.
const ACROSS: u32 = 256;

impl Canvas {
    /// The canvas with a box that is larger beyond a face: whole cells of the coarsest level, filled with what the field was outside. None
    /// where that cannot be: the solid is cut off at the face, so that nobody knows how it goes on; or the box is as large as boxes get.
    pub fn grown(&self, face: Face) -> Option<Self> {
        let lattice = self.field.lattice();
        let by = lattice.cells[face.axis].div_ceil(SHARE);
        let cells = u64::from(lattice.cells[face.axis]) + u64::from(by);
        let finest = self.field.level_count().max(self.detail + 1) - 1;
        if cells << finest > MOST_CELLS || is_cut(&self.field, self.iso, face) {
            return None;
        }
        let mut ends = [[0; 3]; 2];
        ends[usize::from(face.is_last)][face.axis] = by;
        let [before, behind] = ends;
        let field = self.field.grown(before, behind).ok()?;
        let layers = self.layers.iter();
        let layers =
            layers.map(|(substance, layer)| Some((*substance, layer.grown(lattice, before, behind)?)));
        Some(Self {
            layers: layers.collect::<Option<_>>()?,
            field,
            ..self.clone()
        })
    }
}

/// Whether the solid reaches a face.
fn is_cut(field: &HierarchicalSpline<f32>, iso: f64, face: Face) -> bool {
    let lattice = field.lattice();
    let mut part = Aabb::new(DVec3::ZERO, lattice.extent());
    let at = if face.is_last { part.max } else { part.min }[face.axis];
    (part.min[face.axis], part.max[face.axis]) = (at, at);
    let cells = lattice
        .cells_at(field.level_count() - 1)
        .map(|n| n.clamp(1, ACROSS));
    let mut frame = Frame::over(&part, cells);
    frame.world_from_grid = lattice.world_from_lattice * frame.world_from_grid;
    let count = std::array::from_fn(|a| if a == face.axis { 1 } else { cells[a] as usize + 1 });
    let mut values = vec![0.0; count.iter().product()];
    field.frame_values(&frame, [0; 3], count, &mut values);
    values.iter().any(|value| *value > iso)
}
