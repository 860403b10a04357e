//! The one rule that turns data and options into depths and weights.

use std::collections::BTreeMap;

use super::samples::Samples;
use super::small_parts::SmallPart;
use super::{NormalForm, PointOptions};
use crate::StopReason;
use crate::level::band_problem::Weights;
use crate::level::{BASE_DEPTH, MAX_DEPTH};

/// How a cascade runs.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    /// Rms distance that ends the refinement of a cell, unit box.
    pub tolerance: f64,
    /// Deepest level.
    pub max_depth: usize,
    /// Whether every occupied cell is split down to `max_depth`, whatever its residual.
    pub uniform: bool,
    /// Largest number of active functions.
    pub coefficients: Option<usize>,
    /// `β` of the finest level, unit box.
    pub beta: f64,
    /// Mean spacing of clean samples, unit box: levels with finer cells ask for the gradient
    /// [between](super::between) the samples too.
    pub spacing: Option<f64>,
    /// `β` of a second fit to the feet of the points, where noise needs one.
    pub second_beta: Option<f64>,
    /// `μ` of a level.
    pub smoothing: Smoothing,
    /// CG stops at this relative residual ...
    pub residual: f64,
    /// ... or after this many iterations.
    pub iterations: usize,
    /// Whether cells with many samples are thinned on the way down.
    pub thin: bool,
    /// Why cells of the deepest level are not split.
    pub limited_by: StopReason,
    /// Whether points without weight are outliers, which no figure counts.
    pub robust: bool,
    /// What the samples ask for beside their values.
    pub form: NormalForm,
    /// Whether cells that an extremum near the surface may lie in are told.
    pub seeks_extrema: bool,
    /// Cells of the first grid whose samples only some level shows, and which.
    pub shown_from: BTreeMap<[u32; 3], usize>,
    /// Value targets in the place of 0, and no normals: for the trace of the smoother.
    pub probe: Option<Vec<f32>>,
}

/// Weight of the bending energy by level.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Smoothing {
    /// One weight on the way, one on the deepest level.
    Steps { coarse: f64, finest: f64 },
    /// `μ·2^(depth - max_depth)`.
    Halving(f64),
}

/// Deepest level of a clean cloud when the caller gives none, however dense it is.
const DEFAULT_DEPTH: usize = 10;
/// Largest number of coefficients of a clean cloud when the caller names neither it nor a tolerance or a depth: so many, or so
/// many a sample if that is more. The worst cells get them. Past it a dense scan with creases pays for
/// every bit of its surface with twice the time and the triangles, and its normals get worse: dragon of 371 k points,
/// 270 k coefficients, 2.4 u and 7.2°; as many as the tolerance asks for, 727 k, 1.2 u and 10.3° in three times the time.
const DEFAULT_COEFFICIENTS: usize = 270_000;
/// The same for each sample.
const DEFAULT_COEFFICIENTS_A_SAMPLE: f64 = 0.7;
/// Spacing of the coefficients, in spacings of the samples, below which samples have nothing to say. The weights of
/// the finest level belong to the level that the data end at: given to a deeper one, that hardly any cell reaches,
/// they left the leaves of a cloud of 1839 points 40 % less accurate.
const FINEST_SPACING: f64 = 0.3;

/// Cells, in spacings of the samples, below which conditions stand between the samples.
///
/// On levels with `h` between 1 and 1.5 spacings they made a fit that ends there worse: bunny at depth 7, normals 3.7° with
/// and 3.15° without, true surface 2.6 and 2.2 u.
const SPARSE: f64 = 1.0;
/// `β` of the samples themselves on such levels, in units of that on the others.
/// At 1/6 a cloud of 1839 points lost half its accuracy (p95 5.1 u; 3.3 u now, 2.6 u without conditions between) and one of
/// 34 834 at depth 8 a fifth; normals gain 0.05° from it.
const SPARSE_BETA: f64 = 0.1;
/// `μ` of the finest level where its cells are wide: the samples are close enough there.
const FINEST_MU: f64 = 1e-4;
/// The same times `(h/s)³` where they are narrow.
const NARROW_MU: f64 = 7e-5;
/// Weight of a condition between samples times `√(h/s)`.
const BETWEEN: f64 = 2.5;

/// Tolerance of a noisy cloud in standard deviations, when the caller gives none.
const NOISE_FACTOR: f64 = 1.25;

/// Least knot spacing of a noisy cloud in units of `√(σ̂s)`: what the samples of a cell leave of the noise when they
/// are averaged, `σ̂s/h`, is then at most `0.44 h`. On clouds of 0.25, 0.5 and 1 % noise one level deeper or shallower
/// is no better.
const NOISE_CELL: f64 = 1.5;
/// Least knot spacing of a noisy cloud in spacings of its samples. Where the noise is below a fifth of the spacing, most cells by
/// the rule above hold no sample: plates and hills with noise of 0.04 spacings took 320 000 coefficients, now 180 000, for what
/// 50 000 tell without noise.
const SPARSE_NOISE_CELL: f64 = 0.7;
/// Width of the band that noise fills, in standard deviations.
const NOISE_BAND: f64 = 3.0;
/// Standard deviation, in knot spacings, above which the points are moved to their feet.
const THICK: f64 = 0.25;

