//! Trees of fields: Boolean operations, affine placement, weighted sums.
//!
//! With `f > c` inside, union is the larger value and intersection the smaller [Hua04 eq. 4, `Ω`]; the hierarchy
//! of patches is a sum of affine nodes [Hua04 eq. 3]. These results are sharp: along a crease the gradient jumps; the
//! smooth operations round it ([`Rounding`]). Every
//! node passes blocks of grid nodes and batches of points on to its branches, so that theirs are as fast as
//! alone, and leaves out those branches that their bounds prove irrelevant. Leaving out never changes a bit.
//!
//! ```
//! use std::sync::Arc;
//! use bspline::primitives::{Cuboid, Cylinder};
//! use bspline::{Csg, Field};
//! use glam::{DAffine3, DVec3};
//!
//! let block = Arc::new(Cuboid::new(DVec3::ZERO, DVec3::new(2.0, 1.0, 1.0))?);
//! let drill = Arc::new(Cylinder::new(DVec3::NEG_Z, DVec3::Z, 0.5)?);
//! let drill = Csg::affine(drill, DAffine3::from_scale(DVec3::new(1.0, 1.0, 2.0)))?;
//! let drilled = Csg::difference(block, vec![Arc::new(drill)], 0.0)?;
//! assert!(drilled.value(DVec3::ZERO) < 0.0 && drilled.value(DVec3::X) > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod affine;
mod blend;
mod boolean;
mod grown;
mod sum;

pub use affine::Affine;
pub use blend::{Blend, Rounding};
pub use boolean::{Boolean, Operation};
pub use grown::Grown;
pub use sum::Sum;

use std::any::Any;
use std::sync::Arc;

use glam::{DAffine3, DVec3};

use crate::{Aabb, Field, Frame, Interval, Jet};

/// Why a node cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CsgError {
    /// A Boolean operation of nothing.
    #[error("a Boolean operation needs at least one solid")]
    NoBranches,
    /// A number is NaN or infinite.
    #[error("{name} is {value}; it has to be finite")]
    NotFinite {
        /// Name of the parameter.
        name: &'static str,
        /// Value given.
        value: f64,
    },
    /// A number that makes no sense for what it stands for.
    #[error("{name} is {value}; it has to be {allowed}")]
    OutOfRange {
        /// Name of the parameter.
        name: &'static str,
        /// Value given.
        value: f64,
        /// What is possible.
        allowed: &'static str,
    },
    /// A map that flattens space.
    #[error("the map flattens space (relative determinant {determinant:e}) and cannot be inverted")]
    NotInvertible {
        /// Determinant over the product of the lengths of the three columns.
        determinant: f64,
    },
}

/// A node of a tree; its branches are fields of any kind, shared.
#[derive(Clone)]
pub enum Csg {
    /// Union, intersection or difference, sharp.
    Boolean(Boolean),
    /// Union or intersection with its crease rounded.
    Blend(Blend),
    /// A field moved, turned, stretched or mirrored.
    Affine(Affine),
    /// A weighted sum and a constant.
    Sum(Sum),
    /// A field grown by a length.
    Grown(Grown),
}

impl Csg {
    /// What is inside any of the solids: `max_i f_i`.
    ///
    /// # Errors
    /// [`CsgError::NoBranches`].
    pub fn union(solids: Vec<Arc<dyn Field>>) -> Result<Self, CsgError> {
        Boolean::new(Operation::Union, solids).map(Self::Boolean)
    }

    /// What is inside all of the solids: `min_i f_i`.
    ///
    /// # Errors
    /// [`CsgError::NoBranches`].
    pub fn intersection(solids: Vec<Arc<dyn Field>>) -> Result<Self, CsgError> {
        Boolean::new(Operation::Intersection, solids).map(Self::Boolean)
    }

    /// What is inside `solid` but in none of `taken`, at iso-value `iso`: `min(f, 2·iso - g_i)`.
    ///
    /// # Errors
    /// [`CsgError::NotFinite`].
    pub fn difference(solid: Arc<dyn Field>, taken: Vec<Arc<dyn Field>>, iso: f64) -> Result<Self, CsgError> {
        Boolean::difference(solid, taken, iso).map(Self::Boolean)
    }

    /// The union with its creases rounded, `iso` the iso-value of the surfaces; several solids two by two in their order.
    ///
    /// # Errors
    /// [`CsgError::NoBranches`], [`CsgError::NotFinite`], [`CsgError::OutOfRange`].
    pub fn smooth_union(
        solids: Vec<Arc<dyn Field>>,
        rounding: Rounding,
        iso: f64,
    ) -> Result<Arc<dyn Field>, CsgError> {
        blended(Operation::Union, solids, rounding, iso)
    }

    /// The intersection with its creases rounded; see [`Self::smooth_union`].
    ///
    /// # Errors
    /// [`CsgError::NoBranches`], [`CsgError::NotFinite`], [`CsgError::OutOfRange`].
    pub fn smooth_intersection(
        solids: Vec<Arc<dyn Field>>,
        rounding: Rounding,
        iso: f64,
    ) -> Result<Arc<dyn Field>, CsgError> {
        blended(Operation::Intersection, solids, rounding, iso)
    }

    /// `solid` without `taken`, with the creases rounded: the smooth intersection with their complements.
    ///
    /// # Errors
    /// [`CsgError::NotFinite`], [`CsgError::OutOfRange`].
    pub fn smooth_difference(
        solid: Arc<dyn Field>,
        taken: Vec<Arc<dyn Field>>,
        rounding: Rounding,
        iso: f64,
    ) -> Result<Arc<dyn Field>, CsgError> {
        let mut solids = vec![solid];
        for field in taken {
            solids.push(Arc::new(Self::complement(field, iso)?));
        }
        blended(Operation::Intersection, solids, rounding, iso)
    }

