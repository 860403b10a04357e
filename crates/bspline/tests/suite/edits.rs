//! Addition of coefficients to a hierarchy: the same field as built from scratch, all other bricks shared.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::common::Random;
use bspline::hierarchical::{
    BlockEdit, BrickEdit, BrickKey, Change, Corrections, DiffError, EditError, Lattice, LevelCorrections,
    LevelEdit,
};
use bspline::{Aabb, Csg, Field, HierarchicalSpline, KnotVector, Real, TensorSpline};
use glam::{DAffine3, DMat3, DVec3};

fn oblique() -> DAffine3 {
    let m = DMat3::from_cols(
        DVec3::new(1.5, 0.2, 0.0),
        DVec3::new(-0.3, 0.8, 0.1),
        DVec3::new(0.1, 0.0, -1.1),
    );
    DAffine3::from_mat3_translation(m, DVec3::new(10.0, -20.0, 5.0))
}

fn set<T: Real>(level: &mut LevelCorrections<T>, s: [u32; 3], delta: T) {
    let brick = level
        .entry(BrickKey(s.map(|s| s / 8)))
        .or_insert_with(|| Arc::new(Corrections::empty()));
    let slot = s.map(|s| s as usize % 8);
    let old = brick
        .get(64 * slot[0] + 8 * slot[1] + slot[2])
        .unwrap_or(T::zero());
    Arc::make_mut(brick).set(slot, old + delta);
}

/// Level 0 full, then ever fewer functions of two finer levels.
fn random_levels<T: Real>(lattice: &Lattice, random: &mut Random) -> Vec<LevelCorrections<T>> {
    let number = |random: &mut Random| T::from_f64(2.0 * random.unit() - 1.0);
    (0..3)
        .map(|level| {
            let n = lattice.cells_at(level).map(|n| n + 3);
            let mut bricks = BTreeMap::new();
            if level == 0 {
                for s in 0..n.iter().product() {
                    let s = [s / n[2] / n[1], s / n[2] % n[1], s % n[2]];
                    set(&mut bricks, s, number(random));
                }
            } else {
                // Crowded in one part of the box, so that some parents have all eight children.
                for _ in 0..600 {
                    let s = n.map(|n| (random.unit() * random.unit() * n as f64) as u32);
                    set(&mut bricks, s, number(random));
                }
            }
            bricks
        })
        .collect()
}

fn lattice() -> Lattice {
    Lattice {
        world_from_lattice: oblique(),
        cells: [17, 9, 12],
    }
}

fn random_edits<T: Real>(count: usize, levels: usize, random: &mut Random) -> Vec<LevelEdit<T>> {
    (0..count)
        .map(|_| {
            let level = random.below(levels);
            LevelEdit {
                level,
                function: lattice()
                    .cells_at(level)
                    .map(|n| random.below(n as usize + 3) as u32),
                delta: T::from_f64(2.0 * random.unit() - 1.0),
            }
        })
        .collect()
}

fn assert_same<T: Real>(a: &HierarchicalSpline<T>, b: &HierarchicalSpline<T>, random: &mut Random) {
    assert_eq!(a.level_count(), b.level_count());
    assert_eq!(a.sha256(), b.sha256());
    assert_eq!(a.brick_count(), b.brick_count());
    assert_eq!(a.coefficient_count(), b.coefficient_count());
    let region = a.lattice().world_box();
    let region = Aabb::new(region.min - 1.0, region.max + 1.0);
    for _ in 0..300 {
        let p = random.point(&region);
        let ((v, g), (w, h)) = (a.value_gradient(p), b.value_gradient(p));
        let bits = |v: f64, g: DVec3| [v, g.x, g.y, g.z].map(f64::to_bits);
        assert_eq!(bits(v, g), bits(w, h), "at {p}");
        let around = random.small_box(&region);
        assert_eq!(a.bounds(&around), b.bounds(&around));
    }
}

fn brick_edit(edit: &LevelEdit<f32>) -> BrickEdit<f32> {
    let mut add = Corrections::empty();
    add.set(edit.function.map(|f| f as usize % 8), edit.delta);
    BrickEdit {
        level: edit.level,
        key: BrickKey(edit.function.map(|f| f / 8)),
        add,
    }
}

