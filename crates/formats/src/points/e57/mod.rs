//! E57 in and out [ASTM E2807], by crate e57.

mod meter;
mod write;

use std::io::{Read, Seek};

use e57::{E57Reader, RawValues, Record, RecordDataType, RecordName};
use glam::{DAffine3, DQuat, DVec3};

use self::meter::{Meter, Metered};
use super::cloud::PointCloud;
use super::normals;
use crate::limits::{Budget, Counted};
use crate::raw::RawShape;
use crate::{Fault, ReadLimits, Unit, guard};

pub(super) use write::write;

pub(super) const MM_PER_METRE: f64 = 1000.0;
/// Bytes of the parsed description for each byte of its text: a node takes 4 bytes at least.
const XML_RATIO: usize = 40;
/// Points decoded at once.
const BATCH: usize = 4096;
/// Bits of a value in the decoder's queues.
const VALUE_BITS: u64 = 128;

/// Reads the bytes of an E57 file: all scans, each moved by its pose.
///
/// Lengths are metres by the standard; the cloud is in millimetres. Points marked as invalid, and those that are a
/// direction without a range, are left out; spherical coordinates are converted. Normals are those of the extension
/// for surface normals, if every scan has them. The notes name the scans.
///
/// # Errors
/// A [`Fault`] for a checksum or description that does not hold, points that end early, or no usable point.
pub fn parse_e57(bytes: &[u8], limits: &ReadLimits) -> Result<PointCloud, Fault> {
    let mut budget = Budget::new(limits);
    normals::finish(parse(bytes, &mut budget)?, &mut budget)
}

pub(super) fn damaged(e: &e57::Error) -> Fault {
    // The cause is what helps: a checksum, a cut.
    let cause = std::error::Error::source(e)
        .map(|c| format!(" ({c})"))
        .unwrap_or_default();
    Fault::Damaged {
        what: format!("{e}{cause}"),
    }
}

pub(super) fn parse(bytes: &[u8], budget: &mut Budget) -> Result<RawShape, Fault> {
    if bytes.is_empty() {
        return Err(Fault::Empty);
    }
    let word = |at: usize| {
        bytes
            .get(at..at + 8)
            .map(|b| u64::from_le_bytes(b.try_into().expect("eight bytes")))
    };
    let (Some(xml_bytes), Some(_)) = (word(32), word(40)) else {
        return Err(Fault::Truncated {
            what: "the header".into(),
            needed: 48,
            found: bytes.len() as u64,
        });
    };
    if xml_bytes > bytes.len() as u64 {
        return Err(Fault::Truncated {
            what: "the description of the scans".into(),
            needed: xml_bytes,
            found: bytes.len() as u64,
        });
    }
    budget.reserve("the description of the scans", xml_bytes, XML_RATIO)?;
    let (content, meter) = Metered::new(bytes);
    let mut reader = guard::decode("decoder of E57", || {
        E57Reader::new(content).map_err(|e| damaged(&e))
    })?;
    let scans = reader.pointclouds();
    let mut out = Out {
        positions: Counted::new("points"),
        normals: Counted::new("normals"),
        invalid: 0,
    };
    let mut raw = RawShape {
        unit: Unit::Millimetre,
        ..Default::default()
    };
    let columns: Vec<Columns> = scans
        .iter()
        .map(|s| Columns::of(&s.prototype))
        .collect::<Result<_, _>>()?;
    let with_normals = columns.iter().filter(|c| c.normal.is_some()).count();
    let takes_normals = with_normals > 0 && with_normals == scans.len();
    if with_normals > 0 && !takes_normals {
        raw.notes.push(format!(
            "{with_normals} of {} scans have normals; they were skipped",
            scans.len()
        ));
    }
    for record in scans.iter().flat_map(|s| &s.prototype) {
        if let Some(name) = attribute(&record.name, takes_normals)
            && !raw.left_out_attributes.contains(&name)
        {
            raw.left_out_attributes.push(name);
        }
    }
    for (i, (scan, columns)) in scans.iter().zip(&columns).enumerate() {
        let before = (out.positions.items.len(), out.invalid);
        let pose = pose(scan);
        meter.read.set(0);
        meter.quota.set(u64::MAX);
        let mut points = guard::decode("decoder of E57", || {
            reader.pointcloud_raw(scan).map_err(|e| damaged(&e))
        })?;
        let mut batch: Vec<RawValues> = Vec::with_capacity(BATCH);
        let mut count = 0;
        loop {
            batch.clear();
            columns.limit(&meter, count, budget);
            let result = guard::decode("decoder of E57", || fill(&mut points, &mut batch));
            if meter.read.get() > meter.quota.get() {
                return Err(Fault::Limit {
                    what: "what waits in the decoder for its partners",
                    needed: budget.left() + 1,
                    limit: budget.left(),
                });
            }
            result?;
            if batch.is_empty() {
                break;
            }
            count += batch.len() as u64;
            for values in &batch {
                out.push(values, columns, &scan.prototype, &pose, takes_normals, budget)?;
            }
        }
        if scans.len() > 1 || scan.transform.is_some() {
            let name: String = scan
                .name
                .as_deref()
                .unwrap_or("unnamed")
                .chars()
                .take(40)
                .collect();
            raw.notes.push(format!(
                "scan {} of {} ({name:?}): {} points, {}",
                i + 1,
                scans.len(),
                out.positions.items.len() - before.0,
                if scan.transform.is_some() {
                    "moved by its pose"
                } else {
                    "without a pose"
                },
            ));
        }
    }
    if out.invalid > 0 {
        raw.notes
            .push(format!("{} points are marked as invalid; left out", out.invalid));
    }
    raw.positions = out.positions.items;
    raw.normals = takes_normals.then_some(out.normals.items);
    Ok(raw)
}

