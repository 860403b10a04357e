//! Tools of many points: processor time of a tick, and what the source's shortcuts cost in accuracy.
//!
//! `cargo bench -p tools --bench haptics_multi`. One core; a hand that goes about in a floor, a block and a ball for 4 s, up to
//! 11 mm in the solid: by formulas, and by a brick of their field, as the program has it. `looks` are distances asked for in a tick, `points` the depth
//! of the tool's own points in the brick or by the formulas, `between` that of a dense set on its surface every 10 ticks by the formulas, `unlike` the mean difference
//! of the force from that of the default options.

#[path = "common/cpu_time.rs"]
mod cpu_time;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use bspline::Field;
use bspline::csg::Csg;
use bspline::primitives::{Cuboid, HalfSpace, Sphere};
use criterion::measurement::Measurement;
use glam::{DAffine3, DQuat, DVec3};
use tools::haptics::{
    Demand, MultiPoint, MultiPointOptions, Obstacle, PointTool, Pose, Renderer, Sampling, Snapshot,
    SnapshotMaker, Touch, TouchedObject,
};
use tools::paint::Layers;

use cpu_time::{CpuTime, on_one_core};

const TICKS: usize = 4000;

struct Formulas;

impl Obstacle for Formulas {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        let floor = (p.z, DVec3::Z);
        let d = p - DVec3::new(-5.0, 3.0, 0.0);
        let ball = (d.length() - 4.0, d.normalize_or(DVec3::Z));
        let d = p - DVec3::new(15.0, 0.0, 0.0);
        let q = d.abs() - 6.0;
        let out = q.max(DVec3::ZERO);
        let axis = if q.x >= q.y && q.x >= q.z {
            DVec3::X
        } else if q.y >= q.z {
            DVec3::Y
        } else {
            DVec3::Z
        };
        let block = match out == DVec3::ZERO {
            true => (q.max_element(), d.signum() * axis),
            false => (out.length(), d.signum() * out / out.length()),
        };
        [floor, ball, block]
            .into_iter()
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .expect("three")
    }

    fn finest(&self) -> f64 {
        2.0
    }
}

/// The same as a brick of a field round all ways of the hand.
fn brick(tool: &PointTool, touch: Touch) -> Arc<Snapshot> {
    let solids: Vec<Arc<dyn Field>> = vec![
        Arc::new(HalfSpace::new(DVec3::ZERO, DVec3::Z).expect("a floor")),
        Arc::new(Sphere::new(DVec3::new(-5.0, 3.0, 0.0), 4.0).expect("a ball")),
        Arc::new(Cuboid::new(DVec3::new(15.0, 0.0, 0.0), DVec3::splat(6.0)).expect("a block")),
    ];
    let object = TouchedObject {
        id: 1,
        field: Arc::new(Csg::union(solids).expect("solids")),
        iso: 0.0,
        world_from_object: DAffine3::IDENTITY,
        layers: &Layers::default(),
        default: touch,
    };
    let usual = Demand::of_points(tool);
    let demand = Demand {
        reach: tool.extent() + 16.0,
        spacing: Some(0.5),
        ..usual
    };
    SnapshotMaker::new(demand).make(DVec3::new(0.0, 0.0, 5.0), &[object], 1)
}

/// Counts what is asked.
struct Counted<'a> {
    obstacle: &'a dyn Obstacle,
    asked: AtomicUsize,
}

impl Obstacle for Counted<'_> {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        self.asked.fetch_add(1, Ordering::Relaxed);
        self.obstacle.distance(p)
    }

    fn finest(&self) -> f64 {
        self.obstacle.finest()
    }

    fn touch(&self, p: DVec3) -> Touch {
        self.obstacle.touch(p)
    }
}

fn hand(k: usize) -> Pose {
    let t = 1e-3 * k as f64;
    let high = 6.0 + 4.0 * (5.0 * t).cos() + (30.0 - 200.0 * t).max(0.0);
    let turn = DVec3::new(0.5 * (2.0 * t).sin(), 0.3 * t, 0.4 * (3.0 * t).sin());
    Pose {
        at: DVec3::new(12.0 * (3.0 * t).sin(), 8.0 * (2.0 * t).cos(), high),
        turn: DQuat::from_scaled_axis(turn),
    }
}

/// A tool, a dense set of points on its surface, and what is touched.
struct Scene<'a> {
    dense: &'a PointTool,
    obstacle: &'a dyn Obstacle,
}