/// A brick is changed packed where few of its functions change, else with a place for each, and sums of packed ones are
/// merged: three ways to one field.
#[test]
fn functions_added_one_by_one_many_at_once_and_by_the_brick_are_the_same() {
    for seed in 0..20 {
        let mut random = Random(seed);
        let levels = random_levels::<f32>(&lattice(), &mut random);
        let field = HierarchicalSpline::from_corrections(lattice(), 0.5, levels);
        let edits = random_edits::<f32>(300, 3, &mut random);
        let at_once = field.edited(&edits).unwrap();
        let alone = (edits.iter()).fold(field.clone(), |field, edit| field.edited(&[*edit]).unwrap());
        let bricks: Vec<_> = edits.iter().map(brick_edit).collect();
        assert_same(&at_once, &alone, &mut random);
        assert_same(&at_once, &field.added(&bricks).unwrap(), &mut random);
        let largest = LevelEdit {
            delta: f32::MAX,
            ..edits[0]
        };
        let error = field.added(&[brick_edit(&largest), brick_edit(&largest)]).err();
        let (level, function) = (largest.level, largest.function);
        assert!(
            matches!(error, Some(EditError::NotFinite { level: l, function: f, .. }) if l == level && f == function)
        );
    }
}

fn edits_are_those_built_from_scratch<T: Real>(seed: u64) {
    let mut random = Random(seed);
    let mut levels = random_levels::<T>(&lattice(), &mut random);
    let mut field = HierarchicalSpline::from_corrections(lattice(), 0.5, levels.clone());
    for round in 0..12 {
        // In the end deeper than the field was.
        let deepest = [3, 3, 4, 6][round / 3];
        let edits = random_edits::<T>(1 + random.below(20), deepest, &mut random);
        let before = field.clone();
        let sha = field.sha256();
        field = field.edited(&edits).unwrap();
        assert_eq!(before.sha256(), sha, "an edit leaves the version it starts from");
        for edit in &edits {
            while levels.len() <= edit.level {
                levels.push(BTreeMap::new());
            }
            set(&mut levels[edit.level], edit.function, edit.delta);
        }
        let built = HierarchicalSpline::from_corrections(lattice(), 0.5, levels.clone());
        assert_same(&field, &built, &mut random);
    }
}

#[test]
fn edits_are_those_built_from_scratch_in_both_precisions() {
    for seed in 0..3 {
        edits_are_those_built_from_scratch::<f32>(seed);
        edits_are_those_built_from_scratch::<f64>(seed);
    }
}

#[test]
fn a_local_edit_shares_all_other_bricks() {
    let lattice = Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [128, 128, 128],
    };
    let mut levels = vec![LevelCorrections::<f32>::new(); 2];
    for s in 0..32u32.pow(3) {
        set(
            &mut levels[1],
            [s / 1024 * 8, s / 32 % 32 * 8, s % 32 * 8].map(|s| s + 4),
            1.0,
        );
    }
    let field = HierarchicalSpline::from_corrections(lattice, 1.0, levels);
    assert_eq!(field.brick_count(), 16usize.pow(3) + 32usize.pow(3));
    let edit = |level, function| LevelEdit {
        level,
        function,
        delta: 0.25,
    };
    // Inside a brick; on a corner of eight; on the coarse level, whose change reaches its children.
    let fine = field.edited(&[edit(1, [100, 100, 100])]).unwrap();
    assert_eq!(fine.changed_bricks(&field).len(), 1);
    let corner = field.edited(&[edit(1, [97, 97, 97])]).unwrap();
    assert_eq!(corner.changed_bricks(&field).len(), 8);
    let coarse = field.edited(&[edit(0, [52, 52, 52])]).unwrap();
    assert_eq!(coarse.changed_bricks(&field).len(), 1 + 8);
    // A new level: its brick, and the one that covers its cells on the level between is there already.
    let deeper = field.edited(&[edit(2, [204, 204, 204])]).unwrap();
    assert_eq!(deeper.changed_bricks(&field).len(), 1);
    assert_eq!(deeper.level_count(), 3);
    // Undo is the old version; subtraction only comes near it.
    let back = fine
        .edited(&[LevelEdit {
            level: 1,
            function: [100; 3],
            delta: -0.25,
        }])
        .unwrap();
    assert_eq!(back.changed_bricks(&field).len(), 1);
    let boxes = fine.changed_boxes(&field, &field.lattice().world_box());
    assert_eq!(boxes.len(), 1);
    assert!(
        (boxes[0].min - 48.0).abs().max_element() < 1e-9 && (boxes[0].max - 52.0).abs().max_element() < 1e-9
    );
    assert!(
        field
            .changed_boxes(&field.clone(), &field.lattice().world_box())
            .is_empty()
    );
}

