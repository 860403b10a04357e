//! Points in memory, and where their normals come from.

use glam::DVec3;

use crate::{Fault, Unit};

/// Points of a scan, in the file's own unit unless a unit was stated.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// Finite positions, in file order.
    pub positions: Vec<DVec3>,
    /// One outward normal a point, of unit length, or exactly zero where the file gives none that can be used.
    pub normals: Option<Vec<DVec3>>,
    /// Where the normals come from.
    pub normal_source: NormalSource,
    /// Unit of the positions: millimetres where the file names any, otherwise unknown.
    pub unit: Unit,
    /// Step of the file's coordinates along the finest axis, in the unit of the positions; `None` where the file has
    /// floating-point numbers.
    pub resolution: Option<f64>,
    /// Points in the file, kept or not.
    pub file_count: usize,
    /// Faces in the file; 0 if it has none.
    pub face_count: usize,
    /// Faces of fewer than three different corners or of no area; they were left out.
    pub degenerate_faces: usize,
    /// Vertices that no face of any area uses, in a file that has faces; they were left out.
    pub unused_vertices: usize,
    /// Points with a coordinate that is NaN or infinite; they and their faces were left out.
    pub invalid_dropped: usize,
    /// Kept points whose normal is zero, not finite, or cancelled out between faces.
    pub zero_normals: usize,
    /// Names of what the points of the file have beside positions and normals, in the order of the file. It is not read, nor
    /// written. In LAS, where every point has a place for each, only what is not zero everywhere.
    pub left_out_attributes: Vec<String>,
    /// Repairs and doubts, each a sentence with its figures.
    pub notes: Vec<String>,
}

/// Origin of the normals of a [`PointCloud`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NormalSource {
    /// There are none.
    #[default]
    None,
    /// Stored with the points.
    Stored,
    /// Angle-weighted from the faces.
    Faces,
}

impl PointCloud {
    /// States the unit of the file and converts positions to millimetres.
    ///
    /// # Errors
    /// [`Fault::Value`] if `stated` is [`Unit::Unknown`] or the cloud already is in a known unit.
    pub fn to_mm(&mut self, stated: Unit) -> Result<(), Fault> {
        let scale = stated.scale_for("cloud", self.unit)?;
        for p in &mut self.positions {
            *p *= scale;
        }
        self.resolution = self.resolution.map(|r| r * scale);
        self.unit = Unit::Millimetre;
        Ok(())
    }
}
