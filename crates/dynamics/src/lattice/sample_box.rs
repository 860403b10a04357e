use bspline::Real;

use super::Lattice;

/// A box of the samples of a lattice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct SampleBox {
    /// First sample on each axis.
    pub first: [usize; 3],
    /// Samples on each axis; 0 of an empty box.
    pub count: [usize; 3],
}

impl SampleBox {
    /// All samples of `dims`.
    pub fn all(dims: [usize; 3]) -> Self {
        Self {
            first: [0; 3],
            count: dims,
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.count.iter().product()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether it lies in a lattice of `dims` samples.
    pub fn fits(&self, dims: [usize; 3]) -> bool {
        let end = |a: usize| self.first[a].checked_add(self.count[a]);
        (0..3).all(|a| end(a).is_some_and(|end| end <= dims[a]))
    }

    /// Whether a sample lies in it.
    pub fn contains(&self, at: [usize; 3]) -> bool {
        (0..3).all(|a| (self.first[a]..self.first[a] + self.count[a]).contains(&at[a]))
    }

    /// The box with `layers` more on all sides, as far as a lattice of `dims` samples reaches.
    pub fn grown(&self, layers: usize, dims: [usize; 3]) -> Self {
        let first = self.first.map(|f| f.saturating_sub(layers));
        let end = |a: usize| (self.first[a] + self.count[a] + layers).min(dims[a]);
        Self {
            first,
            count: std::array::from_fn(|a| end(a) - first[a]),
        }
    }

    /// The least box with this one and another.
    pub fn joined(&self, other: Self) -> Self {
        if self.is_empty() {
            return other;
        }
        if other.is_empty() {
            return *self;
        }
        let first: [usize; 3] = std::array::from_fn(|a| self.first[a].min(other.first[a]));
        let end = |a: usize| (self.first[a] + self.count[a]).max(other.first[a] + other.count[a]);
        Self {
            first,
            count: std::array::from_fn(|a| end(a) - first[a]),
        }
    }

    /// Numbers of its samples in a lattice of `dims` samples, z fastest.
    pub fn indices(&self, dims: [usize; 3]) -> impl Iterator<Item = usize> + use<> {
        let count = self.count[2];
        self.rows(dims).flat_map(move |row| row..row + count)
    }

    /// The same with their places along the axes.
    pub(crate) fn places(&self, dims: [usize; 3]) -> impl Iterator<Item = (usize, [usize; 3])> + use<> {
        let Self { first, count } = *self;
        self.rows(dims).enumerate().flat_map(move |(r, row)| {
            let (x, y) = (first[0] + r / count[1], first[1] + r % count[1]);
            (0..count[2]).map(move |k| (row + k, [x, y, first[2] + k]))
        })
    }

    /// The first number of each of its rows along z.
    pub(crate) fn rows(&self, dims: [usize; 3]) -> impl Iterator<Item = usize> + use<> {
        let Self { first, count } = *self;
        let rows = if count[2] > 0 { count[0] * count[1] } else { 0 };
        (0..rows).map(move |r| {
            let (x, y) = (first[0] + r / count[1], first[1] + r % count[1]);
            (x * dims[1] + y) * dims[2] + first[2]
        })
    }

    /// The numbers on it of a list of all samples.
    pub(crate) fn crop<V: Copy>(&self, from: &[V], dims: [usize; 3]) -> Vec<V> {
        let mut out = Vec::with_capacity(self.len());
        for row in self.rows(dims) {
            out.extend_from_slice(&from[row..row + self.count[2]]);
        }
        out
    }

    /// Writes the numbers on it into a list of all samples.
    pub(crate) fn paste<V: Copy>(&self, into: &mut [V], dims: [usize; 3], from: &[V]) {
        let count = self.count[2].max(1);
        for (row, from) in self.rows(dims).zip(from.chunks_exact(count)) {
            into[row..row + count].copy_from_slice(from);
        }
    }
}

/// Numbers on a box of samples; on all others they are 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnBox<'a, T> {
    /// Where.
    pub at: SampleBox,
    /// One per sample of the box, z fastest.
    pub values: &'a [T],
}

impl<T: Real> Lattice<T> {
    /// The box of all samples.
    pub fn all_samples(&self) -> SampleBox {
        SampleBox::all(self.sample_dims())
    }

    /// The least box with all samples within `radius` of a place, given in world lengths from the first sample along the
    /// axes. Costs nothing that grows with the lattice; empty where no sample is near or a number is not finite.
    pub fn samples_near(&self, at: [f64; 3], radius: f64) -> SampleBox {
        let mut near = SampleBox::default();
        for (a, axis) in self.axes().iter().enumerate() {
            let (h, last) = (axis.spacing(), (axis.sample_count() - 1) as f64);
            let low = ((at[a] - radius) / h).ceil().max(0.0);
            let high = ((at[a] + radius) / h).floor().min(last);
            if !at[a].is_finite() || radius.is_nan() || low > high {
                return SampleBox::default();
            }
            near.first[a] = low as usize;
            near.count[a] = (high - low) as usize + 1;
        }
        near
    }

    /// World lengths of a sample from the first one along the axes.
    pub fn sample_place(&self, ijk: [usize; 3]) -> [f64; 3] {
        std::array::from_fn(|a| ijk[a] as f64 * self.axes()[a].spacing())
    }
}
