use std::f64::consts::PI;

use proptest::prelude::*;

use super::kinematics::*;
use super::report::*;
use super::variants::VARIANTS;
use super::*;
use crate::devices::report::Parse;

/// Angles over all of the room of an arm.
fn all_angles() -> impl Strategy<Value = DVec3> {
    (-0.8..0.8, -0.7..0.9, 0.7..2.2).prop_map(DVec3::from)
}

/// Angles of a place, with the elbow up: the way back that the driver itself never needs.
fn angles_at(arm: &Variant, place: DVec3) -> DVec3 {
    let p = place + DVec3::from(arm.origin);
    let [la, lb, lc] = arm.length;
    let (out, up) = (p.x.hypot(p.y), p.z - la);
    let far = out.hypot(up);
    let at_b = ((lb * lb + far * far - lc * lc) / (2.0 * lb * far)).acos();
    let b = out.atan2(up) - at_b;
    let c = (out - lb * b.sin()).atan2(-(up - lb * b.cos()));
    DVec3::new(p.y.atan2(p.x), b, c)
}

fn counts_at(arm: &Variant, angles: DVec3) -> [i32; 3] {
    std::array::from_fn(|i| (angles[i] / arm.ratio(i) / (2.0 * PI) * arm.counts[i]).round() as i32)
}

fn with(numbers: [i16; 7]) -> [u8; LENGTH] {
    let mut report = [0; LENGTH];
    for (two, n) in report.chunks_exact_mut(2).zip(numbers) {
        two.copy_from_slice(&n.to_le_bytes());
    }
    report
}

#[test]
fn only_page_and_usage_make_a_board_of_an_id() {
    let mut identity = Identity {
        vendor: 0x16c0,
        product: 0x0486,
        usages: vec![(0xffab, 0x0200)],
        ..Identity::default()
    };
    assert!(recognize(&identity));
    identity.usages = vec![(0xffc9, 0x0004)];
    assert!(!recognize(&identity), "the same board with another program");
    identity.usages = vec![(0xffab, 0x0200)];
    identity.product = 0x0483;
    assert!(!recognize(&identity));
}

#[test]
fn a_report_is_six_encoders_a_button_and_a_wish() {
    let mut parser = Reports::default();
    parser.take(&with([1, -2, 300, -400, 5, 6, 0])).unwrap();
    let sample = parser.sample();
    assert_eq!(sample.axes, [1, -2, 300, -400, 5, 6, 0, 0]);
    assert_eq!((sample.buttons, sample.flags), (0, 0));
    // The button hides in the fourth encoder.
    for (count, is_down, told) in [(9600, 1, -400), (5000, 0, 5000), (5001, 1, -4999), (10_000, 1, 0)] {
        parser.take(&with([0, 0, 0, count, 0, 0, 0])).unwrap();
        assert_eq!(
            (parser.sample().buttons, parser.sample().axes[3]),
            (is_down, told)
        );
    }
    parser.take(&with([0, 0, 0, 0, 0, 0, 1])).unwrap();
    assert_eq!(parser.sample().flags, ASKS);
    let before = parser.sample();
    for length in [0, 14, 63, 65, 1024] {
        assert!(parser.take(&vec![9; length]).is_err(), "{length}");
        assert_eq!(parser.sample(), before);
    }
}

#[test]
fn output_reports_are_as_documented() {
    let report = with_currents([-1, 2, 1999]);
    assert_eq!(report.len(), 65);
    assert_eq!(
        report[..16],
        [0, 0xff, 0xff, 2, 0, 0xcf, 0x07, 0, 0, 0, 0, 0, 0, 0, 0, 0]
    );
    let report = with_preset([1, 2, 6000, 4, 5, 6]);
    assert_eq!(report[..15], [0, 4, 0, 5, 0, 6, 0, 1, 0, 1, 0, 2, 0, 0x70, 0x17]);
    assert!(report[15..].iter().all(|b| *b == 0));
}

#[test]
fn a_count_is_43_54_and_64_micrometres_of_woodenhaptics() {
    let arm = Variant::named("woodenhaptics-2019").unwrap();
    assert_eq!(resolution(arm).map(|r| (r * 1e6).round()), [43.0, 54.0, 64.0]);
    // And that is how far the handle goes.
    let bent = DVec3::new(0.0, 0.3, PI / 2.0);
    let counts = counts_at(arm, bent);
    for (motor, way) in [(1, 53.7e-6), (2, 64.1e-6)] {
        let mut next = counts;
        next[motor] += 1;
        let here = position(arm, angles(arm, counts));
        let there = position(arm, angles(arm, next));
        assert!((here.distance(there) - way).abs() < 0.1e-6);
    }
}

