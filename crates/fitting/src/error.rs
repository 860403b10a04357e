/// Why a fit gave no field.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// The cancel flag was raised.
    #[error("cancelled")]
    Cancelled,
    /// The work would hold more memory than allowed.
    #[error(
        "the fit needs about {needed} bytes, the ceiling is {limit}; raise the memory ceiling or lower the depth limit"
    )]
    MemoryLimit {
        /// Bytes the work would hold at once.
        needed: u64,
        /// Ceiling given by the caller.
        limit: u64,
    },
    /// There is too little to fit.
    #[error("{found} usable samples, at least {needed} are needed")]
    NotEnoughSamples {
        /// Usable samples found.
        found: usize,
        /// Samples needed.
        needed: usize,
    },
    /// The input cannot stand for a solid; the sentence says why and what would help.
    #[error("{0}")]
    Degenerate(String),
    /// An option is out of range.
    #[error("{option} is {value}, but {requirement}")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// Value given.
        value: f64,
        /// What it has to be.
        requirement: &'static str,
    },
}
