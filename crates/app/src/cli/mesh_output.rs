use bspline::polygonize::Mesh;
use clap::ValueEnum;
use clap::builder::PossibleValuesParser;
use formats::Unit;
use glam::DVec3;

use super::failure::Outcome;
use super::keep::{Keep, LeftOut};
use super::output::Output;

/// Names that a mesh can be written under.
pub const MESHES: [&str; 7] = ["ply", "stl", "obj", "glb", "gltf", "3mf", "wrl"];

/// What is written of a mesh, and in which coordinates.
#[derive(Clone, Debug, clap::Args)]
pub struct MeshOutput {
    /// Leave out small pieces of the surface: keep the largest, the N largest, or those that enclose at least a volume
    /// (5mm3, 0.2cm3, 5unit3 in the field's own unit, 1% of the largest). Cavities stay with the piece around them, or are
    /// filled if they are smaller than the volume
    #[arg(long, value_name = "largest|N|VOLUME")]
    keep: Option<Keep>,
    /// Axes of the coordinates: those of the field (of a volume: right, anterior, superior), or with x and y reversed, as
    /// DICOM and ITK have them
    #[arg(long, value_enum, default_value_t = Axes::Ras)]
    axes: Axes,
    /// Unit to write the coordinates in: um, mm, cm or m [default: that of the field]. A field that names no unit is taken
    /// to be in this one
    #[arg(long, value_name = "UNIT")]
    unit: Option<Unit>,
    /// Format of the mesh where the name of the output does not tell it [default for -: ply]
    #[arg(long, value_name = "FORMAT", value_parser = PossibleValuesParser::new(MESHES))]
    pub format: Option<String>,
}

/// Directions of the coordinate axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Axes {
    /// Right, anterior, superior.
    Ras,
    /// Left, posterior, superior.
    Lps,
}

impl MeshOutput {
    /// Leaves out the pieces that are not wanted of a mesh in the coordinates of a field whose lengths are in `unit`.
    pub fn keep(&self, mesh: &mut Mesh, unit: Unit, notes: &mut Vec<String>) -> Outcome<Option<LeftOut>> {
        let unit = self.known(unit);
        let left = match self.keep {
            Some(keep) => keep.apply(mesh, unit)?,
            None => None,
        };
        notes.extend(left.iter().map(|l| l.note(unit)));
        Ok(left)
    }

    /// Writes the mesh; returns the unit of its coordinates.
    pub fn write(
        &self,
        mut mesh: Mesh,
        unit: Unit,
        output: &Output,
        notes: &mut Vec<String>,
    ) -> Outcome<Unit> {
        let known = self.known(unit);
        let written = self.unit.unwrap_or(known);
        let scale = match (known.in_mm(), written.in_mm()) {
            (Some(from), Some(to)) => from / to,
            _ => 1.0,
        };
        let turned = match self.axes {
            Axes::Ras => DVec3::ONE,
            Axes::Lps => DVec3::new(-1.0, -1.0, 1.0),
        };
        // Two axes reversed are half a turn: triangles keep their orientation.
        if scale != 1.0 || self.axes == Axes::Lps {
            mesh.positions.iter_mut().for_each(|p| *p *= turned * scale);
        }
        if unit == Unit::Unknown && written != Unit::Unknown {
            notes.push(format!(
                "the field names no unit; its numbers were taken for {written}"
            ));
        }
        let file = formats::meshes::Mesh {
            vertices: &mesh.positions,
            triangles: &mesh.triangles,
            colors: None,
            unit: written,
        };
        notes.extend(formats::meshes::save(output.path(), &file).map_err(|e| output.writing(e))?);
        Ok(written)
    }

    /// The unit of the field, as far as the file or the user tells.
    fn known(&self, field: Unit) -> Unit {
        match (field, self.unit) {
            (Unit::Unknown, Some(stated)) => stated,
            (known, _) => known,
        }
    }
}
