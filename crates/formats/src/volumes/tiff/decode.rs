//! Strips and tiles unpacked.

use flate2::{Decompress, FlushDecompress, Status};
use weezl::{BitOrder, LzwStatus};

use crate::Fault;
use crate::volumes::voxel::VoxelType;

/// How a strip or tile is packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Compression {
    None,
    Lzw,
    Deflate,
    PackBits,
}

impl Compression {
    pub fn of(code: u64) -> Result<Self, Fault> {
        let name = match code {
            1 => return Ok(Self::None),
            5 => return Ok(Self::Lzw),
            8 | 32946 => return Ok(Self::Deflate),
            32773 => return Ok(Self::PackBits),
            2..=4 => " (fax)",
            6 | 7 => " (JPEG)",
            34712 | 33003 | 33005 => " (JPEG 2000)",
            50000 => " (Zstandard)",
            _ => "",
        };
        Err(Fault::Value {
            what: "the compression",
            value: format!("{code}{name}"),
            remedy: "save the file plain, or with deflate, LZW or PackBits",
        })
    }
}

/// What was done to the voxels of a row before packing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Predictor {
    None,
    /// Differences of neighbours, as integers of the voxel's size.
    Horizontal,
    /// Bytes sorted by significance, highest first, then their differences.
    Float,
}

impl Predictor {
    pub fn of(code: u64, voxel: VoxelType) -> Result<Self, Fault> {
        let is_float = matches!(voxel, VoxelType::F32 | VoxelType::F64);
        match code {
            1 => Ok(Self::None),
            2 => Ok(Self::Horizontal),
            3 if is_float => Ok(Self::Float),
            _ => Err(Fault::Value {
                what: "the predictor",
                value: format!("{code} for {voxel}"),
                remedy: "save the file without a predictor, or with the horizontal one",
            }),
        }
    }
}

/// Fills `out` from `packed`; what is too short or does not hold is told in words.
pub(super) fn inflate(
    how: Compression,
    zlib: &mut Decompress,
    packed: &[u8],
    out: &mut [u8],
) -> Result<(), String> {
    let filled = match how {
        Compression::None => unreachable!("plain chunks are read in place"),
        Compression::Deflate => deflate(zlib, packed, out)?,
        Compression::Lzw => lzw(packed, out)?,
        Compression::PackBits => pack_bits(packed, out),
    };
    if filled < out.len() {
        return Err(format!("{filled} bytes come out of it, {} are needed", out.len()));
    }
    Ok(())
}

fn deflate(state: &mut Decompress, packed: &[u8], out: &mut [u8]) -> Result<usize, String> {
    state.reset(true);
    loop {
        let (read, written) = (state.total_in() as usize, state.total_out() as usize);
        let status = state
            .decompress(&packed[read..], &mut out[written..], FlushDecompress::Finish)
            .map_err(|e| format!("the deflate stream does not hold ({e})"))?;
        let done = state.total_out() as usize;
        let is_stuck = state.total_in() as usize == read && done == written;
        if status == Status::StreamEnd || is_stuck {
            return Ok(done);
        }
    }
}

fn lzw(packed: &[u8], out: &mut [u8]) -> Result<usize, String> {
    let mut state = weezl::decode::Decoder::with_tiff_size_switch(BitOrder::Msb, 8);
    let (mut read, mut written) = (0, 0);
    while written < out.len() {
        let step = state.decode_bytes(&packed[read..], &mut out[written..]);
        read += step.consumed_in;
        written += step.consumed_out;
        match step.status {
            Ok(LzwStatus::Ok) if step.consumed_in > 0 || step.consumed_out > 0 => {}
            Ok(_) => break,
            Err(e) => return Err(format!("the LZW stream does not hold ({e})")),
        }
    }
    Ok(written)
}

