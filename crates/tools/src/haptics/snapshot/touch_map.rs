//! What a surface feels like from place to place, sampled.

use glam::DVec3;

use super::grid::Grid;
use crate::haptics::Touch;
use crate::paint::{Layers, Substance};

/// Compliance and friction at the nodes of a grid, linear between them. Not stiffness: rigid places have none, and beside them it goes over
/// smoothly.
#[derive(Clone, Debug, PartialEq)]
pub struct TouchMap {
    grid: Grid,
    /// mm/N and a number.
    numbers: Vec<[f32; 2]>,
}

impl TouchMap {
    /// Of an object's layers, at the nodes of a grid in the world; `place` gives where they are in the object's own. What nobody painted is
    /// as `default` says, and so is a painted stiffness of 0.
    pub fn new(grid: &Grid, layers: &Layers, default: &Touch, place: impl Fn(DVec3) -> DVec3) -> Self {
        let places: Vec<DVec3> = (0..grid.len())
            .map(|slot| place(grid.place(grid.node(slot))))
            .collect();
        let painted = |substance| layers.get(&substance).map(|layer| layer.values(&places));
        let stiffness = painted(Substance::SurfaceStiffness);
        let friction = painted(Substance::Friction);
        let number = |slot: usize| {
            let soft = match stiffness.as_ref().map(|all| all[slot]) {
                Some(painted) if painted > 0.0 => painted,
                _ => default.stiffness,
            };
            let rough = match friction.as_ref().map(|all| all[slot]) {
                Some(painted) if painted > 0.0 => painted,
                _ => default.friction,
            };
            [(1e3 / soft) as f32, rough as f32]
        };
        Self {
            grid: *grid,
            numbers: (0..grid.len()).map(number).collect(),
        }
    }

    /// Its nodes.
    pub(super) fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Whether some layers say anything that is felt.
    pub fn is_needed(layers: &Layers) -> bool {
        let felt = [Substance::SurfaceStiffness, Substance::Friction];
        felt.iter()
            .any(|s| layers.get(s).is_some_and(|layer| !layer.is_empty()))
    }

    /// At a place; beyond the grid as at its side.
    pub fn at(&self, p: DVec3) -> Touch {
        let grid = &self.grid;
        let q = p / grid.spacing;
        let at: [(usize, f64); 3] = std::array::from_fn(|a| {
            let q = (q[a] - grid.first[a] as f64).clamp(0.0, (grid.count[a] - 1) as f64);
            let cell = (q as usize).min(grid.count[a] - 2);
            (cell, q - cell as f64)
        });
        let mut sum = [0.0; 2];
        for corner in 0..8usize {
            let node = std::array::from_fn(|a| at[a].0 + (corner >> a & 1));
            let share = |a: usize| {
                if corner >> a & 1 == 1 {
                    at[a].1
                } else {
                    1.0 - at[a].1
                }
            };
            let weight = share(0) * share(1) * share(2);
            let numbers = self.numbers[grid.slot(node)];
            sum[0] += weight * f64::from(numbers[0]);
            sum[1] += weight * f64::from(numbers[1]);
        }
        Touch {
            stiffness: 1e3 / sum[0],
            friction: sum[1],
        }
    }
}
