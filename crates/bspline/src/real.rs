use std::fmt::Debug;
use std::iter::Sum;
use std::ops::{AddAssign, MulAssign, SubAssign};

use num_traits::Float;

/// The two floating-point types a spline can be stored and evaluated in.
///
/// `f32` is the working precision; the same code in `f64` gives reference solutions.
pub trait Real:
    Float + Default + Debug + Send + Sync + AddAssign + SubAssign + MulAssign + Sum + 'static
{
    /// Name used on the command line and in files: `"f32"` or `"f64"`.
    const NAME: &'static str;
    /// Unit round-off (half the distance from 1 to the next number).
    const UNIT_ROUND_OFF: f64;

    /// Nearest value of this type.
    fn from_f64(x: f64) -> Self;
    /// Exact conversion.
    fn as_f64(self) -> f64;
    /// Appends the little-endian bytes of the value.
    fn extend_le_bytes(self, bytes: &mut Vec<u8>);
}

impl Real for f32 {
    const NAME: &'static str = "f32";
    const UNIT_ROUND_OFF: f64 = f32::EPSILON as f64 / 2.0;

    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        x as f32
    }
    #[inline(always)]
    fn as_f64(self) -> f64 {
        self as f64
    }
    fn extend_le_bytes(self, bytes: &mut Vec<u8>) {
        bytes.extend(self.to_le_bytes());
    }
}

impl Real for f64 {
    const NAME: &'static str = "f64";
    const UNIT_ROUND_OFF: f64 = f64::EPSILON / 2.0;

    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn as_f64(self) -> f64 {
        self
    }
    fn extend_le_bytes(self, bytes: &mut Vec<u8>) {
        bytes.extend(self.to_le_bytes());
    }
}
