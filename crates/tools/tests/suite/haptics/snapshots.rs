//! What the simulation shows of its objects: layers, edits that come as motions, several objects, boxes that follow the tool.

use std::sync::Arc;

use bspline::hierarchical::{BlockEdit, Change, Lattice};
use bspline::{Field, HierarchicalSpline};
use glam::{DAffine3, DVec3};
use tools::haptics::{Demand, Obstacle, SnapshotMaker, Touch, TouchedObject};
use tools::paint::{Layer, LayerError, Layers, Substance};

fn lattice() -> Lattice {
    Lattice {
        world_from_lattice: DAffine3::from_translation(DVec3::splat(-24.0)),
        cells: [48; 3],
    }
}

/// A ball of 12 mm with bumps, as steep as a scan.
fn ball() -> HierarchicalSpline<f32> {
    let bumps = |p: DVec3| 0.4 * libm::sin(0.9 * p.x) * libm::cos(1.1 * p.y + 0.3 * p.z);
    HierarchicalSpline::schoenberg(lattice(), 300.0, |p| 300.0 * (12.0 - p.length() + bumps(p))).unwrap()
}

/// The same with a bump near (0, 0, 12).
fn edited(field: &HierarchicalSpline<f32>, by: f32) -> HierarchicalSpline<f32> {
    let edit = BlockEdit {
        level: 0,
        first: [23, 23, 35],
        shape: [4; 3],
        change: Change::Set(vec![by; 64]),
    };
    field.edited_blocks(&[edit]).unwrap()
}

fn object<'a>(id: u64, field: &Arc<dyn Field>, layers: &'a Layers) -> TouchedObject<'a> {
    TouchedObject {
        id,
        field: field.clone(),
        iso: 0.0,
        world_from_object: DAffine3::IDENTITY,
        layers,
        default: Touch::default(),
    }
}

/// Places round one.
fn around(at: DVec3, half: f64, count: u32) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |n| {
        let part = |by: f64| 2.0 * (f64::from(n) * by).fract() - 1.0;
        at + half * DVec3::new(part(0.819_172_5), part(0.671_043_6), part(0.549_700_5))
    })
}

fn layer(of: impl Fn(DVec3) -> Option<f64>) -> Layer {
    let empty = Layer::empty(&lattice(), 1);
    let painted = empty.painted(&lattice().world_box(), |p, _| Ok::<_, LayerError>(of(p)));
    painted.unwrap()
}

/// A box that follows the tool round half the ball shows the same surface before and after each step.
#[test]
fn nothing_jumps_where_the_box_follows_the_tool() {
    let field: Arc<dyn Field> = Arc::new(ball());
    let layers = Layers::new();
    for radius in [0.0, 2.0] {
        let mut maker = SnapshotMaker::new(Demand::of_ball(radius));
        let at = |n: u32| {
            let (sine, cosine) = libm::sincos(0.02 * f64::from(n));
            (12.0 + radius) * DVec3::new(sine, 0.2 * sine, cosine)
        };
        let mut last = maker.make(at(0), &[object(0, &field, &layers)], 0);
        let (mut steps, mut worst, mut turn): (u32, f64, f64) = (0, 0.0, 0.0);
        for n in 1..150 {
            let now = maker.make(at(n), &[object(0, &field, &layers)], 0);
            assert!(!now.moves(), "the surface is the same");
            if !Arc::ptr_eq(&now.parts()[0].shape, &last.parts()[0].shape) {
                steps += 1;
                for p in around(at(n), 3.0, 400) {
                    let ((a, g), (b, h)) = (last.distance(p), now.distance(p));
                    if a.abs() < radius + 1.0 {
                        worst = worst.max((a - b).abs());
                        turn = turn.max(g.distance(h));
                    }
                }
                assert!(maker.renewed() < 20_000 && now.covers(at(n), radius + 2.0));
            }
            last = now;
        }
        println!(
            "ball {radius} mm: {steps} steps of the box, jumps of {worst:.2e} mm, gradients by {turn:.2e}"
        );
        assert!(steps > 3 && worst < 1e-5 && turn < 1e-5, "{worst} mm, {turn}");
    }
}

