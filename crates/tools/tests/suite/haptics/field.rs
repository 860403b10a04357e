//! Fields that are no distances, through bricks of their distance: S8 and S9 as they are in use, other iso-values, two objects.

use std::sync::Arc;

use bspline::{Aabb, Field, TensorSpline};
use glam::{DVec2, DVec3};
use tools::haptics::simulated::{Change, Mechanics, Path, SimulatedHand, World};
use tools::haptics::{BrickOptions, DistanceBrick, Obstacle, Pose, Renderer, Surface, Together};

use super::common::{Bumps, Check, Loop, omni, plane, proxy, spline, surface_between, vcp};

/// A brick round the hand at each step of a simulation, Hz.
fn bricks<'a>(field: &'a dyn Field, iso: f64, rate: f64, start: DVec3, options: BrickOptions) -> World<'a> {
    World::changing(
        rate,
        Change::Steps,
        &Pose::at(start),
        move |_, hand| -> Arc<dyn Obstacle> {
            Arc::new(DistanceBrick::new(&Surface::new(field, iso), hand.at, &options))
        },
    )
}

/// Waves of 1.2 mm, 4 and 7 mm long, in numbers like those of a scan: 1000 a millimetre, the surface at 300.
fn bumpy() -> TensorSpline<f64> {
    let bumps = Bumps {
        amplitude: 1.2,
        waves: DVec2::new(4.0, 7.0),
    };
    let within = Aabb::new(DVec3::new(-8.0, -8.0, -8.0), DVec3::new(32.0, 24.0, 8.0));
    spline(&within, 0.5, |p| 300.0 - 1000.0 * bumps.distance(p).0)
}

/// There and back over the bumps at 0.15 m/s.
fn over_bumps(field: &TensorSpline<f64>, renderer: impl Renderer + 'static) -> Check {
    let path = Path::straight([
        (0.0, DVec3::new(0.0, 0.0, 6.0)),
        (0.15, DVec3::new(0.0, 0.0, 1.0)),
        (0.32, DVec3::new(22.0, 12.0, 1.0)),
        (0.49, DVec3::new(0.0, 0.0, 1.0)),
        (0.6, DVec3::new(0.0, 0.0, 8.0)),
    ]);
    let start = path.at(0.0).0;
    let setup = Loop::new(SimulatedHand::light(path), 0.7);
    let options = BrickOptions {
        reach: 11.0,
        ..BrickOptions::of_tool(2.0, 0.5)
    };
    setup.touch_world(bricks(field, 300.0, 30.0, start, options), renderer)
}

#[test]
fn bumps_of_a_field_that_is_no_distance_are_slid_over() {
    let field = bumpy();
    let check = over_bumps(&field, proxy(2.0, 500.0));
    check.assert(
        "bricks of bumps",
        &[
            ("it presses", check.measures.force > 0.5),
            ("P2", check.is_passive()),
            ("P3", check.is_slewed()),
            ("P4", check.stays_out()),
        ],
    );
    // Where the distance is true and the hand less deep than the surface is curved, the stateless contact does as well.
    let wild = over_bumps(&field, vcp(2.0, 500.0));
    let holds = wild.is_passive() && wild.is_slewed() && wild.stays_out();
    assert!(holds, "{:#?}", wild.measures);
    let flat = over_bumps(&field, plane(2.0, 500.0, 30.0));
    assert!(!flat.is_slewed() && !flat.stays_out(), "{:#?}", flat.measures);
}

/// A ball as a square of the distance to its middle: `900 + 10 (R² − |p|²)`, off by what coefficients from values smooth.
fn ball(radius: f64) -> TensorSpline<f64> {
    let reach = DVec3::splat(radius + 6.0);
    let cell = (radius / 8.0).max(1.0);
    let cells = ((radius + 6.0) / cell).ceil();
    let within = Aabb::new(
        -reach * (cells * cell / (radius + 6.0)),
        reach * (cells * cell / (radius + 6.0)),
    );
    spline(&within, cell, move |p| {
        900.0 + 10.0 * (radius * radius - p.length_squared())
    })
}

