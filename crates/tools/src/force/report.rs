/// How far the paths of a stroke have come, as shares of their lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// The one that lags most.
    pub least: f64,
    /// The one that leads.
    pub most: f64,
}

/// What a step of a stroke did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Told {
    /// Of the paths that act.
    pub arrival: Arrival,
    /// Paths that act.
    pub acting: usize,
    /// Sum of their forces: what is felt, from the reference point towards the cursor.
    pub force: f64,
    /// Solves that it took.
    pub solves: usize,
    /// What the paths are short of after the solve, over what they were short of before.
    pub residual: f64,
}

/// What a stroke did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceReport {
    /// Paths.
    pub paths: usize,
    /// Steps.
    pub steps: usize,
    /// Solves of all steps.
    pub solves: usize,
    /// Of all paths, at the end.
    pub arrival: Arrival,
    /// The most that any path was ahead of its end, as a share of its length.
    pub overshoot: f64,
    /// Steps until all paths were within a hundredth of their ends, if they came there.
    pub steps_to_99: Option<usize>,
    /// Largest sum of the forces.
    pub force: f64,
    /// Samples of the region.
    pub samples: usize,
    /// Times that the region was cut.
    pub cuts: usize,
}
