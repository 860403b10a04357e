//! What differs between two versions of a spline on the same knots.

use super::spline::TensorSpline;
use crate::Real;

/// The least box of coefficients about all that differ, as they were and as they are.
#[derive(Clone, Debug, PartialEq)]
pub struct TensorDiff<T> {
    /// First coefficient on each axis.
    pub first: [u32; 3],
    /// Coefficients on each axis; none where nothing differs.
    pub count: [u32; 3],
    /// The old ones, last axis fastest.
    pub old: Vec<T>,
    /// The new ones.
    pub new: Vec<T>,
}

/// Why a difference does not lead anywhere from a spline.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TensorDiffError {
    /// The box is not in the spline, or does not hold as many coefficients as it says.
    #[error("the difference is of {count:?} coefficients from {first:?}, and the spline has {shape:?}")]
    Shape {
        /// First coefficient on each axis.
        first: [u32; 3],
        /// Coefficients on each axis.
        count: [u32; 3],
        /// Those of the spline.
        shape: [usize; 3],
    },
    /// The spline is not the one that the difference starts from.
    #[error("the difference starts from another version of the spline: {at:?} has another coefficient")]
    Version {
        /// Which coefficient.
        at: [usize; 3],
    },
    /// A coefficient is NaN or infinite.
    #[error("the difference has a coefficient {0}; coefficients have to be finite")]
    NotFinite(f64),
}

impl<T: Real> TensorDiff<T> {
    /// Whether nothing differs.
    pub fn is_empty(&self) -> bool {
        self.new.is_empty()
    }

    /// The way back.
    pub fn reversed(&self) -> Self {
        Self {
            old: self.new.clone(),
            new: self.old.clone(),
            ..*self
        }
    }
}

/// There are two zeros.
fn bits<T: Real>(value: T) -> u64 {
    value.as_f64().to_bits()
}

impl<T: Real> TensorSpline<T> {
    /// What leads from this version to another one on the same knots at the same place; none where they are not.
    pub fn difference(&self, new: &Self) -> Option<TensorDiff<T>> {
        let is_version = self.knots == new.knots
            && self.place.world_from_local == new.place.world_from_local
            && self.place.slope == new.place.slope;
        if !is_version {
            return None;
        }
        let [_, ny, nz] = self.shape();
        let (mut low, mut end) = ([u32::MAX; 3], [0u32; 3]);
        let both = self.coefficients.iter().zip(new.coefficients.iter());
        for (i, _) in both.enumerate().filter(|(_, (a, b))| bits(**a) != bits(**b)) {
            let at = [i / nz / ny, i / nz % ny, i % nz].map(|n| n as u32);
            low = std::array::from_fn(|a| low[a].min(at[a]));
            end = std::array::from_fn(|a| end[a].max(at[a] + 1));
        }
        if end[0] == 0 {
            low = [0; 3];
        }
        let count = std::array::from_fn(|a| end[a] - low[a]);
        let part = |of: &Self| of.indices_of(low, count).map(|i| of.coefficients[i]).collect();
        Some(TensorDiff {
            first: low,
            count,
            old: part(self),
            new: part(new),
        })
    }

    /// The version at the other end of a difference.
    ///
    /// # Errors
    /// Any [`TensorDiffError`].
    pub fn applied(&self, diff: &TensorDiff<T>) -> Result<Self, TensorDiffError> {
        let &TensorDiff { first, count, .. } = diff;
        let shape @ [_, ny, nz] = self.shape();
        let is_in = |a: usize| u64::from(first[a]) + u64::from(count[a]) <= shape[a] as u64;
        let needed = count.iter().try_fold(1usize, |n, m| n.checked_mul(*m as usize));
        if !(0..3).all(is_in) || needed != Some(diff.old.len()) || needed != Some(diff.new.len()) {
            return Err(TensorDiffError::Shape { first, count, shape });
        }
        let mut spline = self.clone();
        let mut coefficients = self.coefficients.to_vec();
        let pairs = diff.old.iter().zip(&diff.new);
        for (i, (old, new)) in self.indices_of(first, count).zip(pairs) {
            if bits(coefficients[i]) != bits(*old) {
                let at = [i / nz / ny, i / nz % ny, i % nz];
                return Err(TensorDiffError::Version { at });
            }
            if !new.is_finite() {
                return Err(TensorDiffError::NotFinite(new.as_f64()));
            }
            coefficients[i] = *new;
        }
        spline.coefficients = coefficients.into();
        Ok(spline)
    }

    /// Places in the array of a box of coefficients.
    fn indices_of(&self, first: [u32; 3], count: [u32; 3]) -> impl Iterator<Item = usize> + use<T> {
        let [_, ny, nz] = self.shape();
        let range = move |a: usize| first[a] as usize..first[a] as usize + count[a] as usize;
        range(0).flat_map(move |x| range(1).flat_map(move |y| range(2).map(move |z| (x * ny + y) * nz + z)))
    }
}
