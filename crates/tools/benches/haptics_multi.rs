//! Tools of many points: processor time of a tick, and what the source's shortcuts cost in accuracy.
//!
//! `cargo bench -p tools --bench haptics_multi`. One core; a hand that goes about in a floor, a block and a ball for 4 s, up to
//! 11 mm in the solid. `looks` are distances asked for in a tick, `points` the depth of the tool's own points, `between` that of a dense set on
//! its surface every 10 ticks, `unlike` the mean difference of the force from that of the default options.

#[path = "common/cpu_time.rs"]
#[expect(dead_code, reason = "its groups")]
mod cpu_time;

use std::sync::atomic::{AtomicUsize, Ordering};

use criterion::measurement::Measurement;
use glam::{DQuat, DVec3};
use tools::haptics::{MultiPoint, MultiPointOptions, Obstacle, PointTool, Pose, Renderer, Sampling};

use cpu_time::CpuTime;

const TICKS: usize = 4000;

struct Scene(AtomicUsize);

impl Obstacle for Scene {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        self.0.fetch_add(1, Ordering::Relaxed);
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

fn hand(k: usize) -> Pose {
    let t = 1e-3 * k as f64;
    let high = 6.0 + 4.0 * (5.0 * t).cos() + (30.0 - 200.0 * t).max(0.0);
    let turn = DVec3::new(0.5 * (2.0 * t).sin(), 0.3 * t, 0.4 * (3.0 * t).sin());
    Pose {
        at: DVec3::new(12.0 * (3.0 * t).sin(), 8.0 * (2.0 * t).cos(), high),
        turn: DQuat::from_scaled_axis(turn),
    }
}

/// A run, and what it did.
fn row(name: &str, tool: &PointTool, dense: &PointTool, options: MultiPointOptions, like: &mut Vec<DVec3>) {
    let scene = Scene(AtomicUsize::new(0));
    let depth = |tool: &PointTool, pose: &Pose| {
        let of = |q: &DVec3| tool.nose() - scene.distance(pose.at + pose.turn * *q).0;
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
        scene.0.store(0, Ordering::Relaxed);
        let start = CpuTime.start();
        let felt = renderer.tick(&scene, &pose, 1e-3);
        times.push(1e-3 * CpuTime.end(start));
        let asked = scene.0.load(Ordering::Relaxed);
        looks += asked;
        most = most.max(asked);
        touching += usize::from(felt.force.length() > 0.05);
        points = points.max(depth(tool, &felt.proxy));
        if k % 10 == 0 {
            between = between.max(depth(dense, &felt.proxy));
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

fn main() {
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
    for (name, make) in tools {
        let (tool, dense) = (make(s).expect("a tool"), make(many).expect("a tool"));
        println!("{name}: {} points", tool.points().len());
        let mut like = Vec::with_capacity(TICKS);
        row("default", &tool, &dense, default, &mut like);
        for refinement in [1, 2, 8] {
            let tool = make(Sampling { refinement, ..s }).expect("a tool");
            row(
                &format!("refinement {refinement}"),
                &tool,
                &dense,
                default,
                &mut like,
            );
        }
        for iterations in [1, 4, 12] {
            let options = MultiPointOptions {
                iterations,
                ..default
            };
            row(
                &format!("iterations {iterations}"),
                &tool,
                &dense,
                options,
                &mut like,
            );
        }
        for step in [0.1, 2.0] {
            let options = MultiPointOptions { step, ..default };
            row(&format!("step {step}"), &tool, &dense, options, &mut like);
        }
        for fine_checks in [100, 2000] {
            let options = MultiPointOptions {
                fine_checks,
                ..default
            };
            row(
                &format!("fine checks {fine_checks}"),
                &tool,
                &dense,
                options,
                &mut like,
            );
        }
        let blind = make(Sampling { refinement: 1, ..s }).expect("a tool");
        let deepest = MultiPointOptions {
            deepest: Some(5),
            ..default
        };
        row("five deepest, no finer", &blind, &dense, deepest, &mut like);
        let held = MultiPointOptions {
            turn_every: 100,
            ..default
        };
        row("turned every 100, no finer", &blind, &dense, held, &mut like);
    }
}
