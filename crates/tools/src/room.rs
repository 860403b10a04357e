//! Boxes of fields that grow when a stroke needs more room.

use glam::DVec3;

use crate::canvas::Canvas;
use crate::face::Face;
use crate::force::ForceError;
use crate::geometric::GeometricError;
use crate::tool::ToolError;

/// How often a box grows for one stroke: to about twice its length. Further away is a slip of the pen.
pub const MOST_GROWTHS: usize = 6;

/// Share of the cells along an axis by which a box grows at once.
const SHARE: u32 = 8;

/// Most cells of a box along an axis on the finest level, as files have it.
const MOST_CELLS: u64 = 1 << 30;

impl Canvas {
    /// The face beyond which the box has to grow for what a tool was refused. None where it was refused for something else, where it
    /// goes too far, or where the box cannot grow: the solid is cut off at the face, so that nobody knows how it goes on; or the box is
    /// as large as boxes get.
    pub fn face_for(&self, refused: &ToolError) -> Option<Face> {
        let face = match refused {
            ToolError::Geometric(GeometricError::Leaves { face, .. }) => *face,
            ToolError::Force(ForceError::Outside { at, .. }) => {
                let at = DVec3::from_array(*at);
                let local = self.field.lattice_from_world().transform_point3(at);
                let extent = self.field.lattice().extent();
                let is_near = local.cmpge(-extent).all() && local.cmple(2.0 * extent).all();
                Face::beyond(&self.field, at).filter(|_| is_near)?
            }
            _ => return None,
        };
        let finest = self.field.level_count().max(self.detail + 1) - 1;
        let cells = u64::from(self.field.lattice().cells[face.axis] + self.step(face));
        let can_grow = cells << finest <= MOST_CELLS && !face.cuts(&self.field, self.iso);
        can_grow.then_some(face)
    }

    /// What is left to say of a box that was another one before.
    pub fn growth_since(&self, before: &Self) -> Option<String> {
        let lattice = self.field.lattice();
        let size = lattice.world_box().size();
        (lattice != before.field.lattice()).then(|| {
            format!(
                "the box of the field has grown to {:.3} × {:.3} × {:.3}",
                size.x, size.y, size.z
            )
        })
    }

    fn step(&self, face: Face) -> u32 {
        self.field.lattice().cells[face.axis].div_ceil(SHARE)
    }

    /// The canvas with a box that is larger beyond a face: whole cells of the coarsest level, filled with what the field was outside. None
    /// where the numbers do not fit.
    pub fn grown(&self, face: Face) -> Option<Self> {
        let lattice = self.field.lattice();
        let by = self.step(face);
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
