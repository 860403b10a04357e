//! JPEG-LS, by the C++ library CharLS.

use charls::CharLS;

use super::{Shape, damaged};
use crate::Fault;

pub(super) fn decode(compressed: &[u8], shape: &Shape, out: &mut Vec<u8>) -> Result<usize, Fault> {
    let (width, height, components, bits) = frame(compressed)?;
    shape.check(width, height, components)?;
    *out = CharLS::default()
        .decode(compressed)
        .map_err(|e| damaged("JPEG-LS", e))?;
    let bytes = if bits <= 8 { 1 } else { 2 };
    if out.len() != shape.pixel_count() * bytes {
        return Err(damaged(
            "JPEG-LS",
            format!("it has {} bytes of pixels", out.len()),
        ));
    }
    Ok(bytes)
}

/// Width, height, components and bits of the frame header SOF55 (ISO/IEC 14495-1, C.2.2).
fn frame(stream: &[u8]) -> Result<(u64, u64, u64, u8), Fault> {
    let mut at = 2;
    while let Some([0xFF, marker, high, low]) = stream.get(at..at + 4) {
        if *marker == 0xF7 {
            let head = stream.get(at + 4..at + 10);
            let h = head.ok_or_else(|| damaged("JPEG-LS", "it ends in its header"))?;
            let height = u64::from(u16::from_be_bytes([h[1], h[2]]));
            let width = u64::from(u16::from_be_bytes([h[3], h[4]]));
            return Ok((width, height, h[5].into(), h[0]));
        }
        at += 2 + usize::from(u16::from_be_bytes([*high, *low]));
    }
    Err(damaged("JPEG-LS", "it has no frame header"))
}