/// A run, and what it did.
fn row(name: &str, scene: &Scene, tool: &PointTool, options: MultiPointOptions, like: &mut Vec<DVec3>) {
    let counted = Counted {
        obstacle: scene.obstacle,
        asked: AtomicUsize::new(0),
    };
    let depth = |tool: &PointTool, obstacle: &dyn Obstacle, pose: &Pose| {
        let of = |q: &DVec3| tool.nose() - obstacle.distance(pose.at + pose.turn * *q).0;
        tool.points().iter().map(of).fold(f64::NEG_INFINITY, f64::max)
    };
    let mut times = Vec::with_capacity(TICKS);
    let (mut looks, mut most, mut touching) = (0, 0, 0);
    let (mut points, mut between, mut jump, mut unlike) = (0.0f64, 0.0f64, 0.0f64, 0.0);
    let mut renderer = MultiPoint::new(tool.clone(), options).expect("options");
    let mut force = DVec3::ZERO;
    let is_first = like.is_empty();
    for k in 0..TICKS {
        let pose = hand(k);
        counted.asked.store(0, Ordering::Relaxed);
        let start = CpuTime.start();
        let felt = renderer.tick(&counted, &pose, 1e-3);
        times.push(1e-3 * CpuTime.end(start));
        let asked = counted.asked.load(Ordering::Relaxed);
        looks += asked;
        most = most.max(asked);
        touching += usize::from(felt.force.length() > 0.05);
        points = points.max(depth(tool, scene.obstacle, &felt.proxy));
        if k % 10 == 0 {
            between = between.max(depth(scene.dense, &Formulas, &felt.proxy));
        }
        jump = jump.max((felt.force - force).length());
        force = felt.force;
        match is_first {
            true => like.push(force),
            false => unlike += (force - like[k]).length() / TICKS as f64,
        }
    }
    times.sort_by(f64::total_cmp);
    let mean = times.iter().sum::<f64>() / TICKS as f64;
    let (median, p99) = (times[TICKS / 2], times[TICKS * 99 / 100]);
    println!(
        "{name:24} mean {mean:6.1} us, median {median:6.1}, p99 {p99:6.1}; looks {:4} mean {most:5} most; touches {:3} %; points {points:7.4} mm, between {between:7.4} mm; jump {jump:.3} N; unlike {unlike:.3} N",
        looks / TICKS,
        100 * touching / TICKS
    );
}

/// Forces of the default options, to be unlike.
type Like = Vec<DVec3>;

fn main() {
    on_one_core(|_| measure());
}

fn measure() {
    let s = Sampling::default();
    let many = Sampling {
        points: 4000,
        refinement: 1,
        ..s
    };
    type Make = fn(Sampling) -> Result<PointTool, tools::haptics::ToolError>;
    let tools: [(&str, Make); 4] = [
        ("sphere 4.5", |s| PointTool::sphere(4.5, s)),
        ("cube 10", |s| PointTool::block(DVec3::splat(10.0), s)),
        ("cylinder 4 x 12", |s| PointTool::cylinder(4.0, 12.0, s)),
        ("plate 20 x 30 x 1", |s| PointTool::plate(20.0, 30.0, 1.0, s)),
    ];
    let default = MultiPointOptions::default();
    let deepest = MultiPointOptions {
        deepest: Some(5),
        ..default
    };
    let held = MultiPointOptions {
        turn_every: 100,
        ..default
    };
    let steps = |iterations| MultiPointOptions {
        iterations,
        ..default
    };
    for (name, make) in tools {
        let (tool, dense) = (make(s).expect("a tool"), make(many).expect("a tool"));
        let of = |refinement| make(Sampling { refinement, ..s }).expect("a tool");
        println!("{name}: {} points, by formulas", tool.points().len());
        let formulas = Scene {
            dense: &dense,
            obstacle: &Formulas,
        };
        let mut like = Like::with_capacity(TICKS);
        row("default", &formulas, &tool, default, &mut like);
        for refinement in [2, 8] {
            let name = format!("refinement {refinement}");
            row(&name, &formulas, &of(refinement), default, &mut like);
        }
        for step in [0.1, 2.0] {
            let options = MultiPointOptions { step, ..default };
            row(&format!("step {step}"), &formulas, &tool, options, &mut like);
        }
        for fine_checks in [100, 2000] {
            let options = MultiPointOptions {
                fine_checks,
                ..default
            };
            row(
                &format!("fine checks {fine_checks}"),
                &formulas,
                &tool,
                options,
                &mut like,
            );
        }
        println!("{name}: on a brick");
        let plain = brick(&tool, Touch::default());
        let on_brick = Scene {
            dense: &dense,
            obstacle: &*plain,
        };
        let mut like = Like::with_capacity(TICKS);
        row("default", &on_brick, &tool, default, &mut like);
        for iterations in [1, 4, 12] {
            let name = format!("iterations {iterations}");
            row(&name, &on_brick, &tool, steps(iterations), &mut like);
        }
        row("five deepest", &on_brick, &tool, deepest, &mut like);
        row("turned every 100", &on_brick, &tool, held, &mut like);
        let blind = of(1);
        row("no finer points", &on_brick, &blind, default, &mut like);
        row("no finer, five deepest", &on_brick, &blind, deepest, &mut like);
        row("no finer, every 100", &on_brick, &blind, held, &mut like);
        let touch = Touch {
            stiffness: 1500.0,
            friction: 0.4,
        };
        let rough = brick(&tool, touch);
        let on_rough = Scene {
            dense: &dense,
            obstacle: &*rough,
        };
        row("rough and soft", &on_rough, &tool, default, &mut like);
    }
}
