//! The laws of [`HierarchicalSpline`].

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::common::{Options, field_conformance};
use bspline::hierarchical::{BrickKey, Corrections, Lattice, LevelCorrections};
use bspline::{Aabb, Csg, Field, Frame, HierarchicalSpline, Interval, Real};
use glam::{DAffine3, DMat3, DVec3};

/// A small seeded generator: tests need the same numbers everywhere.
struct Lcg(u64);

impl Lcg {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
    fn point(&mut self, lo: DVec3, hi: DVec3) -> DVec3 {
        lo + DVec3::new(self.next(), self.next(), self.next()) * (hi - lo)
    }
}

fn oblique() -> DAffine3 {
    DAffine3 {
        matrix3: DMat3::from_cols(
            DVec3::new(1.5, 0.2, 0.0),
            DVec3::new(-0.3, 0.8, 0.1),
            DVec3::new(0.1, 0.0, -1.1),
        ),
        translation: DVec3::new(10.0, -20.0, 5.0),
    }
}

fn set<T: Real>(level: &mut BTreeMap<BrickKey, Corrections<T>>, s: [u32; 3], c: f64) {
    let key = BrickKey(s.map(|s| s / 8));
    let brick = level.entry(key).or_insert_with(Corrections::empty);
    brick.set(s.map(|s| (s % 8) as usize), T::from_f64(c));
}

/// Level 0 full, two finer levels with random functions in random places.
fn random_spline<T: Real>(seed: u64, map: DAffine3, cells: [u32; 3]) -> HierarchicalSpline<T> {
    let mut rng = Lcg(seed);
    let lattice = Lattice {
        world_from_lattice: map,
        cells,
    };
    let mut levels: Vec<LevelCorrections<T>> = Vec::new();
    for level in 0..3usize {
        let n = lattice.cells_at(level);
        let mut bricks = BTreeMap::new();
        if level == 0 {
            for x in 0..n[0] + 3 {
                for y in 0..n[1] + 3 {
                    for z in 0..n[2] + 3 {
                        set(&mut bricks, [x, y, z], 2.0 * rng.next() - 1.0);
                    }
                }
            }
        } else {
            for _ in 0..300 - 100 * level {
                let s = n.map(|n| (rng.next() * (n + 3) as f64) as u32);
                set(&mut bricks, s, (2.0 * rng.next() - 1.0) * 0.5);
            }
        }
        levels.push(bricks.into_iter().map(|(k, c)| (k, Arc::new(c))).collect());
    }
    HierarchicalSpline::from_corrections(lattice, 1.0, levels)
}

/// One cubic B-spline centred on 0 with unit knots.
fn bump(x: f64) -> f64 {
    let a = x.abs();
    match a {
        a if a < 1.0 => (4.0 - 6.0 * a * a + 3.0 * a * a * a) / 6.0,
        a if a < 2.0 => (2.0 - a).powi(3) / 6.0,
        _ => 0.0,
    }
}

/// The definition: the sum over all active functions of all levels.
fn definition<T: Real>(f: &HierarchicalSpline<T>, p: DVec3) -> f64 {
    let q = f.lattice_from_world().transform_point3(p);
    let mut sum = 0.0;
    for level in 0..f.level_count() {
        let scaled = q * (1u64 << level) as f64;
        for (key, c) in &f.corrections(level) {
            for (slot, value) in c.iter() {
                let s = [slot / 64, slot / 8 % 8, slot % 8];
                let b: f64 = (0..3)
                    .map(|a| bump(scaled[a] - (8.0 * key.0[a] as f64 + s[a] as f64 - 1.0)))
                    .product();
                sum += value.as_f64() * b;
            }
        }
    }
    sum
}

#[test]
fn totals_evaluate_to_the_sum_of_all_levels() {
    let f = random_spline::<f64>(1, oblique(), [5, 9, 3]);
    let mut rng = Lcg(2);
    for _ in 0..2000 {
        let p = f
            .lattice()
            .world_from_lattice
            .transform_point3(rng.point(DVec3::ZERO, f.lattice().extent()));
        assert!((f.value(p) - definition(&f, p)).abs() < 1e-13, "at {p}");
    }
}

