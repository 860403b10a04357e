//! Run lengths of byte planes, most significant plane first (DICOM PS3.5, annex G).

use super::{Shape, damaged};
use crate::Fault;

pub(super) fn decode(compressed: &[u8], shape: &Shape, out: &mut Vec<u8>) -> Result<usize, Fault> {
    let word = |i: usize| {
        let bytes = compressed.get(4 * i..4 * i + 4)?;
        Some(u32::from_le_bytes(bytes.try_into().ok()?) as usize)
    };
    let planes = shape.bytes_per_pixel;
    let found = word(0).ok_or_else(|| damaged("RLE", "it has no header"))?;
    if found != planes {
        return Err(damaged(
            "RLE",
            format!("{found} byte planes where {planes} are needed"),
        ));
    }
    out.resize(shape.pixel_count() * planes, 0);
    for plane in 0..planes {
        let start = word(1 + plane).filter(|at| *at >= 64 && *at <= compressed.len());
        let start = start.ok_or_else(|| damaged("RLE", format!("plane {plane} starts outside of it")))?;
        let significance = planes - 1 - plane;
        let place = out.iter_mut().skip(significance).step_by(planes);
        let filled = unpack(&compressed[start..], place);
        if filled < shape.pixel_count() {
            return Err(Fault::Truncated {
                what: format!("byte plane {plane} of an RLE frame"),
                needed: shape.pixel_count() as u64,
                found: filled as u64,
            });
        }
    }
    Ok(planes)
}

/// PackBits. Gives the number of bytes put in place; what goes beyond is dropped.
fn unpack<'a>(mut packed: &[u8], mut place: impl Iterator<Item = &'a mut u8>) -> usize {
    let mut filled = 0;
    while let [control, rest @ ..] = packed {
        let control = *control as i8;
        let literal = control >= 0;
        let length = usize::from(control.unsigned_abs()) + 1;
        let used = if literal { length } else { 1 };
        if control == i8::MIN {
            packed = rest;
            continue;
        }
        if rest.len() < used {
            break;
        }
        for i in 0..length {
            let Some(p) = place.next() else {
                return filled;
            };
            *p = rest[if literal { i } else { 0 }];
            filled += 1;
        }
        packed = &rest[used..];
    }
    filled
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of Apple's technical note 1023.
    #[test]
    fn the_packbits_example_unpacks() {
        let packed = [
            0xFE, 0xAA, 0x02, 0x80, 0x00, 0x2A, 0xFD, 0xAA, 0x03, 0x80, 0x00, 0x2A, 0x22, 0xF7, 0xAA, 0x80,
        ];
        let mut out = [0; 24];
        assert_eq!(unpack(&packed, out.iter_mut()), 24);
        assert_eq!(out[..6], [0xAA, 0xAA, 0xAA, 0x80, 0, 0x2A]);
        assert_eq!(out[6..14], [0xAA, 0xAA, 0xAA, 0xAA, 0x80, 0, 0x2A, 0x22]);
        assert_eq!(out[14..], [0xAA; 10]);
        assert_eq!(unpack(&packed[..6], out.iter_mut()), 6);
        assert_eq!(unpack(&packed, out[..9].iter_mut()), 9);
    }
}
