//! A volume fit from end to end.

use bspline::Real;
use bspline::hierarchical::{BRICK_LEN, HALO_LEN, HierarchicalSpline, Lattice, LevelCorrections};
use glam::{DAffine3, DVec3};

use super::active::ActiveSet;
use super::adaptive::Adaptive;
use super::assemble::{full_bricks, sparse_bricks};
use super::axis::Axis;
use super::domain::{Domain, Samples};
use super::interpolate::interpolating_coefficients;
use super::joint::Problem;
use super::measure::{Measured, measure};
use super::noise::noise_level;
use super::select::Cutoff;
use super::tolerance::Outcome;
use super::view::{Overview, VolumeMethod, VolumeOptions, VolumeView};
use crate::{Control, FitError, FitReport, Leaf, StopReason};

/// Levels of a fit unless few coefficients ask for more: knots every 4, 2 and 1 voxels.
const LEVELS: usize = 3;
/// The default tolerance for clean data, of the range between the 1st and 99th percentile.
const CLEAN_TOLERANCE: f64 = 0.005;
/// The default tolerance over the noise: the rms of 64 values of noise alone stays below it in 99.7 % of leaves.
const NOISE_TOLERANCE: f64 = 1.25;
/// Scores below this multiple of σ̂ may be noise. A score of white noise has the standard deviation
/// `√(2√3)³ · √(1/2)³ σ = 2.28 σ` (gain of the interpolation times norm of the function); 3.5 of these are passed by
/// one in two thousand.
const NOISE_SCORE: f64 = 8.0;

/// Fits a field to a volume.
///
/// Returns the field and what it says of its own error: residuals are of the stored coefficients, measured in
/// double precision at every voxel; leaves are the cells of 4³ voxels, x fastest. With neither tolerance
/// nor coefficients given, the tolerance is the larger of 1.25 σ̂ (σ̂ the noise, estimated) and 0.5 % of the range
/// between the 1st and 99th percentile.
///
/// The same input gives the same bits at any thread count.
///
/// # Errors
/// [`FitError::NotEnoughSamples`] and [`FitError::Degenerate`] for volumes that cannot be fitted,
/// [`FitError::Option`] for options out of range or at odds, [`FitError::MemoryLimit`], [`FitError::Cancelled`].
pub fn fit_volume<T: Real>(
    view: &VolumeView,
    options: &VolumeOptions,
    control: &mut Control,
) -> Result<(HierarchicalSpline<T>, FitReport), FitError> {
    options.check()?;
    control.step("looking at the volume", 0.0)?;
    let overview = view.check()?;
    let levels = level_count(view.dims, options)?;
    let samples = Samples {
        values: view.values,
        dims: view.dims,
        scale: T::from_f64(2.0_f64.powi(-exponent_of(&overview))),
    };
    reserve_fixed::<T>(view.dims, levels, options, control)?;
    let domain = Domain::<T>::new(view.dims, levels);
    match options.method {
        VolumeMethod::Interpolate => interpolate(view, &overview, &domain, &samples, control),
        VolumeMethod::Adaptive => adapt(view, &overview, &domain, &samples, options, control),
    }
}

fn interpolate<T: Real>(
    view: &VolumeView,
    overview: &Overview,
    domain: &Domain<T>,
    samples: &Samples<T>,
    control: &mut Control,
) -> Result<(HierarchicalSpline<T>, FitReport), FitError> {
    let finest = domain.finest();
    control.step("prefilter", 0.05)?;
    let dense = interpolating_coefficients(domain, samples);
    control.step("bricks", 0.4)?;
    let bricks = full_bricks(domain.functions(finest), &dense, T::one() / samples.scale);
    let mut active: Vec<ActiveSet> = (0..domain.levels())
        .map(|level| ActiveSet::empty(domain.functions(level)))
        .collect();
    active[finest] = ActiveSet::full(domain.functions(finest));
    let mut stored = vec![Vec::new(); finest];
    stored.push(dense);
    control.step("measuring", 0.6)?;
    let measured = measure(samples, domain, &active, &stored);
    let mut corrections = vec![LevelCorrections::new(); finest];
    corrections.push(bricks);
    let count = stored[finest].len();
    drop((active, stored));
    control.step("totals", 0.8)?;
    let spline = HierarchicalSpline::from_corrections(
        lattice(view, domain.axes[0].spacing(0)),
        view.edge_slope(overview),
        corrections,
    );
    let mut report = report(view, domain, &measured, samples.scale.as_f64(), |_| {
        StopReason::Tolerance
    });
    (report.coefficients, report.depth) = (count, finest);
    control.step("done", 1.0)?;
    Ok((spline, report))
}

