use glam::{DQuat, DVec3};

use super::super::gates::Status;
use super::super::{Contact, Touch};
use super::*;

const DT: f64 = 1e-3;

/// A half space below z = 0.
struct Ground;

impl Obstacle for Ground {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        (p.z, DVec3::Z)
    }

    fn finest(&self) -> f64 {
        1.0
    }

    fn touch(&self, _: DVec3) -> Touch {
        Touch::default()
    }
}

/// Pushes out along the gradient: right for a half space.
struct Spring {
    stiffness: f64,
    is_inside: Option<bool>,
}

impl Renderer for Spring {
    fn tick(&mut self, obstacle: &dyn Obstacle, hand: &Pose, _: f64) -> Felt {
        let (distance, normal) = obstacle.distance(hand.at);
        let is_inside = self.is_inside.unwrap_or(true) && distance < 0.0;
        self.is_inside = Some(is_inside);
        if distance >= 0.0 || is_inside {
            let contact = if is_inside { Contact::Inside } else { Contact::Free };
            return Felt {
                contact,
                ..Felt::nothing(hand)
            };
        }
        Felt {
            force: -self.stiffness * 1e-3 * distance * normal,
            torque: DVec3::new(5.0, 0.0, 0.0),
            proxy: Pose::at(hand.at - distance * normal),
            contact: Contact::Slides,
        }
    }

    fn reset(&mut self) {
        self.is_inside = None;
    }
}

fn abilities() -> Abilities {
    Abilities {
        name: "a device".into(),
        force: 10.0,
        continuous_force: 0.0,
        torque: 1000.0,
        damping: 2.0,
        stiffness: f64::INFINITY,
        resolution: 0.0,
        period: 1e-3,
        delay: 0.0,
        reach: 80.0,
    }
}

fn servo(options: ServoOptions) -> Servo {
    let make = |stiffness, _| -> Box<dyn Renderer> {
        Box::new(Spring {
            stiffness,
            is_inside: None,
        })
    };
    Servo::new(&abilities(), options, make).unwrap()
}

fn told(at: DVec3) -> Reading {
    Reading {
        pose: Pose::at(at),
        buttons: 1,
        age: 0.0,
    }
}

fn tick(servo: &mut Servo, at: DVec3) -> Tick {
    servo.tick(Ok(&told(at)), &Ground, 0.0, DT)
}

/// Armed in the air and moved down to a place, at 0.1 m/s or slower.
fn pressed(servo: &mut Servo, air: DVec3, to: DVec3) -> Tick {
    servo.arm();
    for _ in 0..2100 {
        tick(servo, air);
    }
    assert_eq!(servo.stage(), Stage::Live);
    for step in 0..=1000 {
        tick(servo, air.lerp(to, f64::from(step) / 1000.0));
    }
    tick(servo, to)
}

#[test]
fn the_hand_feels_one_stiffness_at_every_scale() {
    for scale in [0.1, 1.0, 5.0, 20.0] {
        let workspace = Workspace {
            scale,
            turn: DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2),
            shift: DVec3::new(7.0, 0.0, scale),
        };
        let mut servo = servo(ServoOptions {
            workspace,
            ..ServoOptions::default()
        });
        // The device's y is the scene's z, and its 0 lies 1 mm of the device above ground.
        let pressed = pressed(&mut servo, DVec3::Y, -4.0 * DVec3::Y);
        let expected = Wrench {
            force: 500.0 * 3e-3 * DVec3::Y,
            torque: DVec3::new(5.0 / scale, 0.0, 0.0),
        };
        assert!(
            (pressed.wrench.force - expected.force).length() < 1e-9,
            "{scale}: {pressed:?}"
        );
        assert!(
            (pressed.wrench.torque - expected.torque).length() < 1e-9,
            "{scale}: {pressed:?}"
        );
        assert!((pressed.record.proxy[2]).abs() < 1e-5 * scale as f32);
    }
}

