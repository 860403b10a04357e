//! How deep a place lies below the outer surface of a solid.

mod grid;

use std::collections::BTreeSet;

use bspline::hierarchical::BRICK;
use bspline::{Aabb, Field, HierarchicalSpline, Interval, Jet, Real};
use glam::{DAffine3, DMat3, DVec3};

use grid::Grid;

/// Cells of the grid over the thickness of the wall, and in all at most.
const ACROSS: f64 = 8.0;
const MOST: f64 = (1 << 23) as f64;

/// The part of a solid deeper than a wall below its outer surface: positive there, by how much deeper, and negative elsewhere.
///
/// The outer surface is what air can reach from outside; the walls of cavities are none. A cell of a grid counts as solid only if the
/// bounds of the field say so, and depths are exact distances to the cells that air can reach (by parabolas, \[Felzenszwalb12\]): so no depth is too
/// large, and none is too small by more than three cells. Where the solid is cut off by the box of its field that is surface too.
pub struct Interior {
    wall: f64,
    corner: DVec3,
    cell: DVec3,
    /// Nodes on each axis.
    count: [usize; 3],
    /// Depth of each node, last axis fastest, and the largest.
    depth: Vec<f32>,
    deepest: f64,
    bricks: Bricks,
}

/// The bricks of a field. Where a finer one comes in values are summed up from other functions: what they are for does not
/// change, but their last bits do.
struct Bricks {
    lattice_from_world: DAffine3,
    world_from_lattice: DAffine3,
    finest: usize,
    known: BTreeSet<(usize, [u32; 3])>,
}

impl Bricks {
    fn of<T: Real>(field: &HierarchicalSpline<T>) -> Self {
        let map = field.lattice().world_from_lattice;
        let all = field.bricks().into_iter();
        Self {
            lattice_from_world: *field.lattice_from_world(),
            world_from_lattice: map,
            finest: field.level_count() - 1,
            known: all.map(|brick| (brick.level(), brick.key().0)).collect(),
        }
    }

    /// Boxes to which functions with supports in a box may bring bricks where there are none so fine yet.
    fn new_about(&self, supports: &Aabb) -> Vec<Aabb> {
        let local = supports.transformed(&self.lattice_from_world);
        let mut found = Vec::new();
        // Finer ones lie within these.
        for level in 1..=self.finest + 1 {
            let side = BRICK as f64 / (1u64 << level) as f64;
            let [low, high] =
                [local.min + 1e-9, local.max - 1e-9].map(|p| (p / side).floor().max(DVec3::ZERO));
            for x in low.x as u32..=high.x as u32 {
                for y in low.y as u32..=high.y as u32 {
                    for z in low.z as u32..=high.z as u32 {
                        if !self.known.contains(&(level, [x, y, z])) {
                            let corner = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) * side;
                            let own = Aabb::new(corner, corner + side);
                            found.push(own.transformed(&self.world_from_lattice));
                        }
                    }
                }
            }
        }
        found
    }
}

impl Interior {
    /// What of `field` lies deeper than `wall` below the surface `iso`.
    pub fn new<T: Real>(field: &HierarchicalSpline<T>, iso: f64, wall: f64) -> Self {
        let whole = field.lattice().world_box();
        let extent = field.lattice().extent();
        // Cells of an oblique field may lie beside it.
        let is_within = |b: &Aabb| {
            let local = b.transformed(field.lattice_from_world());
            local.min.cmpge(DVec3::splat(-1e-9)).all() && local.max.cmple(extent + 1e-9).all()
        };
        let size = whole.size();
        let width = (wall / ACROSS).max((size.element_product() / MOST).cbrt());
        let cells = (size / width - 1e-9).ceil().max(DVec3::ONE);
        let cells = cells.to_array().map(|n| n.min(MOST) as usize);
        let grid = Grid {
            corner: whole.min,
            cell: size / DVec3::from_array(cells.map(|n| n as f64)),
            cells,
        };
        let mut solid = vec![false; cells.iter().product()];
        let is_solid = |b: &Aabb| {
            let range = field.bounds(b);
            match (range.lo > iso, range.hi < iso) {
                (true, _) => Some(true),
                (_, true) => Some(false),
                _ => None,
            }
        };
        grid.fill([0; 3], cells, &is_solid, &is_within, &mut solid);
        let count = cells.map(|n| n + 1);
        let depth = grid.depths(&grid.outside(&solid), count);
        Self {
            wall,
            corner: grid.corner,
            cell: grid.cell,
            count,
            deepest: f64::from(depth.iter().copied().fold(0.0, f32::max)),
            depth,
            bricks: Bricks::of(field),
        }
    }

    /// Whether functions with supports in a box may change without a bit of the outer surface.
    pub fn may_change(&self, support: &Aabb) -> bool {
        let is_below = |b: &Aabb| self.bounds(b).lo > -self.wall;
        self.bounds(support).lo > 0.0 && self.bricks.new_about(support).iter().all(is_below)
    }

    /// How deep it goes below the outer surface.
    pub fn deepest(&self) -> f64 {
        self.deepest
    }

    /// How much deeper than the wall it goes.
    pub fn room(&self) -> f64 {
        self.deepest - self.wall
    }

    fn node(&self, [x, y, z]: [usize; 3]) -> f64 {
        f64::from(self.depth[(x * self.count[1] + y) * self.count[2] + z])
    }

