//! On which level a surface lies.

mod common;

use std::collections::BTreeMap;
use std::sync::Arc;

use bspline::hierarchical::{BrickKey, Corrections, Lattice, LevelCorrections};
use bspline::{Field, HierarchicalSpline};
use common::Random;
use glam::{DAffine3, DVec3};

fn set(level: &mut BTreeMap<BrickKey, Corrections<f64>>, s: [u32; 3], c: f64) {
    let brick = level
        .entry(BrickKey(s.map(|s| s / 8)))
        .or_insert_with(Corrections::empty);
    brick.set(s.map(|s| (s % 8) as usize), c);
}

fn spline(lattice: Lattice, levels: Vec<BTreeMap<BrickKey, Corrections<f64>>>) -> HierarchicalSpline<f64> {
    let levels = levels
        .into_iter()
        .map(|l| -> LevelCorrections<f64> { l.into_iter().map(|(k, c)| (k, Arc::new(c))).collect() })
        .collect();
    HierarchicalSpline::from_corrections(lattice, 1.0, levels)
}

/// Every function of a level, from its number.
fn full(n: [u32; 3], mut c: impl FnMut([u32; 3]) -> f64) -> BTreeMap<BrickKey, Corrections<f64>> {
    let mut level = BTreeMap::new();
    for x in 0..n[0] + 3 {
        for y in 0..n[1] + 3 {
            for z in 0..n[2] + 3 {
                set(&mut level, [x, y, z], c([x, y, z]));
            }
        }
    }
    level
}

#[test]
fn crossed_cells_are_those_with_corners_on_both_sides() {
    let mut random = Random(1);
    for cells in [[8, 8, 8], [5, 11, 17], [1, 2, 3]] {
        let lattice = Lattice {
            world_from_lattice: DAffine3::IDENTITY,
            cells,
        };
        let f = spline(lattice, vec![full(cells, |_| random.unit() - 0.5)]);
        let iso = 0.02;
        let inside = |x, y, z| f.value(DVec3::new(x as f64, y as f64, z as f64)) > iso;
        let mut crossed = 0;
        for x in 0..cells[0] {
            for y in 0..cells[1] {
                for z in 0..cells[2] {
                    let corners = (0..8).filter(|c| inside(x + (c >> 2), y + (c >> 1 & 1), z + (c & 1)));
                    crossed += u64::from((1..8).contains(&corners.count()));
                }
            }
        }
        assert_eq!(f.crossed_cells(iso), [crossed]);
    }
}

#[test]
fn a_few_deep_spots_do_not_set_the_level() {
    // A plane through the box; a share of it refined to the next level, one brick of that to the level after.
    let cells = [64; 3];
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_scale(DVec3::splat(0.1)),
        cells,
    };
    for (share, expected) in [(0.5, 1), (0.25, 1), (0.0625, 0)] {
        let mut fine = BTreeMap::new();
        let reach = (128.0 * share) as u32;
        for s in (4..=reach - 4).step_by(4) {
            for t in (4..124).step_by(4) {
                set(&mut fine, [s, t, 64], 1e-9);
            }
        }
        let mut deep = BTreeMap::new();
        set(&mut deep, [12, 12, 128], 1e-9);
        let f = spline(lattice, vec![full(cells, |s| 32.9 - f64::from(s[2])), fine, deep]);
        let crossed = f.crossed_cells(0.0);
        // Areas in cells of level 0: a brick of the last level, the refined share without it, and the rest.
        let whole: f64 = crossed
            .iter()
            .zip([1.0, 0.25, 0.0625])
            .map(|(n, a)| *n as f64 * a)
            .sum();
        assert_eq!(whole, 4096.0, "{crossed:?}");
        assert!(
            (crossed[1] as f64 * 0.25 / 4096.0 - share).abs() < 0.02,
            "{crossed:?}"
        );
        assert!(crossed[2] > 0);
        assert_eq!(f.level_of_surface(0.0, 0.1), expected, "{crossed:?}");
        assert_eq!(f.level_of_surface(0.0, 0.0), 2);
        assert_eq!(f.level_of_surface(1e3, 0.1), 0);
    }
}
