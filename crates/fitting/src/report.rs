use crate::level::SolverOutcome;
use crate::level::outcome::note;
use crate::orient::{Route, UNSURE};

/// Why a leaf was not split further.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum StopReason {
    /// The rms residual is below the tolerance.
    Tolerance = 0,
    /// The depth limit was reached with the residual still above the tolerance.
    Depth = 1,
    /// A child would hold too few samples, or none.
    NoData = 2,
    /// The spacing would fall below what the noise justifies.
    Noise = 3,
    /// The coefficient budget was spent.
    Budget = 4,
    /// The memory ceiling was reached.
    Memory = 5,
    /// The residual was below the tolerance when the cell was looked at, and has been moved above it by the
    /// refinement of cells beside it.
    Neighbours = 6,
    /// The surface has an edge there, which a smooth field can only round off: going on would cost more than it
    /// brings.
    Crease = 7,
    /// The smoothing that was asked for leaves more than the tolerance.
    Smoothing = 8,
    /// A part or a gap passes through that is too thin to be shown by the coefficients or the depth allowed; on the way
    /// there it would show in shreds.
    Thin = 9,
}

/// A dyadic cell that was not split, with its own error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leaf {
    /// Level of the cell.
    pub level: u8,
    /// Place of the cell on its level.
    pub cell: [u32; 3],
    /// Samples in the cell; 0 is the stored fact that there is no data here.
    pub sample_count: u32,
    /// Root of the mean square residual, in the tolerance's unit (clouds: world length; volumes: density).
    pub rms: f32,
    /// Largest absolute residual, same unit.
    pub max: f32,
    /// Why the cell was not split.
    pub reason: StopReason,
}

impl Leaf {
    /// Whether its rms residual is above `tolerance`.
    pub fn is_above(&self, tolerance: f64) -> bool {
        f64::from(self.rms) > tolerance
    }
}

/// How the normals of a cloud that had none were found.
#[derive(Clone, Debug, PartialEq)]
pub struct SignReport {
    /// How inside was told from outside.
    pub route: Route,
    /// Points that no surface passes through; they were left out.
    pub outlier_count: usize,
    /// Points whose sign is unsure.
    pub unsure_count: usize,
    /// Mean confidence in the sign, 0 to 1, of each leaf of [`FitReport::leaves`].
    pub leaf_confidence: Vec<f32>,
}

impl SignReport {
    /// Leaves whose sign is unsure.
    pub fn unsure_leaves(&self) -> usize {
        self.leaf_confidence.iter().filter(|c| **c < UNSURE).count()
    }
}

/// What a fit says of itself. Residuals are first measured by the fit; `isoclay check` measures them again.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitReport {
    /// Samples given.
    pub input_count: usize,
    /// Samples used (finite, with a usable normal, not merged).
    pub used_count: usize,
    /// Active functions.
    pub coefficients: usize,
    /// Finest level with an active function; level 0 is the coarsest.
    pub depth: usize,
    /// Root mean square residual (clouds: Newton distance; volumes: density).
    pub rms: f64,
    /// 95th percentile of the absolute residuals.
    pub p95: f64,
    /// Largest absolute residual.
    pub max: f64,
    /// Sound bound on `|f(x_k) - d_k|` over all samples: residual plus the rounding of its evaluation. Never below `max`.
    pub bound: f64,
    /// Estimated standard deviation of the noise, if any was found; same unit as `rms`.
    pub noise: Option<f64>,
    /// Tolerance aimed at, same unit.
    pub tolerance: f64,
    /// Smoothing weight used (see `docs/fitting.md`).
    pub smoothing: f64,
    /// Of the samples given those that no figure counts, by their numbers, ascending: unusable ones and outliers.
    pub left_out: Vec<u32>,
    /// Leaves in a fixed order.
    pub leaves: Vec<Leaf>,
    /// Of a cloud that came without normals.
    pub signs: Option<SignReport>,
    /// Iterative solves that the field rests on, in order: of a cloud the full levels and those of the last cascade, of a
    /// mesh the levels below the first, of a volume the joint solves between exchanges of functions. Empty where nothing is
    /// iterated (an interpolated volume).
    pub solves: Vec<SolverOutcome>,
    /// Repairs and doubts, each a sentence with its figures.
    pub notes: Vec<String>,
}

impl FitReport {
    /// Leaves that were not split for this reason.
    pub fn stopped_by(&self, reason: StopReason) -> usize {
        self.leaves.iter().filter(|l| l.reason == reason).count()
    }

    /// Takes the outcomes of the solves, and tells where one missed the residual asked for.
    pub(crate) fn told_solves(&mut self, solves: Vec<SolverOutcome>) {
        self.notes.extend(note(&solves));
        self.solves = solves;
    }
}
