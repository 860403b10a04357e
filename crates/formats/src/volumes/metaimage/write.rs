//! MetaImage out: `.mha`, compressed voxels, LPS as ITK has it.

use std::io::{self, Seek};
use std::path::Path;

use flate2::Compression;
use flate2::write::ZlibEncoder;

use crate::volumes::encode::Grid;
use crate::volumes::encode::LEVEL;
use crate::volumes::encode::{Slices, spacing_and_directions, words};
use crate::volumes::geometry::{RAS_FROM_LPS, in_world};
use crate::volumes::voxel::VoxelType;
use crate::{FormatError, Unit, atomic};

/// Writes `path`.
pub(in crate::volumes) fn write(path: &Path, mut slices: Slices) -> Result<(), FormatError> {
    let voxel = Slices::unscaled(slices.grid, slices.store).map_err(|f| f.at(path))?;
    atomic::replace(path, |out| {
        // The header tells the compressed length, without which ITK reads nothing.
        let mut zlib = ZlibEncoder::new(slices.scratch_file()?, Compression::new(LEVEL));
        slices.write_to(&mut zlib)?;
        let mut packed = zlib.finish()?;
        let length = packed.stream_position()?;
        out.write_all(header(slices.grid, voxel, length).as_bytes())?;
        packed.rewind()?;
        io::copy(&mut packed, out).map(drop)
    })
}

fn header(grid: &Grid, voxel: VoxelType, length: u64) -> String {
    let map = in_world(&grid.map_mm(), RAS_FROM_LPS);
    let (spacing, directions) = spacing_and_directions(&map);
    let unit = if grid.unit == Unit::Unknown {
        ""
    } else {
        "DistanceUnits = mm\n"
    };
    let [nx, ny, nz] = grid.dims;
    let element = match voxel {
        VoxelType::U8 => "MET_UCHAR",
        VoxelType::I8 => "MET_CHAR",
        VoxelType::U16 => "MET_USHORT",
        VoxelType::I16 => "MET_SHORT",
        VoxelType::U32 => "MET_UINT",
        VoxelType::I32 => "MET_INT",
        VoxelType::U64 => "MET_ULONG_LONG",
        VoxelType::I64 => "MET_LONG_LONG",
        VoxelType::F32 => "MET_FLOAT",
        VoxelType::F64 => "MET_DOUBLE",
    };
    format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n\
         CompressedData = True\nCompressedDataSize = {length}\nTransformMatrix = {}\nOffset = {}\n\
         CenterOfRotation = 0 0 0\n{unit}ElementSpacing = {}\nDimSize = {nx} {ny} {nz}\n\
         ElementType = {element}\nElementDataFile = LOCAL\n",
        words(directions.iter().flat_map(|d| d.to_array()), " "),
        words(map.translation.to_array(), " "),
        words(spacing.to_array(), " "),
    )
}
