//! Fields of growing size, through the snapshots that a session makes of them.

use std::sync::Arc;

use ::tools::haptics::simulated::{Limits, Path, led};
use ::tools::haptics::{Demand, SnapshotMaker, Touch, TouchedObject};
use bspline::Field;
use glam::{DAffine3, DVec3};

use super::super::ball::Ball;
use super::{Add, HapticRun, Mode, Place, Stopped, line, wall};

const STIFFNESS: f64 = 500.0;

/// Along the surface of the ball, 1 mm below where a tool of a radius, mm, would rest.
fn way(field: &dyn Field, radius: f64) -> Path {
    let middle = DVec3::splat(16.0);
    let surface = |turn: f64| {
        let (s, c) = libm::sincos(turn);
        let out = DVec3::new(0.8 * c + 0.36 * s, 0.8 * s, 0.6 * c - 0.48 * s);
        let (mut low, mut high) = (0.0, 16.0);
        for _ in 0..50 {
            let far = 0.5 * (low + high);
            if field.value(middle + far * out) > 0.0 {
                low = far
            } else {
                high = far
            }
        }
        (out, low)
    };
    let at = |turn: f64, over: f64| {
        let (out, far) = surface(turn);
        middle + (far + over) * out
    };
    let along = (0..=100).map(|i| {
        (
            0.1 + 0.01 * f64::from(i),
            at(0.4 + 0.004 * f64::from(i), radius - 1.0),
        )
    });
    Path::straight(std::iter::once((0.0, at(0.4, radius + 2.0))).chain(along))
}

/// Balls of ever more levels.
pub fn all(run: &mut HapticRun, add: &mut Add) -> Result<(), Stopped> {
    let depths = if run.quick { 0..=1 } else { 0..=4 };
    for depth in depths {
        let ball = Ball::new(depth);
        let field = Arc::new(ball.field);
        let voxels = (super::super::ball::CELLS << depth).pow(3);
        let bytes = size_of::<f32>() * field.coefficient_count();
        for radius in [0.0, 2.0, 5.0] {
            run.go_on(0.7 + 0.06 * f64::from(depth))?;
            let path = way(&*field, radius);
            let object = TouchedObject {
                id: 0,
                field: field.clone(),
                iso: 0.0,
                world_from_object: DAffine3::IDENTITY,
                layers: &Default::default(),
                default: Touch::default(),
            };
            let mut maker = SnapshotMaker::new(Demand::of_ball(radius));
            let snapshot = maker.make(path.at(0.6).0, &[object], 0);
            let mut renderer = Mode::Proxy.make(radius, STIFFNESS);
            led(&path, 1.1, &*snapshot, &mut *renderer, None);
            renderer.reset();
            let trace = led(&path, 1.1, &*snapshot, &mut *renderer, Some(wall));
            let limits = Limits::new(STIFFNESS, 1e-3, 0.0, radius);
            let name = format!("ball in a box of {voxels} voxels, proxy");
            let mut line = line(name, &trace, &limits, bytes, 0, Place::Size { radius });
            line.passed &= line.force_jump_max_n <= limits.slew;
            add(line, run);
        }
    }
    Ok(())
}
