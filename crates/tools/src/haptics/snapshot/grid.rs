//! Nodes of a cubic grid that lies still in the world, whatever part of it is looked at.

use bspline::{Aabb, Frame};
use glam::{DAffine3, DQuat, DVec3};

/// A box of nodes `(i, j, k)·spacing`, z fastest. Grids of one spacing share their nodes, to the bit, wherever their boxes lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Numbers of the first node.
    pub first: [i64; 3],
    /// Nodes on each axis.
    pub count: [usize; 3],
    /// Distance of neighbours, mm.
    pub spacing: f64,
}

impl Grid {
    /// The least box of nodes round a box of the world.
    pub fn round(b: &Aabb, spacing: f64) -> Self {
        let first = (b.min / spacing).floor().to_array().map(|v| v as i64);
        let last = (b.max / spacing).ceil().to_array().map(|v| v as i64);
        Self {
            first,
            count: std::array::from_fn(|a| (last[a] - first[a]) as usize + 1),
            spacing,
        }
    }

    /// Nodes.
    pub fn len(&self) -> usize {
        self.count.iter().product()
    }

    /// From the first node to the last.
    pub fn world_box(&self) -> Aabb {
        let last = std::array::from_fn(|a| self.count[a] - 1);
        Aabb::new(self.place([0; 3]), self.place(last))
    }

    /// Where a node of the box lies.
    pub fn place(&self, at: [usize; 3]) -> DVec3 {
        let number = |a: usize| (self.first[a] + at[a] as i64) as f64;
        DVec3::new(number(0), number(1), number(2)) * self.spacing
    }

    /// Place of a node in lists.
    pub fn slot(&self, at: [usize; 3]) -> usize {
        (at[0] * self.count[1] + at[1]) * self.count[2] + at[2]
    }

    /// All nodes in the order of lists.
    pub fn nodes(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        let [nx, ny, nz] = self.count;
        (0..nx).flat_map(move |x| (0..ny).flat_map(move |y| (0..nz).map(move |z| [x, y, z])))
    }

    /// The node at a place of lists.
    pub fn node(&self, slot: usize) -> [usize; 3] {
        let [_, ny, nz] = self.count;
        [slot / (ny * nz), slot / nz % ny, slot % nz]
    }

    /// Steps in lists to the next node on each axis.
    pub fn strides(&self) -> [usize; 3] {
        [self.count[1] * self.count[2], self.count[2], 1]
    }

    /// The node at or before a place on each axis; none outside the box.
    pub fn cell(&self, p: DVec3) -> Option<[usize; 3]> {
        let q = (p / self.spacing).floor().to_array();
        let at: [i64; 3] = std::array::from_fn(|a| q[a] as i64 - self.first[a]);
        let is_inside = (0..3).all(|a| at[a] >= 0 && at[a] + 1 < self.count[a] as i64);
        is_inside.then(|| at.map(|n| n as usize))
    }

    /// The whole grid, laid into the world of a field.
    pub fn frame(&self, field_from_world: &DAffine3) -> Frame {
        let step = DAffine3::from_scale_rotation_translation(
            DVec3::splat(self.spacing),
            DQuat::IDENTITY,
            DVec3::ZERO,
        );
        Frame {
            world_from_grid: *field_from_world * step,
            cells: self.count.map(|n| n as u32 - 1),
        }
    }
}
