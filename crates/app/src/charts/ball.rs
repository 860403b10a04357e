//! The field that edits and tools are measured on, and how they are timed.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use bspline::HierarchicalSpline;
use bspline::hierarchical::{BrickKey, DenseCorrections, Lattice, LevelEdit};
use glam::{DAffine3, DVec3};
use rayon::prelude::*;

/// Cells of level 0 on an axis of the box, mostly.
pub(super) const CELLS: u32 = 32;
/// Radius of the ball in edges of the box.
const RADIUS: f64 = 0.36;
/// Distance from the ball within which functions of finer levels are active, in their intervals.
const BAND: f64 = 2.0;

/// A ball with small waves in a thin shell.
pub(super) struct Ball {
    pub field: HierarchicalSpline<f32>,
    pub level: usize,
    cells: u32,
}

impl Ball {
    /// One of so many levels above the first.
    pub fn new(depth: u32) -> Self {
        Self::of(CELLS, depth)
    }

    /// Distance to a ball on level 0, of so many cells on an axis; small waves near its surface on `depth` finer levels.
    pub fn of(cells: u32, depth: u32) -> Self {
        let lattice = Lattice {
            world_from_lattice: DAffine3::IDENTITY,
            cells: [cells; 3],
        };
        let levels = (0..=depth).map(|level| {
            let n = cells << level;
            let bricks = (n + 2) / 8 + 1;
            let keys = (0..bricks).into_par_iter().flat_map_iter(|x| {
                (0..bricks).flat_map(move |y| (0..bricks).map(move |z| BrickKey([x, y, z])))
            });
            let full: Vec<_> = keys
                .filter_map(|key| Some((key, Arc::new(brick(n, level, key)?.pack()))))
                .collect();
            full.into_iter().collect()
        });
        Self {
            field: HierarchicalSpline::from_corrections(lattice, 1.0, levels.collect()),
            level: depth as usize,
            cells,
        }
    }

    /// The function next to a point.
    pub fn function(&self, p: DVec3) -> [u32; 3] {
        let p = p * f64::from(1u32 << self.level);
        p.to_array().map(|p| p as u32 + 1)
    }

    /// Adds to the function next to a point, in cells of the finest level.
    pub fn edit(&self, p: DVec3, cells: f64) -> LevelEdit<f32> {
        LevelEdit {
            level: self.level,
            function: self.function(p),
            delta: (cells * self.cell()) as f32,
        }
    }

    /// Where a stroke along the surface is after `i` steps of one finest interval each.
    pub fn stroke(&self, i: usize) -> DVec3 {
        let turn = 0.4 + i as f64 * self.cell() / (RADIUS * f64::from(self.cells));
        let (u, v) = (DVec3::new(0.8, 0.0, 0.6), DVec3::new(0.36, 0.8, -0.48));
        self.on_ball(libm::cos(turn) * u + libm::sin(turn) * v)
    }

    /// Point number `i` of a sequence that covers the surface evenly: steps of the plastic number \[Roberts18\].
    pub fn scattered(&self, i: usize) -> DVec3 {
        let [a, b] = [0.754_877_666_25, 0.569_840_290_998].map(|step| (i as f64 * step).fract());
        let (z, turn) = (2.0 * a - 1.0, std::f64::consts::TAU * b);
        let r = (1.0 - z * z).sqrt();
        self.on_ball(DVec3::new(r * libm::cos(turn), r * libm::sin(turn), z))
    }

    /// Diagonal of the box round it.
    #[cfg(feature = "window")]
    pub fn diagonal(&self) -> f64 {
        2.0 * RADIUS * f64::from(self.cells) * 3f64.sqrt()
    }

    fn on_ball(&self, direction: DVec3) -> DVec3 {
        let edge = f64::from(self.cells);
        DVec3::splat(0.5 * edge) + RADIUS * edge * direction
    }

    /// Width of a cell of the finest level.
    pub fn cell(&self) -> f64 {
        1.0 / f64::from(1u32 << self.level)
    }
}

/// Functions of one brick of a level of `n` cells; none if there are none.
fn brick(n: u32, level: u32, key: BrickKey) -> Option<DenseCorrections<f32>> {
    let (middle, radius) = (DVec3::splat(f64::from(n) / 2.0), RADIUS * f64::from(n));
    let height = |knot: DVec3| radius - (knot - middle).length();
    let centre = DVec3::from_array(key.0.map(|k| f64::from(8 * k) + 2.5));
    if level > 0 && height(centre).abs() > 3.5 * 3f64.sqrt() + BAND {
        return None;
    }
    let mut corrections = DenseCorrections::empty();
    for slot in 0..512u32 {
        let at = [slot / 64, slot / 8 % 8, slot % 8];
        let function: [u32; 3] = std::array::from_fn(|a| 8 * key.0[a] + at[a]);
        if function.iter().any(|&f| f >= n + 3) {
            continue;
        }
        let height = height(DVec3::from_array(function.map(f64::from)) - 1.0);
        let value = match level {
            0 => height,
            _ if height.abs() > BAND => continue,
            _ => 0.05 * libm::sin(f64::from(7 * function[0] + 3 * function[1])) / f64::from(1u32 << level),
        };
        corrections.set(at.map(|a| a as usize), value as f32);
    }
    (corrections.mask != [0; 8]).then_some(corrections)
}

/// Median of `count` runs, microseconds; `run` is told its number and returns what it takes to drop, which is not timed.
pub(super) fn median<R>(count: usize, mut run: impl FnMut(usize) -> R) -> f64 {
    let times = (0..count).map(|i| {
        let start = Instant::now();
        let kept = black_box(run(i));
        let time = start.elapsed().as_secs_f64() * 1e6;
        drop(kept);
        time
    });
    middle(times.collect())
}

pub(super) fn middle(mut times: Vec<f64>) -> f64 {
    times.sort_unstable_by(f64::total_cmp);
    times[times.len() / 2]
}
