//! The bricks round a tool, laid out so that a thread that must not wait finds them at once.

use std::any::Any;
use std::sync::Arc;

use glam::DVec3;

use super::bounds::{self, Roots};
use super::brick::{BRICK, BrickKey};
use super::motion::Motion;
use super::node::Node;
use super::spline::{Place, finest_cell, finest_over};
use super::{HierarchicalSpline, along, kernel, slopes};
use crate::{Aabb, Field, Interval, Jet, Real};

/// Most bricks of the table on an axis.
const MOST: u32 = 4;

/// One version of a field with a table of the bricks in a box: an immutable value, made by the thread that edits, asked
/// by the one that renders forces.
///
/// All answers have the bits of the field's own. Value, gradient, bounds over a box and along a segment neither allocate
/// nor lock; where the box [covers](Self::covers) the question they do without the way down the tree. Whoever drops the
/// last one frees what no other version needs: keep them in a [`LocalFields`].
#[derive(Clone, Debug)]
pub struct LocalField<T> {
    field: HierarchicalSpline<T>,
    /// Level of the table; finer bricks are found below its nodes.
    level: usize,
    first: [u32; 3],
    shape: [u32; 3],
    /// The finest node at or above each place of the table, z fastest.
    nodes: Vec<Arc<Node<T>>>,
    motion: Option<Motion<T>>,
}

impl<T: Real> HierarchicalSpline<T> {
    /// The field with a table of the bricks that meet a world box: of the finest level at which these are at most four
    /// on each axis.
    pub fn local(&self, around: &Aabb) -> LocalField<T> {
        let extent = self.lattice.extent();
        let around = around.transformed(self.lattice_from_world());
        let [lo, hi] = [around.min, around.max].map(|q| q.clamp(DVec3::ZERO, extent));
        let keys = |level: usize| {
            let key = |q: DVec3| finest_cell(&self.lattice, level, q).map(|c| c / BRICK as u32);
            (key(lo), key(hi))
        };
        let is_small = |level: &usize| {
            let (a, b) = keys(*level);
            (0..3).all(|axis| b[axis] - a[axis] < MOST)
        };
        let level = (0..self.level_count()).rev().find(is_small).unwrap_or(0);
        let (first, last) = keys(level);
        let shape: [u32; 3] = std::array::from_fn(|a| last[a] - first[a] + 1);
        // A box of more than four bricks of level 0 has no table; the tree answers.
        let is_small = is_small(&level);
        let shape = shape.map(|n| if is_small { n } else { 0 });
        let mut nodes = Vec::with_capacity(shape.iter().product::<u32>() as usize);
        for x in 0..shape[0] {
            for y in 0..shape[1] {
                for z in 0..shape[2] {
                    let key = [first[0] + x, first[1] + y, first[2] + z];
                    nodes.push(self.node_over(level as i8, BrickKey(key)));
                }
            }
        }
        LocalField {
            field: self.clone(),
            level,
            first,
            shape,
            nodes,
            motion: None,
        }
    }

    /// The finest node at or above a brick that holds cells.
    fn node_over(&self, level: i8, key: BrickKey) -> Arc<Node<T>> {
        let mut node = &self.root;
        while node.level < level {
            let shift = (level - node.level - 1) as usize;
            match &node.children[super::node::octant(key.0, shift)] {
                Some(child) => node = child,
                None => break,
            }
        }
        node.clone()
    }
}

impl<T: Real> LocalField<T> {
    /// The version that was laid out.
    pub fn field(&self) -> &HierarchicalSpline<T> {
        &self.field
    }

    /// The same with a region that moves between two states laid over it.
    pub fn with_motion(self, motion: Motion<T>) -> Self {
        Self {
            motion: Some(motion),
            ..self
        }
    }

    /// Whether all questions within a world box are answered from the table.
    pub fn covers(&self, b: &Aabb) -> bool {
        let extent = self.field.lattice.extent();
        let b = b.transformed(self.field.lattice_from_world());
        [b.min, b.max].into_iter().all(|q| {
            let cell = finest_cell(&self.field.lattice, self.level, q.clamp(DVec3::ZERO, extent));
            self.slot(cell.map(|c| c / BRICK as u32)).is_some()
        })
    }

    /// Value, gradient and rate `∂f/∂t` at time `t`; without a motion the rate is 0.
    ///
    /// Before its first state a motion is as in that, after its last as in the last.
    #[inline]
    pub fn value_gradient_rate(&self, p: DVec3, t: f64) -> (f64, DVec3, f64) {
        let (q, beyond) = self.field.place.clamp(p);
        let (value, gradient) = self.place(q).value_gradient(&self.field.place);
        let Some(motion) = &self.motion else {
            let (value, gradient) = self.field.place.extend((value, gradient), q, beyond);
            return (value, gradient, 0.0);
        };
        let added = motion.value_gradient_rate(&self.field.place, q, t);
        let inside = (value + added.0, gradient + added.1);
        let (value, gradient) = self.field.place.extend(inside, q, beyond);
        (value, gradient, added.2)
    }