#[test]
fn gradient_and_hessian_match_central_differences() {
    let f = random_spline::<f64>(3, oblique(), [5, 4, 3]);
    let mut rng = Lcg(4);
    let d = 1e-4;
    for _ in 0..500 {
        let q = rng.point(DVec3::splat(0.05), f.lattice().extent() - 0.05);
        let p = f.lattice().world_from_lattice.transform_point3(q);
        let jet = f.jet(p);
        for a in 0..3 {
            let e = DVec3::AXES[a] * d;
            let ((v1, g1), (v0, g0)) = (f.value_gradient(p + e), f.value_gradient(p - e));
            assert!(((v1 - v0) / (2.0 * d) - jet.gradient[a]).abs() < 1e-5);
            // The third derivative jumps at knots: first order in d there, with constant max|C|/h³.
            assert!(
                ((g1 - g0) / (2.0 * d) - jet.hessian.col(a)).length() < 1e-1,
                "{p}"
            );
        }
    }
}

#[test]
fn gradient_outside_the_box_matches_differences() {
    let f = random_spline::<f64>(5, oblique(), [4, 4, 4]);
    let mut rng = Lcg(6);
    let d = 1e-6;
    for _ in 0..500 {
        let q = rng.point(DVec3::splat(-3.0), f.lattice().extent() + 3.0);
        let p = f.lattice().world_from_lattice.transform_point3(q);
        let (_, g) = f.value_gradient(p);
        for a in 0..3 {
            let e = DVec3::AXES[a] * d;
            let slope = (f.value(p + e) - f.value(p - e)) / (2.0 * d);
            assert!((slope - g[a]).abs() < 1e-4, "{q} {slope} {}", g[a]);
        }
    }
}

#[test]
fn second_derivatives_do_not_jump_across_level_borders() {
    let f = random_spline::<f64>(7, DAffine3::IDENTITY, [4, 4, 4]);
    let mut rng = Lcg(8);
    // Finest spacing 1/4, max|C| about 2: the bound of 1e-9·max|C|/h².
    let tolerance = 1e-9 * 2.0 * 16.0;
    for _ in 0..3000 {
        let mut q = rng.point(DVec3::ZERO, f.lattice().extent());
        let axis = (rng.next() * 3.0) as usize;
        q[axis] = (rng.next() * 14.0 + 1.0).floor() / 4.0;
        let e = DVec3::AXES[axis] * 1e-13;
        let (below, above) = (f.jet(q - e), f.jet(q + e));
        assert!((below.value - above.value).abs() < 1e-11);
        let jump = below.hessian - above.hessian;
        for c in 0..3 {
            assert!(jump.col(c).abs().max_element() < tolerance, "jump {jump} at {q}");
        }
    }
}

#[test]
fn nodes_of_a_frame_have_the_bits_of_single_points_in_any_block() {
    let f = random_spline::<f32>(9, DAffine3::IDENTITY, [5, 6, 7]);
    // A power of two per cell, so that a node's coordinates are the same on both ways.
    let frame = Frame {
        world_from_grid: DAffine3::from_scale(DVec3::splat(0.125)),
        cells: [40, 48, 56],
    };
    for (lo, count) in [
        ([-3, 5, 2], [9, 9, 9]),
        ([30, 40, 50], [14, 12, 9]),
        ([0, 0, 0], [41, 3, 57]),
    ] {
        let mut out = vec![0.0; count.iter().product()];
        f.frame_values(&frame, lo, count, &mut out);
        let mut slot = out.iter();
        for i in 0..count[0] as i64 {
            for j in 0..count[1] as i64 {
                for k in 0..count[2] as i64 {
                    let p = frame.node([lo[0] + i, lo[1] + j, lo[2] + k]);
                    assert_eq!(slot.next().unwrap().to_bits(), f.value(p).to_bits(), "{p}");
                }
            }
        }
    }
}

#[test]
fn bricks_follow_the_functions_not_the_box() {
    let lattice = Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [8, 8, 8],
    };
    let mut levels = vec![BTreeMap::new(); 5];
    let mut level = BTreeMap::new();
    set::<f32>(&mut level, [68, 68, 68], 1.0);
    levels[4] = level.into_iter().map(|(k, c)| (k, Arc::new(c))).collect();
    let f = HierarchicalSpline::from_corrections(lattice, 1.0, levels);
    // One function in the middle of a brick: that brick and its three coarser covers, and the root.
    assert_eq!(f.brick_count(), 5);
    assert_eq!(f.coefficient_count(), 1);
}

