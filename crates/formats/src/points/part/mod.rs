//! Some of the points of a large file, without reading all of it: as many as there is time for, from all over the file.

#[cfg(feature = "lidar")]
mod las;
mod pcd;
mod ply;
mod rows;
mod xyz;

#[cfg(test)]
mod tests;

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use self::rows::Rows;
use super::{NormalSource, PointCloud, read_bytes};
use crate::detect::kind_of;
use crate::input::{io_fault, is_gzip};
use crate::kind::{Kind, PointFormat};
use crate::limits::Budget;
use crate::{Fault, FormatError, ReadLimits};

/// Bytes in which a header has to end.
const HEAD: u64 = 1 << 20;

/// Some of the points of a file.
#[derive(Clone, Debug)]
pub struct CloudPart {
    /// They, and what is known of the file.
    pub cloud: PointCloud,
    /// Points in the file.
    pub count: u64,
    /// Whether that is guessed from the lengths of the lines that were read.
    pub is_guess: bool,
    /// Bytes that were read.
    pub bytes: u64,
}

/// What a file is made of.
struct Layout {
    rows: Rows,
    /// Points in it, where it tells.
    count: Option<u64>,
    /// Faces in it.
    faces: u64,
    /// What stands before so many rows.
    head: Box<dyn Fn(u64) -> Vec<u8>>,
}

/// Reads about `most` bytes of a cloud, or a little more. None where its format has to be read as a whole, and where it is no longer than that.
///
/// # Errors
/// Every [`Fault`] of reading: see the parsers of the single formats.
pub fn read_part(path: &Path, limits: &ReadLimits, most: u64) -> Result<Option<CloudPart>, FormatError> {
    read_faulty(path, limits, most).map_err(|fault| fault.at(path))
}

fn read_faulty(path: &Path, limits: &ReadLimits, most: u64) -> Result<Option<CloudPart>, Fault> {
    let reading = io_fault("reading");
    let mut file = File::open(path).map_err(io_fault("opening"))?;
    let meta = file.metadata().map_err(io_fault("opening"))?;
    if !meta.is_file() || meta.len() <= most {
        return Ok(None);
    }
    let mut head = Vec::new();
    (&mut file).take(HEAD).read_to_end(&mut head).map_err(&reading)?;
    if is_gzip(&head) {
        return Ok(None);
    }
    let kind = kind_of(&head, path)?;
    let layout = match kind {
        Kind::Cloud(PointFormat::Ply) => ply::layout(&head, meta.len()),
        Kind::Cloud(PointFormat::Pcd) => pcd::layout(&head, meta.len()),
        Kind::Cloud(PointFormat::Xyz) => xyz::layout(&head, meta.len()),
        #[cfg(feature = "lidar")]
        Kind::Cloud(PointFormat::Las) => las::layout(&head),
        _ => None,
    };
    let is_readable = |rows: &Rows| rows.end <= meta.len() && rows.stride.is_none_or(|stride| stride <= most);
    let Some(layout) = layout.filter(|layout| is_readable(&layout.rows)) else {
        return Ok(None);
    };
    let mut budget = Budget::new(limits);
    budget.reserve("a part of the file", most, 1)?;
    let picked = layout.rows.pick(most, |at, bytes| {
        file.seek(SeekFrom::Start(at))?;
        file.read_exact(bytes)
    });
    let (rows, count, read) = picked.map_err(&reading)?;
    // Each line is as long as the others, about.
    let length = (layout.rows.end - layout.rows.start) as f64;
    let guess = count as f64 * length / rows.len().max(1) as f64;
    let mut bytes = (layout.head)(count);
    bytes.extend(rows);
    let mut cloud = read_bytes(&bytes, path, &mut budget)?;
    cloud.face_count = layout.faces as usize;
    if layout.faces > 0 && cloud.normals.is_none() {
        cloud.normal_source = NormalSource::Faces;
    }
    Ok(Some(CloudPart {
        cloud,
        count: layout.count.unwrap_or(guess as u64),
        is_guess: layout.count.is_none(),
        bytes: read + head.len() as u64,
    }))
}
