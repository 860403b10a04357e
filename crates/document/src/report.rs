//! Reports of fits as they stand in field files.

use fitting::orient::Route;
use fitting::{FitReport, Leaf, SignReport, SolverOutcome, StopReason};
use formats::field::{FieldMeta, LeafRecord};
use serde::{Deserialize, Serialize};

/// The figures of a [`FitReport`]; leaves and notes have places of their own.
#[derive(Serialize, Deserialize)]
struct Figures {
    input_count: usize,
    used_count: usize,
    depth: usize,
    rms: f64,
    p95: f64,
    max: f64,
    bound: f64,
    noise: Option<f64>,
    tolerance: f64,
    smoothing: f64,
    /// [`FitReport::left_out`], each less the one before.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    left_out: Vec<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    signs: Option<Signs>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    solves: Vec<Solve>,
}

/// The figures of a [`SignReport`]; the confidences of the leaves have a place of their own.
#[derive(Serialize, Deserialize)]
struct Signs {
    route: String,
    outlier_count: usize,
    unsure_count: usize,
}

/// A [`SolverOutcome`], as files and JSON tell it.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Solve {
    /// Level, as `depth` counts them; none where all were solved jointly.
    pub level: Option<usize>,
    /// Iterations done.
    pub iterations: usize,
    /// Share of the starting residual that was left.
    pub residual: f64,
    /// Share asked for; none where the number of iterations is fixed.
    pub goal: Option<f64>,
    /// Whether what was asked for was reached.
    pub converged: bool,
}

impl From<&SolverOutcome> for Solve {
    fn from(s: &SolverOutcome) -> Self {
        Self {
            level: s.depth,
            iterations: s.iterations,
            residual: s.residual,
            goal: s.goal,
            converged: s.is_converged,
        }
    }
}

impl From<Solve> for SolverOutcome {
    fn from(s: Solve) -> Self {
        Self {
            depth: s.level,
            iterations: s.iterations,
            residual: s.residual,
            goal: s.goal,
            is_converged: s.converged,
        }
    }
}

/// What a file says of a fit with that many coefficients, or why it cannot be read.
pub fn read_report(meta: &FieldMeta, coefficients: usize) -> Result<FitReport, String> {
    let figures: Figures = serde_json::from_str(&meta.report)
        .map_err(|e| format!("its fit report cannot be read ({e}); fit the input again"))?;
    let leaves: Option<Vec<Leaf>> = meta.leaves.iter().map(leaf).collect();
    let left_out = figures.left_out.iter().scan(0u32, |at, step| {
        *at = at.saturating_add(*step);
        Some(*at)
    });
    Ok(FitReport {
        input_count: figures.input_count,
        used_count: figures.used_count,
        coefficients,
        depth: figures.depth,
        rms: figures.rms,
        p95: figures.p95,
        max: figures.max,
        bound: figures.bound,
        noise: figures.noise,
        tolerance: figures.tolerance,
        smoothing: figures.smoothing,
        left_out: left_out.collect(),
        signs: figures.signs.map(|s| signs(s, &meta.sign_confidence)),
        leaves: leaves
            .ok_or("a leaf stopped for a reason that this program does not know; use a newer isoclay")?,
        solves: figures.solves.into_iter().map(Into::into).collect(),
        notes: meta.notes.clone(),
    })
}

/// The same with the report of a fit.
pub fn with_report(meta: FieldMeta, report: &FitReport) -> FieldMeta {
    let confidence = report.signs.as_ref().map(|s| s.leaf_confidence.clone());
    FieldMeta {
        report: text(report),
        leaves: report.leaves.iter().map(record).collect(),
        sign_confidence: confidence.unwrap_or_default(),
        notes: report.notes.clone(),
        ..meta
    }
}

/// The figures as they stand in a file.
fn text(report: &FitReport) -> String {
    let before = [0].iter().chain(&report.left_out);
    let figures = Figures {
        input_count: report.input_count,
        used_count: report.used_count,
        depth: report.depth,
        rms: report.rms,
        p95: report.p95,
        max: report.max,
        bound: report.bound,
        noise: report.noise,
        tolerance: report.tolerance,
        smoothing: report.smoothing,
        left_out: report.left_out.iter().zip(before).map(|(i, b)| i - b).collect(),
        signs: report.signs.as_ref().map(|s| Signs {
            route: s.route.name().into(),
            outlier_count: s.outlier_count,
            unsure_count: s.unsure_count,
        }),
        solves: report.solves.iter().map(Solve::from).collect(),
    };
    serde_json::to_string(&figures).expect("a struct of plain fields is always JSON")
}

fn signs(figures: Signs, leaf_confidence: &[f32]) -> SignReport {
    let mut routes = Route::ALL.into_iter();
    SignReport {
        route: routes.find(|r| r.name() == figures.route).unwrap_or_default(),
        outlier_count: figures.outlier_count,
        unsure_count: figures.unsure_count,
        leaf_confidence: leaf_confidence.to_vec(),
    }
}

fn record(leaf: &Leaf) -> LeafRecord {
    LeafRecord {
        level: leaf.level,
        cell: leaf.cell,
        sample_count: leaf.sample_count,
        rms: leaf.rms,
        max: leaf.max,
        reason: leaf.reason as u8,
    }
}

/// A leaf of a file; none if it stopped for a reason that is not known here.
fn leaf(r: &LeafRecord) -> Option<Leaf> {
    use StopReason::*;
    let reason = [
        Tolerance, Depth, NoData, Noise, Budget, Memory, Neighbours, Crease, Smoothing, Thin,
    ]
    .into_iter()
    .find(|s| *s as u8 == r.reason)?;
    Some(Leaf {
        level: r.level,
        cell: r.cell,
        sample_count: r.sample_count,
        rms: r.rms,
        max: r.max,
        reason,
    })
}
