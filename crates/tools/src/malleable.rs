//! What tools have to know of a field that they work on as it is.

use bspline::hierarchical::{Lattice, MAX_LEVELS};
use bspline::{Aabb, Field, HierarchicalSpline, KnotVector, Real, TensorSpline};
use glam::{DAffine3, DQuat, DVec3};

/// Cells of level 0 along the longest edge of the lattice of a field on knots of its own.
const COARSEST: f64 = 32.0;

/// A field that tools work on as it is: with levels, or on knots of its own.
pub trait Malleable: Field + Clone + 'static {
    /// The grids of its levels; of a field on knots of its own those that paint on it lies on, and that it gets when it is
    /// written in levels. They follow from its box alone: knots that are inserted change nothing of them.
    fn grids(&self) -> Lattice;
    /// World box round the field's own.
    fn whole(&self) -> Aabb;
    /// Fall per world length outside its box: how steep a field of its kind is.
    fn steepness(&self) -> f64;
    /// The shortest knot interval, a world length.
    fn shortest(&self) -> f64;
    /// Levels that it has; of a field on knots of its own as many as it takes for grids as fine as its shortest interval.
    fn depth(&self) -> usize;
}

impl<T: Real> Malleable for HierarchicalSpline<T> {
    fn grids(&self) -> Lattice {
        *self.lattice()
    }

    fn whole(&self) -> Aabb {
        self.lattice().world_box()
    }

    fn steepness(&self) -> f64 {
        self.slope()
    }

    fn shortest(&self) -> f64 {
        self.lattice().spacing(self.level_count() - 1).min_element()
    }

    fn depth(&self) -> usize {
        self.level_count()
    }
}

impl<T: Real> Malleable for TensorSpline<T> {
    fn grids(&self) -> Lattice {
        let domain = self.knots().each_ref().map(KnotVector::domain);
        let [start, end] = [0, 1].map(|e| DVec3::from_array(domain.map(|d| d[e])));
        let map = self.world_from_parameter();
        let unit = DVec3::from_array([0, 1, 2].map(|a| map.matrix3.col(a).length()));
        let edges = (end - start) * unit;
        let step = edges.max_element() / COARSEST;
        // An edge that is whole cubes long but for rounding has no cube more.
        let cells = (edges / step - 1e-9).ceil().max(DVec3::ONE);
        Lattice {
            world_from_lattice: *map
                * DAffine3::from_scale_rotation_translation(step / unit, DQuat::IDENTITY, start),
            cells: cells.to_array().map(|n| n as u32),
        }
    }

    fn whole(&self) -> Aabb {
        self.world_box()
    }

    fn steepness(&self) -> f64 {
        self.slope()
    }

    fn shortest(&self) -> f64 {
        let map = self.world_from_parameter().matrix3;
        let of_axis = |a: usize| {
            let knots = &self.knots()[a];
            let inner = &knots.knots()[knots.degree()..=knots.coefficient_count()];
            let lengths = inner.windows(2).map(|w| w[1] - w[0]).filter(|l| *l > 0.0);
            lengths.fold(f64::INFINITY, f64::min) * map.col(a).length()
        };
        (0..3).map(of_axis).fold(f64::INFINITY, f64::min)
    }

    fn depth(&self) -> usize {
        let step = self.grids().spacing(0).min_element();
        let finer = (step / self.shortest()).log2().ceil().max(0.0);
        (finer as usize).min(MAX_LEVELS - 1) + 1
    }
}
