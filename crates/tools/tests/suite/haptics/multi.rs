//! Tools of many points on a device in a hand: twenty seeds each, in any turn, against bricks of fields.
//!
//! What must hold: no point of the tool ever gets in (P4), the force changes no faster than the slew limit (P3), and a static solid gives
//! no energy back, the turning hand's counted in (P2). Beside the tool stands the penalty of its deepest point.

use std::sync::{Arc, LazyLock};

use bspline::primitives::Cuboid;
use bspline::{Aabb, Field};
use fitting::phantoms::SplitMix64;
use glam::{DAffine3, DQuat, DVec2, DVec3};
use tools::haptics::simulated::{Bare, Change, Path, Rig, SimulatedDevice, SimulatedHand, Trace, World};
use tools::haptics::{
    Contact, Demand, Felt, MultiPoint, MultiPointOptions, Obstacle, PointTool, Pose, Renderer, Sampling,
    Scaled, Snapshot, SnapshotMaker, Touch, TouchedObject,
};
use tools::paint::Layers;

use super::common::{Bumps, HalfSpace, Rubbing, omni, spline};

const SEEDS: u64 = 20;
/// How deep a point may be, mm.
const TOLERANCE: f64 = 0.01;

fn plate() -> PointTool {
    PointTool::plate(12.0, 16.0, 1.0, Sampling::default()).expect("a plate")
}

fn snapshot(field: impl Field + 'static, iso: f64, at: DVec3, touch: Touch) -> Arc<Snapshot> {
    let object = TouchedObject {
        id: 1,
        field: Arc::new(field),
        iso,
        world_from_object: DAffine3::IDENTITY,
        layers: &Layers::default(),
        default: touch,
    };
    let demand = Demand {
        reach: 26.0,
        spacing: Some(0.6),
        ..Demand::of_points(&plate())
    };
    SnapshotMaker::new(demand).make(at, &[object], 1)
}

/// 3 mm about z = 0.
static WALL: LazyLock<Arc<Snapshot>> = LazyLock::new(|| {
    let wall = Cuboid::new(DVec3::ZERO, DVec3::new(90.0, 90.0, 1.5)).expect("a wall");
    snapshot(wall, 0.0, DVec3::ZERO, Touch::default())
});

/// Rough waves in numbers like those of a scan, painted with friction and softer than the coupling.
static WAVES: LazyLock<Arc<Snapshot>> = LazyLock::new(|| {
    let bumps = Bumps {
        amplitude: 0.8,
        waves: DVec2::new(9.0, 7.0),
    };
    let within = Aabb::new(DVec3::new(-28.0, -28.0, -28.0), DVec3::new(28.0, 28.0, 28.0));
    let field = spline(&within, 1.0, move |p| 300.0 - 1000.0 * bumps.distance(p).0);
    let touch = Touch {
        stiffness: 1500.0,
        friction: 0.3,
    };
    snapshot(field, 300.0, DVec3::ZERO, touch)
});

/// The penalty of the deepest point: what has no memory of the side.
struct PointPenalty {
    tool: PointTool,
    /// N/mm.
    stiffness: f64,
}

impl Renderer for PointPenalty {
    fn tick(&mut self, obstacle: &dyn Obstacle, hand: &Pose, _: f64) -> Felt {
        let arms = self.tool.points().iter().map(|p| hand.turn * *p);
        let looks = arms.map(|arm| (obstacle.distance(hand.at + arm), arm));
        let deepest = looks.min_by(|a, b| a.0.0.total_cmp(&b.0.0)).expect("points");
        let ((distance, gradient), arm) = deepest;
        let force = self.stiffness * (self.tool.nose() - distance).max(0.0) * gradient;
        Felt {
            force,
            torque: arm.cross(force),
            contact: Contact::Slides,
            ..Felt::nothing(hand)
        }
    }

    fn reset(&mut self) {}
}

fn vector(random: &mut SplitMix64) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| 2.0 * random.uniform() - 1.0))
}