/// Decodes the next points, none at the end.
fn fill<T: Read + Seek>(
    points: &mut e57::PointCloudReaderRaw<T>,
    batch: &mut Vec<RawValues>,
) -> Result<(), Fault> {
    for values in points.take(BATCH) {
        batch.push(values.map_err(|e| damaged(&e))?);
    }
    Ok(())
}

pub(super) fn pose(scan: &e57::PointCloud) -> DAffine3 {
    match &scan.transform {
        None => DAffine3::IDENTITY,
        Some(t) => DAffine3::from_rotation_translation(
            DQuat::from_xyzw(t.rotation.x, t.rotation.y, t.rotation.z, t.rotation.w).normalize(),
            DVec3::new(t.translation.x, t.translation.y, t.translation.z),
        ),
    }
}

/// Name of what a scan has beside positions and normals.
fn attribute(name: &RecordName, takes_normals: bool) -> Option<String> {
    let name = match name {
        RecordName::Intensity => "intensity",
        RecordName::ColorRed | RecordName::ColorGreen | RecordName::ColorBlue => "color",
        RecordName::RowIndex => "row_index",
        RecordName::ColumnIndex => "column_index",
        RecordName::ReturnCount | RecordName::ReturnIndex => "returns",
        RecordName::TimeStamp => "time_stamp",
        RecordName::Unknown { namespace, .. } if namespace == "nor" && takes_normals => return None,
        RecordName::Unknown { name, .. } => name,
        _ => return None,
    };
    Some(name.to_owned())
}

/// Where in a row of a scan the wanted values stand.
pub(super) struct Columns {
    pub cartesian: Option<[usize; 3]>,
    pub cartesian_invalid: Option<usize>,
    /// Range, azimuth and elevation.
    pub spherical: Option<[usize; 3]>,
    pub spherical_invalid: Option<usize>,
    pub normal: Option<[usize; 3]>,
    /// Bits of a row, and of its shortest value.
    row_bits: u64,
    least_bits: u64,
}

