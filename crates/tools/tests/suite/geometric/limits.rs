//! Regions and masks: outside of them nothing changes.

use bspline::Field;
use bspline::hierarchical::{BRICK, HierarchicalSpline};
use fitting::Control;
use glam::DVec3;
use tools::coefficients::support;

use super::{ISO, block, canvas, done, random, refused, stroke};

/// Strokes of every tool at random in regions and masks at random: no function whose support meets what is masked out
/// changes, and something else does.
#[test]
fn no_tool_changes_what_is_masked_out() {
    let field = block();
    let mut changes = 0;
    for seed in 0..27 {
        let mut draw = random(seed);
        let mut place = |from: f64, to: f64| [draw(8.0, 16.0), draw(8.0, 16.0), draw(from, to)];
        let (a, b, low) = (place(11.5, 12.5), place(11.5, 12.5), place(7.0, 9.0));
        let high = place(14.0, 17.0);
        let min: [f64; 3] = std::array::from_fn(|i| low[i].min(high[i]) - 1.0);
        let max: [f64; 3] = std::array::from_fn(|i| low[i].max(high[i]) + 2.0);
        let tools = [
            format!(
                "carve = {{ shape = {{ sphere = {{ radius = 2.0 }} }}, along = [{a:?}, {b:?}], blend = 0.5 }}"
            ),
            format!("add = {{ shape = {{ box = {{ size = [4.0, 3.0, 2.0] }} }}, along = [{a:?}] }}"),
            format!("move = {{ motion = {{ grab = {{ along = [{a:?}, {b:?}], radius = 4.0 }} }} }}"),
            format!("inflate = {{ along = [{a:?}, {b:?}], radius = 3.0, by = 0.6 }}"),
            format!("push = {{ along = [{a:?}, {b:?}], radius = 3.0, speed = 0.2, steps = 2 }}"),
            format!("refine = {{ along = [{a:?}, {b:?}], radius = 1.5 }}"),
            "cut = { region = { min = [9, 9, 10], max = [15, 15, 13] } }".into(),
            format!("simplify = {{ along = [{a:?}, {b:?}], radius = 3.0, tolerance = 0.2 }}"),
            format!(
                "sweep = {{ operation = 'add', shape = {{ box = {{ size = [2, 1, 1] }} }}, follow = true,
                along = {{ spline = {{ through = [{a:?}, {b:?}, [12, 12, 12]] }} }} }}"
            ),
        ];
        let tool = &tools[seed as usize % tools.len()];
        let box_of = format!("{{ min = {min:?}, max = {max:?} }}");
        let limits = [
            format!("within = {box_of}"),
            format!("mask = {{ boxes = [{box_of}], soft = 1.0 }}"),
            format!("mask = {{ boxes = [{box_of}], outside = true }}"),
        ];
        for (n, limit) in limits.iter().enumerate() {
            let text = format!("{limit}\n{tool}");
            let count = assert_kept(&field, &done(&field, &text), |lo, hi| match n {
                2 => (0..3).any(|i| hi[i] < min[i] || lo[i] > max[i]),
                _ => (0..3).all(|i| min[i] < lo[i] && hi[i] < max[i]),
            });
            changes += usize::from(count > 0);
        }
    }
    assert!(changes > 40, "{changes} of 81 strokes changed something");
}

/// Asserts that functions whose supports are not free kept their coefficients; gives the number of those that changed.
fn assert_kept(
    before: &HierarchicalSpline<f32>,
    after: &HierarchicalSpline<f32>,
    is_free: impl Fn([f64; 3], [f64; 3]) -> bool,
) -> usize {
    let mut count = 0;
    for brick in before.difference(after).unwrap().bricks {
        for slot in 0..BRICK * BRICK * BRICK {
            let value = |side: &Option<std::sync::Arc<bspline::hierarchical::Corrections<f32>>>| {
                side.as_ref().and_then(|c| c.get(slot))
            };
            if value(&brick.old) == value(&brick.new) {
                continue;
            }
            count += 1;
            let at = [slot / 64, slot / 8 % 8, slot % 8];
            let function = std::array::from_fn(|a| brick.key.0[a] * 8 + at[a] as u32);
            let (_, b) = support(before, brick.level, function);
            // But for what boxes are widened by.
            let (lo, hi) = ((b.min + 1e-9).to_array(), (b.max - 1e-9).to_array());
            assert!(
                is_free(lo, hi),
                "the function with support {lo:?} to {hi:?} changed"
            );
        }
    }
    count
}