/// From 16 mm above, aside and turning, towards 12 mm behind the wall at 0.2 to 0.6 m/s, and held there; then about in the plane.
fn hit(seed: u64) -> SimulatedHand {
    let mut random = SplitMix64::new(seed);
    let aside = vector(&mut random) * DVec3::new(4.0, 4.0, 0.0);
    let fast = 200.0 + 400.0 * random.uniform();
    let start = aside + DVec3::new(0.0, 0.0, 16.0);
    let behind = DVec3::new(0.0, 0.0, -12.0);
    let path = Path::straight([
        (0.05, start),
        (0.05 + 28.0 / fast, behind),
        (0.5, behind - aside),
        (0.7, behind),
    ]);
    SimulatedHand::light(path).turning(turns(&mut random))
}

/// Down on the waves, about on them, pressed some millimetres, and off again.
fn rub(seed: u64) -> SimulatedHand {
    let mut random = SplitMix64::new(100 + seed);
    let mut place = |height: f64| {
        let p = vector(&mut random) * DVec3::new(7.0, 7.0, 1.0);
        DVec3::new(p.x, p.y, height + 1.5 * p.z)
    };
    let above = place(14.0);
    let on: Vec<_> = (0..5).map(|k| (0.3 + 0.12 * f64::from(k), place(0.0))).collect();
    let off = DVec3::new(0.0, 0.0, 16.0);
    let path = Path::smooth(std::iter::once((0.05, above)).chain(on).chain([(1.1, off)]));
    SimulatedHand::light(path).turning(turns(&mut random))
}

fn turns(random: &mut SplitMix64) -> Vec<(f64, DQuat)> {
    let first = 2.5 * vector(random);
    let then = first + 0.5 * vector(random);
    [(0.0, first), (0.3, first), (0.7, then)]
        .map(|(t, w)| (t, DQuat::from_scaled_axis(w)))
        .into()
}

fn touch(
    obstacle: &Arc<Snapshot>,
    hand: SimulatedHand,
    seconds: f64,
    renderer: impl Renderer + 'static,
) -> Trace {
    touch_world(World::shared(obstacle.clone()), hand, seconds, renderer)
}

fn touch_world(
    world: World<'_>,
    hand: SimulatedHand,
    seconds: f64,
    renderer: impl Renderer + 'static,
) -> Trace {
    let mechanics = omni();
    let force = mechanics.force;
    let device = SimulatedDevice::new(mechanics, hand);
    let drive = Bare {
        renderer: Box::new(renderer),
        force,
    };
    Rig::new(device, drive, world).run(seconds)
}

fn renderer() -> MultiPoint {
    MultiPoint::new(plate(), MultiPointOptions::default()).expect("options")
}

/// What a trace comes to.
#[derive(Debug, Default)]
struct Figures {
    /// Deepest of all points of the tool, mm.
    depth: f64,
    /// Largest change of the force, N.
    jump: f64,
    /// Most energy given back, by force and torque, J.
    returned: f64,
    force: f64,
    sticks: usize,
    /// Whether all points are on the far side of z = 0 at some time.
    is_through: bool,
}

fn figures(trace: &Trace, obstacle: &Snapshot) -> Figures {
    let tool = plate();
    let mut all = Figures::default();
    for t in &trace.ticks {
        let places = tool.points().iter().map(|p| t.proxy.at + t.proxy.turn * *p);
        let depth = |p: DVec3| tool.nose() - obstacle.distance(p).0;
        if t.contact != Contact::Inside {
            all.depth = places.clone().map(depth).fold(all.depth, f64::max);
        }
        all.is_through |= places.clone().all(|p| p.z < 0.0);
        all.force = all.force.max(t.force.length());
        all.sticks += usize::from(t.contact == Contact::Sticks);
    }
    let mut sum = 0.0;
    for w in trace.ticks.windows(2) {
        all.jump = all.jump.max((w[1].force - w[0].force).length());
        let turn = (w[1].read.turn * w[0].read.turn.inverse()).to_scaled_axis();
        let turn = if turn.length() > std::f64::consts::PI {
            turn - std::f64::consts::TAU * turn.normalize()
        } else {
            turn
        };
        sum += 0.5e-3 * (w[0].force + w[1].force).dot(w[1].read.at - w[0].read.at);
        sum += 0.5e-3 * (w[0].torque + w[1].torque).dot(turn);
        all.returned = all.returned.max(sum);
    }
    all
}