#[test]
fn nothing_changes_outside_the_changed_boxes() {
    let mut random = Random(5);
    let (mut inside, mut outside) = (0, 0);
    for seed in 0..30 {
        let levels = random_levels::<f32>(&lattice(), &mut random);
        let old = HierarchicalSpline::from_corrections(lattice(), 0.5, levels);
        let new = (0..1 + seed % 3).fold(old.clone(), |f, _| {
            let edits = random_edits(2, 3 + seed as usize % 2, &mut random);
            f.edited(&edits).unwrap()
        });
        let whole = old.lattice().world_box();
        let within = Aabb::new(whole.min - 5.0, whole.max + 5.0);
        let boxes = new.changed_boxes(&old, &within);
        let other_way = old.changed_boxes(&new, &within);
        assert_eq!(boxes, other_way);
        for _ in 0..2000 {
            let p = random.point(&within);
            let may_change = boxes.iter().any(|b| p.cmpge(b.min).all() && p.cmple(b.max).all());
            let differs = new.value_gradient(p) != old.value_gradient(p);
            assert!(may_change || !differs, "at {p}");
            inside += usize::from(may_change && differs);
            outside += usize::from(!may_change);
        }
    }
    assert!(inside > 1000 && outside > 10_000, "{inside} {outside}");
}

#[test]
fn coefficients_of_a_level_are_the_field_where_nothing_is_finer() {
    let mut random = Random(7);
    let levels = random_levels::<f64>(&lattice(), &mut random);
    for level in 0..3 {
        let field = HierarchicalSpline::from_corrections(lattice(), 0.5, levels.clone());
        let truncated = HierarchicalSpline::from_corrections(lattice(), 0.5, levels[..=level].to_vec());
        let n = lattice().cells_at(level);
        for _ in 0..20 {
            // Cells `first .. first + count`, read by the functions of the same numbers and three more.
            let first = n.map(|n| random.below(n as usize) as u32);
            let count: [usize; 3] = std::array::from_fn(|a| 1 + random.below((n[a] - first[a]) as usize));
            let coefficients = field
                .level_coefficients(level, first, count.map(|n| n + 3))
                .unwrap();
            let knots: [KnotVector; 3] = std::array::from_fn(|a| {
                let scale = 1.0 / (1u64 << level) as f64;
                let start = first[a] as f64 * scale;
                KnotVector::uniform(3, count[a], start, start + count[a] as f64 * scale).unwrap()
            });
            let patch = TensorSpline::new(knots, coefficients, oblique(), 0.5).unwrap();
            for _ in 0..50 {
                let q = DVec3::from_array(patch.knots().each_ref().map(|k| {
                    let [start, end] = k.domain();
                    start + (end - start) * random.unit()
                }));
                let p = oblique().transform_point3(q);
                assert!(
                    (patch.value(p) - truncated.value(p)).abs() < 1e-12,
                    "level {level} at {q}"
                );
            }
        }
    }
}

#[test]
fn bad_edits_are_refused_and_change_nothing() {
    let mut random = Random(9);
    let levels = random_levels::<f32>(&lattice(), &mut random);
    let field = HierarchicalSpline::from_corrections(lattice(), 0.5, levels);
    let edit = |level, function, delta| LevelEdit {
        level,
        function,
        delta,
    };
    let deep = field.edited(&[edit(21, [0; 3], 1.0)]).err();
    assert_eq!(deep, Some(EditError::Level { level: 21, max: 20 }));
    let beyond = field
        .edited(&[edit(0, [0, 0, 0], 1.0), edit(1, [37, 0, 0], 1.0)])
        .err();
    assert!(matches!(
        beyond,
        Some(EditError::Function {
            level: 1,
            count: [37, 21, 27],
            ..
        })
    ));
    for delta in [f32::NAN, f32::INFINITY] {
        let bad = field.edited(&[edit(0, [1; 3], delta)]).err();
        assert!(matches!(bad, Some(EditError::NotFinite { .. })));
    }
    let overflow = field
        .edited(&[edit(0, [1; 3], f32::MAX), edit(0, [1; 3], f32::MAX)])
        .err();
    assert!(matches!(overflow, Some(EditError::NotFinite { .. })));
    assert!(field.level_coefficients(0, [18, 0, 0], [3, 1, 1]).is_err());
    assert_eq!(field.level_coefficients(0, [0; 3], [0, 1, 1]), Ok(vec![]));
    assert_eq!(field.edited(&[]).unwrap().changed_bricks(&field).len(), 0);
}

