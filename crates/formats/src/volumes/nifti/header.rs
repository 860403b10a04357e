//! Headers of NIfTI-1 (348 bytes) and NIfTI-2 (540 bytes) single files, of either endianness.

use std::io::Read;

use super::affine::{self, Transforms};
use crate::input::read_fault;
use crate::kind::VolumeFormat;
use crate::volumes::geometry::checked_dims;
use crate::volumes::several::Several;
use crate::volumes::volume::VolumeHeader;
use crate::volumes::voxel::VoxelType;
use crate::{Fault, Unit};

pub(super) const SIZE_1: usize = 348;
const SIZE_2: usize = 540;

/// A header and what reading the voxels needs of it.
#[derive(Debug)]
pub(super) struct Parsed {
    /// Of the volume that is read.
    pub header: VolumeHeader,
    /// Which of those in the file, if there are several.
    pub several: Option<Several>,
    pub notes: Vec<String>,
    pub big_endian: bool,
    /// The voxels are in a file of their own.
    pub is_pair: bool,
    /// Byte at which the voxels start.
    pub voxels_at: u64,
    /// Bytes read so far.
    pub consumed: u64,
}

/// Which NIfTI a content that starts so is, if any.
pub(crate) fn nifti_format(head: &[u8]) -> Option<VolumeFormat> {
    let magic = match sizes(head)?.0 {
        SIZE_1 => head.get(344..347)?,
        _ => head.get(4..7)?,
    };
    match magic {
        b"n+1" | b"n+2" => Some(VolumeFormat::Nifti),
        b"ni1" | b"ni2" => Some(VolumeFormat::NiftiPair),
        _ => None,
    }
}

/// Header size and endianness from the first four bytes.
fn sizes(head: &[u8]) -> Option<(usize, bool)> {
    let raw: [u8; 4] = head.get(..4)?.try_into().ok()?;
    [(SIZE_1, false), (SIZE_2, false), (SIZE_1, true), (SIZE_2, true)]
        .into_iter()
        .find(|(size, big)| {
            let n = if *big {
                i32::from_be_bytes(raw)
            } else {
                i32::from_le_bytes(raw)
            };
            n == *size as i32
        })
}

/// Numbers at byte offsets.
struct Bytes<'a> {
    raw: &'a [u8],
    big: bool,
}

macro_rules! getter {
    ($name:ident, $t:ty) => {
        fn $name(&self, at: usize) -> $t {
            let raw = self.raw[at..at + size_of::<$t>()]
                .try_into()
                .expect("offset within the header");
            if self.big {
                <$t>::from_be_bytes(raw)
            } else {
                <$t>::from_le_bytes(raw)
            }
        }
    };
}

impl Bytes<'_> {
    getter!(i16, i16);
    getter!(i32, i32);
    getter!(i64, i64);
    getter!(f32, f32);
    getter!(f64, f64);

    fn f32s<const N: usize>(&self, at: usize) -> [f64; N] {
        std::array::from_fn(|i| f64::from(self.f32(at + 4 * i)))
    }
    fn f64s<const N: usize>(&self, at: usize) -> [f64; N] {
        std::array::from_fn(|i| self.f64(at + 8 * i))
    }
}

/// The fields used, the same for both versions.
struct Fields {
    dim: [i64; 8],
    datatype: i16,
    voxels_at: f64,
    slope: f64,
    intercept: f64,
    units: i32,
    transforms: Transforms,
}

/// Reads a header from the start of a content; `volume` is which of several is wanted.
pub(super) fn read(source: &mut impl Read, volume: Option<usize>) -> Result<Parsed, Fault> {
    let mut raw = [0; SIZE_2];
    fill(source, &mut raw[..SIZE_1], 0)?;
    let (size, big) = sizes(&raw).ok_or_else(|| Fault::Value {
        what: "the first number of the file",
        value: i32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]]).to_string(),
        remedy: "a NIfTI file starts with 348 or 540; convert other formats to .nii first",
    })?;
    if size == SIZE_2 {
        fill(source, &mut raw[SIZE_1..], SIZE_1)?;
    }
    let b = Bytes { raw: &raw, big };
    let magic = if size == SIZE_1 {
        &raw[344..347]
    } else {
        &raw[4..7]
    };
    let is_pair = match magic {
        b"n+1" | b"n+2" => false,
        b"ni1" | b"ni2" => true,
        other => {
            return Err(Fault::Value {
                what: "the magic",
                value: crate::error::excerpt(other),
                remedy: "a NIfTI file says n+1 or n+2; an ANALYZE file has to be converted to .nii first",
            });
        }
    };
    let fields = if size == SIZE_1 {
        version_1(&b)
    } else {
        version_2(&b)
    };
    let mut parsed = check(fields, size, is_pair, volume)?;
    parsed.big_endian = big;
    Ok(parsed)
}

fn fill(source: &mut impl Read, buffer: &mut [u8], before: usize) -> Result<(), Fault> {
    let mut got = 0;
    while got < buffer.len() {
        match source.read(&mut buffer[got..]) {
            Ok(0) if got + before == 0 => return Err(Fault::Empty),
            Ok(0) => {
                return Err(Fault::Truncated {
                    what: "the header".into(),
                    needed: (before + buffer.len()) as u64,
                    found: (before + got) as u64,
                });
            }
            Ok(n) => got += n,
            Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
            Err(e) => return Err(read_fault(e)),
        }
    }
    Ok(())
}