#[test]
fn the_finest_brick_in_a_box_is_that_of_all_bricks() {
    let mut met = [0; 3];
    for seed in 0..20 {
        let f = random_spline::<f32>(seed, oblique(), [40, 25, 12]);
        let mut rng = Lcg(seed);
        for _ in 0..50 {
            let map = f.lattice().world_from_lattice;
            let corner = map.transform_point3(rng.point(DVec3::splat(-4.0), f.lattice().extent() + 4.0));
            let b = Aabb::new(corner, corner + rng.point(DVec3::ZERO, DVec3::splat(6.0)));
            let local = b.transformed(f.lattice_from_world());
            let reaches = |level: usize, key: BrickKey| {
                let side = 8.0 / f64::from(1 << level);
                let first = side * DVec3::from_array(key.0.map(f64::from));
                first.cmple(local.max).all() && (first + side).cmpge(local.min).all()
            };
            let all = f.bricks().into_iter();
            let levels = all.filter(|b| reaches(b.level(), b.key())).map(|b| b.level());
            let finest = levels.max().unwrap_or(0);
            assert_eq!(f.finest_in(&b), finest, "seed {seed}: {b:?}");
            met[finest] += 1;
        }
    }
    assert!(met.iter().all(|n| *n > 50), "{met:?}");
}

#[test]
fn hash_covers_the_field_and_nothing_else() {
    let f = random_spline::<f64>(11, oblique(), [5, 4, 3]);
    assert_eq!(
        f.sha256(),
        random_spline::<f64>(11, oblique(), [5, 4, 3]).sha256()
    );
    assert_ne!(
        f.sha256(),
        random_spline::<f64>(12, oblique(), [5, 4, 3]).sha256()
    );
    let rebuilt = HierarchicalSpline::from_corrections(
        *f.lattice(),
        f.slope(),
        (0..f.level_count()).map(|l| f.corrections(l)).collect(),
    );
    assert_eq!(f.sha256(), rebuilt.sha256());
    let steeper = HierarchicalSpline::from_corrections(
        *f.lattice(),
        2.0 * f.slope(),
        (0..f.level_count()).map(|l| f.corrections(l)).collect(),
    );
    assert_ne!(f.sha256(), steeper.sha256());
}

/// The last argument is the precision's share of the largest value.
fn conforms<T: Real>(name: &str, map: DAffine3, value_tolerance: f64, step: f64, tolerance: f64) {
    let f = random_spline::<T>(21, map, [5, 4, 6]);
    // Differences across the faces of the box would see the kink of the extension.
    let whole = f.lattice().world_box();
    let margin = 2.0 * step * whole.size().length();
    let region = Aabb::new(whole.min + margin, whole.max - margin);
    let options = Options {
        value_tolerance,
        step,
        difference_tolerance: tolerance,
        rough_share: 1e-3,
        ..Options::default()
    };
    let widths = field_conformance(name, &f, &region, &options);
    println!("{name}: bounds over ranges, median and p99: {widths:?}");
}

#[test]
fn conforms_in_double_precision() {
    conforms::<f64>(
        "f64",
        DAffine3::from_scale(DVec3::new(1.0, 2.0, 0.5)),
        1e-14,
        1e-5,
        1e-5,
    );
}

#[test]
fn conforms_in_single_precision() {
    conforms::<f32>(
        "f32",
        DAffine3::from_translation(DVec3::splat(0.25)),
        1e-6,
        1e-3,
        1e-2,
    );
}

