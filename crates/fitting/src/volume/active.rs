//! The active functions of one level, and vectors over them.

use std::ops::Range;

use bspline::Real;

/// Active functions of a level: for each row along x, in order of y then z, their indices along x, rising.
///
/// A vector over the active functions is a plain slice in that order ("packed"), so that iterative solves touch
/// nothing that is not active.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ActiveSet {
    size: [usize; 3],
    row_start: Vec<usize>,
    x: Vec<u32>,
}

/// One packed vector per level.
pub(crate) type Packed<T> = Vec<Vec<T>>;

impl ActiveSet {
    /// Every function of a level of `size` functions.
    pub fn full(size: [usize; 3]) -> Self {
        let [nx, ny, nz] = size;
        let x = (0..ny * nz).flat_map(|_| 0..nx as u32).collect();
        Self {
            size,
            row_start: (0..=ny * nz).map(|r| r * nx).collect(),
            x,
        }
    }

    /// No function.
    pub fn empty(size: [usize; 3]) -> Self {
        Self {
            size,
            row_start: vec![0; size[1] * size[2] + 1],
            x: Vec::new(),
        }
    }

    /// The functions whose dense index (x fastest) is listed in `indices`, which rises strictly.
    pub fn from_indices(size: [usize; 3], indices: impl Iterator<Item = usize>) -> Self {
        let mut set = Self {
            size,
            row_start: Vec::with_capacity(size[1] * size[2] + 1),
            x: Vec::new(),
        };
        set.row_start.push(0);
        for index in indices {
            let row = index / size[0];
            while set.row_start.len() <= row {
                set.row_start.push(set.x.len());
            }
            set.x.push((index % size[0]) as u32);
        }
        set.row_start.resize(size[1] * size[2] + 1, set.x.len());
        set
    }

    /// Number of active functions.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Functions of the level along each axis, active or not.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Packed range of row `y` of plane `z`.
    #[inline(always)]
    pub fn row(&self, y: usize, z: usize) -> Range<usize> {
        let r = z * self.size[1] + y;
        self.row_start[r]..self.row_start[r + 1]
    }

    /// Packed range of planes `z`.
    pub fn planes(&self, z: Range<usize>) -> Range<usize> {
        self.row_start[z.start * self.size[1]]..self.row_start[z.end * self.size[1]]
    }

    /// Indices along x of the functions in a packed range.
    #[inline(always)]
    pub fn x(&self, packed: Range<usize>) -> &[u32] {
        &self.x[packed]
    }

    /// Dense indices (x fastest) in packed order.
    pub fn indices(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.size[1] * self.size[2]).flat_map(move |r| {
            self.x[self.row_start[r]..self.row_start[r + 1]]
                .iter()
                .map(move |&x| r * self.size[0] + x as usize)
        })
    }

    /// Adds a packed vector to a dense one.
    pub fn scatter_add<T: Real>(&self, packed: &[T], dense: &mut [T]) {
        for (i, &v) in self.indices().zip(packed) {
            dense[i] += v;
        }
    }

    /// The packed part of a dense vector.
    pub fn gather<T: Real>(&self, dense: &[T]) -> Vec<T> {
        self.indices().map(|i| dense[i]).collect()
    }

    /// Splits a packed vector where planes `0, step, 2 step, ...` begin.
    pub fn split_planes_mut<'a, T>(&self, mut packed: &'a mut [T], step: usize) -> Vec<&'a mut [T]> {
        let mut pieces = Vec::new();
        for z in (0..self.size[2]).step_by(step) {
            let (piece, rest) = packed.split_at_mut(self.planes(z..(z + step).min(self.size[2])).len());
            pieces.push(piece);
            packed = rest;
        }
        pieces
    }

    /// Moves a packed vector from this set to `to`: kept functions keep their value, new ones get zero.
    pub fn transport<T: Real>(&self, packed: &[T], to: &Self) -> Vec<T> {
        let mut from = self.indices().zip(packed).peekable();
        to.indices()
            .map(|i| {
                while from.next_if(|&(j, _)| j < i).is_some() {}
                from.next_if(|&(j, _)| j == i).map_or(T::zero(), |(_, &v)| v)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_survive_packing() {
        let size = [3, 4, 5];
        let picked = [0, 2, 3, 11, 12, 35, 59];
        let set = ActiveSet::from_indices(size, picked.iter().copied());
        assert_eq!(set.indices().collect::<Vec<_>>(), picked);
        assert_eq!(set.row(3, 0), 3..4);
        assert_eq!(set.planes(1..3), 4..6);
        assert_eq!(ActiveSet::full(size).len(), 60);
        assert_eq!(
            ActiveSet::from_indices(size, std::iter::empty()),
            ActiveSet::empty(size)
        );
        let mut dense = vec![0.0; 60];
        set.scatter_add(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0], &mut dense);
        assert_eq!(set.gather(&dense), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    }

    #[test]
    fn transport_keeps_common_functions() {
        let size = [4, 1, 1];
        let (a, b) = ([0, 1, 3], [1, 2, 3]);
        let from = ActiveSet::from_indices(size, a.into_iter());
        let to = ActiveSet::from_indices(size, b.into_iter());
        assert_eq!(from.transport(&[5.0, 6.0, 7.0], &to), [6.0, 0.0, 7.0]);
    }
}
