//! Regions whose knots lie farther apart along some axes than the cells of their level.

use std::borrow::Cow;

use bspline::Real;
use bspline::hierarchical::BRICK;

use super::{Cells, MIN_CELLS, Region, RegionError};

/// Refuses strides that are no powers of two up to the edge of a brick, those that leave a rest of the cells, and those of which too few
/// knot intervals become.
pub(super) fn check(cells: &Cells, stride: [u32; 3]) -> Result<(), RegionError> {
    for (axis, (stride, count)) in stride.into_iter().zip(cells.count).enumerate() {
        let is_one = stride.is_power_of_two() && stride <= BRICK as u32;
        if !is_one || count % stride != 0 || count / stride < MIN_CELLS {
            return Err(RegionError::Stride { axis, stride, count });
        }
    }
    Ok(())
}

impl<T: Real> Region<T> {
    /// Knot intervals on each axis.
    pub(super) fn intervals(&self) -> [u32; 3] {
        std::array::from_fn(|a| self.cells.count[a] / self.stride[a])
    }

    /// The change of the coefficients on the knots of the cells: nothing is approximated.
    pub(super) fn on_cells(&self) -> Cow<'_, [T]> {
        let mut dims = self.patch.lattice().coefficient_dims();
        let mut p = Cow::Borrowed(&self.patch.state().p[..]);
        for (axis, stride) in self.stride.into_iter().enumerate() {
            for _ in 0..stride.ilog2() {
                p = Cow::Owned(with_knots_between(&p, &mut dims, axis));
            }
        }
        p
    }
}

/// Coefficients with a knot inserted in the middle of every interval of an axis, by the two-scale relation of the uniform cubic B-spline:
/// `N(x) = ⅛ Σ (1, 4, 6, 4, 1)ₖ N(2x − k)`.
fn with_knots_between<T: Real>(p: &[T], dims: &mut [usize; 3], axis: usize) -> Vec<T> {
    let weights = [0.125, 0.5, 0.75, 0.5, 0.125].map(T::from_f64);
    let row: usize = dims[axis + 1..].iter().product();
    let (coarse, fine) = (dims[axis], 2 * dims[axis] + 3);
    let mut out = vec![T::zero(); p.len() / coarse * fine];
    for (from, to) in p.chunks(coarse * row).zip(out.chunks_mut(fine * row)) {
        for (s, from) in from.chunks(row).enumerate() {
            for (k, weight) in weights.into_iter().enumerate() {
                let to = &mut to[(2 * s + k) * row..][..row];
                to.iter_mut().zip(from).for_each(|(to, p)| *to += weight * *p);
            }
        }
    }
    dims[axis] = fine;
    out
}