/// All active functions with their coefficients: what edits are checked against.
type Model = BTreeMap<(usize, [u32; 3]), f32>;

fn built(model: &Model) -> HierarchicalSpline<f32> {
    let mut levels = vec![LevelCorrections::new(); 6];
    for ((level, function), value) in model {
        set(&mut levels[*level], *function, *value);
    }
    HierarchicalSpline::from_corrections(lattice(), 0.5, levels)
}

/// A block of up to 9 functions on each axis, added, set, refined (added zeros), or deactivated; done to the model too.
fn random_block(model: &mut Model, random: &mut Random) -> BlockEdit<f32> {
    let level = random.below(5);
    let count = lattice().cells_at(level).map(|n| n + 3);
    let first = count.map(|n| random.below(n as usize) as u32);
    let shape: [usize; 3] = std::array::from_fn(|a| 1 + random.below(9.min((count[a] - first[a]) as usize)));
    let kind = random.below(5);
    let mut values = Vec::new();
    for i in 0..shape.iter().product::<usize>() {
        let at = [i / shape[2] / shape[1], i / shape[2] % shape[1], i % shape[2]];
        let place = (level, std::array::from_fn(|a| first[a] + at[a] as u32));
        let value = match kind {
            2 => 0.0,
            _ => (2.0 * random.unit() - 1.0) as f32,
        };
        values.push(value);
        match kind {
            0 => drop(model.insert(place, value)),
            1 | 2 => *model.entry(place).or_insert(0.0) += value,
            _ => drop(model.remove(&place)),
        }
    }
    BlockEdit {
        level,
        first,
        shape,
        change: match kind {
            0 => Change::Set(values),
            1 | 2 => Change::Add(values),
            _ => Change::Deactivate,
        },
    }
}

#[test]
fn a_thousand_edits_are_undone_and_redone_by_their_differences() {
    let mut random = Random(11);
    let mut model = Model::new();
    let first = built(&model);
    let mut field = first.clone();
    let mut differences = Vec::new();
    let mut hashes = vec![first.sha256()];
    for round in 0..1000 {
        let next = field
            .edited_blocks(&[random_block(&mut model, &mut random)])
            .unwrap();
        differences.push(field.difference(&next).unwrap());
        if round % 25 == 0 {
            assert_same(&next, &built(&model), &mut random);
        }
        field = next;
        hashes.push(field.sha256());
    }
    assert!(field.coefficient_count() > 2000);
    let last = field.clone();
    for (diff, hash) in differences.iter().zip(&hashes).rev() {
        field = field.applied(&diff.reversed()).unwrap();
        assert_eq!(field.sha256(), *hash);
    }
    assert_same(&field, &first, &mut random);
    for (diff, hash) in differences.iter().zip(&hashes[1..]) {
        field = field.applied(diff).unwrap();
        assert_eq!(field.sha256(), *hash);
    }
    assert_same(&field, &last, &mut random);
    // The whole way at once, and with another program's field: nothing is shared, the hashes have been asked for.
    let loaded = built(&model);
    let whole = first.difference(&loaded).unwrap();
    assert_eq!(first.applied(&whole).unwrap().sha256(), last.sha256());
    loaded.sha256();
    assert_eq!(last.difference(&loaded).unwrap().bricks, []);
    // A difference fits the version that it starts from, and no other.
    let e = last.applied(&whole).unwrap_err();
    assert!(matches!(e, DiffError::Version { .. }), "{e}");
}

#[test]
fn deactivated_functions_take_their_bricks_with_them() {
    let mut random = Random(13);
    let field =
        HierarchicalSpline::from_corrections(lattice(), 0.5, random_levels::<f32>(&lattice(), &mut random));
    let level = field.level_count();
    let (first, shape) = ([30, 20, 25], [12, 9, 10]);
    let block = |change| BlockEdit {
        level,
        first,
        shape,
        change,
    };
    let zeros = vec![0.0; shape.iter().product()];
    let refined = field.edited_blocks(&[block(Change::Add(zeros))]).unwrap();
    assert_eq!(refined.level_count(), level + 1);
    // Knots inserted change nothing but rounding: 8 ulp of the largest total.
    let region = field.lattice().world_box();
    for _ in 0..2000 {
        let p = random.point(&region);
        let bound = field.rounding_bound() / 8.0;
        assert!((field.value(p) - refined.value(p)).abs() <= bound, "at {p}");
    }
    let back = refined.edited_blocks(&[block(Change::Deactivate)]).unwrap();
    assert_same(&back, &field, &mut random);
    assert_eq!(back.changed_bricks(&field).len(), 0);
    let wrong = field.edited_blocks(&[block(Change::Set(vec![1.0]))]).err();
    assert_eq!(wrong, Some(EditError::Length { shape, found: 1 }));
}

