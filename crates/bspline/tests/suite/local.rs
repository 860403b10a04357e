//! Local fields: the field's own answers, without allocating.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::common::{Options, Random, field_conformance};
use bspline::hierarchical::{BlockEdit, BrickKey, Change, Corrections, Lattice, LocalFields, Motion};
use bspline::{Aabb, Field, HierarchicalSpline};
use glam::{DAffine3, DMat3, DVec3};

/// Level 0 full; two finer ones in part of the box.
fn field() -> HierarchicalSpline<f32> {
    let lattice = Lattice {
        world_from_lattice: DAffine3 {
            matrix3: DMat3::from_cols(
                DVec3::new(1.5, 0.2, 0.0),
                DVec3::new(-0.3, 0.8, 0.1),
                DVec3::new(0.1, 0.0, -1.1),
            ),
            translation: DVec3::new(3.0, -2.0, 5.0),
        },
        cells: [40, 30, 35],
    };
    let mut random = Random(3);
    let levels = (0..3).map(|level| {
        let mut bricks: BTreeMap<BrickKey, Corrections<f32>> = BTreeMap::new();
        let n = lattice.cells_at(level).map(|n| n as usize + 3);
        let mut set = |s: [usize; 3], c: f64| {
            let brick = bricks.entry(BrickKey::of(s.map(|s| s as u32)));
            let brick = brick.or_insert_with(Corrections::empty);
            brick.set(s.map(|s| s % 8), c as f32);
        };
        if level == 0 {
            for i in 0..n.iter().product() {
                set(
                    [i / n[2] / n[1], i / n[2] % n[1], i % n[2]],
                    2.0 * random.unit() - 1.0,
                );
            }
        } else {
            for _ in 0..4000 {
                set(n.map(|n| n / 3 + random.below(n / 4)), 0.5 * random.unit());
            }
        }
        bricks.into_iter().map(|(k, c)| (k, Arc::new(c))).collect()
    });
    HierarchicalSpline::from_corrections(lattice, 1.0, levels.collect())
}

/// A world box about lattice point `q`, which may lie outside, `r` level-0 cells to each side.
fn around(field: &HierarchicalSpline<f32>, q: DVec3, r: f64) -> Aabb {
    Aabb::new(q - r, q + r).transformed(&field.lattice().world_from_lattice)
}

#[test]
fn local_fields_answer_with_the_bits_of_the_field() {
    let field = field();
    let mut random = Random(4);
    let whole = field.lattice().world_box();
    let (mut covered, mut deep) = (0, 0);
    for i in 0..60 {
        let middle = random.point(&Aabb::new(DVec3::splat(-5.0), DVec3::splat(45.0)));
        let reach = [0.2, 1.0, 4.0, 12.0, 40.0][i % 5];
        let place = around(&field, middle, reach);
        let local = field.local(&place);
        deep += usize::from(local.covers(&around(&field, middle, 0.3)));
        for _ in 0..300 {
            let p = if random.unit() < 0.5 {
                random.point(&place)
            } else {
                random.point(&whole)
            };
            assert_eq!(local.value(p).to_bits(), field.value(p).to_bits());
            assert_eq!(local.value_gradient(p), field.value_gradient(p));
            covered += usize::from(local.covers(&Aabb::new(p, p)));
        }
        for _ in 0..30 {
            let b = random.small_box(&place);
            // From the root down coarser bricks add to what rounding may do.
            let (own, whole) = (local.bounds(&b), field.bounds(&b));
            assert!(whole.lo <= own.lo && own.hi <= whole.hi, "{own:?} {whole:?}");
            assert_eq!(local.gradient_bounds(&b), field.gradient_bounds(&b));
            assert_eq!(local.bounds_along(b.min, b.max), field.bounds_along(b.min, b.max));
        }
    }
    assert!(
        covered > 5000 && deep > 30,
        "{covered} points in tables, {deep} tables"
    );
}

