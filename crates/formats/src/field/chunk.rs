//! Chunks: type, compression, lengths, CRC-32, payload.

use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, Write};

use super::cursor::Cursor;
use crate::Fault;
use crate::error::excerpt;
use crate::limits::Budget;

/// Bytes in front of a payload.
const HEAD: usize = 28;
/// zstd level: coefficients are mostly noise, higher levels gain under 1 % and cost several times the time.
const LEVEL: i32 = 1;
/// Payloads below this are stored as they are.
const WORTH_PACKING: usize = 256;

const STORED: u32 = 0;
const ZSTD: u32 = 1;

pub(super) type Kind = [u8; 4];

/// Writes one chunk.
pub(super) fn write(out: &mut dyn Write, kind: Kind, raw: &[u8]) -> io::Result<()> {
    let packed = match raw.len() {
        0..WORTH_PACKING => None,
        length => Some(pack(&mut &raw[..], length as u64, Vec::new())?).filter(|p| p.len() < length),
    };
    let (method, payload) = packed.as_deref().map_or((STORED, raw), |p| (ZSTD, p));
    let mut sum = crc32fast::Hasher::new();
    sum.update(payload);
    out.write_all(&head(
        kind,
        method,
        [payload.len(), raw.len()].map(|n| n as u64),
        &sum,
    ))?;
    out.write_all(payload)
}

/// Writes one chunk of `length` bytes that are nowhere in memory, the same to the bit. `raw` begins them anew; `scratch`, empty,
/// takes the packed ones until their number is known.
pub(super) fn write_stream<'a>(
    out: &mut dyn Write,
    kind: Kind,
    length: u64,
    raw: &mut dyn FnMut() -> io::Result<Box<dyn Read + 'a>>,
    scratch: &mut File,
) -> io::Result<()> {
    if length < WORTH_PACKING as u64 {
        let mut few = Vec::new();
        raw()?.read_to_end(&mut few)?;
        return write(out, kind, &few);
    }
    let mut kept = Summed::new(BufWriter::new(&mut *scratch));
    pack(&mut raw()?, length, &mut kept)?;
    let (packed, sum) = kept.finish()?;
    let (method, stored, sum) = match packed < length {
        true => (ZSTD, packed, sum),
        false => {
            let mut all = Summed::new(io::sink());
            io::copy(&mut raw()?, &mut all)?;
            (STORED, length, all.finish()?.1)
        }
    };
    out.write_all(&head(kind, method, [stored, length], &sum))?;
    let copied = match method {
        ZSTD => {
            scratch.rewind()?;
            io::copy(scratch, out)?
        }
        _ => io::copy(&mut raw()?, out)?,
    };
    debug_assert_eq!(copied, stored);
    Ok(())
}

/// Packs as a stream, so that the bits do not depend on what was in memory at once.
fn pack<W: Write>(raw: &mut dyn Read, length: u64, out: W) -> io::Result<W> {
    let mut encoder = zstd::stream::write::Encoder::new(out, LEVEL)?;
    encoder.set_pledged_src_size(Some(length))?;
    io::copy(raw, &mut encoder)?;
    encoder.finish()
}

/// Counts what passes, and sums it up.
struct Summed<W> {
    out: W,
    length: u64,
    sum: crc32fast::Hasher,
}

impl<W: Write> Summed<W> {
    fn new(out: W) -> Self {
        Self {
            out,
            length: 0,
            sum: crc32fast::Hasher::new(),
        }
    }

    /// How much it was, and its sum.
    fn finish(mut self) -> io::Result<(u64, crc32fast::Hasher)> {
        self.out.flush()?;
        Ok((self.length, self.sum))
    }
}

impl<W: Write> Write for Summed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = self.out.write(bytes)?;
        self.sum.update(&bytes[..n]);
        self.length += n as u64;
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// What stands in front of a payload of that sum: `lengths` are those of the payload and of what it unpacks to.
fn head(kind: Kind, method: u32, lengths: [u64; 2], payload: &crc32fast::Hasher) -> [u8; HEAD] {
    let mut head = [0; HEAD];
    head[..4].copy_from_slice(&kind);
    head[4..8].copy_from_slice(&method.to_le_bytes());
    head[8..16].copy_from_slice(&lengths[0].to_le_bytes());
    head[16..24].copy_from_slice(&lengths[1].to_le_bytes());
    let mut crc = crc32fast::Hasher::new();
    crc.update(&head[..24]);
    crc.combine(payload);
    head[24..].copy_from_slice(&crc.finalize().to_le_bytes());
    head
}