/// The last level whose knot spacing is at least `h` (unit box).
fn depth_of(h: f64) -> usize {
    ((1.0 / h).log2().floor() as usize).clamp(BASE_DEPTH + 1, MAX_DEPTH)
}

/// What a clean cloud may spend.
fn default_coefficients(samples: &Samples, options: &PointOptions) -> Option<usize> {
    let asks = options.tolerance.is_some() || options.max_depth.is_some();
    let by_samples = (DEFAULT_COEFFICIENTS_A_SAMPLE * samples.positions.len() as f64) as usize;
    options
        .coefficients
        .or_else(|| (!asks).then(|| by_samples.max(DEFAULT_COEFFICIENTS)))
}

impl Plan {
    /// Clean clouds: `β = 0.6 s` (`s` the mean spacing), refined by residual. Noisy ones: every occupied cell
    /// down to the last spacing of at least `1.5 √(σ̂s)` and `0.7 s`, a first fit with `β = σ̂/2` and a second on the
    /// [feet](super::feet) with `β = 0.3 s`, or the second alone where the noise is below a quarter of a cell; `μ`
    /// left to cross-validation, begun at `0.05 (h/s)²`, and a tolerance of `1.25 σ̂` unless one is given.
    ///
    /// `tolerance` and `noise` in the unit box.
    pub fn new(samples: &Samples, options: &PointOptions, tolerance: f64, noise: Option<f64>) -> Self {
        let spacing = samples.mean_spacing(0.0);
        let asked = options.max_depth;
        let max_depth = asked.unwrap_or(depth_of(FINEST_SPACING * spacing).min(DEFAULT_DEPTH));
        let finest_mu = (NARROW_MU * (spacing * (1u64 << max_depth) as f64).powi(3)).max(FINEST_MU);
        let clean = Self {
            tolerance,
            max_depth,
            uniform: false,
            coefficients: default_coefficients(samples, options),
            beta: 0.6 * spacing,
            spacing: Some(spacing),
            second_beta: None,
            smoothing: Smoothing::Steps {
                coarse: 1e-3,
                finest: options.smoothing.unwrap_or(finest_mu),
            },
            residual: 0.03,
            iterations: 8,
            thin: true,
            limited_by: StopReason::Depth,
            robust: options.robust,
            form: NormalForm::Gradient,
            seeks_extrema: false,
            shown_from: BTreeMap::new(),
            probe: None,
        };
        let Some(sigma) = noise else { return clean };
        let spacing = samples.mean_spacing(NOISE_BAND * sigma);
        let by_samples = SPARSE_NOISE_CELL * spacing;
        let justified = depth_of((NOISE_CELL * (sigma * spacing).sqrt()).max(by_samples));
        let max_depth = asked.unwrap_or(justified);
        let h = 0.5f64.powi(max_depth as i32);
        let is_thick = sigma > THICK * h;
        Self {
            tolerance: if options.tolerance.is_some() {
                tolerance
            } else {
                NOISE_FACTOR * sigma
            },
            max_depth,
            uniform: true,
            spacing: None,
            beta: if is_thick { 0.5 * sigma } else { 0.3 * spacing },
            smoothing: Smoothing::Halving(0.05 * (h / spacing).powi(2)),
            second_beta: is_thick.then_some(0.3 * spacing),
            residual: 0.01,
            iterations: 20,
            thin: false,
            coefficients: options.coefficients,
            limited_by: if asked.is_some() {
                StopReason::Depth
            } else {
                StopReason::Noise
            },
            ..clean
        }
    }

    /// Leaves the samples of small parts to the levels that show them.
    pub fn shows(&mut self, small: &[SmallPart]) {
        for part in small {
            let from = part.shown_from().min(self.max_depth);
            let cells = part.cells.iter().map(|cell| cell.map(|c| c as u32));
            self.shown_from.extend(cells.map(|cell| (cell, from)));
        }
    }

    /// Whether the cells of `depth` are too fine for the samples to stand for the surface between them.
    pub fn is_sparse(&self, depth: usize) -> bool {
        let h = 0.5f64.powi(depth as i32);
        self.form == NormalForm::Gradient && self.spacing.is_some_and(|s| h < SPARSE * s)
    }

    /// Weight of the gradient between the samples, where that at a sample has 1.
    pub fn between_weight(&self, depth: usize) -> f64 {
        BETWEEN * (self.spacing.unwrap_or(0.0) * (1u64 << depth) as f64).sqrt()
    }

    /// Weights of the energy on the level of `depth`. `β` is at least a quarter cell on levels that are refined
    /// again: it keeps the near far-field clean.
    pub fn weights(&self, depth: usize) -> Weights {
        let quarter = 0.25 * 0.5f64.powi(depth as i32);
        let own = if self.is_sparse(depth) {
            SPARSE_BETA * self.beta
        } else {
            self.beta
        };
        let beta = if depth == self.max_depth {
            own
        } else {
            own.max(quarter)
        };
        Weights {
            beta,
            mu: self.smoothing.at(depth, self.max_depth),
        }
    }
}

impl Smoothing {
    /// `μ` on the level of `depth`.
    pub fn at(self, depth: usize, max_depth: usize) -> f64 {
        match self {
            Self::Steps { coarse, finest } => {
                if depth == max_depth {
                    finest
                } else {
                    coarse
                }
            }
            Self::Halving(mu) => mu * 0.5f64.powi((max_depth - depth) as i32),
        }
    }
}
