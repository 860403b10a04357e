use std::collections::BTreeMap;
use std::sync::Arc;

use bspline::hierarchical::{BRICK, BrickKey, DenseCorrections, Lattice};
use bspline::primitives::Cuboid;
use bspline::{Csg, Field, HierarchicalSpline};
use fitting::Control;
use fitting::field::{Aim, FieldFitOptions, fit_field};
use glam::{DAffine3, DVec3};

use super::{GeometricError, TOLERANCE};

/// Cells of level 0 along the longest side of the box at most: it is filled whole.
const COARSEST: f64 = 48.0;

/// Room about a block, over its longest edge: what is added to it has to lie within.
pub(crate) const ROOM: f64 = 0.5;

/// Radius of a block's edges over its finest knot interval. Sharp edges ring: of four blocks their corners stood out by 0.08 to 0.19
/// intervals, with a radius of 1 by 0.01 to 0.08, with this by 0.01 to 0.04.
const EDGE: f64 = 1.5;

/// The same over the shortest edge, at most.
const MOST_EDGE: f64 = 0.25;

/// Shortest and longest length of a block: coefficients are in single precision, and so are squares of some lengths over others.
const LENGTHS: [f64; 2] = [1e-30, 1e30];

/// A block of clay to start from: a box about the origin with edges `size`, in knot intervals of `spacing`, both world lengths. Its
/// field is the distance to its faces, positive inside, with the edges rounded by one and a half knot intervals; the field's own box
/// leaves half the longest edge about it free.
///
/// # Errors
/// [`GeometricError::Shape`] if a length is not a positive number or beyond single precision, or the block is less than two or more than 2²⁰ intervals
/// wide; [`GeometricError::Fit`].
pub fn block(
    size: DVec3,
    spacing: f64,
    control: &mut Control,
) -> Result<HierarchicalSpline<f32>, GeometricError> {
    let wrong = |why: String| Err(GeometricError::Shape(why));
    check_lengths(size, spacing)?;
    let across = size / spacing;
    if across.min_element() < 2.0 || across.max_element() > f64::from(1 << 20) {
        return wrong(format!(
            "a block of {size} is {} to {} intervals of {spacing} wide; choose from 2 to 1048576",
            across.min_element(),
            across.max_element(),
        ));
    }
    let room = ROOM * size.max_element();
    let outer = size + 2.0 * room;
    let finest = (outer.max_element() / spacing / COARSEST).log2().ceil().max(0.0) as usize;
    let step = spacing * (1u64 << finest) as f64;
    let cells = (outer / step).ceil().max(DVec3::ONE);
    let solid = rounded(size, spacing)?;
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_scale_rotation_translation(
            DVec3::splat(step),
            glam::DQuat::IDENTITY,
            -0.5 * step * cells,
        ),
        cells: cells.to_array().map(|n| n as u32),
    };
    let coarse = HierarchicalSpline::schoenberg(lattice, 1.0, |p| solid.value(p))
        .map_err(|e| GeometricError::Shape(e.to_string()))?;
    let options = FieldFitOptions {
        aim: Aim::Surface {
            iso: 0.0,
            tolerance: TOLERANCE * spacing,
        },
        finest,
        look: false,
    };
    let (field, _, _) = fit_field(&solid, &coarse, &lattice.world_box(), &options, control)?;
    Ok((0..3).fold(field, |field, axis| evened(&field, axis)))
}

/// Refuses lengths that no block can have.
///
/// # Errors
/// [`GeometricError::Shape`], which names them.
pub(crate) fn check_lengths(size: DVec3, spacing: f64) -> Result<(), GeometricError> {
    let lengths = [size.x, size.y, size.z, spacing];
    if !lengths.iter().all(|length| length.is_finite() && *length > 0.0) {
        return Err(GeometricError::Shape(format!(
            "a block of {size} at {spacing} makes no sense; give lengths above 0"
        )));
    }
    let [least, most] = LENGTHS;
    match lengths.iter().find(|length| !(least..=most).contains(*length)) {
        Some(length) => Err(GeometricError::Shape(format!(
            "a length of {length:e} is beyond what single precision holds; choose from {least:e} to {most:e}"
        ))),
        None => Ok(()),
    }
}

/// The mean of a field and its mirror image about the middle of its box on an axis: even to the bit, where that of a fit to an even target
/// is even to rounding.
fn evened(field: &HierarchicalSpline<f32>, axis: usize) -> HierarchicalSpline<f32> {
    let lattice = *field.lattice();
    let even = |level: usize| {
        let last = lattice.cells_at(level)[axis] + 2;
        let mut bricks: BTreeMap<BrickKey, DenseCorrections<f32>> = BTreeMap::new();
        for (key, functions) in field.corrections(level) {
            for (slot, value) in functions.iter() {
                let at = [slot / BRICK / BRICK, slot / BRICK % BRICK, slot % BRICK];
                let own: [u32; 3] = std::array::from_fn(|a| key.0[a] * BRICK as u32 + at[a] as u32);
                let mut other = own;
                other[axis] = last - own[axis];
                for function in [own, other] {
                    let brick = bricks.entry(BrickKey::of(function));
                    let brick = brick.or_insert_with(DenseCorrections::empty);
                    let slot = function.map(|s| s as usize % BRICK);
                    let before = brick.values[(slot[0] * BRICK + slot[1]) * BRICK + slot[2]];
                    brick.set(slot, before + 0.5 * value);
                }
            }
        }
        let packed = bricks
            .into_iter()
            .map(|(key, brick)| (key, Arc::new(brick.pack())));
        packed.collect()
    };
    HierarchicalSpline::from_corrections(
        lattice,
        field.slope(),
        (0..field.level_count()).map(even).collect(),
    )
}

/// The distance to the faces of a box about the origin, with its edges rounded for knot intervals of `spacing`.
pub(crate) fn rounded(size: DVec3, spacing: f64) -> Result<Csg, GeometricError> {
    let edge = (EDGE * spacing).min(MOST_EDGE * size.min_element());
    let inner = Cuboid::new(DVec3::ZERO, 0.5 * size - edge).map_err(GeometricError::shape)?;
    Csg::sum(vec![(1.0, Arc::new(inner) as Arc<dyn Field>)], edge).map_err(GeometricError::shape)
}
