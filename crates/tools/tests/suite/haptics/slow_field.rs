//! S9: a curved surface from a slow simulation: what the hand meets between two updates.

use std::sync::Arc;

use glam::DVec3;
use tools::haptics::simulated::{Change, Mechanics, Path, SimulatedHand, World};
use tools::haptics::{Obstacle, Pose, Renderer};

use super::common::{Ball, Check, Loop, omni, plane, proxy, vcp};

/// Along a great circle 2 mm below where a tool of 2 mm touches a ball, at a speed, mm/s.
fn circled(radius: f64, speed: f64, rate: f64, renderer: impl Renderer + 'static) -> Check {
    let deep = radius - 2.0;
    let of = |angle: f64| deep * DVec3::new(angle.sin(), 0.0, angle.cos());
    let turn = (60.0 / deep).min(1.5);
    let time = turn * deep / speed;
    let (down, steps) = (0.4, 400);
    let on = (0..=steps).map(|i| {
        let share = f64::from(i) / f64::from(steps);
        (down + share * time, of(share * turn - 0.5 * turn))
    });
    let above = of(-0.5 * turn) * ((radius + 4.0) / deep);
    let path = Path::straight(std::iter::once((0.0, above)).chain(on));
    let setup = Loop {
        device: Mechanics {
            quantum: 0.0,
            ..omni()
        },
        ..Loop::new(SimulatedHand::light(path), down + time)
    };
    let ball = Ball {
        middle: DVec3::ZERO,
        radius,
    };
    let world = World::changing(
        rate,
        Change::Blended,
        &Pose::at(above),
        move |_, _| -> Arc<dyn Obstacle> { Arc::new(ball) },
    );
    setup.touch_world(world, renderer)
}

#[test]
fn a_snapshot_of_the_field_hides_the_rate_of_the_simulation() {
    for (radius, speed) in [(50.0, 50.0), (50.0, 200.0), (10.0, 50.0), (10.0, 200.0)] {
        for rate in [5.0, 15.0, 30.0] {
            for (name, check) in [
                ("proxy", circled(radius, speed, rate, proxy(2.0, 500.0))),
                ("vcp", circled(radius, speed, rate, vcp(2.0, 500.0))),
            ] {
                check.assert(
                    &format!("{name}, ball of {radius} mm at {speed} mm/s and {rate} Hz"),
                    &[
                        ("P2", check.is_passive()),
                        ("P3", check.is_continuous()),
                        ("P4", check.stays_out()),
                    ],
                );
            }
        }
    }
}

/// At each refresh of the plane the force jumps by some K v²/(2 R f²).
#[test]
fn a_tangent_plane_jumps_when_it_is_refreshed() {
    for (radius, speed, rate) in [(50.0, 200.0, 15.0), (50.0, 200.0, 30.0), (10.0, 200.0, 30.0)] {
        let check = circled(radius, speed, rate, plane(2.0, 500.0, rate));
        let way = speed / rate;
        let jump = 1e-3 * 500.0 * way * way / (2.0 * radius);
        assert!(check.measures.jumps_over > 0, "{:#?}", check.measures);
        assert!(
            check.measures.jump > 0.5 * jump,
            "{jump} N expected, {:#?}",
            check.measures
        );
    }
}
