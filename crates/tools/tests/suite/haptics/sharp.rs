//! Sharp edges of Boolean solids under a tool: how far nodes round them off.

use std::sync::Arc;

use bspline::primitives::HalfSpace;
use bspline::{Csg, Field};
use glam::{DAffine3, DQuat, DVec3};
use tools::haptics::{
    Demand, Obstacle, Pose, Proxy, ProxyOptions, Renderer, Snapshot, SnapshotMaker, Touch, TouchedObject,
};
use tools::paint::Layers;

/// The object stands askew, so that its edge runs through the nodes in all ways.
fn place() -> DAffine3 {
    let turn = DQuat::from_axis_angle(DVec3::new(0.3, 1.0, 0.2).normalize(), 0.6);
    DAffine3::from_rotation_translation(turn, DVec3::new(0.13, -0.21, 0.37))
}

fn half(normal: DVec3) -> Arc<dyn Field> {
    Arc::new(HalfSpace::new(DVec3::ZERO, normal).unwrap())
}

fn snapshot(field: &Arc<dyn Field>, radius: f64) -> Arc<Snapshot> {
    let layers = Layers::new();
    let object = TouchedObject {
        id: 0,
        field: field.clone(),
        iso: 0.0,
        world_from_object: place(),
        layers: &layers,
        default: Touch::default(),
    };
    let at = place().transform_point3(DVec3::new(1.0, 0.0, 1.0));
    SnapshotMaker::new(Demand::of_ball(radius)).make(at, &[object], 0)
}

/// The largest error of the place of a ball's middle, mm, while its hand goes along a way of the object's world and along the edge, `y`, at the same
/// time; `distance` is the true one there.
fn rolled(
    snapshot: &Snapshot,
    radius: f64,
    way: impl Fn(f64) -> DVec3,
    distance: impl Fn(DVec3) -> f64,
) -> f64 {
    let back = place().inverse();
    let mut proxy = Proxy::new(ProxyOptions {
        radius,
        ..ProxyOptions::default()
    });
    let (mut worst, mut count) = (0.0_f64, 0);
    let ticks = 6000;
    for n in 0..ticks {
        let share = f64::from(n) / f64::from(ticks);
        let in_object = way(share) + DVec3::Y * (5.0 * share);
        let felt = proxy.tick(snapshot, &Pose::at(place().transform_point3(in_object)), 1e-3);
        if felt.force.length() > 0.02 {
            worst = worst.max((distance(back.transform_point3(felt.proxy.at)) - radius).abs());
            count += 1;
        }
    }
    assert!(count > ticks / 2, "{count}");
    worst
}

/// Radius, and what a convex and a concave edge are off by at most at the distance of nodes that is chosen, all mm.
const LIMITS: [(f64, [f64; 2]); 4] = [
    (0.0, [0.02, 0.06]),
    (0.5, [0.02, 0.05]),
    (2.0, [0.01, 0.075]),
    (5.0, [0.003, 0.1]),
];

/// Over a convex edge a ball rolls on a round offset, which nodes follow; a point is on the edge itself, which they round. In a concave one the ball
/// touches both sides at once, and the offset has an edge.
#[test]
fn edges_are_as_sharp_as_nodes_are_close() {
    let convex: Arc<dyn Field> = Arc::new(Csg::intersection(vec![half(DVec3::X), half(DVec3::Z)]).unwrap());
    let concave: Arc<dyn Field> = Arc::new(Csg::union(vec![half(DVec3::X), half(DVec3::Z)]).unwrap());
    let over = |p: DVec3| match (p.x > 0.0, p.z > 0.0) {
        (true, true) => p.x.hypot(p.z),
        _ => p.x.max(p.z),
    };
    let within = |p: DVec3| match (p.x > 0.0, p.z > 0.0) {
        (false, false) => -p.x.hypot(p.z),
        _ => p.x.min(p.z),
    };
    for (radius, most) in LIMITS {
        let [a, b] = [snapshot(&convex, radius), snapshot(&concave, radius)];
        // Round the edge 1 mm too deep, and into the trough and out again.
        let deep = (radius - 1.0f64).max(-0.3);
        let round = |share: f64| {
            let along = 6.0 * (2.0 * share - 1.0);
            let first = share < 0.04;
            let out = if first { radius + 2.0 } else { deep };
            match along > 0.0 {
                true => DVec3::new(-along, 0.0, 0.0) + DVec3::Z * out,
                false => DVec3::new(out, 0.0, along),
            }
        };
        let into = |share: f64| {
            let along = (6.0 * (2.0 * share - 1.0)).abs();
            let out = if share < 0.04 { radius + 2.0 } else { deep };
            match share < 0.5 {
                true => DVec3::new(out, 0.0, along + deep),
                false => DVec3::new(along + deep, 0.0, out),
            }
        };
        let off = [rolled(&a, radius, round, over), rolled(&b, radius, into, within)];
        let h = a.parts()[0].shape.spacing();
        println!(
            "ball {radius} mm, nodes {h} mm: convex off by {:.4} mm, concave by {:.4}",
            off[0], off[1]
        );
        assert!(off[0] < most[0] && off[1] < most[1], "ball {radius} mm: {off:?}");
        // Two nodes beside the edge nothing is left of it.
        for n in 0..100 {
            let y = 0.05 * f64::from(n);
            let p = place().transform_point3(DVec3::new(-3.0 * h - 0.01 * y, y, 0.3 * h));
            assert!((a.distance(p).0 - 0.3 * h).abs() < 5e-3 * h);
        }
    }
}
