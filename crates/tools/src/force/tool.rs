use bspline::{HierarchicalSpline, Real};
use fitting::Control;
use glam::DVec3;

use super::stroke::{AT_FACE, INSTEAD};
use super::{Chisel, Drill, ForceError, ForceReport, ForceStroke, Holding, Pull};
use crate::paint::Layers;

/// A force tool with all that it is told.
#[derive(Clone, Copy, Debug)]
pub enum ForceTool<'a> {
    /// Brings the surface elsewhere.
    Pull(&'a Pull),
    /// Cuts a groove.
    Chisel(&'a Chisel),
    /// Lays a ridge.
    Squirt(&'a Chisel),
    /// Makes a hole or a cut.
    Drill(&'a Drill),
    /// Makes a bridge or a seam.
    Join(&'a Drill),
}

impl ForceTool<'_> {
    /// Names of all, as sessions write them.
    pub const NAMES: [&'static str; 5] = ["pull", "chisel", "squirt", "drill", "join"];

    /// Its name, as sessions write it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Pull(_) => "pull",
            Self::Chisel(_) => "chisel",
            Self::Squirt(_) => "squirt",
            Self::Drill(_) => "drill",
            Self::Join(_) => "join",
        }
    }

    /// Sets it on a field whose surface lies at `iso`.
    ///
    /// # Errors
    /// Any [`ForceError`].
    pub fn begin<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
    ) -> Result<ForceStroke<T>, ForceError> {
        match self {
            Self::Pull(tool) => tool.begin(field, iso),
            Self::Chisel(tool) => tool.begin(field, iso, false),
            Self::Squirt(tool) => tool.begin(field, iso, true),
            Self::Drill(tool) => tool.begin(field, iso, false),
            Self::Join(tool) => tool.begin(field, iso, true),
        }
    }

    /// Takes it in hand at a place: where it goes is told step by step, see [`ForceStroke::pose`].
    ///
    /// # Errors
    /// Any [`ForceError`].
    pub fn hold<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
        layers: &Layers,
        holding: &Holding,
        at: DVec3,
    ) -> Result<ForceStroke<T>, ForceError> {
        let stroke = match self {
            Self::Pull(tool) => tool.hold(field, iso),
            Self::Chisel(tool) => tool.hold(field, iso, false, at),
            Self::Squirt(tool) => tool.hold(field, iso, true, at),
            Self::Drill(tool) => tool.hold(field, iso, false, at),
            Self::Join(tool) => tool.hold(field, iso, true, at),
        };
        stroke?.painted(layers)?.held(holding)
    }

    /// What it leaves of the field with the matter that is painted on it and what is held, and what is left to say of it, in
    /// sentences.
    ///
    /// # Errors
    /// Any [`ForceError`].
    pub fn apply<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
        layers: &Layers,
        holding: &Holding,
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<T>, Vec<String>), ForceError> {
        let mut stroke = self.begin(field, iso)?.painted(layers)?.held(holding)?;
        while !stroke.is_over() {
            control
                .step("pulling", stroke.progress())
                .map_err(ForceError::Cancelled)?;
            stroke.step()?;
        }
        released(stroke)
    }
}

/// What a stroke leaves, and what is left to say of it, in sentences.
///
/// # Errors
/// Any [`ForceError`].
pub(crate) fn released<T: Real>(
    stroke: ForceStroke<T>,
) -> Result<(HierarchicalSpline<T>, Vec<String>), ForceError> {
    let (is_elastic, at_face, paths) = (stroke.is_elastic(), stroke.paths_at_face(), stroke.targets.len());
    let (field, report) = stroke.release()?;
    let mut notes = if is_elastic {
        Vec::new()
    } else {
        late_paths(&report)
    };
    if at_face > 0 {
        notes.push(format!(
            "{at_face} of {paths} paths begin or end {AT_FACE}; {INSTEAD}"
        ));
    }
    Ok((field, notes))
}

/// Says what did not arrive.
fn late_paths(report: &ForceReport) -> Vec<String> {
    let is_off = |share: f64| (share - 1.0).abs() > 0.02;
    let told = (is_off(report.arrival.least) || is_off(report.arrival.most)).then(|| {
        format!(
            "after {} steps the surface is at {:.1} to {:.1} % of its way; what is near holds it, or the rim of the field",
            report.steps,
            100.0 * report.arrival.least,
            100.0 * report.arrival.most,
        )
    });
    told.into_iter().collect()
}
