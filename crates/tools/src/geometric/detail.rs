//! Knots put in where a field is to become finer, and taken out where it need not be so fine.

use bspline::hierarchical::{BRICK, BlockEdit, Change, MAX_LEVELS};
use bspline::{Aabb, Field, HierarchicalSpline, Real};
use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::GeometricError;
use super::band::band;
use crate::coefficients::{Functions, support, with_functions};
use crate::limits::Limits;
use crate::number::{Point, Positive};

/// Most functions that one stroke puts in.
const MOST: u64 = 1 << 24;

/// Makes a field finer about the brush's way; no value changes but by rounding.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Refine {
    /// The brush's way.
    pub along: Vec<Point>,
    /// How far it reaches.
    pub radius: Positive,
    /// Levels finer than the finest of the field; 1 if missing.
    #[serde(default = "one")]
    pub finer: u8,
}

/// Takes out functions that matter less than a tolerance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Simplify {
    /// The brush's way.
    pub along: Vec<Point>,
    /// How far it reaches.
    pub radius: Positive,
    /// By how much the surface may move, a world length.
    pub tolerance: Positive,
}

fn one() -> u8 {
    1
}

impl Refine {
    /// The field with functions of coefficient 0 within the radius.
    ///
    /// # Errors
    /// Any [`GeometricError`].
    pub fn apply<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        limits: &Limits,
    ) -> Result<HierarchicalSpline<T>, GeometricError> {
        let level = field.level_count() - 1 + usize::from(self.finer);
        if self.finer == 0 || level >= MAX_LEVELS {
            return Err(GeometricError::Shape(format!(
                "finer is {}; write 1 to {}",
                self.finer,
                MAX_LEVELS - field.level_count()
            )));
        }
        let (weight, reach) = band(&self.along, self.radius.0)?;
        let local = reach.transformed(field.lattice_from_world());
        let scale = (1u64 << level) as f64;
        let last = field.lattice().cells_at(level).map(|n| f64::from(n) + 2.0);
        let last = DVec3::from_array(last);
        // Function `s` is centred on knot `s - 1`.
        let first = (local.min * scale + 1.0).ceil().max(DVec3::ZERO);
        let end = (local.max * scale + 1.0).floor().min(last);
        let count = end - first + 1.0;
        if count.min_element() < 1.0 {
            let whole = field.lattice().world_box();
            let corners = |b: &Aabb| [b.min.to_array(), b.max.to_array()];
            return Err(GeometricError::Outside {
                tool: corners(&reach),
                field: corners(&whole),
            });
        }
        if count.element_product() > MOST as f64 {
            return Err(GeometricError::Shape(format!(
                "the brush holds {} functions of that fineness, and {MOST} may be put in at once; make it smaller",
                count.element_product()
            )));
        }
        let [x, y, z] = first.to_array().map(|n| n as u32);
        let [nx, ny, nz] = count.to_array().map(|n| n as u32);
        let mut edits = Vec::new();
        for x in x..x + nx {
            for y in y..y + ny {
                for z in z..z + nz {
                    let (knot, support) = support(field, level, [x, y, z]);
                    if weight.value(knot) > 0.0 && limits.may_change(&support) {
                        edits.push(BlockEdit {
                            level,
                            first: [x, y, z],
                            shape: [1; 3],
                            change: Change::Add(vec![T::zero()]),
                        });
                    }
                }
            }
        }
        field.edited_blocks(&edits).map_err(GeometricError::shape)
    }
}

impl Simplify {
    /// The field without what matters less than the tolerance within the radius.
    ///
    /// # Errors
    /// Any [`GeometricError`].
    pub fn apply<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        limits: &Limits,
    ) -> Result<HierarchicalSpline<T>, GeometricError> {
        let (_, reach) = band(&self.along, self.radius.0)?;
        simplified(field, &reach, self.tolerance.0, limits)
    }
}

/// The field without those functions, in a box, of levels above the coarsest that together change its values by less than half of
/// `tolerance` times its slope.
///
/// B-splines of a level are positive and sum up to 1 at most, so those of one level that are all below a bound change no value by more
/// than that.
pub(super) fn simplified<T: Real>(
    field: &HierarchicalSpline<T>,
    within: &Aabb,
    tolerance: f64,
    limits: &Limits,
) -> Result<HierarchicalSpline<T>, GeometricError> {
    let finest = field.level_count() - 1;
    let bound = 0.5 * tolerance * field.slope() / finest.max(1) as f64;
    let mut gone = Functions::new();
    for level in 1..=finest {
        for (key, functions) in field.corrections(level) {
            for (slot, _) in functions.iter().filter(|(_, c)| c.as_f64().abs() < bound) {
                let at = [slot / BRICK / BRICK, slot / BRICK % BRICK, slot % BRICK];
                let function = std::array::from_fn(|a| key.0[a] * BRICK as u32 + at[a] as u32);
                let (_, b) = support(field, level, function);
                let is_within = b.min.cmpge(within.min).all() && b.max.cmple(within.max).all();
                if is_within && limits.may_change(&b) {
                    gone.insert((level, function), None);
                }
            }
        }
    }
    with_functions(field, &gone).map_err(GeometricError::shape)
}