/// CRC-32 of the head up to the checksum and of the payload as stored.
fn checksum(head: &[u8], payload: &[u8]) -> u32 {
    let mut crc = crc32fast::Hasher::new();
    crc.update(&head[..24]);
    crc.update(payload);
    crc.finalize()
}

/// A chunk whose checksum holds, still packed.
pub(super) struct Chunk<'a> {
    pub kind: Kind,
    method: u32,
    raw_length: u64,
    payload: &'a [u8],
}

/// Takes the chunk at the front of `rest`, the end of `length` bytes, which has to be of one kind, and unpacks it.
pub fn expected(rest: &mut &[u8], length: usize, kind: Kind, budget: &mut Budget) -> Result<Vec<u8>, Fault> {
    let at = (length - rest.len()) as u64;
    let chunk = Chunk::take(rest, at)?;
    match chunk.kind == kind {
        true => chunk.unpack(budget),
        false => Err(Fault::Damaged {
            what: "its parts are not in order".into(),
        }),
    }
}

impl<'a> Chunk<'a> {
    /// Takes the chunk at the front of `rest`, which starts at byte `at` of the file.
    pub fn take(rest: &mut &'a [u8], at: u64) -> Result<Self, Fault> {
        let mut cursor = Cursor::new(rest, "a chunk");
        let head = cursor.take(HEAD as u64)?;
        let u32_at = |i: usize| u32::from_le_bytes(head[i..i + 4].try_into().expect("4 bytes"));
        let u64_at = |i: usize| u64::from_le_bytes(head[i..i + 8].try_into().expect("8 bytes"));
        let payload = cursor.take(u64_at(8))?;
        let kind: Kind = head[..4].try_into().expect("4 bytes");
        let (stored, computed) = (u32_at(24), checksum(head, payload));
        if stored != computed {
            return Err(Fault::Damaged {
                what: format!(
                    "chunk {} at byte {at} has checksum {computed:08x}, {stored:08x} is stored",
                    excerpt(&kind)
                ),
            });
        }
        *rest = &rest[HEAD + payload.len()..];
        Ok(Self {
            kind,
            method: u32_at(4),
            raw_length: u64_at(16),
            payload,
        })
    }

    /// Bytes it takes in the file.
    pub fn stored_length(&self) -> u64 {
        (HEAD + self.payload.len()) as u64
    }

    /// The payload, unpacked.
    pub fn unpack(&self, budget: &mut Budget) -> Result<Vec<u8>, Fault> {
        budget.reserve("an unpacked chunk", self.raw_length, 1)?;
        let raw = match self.method {
            STORED => self.payload.to_vec(),
            ZSTD => {
                // In one go into what was booked: a stream longer than it says fails, and no window of the
                // stream's own choice is allocated.
                let mut raw = Vec::new();
                raw.try_reserve_exact(self.raw_length as usize)
                    .map_err(|_| Fault::Limit {
                        what: "an unpacked chunk",
                        needed: self.raw_length,
                        limit: budget.left(),
                    })?;
                zstd::bulk::Decompressor::new()
                    .and_then(|mut d| d.decompress_to_buffer(self.payload, &mut raw))
                    .map_err(|e| Fault::Damaged {
                        what: format!("chunk {} cannot be unpacked ({e})", excerpt(&self.kind)),
                    })?;
                raw
            }
            other => {
                return Err(Fault::Value {
                    what: "the compression of a chunk",
                    value: other.to_string(),
                    remedy: "known are 0 (none) and 1 (zstd); a newer version of the program may read it",
                });
            }
        };
        if raw.len() as u64 != self.raw_length {
            return Err(Fault::Damaged {
                what: format!(
                    "chunk {} unpacks to {} bytes, {} are stated",
                    excerpt(&self.kind),
                    raw.len(),
                    self.raw_length
                ),
            });
        }
        Ok(raw)
    }
}
