use bspline::{KnotVector, Real};

use super::axis::{Axis, LatticeError, Rim};
use super::banded::Banded;
use super::tensor::{TensorProduct, TensorWorkspace};

/// The sample lattice of a patch and the operators `d = A p`, `A = A_x ⊗ A_y ⊗ A_z`, applied axis by axis.
///
/// Arrays have the order `(x, y, z)` with `z` fastest. Coefficients are the free ones only, as changes: those that
/// are fixed do not move.
#[derive(Clone, Debug)]
pub struct Lattice<T> {
    axes: [Axis; 3],
    sampling: TensorProduct<T>,
    gathering: TensorProduct<T>,
}

impl<T: Real> Lattice<T> {
    /// The lattice of three axes.
    pub fn new(axes: [Axis; 3]) -> Self {
        let a: [Banded<T>; 3] = std::array::from_fn(|k| axes[k].collocation().map(T::from_f64));
        let t: [Banded<T>; 3] = std::array::from_fn(|k| a[k].transposed());
        Self {
            sampling: TensorProduct::new(a.each_ref()),
            gathering: TensorProduct::new(t.each_ref()),
            axes,
        }
    }

    /// A cube of clamped uniform cubic splines: `coefficients` an axis (rim included), `samples` an axis at the
    /// distance `spacing`.
    ///
    /// # Errors
    /// Any [`LatticeError`].
    pub fn cube(coefficients: usize, samples: usize, rim: Rim, spacing: f64) -> Result<Self, LatticeError> {
        let length = spacing * samples.saturating_sub(1) as f64;
        let axis = |a: usize| {
            let knots = KnotVector::clamped_uniform(3, coefficients.saturating_sub(3), 0.0, 1.0)?;
            Axis::new(a, knots, rim, samples, length)
        };
        Ok(Self::new([axis(0)?, axis(1)?, axis(2)?]))
    }

    /// The axes.
    pub fn axes(&self) -> &[Axis; 3] {
        &self.axes
    }

    /// Free coefficients along each axis.
    pub fn coefficient_dims(&self) -> [usize; 3] {
        self.sampling.input_dims()
    }

    /// Samples along each axis.
    pub fn sample_dims(&self) -> [usize; 3] {
        self.sampling.output_dims()
    }

    /// Number of free coefficients.
    pub fn coefficient_count(&self) -> usize {
        self.coefficient_dims().iter().product()
    }

    /// Number of samples.
    pub fn sample_count(&self) -> usize {
        self.sample_dims().iter().product()
    }

    /// Whether there are as many free coefficients as samples on every axis.
    pub fn is_square(&self) -> bool {
        self.coefficient_dims() == self.sample_dims()
    }

    /// Distance of the samples along each axis, in world units.
    pub fn spacing(&self) -> [f64; 3] {
        std::array::from_fn(|a| self.axes[a].spacing())
    }

    /// Volume that belongs to one sample.
    pub fn sample_volume(&self) -> f64 {
        self.spacing().iter().product()
    }

    /// Densities at the samples, `d = A p`. Allocates only when `w` has not seen this size.
    ///
    /// # Panics
    /// If a length is wrong.
    pub fn sample(&self, p: &[T], d: &mut [T], w: &mut TensorWorkspace<T>) {
        self.sampling.apply(p, d, w);
    }

    /// Forces on the coefficients of forces on the samples, `b = Aᵀ g`. Allocates only when `w` has not seen this
    /// size.
    ///
    /// # Panics
    /// If a length is wrong.
    pub fn gather(&self, g: &[T], b: &mut [T], w: &mut TensorWorkspace<T>) {
        self.gathering.apply(g, b, w);
    }

    /// The lattice with the same samples and about half the knots on each axis that has knots to spare; `None` if
    /// none has.
    pub fn half(&self) -> Option<Self> {
        let halves = self.axes.each_ref().map(Axis::half);
        if halves.iter().all(Option::is_none) {
            return None;
        }
        let [x, y, z] = halves;
        let [a, b, c] = &self.axes;
        Some(Self::new([
            x.unwrap_or_else(|| a.clone()),
            y.unwrap_or_else(|| b.clone()),
            z.unwrap_or_else(|| c.clone()),
        ]))
    }

    /// The coefficients here of a spline on [`half`](Self::half) the knots, and the transposed map.
    pub(crate) fn prolongation(&self, half: &Self) -> [TensorProduct<T>; 2] {
        let p: [Banded<T>; 3] =
            std::array::from_fn(|k| self.axes[k].prolongation(&half.axes[k]).map(T::from_f64));
        let t: [Banded<T>; 3] = std::array::from_fn(|k| p[k].transposed());
        [TensorProduct::new(p.each_ref()), TensorProduct::new(t.each_ref())]
    }

    /// Solves `A p = d`, in double precision, on a square lattice.
    ///
    /// # Panics
    /// If the lattice is not square.
    pub(crate) fn inverse(&self) -> TensorProduct<f64> {
        TensorProduct::new(self.axis_inverses().each_ref())
    }

    /// Solves `Aᵀ g = b`, in double precision, on a square lattice.
    ///
    /// # Panics
    /// If the lattice is not square.
    pub(crate) fn inverse_transposed(&self) -> TensorProduct<f64> {
        TensorProduct::new(self.axis_inverses().map(|a| a.transposed()).each_ref())
    }

    fn axis_inverses(&self) -> [Banded<f64>; 3] {
        assert!(self.is_square(), "as many coefficients as samples");
        std::array::from_fn(|k| {
            let a = self.axes[k].collocation().to_dense();
            let a = a
                .try_inverse()
                .expect("axes are refused when their collocation is singular");
            let row = |i: usize| (0..a.ncols()).map(|j| (j, a[(i, j)])).collect::<Vec<_>>();
            Banded::from_rows(a.ncols(), (0..a.nrows()).map(row))
        })
    }
}