#[test]
fn local_fields_neither_allocate_nor_free() {
    let field = field();
    let middle = DVec3::new(16.0, 12.0, 14.0);
    let place = around(&field, middle, 1.5);
    let still = field.local(&place);
    let motion = Motion::new(
        2,
        [60, 44, 52],
        [8; 3],
        [vec![0.0; 512], vec![0.1; 512]],
        [1.0, 1.5],
    );
    let moving = field.local(&place).with_motion(motion);
    let mut random = Random(6);
    let boxes: Vec<Aabb> = (0..200).map(|_| random.small_box(&place)).collect();
    let mut kept = LocalFields::default();
    let handed_out = kept.share(field.local(&place));
    let count = allocation_counter::measure(|| {
        for local in [&still, &moving] {
            for b in &boxes {
                std::hint::black_box((
                    local.value(b.min),
                    local.value_gradient_rate(b.max, 1.25),
                    local.bounds(b),
                    local.gradient_bounds(b),
                    local.bounds_along(b.min, b.max),
                ));
            }
        }
        drop(handed_out);
    });
    assert_eq!((count.count_total, count.count_current), (0, 0));
    assert_eq!(kept.free(), 0);
}

#[test]
fn local_fields_conform_with_and_without_a_motion() {
    let field = field();
    let place = around(&field, DVec3::new(15.0, 11.0, 13.0), 2.0);
    let mut random = Random(8);
    let mut state = || {
        (0..9 * 8 * 7)
            .map(|_| (random.unit() - 0.5) as f32)
            .collect::<Vec<_>>()
    };
    let motion = Motion::new(2, [56, 42, 50], [9, 8, 7], [state(), state()], [0.0, 1.0]);
    let options = Options {
        sound_boxes: 5_000,
        tight_boxes: 200,
        width_limits: [8.0, 60.0],
        value_tolerance: 3e-6,
        step: 1e-3,
        difference_tolerance: 1e-2,
        rough_share: 5e-2,
        ..Options::default()
    };
    field_conformance("still", &field.local(&place), &place, &options);
    // Its bounds are those of the whole motion, the ranges that they are compared with those of its end.
    let options = Options {
        width_limits: [8.0, f64::INFINITY],
        ..options
    };
    field_conformance(
        "moving",
        &field.local(&place).with_motion(motion),
        &place,
        &options,
    );
}

#[test]
fn a_motion_goes_from_its_first_state_to_its_last() {
    let field = field();
    let mut random = Random(9);
    let (level, first, shape) = (2, [56, 42, 50], [9, 8, 7]);
    let mut state = || {
        (0..9 * 8 * 7)
            .map(|_| (random.unit() - 0.5) as f32)
            .collect::<Vec<_>>()
    };
    let states = [state(), state()];
    let at = |share: f32| {
        let values = states[0]
            .iter()
            .zip(&states[1])
            .map(|(a, b)| a * (1.0 - share) + b * share);
        let change = Change::Add(values.collect());
        let edit = BlockEdit {
            level,
            first,
            shape,
            change,
        };
        field.edited_blocks(&[edit]).unwrap()
    };
    let place = around(&field, DVec3::new(15.0, 11.0, 13.0), 2.0);
    let motion = Motion::new(level, first, shape, states.clone(), [10.0, 14.0]);
    assert_eq!(
        field
            .edited(&motion.edits().collect::<Vec<_>>())
            .unwrap()
            .sha256(),
        at(1.0).sha256()
    );
    let moving = field.local(&place).with_motion(motion);
    let mut fastest = 0.0f64;
    for (t, share) in [
        (9.0, 0.0),
        (10.0, 0.0),
        (11.0, 0.25),
        (13.0, 0.75),
        (14.0, 1.0),
        (20.0, 1.0),
    ] {
        let then = at(share);
        for _ in 0..500 {
            let p = random.point(&place);
            let (value, gradient, rate) = moving.value_gradient_rate(p, t);
            let (v, g) = then.value_gradient(p);
            assert!(
                (value - v).abs() < 4.0 * then.rounding_bound(),
                "{value} {v} at {p}, {t}"
            );
            assert!((gradient - g).length() < 1e-3, "{gradient} {g} at {p}, {t}");
            let [early, late] = [11.5, 12.5].map(|t| moving.value_gradient_rate(p, t).0);
            let expected = late - early;
            let expected = if (10.0..=14.0).contains(&t) { expected } else { 0.0 };
            assert!((rate - expected).abs() < 1e-6, "{rate} {expected}");
            fastest = fastest.max(rate.abs());
        }
    }
    assert!(fastest > 0.01, "{fastest}");
}