/// What the makers' presets say: the second link upright and the third level.
#[test]
fn the_place_of_calibration_has_right_angles() {
    for name in ["woodenhaptics-2019", "woodenhaptics-2015", "polhem-1"] {
        let arm = Variant::named(name).unwrap();
        let counts = [0, 1, 2].map(|i| arm.preset[i].into());
        let rest = angles(arm, counts);
        assert!(
            rest.distance(DVec3::new(0.0, 0.0, PI / 2.0)) < 1e-12,
            "{name}: {rest}"
        );
        let [la, lb, lc] = arm.length;
        let place = DVec3::new(lc, 0.0, la + lb) - DVec3::from(arm.origin);
        assert!(position(arm, rest).distance(place) < 1e-12);
    }
}

#[test]
fn more_force_than_the_motors_have_keeps_its_direction() {
    let variant = Variant::named("vintage").unwrap();
    let mut arm = Arm::new(variant, false);
    assert_eq!(
        arm.order(DVec3::X, DVec3::ZERO),
        Order::default(),
        "before a pose is known"
    );
    let mut sample = Sample::default();
    let counts = counts_at(variant, DVec3::new(0.2, 0.4, 1.3));
    sample.axes[..3].copy_from_slice(&counts);
    arm.pose(Some((&sample, 0.0)), 0.0).unwrap();
    let direction = DVec3::new(0.6, 0.64, 0.48);
    let currents =
        |arm: &mut Arm, force: f64| DVec3::from_slice(&arm.order(direction * force, DVec3::ZERO).force);
    let (small, large) = (currents(&mut arm, 0.01), currents(&mut arm, 100.0));
    assert!(large.abs().max_element() <= 1999.0);
    assert!(large.normalize().distance(small.normalize()) < 1e-9);
    assert_eq!(currents(&mut arm, 5.0), large, "the largest force of the arm");
}

#[test]
fn a_board_pushes_only_when_it_may_and_never_before_it_is_calibrated() {
    let order = Order {
        force: [100.0, -50.0, 3000.0],
        ..Order::default()
    };
    let asks = Order { flags: ASKS, ..order };
    let variant = Variant::named("woodenhaptics-2019").unwrap();
    let said = |board: &mut Board, order: &Order, now: f64| {
        let mut said = Vec::new();
        let mut out = |report: &[u8]| {
            said.push(report.to_vec());
            Ok(())
        };
        board.write(order, now, &mut out).unwrap();
        said
    };
    let mut board = Board::new(variant, true);
    assert_eq!(said(&mut board, &order, 0.0), [with_currents([100, -50, 1999])]);
    assert!(said(&mut board, &order, 0.0004).is_empty(), "said already");
    assert_eq!(
        said(&mut board, &order, 0.001).len(),
        1,
        "the board waits for one every millisecond"
    );
    assert_eq!(
        said(&mut board, &asks, 0.002),
        [with_preset([0, 0, 6000, 0, 0, 0])]
    );
    assert_eq!(said(&mut board, &asks, 0.003), [with_currents([0; 3])]);
    assert_eq!(
        said(&mut board, &asks, 0.103),
        [with_preset([0, 0, 6000, 0, 0, 0])]
    );
    assert_eq!(said(&mut board, &order, 0.104), [with_currents([100, -50, 1999])]);
    let mut board = Board::new(variant, false);
    assert_eq!(said(&mut board, &order, 0.0), [with_currents([0; 3])]);
}

#[test]
fn room_and_arm_differ_by_a_quarter_turn() {
    for v in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(1.0, -2.0, 3.0)] {
        assert_eq!(arm_from_room(room_from_arm(v)), v);
    }
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(room_from_arm);
    assert_eq!(x.cross(y), z, "no mirror");
}