fn adapt<T: Real>(
    view: &VolumeView,
    overview: &Overview,
    domain: &Domain<T>,
    samples: &Samples<T>,
    options: &VolumeOptions,
    control: &mut Control,
) -> Result<(HierarchicalSpline<T>, FitReport), FitError> {
    let scale = samples.scale.as_f64();
    let depth = options.max_depth.unwrap_or(domain.finest()).min(domain.finest());
    // Scores below this are rounding of the level before.
    let mut floor = 16.0 * T::UNIT_ROUND_OFF;
    let (budget, budget_reason) = budget(domain, options, control)?;
    let problem = Problem {
        domain,
        samples: *samples,
        ridge: options.smoothing.unwrap_or(0.0),
    };
    let mut goal = Goal {
        tolerance: options.tolerance.unwrap_or(0.0),
        noise: None,
        outcome: Outcome::Met,
    };
    let (active, coefficients, solves) = if overview.min == overview.max {
        let fit = super::joint::Fit::new(domain);
        let value = T::from_f64(f64::from(overview.min)) * samples.scale;
        let coefficients = fit.coefficients.iter().map(|l| vec![value; l.len()]).collect();
        (fit.active, coefficients, Vec::new())
    } else {
        let mut fit = Adaptive::new(problem, depth);
        if let (None, Some(_)) = (options.tolerance, options.coefficients) {
            fit.spend(budget, floor, control, (0.05, 0.85))?;
            goal.outcome = Outcome::BudgetSpent;
        } else {
            if options.tolerance.is_none() {
                control.step("estimating the noise", 0.02)?;
                let noise = fit.noise() / scale;
                goal.noise = Some(noise);
                goal.tolerance = (NOISE_TOLERANCE * noise).max(CLEAN_TOLERANCE * overview.range());
            }
            if let Some(noise) = goal.noise {
                floor = floor.max(NOISE_SCORE * noise * scale);
            }
            goal.outcome = fit.meet(goal.tolerance * scale, budget, floor, control)?;
        }
        (fit.fit.active, fit.fit.coefficients, fit.solves)
    };
    control.step("measuring", 0.9)?;
    let measured = measure(samples, domain, &active, &coefficients);
    control.step("bricks", 0.95)?;
    let unscale = T::one() / samples.scale;
    let corrections: Vec<LevelCorrections<T>> = active
        .iter()
        .zip(&coefficients)
        .map(|(a, c)| sparse_bricks(a, c, unscale))
        .collect();
    let used_depth = active.iter().rposition(|a| a.len() > 0).unwrap_or(0);
    let count = active.iter().map(ActiveSet::len).sum();
    drop((active, coefficients));
    let spline = HierarchicalSpline::from_corrections(
        lattice(view, domain.axes[0].spacing(0)),
        view.edge_slope(overview),
        trimmed(corrections, used_depth),
    );
    let clean = CLEAN_TOLERANCE * overview.range();
    let mut report = report(view, domain, &measured, scale, |rms| {
        let by_noise = goal.noise.is_some() && goal.tolerance > clean;
        match goal.outcome {
            _ if rms <= goal.tolerance && by_noise && rms > clean => StopReason::Noise,
            _ if rms <= goal.tolerance => StopReason::Tolerance,
            Outcome::BudgetSpent => budget_reason,
            Outcome::Smoothed => StopReason::Smoothing,
            _ => StopReason::Depth,
        }
    });
    report.coefficients = count;
    report.depth = used_depth;
    report.tolerance = goal.tolerance;
    report.noise = goal.noise;
    report.smoothing = problem.ridge;
    report.told_solves(solves);
    let missed = report
        .leaves
        .iter()
        .filter(|l| f64::from(l.rms) > goal.tolerance)
        .count();
    if goal.tolerance > 0.0 && missed > 0 {
        report.notes.push(format!(
            "{missed} of {} leaves stay above the tolerance of {:.6}",
            report.leaves.len(),
            goal.tolerance
        ));
    }
    control.step("done", 1.0)?;
    Ok((spline, report))
}

/// What an adaptive fit aimed at and how it ended, in the file's own density.
struct Goal {
    tolerance: f64,
    noise: Option<f64>,
    outcome: Outcome,
}

impl<T: Real> Adaptive<'_, T> {
    /// Standard deviation of the noise, estimated from what levels 0 and 1 leave; nothing stays changed.
    fn noise(&mut self) -> f64 {
        let (domain, samples) = (self.domain(), self.samples());
        self.grow(1, |_| Cutoff::above(0.0));
        let mut r = std::mem::take(&mut self.residual);
        let noise = noise_level(domain, &samples, &mut r);
        self.residual = r;
        self.restart();
        noise
    }
}

/// Leaves out empty levels at the fine end.
fn trimmed<T>(mut levels: Vec<LevelCorrections<T>>, depth: usize) -> Vec<LevelCorrections<T>> {
    levels.truncate(depth + 1);
    levels
}

/// Samples are divided by two to this power. A power of two changes no mantissa: only squares of huge and tiny densities
/// need it.
pub(crate) fn exponent_of(overview: &Overview) -> i32 {
    if overview.magnitude() > 0.0 {
        overview.magnitude().log2().floor() as i32 + 1
    } else {
        0
    }
}

