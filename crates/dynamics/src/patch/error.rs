use crate::constraints::ConstraintError;
use crate::lattice::SampleBox;
use crate::matter::MatterError;
use crate::solve::SolveError;
use crate::sparse::MaskError;

/// Why a patch cannot be made or moved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PatchError {
    /// The matter is refused.
    #[error(transparent)]
    Matter(#[from] MatterError),
    /// The step cannot be solved.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// Constraints are refused.
    #[error(transparent)]
    Constraint(#[from] ConstraintError),
    /// A mask is refused.
    #[error(transparent)]
    Mask(#[from] MaskError),
    /// A list that does not fit the lattice.
    #[error("{found} {what} were given; the patch needs {needed}")]
    Length {
        /// Of what.
        what: &'static str,
        /// How many were given.
        found: usize,
        /// How many are needed.
        needed: usize,
    },
    /// A number that is not finite.
    #[error("{what} {index} is {value}; it has to be finite")]
    NotFinite {
        /// Which list.
        what: &'static str,
        /// Place in it.
        index: usize,
        /// The value.
        value: f64,
    },
    /// A length per density that is not positive and finite.
    #[error(
        "the scale of densities is {scale}; it has to be positive and finite (1 over the usual slope of the field at its \
         surface is a good one)"
    )]
    Scale {
        /// Length per density.
        scale: f64,
    },
    /// A step after which a number is not finite.
    #[error(
        "{what} {index} would become {value}: the motion leaves the range of {precision}; take back the forces or the \
         material that drive it, or use double precision"
    )]
    Overflow {
        /// Which list of the state.
        what: &'static str,
        /// Place in it.
        index: usize,
        /// The number.
        value: f64,
        /// Name of the precision.
        precision: &'static str,
    },
    /// A box that does not lie in the lattice.
    #[error(
        "the box of {:?} samples from {:?} on does not lie in the patch, which has {dims:?}; cut it at the last sample",
        at.count, at.first
    )]
    Box {
        /// The box.
        at: SampleBox,
        /// Samples of the patch.
        dims: [usize; 3],
    },
    /// A response asked for of a scheme that solves nothing with the springs.
    #[error("a step of {scheme} does not answer a force by its springs; ask for paper or tr-bdf2")]
    Explicit {
        /// Name of the scheme.
        scheme: &'static str,
    },
    /// A static problem that has no solution.
    #[error(
        "nothing holds the densities: under a lasting force they would drift for ever; fix the rim, or give the matter some \
         ground stiffness"
    )]
    Unheld,
    /// A static problem that is not solved.
    #[error(
        "the static solve leaves {residual:.1e} of the force; parts without any stiffness hang on nothing: give them some, or \
         take less contrast"
    )]
    Static {
        /// Residual relative to the force.
        residual: f64,
    },
    /// A place without samples.
    #[error(
        "no sample lies near {at:?} within the reach of {radius}; take a place in the patch, or a larger radius"
    )]
    Nowhere {
        /// Lengths along the axes from the first sample.
        at: [f64; 3],
        /// Radius asked for.
        radius: f64,
    },
    /// A snapshot that no patch can have made.
    #[error("the snapshot cannot be restored: {what}; take another one")]
    Snapshot {
        /// What is wrong with it.
        what: String,
    },
    /// Springs of other directions than those of the patch.
    #[error("springs along {found:?}; the patch needs {needed:?}, in this order")]
    Directions {
        /// Steps of the springs given.
        found: Vec<[isize; 3]>,
        /// Steps of the springs needed.
        needed: Vec<[isize; 3]>,
    },
    /// Options of adaptive steps that cannot be kept.
    #[error("adaptive steps: {what} is {value}; it has to be {needed}")]
    Adaptive {
        /// Which option.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        needed: String,
    },
    /// Springs across diagonals on a lattice that is not cubic.
    #[error(
        "the samples lie {spacing:?} apart; springs across diagonals need the same distance on all axes: \
         choose other sample counts, or six neighbours"
    )]
    NotCubic {
        /// Spacing along x, y and z.
        spacing: [f64; 3],
    },
    /// A rate of relaxation that is negative or not finite.
    #[error(
        "rest lengths cannot follow at a rate of {rate} per second; the rate has to be finite and 0 or above (0 keeps \
         the solid elastic)"
    )]
    Rate {
        /// The rate.
        rate: f64,
    },
    /// A weight that does not lie between 0 and 1.
    #[error(
        "the weight of sample {index} is {value}; it has to lie between 0 (keeps its rest) and 1 (follows fully)"
    )]
    Weight {
        /// Which sample.
        index: usize,
        /// Its weight.
        value: f64,
    },
    /// A time step that is not positive and finite.
    #[error("the time step is {dt} s; it has to be positive and finite")]
    TimeStep {
        /// The step in seconds.
        dt: f64,
    },
    /// An explicit step beyond its bound.
    #[error(
        "an explicit step of {dt:.3e} s is unstable beyond {limit:.3e} s; use shorter steps, or an implicit scheme such as \
         tr-bdf2"
    )]
    Unstable {
        /// The step asked for.
        dt: f64,
        /// The largest stable one.
        limit: f64,
    },
}
