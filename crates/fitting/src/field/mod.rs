//! Any field written back into a box of a hierarchical spline: what a tool leaves becomes coefficients.
//!
//! No system is solved. On each level the rest `target - field`, sampled at the knots, is added by the quasi-interpolant
//! of the cubic B-spline, `c_i = (8 r_i - r_{i-1} - r_{i+1})/6` on each axis, which is exact for cubics \[Lyche75\]; done
//! twice it is next to interpolation. A function takes part where the rest at its knot or next to it exceeds the
//! tolerance near the surface, or where the two signs differ. So the cost is that of the box, on every level that of the
//! surface in it, and the field beside it costs nothing.

mod level;

use std::time::Instant;

use crate::{Control, FitError};
use bspline::hierarchical::{BrickDiff, EditError, MAX_LEVELS};
use bspline::{Aabb, Field, HierarchicalSpline, Real};
use level::LevelFit;

/// How close a field has to come to its target, where, and how fine it may become.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldFitOptions {
    /// What is asked for.
    pub aim: Aim,
    /// Finest level that may be used.
    pub finest: usize,
}

/// Where a target matters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// The surface: within three finest knot intervals of it the field may be off by `tolerance`, a world length, times
    /// `|∇t|`; elsewhere it has to have the right sign. The sheets of creases off the surface are not followed.
    Surface {
        /// Value of the field on the surface.
        iso: f64,
        /// World length, `> 0`.
        tolerance: f64,
    },
    /// The density: everywhere in the box it may be off by `tolerance`. Creases are followed down to the finest level.
    Density {
        /// In the unit of the field, `> 0`.
        tolerance: f64,
    },
}

/// What a fit did, and how close it came.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FieldFitReport {
    /// Levels that got functions, or other coefficients, coarsest first.
    pub levels: Vec<usize>,
    /// Functions that took part, over all levels.
    pub functions: usize,
    /// Points at which target and field were compared.
    pub samples: u64,
    /// Largest rest among the knots of the level beyond the finest used, where it matters: a world length, or a density.
    pub worst: f64,
    /// How many of those knots exceed the tolerance: at creases, or where the finest level does not suffice.
    pub over_tolerance: usize,
    /// Knots at which the signs differ further from the surface than the tolerance and one finest interval.
    pub wrong_signs: usize,
    /// Wall time.
    pub seconds: f64,
}

/// The field `onto` with `target` in the world box `within`, the difference that leads there, and a report.
///
/// Outside the box and one support of the finest level nothing changes, to the bit. The target has to agree with the
/// field at the faces of the box, within the tolerance: the box of a tool, with the reach of its blend.
///
/// # Errors
/// [`FitError::Cancelled`]; [`FitError::Option`] for a tolerance that is not above 0, a box without extent, or a level
/// that no field has; [`FitError::Degenerate`] where the target is not finite.
pub fn fit_field<T: Real>(
    target: &dyn Field,
    onto: &HierarchicalSpline<T>,
    within: &Aabb,
    options: &FieldFitOptions,
    control: &mut Control,
) -> Result<(HierarchicalSpline<T>, BrickDiff<T>, FieldFitReport), FitError> {
    let start = Instant::now();
    let local = within.transformed(onto.lattice_from_world());
    let extent = local.max - local.min;
    check(options, extent.min_element())?;
    let mut report = FieldFitReport::default();
    let mut field = onto.clone();
    let across = |level: &usize| extent.min_element() * (1u64 << *level) as f64 >= ACROSS;
    let first = (0..options.finest).find(across).unwrap_or(options.finest);
    let mut open = None;
    for level in first..=options.finest + 1 {
        control.step(
            "field",
            (level - first) as f64 / (options.finest + 2 - first) as f64,
        )?;
        let fit = LevelFit {
            target,
            field: &field,
            level,
            within: &local,
            options,
            is_first: open.is_none(),
        };
        let keys = match open {
            None => fit.all_bricks(),
            Some(parents) => fit.children(parents),
        };
        let mut round = fit.run(&keys)?;
        report.samples += round.samples;
        if level > options.finest {
            report.worst = round.worst;
            report.over_tolerance = round.over_tolerance;
            report.wrong_signs = round.wrong_signs;
            break;
        }
        if !round.edits.is_empty() {
            report.levels.push(level);
            report.functions += round.edits.iter().map(|e| e.add.count()).sum::<usize>();
            let once = field.added(&round.edits).map_err(not_added)?;
            let again = LevelFit { field: &once, ..fit };
            report.samples += again.correct(&mut round.edits);
            field = once.added(&round.edits).map_err(not_added)?;
        }
        open = Some(round.open);
    }
    let difference = onto.difference(&field).expect("versions of one field");
    report.seconds = start.elapsed().as_secs_f64();
    Ok((field, difference, report))
}

fn check(options: &FieldFitOptions, shortest: f64) -> Result<(), FitError> {
    let (Aim::Surface { tolerance, .. } | Aim::Density { tolerance }) = options.aim;
    let bad = |option, value, requirement| {
        Err(FitError::Option {
            option,
            value,
            requirement,
        })
    };
    if !(tolerance.is_finite() && tolerance > 0.0) {
        return bad("the tolerance", tolerance, "it has to be above 0");
    }
    if options.finest >= MAX_LEVELS {
        return bad("the finest level", options.finest as f64, "it can be 20 at most");
    }
    let intervals = shortest * (1u64 << options.finest) as f64;
    if !(intervals.is_finite() && intervals >= 1.0) {
        let requirement = "it has to hold at least one knot interval of the finest level";
        return bad("the shortest side of the box", intervals, requirement);
    }
    Ok(())
}

/// The functions are the lattice's own; what remains is a level too fine for it, or a target beyond all numbers.
fn not_added(error: EditError) -> FitError {
    FitError::Degenerate(format!("the field cannot take the target: {error}"))
}

/// Functions of the coarsest level used along the box's shortest side.
const ACROSS: f64 = 8.0;