/// Paint keeps to a mask as the field does.
#[test]
fn paint_keeps_to_the_mask() {
    let text = "mask = { boxes = [{ min = [6, 6, 6], max = [12, 18, 18] }] }
        paint = { layer = \"mass\", brush = { value = 3.0, along = [[12, 12, 12]], radius = 5.0, fade = 0.0 } }";
    let (left, _) = stroke(text)
        .apply(canvas(&block()), &mut Control::default())
        .unwrap();
    let layer = left.layers.values().next().unwrap();
    let at = |x: f64| layer.at(DVec3::new(x, 12.0, 12.0));
    assert_eq!([at(12.0), at(14.0), at(16.5)], [0.0; 3]);
    assert_eq!(at(9.0), 2.0);
}

/// With a soft mask the effect grows from nothing at the border to all of it.
#[test]
fn a_soft_mask_fades() {
    let field = block();
    let limit = "mask = { boxes = [{ min = [6, 2, 2], max = [22, 22, 22] }], soft = 8.0 }";
    let tool = "add = { shape = { box = { size = [18.0, 8.0, 2.0] } }, along = [[12, 12, 12.5]], finer = 2 }";
    let changed = done(
        &field,
        &format!(
            "{limit}
{tool}"
        ),
    );
    let rise = |x: f64| changed.value(DVec3::new(x, 12.0, 13.0)) - field.value(DVec3::new(x, 12.0, 13.0));
    assert_eq!(rise(5.9), 0.0);
    let all: Vec<f64> = [7.0, 9.0, 10.0, 11.0, 13.5].map(rise).to_vec();
    assert!(all.is_sorted_by(|a, b| a < b), "{all:?}");
    assert!((rise(10.0) / rise(14.0) - 0.5).abs() < 0.05, "{all:?}");
}

#[test]
fn limits_that_make_no_sense_are_refused() {
    let tool = "carve = { shape = { sphere = { radius = 2.0 } }, along = [[12, 12, 12]] }";
    for (limit, why) in [
        ("within = { min = [9, 9, 9], max = [9, 12, 12] }", "no size"),
        ("within = { min = [1, 1, 1], max = [2, 2, 2] }", "widen within"),
        ("mask = { boxes = [] }", "no box"),
        ("mask = { }", "exactly one"),
        (
            "mask = { boxes = [{ min = [9, 9, 9], max = [8, 12, 12] }] }",
            "no size",
        ),
        ("mask = { object = \"none\" }", "none"),
    ] {
        let error = refused(
            &block(),
            &format!(
                "{limit}
{tool}"
            ),
        );
        assert!(error.contains(why), "{limit}: {error}");
    }
}

/// Where a scan has cut the solid off, tools work across the face, and say that what goes on beyond it is cut off too.
#[test]
fn tools_work_across_faces_that_cut_the_solid() {
    let field = block();
    for (text, at, is_wider) in [
        (
            "inflate = { along = [[0, 12, 12]], radius = 4, by = 1.5 }",
            [0.2, 12.0, 13.0],
            true,
        ),
        (
            "add = { along = [[24, 12, 12.5]], shape = { sphere = { radius = 2 } } }",
            [23.8, 12.0, 14.0],
            true,
        ),
        (
            "move = { motion = { grab = { along = [[12, 0, 12], [12, 0, 14]], radius = 4, rigid = 1 } } }",
            [12.0, 0.2, 13.5],
            true,
        ),
        (
            "smooth = { along = [[0, 12, 12]], radius = 3, level = 2 }",
            [0.2, 12.0, 11.5],
            false,
        ),
        (
            "carve = { along = [[24, 12, 12]], shape = { sphere = { radius = 2 } } }",
            [23.8, 12.0, 9.5],
            false,
        ),
    ] {
        let (left, notes) = stroke(text)
            .apply(canvas(&field), &mut Control::default())
            .unwrap();
        assert!(left.field.value(DVec3::from_array(at)) > ISO, "{text}");
        assert_eq!(left.field.lattice(), field.lattice(), "{text}");
        assert_eq!(
            notes.iter().any(|note| note.contains("cut off")),
            is_wider,
            "{text}: {notes:?}"
        );
    }
    // Its upper face is clear of it, so the box grows there.
    let tower = "add = { along = [[12, 12, 12], [12, 12, 25]], shape = { sphere = { radius = 2 } } }";
    let (left, notes) = stroke(tower)
        .apply(canvas(&field), &mut Control::default())
        .unwrap();
    assert!(
        left.field.value(DVec3::new(12.0, 12.0, 26.5)) > ISO && notes[0].contains("grown"),
        "{notes:?}"
    );
}
