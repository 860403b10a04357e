//! Brushes: smoothing, swelling, and knots put in and taken out.

use bspline::Field;
use bspline::hierarchical::{BlockEdit, Change, HierarchicalSpline, Lattice};
use fitting::Control;
use glam::{DAffine3, DVec3};
use tools::canvas::Canvas;

use super::{ISO, SLOPE, block, canvas, done, random, refused, stroke, volume};

const WAY: &str = "along = [[8, 12, 12], [16, 12, 12]]";

/// A block with bumps and dents, some of them on finer knots.
fn rough() -> HierarchicalSpline<f32> {
    let mut draw = random(5);
    let mut field = block();
    for n in 0..6 {
        let at = [draw(7.0, 17.0), draw(9.0, 15.0), draw(11.7, 12.3)];
        let verb = if n % 2 == 0 { "carve" } else { "add" };
        field = done(
            &field,
            &format!("{verb} = {{ shape = {{ sphere = {{ radius = 0.8 }} }}, along = [{at:?}] }}"),
        );
    }
    field
}

/// Mean square height of the surface about `z = 12` along the middle of the brush's way.
fn roughness(field: &HierarchicalSpline<f32>) -> f64 {
    let heights: Vec<f64> = (0..80)
        .map(|i| {
            let p = DVec3::new(9.0 + 6.0 * f64::from(i) / 79.0, 12.0, 12.0);
            (field.value(p) - ISO) / SLOPE
        })
        .collect();
    let mean = heights.iter().sum::<f64>() / 80.0;
    heights.iter().map(|h| (h - mean).powi(2)).sum::<f64>() / 80.0
}

#[test]
fn smoothing_evens_out_and_leaves_what_is_linear() {
    let flat = block();
    for level in [1, 4, 10] {
        for keep in [false, true] {
            let text = format!("smooth = {{ {WAY}, radius = 3.0, level = {level}, keep-volume = {keep} }}");
            assert_eq!(done(&flat, &text).sha256(), flat.sha256(), "{text}");
        }
    }
    let rough = rough();
    let mut last = roughness(&rough);
    for level in [1, 3, 8] {
        let text = format!("smooth = {{ {WAY}, radius = 4.0, level = {level} }}");
        let smooth = done(&rough, &text);
        let now = roughness(&smooth);
        assert!(now < last, "level {level}: {now} of {last}");
        // The detail is gone, and so are its functions.
        assert!(
            smooth.coefficient_count() < rough.coefficient_count(),
            "level {level}"
        );
        last = now;
    }
    assert!(last < 0.2 * roughness(&rough), "{last}");
}

/// A ball of 300 above its surface, with noise on the finer of two levels, as a scan has it.
fn scanned(seed: u64) -> HierarchicalSpline<f32> {
    let lattice = Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [24; 3],
    };
    let ball = |p: DVec3| 300.0 * ((8.0 - p.distance(DVec3::splat(12.0))) / 0.8).tanh() + ISO;
    let ball = HierarchicalSpline::schoenberg(lattice, 300.0, ball).unwrap();
    let mut draw = random(seed);
    let noise = BlockEdit {
        level: 1,
        first: [0; 3],
        shape: [51; 3],
        change: Change::Add((0..51 * 51 * 51).map(|_| draw(-25.0, 25.0) as f32).collect()),
    };
    ball.edited_blocks(&[noise]).unwrap()
}

/// What a stroke leaves of it; its fit left 20.
fn on_scan(scan: &HierarchicalSpline<f32>, text: &str) -> HierarchicalSpline<f32> {
    let mut canvas = Canvas::alone(scan.clone(), ISO, 1);
    canvas.density = Some(20.0);
    let left = stroke(text).apply(canvas, &mut Control::default());
    left.unwrap_or_else(|e| panic!("{text}: {e}")).0.field
}

/// Values of a cube about a place, one apart.
fn values(field: &HierarchicalSpline<f32>, at: DVec3, half: f64) -> Vec<f64> {
    let side = |n: usize| n as f64 - half;
    let count = 2 * half as usize + 1;
    let places = (0..count * count * count)
        .map(|n| at + DVec3::new(side(n / count / count), side(n / count % count), side(n % count)));
    places.map(|p| field.value(p)).collect()
}

fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
    (square / values.len() as f64).sqrt()
}

/// The tolerance of a scan's fit is as large as its noise: what is written to within that stays noisy.
#[test]
fn smoothing_takes_the_noise_of_a_scan_away() {
    for seed in 0..5 {
        let scan = scanned(seed);
        for (level, keep, most) in [(1, false, 0.45), (2, false, 0.25), (1, true, 0.7), (2, true, 0.4)] {
            let text = format!(
                "smooth = {{ along = [[12, 12, 12]], radius = 8, level = {level}, keep-volume = {keep} }}"
            );
            let inside = |field| deviation(&values(field, DVec3::splat(12.0), 2.0));
            let (before, after) = (inside(&scan), inside(&on_scan(&scan, &text)));
            assert!(after < most * before, "{seed} {text}: {after} of {before}");
        }
    }
}

/// Beyond a face a mean has nothing to go by: straight lines from the last two functions grew a hundredfold in five strokes.
#[test]
fn smoothing_at_a_corner_of_the_box_as_often_as_one_likes_grows_nothing() {
    for seed in 0..3 {
        let scan = scanned(seed);
        let range = |field: &HierarchicalSpline<f32>| {
            let all = values(field, DVec3::splat(2.0), 2.0);
            all.into_iter()
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
                    [low.min(v), high.max(v)]
                })
        };
        let [low, high] = range(&scan);
        for (level, keep) in [(1, false), (2, true), (5, false), (5, true), (10, false)] {
            let text = format!(
                "smooth = {{ along = [[0, 0, 0]], radius = 9, level = {level}, keep-volume = {keep} }}"
            );
            let mut field = scan.clone();
            for n in 0..6 {
                field = on_scan(&field, &text);
                let [least, most] = range(&field);
                assert!(
                    low <= least && most <= high,
                    "{seed} {text}, stroke {n}: {least} {most}"
                );
            }
            assert!(
                deviation(&values(&field, DVec3::splat(2.0), 2.0))
                    < 0.6 * deviation(&values(&scan, DVec3::splat(2.0), 2.0)),
                "{text}"
            );
        }
    }
}

/// A pore asks for knots of a hundredth: means over those of the whole brush took minutes and gigabytes.
#[test]
fn brushes_over_a_pore_cost_what_it_holds() {
    let field = block();
    let pore = done(
        &field,
        "carve = { shape = { cylinder = { axis = [0, 0, 1], radius = 0.02, height = 1 } }, along = [[12.5, 12, 12]] }",
    );
    assert!(pore.level_count() > 4, "{}", pore.level_count());
    for (text, height) in [
        ("smooth = { along = [[12, 12, 12]], radius = 6, level = 2 }", 12.0),
        (
            "smooth = { along = [[12, 12, 12]], radius = 6, level = 1, keep-volume = true }",
            12.0,
        ),
        ("inflate = { along = [[12, 12, 12]], radius = 6, by = 2 }", 14.0),
    ] {
        let plain = done(&field, text);
        let mut control = Control {
            memory_limit: Some(64 << 20),
            ..Default::default()
        };
        let left = stroke(text).apply(canvas(&pore), &mut control);
        let left = left.unwrap_or_else(|e| panic!("{text}: {e}")).0.field;
        for p in [[11.0, 12.0], [12.5, 13.0], [12.5, 12.0]].map(|[x, y]| DVec3::new(x, y, height)) {
            let off = (left.value(p) - plain.value(p)) / SLOPE;
            assert!(off.abs() < 0.05, "{text} {p}: {off}");
        }
    }
}

/// A mean draws a bump in; the kernel that keeps what is quadratic hardly does.
#[test]
fn smoothing_can_keep_the_volume() {
    // A distance everywhere: beside what tools have made the density only has the right sign.
    let middle = DVec3::splat(12.0);
    let ball = |p: DVec3| SLOPE * (4.0 - p.distance(middle)) + ISO;
    let ball = HierarchicalSpline::schoenberg(*block().lattice(), SLOPE, ball).unwrap();
    let lost = |keep: bool| {
        let text =
            format!("smooth = {{ along = [[12, 12, 14]], radius = 12.0, level = 2, keep-volume = {keep} }}");
        let smooth = done(&ball, &text);
        let top = DVec3::new(12.0, 12.0, 16.0);
        (ball.value(top) - smooth.value(top)) / SLOPE
    };
    let (mean, kept) = (lost(false), lost(true));
    // The density of a ball falls evenly, so its mean is lower by σ²/R: σ is 1, R 4.
    assert!((0.2..0.3).contains(&mean), "{mean}");
    assert!(kept.abs() < 0.2 * mean, "{kept} of {mean}");
}

