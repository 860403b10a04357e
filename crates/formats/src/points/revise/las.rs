use glam::DVec3;

use super::{CloudChanges, Placed, Row, Rows};
use crate::Fault;
use crate::points::las::header::{self, Header, u32_at, u64_at};
use crate::points::las::unit;

/// Places in the header [ASPRS, LAS Specification 1.4-R15, table 3].
const VERSION: usize = 25;
const OLD_COUNT: usize = 107;
const OLD_RETURNS: usize = 111;
const BOUNDS: usize = 179;
const WAVEFORMS: usize = 227;
const RECORDS: usize = 235;
const COUNT: usize = 247;
const RETURNS: usize = 255;

/// The bytes of the file with its changes. Rows are those of points that are not withheld; the others stay.
pub fn revised(bytes: &[u8], changes: &CloudChanges) -> Result<Vec<u8>, Fault> {
    let header = header::read(bytes)?;
    if header.is_compressed {
        return Err(Fault::Value {
            what: "the format of the scan",
            value: "compressed points (LAZ)".into(),
            remedy: "edited points are written uncompressed: unpack the scan to .las and fit that",
        });
    }
    if *changes == CloudChanges::default() {
        return Ok(bytes.to_vec());
    }
    let grid = Grid::of(&header);
    let end = header.points_at + header.point_count as usize * header.record_bytes;
    let mut out = bytes[..header.points_at].to_vec();
    let mut rows = Rows::of(changes);
    let mut points: Vec<&[u8]> = Vec::new();
    for point in bytes[header.points_at..end].chunks_exact(header.record_bytes) {
        if header.is_withheld(point) {
            out.extend_from_slice(point);
            continue;
        }
        match rows.next(points.len()) {
            Row::Stays => out.extend_from_slice(point),
            Row::Moves(placed) => out.extend(grid.placed(point, placed)?),
            Row::Goes => {}
        }
        points.push(point);
    }
    for placed in &changes.added {
        out.extend(grid.placed(points[placed.row], placed)?);
    }
    put_header(&mut out, &header, bytes)?;
    out.extend_from_slice(&bytes[end..]);
    Ok(out)
}

/// The whole numbers of a point.
struct Grid {
    /// File from cloud.
    scale: f64,
    step: DVec3,
    offset: DVec3,
    normals: Option<[(usize, bool); 3]>,
}

impl Grid {
    fn of(header: &Header) -> Self {
        Self {
            scale: 1.0 / unit::of(header).0.in_mm().unwrap_or(1.0),
            step: header.scale,
            offset: header.offset,
            normals: header.normal_columns(),
        }
    }

    fn placed(&self, point: &[u8], placed: &Placed) -> Result<Vec<u8>, Fault> {
        let steps = ((placed.position * self.scale - self.offset) / self.step).round();
        if steps.abs().max_element() > f64::from(i32::MAX) {
            return Err(Fault::Value {
                what: "the place of an edited point",
                value: placed.position.to_string(),
                remedy: "it is beyond what the file's scale and offset can hold; convert the scan by isoclay convert and fit that",
            });
        }
        let mut row = point.to_vec();
        for (axis, steps) in steps.to_array().into_iter().enumerate() {
            row[4 * axis..][..4].copy_from_slice(&(steps as i32).to_le_bytes());
        }
        let normals = self.normals.iter().flatten();
        for ((at, is_double), n) in normals.zip(placed.normal.to_array()) {
            match is_double {
                true => row[*at..][..8].copy_from_slice(&n.to_le_bytes()),
                false => row[*at..][..4].copy_from_slice(&(n as f32).to_le_bytes()),
            }
        }
        Ok(row)
    }
}

/// Puts counts, bounds and the places of what follows the points into the header of `out`, which ends with the points.
fn put_header(out: &mut [u8], header: &Header, old: &[u8]) -> Result<(), Fault> {
    let (head, points) = out.split_at_mut(header.points_at);
    let (mut count, mut returns) = (0u64, [0u64; 15]);
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for point in points.chunks_exact(header.record_bytes) {
        count += 1;
        let number = point[14] & if header.format < 6 { 7 } else { 15 };
        if let Some(slot) = usize::from(number).checked_sub(1) {
            returns[slot] += 1;
        }
        let x = |axis: usize| f64::from(u32_at(point, 4 * axis) as i32);
        let p = DVec3::new(x(0), x(1), x(2)) * header.scale + header.offset;
        (low, high) = (low.min(p), high.max(p));
    }
    let is_1_4 = head[VERSION] >= 4;
    let mut put = |at: usize, bytes: &[u8]| head[at..at + bytes.len()].copy_from_slice(bytes);
    // Files of 1.4 leave the old places empty where they have no room, or no meaning.
    if !is_1_4 || u32_at(old, OLD_COUNT) > 0 {
        let narrow = |n: u64| {
            u32::try_from(n).map_err(|_| Fault::Value {
                what: "the number of points",
                value: n.to_string(),
                remedy: "the header counts to 4294967295; edit a part of the scan",
            })
        };
        put(OLD_COUNT, &narrow(count)?.to_le_bytes());
        for (slot, n) in returns[..5].iter().enumerate() {
            put(OLD_RETURNS + 4 * slot, &narrow(*n)?.to_le_bytes());
        }
    }
    for axis in 0..3 {
        put(BOUNDS + 16 * axis, &high[axis].to_le_bytes());
        put(BOUNDS + 16 * axis + 8, &low[axis].to_le_bytes());
    }
    let old_end = header.points_at as u64 + header.point_count * header.record_bytes as u64;
    let new_end = header.points_at as u64 + count * header.record_bytes as u64;
    let mut moved = |at: usize| {
        let place = u64_at(old, at);
        if place >= old_end {
            put(at, &(place - old_end + new_end).to_le_bytes());
        }
    };
    if head_has(old, WAVEFORMS + 8) && old[VERSION] >= 3 {
        moved(WAVEFORMS);
    }
    if is_1_4 {
        moved(RECORDS);
        put(COUNT, &count.to_le_bytes());
        for (slot, n) in returns.iter().enumerate() {
            put(RETURNS + 8 * slot, &n.to_le_bytes());
        }
    }
    Ok(())
}

/// Whether the header reaches so far.
fn head_has(bytes: &[u8], end: usize) -> bool {
    usize::from(header::u16_at(bytes, 94)) >= end
}
