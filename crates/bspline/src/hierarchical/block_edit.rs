//! What is done to a block of functions at once.

use super::Lattice;
use super::functions::{EditError, MAX_LEVELS, check_function};
use crate::{KnotVector, Real, TensorSpline};

/// What is done to a block of functions of one level.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockEdit<T> {
    /// Level of the functions, 0 the coarsest; may be finer than the field was so far.
    pub level: usize,
    /// Number of the block's first function on each axis.
    pub first: [u32; 3],
    /// Functions on each axis.
    pub shape: [usize; 3],
    /// What is done.
    pub change: Change<T>,
}

/// What an edit does to the corrections of its functions. Values stand in the order of the functions, z fastest.
#[derive(Clone, Debug, PartialEq)]
pub enum Change<T> {
    /// Adds to them; functions that were not active become so. Zeros insert knots without a change.
    Add(Vec<T>),
    /// Sets them; functions that were not active become so.
    Set(Vec<T>),
    /// Takes the functions out of the field; bricks that no function reaches any more go with them.
    Deactivate,
}

impl<T: Real> BlockEdit<T> {
    /// The edit that adds a patch to a field on `lattice`: a cubic one on uniform knots of one of its levels, placed as
    /// it is. Exact where all functions of the patch lie within it, so with zeros in its outer three layers.
    ///
    /// # Errors
    /// [`EditError::NotDyadic`]; [`EditError::Function`] if the patch reaches further than the lattice's functions.
    pub fn adding(patch: &TensorSpline<T>, lattice: &Lattice) -> Result<Self, EditError> {
        let not = |why| Err(EditError::NotDyadic { why });
        if patch.world_from_parameter() != &lattice.world_from_lattice {
            return not("it is placed by another map");
        }
        let axes = patch.knots();
        let spacing = axes[0].knots()[1] - axes[0].knots()[0];
        let level = (1.0 / spacing).log2().round();
        if !(0.0..=MAX_LEVELS as f64).contains(&level) {
            return not("they are further apart than those of level 0, or nearer than any");
        }
        let scale = level.exp2();
        let mut first = [0; 3];
        for (axis, first) in axes.iter().zip(&mut first) {
            if axis.degree() != 3 {
                return not("its degree is not 3 on every axis");
            }
            let places = axis.knots().iter().map(|knot| knot * scale);
            let start = axis.knots()[0] * scale;
            if places
                .enumerate()
                .any(|(i, place)| (place - start.round() - i as f64).abs() > 1e-9)
            {
                return not("they are not evenly spaced on those of one level");
            }
            // Function 0 is centred on the third knot; function `s` of a level on knot `s - 1`.
            match u32::try_from(start.round() as i64 + 3) {
                Ok(number) => *first = number,
                Err(_) => return not("it reaches further than the lattice's functions"),
            }
        }
        let edit = Self {
            level: level as usize,
            first,
            shape: axes.each_ref().map(KnotVector::coefficient_count),
            change: Change::Add(patch.coefficients().to_vec()),
        };
        check_function(lattice, edit.level, last_of(edit.first, edit.shape))?;
        Ok(edit)
    }
}

/// Last of the functions from `first` on.
pub(super) fn last_of(first: [u32; 3], count: [usize; 3]) -> [u32; 3] {
    std::array::from_fn(|a| {
        let last = first[a] as u64 + (count[a] as u64).saturating_sub(1);
        u32::try_from(last).unwrap_or(u32::MAX)
    })
}
