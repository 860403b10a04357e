use std::fmt;
use std::str::FromStr;

/// Types of voxels that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are the types")]
pub enum VoxelType {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

impl VoxelType {
    const CODES: [(i16, Self); 10] = [
        (2, Self::U8),
        (256, Self::I8),
        (512, Self::U16),
        (4, Self::I16),
        (768, Self::U32),
        (8, Self::I32),
        (1280, Self::U64),
        (1024, Self::I64),
        (16, Self::F32),
        (64, Self::F64),
    ];

    /// Type of a NIfTI `datatype` code.
    pub(super) fn from_code(code: i16) -> Option<Self> {
        Self::CODES.iter().find(|(c, _)| *c == code).map(|(_, t)| *t)
    }

    /// NIfTI `datatype` code.
    pub(super) fn code(self) -> i16 {
        Self::CODES
            .iter()
            .find(|(_, t)| *t == self)
            .expect("every type is listed")
            .0
    }

    /// Bytes of a voxel.
    pub fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    /// Whether values are whole numbers.
    pub fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }

    /// Smallest and largest finite value.
    pub fn range(self) -> (f64, f64) {
        macro_rules! of {
            ($t:ty) => {
                (<$t>::MIN as f64, <$t>::MAX as f64)
            };
        }
        match self {
            Self::U8 => of!(u8),
            Self::I8 => of!(i8),
            Self::U16 => of!(u16),
            Self::I16 => of!(i16),
            Self::U32 => of!(u32),
            Self::I32 => of!(i32),
            Self::U64 => of!(u64),
            Self::I64 => of!(i64),
            Self::F32 => of!(f32),
            Self::F64 => of!(f64),
        }
    }

    /// Whether `f32` may have to round a value of this type.
    pub fn exceeds_f32(self) -> bool {
        matches!(self, Self::U32 | Self::I32 | Self::U64 | Self::I64 | Self::F64)
    }
}

impl fmt::Display for VoxelType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::U8 => "uint8",
            Self::I8 => "int8",
            Self::U16 => "uint16",
            Self::I16 => "int16",
            Self::U32 => "uint32",
            Self::I32 => "int32",
            Self::U64 => "uint64",
            Self::I64 => "int64",
            Self::F32 => "float32",
            Self::F64 => "float64",
        })
    }
}

impl FromStr for VoxelType {
    type Err = String;

    /// Reads a name as [`fmt::Display`] writes it.
    fn from_str(s: &str) -> Result<Self, String> {
        let of = |t: &(i16, Self)| t.1;
        Self::CODES
            .iter()
            .map(of)
            .find(|t| t.to_string() == s)
            .ok_or_else(|| {
                let names: Vec<_> = Self::CODES.iter().map(|t| of(t).to_string()).collect();
                format!("{s:?} is no type of voxels; write one of {}", names.join(", "))
            })
    }
}

/// How densities are stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StoreAs {
    /// As they are.
    Float32,
    /// As `round((density - intercept) / slope)`, held to the range of an integer type; the header says how to
    /// get densities back.
    Integer {
        /// Type of the voxels; not a float type.
        voxel: VoxelType,
        /// Density of one step, finite and not 0.
        slope: f64,
        /// Density of a stored 0.
        intercept: f64,
    },
}
