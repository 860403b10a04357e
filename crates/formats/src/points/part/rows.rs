//! Rows of a file, all of the same length or lines.

use std::io;

/// Pieces of a file that are read.
const PIECES: u64 = 64;

/// Where the rows of a file lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rows {
    /// Bytes at which they begin.
    pub start: u64,
    /// And end.
    pub end: u64,
    /// Bytes of one; lines if missing.
    pub stride: Option<u64>,
}

impl Rows {
    /// About so many bytes of them in pieces that lie evenly over all, how many rows these are, and the bytes that were read.
    pub fn pick(
        &self,
        most: u64,
        mut read: impl FnMut(u64, &mut [u8]) -> io::Result<()>,
    ) -> io::Result<(Vec<u8>, u64, u64)> {
        let length = self.end - self.start;
        let unit = self.stride.unwrap_or(1);
        // A piece has at least one row; a line longer than a piece is passed over.
        let units = length / unit;
        let piece = (most / PIECES / unit).max(1).min(units);
        let (mut picked, mut count, mut bytes, mut next) = (Vec::new(), 0, 0, 0);
        for n in 0..PIECES {
            let first = (n * (units - piece)).div_euclid(PIECES - 1);
            // In a short file they would lie over one another.
            if units == 0 || first < next {
                continue;
            }
            let (from, is_last) = (self.start + first * unit, first + piece == units);
            let mut rows = vec![0; (piece * unit) as usize];
            read(from, &mut rows)?;
            next = first + piece;
            bytes += rows.len() as u64;
            match self.stride {
                Some(_) => {
                    count += piece;
                    picked.extend(rows);
                }
                None => {
                    let whole = lines(&rows, first == 0, is_last);
                    count += whole
                        .split(|b| *b == b'\n')
                        .filter(|line| !line.trim_ascii().is_empty())
                        .count() as u64;
                    picked.extend(whole);
                    // The last line may have no end.
                    if !picked.ends_with(b"\n") {
                        picked.push(b'\n');
                    }
                }
            }
        }
        Ok((picked, count, bytes))
    }
}

/// The lines that are whole in a piece.
fn lines(piece: &[u8], is_first: bool, is_last: bool) -> &[u8] {
    let start = match is_first {
        true => 0,
        false => memchr::memchr(b'\n', piece).map_or(piece.len(), |at| at + 1),
    };
    let rest = &piece[start..];
    let end = match is_last {
        true => rest.len(),
        false => memchr::memrchr(b'\n', rest).map_or(0, |at| at + 1),
    };
    &rest[..end]
}