#[test]
fn a_patch_on_the_knots_of_a_level_is_an_edit() {
    let mut random = Random(17);
    let field =
        HierarchicalSpline::from_corrections(lattice(), 0.5, random_levels::<f64>(&lattice(), &mut random));
    let (level, first, cells) = (2usize, [20.0, 16.0, 30.0], [9, 8, 7]);
    let knots: [KnotVector; 3] = std::array::from_fn(|a| {
        let scale = 0.25;
        KnotVector::uniform(
            3,
            cells[a],
            first[a] * scale,
            (first[a] + cells[a] as f64) * scale,
        )
        .unwrap()
    });
    let shape = cells.map(|n| n + 3);
    let coefficients: Vec<f64> = (0..shape.iter().product::<usize>())
        .map(|i| {
            let at = [i / shape[2] / shape[1], i / shape[2] % shape[1], i % shape[2]];
            let is_rim = (0..3).any(|a| at[a] < 3 || at[a] + 3 >= shape[a]);
            if is_rim { 0.0 } else { random.unit() - 0.5 }
        })
        .collect();
    let patch = TensorSpline::new(knots.clone(), coefficients.clone(), oblique(), 0.0).unwrap();
    let edit = BlockEdit::adding(&patch, &lattice()).unwrap();
    assert_eq!(edit.level, level);
    let moved = field.edited_blocks(&[edit]).unwrap();
    let region = field.lattice().world_box();
    let mut most = 0.0f64;
    for _ in 0..3000 {
        let p = random.point(&region);
        let expected = field.value(p) + patch.value(p);
        assert!((moved.value(p) - expected).abs() < 1e-12, "at {p}");
        most = most.max(patch.value(p).abs());
    }
    assert!(most > 0.05, "{most}");
    let shifted = KnotVector::uniform(3, 9, 5.1, 5.1 + 9.0 * 0.25).unwrap();
    let [_, y, z] = knots;
    let off = TensorSpline::new([shifted, y, z], coefficients, oblique(), 0.0).unwrap();
    let refused = BlockEdit::adding(&off, &lattice()).unwrap_err();
    assert!(matches!(refused, EditError::NotDyadic { .. }), "{refused}");
}

#[test]
fn trees_know_what_has_changed_in_their_branches() {
    let mut random = Random(19);
    let levels = random_levels::<f32>(&lattice(), &mut random);
    let old = Arc::new(HierarchicalSpline::from_corrections(lattice(), 0.5, levels));
    let edit = LevelEdit {
        level: 2,
        function: [33, 30, 25],
        delta: 0.5,
    };
    let new = Arc::new(old.edited(&[edit]).unwrap());
    let whole = old.lattice().world_box();
    let within = Aabb::new(whole.min - 50.0, whole.max + 50.0);
    let turned = DAffine3::from_rotation_y(0.4);
    let tree = |field: &Arc<HierarchicalSpline<f32>>| -> Csg {
        let field: Arc<dyn Field> = field.clone();
        let moved = Arc::new(Csg::affine(field.clone(), turned).unwrap());
        let mean = Arc::new(Csg::sum(vec![(0.5, field.clone()), (0.5, moved)], 0.1).unwrap());
        let grown = Arc::new(Csg::grown(field, 0.2).unwrap());
        Csg::difference(mean, vec![grown], 0.0).unwrap()
    };
    let (before, after) = (tree(&old), tree(&new));
    let boxes = after.changed_boxes(&before, &within);
    let volume = |b: &Aabb| b.size().element_product();
    assert!(boxes.len() < 40 && boxes.iter().map(volume).sum::<f64>() < 0.3 * volume(&whole));
    let mut changed = 0;
    for _ in 0..20_000 {
        let p = random.point(&whole);
        let differs = after.value(p) != before.value(p);
        changed += usize::from(differs);
        let may = boxes.iter().any(|b| p.cmpge(b.min).all() && p.cmple(b.max).all());
        assert!(may || !differs, "at {p}");
    }
    assert!(changed > 20, "{changed}");
    // Other operations, other fields: everything may have changed.
    assert_eq!(after.changed_boxes(old.as_ref(), &within), [within]);
    let union = Csg::union(vec![old.clone(), new]).unwrap();
    assert_eq!(union.changed_boxes(&before, &within), [within]);
}