    /// Nodes about a box.
    fn about(&self, b: &Aabb) -> [[usize; 3]; 2] {
        let [low, high] = [b.min, b.max].map(|p| (p - self.corner) / self.cell);
        // What rounding may add.
        let low = (low - 1e-9).floor();
        let high = (high + 1e-9).ceil();
        [low, high].map(|p| std::array::from_fn(|a| p[a].clamp(0.0, (self.count[a] - 1) as f64) as usize))
    }
}

impl Field for Interior {
    fn value(&self, p: DVec3) -> f64 {
        self.value_gradient(p).0
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let last = DVec3::from_array(self.count.map(|n| (n - 1) as f64));
        let local = (p - self.corner) / self.cell;
        if !(local.cmpge(DVec3::ZERO).all() && local.cmple(last).all()) {
            return (-self.wall, DVec3::ZERO);
        }
        let low = local.floor().min(last - 1.0);
        let share = local - low;
        let low = low.to_array().map(|n| n as usize);
        let (mut value, mut slope) = (0.0, DVec3::ZERO);
        for corner in 0..8 {
            let up: [usize; 3] = [corner >> 2, corner >> 1 & 1, corner & 1];
            let depth = self.node(std::array::from_fn(|a| low[a] + up[a]));
            let weight = DVec3::from_array(std::array::from_fn(|a| {
                if up[a] == 1 { share[a] } else { 1.0 - share[a] }
            }));
            let sign = DVec3::from_array(up.map(|u| if u == 1 { 1.0 } else { -1.0 }));
            value += depth * weight.element_product();
            slope += depth * sign * DVec3::new(weight.y * weight.z, weight.x * weight.z, weight.x * weight.y);
        }
        (value - self.wall, slope / self.cell)
    }

    fn jet(&self, p: DVec3) -> Jet {
        let (value, gradient) = self.value_gradient(p);
        Jet {
            value,
            gradient,
            hessian: DMat3::ZERO,
        }
    }

    fn bounds(&self, b: &Aabb) -> Interval {
        let end = self.corner + self.cell * DVec3::from_array(self.count.map(|n| (n - 1) as f64));
        let slack = 1e-6 * self.cell;
        let is_beyond = b.min.cmplt(self.corner - slack).any() || b.max.cmpgt(end + slack).any();
        let [low, high] = self.about(b);
        let (mut least, mut most) = (if is_beyond { 0.0 } else { f64::INFINITY }, 0.0_f64);
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let depth = self.node([x, y, z]);
                    (least, most) = (least.min(depth), most.max(depth));
                }
            }
        }
        Interval::new(least - self.wall, most - self.wall)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bspline::hierarchical::Lattice;

    /// On cells of a fifth, so that bends are seen.
    fn field(density: impl Fn(DVec3) -> f64 + Sync) -> HierarchicalSpline<f32> {
        let lattice = Lattice {
            world_from_lattice: DAffine3::from_scale_rotation_translation(
                DVec3::splat(0.2),
                glam::DQuat::IDENTITY,
                DVec3::splat(-5.0),
            ),
            cells: [50, 55, 60],
        };
        HierarchicalSpline::schoenberg(lattice, 1.0, density).unwrap()
    }

    /// Depths under a ball with a closed cavity and one that a channel opens, against their formula.
    #[test]
    fn depths_count_from_what_air_can_reach() {
        let cavity = |p: DVec3| p.distance(DVec3::X) - 1.0;
        let closed = move |p: DVec3| (4.5 - p.length()).min(cavity(p));
        let interior = Interior::new(&field(closed), 0.0, 1.0);
        let slack = 3.0 * interior.cell.length();
        for p in [
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [2.0, 1.0, -2.0],
            [-3.0, 0.5, 1.0],
            [0.0, 0.0, 4.2],
        ] {
            let p = DVec3::from_array(p);
            let depth = 4.5 - p.length();
            let found = interior.value(p) + 1.0;
            assert!(
                found <= depth + 0.01 && found >= depth - slack,
                "{p}: {found} of {depth}"
            );
            let b = Aabb::new(p - 0.3, p + 0.3);
            let (least, bounds) = (depth - 0.3 * 3_f64.sqrt(), interior.bounds(&b));
            assert!(
                bounds.lo + 1.0 <= depth && bounds.lo + 1.0 >= least - slack,
                "{p}: {bounds:?}"
            );
        }
        // A channel to the cavity makes its wall an outer surface.
        let channel = |p: DVec3| p.distance(DVec3::new(1.0, 0.0, 3.0)) - 2.2;
        let interior = Interior::new(&field(move |p| closed(p).min(channel(p))), 0.0, 1.0);
        assert!(interior.value(DVec3::new(1.0, 0.0, -1.5)) + 1.0 <= 0.51);
        // Solid everywhere: the box is the surface.
        let all = Interior::new(&field(|_| 1.0), 0.0, 1.0);
        assert!((all.value(DVec3::new(0.0, 0.0, 5.5)) + 1.0 - 1.5).abs() < 1e-5);
        assert!(all.bounds(&Aabb::new(DVec3::splat(4.0), DVec3::splat(5.5))).lo <= -1.0);
        assert!((all.deepest() - 5.0).abs() < 0.1, "{}", all.deepest());
    }
}
