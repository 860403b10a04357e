//! Pushing and pulling: how far the surface goes.

use bspline::Field;
use bspline::hierarchical::{HierarchicalSpline, Lattice};
use glam::{DAffine3, DVec2, DVec3};

use super::{ISO, SLOPE, block, done, random, refused};

/// How far the surface lies beyond a place along a direction, between -5 and 5; it is crossed once.
fn height(field: &HierarchicalSpline<f32>, from: DVec3, way: DVec3) -> f64 {
    let (mut low, mut high) = (-5.0, 5.0);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        let is_in = field.value(from + middle * way) > ISO;
        *(if is_in { &mut low } else { &mut high }) = middle;
    }
    low
}

const TOP: DVec3 = DVec3::new(12.0, 12.0, 12.0);

/// Depth is speed × force × steps, in one step or in many, by a hundredth of the tolerance a step or by half the brush, both ways, and
/// deeper than the brush is wide.
#[test]
fn a_push_goes_as_deep_as_speed_force_and_time_say() {
    let mut off = 0.0_f64;
    for (speed, force, steps) in [
        (0.05, 2.0, 8),
        (0.05, -2.0, 8),
        (0.4, 1.0, 1),
        (0.0004, 5.0, 60),
        (1.0, -1.0, 4),
        (0.25, 1.0, 12),
    ] {
        let text = format!(
            "push = {{ along = [[12, 12, 12]], radius = 2.5, speed = {speed}, force = {force}, steps = {steps} }}"
        );
        let left = done(&block(), &text);
        let depth = -height(&left, TOP, DVec3::Z) / (speed * force * f64::from(steps));
        println!("{text}: {depth:.4}");
        off = off.max((depth - 1.0).abs());
        // Half way to the rim it is as deep, beyond the rim nothing has moved.
        let beside = height(&left, TOP + 3.2 * DVec3::X, DVec3::Z);
        assert!(beside.abs() < 0.02, "{text}: {beside} beside it");
    }
    assert!(off < 0.02, "{off}");
}

/// The profile of many steps is that of one: the fade of the brush, with no lip beside it and no ripple about it.
#[test]
fn walls_of_a_push_are_as_smooth_as_its_brush() {
    let fade = |t: f64| 1.0 - t * t * t * (10.0 - t * (15.0 - 6.0 * t));
    for (force, steps) in [(1.0, 1), (1.0, 10), (-1.0, 10)] {
        let speed = 2.0 / f64::from(steps);
        let text = format!(
            "push = {{ along = [[12, 12, 12]], radius = 4, speed = {speed}, force = {force}, steps = {steps} }}"
        );
        let left = done(&block(), &text);
        let (mut most, mut turned) = (0.0_f64, 0.0_f64);
        for n in 0..600 {
            let across = 2.0 + 2.0 * f64::from(n) / 600.0;
            let profile = |across: f64| -2.0 * force * fade(0.5 * across - 1.0);
            let rise = (profile(across + 1e-4) - profile(across - 1e-4)) / 2e-4;
            // A golden angle on each time.
            let way = DVec2::from_angle(2.4 * f64::from(n)).extend(0.0);
            let at = TOP + across * way;
            let high = height(&left, at, DVec3::Z);
            let normal = -left.value_gradient(at + high * DVec3::Z).1;
            let expected = DVec3::Z - rise * way;
            most = most.max((high - profile(across)).abs() / (1.0 + rise * rise).sqrt());
            turned = turned.max(normal.angle_between(expected).to_degrees());
        }
        println!("{text}: off {most:.4}, normals {turned:.2} degrees");
        assert!(most < 0.01 && turned < 3.5, "{text}: {most}, {turned} degrees");
    }
}

/// A brush that moves acts on a place as long as it is over it: a radius whole and half of one on each side fading, which is a radius and a
/// half. In how many steps the way is cut does not matter, but for what the surface has moved by meanwhile.
#[test]
fn a_moving_push_goes_as_deep_as_it_is_slow() {
    for (radius, speed, steps, force) in [
        (2.0, 0.3, 6, 1),
        (2.0, 0.06, 30, 1),
        (2.0, 0.0225, 80, 1),
        (1.5, 0.02, 40, -2),
    ] {
        let text = format!(
            "push = {{ along = [[7, 12, 12], [17, 12, 12]], radius = {radius}, speed = {speed}, force = {force}, steps = {steps} }}"
        );
        let left = done(&block(), &text);
        let expected = -speed * f64::from(force * steps) * 1.5 * radius / 10.0;
        for x in [10.5, 12.0, 13.5] {
            let share = height(&left, DVec3::new(x, 12.0, 12.0), DVec3::Z) / expected;
            println!("{text} at {x}: {share:.4}");
            assert!((share - 1.0).abs() < 0.03, "{text} at {x}: {share}");
        }
    }
}

/// Depths are lengths where the density is no distance, along normals that lie anyhow.
#[test]
fn pushes_are_lengths_on_any_density() {
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_scale(DVec3::splat(0.5)),
        cells: [48; 3],
    };
    let density = |p: DVec3| ISO + SLOPE * (49.0 - p.distance_squared(TOP)) / 14.0;
    let ball: HierarchicalSpline<f32> = HierarchicalSpline::schoenberg(lattice, SLOPE, density).unwrap();
    let mut draw = random(3);
    for n in 0..12 {
        let way = DVec3::new(draw(-1.0, 1.0), draw(-1.0, 1.0), draw(-1.0, 1.0)).normalize();
        let (at, force) = (TOP + 6.8 * way, if n % 2 == 0 { 1.0 } else { -1.0 });
        let text = format!(
            "push = {{ along = [{:?}], radius = 2, speed = 0.08, force = {force}, steps = 10 }}",
            at.to_array()
        );
        // Splines through a quadratic lie a little beside it.
        let [before, left] = [&ball, &done(&ball, &text)].map(|f| height(f, TOP + 7.0 * way, way));
        let depth = (before - left) / (0.8 * force);
        println!("{way:.3} {depth:.4}");
        assert!((depth - 1.0).abs() < 0.01, "{text}: {depth}");
    }
}

#[test]
fn pushes_that_make_no_sense_are_refused() {
    for (text, why) in [
        ("push = { along = [], radius = 1, speed = 0.1 }", "no place"),
        (
            "push = { along = [[12, 12, 12]], radius = 1, speed = 2 }",
            "push less hard",
        ),
        (
            "push = { along = [[12, 12, 12]], radius = 1, speed = 0.1, steps = 0 }",
            "1 to 10000",
        ),
        (
            "push = { along = [[12, 12, 12]], radius = 1, speed = 0.1, force = [1, 2] }",
            "paced",
        ),
        (
            "push = { along = [[12, 12, 15]], radius = 1, speed = 0.1 }",
            "no surface lies within",
        ),
        (
            "push = { along = [[12, 12, 99]], radius = 1, speed = 0.1 }",
            "the field from",
        ),
        (
            "paced = true\npush = { along = [[12, 12, 12]], radius = 1, speed = 0.1, steps = 3 }",
            "leave steps out",
        ),
        (
            "paced = true\npush = { along = [[12, 12, 12]], radius = 1, speed = 0.1, force = [1, 2] }",
            "2 forces",
        ),
    ] {
        let error = refused(&block(), text);
        assert!(error.contains(why), "{text}: {error}");
    }
}