/// The grids of a field whose coarsest has a knot every `spacing` voxels.
pub(crate) fn lattice(view: &VolumeView, spacing: usize) -> Lattice {
    Lattice {
        world_from_lattice: view.world_from_voxel * DAffine3::from_scale(DVec3::splat(spacing as f64)),
        cells: view.dims.map(|n| (n - 1).div_ceil(spacing).max(1) as u32),
    }
}

/// Levels that leave at least half of the coefficients for detail.
fn level_count(dims: [usize; 3], options: &VolumeOptions) -> Result<usize, FitError> {
    let base = |levels| {
        dims.map(|n| Axis::new(n, levels).functions(0))
            .iter()
            .product::<usize>()
    };
    let mut levels = LEVELS;
    if let Some(wanted) = options.coefficients {
        if wanted < 64 {
            return Err(FitError::Option {
                option: "coefficients",
                value: wanted as f64,
                requirement: "a volume takes at least 64: one cell of level 0",
            });
        }
        while 2 * base(levels) > wanted && dims.iter().any(|&n| n > (1 << (levels - 1)) + 1) {
            levels += 1;
        }
    }
    Ok(levels)
}

/// Bytes of one coefficient in the joint solve: five vectors, norms, index.
fn bytes_per_coefficient<T>() -> u64 {
    6 * size_of::<T>() as u64 + 8
}

/// Bytes of all bricks of a field whose levels are full.
fn brick_bytes<T>(dims: [usize; 3], levels: usize, depth: usize) -> u64 {
    let brick = (HALO_LEN + BRICK_LEN) as u64 * size_of::<T>() as u64 + 160;
    let count = |level| dims.map(|n| Axis::new(n, levels).functions(level).div_ceil(8) as u64);
    (0..=depth)
        .map(|level| count(level).iter().product::<u64>() * brick)
        .sum()
}

/// Refuses fits whose arrays over all voxels alone exceed the ceiling.
fn reserve_fixed<T>(
    dims: [usize; 3],
    levels: usize,
    options: &VolumeOptions,
    control: &Control,
) -> Result<(), FitError> {
    let bytes = size_of::<T>() as u64;
    let padded: u64 = dims
        .map(|n| Axis::new(n, levels).padded() as u64)
        .iter()
        .product();
    let depth = options.max_depth.unwrap_or(levels - 1).min(levels - 1);
    let bricks = brick_bytes::<T>(dims, levels, depth);
    control.reserve(match options.method {
        // Dense coefficients, their copy in double precision with indices and magnitudes, bricks.
        VolumeMethod::Interpolate => padded * (bytes + 8 + 4 + 4) + bricks,
        // Residual and scratch during the fit, scores of coarser levels; bricks and magnitudes after it.
        VolumeMethod::Adaptive => (padded * (3 * bytes)).max(padded * 4 + bricks),
    })
}

/// The number of functions allowed, and what a leaf says that wanted more.
fn budget<T: Real>(
    domain: &Domain<T>,
    options: &VolumeOptions,
    control: &Control,
) -> Result<(usize, StopReason), FitError> {
    let asked = options.coefficients.unwrap_or(usize::MAX);
    let Some(limit) = control.memory_limit else {
        return Ok((asked, StopReason::Budget));
    };
    let padded: u64 = domain.padded().map(|n| n as u64).iter().product();
    let fixed = padded * (3 * size_of::<T>() as u64);
    let base = domain.function_count(0) as u64;
    control.reserve(fixed + base * bytes_per_coefficient::<T>())?;
    let affordable = ((limit - fixed) / bytes_per_coefficient::<T>()) as usize;
    Ok(if affordable < asked {
        (affordable, StopReason::Memory)
    } else {
        (asked, StopReason::Budget)
    })
}

/// The report of what was measured; `reason` says why a leaf of given rms residual was left.
fn report<T: Real>(
    view: &VolumeView,
    domain: &Domain<T>,
    measured: &Measured,
    scale: f64,
    reason: impl Fn(f64) -> StopReason,
) -> FitReport {
    let grid = measured.grid;
    let [cx, cy, _] = grid.cells;
    let leaves = measured.leaves.iter().enumerate().map(|(i, leaf)| {
        let rms = leaf.rms() / scale;
        Leaf {
            level: grid.level as u8,
            cell: [i % cx, i / cx % cy, i / (cx * cy)].map(|c| c as u32),
            sample_count: leaf.count,
            rms: rms as f32,
            max: (f64::from(leaf.max) / scale) as f32,
            reason: reason(rms),
        }
    });
    let mut notes = Vec::new();
    if domain.samples() != domain.padded() {
        notes.push(format!(
            "the box of {} voxels is continued to {} by the edge values, to whole cells of {} voxels",
            domain.samples().map(|n| n.to_string()).join(" × "),
            domain.padded().map(|n| n.to_string()).join(" × "),
            domain.axes[0].spacing(0)
        ));
    }
    FitReport {
        input_count: view.values.len(),
        used_count: view.values.len(),
        rms: measured.rms / scale,
        p95: measured.p95 / scale,
        max: measured.max / scale,
        bound: measured.bound / scale,
        leaves: leaves.collect(),
        notes,
        ..FitReport::default()
    }
}
