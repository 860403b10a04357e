//! VTK ImageData out: XML with appended raw data in blocks compressed by zlib,
//! <https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html>. Voxels are points of the image.

use std::io::{self, Seek, Write};
use std::path::Path;

use flate2::Compression;
use flate2::write::ZlibEncoder;

use super::encode::Grid;
use super::encode::LEVEL;
use super::encode::{Slices, spacing_and_directions, words};
use super::voxel::VoxelType;
use crate::{FormatError, atomic};

/// Bytes that are compressed together; a multiple of every voxel's size.
const BLOCK: usize = 1 << 18;

/// Writes `path`.
pub(super) fn write(path: &Path, mut slices: Slices) -> Result<(), FormatError> {
    let voxel = Slices::unscaled(slices.grid, slices.store).map_err(|f| f.at(path))?;
    let head = head(slices.grid, voxel);
    atomic::replace(path, |out| {
        // The sizes of all blocks stand before the first of them.
        let mut blocks = Blocks {
            file: slices.scratch_file()?,
            open: Vec::with_capacity(BLOCK),
            packed: Vec::new(),
            last: 0,
        };
        slices.write_to(&mut blocks)?;
        blocks.pack()?;
        out.write_all(head.as_bytes())?;
        let partial = if blocks.last == BLOCK { 0 } else { blocks.last };
        for n in [blocks.packed.len() as u64, BLOCK as u64, partial as u64] {
            out.write_all(&n.to_le_bytes())?;
        }
        for n in &blocks.packed {
            out.write_all(&n.to_le_bytes())?;
        }
        blocks.file.rewind()?;
        io::copy(&mut blocks.file, out)?;
        out.write_all(b"\n  </AppendedData>\n</VTKFile>\n")
    })
}

fn head(grid: &Grid, voxel: VoxelType) -> String {
    let map = grid.map_mm();
    let (spacing, [x, y, z]) = spacing_and_directions(&map);
    let rows = (0..3).flat_map(|row| [x[row], y[row], z[row]]);
    let [nx, ny, nz] = grid.dims.map(|n| n - 1);
    let extent = format!("0 {nx} 0 {ny} 0 {nz}");
    let kind = match voxel {
        VoxelType::U8 => "UInt8",
        VoxelType::I8 => "Int8",
        VoxelType::U16 => "UInt16",
        VoxelType::I16 => "Int16",
        VoxelType::U32 => "UInt32",
        VoxelType::I32 => "Int32",
        VoxelType::U64 => "UInt64",
        VoxelType::I64 => "Int64",
        VoxelType::F32 => "Float32",
        VoxelType::F64 => "Float64",
    };
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" \
         header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n  <ImageData WholeExtent=\"{extent}\" \
         Origin=\"{}\" Spacing=\"{}\" Direction=\"{}\">\n    <Piece Extent=\"{extent}\">\n      \
         <PointData Scalars=\"density\">\n        <DataArray type=\"{kind}\" Name=\"density\" \
         format=\"appended\" offset=\"0\"/>\n      </PointData>\n    </Piece>\n  </ImageData>\n  \
         <AppendedData encoding=\"raw\">\n   _",
        words(map.translation.to_array(), " "),
        words(spacing.to_array(), " "),
        words(rows, " "),
    )
}

/// Cuts what is written into blocks and keeps them compressed in a file.
struct Blocks<W> {
    file: W,
    open: Vec<u8>,
    /// Compressed bytes of each block.
    packed: Vec<u64>,
    /// Bytes of the last block before compression.
    last: usize,
}

impl<W: Write> Blocks<W> {
    fn pack(&mut self) -> io::Result<()> {
        if self.open.is_empty() {
            return Ok(());
        }
        let mut zlib = ZlibEncoder::new(Vec::new(), Compression::new(LEVEL));
        zlib.write_all(&self.open)?;
        let packed = zlib.finish()?;
        self.file.write_all(&packed)?;
        self.packed.push(packed.len() as u64);
        self.last = self.open.len();
        self.open.clear();
        Ok(())
    }
}

impl<W: Write> Write for Blocks<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = bytes.len().min(BLOCK - self.open.len());
        self.open.extend_from_slice(&bytes[..taken]);
        if self.open.len() == BLOCK {
            self.pack()?;
        }
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
