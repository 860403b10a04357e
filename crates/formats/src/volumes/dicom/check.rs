//! Which pictures can be densities at all, and which can stand in one volume.

use super::dataset::{DataSet, PixelKind};
use super::pixels::Layout;
use super::scan::File;
use super::syntax::{self, Codec};
use crate::Fault;
use crate::volumes::voxel::VoxelType;

/// Refuses pictures that are no densities: colour, bits, tables instead of a rescaling.
pub(super) fn is_scalar(data: &DataSet) -> Result<(), Fault> {
    let refuse = |what, value: String, remedy| Err(Fault::Value { what, value, remedy });
    let format = &data.format;
    let Some(pixels) = &data.pixels else {
        return refuse(
            "the number of pictures",
            "0".into(),
            "reports and plans hold none; name the files of an image series",
        );
    };
    if data.is_mosaic {
        return refuse(
            "the kind of the picture",
            "a mosaic, which holds the slices of a volume as tiles (Siemens)".into(),
            "split it first, for instance by dcm2niix, and read what that writes",
        );
    }
    if data.syntax.codec.is_none() {
        return Err(syntax::refusal(&data.syntax_uid));
    }
    if data.rows == 0 || data.columns == 0 || data.rows > 1 << 16 || data.columns > 1 << 16 {
        return refuse(
            "the size of a picture (columns, rows)",
            format!("{} x {}", data.columns, data.rows),
            "both are at least 1; the header is damaged, export the series again",
        );
    }
    if format.samples != 1 || !format.photometric.starts_with("MONOCHROME") {
        return refuse(
            "the photometric interpretation",
            format!("{} with {} samples a pixel", format.photometric, format.samples),
            "colours are no densities; read are MONOCHROME1 and MONOCHROME2",
        );
    }
    if data.has_modality_table {
        return refuse(
            "the rescaling",
            "a table (0028,3000)".into(),
            "read are a slope and an intercept; export the series with these",
        );
    }
    if pixels.kind != PixelKind::Integer {
        return Ok(());
    }
    let (allocated, stored, high) = (format.bits_allocated, format.bits_stored, format.high_bit);
    if ![8, 16, 32].contains(&allocated)
        || stored == 0
        || stored > allocated
        || high >= allocated
        || high + 1 < stored
    {
        return refuse(
            "the bits of a pixel (allocated, stored, highest)",
            format!("{allocated}, {stored}, {high}"),
            "read are 8, 16 or 32 allocated ones, which hold the stored ones",
        );
    }
    Ok(())
}

/// Refuses a file that cannot stand in one volume with the first.
pub(super) fn goes_with(first: &File, file: &File) -> Result<(), Fault> {
    let (a, b) = (&first.data, &file.data);
    let differ = |what, of_a: String, of_b: String, remedy| {
        Err(Fault::Value {
            what,
            value: format!("mixed: {of_a} in {}, {of_b} in {}", first.name, file.name),
            remedy,
        })
    };
    const APART: &str = "move the pictures of one kind to a directory of their own";
    if (a.rows, a.columns) != (b.rows, b.columns) {
        return differ(
            "the size of the pictures",
            format!("{} x {}", a.columns, a.rows),
            format!("{} x {}", b.columns, b.rows),
            APART,
        );
    }
    if a.format.photometric != b.format.photometric {
        return differ(
            "the photometric interpretation",
            a.format.photometric.clone(),
            b.format.photometric.clone(),
            APART,
        );
    }
    let unit = |d: &DataSet| {
        let own = d.frames.first().and_then(|f| f.rescale_type.clone());
        own.or_else(|| d.common.rescale_type.clone()).unwrap_or_default()
    };
    if unit(a) != unit(b) {
        return differ(
            "the unit of the rescaled values",
            format!("{:?}", unit(a)),
            format!("{:?}", unit(b)),
            APART,
        );
    }
    Ok(())
}

/// Frames of a file, against the bytes that are there for them.
pub(super) fn frame_count(data: &DataSet) -> Result<u32, Fault> {
    let count = data.frame_count.unwrap_or(1);
    let Some(pixels) = &data.pixels else {
        return Ok(count);
    };
    if count == 0 {
        return Err(Fault::Value {
            what: "the number of frames",
            value: "0".into(),
            remedy: "it is at least 1; the header is damaged, export the series again",
        });
    }
    let is_native = data.syntax.codec == Some(Codec::Native);
    match (pixels.length, pixels.left) {
        (None, Some(left)) if !is_native => {
            // Each frame has a fragment of its own, and that a head of 8 bytes.
            let needed = u64::from(count) * 8;
            short(needed, left)?;
        }
        (Some(length), left) if is_native => {
            let frame = u64::from(data.rows) * u64::from(data.columns) * layout_of(data).bytes as u64;
            short(frame.saturating_mul(count.into()), length.into())?;
            short(length.into(), left.unwrap_or(u64::MAX))?;
        }
        _ => {
            return Err(Fault::Damaged {
                what: "the pixels are not written as the transfer syntax says".into(),
            });
        }
    }
    Ok(count)
}

fn short(needed: u64, found: u64) -> Result<(), Fault> {
    if needed <= found {
        return Ok(());
    }
    Err(Fault::Truncated {
        what: "the block of pixels".into(),
        needed,
        found,
    })
}

/// How the pixels of a file lie, as [`is_scalar`] let them pass.
pub(super) fn layout_of(data: &DataSet) -> Layout {
    let format = &data.format;
    let pixels = data.pixels.as_ref().expect("files without pixels were refused");
    let (bytes, bits_stored, high_bit) = match pixels.kind {
        PixelKind::Integer => (
            format.bits_allocated as usize / 8,
            format.bits_stored,
            format.high_bit,
        ),
        PixelKind::Float32 => (4, 32, 31),
        PixelKind::Float64 => (8, 64, 63),
    };
    let big_endian = data.syntax.encoding.big_endian;
    Layout {
        kind: pixels.kind,
        bytes,
        big_endian,
        swapped_pairs: big_endian && bytes == 1 && pixels.words,
        bits_stored,
        high_bit,
        signed: format.signed,
    }
}

/// The type that numbers of that layout have.
pub(super) fn voxel_type(layout: &Layout) -> VoxelType {
    match (layout.kind, layout.bytes, layout.signed) {
        (PixelKind::Float32, ..) => VoxelType::F32,
        (PixelKind::Float64, ..) => VoxelType::F64,
        (_, 1, false) => VoxelType::U8,
        (_, 1, true) => VoxelType::I8,
        (_, 2, false) => VoxelType::U16,
        (_, 2, true) => VoxelType::I16,
        (_, _, false) => VoxelType::U32,
        (_, _, true) => VoxelType::I32,
    }
}
