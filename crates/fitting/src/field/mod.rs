//! Any field written back into a box of a hierarchical spline: what a tool leaves becomes coefficients.
//!
//! No system is solved. On each level the rest `target - field`, sampled at the knots, is added by the quasi-interpolant
//! of the cubic B-spline, `c_i = (8 r_i - r_{i-1} - r_{i+1})/6` on each axis, which is exact for cubics \[Lyche75\]; done
//! twice it is next to interpolation. A function takes part where the rest at its knot or next to it exceeds the
//! tolerance near the surface, or where the two signs differ. So the cost is that of the box, on every level that of the
//! surface in it, and the field beside it costs nothing.

mod judge;
mod level;
mod masks;
mod prune;
mod refine;
mod region;
mod room;
mod sample;
mod slabs;
mod tiles;

use std::time::Instant;

use crate::{Control, FitError};
use bspline::hierarchical::{BrickDiff, EditError, MAX_LEVELS};
use bspline::{Aabb, Field, HierarchicalSpline, Real};
pub use judge::Left;
use level::LevelFit;
use prune::dead_functions;
use region::Region;
use tiles::in_pool;

/// How close a field has to come to its target, where, and how fine it may become.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldFitOptions {
    /// What is asked for.
    pub aim: Aim,
    /// Finest level that may be used.
    pub finest: usize,
    /// Whether the fit looks at the end at the middles of the finest cells that it changed, for as many samples more as
    /// there are, and reports what is left there.
    pub look: bool,
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
    /// Both: what [`Aim::Surface`] asks for, and that the field is nowhere off by more than `density`.
    SurfaceAndDensity {
        /// Value of the field on the surface.
        iso: f64,
        /// World length, `> 0`.
        tolerance: f64,
        /// In the unit of the field, `> 0`.
        density: f64,
    },
    /// The density: everywhere in the box it may be off by `tolerance`. Creases are followed down to the finest level.
    Density {
        /// In the unit of the field, `> 0`.
        tolerance: f64,
    },
}

/// What a fit did, and how close it came. There is no solver to tell of: the coefficients are a quasi-interpolant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FieldFitReport {
    /// Levels that got functions, or other coefficients, coarsest first.
    pub levels: Vec<usize>,
    /// Functions that took part, over all levels.
    pub functions: usize,
    /// Functions of the old surface that were taken out, as the new one is far from them.
    pub taken_out: usize,
    /// Points at which target and field were compared.
    pub samples: u64,
    /// What the look at the end found, if there was one.
    pub left: Option<Left>,
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
    fit_field_where(target, onto, within, options, &|_| true, control)
}

/// [`fit_field`] with those functions alone of whose supports, world boxes, `is_free` is true; all others keep their
/// coefficients to the bit. It has to be true of what lies within a box of which it is true.
///
/// # Errors
/// As [`fit_field`].
pub fn fit_field_where<T: Real>(
    target: &dyn Field,
    onto: &HierarchicalSpline<T>,
    within: &Aabb,
    options: &FieldFitOptions,
    is_free: &(dyn Fn(&Aabb) -> bool + Sync),
    control: &mut Control,
) -> Result<(HierarchicalSpline<T>, BrickDiff<T>, FieldFitReport), FitError> {
    let start = Instant::now();
    let local = within.transformed(onto.lattice_from_world());
    let extent = local.max - local.min;
    check(options, extent.min_element())?;
    let mut report = FieldFitReport::default();
    let mut field = onto.clone();
    let region = |level, is_between| Region {
        lattice: onto.lattice(),
        level,
        finest: options.finest,
        within: &local,
        is_between,
        is_free,
    };
    let detail = onto.finest_in(within);
    let is_resolved = |level: usize| level >= detail && level + 1 >= options.finest;
    let across = |level: &usize| extent.min_element() * (1u64 << *level) as f64 >= ACROSS;
    let first = (0..options.finest).find(across).unwrap_or(options.finest);
    let (mut open, mut edits) = (Vec::new(), Vec::new());
    for level in first..=options.finest {
        let done = (level - first) as f64 / (options.finest + 2 - first) as f64;
        control.step("writing back", done)?;
        let fit = LevelFit {
            target,
            field: &field,
            region: region(level, false),
            options,
            is_first: level == first,
            is_resolved: is_resolved(level),
            slab: SLAB,
        };
        let keys = if level == first { fit.all_tiles() } else { open };
        let round = in_pool(keys.len(), || fit.run(&keys))?;
        report.samples += round.samples;
        if !round.edits.is_empty() {
            report.levels.push(level);
            report.functions += round.edits.iter().map(|e| e.add.count()).sum::<usize>();
            let mut first = edits.len();
            edits.extend(round.edits);
            // The bits are the same from there. Of a large box the version before makes room for the next.
            if keys.len() > SLAB {
                (field, first) = (onto.clone(), 0);
            }
            field = field.added(&edits[first..]).map_err(not_added)?;
        }
        open = round.open;
    }
    if let Some((iso, _)) = options.aim.surface() {
        let most = options.aim.density().unwrap_or(f64::INFINITY);
        let dead = dead_functions(onto, &field, (iso, most), first, |level| region(level, false));
        let before = field.coefficient_count();
        field = field.edited_blocks(&dead).map_err(not_added)?;
        report.taken_out = before - field.coefficient_count();
    }
    if options.look {
        let fit = LevelFit {
            target,
            field: &field,
            region: region(options.finest, true),
            options,
            is_first: false,
            is_resolved: true,
            slab: SLAB,
        };
        let (left, samples) = in_pool(open.len(), || fit.look(&open))?;
        report.samples += samples;
        report.left = Some(left);
    }
    let difference = onto.difference(&field).expect("versions of one field");
    report.seconds = start.elapsed().as_secs_f64();
    Ok((field, difference, report))
}

impl Aim {
    /// Value on the surface and the length that it may be off by, if it counts.
    fn surface(&self) -> Option<(f64, f64)> {
        match *self {
            Self::Surface { iso, tolerance } | Self::SurfaceAndDensity { iso, tolerance, .. } => {
                Some((iso, tolerance))
            }
            Self::Density { .. } => None,
        }
    }

    /// What the field may be off by anywhere, if it counts.
    fn density(&self) -> Option<f64> {
        match *self {
            Self::Surface { .. } => None,
            Self::SurfaceAndDensity { density, .. } => Some(density),
            Self::Density { tolerance } => Some(tolerance),
        }
    }
}

fn check(options: &FieldFitOptions, shortest: f64) -> Result<(), FitError> {
    let bad = |option, value, requirement| {
        Err(FitError::Option {
            option,
            value,
            requirement,
        })
    };
    let lengths = options.aim.surface().map(|(_, tolerance)| tolerance);
    for tolerance in lengths.into_iter().chain(options.aim.density()) {
        if !(tolerance.is_finite() && tolerance > 0.0) {
            return bad("the tolerance", tolerance, "it has to be above 0");
        }
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

/// Tiles of a slab from which on the next one begins: some 12 KiB each while they are looked at.
const SLAB: usize = 1 << 14;

/// Functions of the coarsest level used along the box's shortest side.
const ACROSS: f64 = 8.0;
