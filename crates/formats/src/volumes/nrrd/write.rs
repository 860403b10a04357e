//! NRRD out: one file, gzipped voxels, RAS.

use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;

use crate::volumes::encode::Grid;
use crate::volumes::encode::LEVEL;
use crate::volumes::encode::{Slices, words};
use crate::volumes::voxel::VoxelType;
use crate::{FormatError, Unit, atomic};

/// Writes `path`.
pub(in crate::volumes) fn write(path: &Path, mut slices: Slices) -> Result<(), FormatError> {
    let voxel = Slices::unscaled(slices.grid, slices.store).map_err(|f| f.at(path))?;
    let header = header(slices.grid, voxel);
    atomic::replace(path, |out| {
        out.write_all(header.as_bytes())?;
        let mut gz = GzEncoder::new(out, Compression::new(LEVEL));
        slices.write_to(&mut gz)?;
        gz.finish().map(drop)
    })
}

fn header(grid: &Grid, voxel: VoxelType) -> String {
    let map = grid.map_mm();
    let m = map.matrix3;
    let vector = |v: glam::DVec3| format!("({})", words(v.to_array(), ","));
    let unit = if grid.unit == Unit::Unknown {
        ""
    } else {
        "space units: \"mm\" \"mm\" \"mm\"\n"
    };
    let [nx, ny, nz] = grid.dims;
    let kind = match voxel {
        VoxelType::F32 => "float".to_string(),
        VoxelType::F64 => "double".to_string(),
        other => other.to_string(),
    };
    format!(
        "NRRD0004\n# Complete NRRD file format specification at:\n# \
         http://teem.sourceforge.net/nrrd/format.html\ntype: {kind}\ndimension: 3\n\
         space: right-anterior-superior\nsizes: {nx} {ny} {nz}\nspace directions: {} {} {}\n\
         kinds: domain domain domain\n{unit}endian: little\nencoding: gzip\nspace origin: {}\n\n",
        vector(m.x_axis),
        vector(m.y_axis),
        vector(m.z_axis),
        vector(map.translation)
    )
}
