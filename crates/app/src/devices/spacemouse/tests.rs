use proptest::prelude::*;

use super::reports::{HAS_CHARGE, Reports};
use super::*;
use crate::devices::report::{Parse, Rejected};

fn sample_of(reports: &[&[u8]]) -> Sample {
    let mut parser = Reports::default();
    for report in reports {
        parser.take(report).unwrap();
    }
    parser.sample()
}

/// The pose after a while under a sample that came at time 0.
fn after(sample: &Sample, seconds: f64) -> Pose {
    let mut mouse = SpaceMouse::new("cap", Rate::default());
    let count = (seconds * 1000.0).round() as usize;
    let poses = (0..=count).map(|ms| mouse.pose(Some((sample, 0.0)), ms as f64 * 1e-3).unwrap());
    poses.last().unwrap()
}

#[test]
fn the_worked_packet_is_a_turn_of_minus_30_about_y() {
    let sample = sample_of(&[&[0x02, 0x00, 0x00, 0xe2, 0xff, 0x00, 0x00]]);
    assert_eq!(sample.axes[..6], [0, 0, 0, 0, -30, 0]);
    // The cap's Y points to the user and ours away from him.
    let (axis, angle) = after(&sample, 0.1).turn.to_axis_angle();
    assert!(axis.distance(DVec3::Y) < 1e-9 && angle > 0.0, "{axis} {angle}");
}

#[test]
fn split_and_combined_reports_say_the_same() {
    let (t, r) = ([1, 0, 2, 0, 0xfd, 0xff], [4, 0, 0xa2, 0xfe, 0x5e, 0x01]);
    let with = |id: u8, payload: &[u8]| [&[id], payload].concat();
    let split = sample_of(&[&with(1, &t), &with(2, &r)]);
    let combined = sample_of(&[&with(1, &[t, r].concat())]);
    assert_eq!(split, combined);
    assert_eq!(split.axes[..6], [1, 2, -3, 4, -350, 350]);
}

#[test]
fn buttons_come_as_bits_or_as_a_list() {
    assert_eq!(sample_of(&[&[0x03, 0x02, 0x00]]).buttons, 2);
    // All buttons of a SpaceMouse Pro.
    assert_eq!(sample_of(&[&[0x03, 0x37, 0xf1, 0xc0, 0x07]]).buttons, 0x07c0_f137);
    assert_eq!(sample_of(&[&[0x1c, 1, 0, 13, 0, 0, 0]]).buttons, 1 | 1 << 12);
    // Held for long, it is in another list, and still down.
    assert_eq!(
        sample_of(&[&[0x1c, 13, 0], &[0x1d, 13, 0], &[0x1c, 0, 0]]).buttons,
        1 << 12
    );
    assert_eq!(sample_of(&[&[0x1c, 103, 0]]).buttons, 0);
    assert_eq!(sample_of(&[&[0x1c, 13, 0], &[0x1c]]).buttons, 0);
}

#[test]
fn the_battery_is_told() {
    assert_eq!(sample_of(&[&[0x17, 80, 1]]).flags, HAS_CHARGE | 80);
    assert_eq!(sample_of(&[&[0x01, 0, 0, 0, 0, 0, 0]]).flags, 0);
}

#[test]
fn wrong_lengths_and_numbers_are_refused_and_change_nothing() {
    let mut parser = Reports::default();
    parser.take(&[0x01, 5, 0, 6, 0, 7, 0]).unwrap();
    let before = parser.sample();
    for report in [
        &[][..],
        &[0x01],
        &[0x01, 1, 0, 2, 0, 3],
        &[0x01, 1, 0, 2, 0, 3, 0, 4],
        &[0x02; 13],
        &[0x03],
        &[0x03; 10],
        &[0x17],
        &[0x1c, 1],
        &[0x1d; 65],
        &[0x05, 1],
    ] {
        assert!(parser.take(report).is_err(), "{report:?}");
        assert_eq!(parser.sample(), before);
    }
    let why = parser.take(&[0x02, 0]).unwrap_err();
    assert_eq!(why.to_string(), "report 2 has 2 bytes and not 7");
    assert_eq!(parser.take(&[0x99]), Err(Rejected::Unknown { report: 0x99 }));
}

#[test]
fn cap_axes_are_right_away_and_up_in_the_room() {
    let mut sample = Sample::default();
    for (axis, goal) in [(0, DVec3::X), (1, DVec3::NEG_Y), (2, DVec3::NEG_Z)] {
        sample.axes = [0; 8];
        sample.axes[axis] = 350;
        let at = after(&sample, 0.09).at;
        assert!(at.normalize().distance(goal) < 1e-12 && at.length() > 1.0, "{at}");
        sample.axes = [0; 8];
        sample.axes[3 + axis] = 350;
        let turn = after(&sample, 0.09).turn.to_scaled_axis();
        assert!(turn.normalize().distance(goal) < 1e-9, "{turn}");
    }
}

