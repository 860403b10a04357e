//! Pixels of one frame out of their compressed bytes.

mod jpeg;
mod jpeg2000;
#[cfg(feature = "jpeg-ls")]
mod jpeg_ls;
mod rle;

use super::syntax::Codec;
use crate::Fault;

/// What a frame decodes to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    pub rows: usize,
    pub columns: usize,
    /// 1, 2 or 4, as the header says.
    pub bytes_per_pixel: usize,
    /// Bits and sign of the stored numbers, as the header says.
    pub bits_stored: u32,
    pub signed: bool,
}

impl Shape {
    pub fn pixel_count(&self) -> usize {
        self.rows * self.columns
    }

    /// Refuses a picture that is not the one that the header announces, before memory is taken for it.
    fn check(&self, width: u64, height: u64, components: u64) -> Result<(), Fault> {
        if (width, height, components) == (self.columns as u64, self.rows as u64, 1) {
            return Ok(());
        }
        Err(Fault::Value {
            what: "the size of a compressed picture",
            value: format!(
                "{width} x {height} with {components} components, where the header says {} x {} with 1",
                self.columns, self.rows
            ),
            remedy: "header and pixels disagree; fetch the file again",
        })
    }
}

/// Bytes held while a frame is decoded, besides its compressed bytes and the result.
pub(super) fn working_bytes(codec: Codec, shape: &Shape) -> u64 {
    let pixels = shape.pixel_count() as u64;
    match codec {
        Codec::Native | Codec::Rle => 0,
        // The library gives a vector of its own.
        Codec::JpegLs => 2 * pixels,
        // Differences and samples of the lossless process; coefficients of the progressive one. 6 were measured.
        Codec::Jpeg => 8 * pixels + (1 << 20),
        // Coefficients, wavelet output, samples, the tree of code blocks.
        Codec::Jpeg2000 => jpeg2000::working_bytes(pixels),
    }
}

/// Decodes `compressed` into `out`: `bytes` little-endian bytes a pixel, row after row. Gives `bytes`, which can be
/// fewer than the header says: a picture of 8 bits decodes to one byte.
pub(super) fn decode(
    codec: Codec,
    compressed: &[u8],
    shape: &Shape,
    out: &mut Vec<u8>,
) -> Result<usize, Fault> {
    out.clear();
    match codec {
        Codec::Native => unreachable!("native frames are read as they are"),
        Codec::Rle => rle::decode(compressed, shape, out),
        Codec::Jpeg => jpeg::decode(compressed, shape, out),
        Codec::Jpeg2000 => jpeg2000::decode(compressed, shape, out),
        #[cfg(feature = "jpeg-ls")]
        Codec::JpegLs => jpeg_ls::decode(compressed, shape, out),
        #[cfg(not(feature = "jpeg-ls"))]
        Codec::JpegLs => unreachable!("refused with its transfer syntax"),
    }
}

fn damaged(what: &str, e: impl std::fmt::Display) -> Fault {
    Fault::Damaged {
        what: format!("the {what} stream does not hold ({e})"),
    }
}