    /// `field` grown by the world length `by`, to first order: `f + by·|∇f|`; shrunk if `by` is negative.
    ///
    /// # Errors
    /// [`CsgError::NotFinite`].
    pub fn grown(field: Arc<dyn Field>, by: f64) -> Result<Self, CsgError> {
        Grown::new(field, by).map(Self::Grown)
    }

    /// `field` carried by `world_from_local`; values stay as they are.
    ///
    /// # Errors
    /// [`CsgError::NotFinite`], [`CsgError::NotInvertible`].
    pub fn affine(field: Arc<dyn Field>, world_from_local: DAffine3) -> Result<Self, CsgError> {
        Affine::new(field, world_from_local).map(Self::Affine)
    }

    /// `constant + Σ_i w_i f_i`.
    ///
    /// # Errors
    /// [`CsgError::NotFinite`].
    pub fn sum(terms: Vec<(f64, Arc<dyn Field>)>, constant: f64) -> Result<Self, CsgError> {
        Sum::new(terms, constant).map(Self::Sum)
    }

    /// `field + by`, in the unit of the field: for a distance, the solid grown by `by` (a true offset outside convex
    /// parts). [`Self::grown`] takes a length for any field.
    ///
    /// # Errors
    /// [`CsgError::NotFinite`].
    pub fn offset(field: Arc<dyn Field>, by: f64) -> Result<Self, CsgError> {
        Self::sum(vec![(1.0, field)], by)
    }

    /// What is outside the solid at iso-value `iso`: `2·iso - f`.
    ///
    /// # Errors
    /// [`CsgError::NotFinite`].
    pub fn complement(field: Arc<dyn Field>, iso: f64) -> Result<Self, CsgError> {
        Self::sum(vec![(-1.0, field)], 2.0 * iso)
    }

    fn node(&self) -> &dyn Field {
        match self {
            Self::Boolean(node) => node,
            Self::Affine(node) => node,
            Self::Sum(node) => node,
            Self::Blend(node) => node,
            Self::Grown(node) => node,
        }
    }
}

impl Field for Csg {
    fn value(&self, p: DVec3) -> f64 {
        self.node().value(p)
    }
    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        self.node().value_gradient(p)
    }
    fn jet(&self, p: DVec3) -> Jet {
        self.node().jet(p)
    }
    fn bounds(&self, b: &Aabb) -> Interval {
        self.node().bounds(b)
    }
    fn gradient_bounds(&self, b: &Aabb) -> [Interval; 3] {
        self.node().gradient_bounds(b)
    }
    fn hessian_bound(&self, b: &Aabb) -> f64 {
        self.node().hessian_bound(b)
    }
    fn bounds_along(&self, from: DVec3, to: DVec3) -> Interval {
        self.node().bounds_along(from, to)
    }
    fn changed_boxes(&self, before: &dyn Field, within: &Aabb) -> Vec<Aabb> {
        self.node().changed_boxes(before, within)
    }
    fn as_any(&self) -> Option<&dyn Any> {
        self.node().as_any()
    }
    fn jets(&self, points: &[DVec3], out: &mut [Jet]) {
        self.node().jets(points, out);
    }
    fn values_gradients(&self, points: &[DVec3], out: &mut [(f64, DVec3)]) {
        self.node().values_gradients(points, out);
    }
    fn frame_values(&self, frame: &Frame, lo: [i64; 3], count: [usize; 3], out: &mut [f64]) {
        self.node().frame_values(frame, lo, count, out);
    }
    fn frame_values_from(
        &self,
        known: &dyn Field,
        values: &[f64],
        frame: &Frame,
        lo: [i64; 3],
        count: [usize; 3],
        out: &mut [f64],
    ) -> bool {
        self.node()
            .frame_values_from(known, values, frame, lo, count, out)
    }
    fn frame_bounds(&self, frame: &Frame, lo: [i64; 3], hi: [i64; 3]) -> Interval {
        self.node().frame_bounds(frame, lo, hi)
    }
    fn frame_bounds_about(&self, frame: &Frame, lo: [i64; 3], hi: [i64; 3], level: f64) -> Interval {
        self.node().frame_bounds_about(frame, lo, hi, level)
    }
}

/// World boxes outside which no branch has changed. `pairs` gives each branch with what stood in its place before; none
/// if the nodes differ in more than their branches.
fn changed_branches<'a>(
    pairs: Option<impl Iterator<Item = (&'a Arc<dyn Field>, &'a Arc<dyn Field>)>>,
    within: &Aabb,
) -> Vec<Aabb> {
    let Some(pairs) = pairs else {
        return vec![*within];
    };
    let changed = pairs.filter(|(now, before)| !Arc::ptr_eq(now, before));
    changed
        .flat_map(|(now, before)| now.changed_boxes(before.as_ref(), within))
        .collect()
}

/// `before` as a node of the kind `N`.
fn node_of<N: 'static>(before: &dyn Field) -> Option<&N> {
    before.as_any()?.downcast_ref()
}

/// Two fields at a time, from the first on.
fn blended(
    operation: Operation,
    solids: Vec<Arc<dyn Field>>,
    rounding: Rounding,
    iso: f64,
) -> Result<Arc<dyn Field>, CsgError> {
    let mut solids = solids.into_iter();
    let mut whole = solids.next().ok_or(CsgError::NoBranches)?;
    for solid in solids {
        whole = Arc::new(Blend::new(operation, rounding, [whole, solid], iso)?);
    }
    Ok(whole)
}
