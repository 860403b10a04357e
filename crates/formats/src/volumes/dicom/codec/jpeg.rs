//! JPEG: the baseline process with 8 bits and the lossless ones with up to 16.

use jpeg_decoder::{Decoder, PixelFormat};

use super::{Shape, damaged};
use crate::Fault;

pub(super) fn decode(compressed: &[u8], shape: &Shape, out: &mut Vec<u8>) -> Result<usize, Fault> {
    let fault = |e: jpeg_decoder::Error| damaged("JPEG", e);
    let mut decoder = Decoder::new(compressed);
    decoder.read_info().map_err(fault)?;
    let info = decoder.info().ok_or_else(|| damaged("JPEG", "it has no frame"))?;
    let (bytes, components) = match info.pixel_format {
        PixelFormat::L8 => (1, 1),
        PixelFormat::L16 => (2, 1),
        PixelFormat::RGB24 => (1, 3),
        PixelFormat::CMYK32 => (1, 4),
    };
    shape.check(info.width.into(), info.height.into(), components)?;
    let pixels = decoder.decode().map_err(fault)?;
    if pixels.len() != shape.pixel_count() * bytes {
        return Err(damaged(
            "JPEG",
            format!("it has {} bytes of pixels", pixels.len()),
        ));
    }
    if bytes == 1 {
        out.extend_from_slice(&pixels);
    } else {
        // The decoder gives numbers of the machine.
        let numbers = pixels.chunks_exact(2).map(|b| u16::from_ne_bytes([b[0], b[1]]));
        out.extend(numbers.flat_map(u16::to_le_bytes));
    }
    Ok(bytes)
}
