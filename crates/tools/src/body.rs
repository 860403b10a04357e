//! What an object's field is made of.

use std::sync::Arc;

use bspline::hierarchical::{BrickDiff, DiffError, Lattice};
use bspline::tensor::{TensorDiff, TensorDiffError};
use bspline::{Aabb, Field, HierarchicalSpline, TensorSpline};
use glam::DAffine3;

use crate::malleable::Malleable;

/// The field of an object. Cheap to copy.
#[derive(Clone, Debug)]
pub enum Body {
    /// On dyadic levels, finer where it has to be: what is fitted, and what every tool works on.
    Levels(HierarchicalSpline<f32>),
    /// On three knot vectors of its own: force tools, paint, holds and the insertion of knots work on it as it is, see
    /// [`crate::knots`].
    Knots(TensorSpline<f32>),
}

/// What leads from one version of a body to another.
#[derive(Clone, Debug, PartialEq)]
pub enum BodyDiff {
    /// Bricks.
    Levels(BrickDiff<f32>),
    /// A box of coefficients.
    Knots(TensorDiff<f32>),
}

/// Why a difference leads nowhere from a body.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BodyError {
    /// Bricks do not fit.
    #[error(transparent)]
    Levels(#[from] DiffError),
    /// Coefficients do not fit.
    #[error(transparent)]
    Knots(#[from] TensorDiffError),
    /// One has levels, the other knots of its own.
    #[error("the difference is of a field of another kind")]
    Kind,
}

impl From<HierarchicalSpline<f32>> for Body {
    fn from(field: HierarchicalSpline<f32>) -> Self {
        Self::Levels(field)
    }
}

impl From<TensorSpline<f32>> for Body {
    fn from(field: TensorSpline<f32>) -> Self {
        Self::Knots(field)
    }
}

impl Body {
    /// The field, to be asked.
    pub fn as_field(&self) -> &dyn Field {
        match self {
            Self::Levels(field) => field,
            Self::Knots(field) => field,
        }
    }

    /// The field, to be part of others.
    pub fn shared(&self) -> Arc<dyn Field> {
        match self {
            Self::Levels(field) => Arc::new(field.clone()),
            Self::Knots(field) => Arc::new(field.clone()),
        }
    }

    /// The field, if it has levels.
    pub fn levels(&self) -> Option<&HierarchicalSpline<f32>> {
        match self {
            Self::Levels(field) => Some(field),
            Self::Knots(_) => None,
        }
    }

    /// The field, if it has knots of its own.
    pub fn knots(&self) -> Option<&TensorSpline<f32>> {
        match self {
            Self::Levels(_) => None,
            Self::Knots(field) => Some(field),
        }
    }

    /// Its grids, see [`Malleable::grids`].
    pub fn lattice(&self) -> Lattice {
        match self {
            Self::Levels(field) => field.grids(),
            Self::Knots(field) => field.grids(),
        }
    }

    /// World box round the field's own.
    pub fn world_box(&self) -> Aabb {
        match self {
            Self::Levels(field) => field.whole(),
            Self::Knots(field) => field.whole(),
        }
    }

    /// Fall of the field per world length outside its box.
    pub fn slope(&self) -> f64 {
        match self {
            Self::Levels(field) => field.steepness(),
            Self::Knots(field) => field.steepness(),
        }
    }

    /// Coefficients.
    pub fn coefficient_count(&self) -> usize {
        match self {
            Self::Levels(field) => field.coefficient_count(),
            Self::Knots(field) => field.coefficients().len(),
        }
    }

    /// Its levels, see [`Malleable::depth`].
    pub fn level_count(&self) -> usize {
        match self {
            Self::Levels(field) => field.depth(),
            Self::Knots(field) => field.depth(),
        }
    }

    /// The same field where its own world lies elsewhere.
    pub fn placed(&self, map: DAffine3) -> Self {
        match self {
            Self::Levels(field) => Self::Levels(field.placed(map * field.lattice().world_from_lattice)),
            Self::Knots(field) => Self::Knots(field.placed(map * *field.world_from_parameter())),
        }
    }

    /// SHA-256 of the field.
    pub fn sha256(&self) -> [u8; 32] {
        match self {
            Self::Levels(field) => field.sha256(),
            Self::Knots(field) => field.sha256(),
        }
    }

    /// Boxes of its own world outside of which its values are as in an earlier version; of knots of its own the whole, where
    /// anything differs.
    pub fn changed_boxes(&self, before: &Self) -> Vec<Aabb> {
        let whole = self.world_box();
        match (self, before) {
            (Self::Levels(now), Self::Levels(before)) => now.changed_boxes(before, &whole),
            _ if self.difference(before).is_some_and(|diff| diff.is_empty()) => Vec::new(),
            _ => vec![whole],
        }
    }

    /// What leads to another version; none where they are not versions of one field on the same lattice or knots.
    pub fn difference(&self, new: &Self) -> Option<BodyDiff> {
        match (self, new) {
            (Self::Levels(old), Self::Levels(new)) => old.difference(new).ok().map(BodyDiff::Levels),
            (Self::Knots(old), Self::Knots(new)) => old.difference(new).map(BodyDiff::Knots),
            _ => None,
        }
    }

    /// The version at the other end of a difference.
    ///
    /// # Errors
    /// Any [`BodyError`].
    pub fn applied(&self, diff: &BodyDiff) -> Result<Self, BodyError> {
        Ok(match (self, diff) {
            (Self::Levels(field), BodyDiff::Levels(diff)) => Self::Levels(field.applied(diff)?),
            (Self::Knots(field), BodyDiff::Knots(diff)) => Self::Knots(field.applied(diff)?),
            _ => return Err(BodyError::Kind),
        })
    }
}

impl BodyDiff {
    /// Whether nothing differs.
    pub fn is_empty(&self) -> bool {
        match self {
            Self::Levels(diff) => diff.bricks.is_empty(),
            Self::Knots(diff) => diff.is_empty(),
        }
    }

    /// The way back.
    pub fn reversed(&self) -> Self {
        match self {
            Self::Levels(diff) => Self::Levels(diff.reversed()),
            Self::Knots(diff) => Self::Knots(diff.reversed()),
        }
    }
}
