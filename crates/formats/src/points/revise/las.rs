use glam::DVec3;

use super::{CloudChanges, Placed, Row, Rows};
use crate::Fault;
use crate::limits::Budget;
use crate::points::las::header::{self, Header, u32_at, u64_at};
use crate::points::las::laz;
use crate::points::las::unit;

/// Places in the header [ASPRS, LAS Specification 1.4-R15, table 3].
const VERSION: usize = 25;
const FORMAT: usize = 104;
const OLD_COUNT: usize = 107;
const OLD_RETURNS: usize = 111;
const BOUNDS: usize = 179;
const WAVEFORMS: usize = 227;
const RECORDS: usize = 235;
const COUNT: usize = 247;
const RETURNS: usize = 255;
/// Mark of compressed points in the byte of the format [Isenburg, LASzip, 2013].
const COMPRESSED: u8 = 0xc0;

/// What a file of these bytes is called: `laz` if its points are compressed.
pub fn extension(bytes: &[u8]) -> &'static str {
    match bytes[FORMAT] & COMPRESSED {
        0 => "las",
        _ => "laz",
    }
}

/// The bytes of the file with its changes, compressed if it is. Rows are those of points that are not withheld; the others stay.
pub fn revised(bytes: &[u8], changes: &CloudChanges, budget: &mut Budget) -> Result<Vec<u8>, Fault> {
    let header = header::read(bytes)?;
    if *changes == CloudChanges::default() {
        return Ok(bytes.to_vec());
    }
    if !header.is_compressed {
        return edited(bytes, &header, changes);
    }
    let plain = unpacked(bytes, &header, budget)?;
    let new = edited(&plain, &header::read(&plain)?, changes)?;
    packed(&new, bytes[FORMAT] & COMPRESSED)
}

/// The same for points that are not compressed.
fn edited(bytes: &[u8], header: &Header, changes: &CloudChanges) -> Result<Vec<u8>, Fault> {
    let grid = Grid::of(header);
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
    put_header(&mut out, header)?;
    move_tail(&mut out, end);
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

/// Puts counts and bounds into the header of `out`, which ends with the points.
fn put_header(out: &mut [u8], header: &Header) -> Result<(), Fault> {
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
    let has_old_count = u32_at(head, OLD_COUNT) > 0;
    let mut put = |at: usize, bytes: &[u8]| head[at..at + bytes.len()].copy_from_slice(bytes);
    // Files of 1.4 leave the old places empty where they have no room, or no meaning.
    if !is_1_4 || has_old_count {
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
    if is_1_4 {
        put(COUNT, &count.to_le_bytes());
        for (slot, n) in returns.iter().enumerate() {
            put(RETURNS + 8 * slot, &n.to_le_bytes());
        }
    }
    Ok(())
}

/// Where the header says what stands behind the points: wave forms, and records of 1.4.
fn places_behind(head: &[u8]) -> impl Iterator<Item = usize> + use<> {
    let wave_forms = head[VERSION] >= 3 && usize::from(header::u16_at(head, 94)) >= WAVEFORMS + 8;
    let places = [(wave_forms, WAVEFORMS), (head[VERSION] >= 4, RECORDS)];
    places.into_iter().filter(|p| p.0).map(|p| p.1)
}

/// Tells the header that what stood behind the points, at `from` and beyond, follows `out` now.
fn move_tail(out: &mut [u8], from: usize) {
    let to = out.len() as u64;
    for at in places_behind(out) {
        let place = u64_at(out, at);
        if let Some(beyond) = place.checked_sub(from as u64).filter(|_| place > 0) {
            out[at..at + 8].copy_from_slice(&(to + beyond).to_le_bytes());
        }
    }
}

/// The file without compression. What stands behind the compressed points is kept where the header says that there is something.
fn unpacked(bytes: &[u8], header: &Header, budget: &mut Budget) -> Result<Vec<u8>, Fault> {
    let behind = places_behind(bytes).map(|at| u64_at(bytes, at));
    let tail = behind
        .filter(|place| (header.points_at as u64..bytes.len() as u64).contains(place))
        .min()
        .map_or(bytes.len(), |place| place as usize);
    budget.reserve(
        "the points, not compressed",
        header.point_count,
        header.record_bytes,
    )?;
    let mut out = bytes[..header.points_at].to_vec();
    laz::unpack(bytes, header, budget, |point, _| {
        out.extend_from_slice(point);
        Ok(())
    })?;
    out[FORMAT] &= !COMPRESSED;
    move_tail(&mut out, tail);
    out.extend_from_slice(&bytes[tail..]);
    Ok(out)
}

/// The file with its points compressed as it says, marked by `mark`.
fn packed(plain: &[u8], mark: u8) -> Result<Vec<u8>, Fault> {
    let header = header::read(plain)?;
    let (head, rest) = plain.split_at(header.points_at);
    let (points, tail) = rest.split_at(header.point_count as usize * header.record_bytes);
    let mut out = laz::pack(head, points, &header)?;
    out[FORMAT] |= mark;
    move_tail(&mut out, plain.len() - tail.len());
    out.extend_from_slice(tail);
    Ok(out)
}

#[cfg(test)]
mod tests;
