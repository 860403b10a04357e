//! Stored numbers to densities.

use super::dataset::{PixelFormat, PixelKind};

/// How a pixel lies in its bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub kind: PixelKind,
    /// 1, 2, 4 or 8.
    pub bytes: usize,
    pub big_endian: bool,
    /// Whether pixels of one byte stand in 16-bit words of a big-endian file.
    pub swapped_pairs: bool,
    pub bits_stored: u32,
    pub high_bit: u32,
    pub signed: bool,
}

impl Layout {
    /// The same pixels out of a codec, which gives `bytes` little-endian bytes each, aligned at bit 0.
    pub fn decoded(self, bytes: usize) -> Self {
        let bits_stored = self.bits_stored.min(8 * bytes as u32);
        Self {
            bytes,
            big_endian: false,
            swapped_pairs: false,
            bits_stored,
            high_bit: bits_stored - 1,
            ..self
        }
    }
}

impl Layout {
    /// Least and largest number that a pixel can hold.
    pub fn range(&self) -> (f64, f64) {
        match self.kind {
            PixelKind::Float32 => (f32::MIN.into(), f32::MAX.into()),
            PixelKind::Float64 => (f64::MIN, f64::MAX),
            PixelKind::Integer => {
                let steps = (1u64 << self.bits_stored) as f64;
                match self.signed {
                    true => (-steps / 2.0, steps / 2.0 - 1.0),
                    false => (0.0, steps - 1.0),
                }
            }
        }
    }

    /// Puts a number that the pixel can hold in place of its (little-endian) bytes; bits beside those stored stay. Whether
    /// it changed.
    pub fn put(&self, bytes: &mut [u8], number: f64) -> bool {
        let old = bytes
            .iter()
            .rev()
            .fold(0u64, |word, byte| word << 8 | u64::from(*byte));
        let new = match self.kind {
            PixelKind::Float32 => u64::from((number as f32).to_bits()),
            PixelKind::Float64 => number.to_bits(),
            PixelKind::Integer => {
                let shift = self.high_bit + 1 - self.bits_stored;
                let stored = (1u64 << self.bits_stored) - 1;
                old & !(stored << shift) | (number as i64 as u64 & stored) << shift
            }
        };
        bytes.copy_from_slice(&new.to_le_bytes()[..bytes.len()]);
        new != old
    }
}

/// `slope · stored + intercept`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rescale {
    pub slope: f64,
    pub intercept: f64,
}

impl Rescale {
    pub const NONE: Self = Self {
        slope: 1.0,
        intercept: 0.0,
    };
}

/// Converts `raw` to densities, in double precision where there is a rescaling. Gives how many pixels hold
/// `padding`, a stored number.
pub(super) fn convert(
    raw: &[u8],
    layout: &Layout,
    rescale: Rescale,
    padding: Option<f64>,
    out: &mut [f32],
) -> usize {
    debug_assert!(raw.len() >= out.len() * layout.bytes);
    // Bits above the highest are shifted out, those below the lowest after it: overlays lived there once.
    macro_rules! integers {
        ($unsigned:ty, $signed:ty) => {{
            const BITS: u32 = <$unsigned>::BITS;
            let up = BITS - 1 - layout.high_bit;
            let down = BITS - layout.bits_stored;
            if layout.signed {
                each!($unsigned, |v| ((v << up) as $signed) >> down)
            } else {
                each!($unsigned, |v| (v << up) >> down)
            }
        }};
    }
    macro_rules! each {
        ($t:ty, $number:expr) => {
            if layout.big_endian {
                each!($t, $number, from_be_bytes)
            } else {
                each!($t, $number, from_le_bytes)
            }
        };
        ($t:ty, $number:expr, $from:ident) => {{
            let number = $number;
            let numbers = raw
                .chunks_exact(size_of::<$t>())
                .map(|b| number(<$t>::$from(b.try_into().expect("chunks of this size"))));
            let mut padded = 0;
            if rescale == Rescale::NONE && padding.is_none() {
                for (o, v) in out.iter_mut().zip(numbers) {
                    *o = v as f32;
                }
            } else {
                let padding = padding.unwrap_or(f64::NAN);
                let Rescale { slope, intercept } = rescale;
                for (o, v) in out.iter_mut().zip(numbers) {
                    let v = v as f64;
                    padded += usize::from(v == padding);
                    *o = (v * slope + intercept) as f32;
                }
            }
            padded
        }};
    }
    if layout.swapped_pairs {
        // One byte each: the pixel of the other byte of its word; the last of an odd number has padding beside it.
        let mut swapped = raw.to_vec();
        swapped.chunks_exact_mut(2).for_each(|pair| pair.swap(0, 1));
        let plain = Layout {
            swapped_pairs: false,
            ..*layout
        };
        return convert(&swapped, &plain, rescale, padding, out);
    }
    match (layout.kind, layout.bytes) {
        (PixelKind::Float32, _) => each!(u32, |v| f32::from_bits(v)),
        (PixelKind::Float64, _) => each!(u64, |v| f64::from_bits(v)),
        (PixelKind::Integer, 1) => integers!(u8, i8),
        (PixelKind::Integer, 2) => integers!(u16, i16),
        (PixelKind::Integer, _) => integers!(u32, i32),
    }
}

