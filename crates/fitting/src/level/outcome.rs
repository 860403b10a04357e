//! How solves ended.

/// How an iterative solve of a fit ended.
///
/// Residuals are in the norm of the preconditioner, `√(r·M⁻¹r)`, as shares of the one that the solve began with (clouds,
/// the full levels: of the one of the zero field).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverOutcome {
    /// Level that was solved, counted like [`FitReport::depth`](crate::FitReport::depth); `None` where all levels were
    /// solved jointly.
    pub depth: Option<usize>,
    /// Iterations made.
    pub iterations: usize,
    /// Residual at the end.
    pub residual: f64,
    /// Residual asked for; `None` where a fixed number of iterations is made on purpose and no residual is asked.
    pub goal: Option<f64>,
    /// Whether the residual asked for was reached; without one, whether nothing but rounding was left.
    pub is_converged: bool,
}

/// A sentence on the levels that missed the residual asked for, if any did.
pub(crate) fn note(solves: &[SolverOutcome]) -> Option<String> {
    let missed: Vec<&SolverOutcome> = solves
        .iter()
        .filter(|s| s.goal.is_some() && !s.is_converged)
        .collect();
    let worst = missed.iter().max_by(|a, b| a.residual.total_cmp(&b.residual))?;
    let levels: Vec<String> = missed
        .iter()
        .map(|s| s.depth.map_or("all".into(), |d| d.to_string()))
        .collect();
    Some(format!(
        "the solver did not converge on level{} {}: it ended after {} iterations at most, with up to {:.2} of the residual \
         it began with left, where {:.2} were asked for; the errors told are those of what was found",
        if levels.len() == 1 { "" } else { "s" },
        levels.join(", "),
        missed.iter().map(|s| s.iterations).max().unwrap_or(0),
        worst.residual,
        worst.goal.unwrap_or(0.0),
    ))
}
