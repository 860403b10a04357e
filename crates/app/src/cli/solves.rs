//! How the solver of a fit ended, as tables tell it.

use document::Solve;

use super::quantity::human_number;

/// One short row: how often was solved, with how many iterations, and what did not converge.
pub fn row(solves: &[Solve]) -> Option<String> {
    let last = solves.last()?;
    let iterations: usize = solves.iter().map(|s| s.iterations).sum();
    let asked = solves.iter().filter(|s| s.goal.is_some()).count();
    let missed = solves.iter().filter(|s| s.goal.is_some() && !s.converged);
    let levels: Vec<String> = missed
        .map(|s| s.level.map_or("all".into(), |l| l.to_string()))
        .collect();
    let end = match (asked, levels.as_slice()) {
        (0, _) => format!(
            "fixed numbers of them, {} of the residual left",
            human_number(last.residual)
        ),
        (_, []) => "converged".into(),
        (_, levels) => format!("not converged on level {}", levels.join(", ")),
    };
    let count = solves.len();
    Some(format!("{count} solves, {iterations} iterations: {end}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solve(level: usize, goal: Option<f64>, converged: bool) -> Solve {
        Solve {
            level: Some(level),
            iterations: 8,
            residual: 0.05,
            goal,
            converged,
        }
    }

    #[test]
    fn the_row_names_levels_that_missed_what_was_asked_for() {
        let few_on_purpose = solve(5, None, false);
        let told = |solves: &[Solve]| row(solves).expect("solves");
        assert_eq!(row(&[]), None);
        assert_eq!(
            told(&[few_on_purpose, solve(6, Some(0.03), true)]),
            "2 solves, 16 iterations: converged"
        );
        assert_eq!(
            told(&[
                few_on_purpose,
                solve(6, Some(0.03), false),
                solve(7, Some(0.03), false)
            ]),
            "3 solves, 24 iterations: not converged on level 6, 7"
        );
        assert_eq!(
            told(&[few_on_purpose]),
            "1 solves, 8 iterations: fixed numbers of them, 0.05000 of the residual left"
        );
    }
}
