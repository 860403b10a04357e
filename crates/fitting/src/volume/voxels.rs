//! Voxels as the caller holds them: nothing is copied to be fitted.

use bspline::Real;

/// Which axis of a volume is fastest in memory. The fit does not depend on it, to the bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// Voxel `(x, y, z)` at `x + nx (y + ny z)`, as volume files have it.
    #[default]
    XFastest,
    /// Voxel `(x, y, z)` at `z + nz (y + ny x)`.
    ZFastest,
}

/// Densities of a volume, borrowed.
#[derive(Clone, Copy, Debug)]
pub enum Voxels<'a> {
    /// Floats.
    F32(&'a [f32], Order),
    /// Whole numbers, as scanners store them; fitted as floats of the same values would be, to the bit.
    I16(&'a [i16], Order),
}

impl<'a> From<&'a [f32]> for Voxels<'a> {
    fn from(values: &'a [f32]) -> Self {
        Self::F32(values, Order::XFastest)
    }
}

impl<'a> From<&'a Vec<f32>> for Voxels<'a> {
    fn from(values: &'a Vec<f32>) -> Self {
        values.as_slice().into()
    }
}

/// A number that a voxel may be stored as.
pub(crate) trait Number: Copy + Sync {
    /// The same number as a float.
    fn float(self) -> f32;
}

impl Number for f32 {
    #[inline(always)]
    fn float(self) -> f32 {
        self
    }
}

impl Number for i16 {
    #[inline(always)]
    fn float(self) -> f32 {
        f32::from(self)
    }
}

/// Asks the numbers of either type.
macro_rules! each {
    ($voxels:expr, $values:ident, $order:ident => $ask:expr) => {
        match $voxels {
            Voxels::F32($values, $order) => $ask,
            Voxels::I16($values, $order) => $ask,
        }
    };
}
pub(crate) use each;

impl Voxels<'_> {
    /// How many there are.
    pub fn len(&self) -> usize {
        each!(self, values, _order => values.len())
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Voxel `(x, y, z)` of a volume of `dims` voxels.
    ///
    /// # Panics
    /// If there is no such voxel.
    #[inline(always)]
    pub fn at(&self, dims: [usize; 3], [x, y, z]: [usize; 3]) -> f32 {
        let [nx, ny, nz] = dims;
        each!(self, values, order => values[match order {
            Order::XFastest => x + nx * (y + ny * z),
            Order::ZFastest => z + nz * (y + ny * x),
        }].float())
    }

    /// Voxels `(0.., y, z)` times `scale`.
    #[inline(always)]
    pub(crate) fn row<T: Real>(&self, dims: [usize; 3], y: usize, z: usize, scale: T, out: &mut [T]) {
        let [nx, ny, nz] = dims;
        each!(self, values, order => match order {
            Order::XFastest => {
                let start = (z * ny + y) * nx;
                for (o, &v) in out.iter_mut().zip(&values[start..start + nx]) {
                    *o = T::from_f64(f64::from(v.float())) * scale;
                }
            }
            Order::ZFastest => {
                for (o, &v) in out.iter_mut().zip(values[z + nz * y..].iter().step_by(nz * ny)) {
                    *o = T::from_f64(f64::from(v.float())) * scale;
                }
            }
        })
    }
}