/// TIFF 6, section 9: a count below 128 and so many bytes plus one, or a count above and a byte to repeat.
fn pack_bits(packed: &[u8], out: &mut [u8]) -> usize {
    let (mut rest, mut written) = (packed, 0);
    while written < out.len()
        && let [head, tail @ ..] = rest
    {
        let room = out.len() - written;
        let (count, taken) = match head {
            0..128 => {
                let count = (usize::from(*head) + 1).min(tail.len()).min(room);
                out[written..written + count].copy_from_slice(&tail[..count]);
                (count, count)
            }
            128 => (0, 0),
            _ => {
                let Some(value) = tail.first() else {
                    break;
                };
                let count = (257 - usize::from(*head)).min(room);
                out[written..written + count].fill(*value);
                (count, 1)
            }
        };
        written += count;
        rest = &tail[taken..];
    }
    written
}

/// Turns a row back to what it was before packing; `size` bytes a voxel. A row of floats comes out big endian.
pub(super) fn undo_predictor(predictor: Predictor, row: &mut [u8], size: usize, is_big_endian: bool) {
    match predictor {
        Predictor::None => {}
        Predictor::Horizontal => {
            macro_rules! add {
                ($t:ty) => {{
                    let mut sum: $t = 0;
                    for bytes in row.chunks_exact_mut(size_of::<$t>()) {
                        let raw = (&*bytes).try_into().expect("chunks of this size");
                        let step = if is_big_endian {
                            <$t>::from_be_bytes(raw)
                        } else {
                            <$t>::from_le_bytes(raw)
                        };
                        sum = sum.wrapping_add(step);
                        let raw = if is_big_endian {
                            sum.to_be_bytes()
                        } else {
                            sum.to_le_bytes()
                        };
                        bytes.copy_from_slice(&raw);
                    }
                }};
            }
            match size {
                1 => add!(u8),
                2 => add!(u16),
                4 => add!(u32),
                _ => add!(u64),
            }
        }
        Predictor::Float => {
            let mut sum = 0u8;
            for byte in row.iter_mut() {
                sum = sum.wrapping_add(*byte);
                *byte = sum;
            }
            let sorted = row.to_vec();
            let count = row.len() / size;
            for (k, voxel) in row.chunks_exact_mut(size).enumerate() {
                for (b, byte) in voxel.iter_mut().enumerate() {
                    *byte = sorted[b * count + k];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of TIFF 6, section 9.
    #[test]
    fn pack_bits_of_the_standard_is_unpacked() {
        let packed = [
            0xfe, 0xaa, 0x02, 0x80, 0x00, 0x2a, 0xfd, 0xaa, 0x03, 0x80, 0x00, 0x2a, 0x22, 0xf7, 0xaa,
        ];
        let mut out = [0; 24];
        let mut zlib = Decompress::new(true);
        inflate(Compression::PackBits, &mut zlib, &packed, &mut out).unwrap();
        assert_eq!(out[..7], [0xaa, 0xaa, 0xaa, 0x80, 0x00, 0x2a, 0xaa]);
        assert_eq!(out[14..], [0xaa; 10]);
        for cut in 0..packed.len() {
            assert!(
                inflate(Compression::PackBits, &mut zlib, &packed[..cut], &mut out).is_err(),
                "{cut}"
            );
        }
    }

    #[test]
    fn differences_are_summed_and_sorted_bytes_put_back() {
        let mut row = [1, 0, 255, 255, 3, 0];
        undo_predictor(Predictor::Horizontal, &mut row, 2, false);
        assert_eq!(row, [1, 0, 0, 0, 3, 0]);
        // 1.0 and 2.0: high bytes 3f 40, then 80 00, then zeros; differences of these.
        let sorted = [0x3f, 0x40, 0x80, 0, 0, 0, 0, 0u8];
        let mut before = 0u8;
        let mut row = sorted.map(|b| b.wrapping_sub(std::mem::replace(&mut before, b)));
        undo_predictor(Predictor::Float, &mut row, 4, false);
        assert_eq!(row[..4], 1f32.to_be_bytes());
        assert_eq!(row[4..], 2f32.to_be_bytes());
    }
}
