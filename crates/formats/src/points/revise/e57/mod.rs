//! E57 written again [ASTM E2807]: the points of scans with edits are packed anew, all else stays as it is, to the bit: the other scans, pictures,
//! what the description says.
//!
//! New points stand at the end of the scan of the row whose attributes they get. Packed points stand where the old ones did, or at
//! the end of the file where there are more.

mod description;
mod pages;
mod section;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::io::Cursor;
use std::ops::Range;

use e57::{E57Reader, RawValues, Record, RecordDataType, RecordValue};
use glam::{DAffine3, DVec3};

use self::description::Scan;
use self::pages::Paged;
use self::section::Section;
use super::{CloudChanges, Placed, Row, Rows};
use crate::Fault;
use crate::limits::Budget;
use crate::points::e57::{Columns, MM_PER_METRE, damaged, parse, pose};

/// Bytes of the head of a section of points.
const SECTION_HEAD: usize = 32;

/// The bytes of the file with its changes. Rows are those of the cloud that is read: all scans, without points that are marked as invalid.
pub fn revised(bytes: &[u8], changes: &CloudChanges, budget: &mut Budget) -> Result<Vec<u8>, Fault> {
    if *changes == CloudChanges::default() {
        return Ok(bytes.to_vec());
    }
    // The decoder comes through what it came through once.
    let whole = parse(bytes, budget)?.positions.len();
    budget.reserve("the scans, packed anew", bytes.len() as u64, 3)?;
    let mut file = Paged::of(bytes)?;
    let text = file.description()?;
    let told = description::scans(&text)?;
    file.take_description();
    let mut words = Vec::new();
    let mut rows = Rows::of(changes);
    let mut kept = BTreeMap::new();
    let wanted: BTreeSet<usize> = changes.added.iter().map(|p| p.row).collect();
    let mut row = 0;
    let mut reader = E57Reader::new(Cursor::new(bytes)).map_err(|e| damaged(&e))?;
    for (scan, told) in reader.pointclouds().iter().zip(&told) {
        let mut edited = Edited::of(&scan.prototype, pose(scan))?;
        let first = row;
        let mut is_new = [false; 2];
        for values in reader.pointcloud_raw(scan).map_err(|e| damaged(&e))? {
            let values = values.map_err(|e| damaged(&e))?;
            if !edited.is_point(&values)? {
                edited.push(values)?;
                continue;
            }
            if wanted.contains(&row) {
                kept.insert(row, values.clone());
            }
            match rows.next(row) {
                Row::Stays => edited.push(values)?,
                Row::Moves(placed) => {
                    is_new[0] = true;
                    edited.push(edited.placed(values, placed)?)?;
                }
                Row::Goes => is_new[1] = true,
            }
            row += 1;
        }
        for placed in changes.added.iter().filter(|p| (first..row).contains(&p.row)) {
            is_new[1] = true;
            edited.push(edited.placed(kept[&placed.row].clone(), placed)?)?;
        }
        if is_new[1] && told.has_groups {
            return Err(Fault::Value {
                what: "what names the points by number",
                value: "pointGroupingSchemes".into(),
                remedy: "points come or go; convert the scan by isoclay convert and fit that",
            });
        }
        if is_new != [false; 2] {
            words.extend(edited.put(&mut file, told));
        }
    }
    let out = file.file(&description::with(&text, words));
    let now = parse(&out, budget)?.positions.len();
    match now + changes.removed.len() == whole + changes.added.len() {
        true => Ok(out),
        false => Err(Fault::Damaged {
            what: "scans that stand over one another".into(),
        }),
    }
}

/// The points of a scan on their way into the file.
struct Edited<'a> {
    prototype: &'a [Record],
    columns: Columns,
    local_from_world: DAffine3,
    section: Section,
    /// Least and greatest value of each attribute, and of cartesian coordinates.
    values: Vec<[f64; 2]>,
    bounds: [DVec3; 2],
}

impl<'a> Edited<'a> {
    fn of(prototype: &'a [Record], pose: DAffine3) -> Result<Self, Fault> {
        Ok(Self {
            columns: Columns::of(prototype)?,
            local_from_world: pose.inverse(),
            section: Section::of(prototype.iter().map(|r| r.data_type.clone()))?,
            values: vec![[f64::INFINITY, f64::NEG_INFINITY]; prototype.len()],
            bounds: [DVec3::INFINITY, DVec3::NEG_INFINITY],
            prototype,
        })
    }

    fn value(&self, values: &RawValues, column: usize) -> Result<f64, Fault> {
        let kind = &self.prototype[column].data_type;
        values[column].to_f64(kind).map_err(|e| damaged(&e))
    }

