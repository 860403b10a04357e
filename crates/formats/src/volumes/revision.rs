//! What changes when a volume is written again: densities, and the numbers that stand for them in a file.

use super::voxel::VoxelType;

/// New density of a voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// `x + nx·(y + ny·z)` in the whole volume.
    pub voxel: usize,
    /// After rescaling.
    pub density: f64,
}

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Revision {
    /// Voxels that hold another number than before.
    pub changed: usize,
    /// Largest difference between a density asked for and the one that is stored, but for those beyond the type.
    pub rounding: f64,
    /// Densities beyond what the type of the voxels can hold; the nearest that it can was taken.
    pub clamped: usize,
}

/// How a density becomes a number: `density = slope · number + intercept`.
pub(super) struct Scale {
    pub rescale: Option<[f64; 2]>,
    /// Least and largest number.
    pub range: (f64, f64),
    pub is_integer: bool,
}

impl Scale {
    pub fn of(stored: VoxelType, rescale: Option<[f64; 2]>) -> Self {
        Self {
            rescale,
            range: stored.range(),
            is_integer: stored.is_integer(),
        }
    }

    /// The number nearest to a density; what is lost goes into `told`.
    pub fn number(&self, density: f64, told: &mut Revision) -> f64 {
        let [slope, intercept] = self.rescale.unwrap_or([1.0, 0.0]);
        let exact = (density - intercept) / slope;
        let rounded = if self.is_integer { exact.round() } else { exact };
        let (least, largest) = self.range;
        let number = rounded.clamp(least, largest);
        if number != rounded {
            told.clamped += 1;
        } else {
            let stored = number * slope + intercept;
            told.rounding = told.rounding.max((stored - density).abs());
        }
        number
    }
}

/// Puts a number of a type in place of the bytes of another; whether these changed.
pub(super) fn put(bytes: &mut [u8], stored: VoxelType, big_endian: bool, number: f64) -> bool {
    macro_rules! bytes_of {
        ($t:ty) => {{
            let number = number as $t;
            let new = if big_endian {
                number.to_be_bytes()
            } else {
                number.to_le_bytes()
            };
            let is_new = bytes != new;
            bytes.copy_from_slice(&new);
            is_new
        }};
    }
    match stored {
        VoxelType::U8 => bytes_of!(u8),
        VoxelType::I8 => bytes_of!(i8),
        VoxelType::U16 => bytes_of!(u16),
        VoxelType::I16 => bytes_of!(i16),
        VoxelType::U32 => bytes_of!(u32),
        VoxelType::I32 => bytes_of!(i32),
        VoxelType::U64 => bytes_of!(u64),
        VoxelType::I64 => bytes_of!(i64),
        VoxelType::F32 => bytes_of!(f32),
        VoxelType::F64 => bytes_of!(f64),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn densities_become_the_nearest_number_that_the_type_holds() {
        let mut told = Revision::default();
        let scale = Scale::of(VoxelType::I16, Some([0.5, -1000.0]));
        assert_eq!(scale.number(-999.7, &mut told), 1.0);
        assert!((told.rounding - 0.2).abs() < 1e-9, "{told:?}");
        assert_eq!(scale.number(1e6, &mut told), 32767.0);
        assert_eq!(told.clamped, 1);
        let mut told = Revision::default();
        let plain = Scale::of(VoxelType::F32, None);
        assert_eq!(plain.number(0.1, &mut told), 0.1);
        assert_eq!(told, Revision::default());
    }

    #[test]
    fn numbers_take_the_place_of_others_in_either_order_of_bytes() {
        let mut bytes = [0xff, 0xfe];
        assert!(put(&mut bytes, VoxelType::I16, true, 258.0));
        assert_eq!(bytes, [1, 2]);
        assert!(!put(&mut bytes, VoxelType::I16, true, 258.0));
        assert!(put(&mut bytes, VoxelType::U16, false, 258.0));
        assert_eq!(bytes, [2, 1]);
    }
}