#[test]
fn bounds_hold_outside_the_box_and_on_oblique_lattices() {
    for seed in 0..50 {
        let map = if seed % 2 == 0 {
            oblique()
        } else {
            DAffine3::from_scale(DVec3::new(1.0, 2.0, 0.5))
        };
        let f = random_spline::<f32>(seed, map, [5, 4, 9]);
        let region = f.lattice().world_box();
        let (lo, hi) = (region.min - 3.0, region.max + 3.0);
        let mut rng = Lcg(seed + 1);
        for _ in 0..200 {
            let (a, b) = (rng.point(lo, hi), rng.point(lo, hi));
            let b = a + (b - a) * rng.next().powi(3);
            let region = Aabb::new(a.min(b), a.max(b));
            let bound = f.bounds(&region);
            for _ in 0..20 {
                let p = rng.point(region.min, region.max);
                assert!(bound.contains(f.value(p)), "{} outside {bound:?}", f.value(p));
            }
        }
    }
}

#[test]
fn bounds_of_boxes_along_the_knots_read_their_own_cells_only() {
    // One huge coefficient: function 5 of level 0, whose support is the cells 3 .. 7 on each axis.
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_scale_rotation_translation(
            DVec3::new(0.1, 0.3, 0.7),
            glam::DQuat::IDENTITY,
            DVec3::splat(1.0 / 3.0),
        ),
        cells: [12; 3],
    };
    let mut bricks = BTreeMap::new();
    set::<f32>(&mut bricks, [6, 6, 6], 1e6);
    let level = bricks.into_iter().map(|(k, c)| (k, Arc::new(c))).collect();
    let f = HierarchicalSpline::from_corrections(lattice, 1.0, vec![level]);
    let frame = Frame {
        world_from_grid: lattice.world_from_lattice,
        cells: lattice.cells,
    };
    for first in 0..12i64 {
        for last in first + 1..=12 {
            let bound = f.frame_bounds(&frame, [first, 0, 0], [last, 12, 12]);
            let reads = first < 7 && last > 3;
            assert_eq!(bound.hi > 1e5, reads, "cells {first} .. {last}: {bound:?}");
            for node in first..=last {
                let value = f.value(frame.node([node, 5, 5]));
                assert!(
                    bound.contains(value),
                    "node {node} of {first} .. {last}: {value} {bound:?}"
                );
            }
        }
    }
}

#[test]
fn bounds_about_a_level_answer_like_the_bounds() {
    let side = |b: Interval, c: f64| (b.hi <= c, b.lo > c);
    let (mut told, mut asked) = (0, 0);
    for seed in 0..3 {
        let f = random_spline::<f32>(seed, DAffine3::from_scale(DVec3::new(1.0, 2.0, 0.5)), [5, 4, 9]);
        // Reaches over the lattice's box on all sides, at an offset of its own.
        let region = f.lattice().world_box();
        let frame = Frame::over(&Aabb::new(region.min - 0.37, region.max + 0.41), [60; 3]);
        // As another object is seen: shifted to its surface, turned, stretched.
        let shifted = Csg::sum(vec![(0.5, Arc::new(f.clone()) as _)], 0.1).unwrap();
        let turn = DAffine3::from_rotation_z(0.3);
        let placed = Csg::affine(Arc::new(shifted), turn).unwrap();
        let placed = Csg::sum(vec![(1.7, Arc::new(placed) as _)], -0.05).unwrap();
        let fields: [&dyn Field; 2] = [&f, &placed];
        let mut rng = Lcg(seed);
        for n in 0..8000 {
            let f = fields[n % 2];
            let size = 1.0 + 30.0 * rng.next().powi(4);
            let lo: [i64; 3] = std::array::from_fn(|_| (rng.next() * (60.0 - size)) as i64);
            let hi = lo.map(|x| x + size as i64);
            let level = 2.0 * (2.0 * rng.next() - 1.0);
            let full = side(f.frame_bounds(&frame, lo, hi), level);
            let quick = side(f.frame_bounds_about(&frame, lo, hi, level), level);
            assert!(
                quick == full || quick == (false, false),
                "{lo:?} {hi:?} {level}: {quick:?} {full:?}"
            );
            told += (quick != (false, false)) as u32;
            asked += (full != (false, false)) as u32;
        }
    }
    // Only rounding may lose an answer.
    assert!(asked > 8000 && told + 10 >= asked, "{told} of {asked}");
}