/// On the way from one snapshot to the next distances and gradients go from those of the one to those of the other, in proportion; and where the
/// earlier box does not reach, they are those of the later one.
#[test]
fn an_edit_comes_as_a_motion() {
    let before = ball();
    let after: Arc<dyn Field> = Arc::new(edited(&before, 500.0));
    let before: Arc<dyn Field> = Arc::new(before);
    let (layers, at) = (Layers::new(), DVec3::Z * 13.0);
    let mut maker = SnapshotMaker::new(Demand::of_ball(2.0));
    let first = maker.make(at, &[object(0, &before, &layers)], 1);
    assert!(!first.moves());
    // The tool has gone on, so that the box goes with it.
    let there = at + DVec3::X * 9.0;
    let second = maker.make(there, &[object(0, &after, &layers)], 2);
    assert!(second.moves() && second.edit == 2 && second.heartbeat == first.heartbeat + 1);
    let mut most = 0.0_f64;
    for p in around(at, 6.0, 500) {
        let ((a, ga), (b, gb)) = (first.distance(p), second.distance(p));
        for share in [0.0, 0.25, 0.5, 1.0] {
            let (phi, gradient) = second.moving(share).distance(p);
            assert!((phi - (a + share * (b - a))).abs() < 1e-12);
            assert!(gradient.distance(ga + share * (gb - ga)) < 1e-12);
        }
        most = most.max((a - b).abs());
    }
    assert!(most > 0.3, "the edit is seen: {most} mm");
    let beyond = there + DVec3::X * 14.0;
    assert!(!first.covers(beyond, 0.0));
    assert_eq!(second.moving(0.3).distance(beyond), second.distance(beyond));
    // A heartbeat without a change moves nothing, and shares what it knows.
    let third = maker.make(there, &[object(0, &after, &layers)], 2);
    assert!(!third.moves() && Arc::ptr_eq(&third.parts()[0].shape, &second.parts()[0].shape));
    assert_eq!(third.heartbeat, second.heartbeat + 1);
    // Whoever still holds a snapshot keeps it.
    assert_eq!(maker.free(), 3);
    drop((first, second));
    assert_eq!(maker.free(), 1);
}

/// Compliance and friction are linear between the nodes; where nothing is painted, or 0, an object is as its default says; a place off the surface
/// feels like the surface nearest to it.
#[test]
fn painted_layers_are_felt_where_they_are() {
    let field: Arc<dyn Field> = Arc::new(ball());
    let layers = Layers::from([
        (
            Substance::SurfaceStiffness,
            layer(|p| Some(if p.x > 0.0 { 400.0 } else { 0.0 })),
        ),
        (
            Substance::Friction,
            layer(|p| (p.y.abs() < 6.0).then_some(0.1 + 0.02 * (p.y + 6.0))),
        ),
    ]);
    let default = Touch {
        stiffness: f64::INFINITY,
        friction: 0.05,
    };
    let of = |layers| TouchedObject {
        default,
        ..object(0, &field, layers)
    };
    let at = DVec3::Z * 12.0;
    let mut maker = SnapshotMaker::new(Demand::of_ball(2.0));
    let snapshot = maker.make(at, &[of(&layers)], 0);
    for n in 0..200 {
        let y = -4.0 + 0.04 * f64::from(n);
        for (x, soft) in [(4.0, 400.0), (-4.0, f64::INFINITY)] {
            let p = DVec3::new(x, y, 13.0);
            let (phi, gradient) = snapshot.distance(p);
            let on = p - phi * gradient;
            let felt = snapshot.touch(p);
            if soft.is_finite() {
                assert!((felt.stiffness / soft - 1.0).abs() < 1e-6, "{p}: {felt:?}");
            } else {
                assert_eq!(felt.stiffness, soft, "{p}");
            }
            let mu = 0.1 + 0.02 * (on.y + 6.0);
            assert!((felt.friction - mu).abs() < 1e-3, "{p}: {felt:?}, {mu} painted");
        }
    }
    // From soft to rigid it goes through all that lies between, never below either.
    let mut last = 0.0;
    for n in 0..=40 {
        let felt = snapshot.touch(DVec3::new(1.0 - 0.05 * f64::from(n), 0.0, 12.5));
        let compliance = 1.0 / felt.stiffness;
        assert!((0.0..=1.0 / 400.0 + 1e-9).contains(&compliance));
        assert!(n == 0 || compliance <= last + 1e-12);
        last = compliance;
    }
    let bare = snapshot.touch(DVec3::new(0.0, 9.0, 9.5));
    assert_eq!(
        (bare.stiffness.is_infinite(), (1e3 * bare.friction).round()),
        (false, 50.0)
    );
    // The same layers are shared; others are read anew, and the shape is not.
    let again = maker.make(at, &[of(&layers)], 0);
    let map = |s: &tools::haptics::Snapshot| s.parts()[0].painted.clone().unwrap();
    assert!(Arc::ptr_eq(&map(&snapshot), &map(&again)));
    let rough = Layers::from([(Substance::Friction, layer(|_| Some(0.7)))]);
    let other = maker.make(at, &[of(&rough)], 0);
    assert!(Arc::ptr_eq(&other.parts()[0].shape, &snapshot.parts()[0].shape) && !other.moves());
    let felt = other.touch(DVec3::new(4.0, 0.0, 12.0));
    assert!(felt.stiffness.is_infinite() && (felt.friction - 0.7).abs() < 1e-6);
}

