//! Force tools: what is exact enough, and what it costs.

mod draw;
mod integrals;
mod loops;
mod strokes;
mod table2;

use ::tools::study::StudyError;
use serde::Serialize;

pub use ::tools::study::Sculpture;
pub use integrals::Quadrature;

/// A tool at work, or a part of one, and what it did.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ToolLine {
    /// Which tool, and on what.
    pub tool: String,
    /// Paths that act.
    pub paths: usize,
    /// Length of the paths over the radius of the tool.
    pub drag_over_r: Option<f64>,
    /// Samples per length over those that the tool takes by itself.
    pub sampling_factor: Option<f64>,
    /// What the solid does with its shape, and what makes the force as large as it is.
    pub law: String,
    /// Share of the way to which the surface came, of the place of the tool that was farthest off.
    pub arrival: Option<f64>,
    /// The most that a path was ahead of its end, as a share of its length.
    pub overshoot: Option<f64>,
    /// Steps until all paths were within a hundredth of their ends.
    pub steps_to_99: Option<usize>,
    /// Largest difference from the reference: of heights over the length of the paths, of an integral over the integral.
    pub profile_error: Option<f64>,
    /// Processor time of a loop (force, step, difference, local mesh), ms: the median.
    pub loop_ms: Option<f64>,
    /// The same of the slowest loop in a hundred.
    pub slow_loop_ms: Option<f64>,
    /// What \[Hua04\] prints for it.
    pub printed_ms: Option<f64>,
    /// What a user gets without options.
    pub default: bool,
    /// Where it is drawn.
    #[serde(skip)]
    place: Place,
}

/// Where a line is drawn.
#[derive(Clone, Debug, Default, PartialEq)]
enum Place {
    #[default]
    Nowhere,
    /// Error of the tip, or of the worst place of the tool, by a quantity.
    Sampling {
        error: f64,
    },
    Paths {
        error: f64,
    },
    /// Radius over the finest knot interval.
    Brush {
        intervals: f64,
        series: &'static str,
    },
    /// Samples that move.
    Loop {
        samples: usize,
        series: String,
    },
}

/// Why there is no chart.
#[derive(Debug, thiserror::Error)]
pub enum ToolsError {
    /// A stroke, or its loop.
    #[error(transparent)]
    Study(StudyError),
    /// The user said stop.
    #[error("cancelled")]
    Cancelled,
}

impl<E> From<E> for ToolsError
where
    StudyError: From<E>,
{
    fn from(error: E) -> Self {
        Self::Study(error.into())
    }
}

/// What a sweep runs with.
pub struct ToolRun<'a> {
    /// The smallest sizes only.
    pub quick: bool,
    /// Processor seconds of the process.
    pub clock: fn() -> f64,
    /// Told the share done; says whether to go on.
    pub go_on: &'a mut dyn FnMut(f64) -> bool,
    /// Given every line when it is there.
    pub show: &'a mut dyn FnMut(&ToolLine),
}

impl ToolRun<'_> {
    fn go_on(&mut self, fraction: f64) -> Result<(), ToolsError> {
        match (self.go_on)(fraction) {
            true => Ok(()),
            false => Err(ToolsError::Cancelled),
        }
    }
}

/// What was measured.
pub struct ToolCosts {
    lines: Vec<ToolLine>,
    quadratures: Vec<Quadrature>,
}

/// Integrals, strokes on a half-space, the rows of \[Hua04 table 2\], and loops on fitted fields.
///
/// # Errors
/// [`ToolsError`].
pub fn tool_costs(sculptures: &[Sculpture], run: &mut ToolRun) -> Result<ToolCosts, ToolsError> {
    let mut lines = Vec::new();
    let mut add = |line: ToolLine, run: &mut ToolRun| {
        (run.show)(&line);
        lines.push(line);
    };
    run.go_on(0.0)?;
    let quadratures = integrals::quadratures(run.clock);
    for q in &quadratures {
        add(q.line(), run);
    }
    strokes::samplings(run, &mut add)?;
    strokes::numbers_of_paths(run, &mut add)?;
    loops::brushes(run, &mut add)?;
    table2::rows(run, &mut add)?;
    for sculpture in sculptures {
        loops::on_sculpture(sculpture, run, &mut add)?;
    }
    Ok(ToolCosts { lines, quadratures })
}

/// Takes a line when it is there.
type Add<'a> = dyn FnMut(ToolLine, &mut ToolRun) + 'a;

/// Milliseconds of loops: the median, and the slowest in a hundred.
fn summary(mut seconds: Vec<f64>) -> (Option<f64>, Option<f64>) {
    seconds.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let place = (share * seconds.len() as f64) as usize;
        seconds
            .get(place.min(seconds.len().saturating_sub(1)))
            .map(|s| 1e3 * s)
    };
    (at(0.5), at(0.99))
}