#[test]
fn a_stiffness_above_the_ceiling_is_lowered_and_said() {
    let wished = ServoOptions {
        stiffness: 50_000.0,
        ..ServoOptions::default()
    };
    // (2 + 1) N s/m over half a millisecond.
    let lowered = servo(wished).granted();
    assert!((lowered.stiffness - 6000.0).abs() < 1e-9, "{lowered:?}");
    let note = lowered.note().unwrap();
    assert!(note.contains("50000") && note.contains("6000"), "{note}");
    assert_eq!(servo(ServoOptions::default()).granted().note(), None);
    let mut servo = servo(wished);
    let pressed = pressed(&mut servo, DVec3::Z, -DVec3::Z);
    assert!((pressed.wrench.force.z - 6.0).abs() < 1e-9, "{pressed:?}");
}

#[test]
fn lateness_friction_makers_and_damping_each_lower_the_ceiling() {
    let late = Abilities {
        delay: 1e-3,
        ..abilities()
    };
    let stiffness = |abilities: &Abilities, damping, friction| {
        Ceiling::new(abilities, DT, 1.0, damping, friction).stiffness()
    };
    assert!((stiffness(&late, 0.0, None) - 2000.0).abs() < 1e-9);
    assert!((stiffness(&late, 1.5, None) - 1000.0).abs() < 1e-9);
    let counting = Abilities {
        resolution: 0.055,
        ..abilities()
    };
    assert!((stiffness(&counting, 0.0, Some(0.1)) - 2.0 * 0.1 / 55e-6).abs() < 1e-9);
    assert!((stiffness(&counting, 0.0, None) - 6000.0).abs() < 1e-9);
    let made = Abilities {
        stiffness: 700.0,
        ..abilities()
    };
    assert_eq!(stiffness(&made, 0.0, None), 700.0);
    // A slow device holds each force for its own period.
    let slow = Abilities {
        period: 16e-3,
        ..abilities()
    };
    assert!((stiffness(&slow, 0.0, None) - 375.0).abs() < 1e-9);
    let options = ServoOptions {
        damping: 10.0,
        ..ServoOptions::default()
    };
    let granted = servo(options).granted();
    assert_eq!((granted.damping, granted.stiffness), (1.5, 500.0));
}

#[test]
fn nothing_that_damps_is_an_error_and_the_ceiling_can_be_left_out() {
    let loose = Abilities {
        damping: 0.0,
        ..abilities()
    };
    let options = ServoOptions {
        hand_damping: 0.0,
        ..ServoOptions::default()
    };
    let make = |stiffness, _| -> Box<dyn Renderer> {
        Box::new(Spring {
            stiffness,
            is_inside: None,
        })
    };
    let why = Servo::new(&loose, options, make).err().unwrap();
    assert!(matches!(why, ServoError::NoStiffness { .. }), "{why}");
    let far = ServoOptions {
        workspace: Workspace {
            scale: 1e30,
            ..Workspace::default()
        },
        ..ServoOptions::default()
    };
    let why = Servo::new(&abilities(), far, make).err().unwrap();
    assert!(
        why.to_string().contains("scale") && why.to_string().contains("1e6 at most"),
        "{why}"
    );
    let unbound = ServoOptions {
        is_bound: false,
        ..options
    };
    let servo = Servo::new(&loose, unbound, make).unwrap();
    assert_eq!(servo.granted().stiffness, 500.0);
    // A device without force cannot tremble: its proxy is still shown.
    let mouse = Abilities { force: 0.0, ..loose };
    let mut servo = Servo::new(&mouse, options, make).unwrap();
    let pressed = pressed(&mut servo, DVec3::Z, -DVec3::Z);
    assert_eq!(pressed.wrench.force, DVec3::ZERO);
    assert!((pressed.record.wished - 0.5).abs() < 1e-6, "{pressed:?}");
}

