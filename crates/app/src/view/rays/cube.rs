//! Cubes of a solid's tree: bricks, coarser ones above level 0, and what is wished of them.

use std::sync::Arc;

use bspline::hierarchical::{BRICK, Brick, BrickKey, HALO, HALO_LEN};
use bspline::{Field, HierarchicalSpline};
use glam::DVec3;
use rayon::prelude::*;

use super::Solid;
use crate::view::{Look, Mode};

/// Coefficients of a brick with those round it.
pub type Totals = Arc<[f32; HALO_LEN]>;

/// Halvings from the root to level 0.
pub fn crown(solid: &Solid) -> i8 {
    let most = solid.field.lattice().cells.into_iter().max().unwrap_or(1);
    let bricks = most.div_ceil(BRICK as u32);
    bricks.next_power_of_two().trailing_zeros() as i8
}

/// What is looked for in a solid.
#[derive(Clone, Copy, Debug)]
pub struct Wish {
    /// Cubes whose density is nowhere above the first, or everywhere above the second, need not be looked into.
    range: [f32; 2],
    /// Nor those that this plane, a point and a normal in the lattice, does not meet.
    plane: Option<[DVec3; 2]>,
}

/// What is drawn of an octant of a cube.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Octant {
    /// The cube's own numbers.
    Own,
    /// Nothing: all of it is outside.
    Outside,
    /// Nothing: all of it is inside.
    Inside,
    /// Another cube, by its number.
    Cube(u32),
}

/// A cube of a solid's tree.
#[derive(Clone, Copy, Debug)]
pub struct Cube<'a> {
    /// Which solid.
    pub solid: usize,
    /// Below 0 above the field's bricks.
    pub level: i8,
    /// Where among those of its level.
    pub key: [u32; 3],
    /// From level 0 on.
    pub brick: Option<Brick<'a, f32>>,
}

impl Wish {
    /// What a look wishes of a solid.
    pub fn new(solid: &Solid, look: &Look) -> Self {
        let range = match look.mode {
            Mode::Volume => {
                let lowest = solid.second.unwrap_or(f64::INFINITY).min(look.density[0]);
                [lowest as f32, f32::INFINITY]
            }
            _ => [solid.iso as f32; 2],
        };
        let plane = look.cut.map(|(at, normal)| {
            let map = solid.world_from_object * solid.field.lattice().world_from_lattice;
            [
                map.inverse().transform_point3(at),
                map.matrix3.transpose() * normal,
            ]
        });
        Self { range, plane }
    }

    /// What to draw of a cube with numbers in a range; none if it is to be looked into.
    fn side(&self, [low, high]: [f32; 2], corner: DVec3, width: f64) -> Option<Octant> {
        let is_cut = || {
            self.plane.is_some_and(|[at, normal]| {
                let far = (corner + 0.5 * width - at).dot(normal);
                far.abs() <= 0.5 * width * normal.abs().element_sum()
            })
        };
        match (high <= self.range[0], low > self.range[1]) {
            (true, _) => Some(Octant::Outside),
            (_, true) if !is_cut() => Some(Octant::Inside),
            _ => None,
        }
    }
}

impl<'a> Cube<'a> {
    /// All of a solid.
    pub fn root(solid: usize, of: &'a Solid) -> Self {
        let mut root = Self {
            solid,
            level: -crown(of),
            key: [0; 3],
            brick: None,
        };
        if root.level == 0 {
            root.brick = of.field.brick(0, BrickKey([0; 3]));
        }
        root
    }

    /// Its edge in cells of level 0.
    pub fn width(&self) -> f64 {
        BRICK as f64 * (-f64::from(self.level)).exp2()
    }

    /// Where it begins, in the lattice.
    pub fn corner(&self) -> DVec3 {
        DVec3::from_array(self.key.map(f64::from)) * self.width()
    }

    /// Its octants in finer cubes; none if it has none.
    pub fn finer(&self, of: &'a Solid, wish: &Wish) -> Option<[Result<Self, Octant>; 8]> {
        let octants = std::array::from_fn(|octant| {
            let key = BrickKey(self.key).child(octant);
            let mut cube = Self {
                level: self.level + 1,
                key: key.0,
                brick: None,
                ..*self
            };
            match &self.brick {
                Some(brick) => cube.brick = Some(brick.child(octant).ok_or(Octant::Own)?),
                None => {
                    let cells = of.field.lattice().extent();
                    if cube.corner().cmpge(cells).any() {
                        return Err(Octant::Outside);
                    }
                    if cube.level == 0 {
                        cube.brick = Some(of.field.brick(0, key).ok_or(Octant::Outside)?);
                    }
                }
            }
            let side = cube
                .brick
                .and_then(|brick| wish.side(brick.hull(), cube.corner(), cube.width()));
            side.map_or(Ok(cube), Err)
        });
        let has_finer = octants.iter().any(|octant| *octant != Err(Octant::Own));
        has_finer.then_some(octants)
    }
}

impl PartialEq for Cube<'_> {
    fn eq(&self, other: &Self) -> bool {
        (self.solid, self.level, self.key) == (other.solid, other.level, other.key)
    }
}

/// Numbers of a cube that is coarser than all bricks: from values of the field at its knots, so that cubic fields stay as they are
/// \[Boor73\].
pub fn made(field: &HierarchicalSpline<f32>, level: i8, key: [u32; 3]) -> Totals {
    // One more on each side.
    const SIDE: usize = HALO + 2;
    let spacing = (-f64::from(level)).exp2();
    let map = field.lattice().world_from_lattice;
    let mut values = vec![0.0; SIDE * SIDE * SIDE];
    for (n, value) in values.iter_mut().enumerate() {
        let at = [n / (SIDE * SIDE), n / SIDE % SIDE, n % SIDE];
        let knot: [f64; 3] =
            std::array::from_fn(|a| (f64::from(key[a]) * BRICK as f64 + at[a] as f64 - 2.0) * spacing);
        *value = field.value(map.transform_point3(DVec3::from_array(knot)));
    }
    for stride in [SIDE * SIDE, SIDE, 1] {
        let line = |n: usize| (8.0 * values[n] - values[n - stride] - values[n + stride]) / 6.0;
        let is_inner = |n: usize| (1..SIDE - 1).contains(&(n / stride % SIDE));
        let of_line = |n: usize| if is_inner(n) { line(n) } else { values[n] };
        values = (0..values.len()).map(of_line).collect();
    }
    let inner = |n: usize| {
        let [x, y, z] = [n / (HALO * HALO), n / HALO % HALO, n % HALO].map(|k| k + 1);
        values[(x * SIDE + y) * SIDE + z] as f32
    };
    Arc::new(std::array::from_fn(inner))
}

/// Those of many.
pub fn make(field: &HierarchicalSpline<f32>, places: &[(i8, [u32; 3])]) -> Vec<Totals> {
    let all = places.par_iter();
    all.map(|(level, key)| made(field, *level, *key)).collect()
}