#[test]
fn a_full_cap_goes_at_full_speed_and_no_faster() {
    let rate = Rate::default();
    let full = |count: i32| {
        let mut mouse = SpaceMouse::new("cap", rate);
        let mut sample = Sample::default();
        sample.axes[0] = count;
        // Reports come, so that the speed stays.
        let at = |mouse: &mut SpaceMouse, ms: i32| {
            let now = f64::from(ms) * 1e-3;
            mouse.pose(Some((&sample, now)), now).unwrap().at.x
        };
        for ms in 0..300 {
            at(&mut mouse, ms);
        }
        let from = at(&mut mouse, 300);
        for ms in 301..400 {
            at(&mut mouse, ms);
        }
        (at(&mut mouse, 400) - from) / 0.1
    };
    assert!((full(350) - rate.speed).abs() < 0.01 * rate.speed);
    assert!(
        (full(400) - full(350)).abs() < 1e-9,
        "beyond the range of the descriptor"
    );
    assert!((full(-350) + full(350)).abs() < 1e-9);
    assert_eq!(full((0.04 * 350.0) as i32), 0.0, "the dead zone");
    // No step at its end: one count more is a small speed.
    assert!(full(15) > 0.0 && full(15) < 0.01 * rate.speed);
}

/// A cap whose reports cease, as of a receiver out of reach, must not drive the tool for ever.
#[test]
fn without_reports_the_tool_comes_to_rest_and_a_report_revives_it() {
    let mut mouse = SpaceMouse::new("cap", Rate::default());
    let mut sample = Sample::default();
    sample.axes[0] = 350;
    let mut at = |ms: i32, told: f64| {
        mouse
            .pose(Some((&sample, told)), f64::from(ms) * 1e-3)
            .unwrap()
            .at
            .x
    };
    let mut ways = Vec::new();
    let mut last = at(0, 0.0);
    for ms in 1..=500 {
        let now = at(ms, 0.0);
        ways.push(now - last);
        last = now;
    }
    // Full way a tick: 0.08 mm.
    assert!(ways[98] > 0.07, "held for 100 ms: {}", ways[98]);
    assert!(ways[160] < 0.02 && ways[160] > 0.0, "fades: {}", ways[160]);
    assert!(ways[499] < 1e-6, "rests: {}", ways[499]);
    let largest = ways.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
    assert!(largest < 0.08 * 0.04, "no step of the speed: {largest}");
    let from = last;
    for ms in 501..600 {
        at(ms, 0.5);
    }
    assert!(at(600, 0.5) > from + 4.0);
}

#[test]
fn the_tool_stays_in_its_room_and_the_turn_stays_a_turn() {
    let mut mouse = SpaceMouse::new("cap", Rate::default());
    let sample = Sample {
        axes: [350; 8],
        ..Sample::default()
    };
    for ms in 0..5000 {
        let now = f64::from(ms) * 1e-3;
        let pose = mouse.pose(Some((&sample, now)), now).unwrap();
        assert!(pose.at.abs().max_element() <= 100.0);
        assert!((pose.turn.length() - 1.0).abs() < 1e-12);
    }
    // After a pause the tool goes on from where it was.
    let before = mouse.pose(Some((&Sample::default(), 5.0)), 5.0).unwrap();
    let after = mouse.pose(Some((&sample, 99.0)), 99.0).unwrap();
    assert!(after.at.distance(before.at) < 2.0);
}

proptest! {
    #[test]
    fn any_bytes_are_taken_or_refused(reports in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..70), 0..20)) {
        let mut parser = Reports::default();
        for report in reports {
            let before = parser.sample();
            if parser.take(&report).is_err() {
                prop_assert_eq!(parser.sample(), before);
            }
        }
    }

    #[test]
    fn any_counts_move_the_tool_by_no_more_than_full_speed(axes in any::<[i16; 6]>()) {
        let mut all = [0; 8];
        all[..6].copy_from_slice(&axes.map(i32::from));
        let sample = Sample { axes: all, ..Sample::default() };
        let mut mouse = SpaceMouse::new("cap", Rate::default());
        let mut last = mouse.pose(Some((&sample, 0.0)), 0.0).unwrap();
        for ms in 1..50 {
            let pose = mouse.pose(Some((&sample, 0.0)), f64::from(ms) * 1e-3).unwrap();
            prop_assert!(pose.is_finite());
            prop_assert!((pose.at - last.at).abs().max_element() <= 0.08 + 1e-9);
            last = pose;
        }
    }
}
