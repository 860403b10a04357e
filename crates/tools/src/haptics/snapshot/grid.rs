//! Nodes of a cubic grid that lies still in the world, whatever part of it is looked at.

use bspline::{Aabb, Frame};
use glam::{DAffine3, DQuat, DVec3};

/// Nodes from one to the next of those that are always looked at. A grid begins and ends with one.
pub const STEP: usize = 4;

/// Largest number of a node at which a box ends.
const FARTHEST: i64 = 1 << 30;

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
    /// The least box of nodes round a box of the world, from a multiple of [`STEP`] to another. Boxes so far away that their nodes
    /// cannot be numbered in 32 bits become one at the end of those that can.
    pub fn round(b: &Aabb, spacing: f64) -> Self {
        let step = STEP as i64;
        let number = |v: f64| (v as i64).clamp(-FARTHEST, FARTHEST);
        let first = (b.min / spacing).floor().to_array();
        let first = first.map(|v| number(v).div_euclid(step) * step);
        let last = (b.max / spacing).ceil().to_array();
        let last = last.map(|v| (number(v) + step - 1).div_euclid(step) * step);
        let last: [i64; 3] = std::array::from_fn(|a| last[a].max(first[a] + 2 * step));
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

    /// Number of a node of the box in the world.
    pub fn number(&self, at: [usize; 3]) -> [i32; 3] {
        std::array::from_fn(|a| (self.first[a] + at[a] as i64) as i32)
    }

    /// The node of the box with a number in the world.
    pub fn find(&self, number: [i32; 3]) -> Option<[usize; 3]> {
        let at: [i64; 3] = std::array::from_fn(|a| i64::from(number[a]) - self.first[a]);
        let is_there = (0..3).all(|a| at[a] >= 0 && at[a] < self.count[a] as i64);
        is_there.then(|| at.map(|n| n as usize))
    }

    /// Whether a node lies at a side of the box.
    pub fn is_rim(&self, at: [usize; 3]) -> bool {
        (0..3).any(|a| at[a] == 0 || at[a] + 1 == self.count[a])
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

    /// The node at a place of lists.
    pub fn node(&self, slot: usize) -> [usize; 3] {
        let [_, ny, nz] = self.count;
        [slot / (ny * nz), slot / nz % ny, slot % nz]
    }

    /// Places in lists of the nodes next to one on each axis.
    pub fn neighbours(&self, at: [usize; 3], slot: usize) -> impl Iterator<Item = usize> + use<> {
        let (strides, count) = (self.strides(), self.count);
        (0..3).flat_map(move |a| {
            let before = (at[a] > 0).then(|| slot - strides[a]);
            let behind = (at[a] + 1 < count[a]).then(|| slot + strides[a]);
            before.into_iter().chain(behind)
        })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_beyond_all_numbers_have_nodes() {
        for at in [0.0, 1e12, -1e30, 1e300] {
            let grid = Grid::round(&Aabb::new(DVec3::splat(at), DVec3::splat(at)).widened(8.0), 0.5);
            assert!(
                grid.count.iter().all(|n| *n > 2 * STEP && *n < 64),
                "{at}: {grid:?}"
            );
            assert_eq!(grid.find(grid.number([1, 2, 3])), Some([1, 2, 3]));
        }
    }
}