    /// Whether a kind of coordinates is there and not marked as invalid.
    fn has(
        &self,
        values: &RawValues,
        columns: Option<[usize; 3]>,
        state: Option<usize>,
    ) -> Result<bool, Fault> {
        let is_valid = state.map(|s| self.value(values, s)).transpose()?.unwrap_or(0.0) == 0.0;
        Ok(columns.is_some() && is_valid)
    }

    fn has_cartesian(&self, values: &RawValues) -> Result<bool, Fault> {
        self.has(values, self.columns.cartesian, self.columns.cartesian_invalid)
    }

    fn has_spherical(&self, values: &RawValues) -> Result<bool, Fault> {
        self.has(values, self.columns.spherical, self.columns.spherical_invalid)
    }

    /// Whether a row is one of the cloud.
    fn is_point(&self, values: &RawValues) -> Result<bool, Fault> {
        Ok(self.has_cartesian(values)? || self.has_spherical(values)?)
    }

    /// A row with its point elsewhere, by all coordinates that hold.
    fn placed(&self, mut values: RawValues, placed: &Placed) -> Result<RawValues, Fault> {
        let local = self
            .local_from_world
            .transform_point3(placed.position / MM_PER_METRE);
        let normal = self.local_from_world.transform_vector3(placed.normal);
        let mut new = Vec::new();
        if self.has_cartesian(&values)? {
            new.push((self.columns.cartesian, local));
        }
        if self.has_spherical(&values)? {
            let range = local.length();
            let elevation = (local.z / range.max(f64::MIN_POSITIVE)).asin();
            new.push((
                self.columns.spherical,
                DVec3::new(range, local.y.atan2(local.x), elevation),
            ));
        }
        new.push((self.columns.normal, normal));
        for (columns, new) in new {
            for (column, new) in columns.into_iter().flatten().zip(new.to_array()) {
                let kind = &self.prototype[column].data_type;
                values[column] = stored(kind, new).ok_or_else(|| Fault::Value {
                    what: "the place of an edited point",
                    value: placed.position.to_string(),
                    remedy: "it is beyond what the file's scale and limits can hold; convert the scan by isoclay convert and fit that",
                })?;
            }
        }
        Ok(values)
    }

    fn push(&mut self, values: RawValues) -> Result<(), Fault> {
        for column in 0..values.len() {
            let value = self.value(&values, column)?;
            let [low, high] = &mut self.values[column];
            (*low, *high) = (low.min(value), high.max(value));
        }
        if let (true, Some(columns)) = (self.has_cartesian(&values)?, self.columns.cartesian) {
            let [x, y, z] = columns.map(|c| self.value(&values, c));
            let p = DVec3::new(x?, y?, z?);
            let [low, high] = self.bounds;
            self.bounds = [low.min(p), high.max(p)];
        }
        self.section.push(&values);
        Ok(())
    }

    /// Puts the points where they stood, or at the end if they take more room; what is to be told of it.
    fn put(mut self, file: &mut Paged, told: &Scan) -> Vec<(Range<usize>, String)> {
        let (old, length) = (pages::logical(told.at), self.section.length());
        let count = self.section.count;
        let room = file.bytes.get(old..old + SECTION_HEAD).map_or(0, |head| {
            u64::from_le_bytes(head[8..16].try_into().expect("eight bytes")) as usize
        });
        let is_there = old.checked_add(room).is_some_and(|end| end <= file.bytes.len());
        if is_there {
            // Nothing is left of what was edited.
            file.bytes[old..old + room].fill(0);
        }
        let at = match is_there && length <= room {
            true => old,
            false => file.append(&vec![0; length]),
        };
        file.bytes[at..at + length].copy_from_slice(&self.section.bytes(at));
        told.told(pages::physical(at), count, &self.values, self.bounds)
    }
}

/// A value as an attribute stores it.
fn stored(kind: &RecordDataType, value: f64) -> Option<RecordValue> {
    let whole = |value: f64, min: i64, max: i64| {
        let n = value.round();
        (n >= min as f64 && n <= max as f64).then_some(n as i64)
    };
    match *kind {
        RecordDataType::Single { .. } => Some(RecordValue::Single(value as f32)),
        RecordDataType::Double { .. } => Some(RecordValue::Double(value)),
        RecordDataType::ScaledInteger {
            min,
            max,
            scale,
            offset,
        } => whole((value - offset) / scale, min, max).map(RecordValue::ScaledInteger),
        RecordDataType::Integer { min, max } => whole(value, min, max).map(RecordValue::Integer),
    }
}