#[test]
fn inflating_adds_and_deflating_takes() {
    let field = rough();
    let mut last = f64::NEG_INFINITY;
    for by in [-1.0, -0.5, -0.1, 0.0, 0.1, 0.5, 1.0] {
        let left = done(&field, &format!("inflate = {{ {WAY}, radius = 3.0, by = {by} }}"));
        let now = volume(&left);
        assert!(now > last, "{by}: {now} after {last}");
        last = now;
    }
    // A plane goes up by what was asked.
    let left = done(
        &block(),
        &format!("inflate = {{ {WAY}, radius = 3.0, by = 0.7 }}"),
    );
    let top = left.value(DVec3::new(12.0, 12.0, 12.7)) - ISO;
    assert!(top.abs() < 0.02 * SLOPE, "{top}");
}

/// The edge of a scan is a few voxels wide, and beside it there is noise only.
#[test]
fn inflating_moves_the_edge_of_a_scan_by_what_was_asked() {
    let middle = DVec3::new(12.0, 12.0, 4.0);
    let ways = [
        [0.0, 0.0, 1.0],
        [0.2, 0.0, 1.0],
        [0.0, -0.2, 1.0],
        [-0.15, 0.15, 1.0],
    ];
    for seed in 0..3 {
        let noise = std::cell::RefCell::new(random(seed));
        let inside = |p: DVec3| ((8.0 - p.distance(middle)) / 0.8).tanh();
        let scan = |p: DVec3| 300.0 * inside(p) + ISO + noise.borrow_mut()(-15.0, 15.0);
        let scan = HierarchicalSpline::schoenberg(*block().lattice(), 300.0, scan).unwrap();
        for by in [-3.0, -1.5, -0.4, 0.4, 1.5, 3.0] {
            let text = format!("inflate = {{ along = [[12, 12, 12]], radius = 7.5, by = {by} }}");
            let left = done(&scan, &text);
            for way in ways {
                let way = DVec3::from(way).normalize();
                let radius = |field: &HierarchicalSpline<f32>| {
                    let steps = (0..1200).rev().map(|n| 0.01 * f64::from(n));
                    let mut met = steps.filter(|r| field.value(middle + *r * way) > ISO);
                    met.next().unwrap()
                };
                let moved = radius(&left) - radius(&scan);
                assert!(
                    (moved - by).abs() <= 0.05 * by.abs() + 0.05,
                    "{text} {way}: {moved}"
                );
            }
        }
    }
}

/// What lies deeper than half of a plate is its other side: in one step that came through as a slot of air, 0.5 either way.
#[test]
fn inflating_a_plate_by_more_than_half_of_it_leaves_no_slot() {
    let plate = |p: DVec3| 300.0 * ((1.5 - (p.z - 12.0).abs()) / 0.8).tanh() + ISO;
    let plate = HierarchicalSpline::schoenberg(*block().lattice(), 300.0, plate).unwrap();
    let at = |z: f64| DVec3::new(12.0, 12.0, 12.0 + z);
    for by in [1.0, 2.0, 3.0] {
        let left = done(
            &plate,
            &format!("inflate = {{ along = [[12, 12, 12]], radius = 8, by = {by} }}"),
        );
        let heights = |field: &HierarchicalSpline<f32>| {
            let solid = (-800..800)
                .map(|n| 0.01 * f64::from(n))
                .filter(|z| field.value(at(*z)) > ISO);
            let solid: Vec<f64> = solid.collect();
            (solid[0], solid[solid.len() - 1], solid.len())
        };
        let ((low, high, count), before) = (heights(&left), heights(&plate));
        assert_eq!(
            count,
            ((high - low) * 100.0).round() as usize + 1,
            "{by}: a slot from {low} to {high}"
        );
        let moved = 0.5 * (high - low) - 0.5 * (before.1 - before.0);
        assert!((moved - by).abs() <= 0.1 * by, "{by}: {moved}");
    }
}

