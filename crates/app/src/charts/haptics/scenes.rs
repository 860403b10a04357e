//! The scenes in which methods fail, each with each method.

use std::sync::Arc;

use ::tools::haptics::Obstacle;
use ::tools::haptics::simulated::{
    Ball, Bare, Edge, Groove, HalfSpace, Limits, Measures, Mechanics, Passage, Path, Preset, Rig, Sheet,
    SimulatedDevice, SimulatedHand, World,
};
use glam::DVec3;

use super::{Add, HapticRun, Mode, Place, Stopped, line, wall};

/// A scene: what is touched, by whom, and what must hold.
struct Scene {
    name: &'static str,
    solid: Arc<dyn Obstacle>,
    device: Mechanics,
    hand: SimulatedHand,
    stiffness: f64,
    radius: f64,
    seconds: f64,
    /// On which side the proxy has to stay.
    is_here: fn(DVec3) -> bool,
    /// Whether free space is locally convex, so that the motion justifies every change of the force.
    is_convex: bool,
    /// Whether the hand is at rest in the last second.
    is_at_rest: bool,
}

fn of(x: f64, z: f64) -> DVec3 {
    DVec3::new(x, 0.0, z)
}

/// Those that need neither a servo nor a simulation. They are set as in the tests of the library.
fn scenes() -> Vec<Scene> {
    let scene = |name, solid: Arc<dyn Obstacle>, path: Path, seconds| Scene {
        name,
        solid,
        device: Preset::Omni.mechanics(),
        hand: SimulatedHand::light(path),
        stiffness: 500.0,
        radius: 2.0,
        seconds,
        is_here: |_| true,
        is_convex: true,
        is_at_rest: true,
    };
    let floor = || Arc::new(HalfSpace::floor(0.0));
    let press = || Path::smooth([(0.1, of(0.0, 14.0)), (0.6, of(0.0, -4.0))]);
    let half = 20f64.to_radians();
    let into = Path::smooth([(0.1, of(12.5 * half.tan(), 25.0)), (0.9, of(0.0, -9.0))]);
    let between = [
        (0.2, of(0.0, 0.0)),
        (0.7, of(8.0, -10.0)),
        (1.2, of(-8.0, -20.0)),
        (1.7, of(8.0, -30.0)),
    ];
    let deep = 48.0;
    let round = |i: u32| {
        let turn = -0.6 + 0.003 * f64::from(i);
        (
            0.4 + 0.003 * f64::from(i) * deep / 200.0,
            deep * of(libm::sin(turn), libm::cos(turn)),
        )
    };
    let ball = Ball {
        middle: DVec3::ZERO,
        radius: 50.0,
    };
    let passage = Passage {
        gap: 4.1,
        thickness: 1.0,
    };
    let late = Mechanics {
        delay: 10e-3,
        ..Preset::Omni.mechanics()
    };
    vec![
        scene("S1 wall", floor(), press(), 3.0),
        Scene {
            is_here: |p| p.z > 0.0,
            ..scene(
                "S2 sheet of 1 mm at 0.5 m/s",
                Arc::new(Sheet { thickness: 1.0 }),
                Path::straight([(0.1, of(0.0, 15.0)), (0.154, of(0.0, -12.0))]),
                1.5,
            )
        },
        Scene {
            stiffness: 400.0,
            radius: 0.5,
            ..scene(
                "S3 groove of 40°",
                Arc::new(Groove { half }),
                into.trembling(0.02 * DVec3::X, 35.0),
                3.0,
            )
        },
        Scene {
            is_convex: false,
            is_at_rest: false,
            ..scene(
                "S4 edge of 90°",
                Arc::new(Edge {
                    half: 45f64.to_radians(),
                }),
                Path::straight([(0.2, of(-12.0, -1.2)), (0.44, of(12.0, -1.2))]),
                1.0,
            )
        },
        Scene {
            is_here: |p| p.x.abs() < 2.5,
            ..scene(
                "S7 passage of 2r + 0.1 mm",
                Arc::new(passage),
                Path::smooth(between),
                3.0,
            )
        },
        Scene {
            device: Mechanics {
                quantum: 0.0,
                ..Preset::Omni.mechanics()
            },
            is_at_rest: false,
            ..scene(
                "S9 ball of 50 mm at 0.2 m/s",
                Arc::new(ball),
                Path::straight(std::iter::once((0.0, 54.0 / deep * round(0).1)).chain((0..=400).map(round))),
                0.68,
            )
        },
        Scene {
            stiffness: 0.7 * late.stable_stiffness(4.0),
            device: late,
            ..scene("S11 wall, 10 ms late", floor(), press(), 5.0)
        },
    ]
}

/// All of them.
pub fn all(run: &mut HapticRun, add: &mut Add) -> Result<(), Stopped> {
    let scenes = scenes();
    let count = scenes.len();
    for (i, scene) in scenes.into_iter().enumerate() {
        run.go_on(0.5 + 0.2 * i as f64 / count as f64)?;
        for mode in Mode::ALL {
            let device = SimulatedDevice::new(scene.device.clone(), scene.hand.clone());
            let drive = Bare {
                renderer: mode.make(scene.radius, scene.stiffness),
                force: scene.device.force,
            };
            let mut rig = Rig::new(device, drive, World::shared(Arc::clone(&scene.solid)));
            rig.clock = Some(wall);
            let trace = rig.run(scene.seconds);
            let m = &scene.device;
            let limits = Limits::new(scene.stiffness, m.period, m.quantum, scene.radius);
            let pops = trace.crossings(scene.is_here);
            let place = Place::Scene {
                scene: scene.name,
                mode: mode.name(),
            };
            let name = format!("{}, {}", scene.name, mode.name());
            let mut line = line(name, &trace, &limits, 0, pops, place);
            line.passed &= match scene.is_convex {
                true => line.jumps_over_limit == 0,
                false => line.force_jump_max_n <= limits.slew,
            };
            let rests = Measures::of(&trace, &limits).ripple <= limits.ripple();
            line.passed &= rests || !scene.is_at_rest;
            line.default = mode == Mode::Proxy;
            add(line, run);
        }
    }
    Ok(())
}
