//! Strokes that only part of space is open to.

use super::*;
use bspline::Aabb;
use tools::coefficients::{changed, support};
use tools::force::Holding;
use tools::limits::{Limits, Mask};

/// As many samples, and about as many solves; nothing beyond the border is touched, and nothing swells at it.
#[test]
fn strokes_across_a_border_of_limits_cost_what_others_do() {
    let field = block::<f32>(24);
    let whole = field.lattice().world_box();
    for mask in [
        "boxes = [{ min = [1, 1, 1], max = [12.6, 23, 23] }]",
        "formula = '20.3 - x - 0.6*y'",
        "formula = '(x - 12)^2 + (y - 9)^2 - 6'",
    ] {
        let mask: Mask = toml::from_str(mask).unwrap();
        let limits = Limits::new(None, Some(&mask), &Default::default(), &whole).unwrap();
        let is_free = |p: DVec3, room: f64| limits.is_free(&Aabb::new(p - room, p + room));
        let holding = Holding {
            iso: ISO,
            holds: Vec::new(),
            limits: limits.clone(),
        };
        for by_hand in [false, true] {
            let d = 1.2;
            let done = |held: Option<&Holding>| {
                let tool = pull(&format!(
                    "along = [[12, 12, 12]]\ndisc = 1.8\n{}radius = {R}",
                    if by_hand { "" } else { "lift = 1.2\n" }
                ));
                let stroke = match by_hand {
                    true => tool.hold(&field, ISO),
                    false => tool.begin(&field, ISO),
                };
                let mut stroke = stroke.unwrap();
                if let Some(held) = held {
                    stroke = stroke.held(held).unwrap();
                }
                if by_hand {
                    for i in 1..=6 {
                        stroke.pose(d * f64::from(i) / 6.0 * DVec3::Z).unwrap();
                        stroke.step().unwrap();
                    }
                    stroke.let_go();
                }
                finished(stroke)
            };
            let (_, free) = done(None);
            let (after, held) = done(Some(&holding));
            let what = format!("{mask:?} {by_hand}: {held:?} {free:?}");
            assert!(held.samples <= free.samples, "{what}");
            assert!(held.solves <= 3 * free.solves, "{what}");
            let functions = changed(&field, &after).unwrap();
            let mut border = 0;
            for (level, function) in functions.into_keys() {
                border += usize::from(level > 0);
                assert!(limits.is_free(&support(&field, level, function).1), "{what}");
            }
            let mut inside = 0;
            for i in 0..40 {
                for j in 0..40 {
                    let [x, y] = [i, j].map(|n| 6.05 + 0.3 * f64::from(n));
                    // Nothing swells at the border; what lies in the disc, away from it, arrives.
                    let p = DVec3::new(x, y, 12.0);
                    let share = height(&after, x, y) / d;
                    assert!((-0.05..1.05).contains(&share), "{what} {p}: {share}");
                    if is_free(p, 1.5) && (p - 12.0).length() < 1.7 {
                        inside += 1;
                        assert!((share - 1.0).abs() < 0.025, "{what} {p}: {share}");
                    }
                }
            }
            assert!(inside > 2 && border > 200, "{what} {inside} {border}");
        }
    }
}

/// Beside a face of the field's box hardly anything gives way: what brought a path home there threw up a hill nine times as high beside it.
#[test]
fn forces_do_not_act_where_the_box_cuts_the_solid_off() {
    let field = block::<f32>(24);
    let text = |along: &str| format!("along = {along}\nby = [0, 0, 1.2]\nradius = {R}");
    let error = pull(&text("[[0.8, 12, 12]]")).begin(&field, ISO).err();
    let error = error.expect("all of it lies at a face").to_string();
    assert!(error.contains("cut off") && error.contains("inflate"), "{error}");
    let stroke = pull(&text("[[0.2, 12, 12], [12, 12, 12]]"))
        .begin(&field, ISO)
        .unwrap();
    let at_face = stroke.paths_at_face();
    assert!((1..=5).contains(&at_face), "{at_face}");
    let (left, _) = finished(stroke);
    for x in (0..48).map(|n| 0.25 * f64::from(n)) {
        let top = |z: &f64| left.value(DVec3::new(x, 12.0, *z)) > ISO;
        let height = (0..480).map(|n| 0.05 * f64::from(n)).rev().find(top).unwrap();
        let least = if x > 3.0 { 13.0 } else { 11.9 };
        assert!((least..13.5).contains(&height), "{height} at {x}");
    }
}

/// In noise the gradient leads anywhere: places from which it never came to a surface less than two radii away were refused.
#[test]
fn surfaces_beside_noise_are_found_wherever_they_are_near() {
    let noise = |p: DVec3| {
        14.0 * libm::sin(5.1 * p.x + 1.7 * p.y)
            * libm::sin(4.7 * p.y - 2.3 * p.z)
            * libm::sin(6.1 * p.z + p.x)
    };
    let lattice = Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [24; 3],
    };
    let ct = |p: DVec3| 525.0 * libm::erf((12.0 - p.z) / 0.9) - 475.0 + noise(p);
    let field = HierarchicalSpline::<f32>::schoenberg(lattice, 500.0, ct).unwrap();
    let reach = 8.0;
    let (mut nowhere, mut lost) = (0, 0);
    for n in 0..200 {
        let at = |k: u32| 6.0 + 12.0 * f64::from(n * k % 199) / 199.0;
        let p = DVec3::new(at(29), at(61), 8.0 + 9.0 * f64::from(n) / 200.0);
        match nearest_surface(&field, -300.0, p, reach) {
            Ok(found) => lost += usize::from(found.distance(p) > (p.z - 11.7).abs() + 1.0),
            Err(_) => nowhere += 1,
        }
    }
    println!("{nowhere} not found, {lost} found too far");
    assert_eq!(nowhere, 0);
    assert!(lost <= 2, "{lost}");
}