#[test]
fn the_rate_of_the_simulation_is_not_felt_through_bricks() {
    for (radius, speed, rate) in [
        (10.0, 50.0, 5.0),
        (10.0, 200.0, 30.0),
        (50.0, 200.0, 30.0),
        (50.0, 50.0, 15.0),
    ] {
        let field = ball(radius);
        let deep = radius - 1.0;
        let of = |angle: f64| deep * DVec3::new(angle.sin(), 0.0, angle.cos());
        let turn = (0.3 * speed / deep).min(1.2);
        let time = turn * deep / speed;
        let on = (0..=200).map(|i| {
            let share = f64::from(i) / 200.0;
            (0.2 + share * time, of(share * turn - 0.5 * turn))
        });
        let above = of(-0.5 * turn) * ((radius + 4.0) / deep);
        let path = Path::straight(std::iter::once((0.0, above)).chain(on));
        let setup = Loop {
            device: Mechanics {
                quantum: 0.0,
                ..omni()
            },
            ..Loop::new(SimulatedHand::light(path), 0.2 + time)
        };
        let options = BrickOptions {
            reach: 1e-3 * 1.5 * speed * 1e3 / rate + 6.0,
            ..BrickOptions::of_tool(2.0, 1.0)
        };
        let check = setup.touch_world(bricks(&field, 900.0, rate, above, options), proxy(2.0, 500.0));
        check.assert(
            &format!("ball of {radius} mm at {speed} mm/s, {rate} Hz"),
            &[
                ("it presses", check.measures.force > 0.3),
                ("P2", check.is_passive()),
                ("P3", check.is_continuous()),
                ("P4", check.stays_out()),
            ],
        );
    }
}

#[test]
fn any_iso_value_has_its_surface() {
    let field = ball(10.0);
    for iso in [400.0, 900.0, 1300.0] {
        let top = surface_between(&field, iso, DVec3::new(0.0, 0.0, 1.0), DVec3::new(0.0, 0.0, 15.0));
        let path = Path::smooth([(0.0, 1.4 * top), (0.5, 0.8 * top)]);
        let setup = Loop::new(SimulatedHand::light(path), 2.0);
        let options = BrickOptions::of_tool(2.0, 1.0);
        let brick = DistanceBrick::new(&Surface::new(&field, iso), top, &options);
        let check = setup.touch(brick, proxy(2.0, 500.0));
        let end = check.trace.ticks.last().expect("ticks");
        // The proxy may have slid aside by the counts of the encoder; the ball is round.
        let wanted = 0.5 * (top.z + 2.0 - end.read.at.length());
        assert!(
            (end.force.length() / wanted - 1.0).abs() < 0.02,
            "{} N at {iso}, {wanted} N by its radius {}",
            end.force.length(),
            top.z
        );
        check.assert(
            &format!("iso-value {iso}"),
            &[
                ("P1", check.rests()),
                ("P2", check.is_passive()),
                ("P3", check.is_slewed()),
                ("P4", check.stays_out()),
            ],
        );
    }
}

/// Two bricks as one obstacle that owns them.
struct Pair([DistanceBrick; 2]);

impl Obstacle for Pair {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        Together(&self.0).distance(p)
    }

    fn finest(&self) -> f64 {
        Together(&self.0).finest()
    }
}

#[test]
fn two_fields_hold_a_tool_between_them() {
    let field = ball(10.0);
    let options = BrickOptions::of_tool(2.0, 1.0);
    // The same ball twice, the second at another iso-value.
    let isos = [900.0, 700.0];
    let places = [DVec3::new(-9.0, 0.0, 0.0), DVec3::new(9.0, 0.0, 0.0)];
    let middle = DVec3::new(0.0, 0.0, 8.0);
    let brick = |i: usize| {
        let surface = Surface::new(&field, isos[i]).placed(glam::DAffine3::from_translation(places[i]));
        DistanceBrick::new(&surface, middle, &options)
    };
    let pair = Pair([brick(0), brick(1)]);
    let path = Path::smooth([
        (0.0, DVec3::new(1.0, 0.0, 14.0)),
        (0.6, DVec3::new(0.0, 0.0, 2.0)),
    ]);
    let check = Loop::new(SimulatedHand::light(path), 2.0).touch(pair, proxy(2.0, 500.0));
    let radius = |iso| surface_between(&field, iso, DVec3::Z, 15.0 * DVec3::Z).z + 2.0;
    let end = check.trace.ticks.last().expect("ticks").proxy.at;
    for (place, iso) in places.into_iter().zip(isos) {
        let off = end.distance(place) - radius(iso);
        assert!(off.abs() < 0.01, "{off} mm from the ball at {place}");
    }
    check.assert(
        "between two fields",
        &[
            ("P1", check.rests()),
            ("P2", check.is_passive()),
            ("P3", check.is_slewed()),
            ("P4", check.stays_out()),
        ],
    );
}