/// Of several objects the nearest is felt, with its own feel; each moves by itself, and comes and goes without the others.
#[test]
fn several_objects_are_there_at_once() {
    let here = ball();
    let field: [Arc<dyn Field>; 2] = [Arc::new(here.clone()), Arc::new(edited(&here, -600.0))];
    let layers = Layers::new();
    let of = |id: u64, field: &Arc<dyn Field>, x: f64, friction: f64| TouchedObject {
        world_from_object: DAffine3::from_translation(DVec3::X * x),
        default: Touch {
            friction,
            ..Touch::default()
        },
        ..object(id, field, &layers)
    };
    let at = DVec3::new(13.0, 0.0, 4.0);
    let alone = |field: &Arc<dyn Field>, x: f64| {
        SnapshotMaker::new(Demand::of_ball(1.0)).make(at, &[of(0, field, x, 0.0)], 0)
    };
    let [left, right] = [alone(&field[0], 0.0), alone(&field[0], 26.0)];
    let mut maker = SnapshotMaker::new(Demand::of_ball(1.0));
    let both = maker.make(at, &[of(7, &field[0], 0.0, 0.2), of(9, &field[0], 26.0, 0.6)], 0);
    let mut seen = [0; 2];
    for p in around(at, 6.0, 400) {
        let (a, b) = (left.distance(p), right.distance(p));
        let nearest = if a.0 <= b.0 { a } else { b };
        assert_eq!(both.distance(p), nearest);
        let second = usize::from(b.0 < a.0);
        assert_eq!(both.touch(p).friction, [0.2, 0.6][second]);
        seen[second] += 1;
    }
    assert!(seen[0] > 100 && seen[1] > 100, "{seen:?}");
    // One is edited: it moves, the other does not. They are told in another order.
    let next = maker.make(at, &[of(9, &field[1], 26.0, 0.6), of(7, &field[0], 0.0, 0.2)], 1);
    let moves: Vec<(u64, bool)> = next
        .parts()
        .iter()
        .map(|part| (part.object, part.before.is_some()))
        .collect();
    let is_touched = next.distance(DVec3::new(26.0, 0.0, 12.0)) != both.distance(DVec3::new(26.0, 0.0, 12.0));
    assert_eq!(moves, [(9, is_touched), (7, false)]);
    assert!(is_touched);
    assert!(Arc::ptr_eq(&next.parts()[1].shape, &both.parts()[0].shape));
    // One goes, and comes back elsewhere: nothing leads there from where it was.
    let one = maker.make(at, &[of(7, &field[0], 0.0, 0.2)], 2);
    assert_eq!(one.parts().len(), 1);
    assert_eq!(one.distance(at), left.distance(at));
    let back = maker.make(at, &[of(7, &field[0], 1.0, 0.2)], 3);
    assert!(!back.moves() && back.distance(at).0 < one.distance(at).0);
}