#[test]
fn unplugged_in_contact_the_force_is_gone_and_stays_so() {
    let mut servo = servo(ServoOptions::default());
    let pressed = pressed(&mut servo, DVec3::Z, -2.0 * DVec3::Z);
    assert!((pressed.wrench.force.z - 1.0).abs() < 1e-9);
    let gone = DeviceError::Gone("a device".into());
    let left = servo.tick(Err(&gone), &Ground, 0.0, DT);
    assert_eq!(left.wrench, Wrench::ZERO);
    assert!(left.record.status.has(Status::BLIND));
    assert_eq!(left.record.status.trip(), Some(Trip::Gone));
    // Plugged in again, where it was: still none.
    for _ in 0..3000 {
        assert_eq!(tick(&mut servo, -2.0 * DVec3::Z).wrench, Wrench::ZERO);
    }
    // Armed inside the solid: none until the hand was outside, and then by the ramp.
    servo.arm();
    for _ in 0..3000 {
        assert_eq!(tick(&mut servo, -2.0 * DVec3::Z).wrench, Wrench::ZERO);
    }
    for step in 0..100 {
        let z = -2.0 + 0.03 * f64::from(step);
        assert_eq!(tick(&mut servo, z * DVec3::Z).wrench, Wrench::ZERO);
    }
    for step in 0..100 {
        let z = 0.97 - 0.03 * f64::from(step);
        let force = tick(&mut servo, z * DVec3::Z).wrench.force.z;
        assert!((0.0..=0.5e-3 * 2e3 * 0.11).contains(&force), "{force}");
    }
}

/// A stroke that pulls while the simulation is silent is lost hold of: nothing pulls any more until it was let go.
#[test]
fn a_stroke_that_faded_is_felt_again_only_after_it_was_let_go() {
    let mut servo = servo(ServoOptions::default());
    pressed(&mut servo, DVec3::Z, 3.0 * DVec3::Z);
    let step = StrokeStep {
        number: 1,
        reference: DVec3::ZERO,
        cursor: 3.0 * DVec3::Z,
        force: 1.0,
        rigidity: 0.1,
    };
    let told = told(3.0 * DVec3::Z);
    let mut ticks = |step: Option<StrokeStep>, heartbeat: f64, count: usize| {
        let tick = |_| {
            servo.pull(step);
            servo.tick(Ok(&told), &Ground, heartbeat, DT).wrench.force.z
        };
        (0..count).map(tick).last().expect("some ticks")
    };
    assert!((ticks(Some(step), 0.0, 100) + 1.0).abs() < 1e-9);
    assert_eq!(ticks(Some(step), 0.6, 101), 0.0);
    assert_eq!(ticks(Some(StrokeStep { number: 2, ..step }), 0.0, 500), 0.0);
    assert_eq!(ticks(None, 0.0, 10), 0.0);
    assert!((ticks(Some(StrokeStep { number: 3, ..step }), 0.0, 100) + 1.0).abs() < 1e-9);
}

#[test]
fn a_record_tells_what_happened() {
    let mut servo = servo(ServoOptions::default());
    let pressed = pressed(&mut servo, DVec3::Z, -2.0 * DVec3::Z);
    let record = pressed.record;
    assert_eq!(record.tick, 3102);
    assert_eq!(record.buttons, 1);
    assert_eq!(record.hand, [0.0, 0.0, -2.0]);
    assert_eq!(record.proxy, [0.0, 0.0, 0.0]);
    assert!((record.force[2] - 1.0).abs() < 1e-6 && (record.wished - 1.0).abs() < 1e-6);
    assert_eq!(record.status.contact(), Contact::Slides);
    assert!(record.status.is_live() && record.status.trip().is_none());
    // ½ K x² = 1 mJ, less half a step of a held force, and what the device's damping took: b v² for 1 s at 3 mm/s.
    assert!((record.energy - 1e-3 - 18e-6).abs() < 1e-5, "{}", record.energy);
}

#[test]
fn a_tick_allocates_nothing_whatever_happens() {
    let mut servo = servo(ServoOptions::default());
    servo.arm();
    let gone = DeviceError::Gone("a device".into());
    let counted = allocation_counter::measure(|| {
        for n in 0..5000 {
            let at = DVec3::new(0.0, 0.0, 3.0 - 2e-3 * f64::from(n));
            tick(&mut servo, at);
        }
        tick(&mut servo, DVec3::NAN);
        servo.arm();
        servo.tick(Err(&gone), &Ground, 0.0, DT);
    });
    assert_eq!(servo.status().trip(), Some(Trip::Gone));
    assert_eq!(counted.count_total, 0);
}