    /// Place in the table of a brick of its level.
    #[inline]
    fn slot(&self, key: [u32; 3]) -> Option<usize> {
        let at: [u32; 3] = std::array::from_fn(|a| key[a].wrapping_sub(self.first[a]));
        let is_inside = (0..3).all(|a| at[a] < self.shape[a]);
        is_inside.then(|| ((at[0] * self.shape[1] + at[1]) * self.shape[2] + at[2]) as usize)
    }

    /// Where lattice point `q` is evaluated.
    #[inline]
    fn place(&self, q: DVec3) -> Place<'_, T> {
        let finest = self.field.level_count() - 1;
        let cell = finest_cell(&self.field.lattice, finest, q);
        let shift = finest - self.level + BRICK.ilog2() as usize;
        let node = match self.slot(cell.map(|c| c >> shift)) {
            Some(slot) => &self.nodes[slot],
            None => &self.field.root,
        };
        Place::new(finest_over(node, finest, cell), finest, cell, q)
    }

    /// The nodes that together hold the cells of a world box.
    fn roots(&self, b: &Aabb) -> Roots<'_, impl Iterator<Item = &Node<T>>> {
        let is_covered = self.covers(b);
        let local = b.transformed(self.field.lattice_from_world());
        let extent = self.field.lattice.extent();
        let key = |q: DVec3| {
            finest_cell(&self.field.lattice, self.level, q.clamp(DVec3::ZERO, extent))
                .map(|c| c / BRICK as u32)
        };
        let (lo, hi) = match is_covered {
            true => (key(local.min), key(local.max)),
            false => ([1; 3], [0; 3]),
        };
        let range = move |a: usize| lo[a]..=hi[a];
        let keys = range(0).flat_map(move |x| range(1).flat_map(move |y| range(2).map(move |z| [x, y, z])));
        let table = keys.map(|key| &*self.nodes[self.slot(key).expect("covered")]);
        let root = (!is_covered).then_some(&*self.field.root);
        Roots {
            place: &self.field.place,
            finest: self.field.level_count() - 1,
            nodes: table.chain(root),
        }
    }
}

/// The field at the end of its motion, if it has one.
impl<T: Real> Field for LocalField<T> {
    fn value(&self, p: DVec3) -> f64 {
        if self.motion.is_some() {
            return self.value_gradient(p).0;
        }
        let (q, beyond) = self.field.place.clamp(p);
        let at = self.place(q);
        kernel::value(at.brick.own_totals(), at.cell, at.t).as_f64() - self.field.slope() * beyond.length()
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let (value, gradient, _) = self.value_gradient_rate(p, f64::INFINITY);
        (value, gradient)
    }

    fn jet(&self, p: DVec3) -> Jet {
        let mut jet = self.field.jet(p);
        if let Some(motion) = &self.motion {
            let (q, _) = self.field.place.clamp(p);
            jet.hessian += motion.hessian(&self.field.place, q);
            (jet.value, jet.gradient) = self.value_gradient(p);
        }
        jet
    }

    /// Of all moments from the first state of a motion to its last.
    fn bounds(&self, b: &Aabb) -> Interval {
        let local = b.transformed(self.field.lattice_from_world());
        let still = bounds::over_lattice_box(self.roots(b), &local, None);
        let extent = self.field.lattice.extent();
        let inside = Aabb {
            min: local.min.clamp(DVec3::ZERO, extent),
            max: local.max.clamp(DVec3::ZERO, extent),
        };
        self.motion.as_ref().map_or(still, |m| still + m.bounds(&inside))
    }

    /// Of all moments from the first state of a motion to its last; with a motion, unknown outside the lattice's box.
    fn gradient_bounds(&self, b: &Aabb) -> [Interval; 3] {
        let still = slopes::over_world_box(self.roots(b), b);
        let Some(motion) = &self.motion else {
            return still;
        };
        let moved =
            motion.gradient_bounds(&self.field.place, &b.transformed(self.field.lattice_from_world()));
        std::array::from_fn(|a| still[a] + moved[a])
    }

    fn bounds_along(&self, from: DVec3, to: DVec3) -> Interval {
        let rounding = self.field.rounding_bound();
        if self.motion.is_some() {
            return self.bounds(&Aabb {
                min: from.min(to),
                max: from.max(to),
            });
        }
        along::over_segment(self, from, to, self.field.finest_spacing(), rounding)
    }

    fn as_any(&self) -> Option<&dyn Any> {
        Some(self)
    }
}

/// The local fields that one thread has made and others may still hold: dropping theirs frees nothing, so that a thread
/// that must not wait never frees.
#[derive(Debug)]
pub struct LocalFields<T> {
    made: Vec<Arc<LocalField<T>>>,
}

impl<T> Default for LocalFields<T> {
    fn default() -> Self {
        Self { made: Vec::new() }
    }
}

impl<T> LocalFields<T> {
    /// A shared handle, of which this keeps one itself.
    pub fn share(&mut self, field: LocalField<T>) -> Arc<LocalField<T>> {
        let field = Arc::new(field);
        self.made.push(field.clone());
        field
    }

    /// Frees those that nobody else holds any more; returns how many are left.
    pub fn free(&mut self) -> usize {
        self.made.retain(|field| Arc::strong_count(field) > 1);
        self.made.len()
    }
}