proptest! {
    #[test]
    fn torques_are_the_slopes_of_the_kinematics(angles in all_angles(), f in any::<[i8; 3]>(), which in 0..VARIANTS.len()) {
        let arm = &VARIANTS[which];
        let force = DVec3::from(f.map(f64::from)) / 20.0;
        let torques = torques(arm, angles, force);
        let h = 1e-5;
        for i in 0..3 {
            let mut step = DVec3::ZERO;
            step[i] = h;
            let slope = (position(arm, angles + step) - position(arm, angles - step)) / (2.0 * h);
            // Central differences are off by h² of lengths below half a metre.
            prop_assert!((slope.dot(force) - torques[i]).abs() < 1e-9 * (1.0 + force.length()));
        }
    }

    #[test]
    fn counts_come_back_from_the_place(way in any::<[i8; 3]>(), which in 0..VARIANTS.len()) {
        let arm = &VARIANTS[which];
        // Within a third of the room, where every one of the arms reaches.
        let place = DVec3::from(way.map(f64::from)) / 128.0 * arm.radius / 3.0;
        let counts = counts_at(arm, angles_at(arm, place));
        let nearest = position(arm, angles(arm, counts));
        let [a, b, c] = resolution(arm);
        prop_assert!(nearest.distance(place) < a + b + c, "half a count of each, nearer or further out than the middle");
        prop_assert_eq!(counts_at(arm, angles_at(arm, nearest)), counts);
    }

    /// What the motors do is what the hand feels: their power is force times speed, whatever the ratios.
    #[test]
    fn power_of_the_motors_is_power_at_the_hand(
        angles in all_angles(), rates in any::<[i8; 3]>(), f in any::<[i8; 3]>(), which in 0..VARIANTS.len(),
    ) {
        let arm = &VARIANTS[which];
        let (rates, force) = (DVec3::from(rates.map(f64::from)) / 64.0, DVec3::from(f.map(f64::from)) / 25.0);
        let speed = jacobian(arm, angles) * rates;
        let current = currents(arm, torques(arm, angles, force));
        let power: f64 = (0..3).map(|i| {
            let motor_speed = rates[i] / arm.ratio(i);
            current[i] * arm.torque_constant[i] * motor_speed
        }).sum();
        prop_assert!((power - force.dot(speed)).abs() < 1e-12 * (1.0 + power.abs()));
    }

    #[test]
    fn weight_is_held_by_the_slope_of_its_energy(angles in all_angles(), which in 0..VARIANTS.len()) {
        let arm = &VARIANTS[which];
        let energy = |a: DVec3| {
            let ([mb, mc], [cb, cc], lb) = (arm.mass, arm.centre, arm.length[1]);
            9.81 * (mb * cb * a.y.cos() + mc * (lb * a.y.cos() - cc * a.z.cos()))
        };
        let torques = gravity(arm, angles);
        let h = 1e-5;
        for i in 0..3 {
            let mut step = DVec3::ZERO;
            step[i] = h;
            let slope = (energy(angles + step) - energy(angles - step)) / (2.0 * h);
            prop_assert!((slope - torques[i]).abs() < 1e-9);
        }
    }

    #[test]
    fn the_gimbal_turns_and_does_nothing_else(axes in any::<[i16; 6]>(), which in 0..VARIANTS.len()) {
        let mut arm = Arm::new(&VARIANTS[which], false);
        let mut all = [0; 8];
        all[..6].copy_from_slice(&axes.map(i32::from));
        let sample = Sample { axes: all, ..Sample::default() };
        let pose = arm.pose(Some((&sample, 0.0)), 0.0).unwrap();
        prop_assert!(pose.is_finite());
        prop_assert!((pose.turn.length() - 1.0).abs() < 1e-12);
        prop_assert_eq!(VARIANTS[which].gimbal_counts > 0.0 || pose.turn == DQuat::IDENTITY, true);
    }

    #[test]
    fn any_bytes_are_taken_or_refused(report in prop::collection::vec(any::<u8>(), 0..80)) {
        let mut parser = Reports::default();
        prop_assert_eq!(parser.take(&report).is_ok(), report.len() == LENGTH);
    }

    #[test]
    fn any_encoders_and_forces_order_currents_below_the_limit(axes in any::<[i16; 6]>(), force in any::<[i32; 3]>()) {
        let mut arm = Arm::new(&VARIANTS[0], true);
        let mut all = [0; 8];
        all[..6].copy_from_slice(&axes.map(i32::from));
        let sample = Sample { axes: all, ..Sample::default() };
        arm.pose(Some((&sample, 0.0)), 0.0).unwrap();
        let order = arm.order(DVec3::from(force.map(f64::from)), DVec3::ZERO);
        prop_assert!(order.force.iter().all(|v| v.is_finite() && v.abs() < 2000.0));
    }
}
