//! What differs between two versions of a field, as a value that leads from either to the other.

use std::sync::Arc;

use super::brick::{Corrections, differing};
use super::functions::check_functions;
use super::graft::Graft;
use super::node::Node;
use super::{BrickKey, HierarchicalSpline};
use crate::Real;

/// The bricks whose functions differ between two versions of a field.
///
/// It holds corrections alone: totals follow from them, so that a version reached by [`HierarchicalSpline::applied`] has
/// the bits of the one that the difference was taken from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BrickDiff<T> {
    /// In the order of levels, then of keys.
    pub bricks: Vec<BrickChange<T>>,
}

/// The functions of one brick in two versions; none where no function is active.
#[derive(Clone, Debug, PartialEq)]
pub struct BrickChange<T> {
    /// Level of the brick, 0 the coarsest.
    pub level: usize,
    /// Place of the brick.
    pub key: BrickKey,
    /// In the older version.
    pub old: Option<Arc<Corrections<T>>>,
    /// In the newer one.
    pub new: Option<Arc<Corrections<T>>>,
}

/// Why a difference cannot be taken or applied.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DiffError {
    /// Boxes, maps or slopes differ.
    #[error("the two fields stand on different lattices")]
    Lattice,
    /// The field is not the version that the difference starts from.
    #[error("brick {key:?} of level {level} is not as the difference expects it")]
    Version {
        /// Level of the brick.
        level: usize,
        /// Place of the brick.
        key: [u32; 3],
    },
}

impl<T: Clone> BrickDiff<T> {
    /// The way back.
    pub fn reversed(&self) -> Self {
        let turned = |change: &BrickChange<T>| BrickChange {
            old: change.new.clone(),
            new: change.old.clone(),
            ..change.clone()
        };
        Self {
            bricks: self.bricks.iter().map(turned).collect(),
        }
    }
}

impl<T: Real> HierarchicalSpline<T> {
    /// What leads from this version to a `newer` one, at the cost of what the two do not share.
    ///
    /// # Errors
    /// [`DiffError::Lattice`].
    pub fn difference(&self, newer: &Self) -> Result<BrickDiff<T>, DiffError> {
        if self.lattice() != newer.lattice() || self.slope() != newer.slope() {
            return Err(DiffError::Lattice);
        }
        let mut bricks = Vec::new();
        collect(Some(&self.root), Some(&newer.root), &mut bricks);
        bricks.sort_unstable_by_key(|change| (change.level, change.key));
        Ok(BrickDiff { bricks })
    }

    /// The version at the other end of a difference that starts from this one.
    ///
    /// # Errors
    /// [`DiffError::Version`] if a brick is not as the difference has it; [`DiffError::Lattice`] if one has a function
    /// that the lattice does not have.
    pub fn applied(&self, diff: &BrickDiff<T>) -> Result<Self, DiffError> {
        let mut grafts = Vec::new();
        for change in &diff.bricks {
            let &BrickChange { level, key, .. } = change;
            let node = self.find(level, key);
            if node.and_then(|n| n.corrections.as_ref()) != change.old.as_ref() {
                return Err(DiffError::Version { level, key: key.0 });
            }
            if let Some(new) = &change.new {
                check_functions(&self.lattice, level, key, new).map_err(|_| DiffError::Lattice)?;
            }
            let changed = differing(change.old.as_deref(), change.new.as_deref());
            grafts.push(Graft::new(
                &self.lattice,
                (level, key),
                changed,
                change.new.clone(),
            ));
        }
        Ok(self.with_grafts(grafts))
    }
}

fn collect<'a, T: Real>(
    old: Option<&'a Arc<Node<T>>>,
    new: Option<&'a Arc<Node<T>>>,
    found: &mut Vec<BrickChange<T>>,
) {
    let Some(any) = old.or(new) else { return };
    let known = |n: Option<&'a Arc<Node<T>>>| n.and_then(|n| n.digest.get());
    let is_shared = old.zip(new).is_some_and(|(a, b)| Arc::ptr_eq(a, b));
    // Of fields that were loaded apart no nodes are shared; once their hash has been asked for, digests tell as much.
    if is_shared || known(old).is_some() && known(old) == known(new) {
        return;
    }
    let functions = |n: Option<&Arc<Node<T>>>| n.and_then(|n| n.corrections.clone());
    let (before, after) = (functions(old), functions(new));
    let is_same = match (&before, &after) {
        (Some(a), Some(b)) => Arc::ptr_eq(a, b) || a == b,
        (a, b) => a.is_none() && b.is_none(),
    };
    if !is_same {
        found.push(BrickChange {
            level: any.level as usize,
            key: any.key,
            old: before,
            new: after,
        });
    }
    let children = |n: Option<&'a Arc<Node<T>>>| n.map(|n| &n.children);
    for octant in 0..8 {
        let child = |n| children(n).and_then(|c| c[octant].as_ref());
        collect(child(old), child(new), found);
    }
}
