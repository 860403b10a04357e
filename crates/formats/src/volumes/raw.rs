//! Voxels without a header, laid out as the user says.

use std::path::Path;

use glam::{DAffine3, DMat3, DVec3};

use super::geometry::{checked_dims, usable};
use super::slices;
use super::stream::{StreamSlices, check_length, skip, stored_bytes};
use super::volume::{Orientation, Volume, VolumeHeader};
use super::voxel::VoxelType;
use crate::input::{self, SkipRead};
use crate::limits::Budget;
use crate::{Fault, ReadLimits, Unit};

/// Where and how the voxels of a file without a header lie: x fastest, nothing between them.
#[derive(Clone, Debug, PartialEq)]
pub struct RawLayout {
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Type of the voxels.
    pub voxel: VoxelType,
    /// Order of the bytes of a voxel.
    pub big_endian: bool,
    /// Bytes before the first voxel, of the inflated content if the name ends in `.gz`.
    pub offset: u64,
    /// Distances between neighbouring voxels, in `unit`.
    pub spacing: [f64; 3],
    /// World coordinates of the centre of the first voxel, in `unit`; axes are taken as stored.
    pub origin: [f64; 3],
    /// Unit of the spacing and the origin.
    pub unit: Unit,
    /// Density = slope · stored + intercept.
    pub rescale: Option<[f64; 2]>,
}

/// Reads the (inflated) bytes of a file without a header.
///
/// # Errors
/// As [`super::read`], without the path.
pub fn parse_raw(bytes: &[u8], layout: &RawLayout, limits: &ReadLimits) -> Result<Volume, Fault> {
    let mut source = voxels(layout, Box::new(bytes), Some(bytes.len() as u64), true)?;
    slices::read(&mut source, &mut Budget::new(limits))
}

pub(super) fn open(path: &Path, layout: &RawLayout) -> Result<StreamSlices<'static>, Fault> {
    let input = input::open_by_name(path)?;
    let is_plain = matches!(input.source, input::Source::Plain(_));
    voxels(layout, Box::new(input.source), input.length_bound, is_plain)
}

/// `bound` is the length itself where `is_exact`.
fn voxels<'a>(
    layout: &RawLayout,
    mut source: Box<dyn SkipRead + 'a>,
    bound: Option<u64>,
    is_exact: bool,
) -> Result<StreamSlices<'a>, Fault> {
    let dims = checked_dims(layout.dims.map(|n| i64::try_from(n).unwrap_or(i64::MAX)))?;
    if let Some([slope, intercept]) = layout.rescale
        && !(slope.is_finite() && slope != 0.0 && intercept.is_finite())
    {
        return Err(Fault::Value {
            what: "the rescaling",
            value: format!("{slope}, {intercept}"),
            remedy: "both are finite and the slope is not 0",
        });
    }
    let scale = layout.unit.in_mm().unwrap_or(1.0);
    if layout.spacing.iter().any(|s| *s <= 0.0) {
        return Err(Fault::Value {
            what: "the spacing",
            value: format!("{:?}", layout.spacing),
            remedy: "the distances between voxels are above 0",
        });
    }
    let header = VolumeHeader {
        dims,
        world_from_voxel: usable(DAffine3 {
            matrix3: DMat3::from_diagonal(DVec3::from_array(layout.spacing) * scale),
            translation: DVec3::from_array(layout.origin) * scale,
        })?,
        unit: if layout.unit == Unit::Unknown {
            Unit::Unknown
        } else {
            Unit::Millimetre
        },
        orientation: Orientation::Spacings,
        stored: layout.voxel,
        rescale: layout.rescale,
    };
    let mut notes = vec!["the file has no header; axes are taken as stored".to_string()];
    if let Some(bound) = bound {
        let found = bound.saturating_sub(layout.offset);
        check_length(&header, found)?;
        let unread = found - stored_bytes(&header);
        if is_exact && unread > 0 {
            notes.push(format!(
                "{unread} bytes after the voxels were not read; are dimensions, type and offset right?"
            ));
        }
    }
    skip(&mut *source, layout.offset)?;
    Ok(StreamSlices::new(header, notes, layout.big_endian, source))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout() -> RawLayout {
        RawLayout {
            dims: [2, 1, 2],
            voxel: VoxelType::U16,
            big_endian: true,
            offset: 3,
            spacing: [0.5, 1.0, 2.0],
            origin: [1.0, 2.0, 3.0],
            unit: Unit::Centimetre,
            rescale: Some([0.5, -1.0]),
        }
    }

    #[test]
    fn bytes_become_densities_where_the_layout_says() {
        let bytes = [9, 9, 9, 0, 1, 1, 0, 0, 4, 0, 8, 7];
        let v = parse_raw(&bytes, &layout(), &ReadLimits::default()).unwrap();
        assert_eq!(v.values, [-0.5, 127.0, 1.0, 3.0]);
        assert_eq!(v.header.spacing(), DVec3::new(5.0, 10.0, 20.0));
        assert_eq!(
            v.header.world_from_voxel.translation,
            DVec3::new(10.0, 20.0, 30.0)
        );
        assert_eq!(v.header.unit, Unit::Millimetre);
        assert!(v.notes[1].starts_with("1 bytes after"), "{:?}", v.notes);
    }

    #[test]
    fn layouts_that_cannot_be_are_refused() {
        let bytes = [0; 100];
        for change in [
            |l: &mut RawLayout| l.dims = [usize::MAX, usize::MAX, 2],
            |l: &mut RawLayout| l.dims[1] = 0,
            |l: &mut RawLayout| l.dims[2] = 30,
            |l: &mut RawLayout| l.offset = u64::MAX,
            |l: &mut RawLayout| l.spacing[0] = -1.0,
            |l: &mut RawLayout| l.spacing[1] = f64::NAN,
            |l: &mut RawLayout| l.origin[1] = f64::INFINITY,
            |l: &mut RawLayout| l.rescale = Some([0.0, 1.0]),
        ] {
            let mut l = layout();
            change(&mut l);
            assert!(parse_raw(&bytes, &l, &ReadLimits::default()).is_err(), "{l:?}");
        }
    }
}
