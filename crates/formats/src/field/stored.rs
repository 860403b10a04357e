use bspline::{HierarchicalSpline, Real};

use super::AnyField;

/// The coefficient types that a file holds: `f32` and `f64`.
pub trait Stored: Real {
    /// Bytes of a coefficient.
    const BYTES: usize;
    /// Little-endian bytes, `BYTES` long.
    type Raw: AsRef<[u8]>;
    /// The bytes of a value.
    fn to_raw(self) -> Self::Raw;
    /// The value whose byte `i` is `byte(i)`.
    fn from_bytes(byte: impl Fn(usize) -> u8) -> Self;
    /// A field of this precision as one of any.
    fn any(field: HierarchicalSpline<Self>) -> AnyField;
}

impl Stored for f32 {
    const BYTES: usize = 4;
    type Raw = [u8; 4];
    #[inline(always)]
    fn to_raw(self) -> [u8; 4] {
        self.to_le_bytes()
    }
    #[inline(always)]
    fn from_bytes(byte: impl Fn(usize) -> u8) -> Self {
        Self::from_le_bytes(std::array::from_fn(byte))
    }
    fn any(field: HierarchicalSpline<Self>) -> AnyField {
        AnyField::F32(field)
    }
}

impl Stored for f64 {
    const BYTES: usize = 8;
    type Raw = [u8; 8];
    #[inline(always)]
    fn to_raw(self) -> [u8; 8] {
        self.to_le_bytes()
    }
    #[inline(always)]
    fn from_bytes(byte: impl Fn(usize) -> u8) -> Self {
        Self::from_le_bytes(std::array::from_fn(byte))
    }
    fn any(field: HierarchicalSpline<Self>) -> AnyField {
        AnyField::F64(field)
    }
}