/// Knots put in change nothing; with the tolerance of rounding they go again.
#[test]
fn knots_come_and_go_without_a_change() {
    let field = rough();
    let fine = done(&field, &format!("refine = {{ {WAY}, radius = 1.5, finer = 1 }}"));
    assert_eq!(fine.level_count(), field.level_count() + 1);
    assert!(fine.coefficient_count() > field.coefficient_count() + 10_000);
    let mut draw = random(6);
    let largest = 12.0 * SLOPE + ISO;
    for _ in 0..3000 {
        let p = DVec3::new(draw(5.0, 19.0), draw(9.0, 15.0), draw(9.0, 15.0));
        let off = (fine.value(p) - field.value(p)).abs() / largest;
        assert!(off <= 1e-6, "{p}: {off}");
    }
    let slim = done(
        &fine,
        &format!("simplify = {{ {WAY}, radius = 4.0, tolerance = 1e-6 }}"),
    );
    assert!(slim.coefficient_count() <= field.coefficient_count());
    for _ in 0..3000 {
        let p = DVec3::new(draw(5.0, 19.0), draw(9.0, 15.0), draw(9.0, 15.0));
        assert!((slim.value(p) - field.value(p)).abs() / largest <= 1e-6, "{p}");
    }
    // A coarser field within the tolerance asked for.
    let coarse = done(
        &field,
        &format!("simplify = {{ {WAY}, radius = 6.0, tolerance = 0.05 }}"),
    );
    assert!(coarse.coefficient_count() < slim.coefficient_count());
    for _ in 0..3000 {
        let p = DVec3::new(draw(5.0, 19.0), draw(9.0, 15.0), draw(9.0, 15.0));
        assert!((coarse.value(p) - field.value(p)).abs() <= 0.05 * SLOPE, "{p}");
    }
}

/// Edits of the coarse levels leave what the finer ones add.
#[test]
fn coarse_edits_keep_the_fine_detail() {
    let field = rough();
    let left = done(
        &field,
        "coarse = 0\nmove = { motion = { grab = { along = [[12, 12, 12], [12, 12, 14]], radius = 6.0 } } }",
    );
    for level in 1..field.level_count() {
        assert_eq!(left.corrections(level), field.corrections(level));
    }
    let lifted = block();
    let lifted = done(
        &lifted,
        "coarse = 0\nmove = { motion = { grab = { along = [[12, 12, 12], [12, 12, 14]], radius = 6.0 } } }",
    );
    let p = DVec3::new(12.0, 12.0, 13.5);
    let (fine, plain) = (left.value(p) - field.value(p), lifted.value(p) - block().value(p));
    assert!((fine - plain).abs() < 0.3 * plain, "{fine} for {plain}");
}

#[test]
fn brushes_that_make_no_sense_are_refused() {
    let field = block();
    for (text, why) in [
        ("smooth = { along = [], radius = 1, level = 1 }", "no place"),
        (
            "smooth = { along = [[9, 9, 9]], radius = 1, level = 11 }",
            "1 to 10",
        ),
        (
            "smooth = { along = [[99, 9, 9]], radius = 1, level = 1 }",
            "the field from",
        ),
        (
            "inflate = { along = [[9, 9, 9]], radius = 1, by = 2 }",
            "wider brush",
        ),
        (
            "refine = { along = [[9, 9, 9]], radius = 1, finer = 0 }",
            "write 1 to",
        ),
        (
            "refine = { along = [[9, 9, 9]], radius = 9, finer = 9 }",
            "smaller",
        ),
        ("refine = { along = [[-9, 9, 9]], radius = 1 }", "the field from"),
        (
            "coarse = 9\nsmooth = { along = [[9, 9, 9]], radius = 1, level = 1 }",
            "levels 0 to 0",
        ),
    ] {
        let error = refused(&field, text);
        assert!(error.contains(why), "{text}: {error}");
    }
}
