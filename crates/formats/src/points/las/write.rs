//! LAS 1.2 out, compressed or not: whole multiples of a step, fine enough for any cloud.

use std::io::{self, Cursor, Write};

use glam::DVec3;
use laz::laszip::{LasZipCompressor, LazItemRecordBuilder, LazVlrBuilder};

use crate::Unit;
use crate::points::cloud::PointCloud;

const HEADER: usize = 227;
const VLR_HEAD: usize = 54;
/// Bytes of a point of format 0.
const POINT: usize = 20;
/// Steps across the cloud; coordinates are numbers of 31 bits and a sign.
const STEPS: f64 = 1e9;

/// The step and the origin of the coordinates.
pub(crate) struct Grid {
    pub scale: f64,
    pub offset: DVec3,
}

impl Grid {
    /// The finest decimal step that leaves room for the whole cloud.
    ///
    /// `max` and `min` bound the points.
    pub fn of(min: DVec3, max: DVec3) -> Self {
        let extent = (max - min).max_element();
        let center = (min + max) * 0.5;
        // A single point, or identical ones, still need a step.
        let extent = if extent > 0.0 {
            extent
        } else {
            center.abs().max_element().max(1.0) * 1e-9
        };
        let digits = extent.log10().floor() as i32;
        // Printed numbers are read to the nearest double; powers of ten by multiplication are not.
        let ten_to = |n: i32| format!("1e{n}").parse::<f64>().expect("a number");
        let mut power = (extent / STEPS).log10().ceil() as i32;
        while ten_to(power) * STEPS < extent {
            power += 1;
        }
        // A round origin keeps round coordinates round.
        let round = ten_to(digits);
        let offset = (center / round).round() * round;
        Self {
            scale: ten_to(power),
            offset: if offset.is_finite() { offset } else { center },
        }
    }

    fn steps(&self, p: DVec3) -> [i32; 3] {
        ((p - self.offset) / self.scale)
            .round()
            .to_array()
            .map(|x| x as i32)
    }

    fn place(&self, steps: [i32; 3]) -> DVec3 {
        DVec3::from_array(steps.map(f64::from)) * self.scale + self.offset
    }
}

/// Bytes of the file, all of it: its head counts what follows.
pub(in crate::points) fn write(out: &mut dyn Write, cloud: &PointCloud, compress: bool) -> io::Result<()> {
    let metres = cloud.unit.in_mm().map_or(1.0, |mm| mm / 1000.0);
    let at = |i: usize| cloud.positions[i] * metres;
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for i in 0..cloud.positions.len() {
        (min, max) = (min.min(at(i)), max.max(at(i)));
    }
    let grid = if cloud.positions.is_empty() {
        Grid {
            scale: 1e-3,
            offset: DVec3::ZERO,
        }
    } else {
        Grid::of(min, max)
    };
    let extra = if cloud.normals.is_some() { 12 } else { 0 };
    let items = LazItemRecordBuilder::default_for_point_format_id(0, extra).map_err(io::Error::other)?;
    let laz = LazVlrBuilder::default().with_laz_items(items).build();

    let mut records: Vec<(&str, u16, Vec<u8>)> = Vec::new();
    if cloud.unit != Unit::Unknown {
        // A projected system of nobody's, in metres.
        let keys: [u16; 16] = [1, 1, 0, 3, 1024, 0, 1, 1, 3072, 0, 1, 32767, 3076, 0, 1, 9001];
        records.push((
            "LASF_Projection",
            34735,
            keys.iter().flat_map(|k| k.to_le_bytes()).collect(),
        ));
    }
    if extra > 0 {
        let names = ["NormalX", "NormalY", "NormalZ"];
        records.push((
            "LASF_Spec",
            4,
            names.iter().flat_map(|n| extra_bytes(n)).collect(),
        ));
    }
    if compress {
        let mut data = Vec::new();
        laz.write_to(&mut data)?;
        records.push(("laszip encoded", 22204, data));
    }
    let points_at = HEADER + records.iter().map(|r| VLR_HEAD + r.2.len()).sum::<usize>();
    let mut bytes = header(
        cloud.positions.len() as u32,
        records.len() as u32,
        points_at as u32,
        POINT + usize::from(extra),
        compress,
        &grid,
    );
    let (low, high) = (grid.place(grid.steps(min)), grid.place(grid.steps(max)));
    for axis in 0..3 {
        for x in [high[axis], low[axis]] {
            bytes.extend(if cloud.positions.is_empty() { 0.0 } else { x }.to_le_bytes());
        }
    }
    for (user, id, data) in &records {
        let mut head = [0; VLR_HEAD];
        head[2..2 + user.len()].copy_from_slice(user.as_bytes());
        head[18..20].copy_from_slice(&id.to_le_bytes());
        head[20..22].copy_from_slice(&(data.len() as u16).to_le_bytes());
        bytes.extend(head);
        bytes.extend(data);
    }
    let mut point = vec![0; POINT + usize::from(extra)];
    // First of one return.
    point[14] = 0b001_001;
    let fill = |i: usize, point: &mut [u8]| {
        for (slot, x) in grid.steps(at(i)).into_iter().enumerate() {
            point[4 * slot..4 * slot + 4].copy_from_slice(&x.to_le_bytes());
        }
        if let Some(n) = &cloud.normals {
            for (slot, x) in n[i].to_array().into_iter().enumerate() {
                point[POINT + 4 * slot..POINT + 4 * slot + 4].copy_from_slice(&(x as f32).to_le_bytes());
            }
        }
    };
    if !compress {
        out.write_all(&bytes)?;
        for i in 0..cloud.positions.len() {
            fill(i, &mut point);
            out.write_all(&point)?;
        }
        return Ok(());
    }
    // The place of the chunk table is written last, before the points.
    let mut whole = Cursor::new(bytes);
    whole.set_position(points_at as u64);
    let mut compressor = LasZipCompressor::new(&mut whole, laz).map_err(io::Error::other)?;
    for i in 0..cloud.positions.len() {
        fill(i, &mut point);
        compressor.compress_one(&point)?;
    }
    compressor.done()?;
    drop(compressor);
    out.write_all(whole.get_ref())
}

/// The header up to the bounds.
fn header(count: u32, records: u32, points_at: u32, point: usize, compress: bool, grid: &Grid) -> Vec<u8> {
    let mut h = vec![0; 131];
    h[..4].copy_from_slice(b"LASF");
    h[24..26].copy_from_slice(&[1, 2]);
    h[26..33].copy_from_slice(b"isoclay");
    h[58..65].copy_from_slice(b"isoclay");
    h[94..96].copy_from_slice(&(HEADER as u16).to_le_bytes());
    h[96..100].copy_from_slice(&points_at.to_le_bytes());
    h[100..104].copy_from_slice(&records.to_le_bytes());
    h[104] = if compress { 0x80 } else { 0 };
    h[105..107].copy_from_slice(&(point as u16).to_le_bytes());
    h[107..111].copy_from_slice(&count.to_le_bytes());
    // All are first returns.
    h[111..115].copy_from_slice(&count.to_le_bytes());
    for x in [grid.scale; 3].into_iter().chain(grid.offset.to_array()) {
        h.extend(x.to_le_bytes());
    }
    h
}

/// The description of an extra float of each point.
fn extra_bytes(name: &str) -> [u8; 192] {
    let mut entry = [0; 192];
    entry[2] = 9;
    entry[4..4 + name.len()].copy_from_slice(name.as_bytes());
    entry
}