#[test]
fn batches_have_the_bits_of_single_points_in_any_order() {
    for seed in 0..5 {
        let f = random_spline::<f32>(seed, oblique(), [9, 6, 17]);
        let mut rng = Lcg(100 + seed);
        // Over the box on all sides, and crowded, so that neighbours share bricks of all levels.
        let points: Vec<DVec3> = (0..4000)
            .map(|i| {
                let q = rng.point(DVec3::splat(-2.0), f.lattice().extent() + 2.0);
                let q = if i % 2 == 0 { q.floor() } else { q };
                f.lattice().world_from_lattice.transform_point3(q)
            })
            .collect();
        let order = f.evaluation_order(&points);
        let mut seen = order.clone();
        seen.sort_unstable();
        assert!(
            seen.iter().copied().eq(0..points.len() as u32),
            "not a permutation"
        );
        let sorted: Vec<DVec3> = order.iter().map(|&i| points[i as usize]).collect();
        for batch in [points, sorted] {
            let mut out = vec![(0.0, DVec3::ZERO); batch.len()];
            f.values_gradients(&batch, &mut out);
            for (p, (v, g)) in batch.iter().zip(out) {
                let (value, gradient) = f.value_gradient(*p);
                assert_eq!(v.to_bits(), value.to_bits(), "{p}");
                assert_eq!(
                    g.to_array().map(f64::to_bits),
                    gradient.to_array().map(f64::to_bits)
                );
            }
        }
    }
}

#[test]
fn evaluation_order_keeps_the_points_of_a_cell_together() {
    let f = random_spline::<f64>(31, DAffine3::IDENTITY, [9, 6, 17]);
    let mut rng = Lcg(32);
    // Finest cells are a quarter wide; four points in the middle of each of 500, far from each other in the list.
    let middles: Vec<DVec3> = (0..500)
        .map(|_| (rng.point(DVec3::ZERO, f.lattice().extent()) * 4.0).floor() / 4.0 + 0.125)
        .collect();
    let points: Vec<DVec3> = (0..4).flat_map(|_| middles.iter().copied()).collect();
    let order = f.evaluation_order(&points);
    let runs = order
        .chunk_by(|&i, &j| points[i as usize] == points[j as usize])
        .count();
    let mut distinct: Vec<[u64; 3]> = middles.iter().map(|m| m.to_array().map(f64::to_bits)).collect();
    distinct.sort_unstable();
    distinct.dedup();
    // A cell of a coarser level holds several of the middles, in the order of the list.
    assert!(
        runs <= distinct.len() * 2,
        "{runs} runs of {} places",
        distinct.len()
    );
    for same in order.chunk_by(|&i, &j| points[i as usize] == points[j as usize]) {
        assert!(same.is_sorted(), "points of one cell keep their order");
    }
}

/// On oblique lattices with functions at every face: in the old box nothing changes but by rounding, outside the field goes on, and
/// in two steps the box is the same as in one.
fn grows<T: Real>() {
    for seed in 0..20 {
        let cells = [5 + seed as u32 % 4, 7, 9];
        let field = random_spline::<T>(seed, oblique(), cells);
        let [before, behind] = [[1, 0, 3], [0, 2, seed as u32]];
        let grown = field.grown(before, behind).unwrap();
        let growth = field.lattice().growth_to(grown.lattice());
        assert_eq!(growth, Some([before, behind]));
        assert!(grown.lattice().growth_to(field.lattice()).is_none());
        let old = field.coefficient_counts();
        assert_eq!(
            grown.coefficient_counts()[1..],
            old[1..],
            "finer functions only move"
        );
        let mut rng = Lcg(seed + 99);
        let bound = field.rounding_bound() + grown.rounding_bound();
        let extent = field.lattice().extent();
        for _ in 0..400 {
            let q = rng.point(DVec3::ZERO, extent);
            let p = oblique().transform_point3(q);
            let off = (field.value(p) - grown.value(p)).abs();
            assert!(off <= bound, "{q}: off by {off}, {bound} allowed");
        }
        let again = field
            .grown([1, 0, 0], [0; 3])
            .unwrap()
            .grown([0, 0, 3], behind)
            .unwrap();
        assert_eq!(again.lattice().cells, grown.lattice().cells);
        assert!(again.lattice().growth_to(grown.lattice()) == Some([[0; 3]; 2]));
    }
}

#[test]
fn a_box_that_grows_keeps_its_field() {
    grows::<f32>();
    grows::<f64>();
}
