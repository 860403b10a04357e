//! LAS and LAZ in and out [ASPRS, LAS Specification 1.4-R15].
//!
//! The header is read here, since every promise in it has to be checked before anything is made room for; the
//! compression is crate laz.

mod attributes;
pub(super) mod header;
pub(super) mod laz;
pub(super) mod unit;
mod write;

use glam::DVec3;

use self::attributes::Attributes;
use self::header::Header;
use super::cloud::PointCloud;
use super::normals;
use crate::limits::{Budget, Counted};
use crate::raw::RawShape;
use crate::{Fault, ReadLimits, Unit};

pub(super) use write::write;

/// Reads the bytes of a LAS or LAZ file, versions 1.0 to 1.4, point formats 0 to 10.
///
/// Points marked as withheld (deleted) are left out. Normals are read from extra bytes named `NormalX`, `nx` or
/// the like. Where the coordinate system is in metres, the cloud is in millimetres; otherwise in the file's unit.
///
/// # Errors
/// A [`Fault`] for a header that contradicts itself or promises more than there is, compressed points that do not
/// hold, or no usable point.
pub fn parse_las(bytes: &[u8], limits: &ReadLimits) -> Result<PointCloud, Fault> {
    let mut budget = Budget::new(limits);
    normals::finish(parse(bytes, &mut budget)?, &mut budget)
}

pub(super) fn parse(bytes: &[u8], budget: &mut Budget) -> Result<RawShape, Fault> {
    if bytes.is_empty() {
        return Err(Fault::Empty);
    }
    let header = header::read(bytes)?;
    let (unit, doubt) = unit::of(&header);
    let mut out = Out {
        header: &header,
        scale: unit.in_mm().unwrap_or(1.0),
        normal_columns: header.normal_columns(),
        positions: Counted::new("points"),
        normals: Counted::new("normals"),
        attributes: Attributes::new(&header),
        withheld: 0,
    };
    if header.is_compressed {
        laz::unpack(bytes, &header, budget, |point, budget| out.push(point, budget))?;
    } else {
        let rows = bytes[header.points_at..].chunks_exact(header.record_bytes);
        for point in rows.take(header.point_count as usize) {
            out.push(point, budget)?;
        }
    }
    let mut notes = Vec::from_iter(doubt);
    if out.withheld > 0 {
        notes.push(format!(
            "{} of {} points are marked as withheld; left out",
            out.withheld, header.point_count
        ));
    }
    Ok(RawShape {
        left_out_attributes: out.attributes.names(&header),
        normals: out.normal_columns.map(|_| out.normals.items),
        positions: out.positions.items,
        unit: if unit == Unit::Unknown {
            unit
        } else {
            Unit::Millimetre
        },
        resolution: Some(header.scale.min_element() * unit.in_mm().unwrap_or(1.0)),
        notes,
        ..Default::default()
    })
}

struct Out<'a> {
    header: &'a Header<'a>,
    /// To millimetres, where the unit is known.
    scale: f64,
    normal_columns: Option<[(usize, bool); 3]>,
    positions: Counted<DVec3>,
    normals: Counted<DVec3>,
    attributes: Attributes,
    withheld: u64,
}

impl Out<'_> {
    fn push(&mut self, point: &[u8], budget: &mut Budget) -> Result<(), Fault> {
        if self.header.is_withheld(point) {
            self.withheld += 1;
            return Ok(());
        }
        self.attributes.add(point);
        let x = |axis: usize| f64::from(header::u32_at(point, 4 * axis) as i32);
        let p = DVec3::new(x(0), x(1), x(2)) * self.header.scale + self.header.offset;
        self.positions.push(p * self.scale, budget)?;
        if let Some(columns) = self.normal_columns {
            let n = columns.map(|(at, is_double)| match is_double {
                true => f64::from_bits(header::u64_at(point, at)),
                false => f64::from(f32::from_bits(header::u32_at(point, at))),
            });
            self.normals.push(n.into(), budget)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
