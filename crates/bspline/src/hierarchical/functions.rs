//! Which functions there are.

use super::Lattice;
use super::brick::{BRICK, BrickKey, Corrections};
use crate::Real;

/// Most levels that an edit may lead to.
pub const MAX_LEVELS: usize = 21;
/// Most cells of a level on an axis.
const MAX_CELLS: u64 = 1 << 30;

/// Why coefficients cannot be changed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EditError {
    /// Too deep.
    #[error("level {level} is deeper than {max}, the deepest that this lattice can have")]
    Level {
        /// Level asked for.
        level: usize,
        /// Deepest possible one.
        max: usize,
    },
    /// No such function.
    #[error("level {level} has {count:?} functions; there is none with the number {function:?}")]
    Function {
        /// Level asked for.
        level: usize,
        /// Function asked for.
        function: [u32; 3],
        /// Functions on each axis.
        count: [u32; 3],
    },
    /// The coefficient would be NaN or infinite.
    #[error("function {function:?} of level {level} would get the coefficient {value}; it has to be finite")]
    NotFinite {
        /// Level of the function.
        level: usize,
        /// Number of the function.
        function: [u32; 3],
        /// What it would be.
        value: f64,
    },
    /// A patch does not stand on the functions of a level.
    #[error("the patch's knots are none of the lattice's: {why}")]
    NotDyadic {
        /// What is different.
        why: &'static str,
    },
    /// A block's values do not fit its shape.
    #[error("a block of {shape:?} functions takes as many values; there are {found}")]
    Length {
        /// Functions on each axis.
        shape: [usize; 3],
        /// Values given.
        found: usize,
    },
}

/// Whether a lattice has the functions of a level up to number `function`.
pub(super) fn check_function(lattice: &Lattice, level: usize, function: [u32; 3]) -> Result<(), EditError> {
    let most = u64::from(lattice.cells.into_iter().max().expect("three axes"));
    let max = (0..MAX_LEVELS)
        .rev()
        .find(|l| most << l <= MAX_CELLS)
        .unwrap_or(0);
    if level > max {
        return Err(EditError::Level { level, max });
    }
    let count = lattice.cells_at(level).map(|n| n + 3);
    if (0..3).any(|a| function[a] >= count[a]) {
        return Err(EditError::Function {
            level,
            function,
            count,
        });
    }
    Ok(())
}

/// Whether a lattice has the functions of a brick, and their coefficients are numbers.
pub(super) fn check_functions<T: Real>(
    lattice: &Lattice,
    level: usize,
    key: BrickKey,
    functions: &Corrections<T>,
) -> Result<(), EditError> {
    let function = |slot: usize| -> [u32; 3] {
        let at = [slot / BRICK / BRICK, slot / BRICK % BRICK, slot % BRICK];
        std::array::from_fn(|a| key.0[a].saturating_mul(BRICK as u32).saturating_add(at[a] as u32))
    };
    if let Some((slot, value)) = functions.unfit() {
        return Err(EditError::NotFinite {
            level,
            function: function(slot),
            value: value.as_f64(),
        });
    }
    let Some(x) = functions.mask().iter().rposition(|word| *word != 0) else {
        return Ok(());
    };
    // The last row and the last place in one: of all planes, and of all rows, laid on each other.
    let plane = functions.mask().iter().fold(0, |all, word| all | word);
    let row = plane.to_le_bytes().into_iter().fold(0, |all, row| all | row);
    let [y, z] = [plane.ilog2() as usize / BRICK, row.ilog2() as usize];
    check_function(lattice, level, function((x * BRICK + y) * BRICK + z))
}