impl Columns {
    pub fn of(prototype: &[Record]) -> Result<Self, Fault> {
        let find = |name: &RecordName| prototype.iter().position(|r| r.name == *name);
        let three = |names: [RecordName; 3]| {
            let [a, b, c] = names.map(|n| find(&n));
            Some([a?, b?, c?])
        };
        let normal = |axis: &str| RecordName::Unknown {
            namespace: "nor".into(),
            name: format!("normal{axis}"),
        };
        let bits: Vec<u64> = prototype.iter().map(|r| bits(&r.data_type)).collect();
        // The decoder would make up values of no bits without end.
        let least_bits = bits.iter().copied().filter(|b| *b > 0).min();
        let columns = Self {
            cartesian: three([
                RecordName::CartesianX,
                RecordName::CartesianY,
                RecordName::CartesianZ,
            ]),
            cartesian_invalid: find(&RecordName::CartesianInvalidState),
            spherical: three([
                RecordName::SphericalRange,
                RecordName::SphericalAzimuth,
                RecordName::SphericalElevation,
            ]),
            spherical_invalid: find(&RecordName::SphericalInvalidState),
            normal: three([normal("X"), normal("Y"), normal("Z")]),
            row_bits: bits.iter().sum(),
            least_bits: least_bits.unwrap_or(0),
        };
        if least_bits.is_none() || columns.cartesian.is_none() && columns.spherical.is_none() {
            return Err(Fault::Value {
                what: "the list of attributes of a scan",
                value: format!("{} attributes of {} bits", prototype.len(), columns.row_bits),
                remedy: "a scan needs cartesian or spherical coordinates that differ",
            });
        }
        Ok(columns)
    }

    /// Sets the bytes that may be read for the next batch.
    ///
    /// Attributes come in packets of their own lengths, and the decoder keeps what has no partner yet: at 1 bit a
    /// value, 128 times the bytes of the file. What is read beyond the points' own bytes must fit the budget so.
    fn limit(&self, meter: &Meter, points: u64, budget: &Budget) {
        let own = (points + BATCH as u64).saturating_mul(self.row_bits) / 8;
        let waiting = budget.left() / (VALUE_BITS / self.least_bits.max(1)).max(1);
        // Heads of packets and checksums of pages take little.
        meter
            .quota
            .set(own.saturating_add(own / 50).saturating_add(waiting));
    }
}

pub(super) fn bits(kind: &RecordDataType) -> u64 {
    match kind {
        RecordDataType::Single { .. } => 32,
        RecordDataType::Double { .. } => 64,
        RecordDataType::ScaledInteger { min, max, .. } | RecordDataType::Integer { min, max } => {
            let range = i128::from(*max) - i128::from(*min);
            if range > 0 {
                u64::from(range.ilog2()) + 1
            } else {
                0
            }
        }
    }
}

struct Out {
    positions: Counted<DVec3>,
    normals: Counted<DVec3>,
    invalid: u64,
}

impl Out {
    fn push(
        &mut self,
        values: &RawValues,
        columns: &Columns,
        prototype: &[Record],
        pose: &DAffine3,
        takes_normals: bool,
        budget: &mut Budget,
    ) -> Result<(), Fault> {
        let value = |i: usize| values[i].to_f64(&prototype[i].data_type).map_err(|e| damaged(&e));
        let three = |c: [usize; 3]| Ok::<_, Fault>(DVec3::new(value(c[0])?, value(c[1])?, value(c[2])?));
        let is_valid =
            |state: Option<usize>| Ok::<_, Fault>(state.map(value).transpose()?.unwrap_or(0.0) == 0.0);
        let local = match (columns.cartesian, columns.spherical) {
            (Some(c), _) if is_valid(columns.cartesian_invalid)? => three(c)?,
            (_, Some(s)) if is_valid(columns.spherical_invalid)? => {
                let [range, azimuth, elevation] = three(s)?.to_array();
                DVec3::new(
                    elevation.cos() * azimuth.cos(),
                    elevation.cos() * azimuth.sin(),
                    elevation.sin(),
                ) * range
            }
            _ => {
                self.invalid += 1;
                return Ok(());
            }
        };
        self.positions
            .push(pose.transform_point3(local) * MM_PER_METRE, budget)?;
        if let (true, Some(n)) = (takes_normals, columns.normal) {
            self.normals.push(pose.transform_vector3(three(n)?), budget)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