#[test]
fn a_plate_is_kept_out_of_a_wall_in_any_turn() {
    let mut most = Figures::default();
    for seed in 0..SEEDS {
        let trace = touch(&WALL, hit(seed), 1.0, renderer());
        let f = figures(&trace, &WALL);
        assert!(f.depth < TOLERANCE && !f.is_through, "{seed}: {f:?}");
        assert!(f.jump <= 0.25 + 1e-9, "{seed}: {f:?}");
        assert!(f.returned < 1e-4, "{seed}: {f:?}");
        assert!(f.force > 1.0, "{seed}: {f:?}");
        most.depth = most.depth.max(f.depth);
        most.jump = most.jump.max(f.jump);
        most.returned = most.returned.max(f.returned);
    }
    println!("wall: {most:?}");
}

/// The criteria can fail: without memory the plate is soon behind the wall, which returns what it never got; without a slew limit the force
/// steps by more.
#[test]
fn a_penalty_lets_the_plate_through_a_wall() {
    let (mut through, mut gained, mut jumps) = (0, 0, 0);
    for seed in 0..SEEDS {
        let penalty = PointPenalty {
            tool: plate(),
            stiffness: 0.5,
        };
        let trace = touch(&WALL, hit(seed), 1.0, penalty);
        let f = figures(&trace, &WALL);
        through += usize::from(f.is_through);
        gained += usize::from(f.returned > 1e-4);
        jumps += usize::from(f.jump > 0.25);
    }
    assert_eq!((through, jumps), (SEEDS as usize, SEEDS as usize));
    assert!(gained > 4, "{gained}");
    let unlimited = MultiPointOptions {
        slew: 1e9,
        ..MultiPointOptions::default()
    };
    let wild = (0..SEEDS).filter(|seed| {
        let renderer = MultiPoint::new(plate(), unlimited).expect("options");
        figures(&touch(&WALL, hit(*seed), 1.0, renderer), &WALL).jump > 0.25
    });
    assert!(wild.count() > 3);
}

#[test]
fn a_plate_rubs_over_waves_without_a_gain() {
    let mut most = Figures::default();
    let mut sticks = 0;
    for seed in 0..SEEDS {
        let trace = touch(&WAVES, rub(seed), 1.2, renderer());
        let f = figures(&trace, &WAVES);
        assert!(f.depth < TOLERANCE && !f.is_through, "{seed}: {f:?}");
        assert!(f.jump <= 0.25 + 1e-9, "{seed}: {f:?}");
        assert!(f.returned < 1e-4, "{seed}: {f:?}");
        assert!(f.force > 0.3, "{seed}: {f:?}");
        sticks += f.sticks;
        most.depth = most.depth.max(f.depth);
        most.jump = most.jump.max(f.jump);
        most.returned = most.returned.max(f.returned);
    }
    assert!(sticks > 1000, "{sticks}");
    println!("waves: {most:?}, {sticks} ticks stick");
}

