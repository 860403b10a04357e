//! Ticks take no memory: the allocator of another thread would make them wait.

use std::sync::Arc;

use bspline::HierarchicalSpline;
use bspline::hierarchical::Lattice;
use glam::{DAffine3, DVec3};
use tools::haptics::{
    Abilities, Demand, DeviceError, Obstacle, Pose, Proxy, ProxyOptions, Reading, Renderer, Servo,
    ServoOptions, SnapshotMaker, Touch, TouchedObject, Vcp, VcpOptions,
};
use tools::paint::Layers;

/// A ball of 12 mm in the middle of a box of 40 mm, 40 densities to a millimetre.
fn ball() -> HierarchicalSpline<f32> {
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_scale(DVec3::splat(1.0)),
        cells: [40; 3],
    };
    let middle = DVec3::splat(20.0);
    HierarchicalSpline::schoenberg(lattice, 40.0, |p| 40.0 * (12.0 - p.distance(middle)) + 300.0).unwrap()
}

fn reading(at: DVec3) -> Reading {
    Reading {
        pose: Pose::at(at),
        buttons: 0,
        age: 0.0,
    }
}

/// A tool of a radius down onto the ball and over it.
fn hand(radius: f64, n: u32) -> DVec3 {
    let angle = 1e-3 * f64::from(n);
    let (sine, cosine) = libm::sincos(angle);
    let depth = 3.0 * libm::sin(2.0 * angle);
    DVec3::splat(20.0) + (13.0 + radius - depth) * DVec3::new(sine, 0.0, cosine)
}

#[test]
fn ticks_take_no_memory() {
    let abilities = Abilities {
        name: "test".into(),
        force: 10.0,
        continuous_force: 10.0,
        torque: 0.0,
        damping: 1.0,
        stiffness: f64::INFINITY,
        resolution: 0.0,
        period: 1e-3,
        delay: 0.0,
        reach: 100.0,
    };
    let field = Arc::new(ball());
    let layers = Layers::new();
    for radius in [0.0, 2.0, 5.0] {
        let object = TouchedObject {
            id: 0,
            field: field.clone(),
            iso: 300.0,
            world_from_object: DAffine3::IDENTITY,
            layers: &layers,
            default: Touch {
                friction: 0.3,
                ..Touch::default()
            },
        };
        let mut maker = SnapshotMaker::new(Demand::of_ball(radius));
        let snapshot = maker.make(hand(radius, 300), &[object], 0);
        let obstacle: &dyn Obstacle = &*snapshot;
        let renderers: [Box<dyn Renderer>; 2] = [
            Box::new(Proxy::new(ProxyOptions {
                radius,
                stretch: 0.1,
                ..ProxyOptions::default()
            })),
            Box::new(Vcp::new(VcpOptions {
                radius,
                ..VcpOptions::default()
            })),
        ];
        for renderer in renderers {
            let mut servo = Servo::new(&abilities, ServoOptions::default(), |_, _| renderer).unwrap();
            servo.arm();
            let gone = DeviceError::Gone("test".into());
            let mut pressed = 0;
            let counted = allocation_counter::measure(|| {
                for n in 0..600 {
                    let tick = servo.tick(Ok(&reading(hand(radius, n))), obstacle, 0.0, 1e-3);
                    pressed += u32::from(tick.felt.force != DVec3::ZERO);
                }
                // Late, silent, and gone.
                servo.tick(Ok(&reading(hand(radius, 600))), obstacle, 1.0, 8e-3);
                servo.tick(Err(&gone), obstacle, 0.0, 1e-3);
            });
            assert!(pressed > 100, "radius {radius}: {pressed} ticks in contact");
            assert_eq!(counted.count_total, 0, "radius {radius}");
        }
    }
}
