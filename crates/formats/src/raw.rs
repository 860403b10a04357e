//! What the parsers hand on, before anything is cleaned: to [`crate::points`] for clouds, to [`crate::meshes`] for
//! meshes.

use glam::DVec3;

use crate::limits::{Budget, Counted};
use crate::polygon;
use crate::{Fault, Unit};

/// Marks a corner of a face without a normal of its own.
pub(crate) const NO_NORMAL: u32 = u32::MAX;

/// Points and faces as a file gives them.
#[derive(Debug, Default)]
pub(crate) struct RawShape {
    /// Finite or not.
    pub positions: Vec<DVec3>,
    /// As stored, of any length, finite or not.
    pub normals: Option<Vec<DVec3>>,
    /// Red, green, blue of each position; only parsed for meshes.
    pub colors: Option<Vec<[u8; 3]>>,
    /// Indices are below `positions.len()`.
    pub triangles: Vec<[u32; 3]>,
    /// For each triangle the normal of each corner, [`NO_NORMAL`] where it has none.
    pub corner_normals: Option<(Vec<[u32; 3]>, Vec<DVec3>)>,
    pub face_count: usize,
    /// Faces of fewer than three corners, never made into triangles.
    pub short_faces: usize,
    /// Unit of the positions, millimetres where the file names any.
    pub unit: Unit,
    /// Step of the coordinates, where the file counts in steps.
    pub resolution: Option<f64>,
    /// Names of what the points have beside positions and normals; only told for clouds.
    pub left_out_attributes: Vec<String>,
    pub notes: Vec<String>,
}

/// Which parts of a file a parser has to keep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wanted {
    /// Positions and normals.
    Cloud,
    /// Positions, faces and colours.
    Mesh,
}

/// Faces as they are read: fans at first, since corners may be named before they are defined.
#[derive(Debug)]
pub(crate) struct Faces {
    pub triangles: Counted<[u32; 3]>,
    /// First triangle of each face of more than three corners, and how many it has.
    polygons: Counted<(u32, u32)>,
    /// Corners of the longest face so far: what cutting it will hold is booked.
    longest: usize,
    pub count: usize,
    pub short: usize,
}

impl Faces {
    pub fn new() -> Self {
        Self {
            triangles: Counted::new("triangles of the faces"),
            polygons: Counted::new("polygons"),
            longest: 3,
            count: 0,
            short: 0,
        }
    }

    /// Adds a face of any number of corners; indices are checked by the caller.
    pub fn push(
        &mut self,
        corners: impl ExactSizeIterator<Item = u32>,
        budget: &mut Budget,
    ) -> Result<(), Fault> {
        self.count += 1;
        self.short += usize::from(corners.len() < 3);
        if corners.len() > 3 {
            let first = u32::try_from(self.triangles.items.len());
            let (Ok(first), Ok(triangles)) = (first, u32::try_from(corners.len() - 2)) else {
                return Err(Fault::Value {
                    what: "the number of triangles",
                    value: self.triangles.items.len().to_string(),
                    remedy: "fewer than 4294967296 can be read; split the mesh",
                });
            };
            self.polygons.push((first, triangles), budget)?;
            if let Some(more) = corners.len().checked_sub(self.longest) {
                budget.reserve("the corners of a face", more as u64, polygon::BYTES_PER_CORNER)?;
                self.longest = corners.len();
            }
        }
        let mut fan = [0; 3];
        for (i, corner) in corners.enumerate() {
            match i {
                0 | 1 => fan[i] = corner,
                _ => {
                    fan[2] = corner;
                    self.triangles.push(fan, budget)?;
                    fan[1] = corner;
                }
            }
        }
        Ok(())
    }

    /// Hands the faces to `raw`, whose positions are complete. Polygons that are not convex are cut anew.
    ///
    /// `corner_normals` go with the corners of `triangles`.
    pub fn finish(mut self, raw: &mut RawShape) {
        let mut cutter = polygon::Cutter::default();
        for &(first, count) in &self.polygons.items {
            let run = first as usize..first as usize + count as usize;
            let fan = &mut self.triangles.items[run.clone()];
            if !cutter.cut(&raw.positions, fan) {
                continue;
            }
            let normals = raw.corner_normals.as_mut().map(|(n, _)| &mut n[run]);
            cutter.apply(fan);
            if let Some(n) = normals {
                cutter.apply(n);
            }
        }
        if cutter.uncut > 0 {
            raw.notes.push(format!(
                "{} of {} faces cross themselves or are too intricate; they were cut as fans",
                cutter.uncut, self.count
            ));
        }
        raw.triangles = self.triangles.items;
        raw.face_count = self.count;
        raw.short_faces = self.short;
    }
}
