//! JPEG 2000, lossless and lossy, one component of up to 16 bits.

use hayro_jpeg2000::{DecodeSettings, DecoderContext, Image};

use super::{Shape, damaged};
use crate::Fault;

/// Bytes of the decoder's own memory for a picture of `pixels`: 14 a pixel were measured, for tiles and code blocks of
/// the usual size.
pub(super) fn working_bytes(pixels: u64) -> u64 {
    24 * pixels + (1 << 20)
}

pub(super) fn decode(compressed: &[u8], shape: &Shape, out: &mut Vec<u8>) -> Result<usize, Fault> {
    let size = Size::read(compressed)?;
    shape.check(size.width, size.height, size.components)?;
    let settings = DecodeSettings {
        strict: true,
        ..Default::default()
    };
    let fault = |e| damaged("JPEG 2000", e);
    let image = Image::new(compressed, &settings).map_err(fault)?;
    if (image.width() as usize, image.height() as usize) != (shape.columns, shape.rows) {
        return Err(damaged("JPEG 2000", "its boxes contradict its picture"));
    }
    let mut context = DecoderContext::default();
    let decoded = image.decode(&mut context).map_err(fault)?;
    let [component] = decoded.components() else {
        return Err(damaged("JPEG 2000", "it is no grey picture"));
    };
    if component.samples().len() != shape.pixel_count() {
        return Err(damaged(
            "JPEG 2000",
            format!("it has {} samples", component.samples().len()),
        ));
    }
    for sample in component.samples() {
        out.extend_from_slice(&(size.number(*sample, shape) as u16).to_le_bytes());
    }
    Ok(2)
}

/// What the marker SIZ says (ISO/IEC 15444-1, A.5.1).
struct Size {
    width: u64,
    height: u64,
    components: u64,
    bits: u32,
    signed: bool,
}

impl Size {
    /// The number that a decoded sample stands for.
    ///
    /// A lossy stream overshoots at edges: what is beyond the depth of the stream, or beyond the bits that the header
    /// says are stored, is their end and not what their bits would wrap to.
    fn number(&self, sample: f32, shape: &Shape) -> i32 {
        let top = (1i32 << self.bits) - 1;
        // The decoder shifts signed samples up as it does unsigned ones.
        let shift = if self.signed { 1i32 << (self.bits - 1) } else { 0 };
        let number = sample.round().clamp(0.0, top as f32) as i32 - shift;
        if self.signed != shape.signed || shape.bits_stored >= self.bits {
            return number;
        }
        let (low, high) = match shape.signed {
            true => (
                -(1 << (shape.bits_stored - 1)),
                (1 << (shape.bits_stored - 1)) - 1,
            ),
            false => (0, (1 << shape.bits_stored) - 1),
        };
        number.clamp(low, high)
    }

    fn read(stream: &[u8]) -> Result<Self, Fault> {
        const START: [u8; 4] = [0xFF, 0x4F, 0xFF, 0x51];
        // In a file with boxes the code stream stands at the end; files of DICOM have none.
        let at =
            memchr::memmem::find(stream, &START).ok_or_else(|| damaged("JPEG 2000", "it has no picture"))?;
        let size = &stream[at + 4..];
        let head: &[u8; 39] = size
            .first_chunk()
            .ok_or_else(|| damaged("JPEG 2000", "it ends in its header"))?;
        let long = |i: usize| {
            u64::from(u32::from_be_bytes([
                head[i],
                head[i + 1],
                head[i + 2],
                head[i + 3],
            ]))
        };
        let [width, height, left, top, tile_width, tile_height] = [4, 8, 12, 16, 20, 24].map(long);
        let depth = head[38];
        let this = Self {
            width: width.saturating_sub(left),
            height: height.saturating_sub(top),
            components: u64::from(u16::from_be_bytes([head[36], head[37]])),
            bits: u32::from(depth & 0x7F) + 1,
            signed: depth & 0x80 != 0,
        };
        if this.bits > 16 {
            return Err(Fault::Value {
                what: "the depth of a JPEG 2000 picture",
                value: format!("{} bits", this.bits),
                remedy: "up to 16 are read; convert the files first, for instance by gdcmconv --raw IN OUT",
            });
        }
        // A decoder keeps books on each tile: pictures of many pixels with tiles of one would take gigabytes.
        let tiles = width.div_ceil(tile_width.max(1)) * height.div_ceil(tile_height.max(1));
        if tiles > 65_535 || tiles > 64 + this.width * this.height / 256 {
            return Err(damaged("JPEG 2000", format!("it has {tiles} tiles")));
        }
        Ok(this)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overshoot_ends_at_the_stored_depth() {
        let number = |bits, signed, bits_stored, header_signed, sample| {
            let size = Size {
                width: 1,
                height: 1,
                components: 1,
                bits,
                signed,
            };
            let shape = Shape {
                rows: 1,
                columns: 1,
                bytes_per_pixel: 2,
                bits_stored,
                signed: header_signed,
            };
            size.number(sample, &shape)
        };
        for (bits, stored) in [(12, 12), (16, 12), (12, 16)] {
            for (sample, expected) in [(-0.7, 0), (-300.0, 0), (5.4, 5), (4095.6, 4095), (4400.0, 4095)] {
                assert_eq!(
                    number(bits, false, stored, false, sample),
                    expected,
                    "{bits} {stored} {sample}"
                );
            }
        }
        for (sample, expected) in [(-3.0, -2048), (0.0, -2048), (2048.0, 0), (4099.0, 2047)] {
            assert_eq!(number(12, true, 12, true, sample), expected, "{sample}");
        }
        assert_eq!(number(16, true, 12, true, 32768.0 + 2050.0), 2047);
        assert_eq!(number(16, true, 12, true, 32768.0 - 2050.0), -2048);
        // Header and stream disagree about the sign: the bits are what there is.
        assert_eq!(number(16, false, 12, true, 4000.0), 4000);
        assert_eq!(number(16, false, 16, false, 70_000.0), 65_535);
    }
}