/// Rough ground sinks by 0.1 mm thirty times a second under a plate that is dragged over it, and then 3 mm come over it in one step of the
/// simulation: both are felt as motions, the second of the plate at 0.1 m/s at most.
#[test]
fn ground_that_changes_moves_a_plate_at_bounded_rates() {
    let height = |time: f64| {
        if time < 0.7 {
            -3.0 * (time - 0.2).max(0.0)
        } else {
            1.5
        }
    };
    let mut most = [0.0f64; 3];
    for seed in 0..SEEDS {
        let mut random = SplitMix64::new(200 + seed);
        let aside = vector(&mut random) * DVec3::new(8.0, 8.0, 0.0);
        let lies = DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2);
        let turn = DQuat::from_scaled_axis(0.3 * vector(&mut random)) * lies;
        let of = |p: DVec3, z: f64| DVec3::new(p.x, p.y, z);
        let path = Path::smooth([
            (0.0, of(aside, 8.0)),
            (0.2, of(aside, -3.0)),
            (0.7, of(-aside, -3.0)),
            (1.3, of(-aside, -3.0)),
        ]);
        let hand = SimulatedHand::light(path).turning([(0.0, turn)]);
        let ground = move |time: f64, _: &Pose| -> Arc<dyn Obstacle> {
            Arc::new(Rubbing {
                solid: HalfSpace::floor(height(time)),
                coefficient: 0.4,
            })
        };
        let world = World::changing(30.0, Change::Blended, &Pose::at(8.0 * DVec3::Z), ground);
        let trace = touch_world(world, hand, 1.3, renderer());
        let lowest = |t: &tools::haptics::simulated::Tick| {
            let places = plate()
                .points()
                .iter()
                .map(|p| (t.proxy.at + t.proxy.turn * *p).z)
                .collect::<Vec<_>>();
            places.into_iter().fold(f64::INFINITY, f64::min) - plate().nose()
        };
        for w in trace.ticks.windows(2) {
            let jump = (w[1].force - w[0].force).length();
            match w[0].time {
                t if (0.3..0.69).contains(&t) => most[0] = most[0].max(jump),
                t if t >= 0.7 => most[1] = most[1].max(jump),
                _ => {}
            }
            if w[0].time > 0.7 {
                most[2] = most[2].max(lowest(&w[1]) - lowest(&w[0]));
            }
        }
        let end = trace.ticks.last().expect("ticks");
        assert!((lowest(end) - 1.5).abs() < 0.01, "{seed}: {}", lowest(end));
        assert!(end.force.z > 0.5, "{seed}: {}", end.force);
    }
    println!(
        "changing ground: steps while it sinks {:.4} N, while it comes {:.4} N, way out {:.4} mm a tick",
        most[0], most[1], most[2]
    );
    // 60 mm/s at most of a hand that friction lets slip, and 0.1 mm in 33 ticks.
    assert!(most[0] < 0.05, "{most:?}");
    assert!(most[1] <= 0.25 + 1e-9 && most[2] <= 0.101, "{most:?}");
}

/// A tool that is told in the lengths of the hand feels the same at every zoom.
#[test]
fn a_plate_feels_the_same_at_every_zoom() {
    struct Zoomed<'a>(&'a Snapshot, f64);
    impl Obstacle for Zoomed<'_> {
        fn distance(&self, p: DVec3) -> (f64, DVec3) {
            let (d, g) = self.0.distance(p / self.1);
            (self.1 * d, g)
        }
        fn finest(&self) -> f64 {
            self.1 * self.0.finest()
        }
        fn touch(&self, p: DVec3) -> Touch {
            let touch = self.0.touch(p / self.1);
            Touch {
                stiffness: touch.stiffness / self.1,
                ..touch
            }
        }
    }
    let hand = rub(7);
    let pose = |k: u32| {
        let t = 1e-3 * f64::from(k);
        Pose {
            at: hand.path.at(t).0,
            turn: hand.turn(t),
        }
    };
    let mut plain = renderer();
    let felt: Vec<_> = (0..1100).map(|k| plain.tick(&**WAVES, &pose(k), 1e-3)).collect();
    // Powers of two: what differs is not rounding.
    for scale in [1.0 / 64.0, 16.0] {
        let mut scaled = Scaled {
            renderer: renderer(),
            scale,
        };
        let zoomed = Zoomed(&WAVES, scale);
        for (k, one) in (0..1100).zip(&felt) {
            let hand = pose(k);
            let at = scale * hand.at;
            let other = scaled.tick(&zoomed, &Pose { at, ..hand }, 1e-3);
            let own = Pose {
                at: other.proxy.at / scale,
                ..other.proxy
            };
            let other = (other.force, other.torque / scale, own, other.contact);
            assert_eq!(
                other,
                (one.force, one.torque, one.proxy, one.contact),
                "{scale} {k}"
            );
        }
    }
}