fn version_1(b: &Bytes) -> Fields {
    let pixdim: [f64; 8] = b.f32s(76);
    Fields {
        dim: std::array::from_fn(|i| i64::from(b.i16(40 + 2 * i))),
        datatype: b.i16(70),
        voxels_at: b.f32(108).into(),
        slope: b.f32(112).into(),
        intercept: b.f32(116).into(),
        units: b.raw[123].into(),
        transforms: Transforms {
            qform_code: b.i16(252).into(),
            sform_code: b.i16(254).into(),
            qfac: pixdim[0],
            spacing: [pixdim[1], pixdim[2], pixdim[3]],
            quaternion: b.f32s(256),
            offset: b.f32s(268),
            rows: [b.f32s(280), b.f32s(296), b.f32s(312)],
        },
    }
}

fn version_2(b: &Bytes) -> Fields {
    let pixdim: [f64; 8] = b.f64s(104);
    Fields {
        dim: std::array::from_fn(|i| b.i64(16 + 8 * i)),
        datatype: b.i16(12),
        voxels_at: b.i64(168) as f64,
        slope: b.f64(176),
        intercept: b.f64(184),
        units: b.i32(500),
        transforms: Transforms {
            qform_code: b.i32(344),
            sform_code: b.i32(348),
            qfac: pixdim[0],
            spacing: [pixdim[1], pixdim[2], pixdim[3]],
            quaternion: b.f64s(352),
            offset: b.f64s(376),
            rows: [b.f64s(400), b.f64s(432), b.f64s(464)],
        },
    }
}

fn check(f: Fields, size: usize, is_pair: bool, volume: Option<usize>) -> Result<Parsed, Fault> {
    let axes = f.dim[0];
    if !(1..=7).contains(&axes) {
        return Err(Fault::Value {
            what: "the number of dimensions",
            value: axes.to_string(),
            remedy: "a NIfTI header has 1 to 7",
        });
    }
    // Axes that the header does not count are 1, whatever stands there.
    let extent = |i: usize| if i as i64 <= axes { f.dim[i] } else { 1 };
    if let Some(n) = (4..8).map(extent).find(|n| *n < 1) {
        return Err(Fault::Value {
            what: "a dimension",
            value: n.to_string(),
            remedy: "every dimension is at least 1",
        });
    }
    // The first of the further axes runs fastest: a number counts through all of them.
    let count = (4..8).map(extent).fold(1u64, |n, d| n.saturating_mul(d as u64));
    let several = Several::choose(count, volume)?;
    let dims = checked_dims([1, 2, 3].map(extent))?;
    let stored = VoxelType::from_code(f.datatype).ok_or_else(|| Fault::Value {
        what: "the voxel type",
        value: match f.datatype {
            1 => "1 (bits)".into(),
            32 | 1792 | 2048 => format!("{} (complex)", f.datatype),
            128 | 2304 => format!("{} (colour)", f.datatype),
            1536 => "1536 (128-bit float)".into(),
            other => other.to_string(),
        },
        remedy: "read are int8 to int64, uint8 to uint64, float32 and float64; convert it to one of these",
    })?;
    // Four bytes after the header tell of extensions; older writers leave them out.
    let earliest = if is_pair { 0.0 } else { size as f64 };
    if !(f.voxels_at >= earliest && f.voxels_at <= 1e12 && f.voxels_at.fract() == 0.0) {
        return Err(Fault::Value {
            what: "the start of the voxels (vox_offset)",
            value: f.voxels_at.to_string(),
            remedy: "it is a whole number of bytes after the header; is the header damaged?",
        });
    }
    let mut notes = Vec::from_iter(several.map(|s| s.note()));
    let (mut world_from_voxel, orientation) = affine::choose(&f.transforms, &mut notes)?;
    let unit = match f.units & 7 {
        1 => Unit::Metre,
        2 => Unit::Millimetre,
        3 => Unit::Micrometre,
        _ => Unit::Unknown,
    };
    if let Some(scale) = unit.in_mm() {
        world_from_voxel.matrix3 *= scale;
        world_from_voxel.translation *= scale;
    } else {
        notes.push("the file names no unit of length".into());
    }
    // A slope of 0 or NaN means: no rescaling.
    let rescale = match (f.slope, f.intercept) {
        (s, _) if s == 0.0 || s.is_nan() => None,
        (1.0, 0.0) => None,
        (s, i) if s.is_finite() && i.is_finite() => Some([s, i]),
        (s, i) => {
            return Err(Fault::Value {
                what: "the rescaling (scl_slope, scl_inter)",
                value: format!("{s}, {i}"),
                remedy: "both are finite; set them in the header and save the volume again",
            });
        }
    };
    let header = VolumeHeader {
        dims,
        world_from_voxel,
        unit: if unit == Unit::Unknown {
            unit
        } else {
            Unit::Millimetre
        },
        orientation,
        stored,
        rescale,
    };
    Ok(Parsed {
        header,
        several,
        notes,
        big_endian: false,
        is_pair,
        voxels_at: f.voxels_at as u64,
        consumed: size as u64,
    })
}
