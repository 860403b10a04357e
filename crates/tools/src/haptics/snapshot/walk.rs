//! From nodes that are beside the surface near a place to its closest place, as they know it.

use glam::DVec3;

use super::beside::{Beside, BesideNodes};
use super::grid::Grid;
use super::hull::Hull;
use super::nearest::Way;

/// Closest places of neighbours that are tried, one after the other, each nearer than the one before.
const WALK: usize = 6;

/// Where a walk has led.
pub struct Walked<'a> {
    /// The node whose closest place is nearest.
    pub beside: &'a Beside,
    /// Where that node's surface is nearest, to second order.
    pub there: DVec3,
    /// What the least eigenvalue of `1 + sC` is at least on the way there; 0 where it says little.
    pub trust: f64,
}

impl Walked<'_> {
    /// Distance from the place that was walked from.
    pub fn far(&self, p: DVec3) -> f64 {
        p.distance(self.there).min(p.distance(self.beside.at))
    }

    /// What the distance may be off by, mm. With `ρ` the [roughness](Beside::rough), `u` the way along the surface and `s` that to it, the
    /// surface is off by `ρu³`, and the place on it by `e = 3ρsu²/λ`, which makes `λe²/2s`.
    pub fn off(&self, p: DVec3) -> f64 {
        if self.trust <= 0.0 {
            return f64::INFINITY;
        }
        let rough = self.beside.rough;
        let u = self.there.distance(self.beside.foot.at);
        rough * u * u * u * (1.0 + 4.5 * rough * p.distance(self.there) * u / self.trust)
    }
}

/// A node beside the surface: its place in lists, and its number in the world.
pub type First = (usize, [i32; 3]);

/// Different nodes, at most one of a node and of each next to it.
#[derive(Default)]
pub struct Firsts {
    all: [First; 7],
    count: usize,
}

impl Firsts {
    /// The nodes beside the surface that a node and those next to it are nearest to.
    pub fn of(grid: &Grid, ways: &[Way], at: [usize; 3], slot: usize) -> Self {
        let strides = grid.strides();
        let number = grid.number(at);
        let mut found = Self::default();
        let mut add = |from: usize, a: usize, by: i32| {
            let way = ways[from];
            if let (Some(there), Some(mut step)) = (way.from(from, strides), way.step()) {
                step[a] += by;
                found.add(there, std::array::from_fn(|a| number[a] + step[a]));
            }
        };
        add(slot, 0, 0);
        for a in 0..3 {
            if at[a] > 0 {
                add(slot - strides[a], a, -1);
            }
            if at[a] + 1 < grid.count[a] {
                add(slot + strides[a], a, 1);
            }
        }
        found
    }

    fn add(&mut self, slot: usize, number: [i32; 3]) {
        if self.list().iter().all(|first| first.0 != slot) {
            self.all[self.count] = (slot, number);
            self.count += 1;
        }
    }

    /// All of them.
    pub fn list(&self) -> &[First] {
        &self.all[..self.count]
    }
}

/// From the nodes `first` to those at the corners of the cell that the nearest points to, while they are nearer. `hull` gets what was
/// looked at; none if there are no first ones.
pub fn walk<'a>(
    grid: &Grid,
    nodes: &'a BesideNodes,
    p: DVec3,
    first: &[First],
    hull: &mut Hull,
) -> Option<Walked<'a>> {
    let [sx, sy, _] = grid.strides();
    let mut best = (f64::INFINITY, u32::MAX);
    let try_node = |best: &mut (f64, u32), number: u32| {
        let far = p.distance_squared(nodes.place(number));
        let is_nearer = far < best.0;
        if is_nearer {
            *best = (far, number);
        }
        is_nearer
    };
    for (slot, node) in first {
        if let Some(number) = nodes.number(*slot) {
            hull.add(*node);
            try_node(&mut best, number);
        }
    }
    if best.1 == u32::MAX {
        return None;
    }
    let point = |number: u32| nodes.at(number).foot.toward_with_trust(p, grid.spacing);
    let (mut there, mut trust) = point(best.1);
    for _ in 0..WALK {
        let Some(cell) = grid.cell(there) else {
            hull.leave();
            break;
        };
        hull.add(grid.number(cell));
        hull.add(grid.number(cell.map(|n| n + 1)));
        let start = grid.slot(cell);
        let mut is_nearer = false;
        for corner in [0, 1, sy, sy + 1, sx, sx + 1, sx + sy, sx + sy + 1] {
            if let Some(number) = nodes.number(start + corner) {
                is_nearer |= try_node(&mut best, number);
            }
        }
        if !is_nearer {
            break;
        }
        (there, trust) = point(best.1);
    }
    Some(Walked {
        beside: nodes.at(best.1),
        there,
        trust,
    })
}
