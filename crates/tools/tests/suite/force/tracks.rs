//! Tools that move leave their depth, at any speed and along any bend.

use bspline::Field;
use bspline::hierarchical::HierarchicalSpline;
use glam::DVec3;
use tools::curve::Along;
use tools::force::{Chisel, nearest_surface};
use tools::number::{Point, Positive};

use super::{ISO, R, ball, block, finished};

/// Radii on the track from one place that is looked at to the next.
const LOOK: f64 = 0.11;

/// Places of a polyline, a length apart.
fn along(line: &[DVec3], step: f64) -> Vec<DVec3> {
    let (mut places, mut left) = (Vec::new(), 0.0);
    for leg in line.windows(2) {
        let length = leg[0].distance(leg[1]);
        while left <= length {
            places.push(leg[0].lerp(leg[1], left / length));
            left += step;
        }
        left -= length;
    }
    places
}

/// The least and the largest share of its depth that a groove has along its track, on and between the paths: all of it, and without
/// half a radius at both ends.
fn depths([before, after]: [&HierarchicalSpline<f32>; 2], line: &[DVec3], way: f64) -> [(f64, f64); 2] {
    let share = |p: &DVec3| {
        let at = nearest_surface(before, ISO, *p, 6.0).unwrap();
        let normal = -before.value_gradient(at).1.normalize();
        let is_in = |s: f64| after.value(at + s * normal) > ISO;
        let (mut low, mut high) = (-4.0, 4.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            *(if is_in(middle) { &mut low } else { &mut high }) = middle;
        }
        low / way
    };
    let all = along(line, LOOK * R).iter().map(share).collect::<Vec<_>>();
    let ends = (0.5 / LOOK).ceil() as usize;
    [&all[..], &all[ends..all.len() - ends]].map(|some| {
        let none = (f64::INFINITY, 0.0_f64);
        some.iter()
            .fold(none, |(least, most), s| (least.min(*s), most.max(*s)))
    })
}

/// The groove of a tool in a hand that goes `pace` radii a step, or of a script without one.
fn made(
    field: &HierarchicalSpline<f32>,
    line: &[DVec3],
    (grows, depth): (bool, f64),
    pace: Option<f64>,
) -> HierarchicalSpline<f32> {
    let chisel = Chisel {
        along: Along::Points(line.iter().map(|p| Point(*p)).collect()),
        depth: Positive(depth),
        radius: Positive(R),
        how: Default::default(),
    };
    let Some(pace) = pace else {
        return finished(chisel.begin(field, ISO, grows).unwrap()).0;
    };
    let mut stroke = chisel.hold(field, ISO, grows, line[0]).unwrap();
    // A fast hand is asked several times a step where it is.
    let poses = (4.0 * pace).ceil();
    for (n, pose) in along(line, pace * R / poses).into_iter().enumerate() {
        stroke.pose(pose).unwrap();
        if (n + 1) % poses as usize == 0 {
            stroke.step().unwrap();
        }
    }
    stroke.pose(line[line.len() - 1]).unwrap();
    stroke.let_go();
    finished(stroke).0
}

#[test]
fn moving_tools_leave_their_depth_at_any_speed_along_any_bend() {
    let flat = |places: Vec<[f64; 2]>| -> Vec<DVec3> {
        places.into_iter().map(|[x, y]| DVec3::new(x, y, 12.0)).collect()
    };
    let circle = |radius: f64, turn: f64| {
        let at = |i: u32| {
            let (sin, cos) = (turn * f64::from(i) / 40.0).sin_cos();
            [12.0 + radius * cos, 12.0 + radius * sin]
        };
        flat((0..=40).map(at).collect())
    };
    let wave = (0..=60).map(|i| 5.5 + 13.0 * f64::from(i) / 60.0);
    let meridian = (0..=40).map(|i| 2.6 * (f64::from(i) / 40.0 - 0.5));
    let meridian = meridian.map(|a| DVec3::splat(12.0) + 6.0 * DVec3::new(a.sin(), 0.1, a.cos()).normalize());
    let (block, ball) = (block::<f32>(24), ball::<f32>(24, 1.0));
    let tracks = [
        ("straight", &block, flat(vec![[5.0, 11.3], [19.0, 12.4]])),
        ("circle", &block, circle(3.6, 4.5)),
        ("wide circle", &block, circle(6.0, 3.5)),
        (
            "wave",
            &block,
            flat(wave.map(|x| [x, 12.0 + 1.5 * x.sin()]).collect()),
        ),
        (
            "corner",
            &block,
            flat(vec![[6.0, 10.0], [15.0, 10.0], [15.0, 17.0]]),
        ),
        ("meridian", &ball, meridian.collect()),
    ];
    let hands = [None, Some(0.05), Some(0.2), Some(0.7), Some(3.0), Some(20.0)];
    let drags = [(false, 0.33), (true, 0.5), (false, 1.0), (true, 1.5)];
    let (mut count, mut worst, mut off) = (0, [0.0_f64; 2], Vec::new());
    for (t, (name, field, line)) in tracks.iter().enumerate() {
        for (h, pace) in hands.iter().enumerate() {
            let (grows, drag) = drags[(t + h) % 4];
            let depth = drag * R;
            let after = made(field, line, (grows, depth), *pace);
            let way = if grows { depth } else { -depth };
            let found = depths([field, &after], line, way);
            println!("{name} {drag} {pace:?}: {found:.4?}");
            count += 1;
            // Beside a free end, between the last two paths, grooves are deeper.
            for (i, limit) in [0.025, 0.015].into_iter().enumerate() {
                let (least, most) = found[i];
                worst[i] = worst[i].max(1.0 - least).max(most - 1.0);
                if least <= 1.0 - limit || most >= 1.0 + limit {
                    off.push(format!("{name} {drag} r, {pace:?} r a step: {found:?}"));
                }
            }
        }
    }
    println!("{count} grooves, {worst:.4?} off at most");
    assert!(off.is_empty(), "{off:#?}");
}
