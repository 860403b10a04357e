//! Which matter a matrix, or what was made for it, is of.

/// What a matrix depends on, counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Version {
    /// Matter and constraints that were set.
    pub changes: u64,
    /// Matter that was painted since.
    pub paints: u64,
}

/// Key of the matrix that the solver was made for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Prepared {
    pub version: Version,
    pub damping: f64,
    pub stiffness: f64,
    /// Of the matrix.
    pub unit: f64,
    /// Residual of the first solve with it.
    pub residual: f64,
}