impl PixelFormat {
    /// The stored number that a padding value, read as unsigned, stands for.
    pub fn signed_number(&self, value: i64) -> f64 {
        let bits = self.bits_allocated.clamp(1, 32);
        let low = value & ((1 << bits) - 1);
        if self.signed && low >> (bits - 1) & 1 == 1 {
            return (low - (1 << bits)) as f64;
        }
        low as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(bytes: usize, bits_stored: u32, high_bit: u32, signed: bool) -> Layout {
        Layout {
            kind: PixelKind::Integer,
            bytes,
            big_endian: false,
            swapped_pairs: false,
            bits_stored,
            high_bit,
            signed,
        }
    }

    fn one(raw: &[u8], layout: Layout) -> f32 {
        let mut out = [0.0];
        convert(raw, &layout, Rescale::NONE, None, &mut out);
        out[0]
    }

    #[test]
    fn bits_outside_of_those_stored_do_not_count() {
        // An overlay in the upper four bits of 12 stored ones.
        assert_eq!(one(&[0x34, 0xF2], layout(2, 12, 11, false)), 0x234 as f32);
        // The sign is bit 11, whatever stands above.
        assert_eq!(one(&[0xFF, 0x0F], layout(2, 12, 11, true)), -1.0);
        assert_eq!(one(&[0xFF, 0x07], layout(2, 12, 11, true)), 2047.0);
        // Stored in the upper 12 bits.
        assert_eq!(one(&[0x4F, 0x23], layout(2, 12, 15, false)), 0x234 as f32);
        assert_eq!(one(&[0xFF], layout(1, 8, 7, true)), -1.0);
        assert_eq!(one(&[0, 0, 0, 0x80], layout(4, 32, 31, true)), -(2f32.powi(31)));
    }

    #[test]
    fn numbers_are_put_where_they_are_read() {
        for (layout, numbers) in [
            (layout(2, 12, 11, false), [0.0, 4095.0, 77.0]),
            (layout(2, 12, 11, true), [-2048.0, 2047.0, -1.0]),
            (layout(2, 12, 15, true), [-2048.0, 2047.0, 5.0]),
            (layout(1, 8, 7, true), [-128.0, 127.0, 3.0]),
            (layout(4, 32, 31, true), [-(2f64.powi(31)), 2f64.powi(30), 9.0]),
        ] {
            assert_eq!(layout.range().0, numbers[0]);
            for number in numbers {
                let mut raw = vec![0xA5; layout.bytes];
                layout.put(&mut raw, number);
                assert_eq!(f64::from(one(&raw, layout)), number, "{layout:?}");
                assert!(!layout.put(&mut raw, number));
            }
        }
        // An overlay in the upper bits stays.
        let mut raw = [0x34, 0xF2];
        assert!(layout(2, 12, 11, false).put(&mut raw, 0x111 as f64));
        assert_eq!(raw, [0x11, 0xF1]);
    }

    #[test]
    fn rescaling_is_done_in_double_precision_and_padding_counted_before_it() {
        let raw: Vec<u8> = [-2000i16, 5, 6].iter().flat_map(|v| v.to_be_bytes()).collect();
        let big = Layout {
            big_endian: true,
            ..layout(2, 16, 15, true)
        };
        let mut out = [0.0; 3];
        let rescale = Rescale {
            slope: 0.1,
            intercept: -1024.0,
        };
        assert_eq!(convert(&raw, &big, rescale, Some(-2000.0), &mut out), 1);
        assert_eq!(
            out,
            [
                -1224.0,
                (0.5f64 - 1024.0) as f32,
                (0.6000000000000001f64 - 1024.0) as f32
            ]
        );
    }

    #[test]
    fn a_padding_value_read_as_unsigned_gets_its_sign_back() {
        let format = |signed| PixelFormat {
            bits_allocated: 16,
            signed,
            ..Default::default()
        };
        assert_eq!(format(true).signed_number(63536), -2000.0);
        assert_eq!(format(true).signed_number(-2000), -2000.0);
        assert_eq!(format(false).signed_number(63536), 63536.0);
    }
}
