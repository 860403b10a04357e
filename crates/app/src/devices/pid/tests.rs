use std::sync::Arc;

use proptest::prelude::*;
use tools::haptics::{Device, DeviceError};

use super::descriptor::{Descriptor, DescriptorError, Usage, Way};
use super::effects::{Kind, Spring};
use super::input::Reports;
use super::layout::Layout;
use super::makers::{ARRAY, Items, VARIABLE, openffboard, rhino};
use super::slot::Part;
use super::*;
use crate::devices::clock::Clock;
use crate::devices::fake::Fake;
use crate::devices::link::{Link, Linked, Reader, Writer};
use crate::devices::report::{Parse, Rejected};

fn layout(bytes: &[u8]) -> Layout {
    Layout::of(Descriptor::parse(bytes).unwrap()).unwrap()
}

#[test]
fn set_constant_is_as_documented() {
    let (a, b) = (layout(&openffboard()), layout(&rhino()));
    assert_eq!(a.set_constant(3, 1.0).unwrap(), [5, 3, 0xff, 0x7f]);
    assert_eq!(a.set_constant(3, -1.0).unwrap(), [5, 3, 0x01, 0x80]);
    assert_eq!(b.set_constant(7, 0.5).unwrap(), [105, 7, 0x00, 0x08]);
    assert_eq!(b.set_constant(7, -1.0).unwrap(), [105, 7, 0x00, 0xf0]);
    assert_eq!(
        b.set_constant(7, 9.0).unwrap(),
        [105, 7, 0x00, 0x10],
        "held to its range"
    );
}

#[test]
fn set_condition_is_as_documented() {
    let spring = Spring {
        centre: -0.5,
        stiffness: [1.0, 0.25],
        saturation: 0.75,
    };
    // Number, effect, axis, centre, both stiffnesses, both saturations, dead band.
    let said = layout(&rhino()).set_spring(2, 1, &spring).unwrap();
    assert_eq!(
        said,
        [
            103, 2, 1, 0x00, 0xf8, 0x00, 0x10, 0x00, 0x04, 0x00, 0x0c, 0x00, 0x0c, 0, 0
        ]
    );
    let said = layout(&openffboard()).set_spring(2, 0, &spring).unwrap();
    // -16383.5 goes away from zero.
    assert_eq!(
        said,
        [
            3, 2, 0, 0x00, 0xc0, 0xff, 0x7f, 0x00, 0x20, 0xff, 0x5f, 0xff, 0x5f, 0, 0
        ]
    );
}

#[test]
fn set_effect_is_as_documented() {
    let (a, b) = (layout(&openffboard()), layout(&rhino()));
    let said = a
        .set_effect(1, Kind::Constant, [true, false, false], 27_000, 200)
        .unwrap();
    // Effect, kind, duration, repeat, period, delay, gain, button, axes with the direction, both directions.
    let expected = [
        1, 1, 1, 200, 0, 0, 0, 0, 0, 0, 0, 0xff, 0, 0b101, 0x78, 0x69, 0, 0,
    ];
    assert_eq!(said, expected);
    let said = a
        .set_effect(1, Kind::Spring, [true, true, false], 0, 200)
        .unwrap();
    assert_eq!(said[2], 8);
    assert_eq!(said[13..], [0b011, 0, 0, 0, 0]);
    let said = b
        .set_effect(4, Kind::Constant, [false, true, false], 9000, 300)
        .unwrap();
    // Effect, kind, duration, repeat, period, gain, button, axes, directions of one byte, delay.
    let expected = [
        101, 4, 1, 0x2c, 0x01, 0, 0, 0, 0, 0x00, 0x10, 0, 0b110, 64, 0, 0, 0,
    ];
    assert_eq!(said, expected);
}

/// The same command is a bit in one device and a number in the other, in another order.
#[test]
fn commands_are_bits_or_numbers_as_the_descriptor_says() {
    let (a, b) = (layout(&openffboard()), layout(&rhino()));
    let said = |l: &Layout| {
        let c = &l.control;
        [c.enable, c.disable, c.stop, c.reset.unwrap()].map(|command| l.command(command))
    };
    assert_eq!(said(&a), [[0x0c, 1], [0x0c, 2], [0x0c, 4], [0x0c, 8]]);
    assert_eq!(said(&b), [[112, 2], [112, 1], [112, 3], [112, 4]]);
    assert_eq!(a.start(9), [0x0a, 9, 1, 1]);
    assert_eq!(b.start(9), [110, 9, 1, 1]);
    assert_eq!(a.full_gain().unwrap(), [0x0d, 255]);
    assert_eq!(b.full_gain().unwrap(), [113, 255]);
}

#[test]
fn an_effect_is_made_and_its_number_is_asked_for() {
    for (bytes, sent, load, spring) in [
        (openffboard(), [0x11, 1, 0, 0], 0x12, 8),
        (rhino(), [5, 1, 0, 0], 6, 8),
    ] {
        let (layout, mut fake) = (layout(&bytes), Fake::new(Clock::standing()));
        let mut tries = 0;
        fake.answer(Box::new(move |report, _| {
            tries += 1;
            assert_eq!(report, load);
            // Busy at first: neither of the three.
            vec![load, 7, u8::from(tries > 5), 0, 1]
        }));
        assert_eq!(layout.create(&mut fake, Kind::Constant), Ok(7));
        assert_eq!(fake.features(), [sent]);
        assert_eq!(layout.create(&mut fake, Kind::Spring), Ok(7));
        assert_eq!(fake.features()[1][1], spring);
        fake.answer(Box::new(move |_, _| vec![load, 0, 2, 0, 0]));
        assert_eq!(layout.create(&mut fake, Kind::Constant), Err(CreateError::Full));
        fake.answer(Box::new(move |_, _| vec![load, 0]));
        assert_eq!(
            layout.create(&mut fake, Kind::Constant),
            Err(CreateError::NoAnswer)
        );
        fake.unplug();
        assert!(matches!(
            layout.create(&mut fake, Kind::Constant),
            Err(CreateError::Transport(_))
        ));
    }
}

#[test]
fn input_reports_give_axes_and_buttons() {
    let mut parser = Reports::new(layout(&openffboard()).input);
    let mut report = vec![1, 0x05, 0, 0, 0x80, 0, 0, 0, 0xff];
    report.extend([0x01, 0x80, 0xff, 0x7f, 0x64, 0x00]);
    report.extend([9; 10]);
    parser.take(&report).unwrap();
    let sample = parser.sample();
    assert_eq!(sample.axes[..3], [-32_767, 32_767, 100]);
    assert_eq!(sample.buttons, 0x8000_0005, "32 of the 64");
    // What tells the state of the motors is known and says nothing of the hand.
    parser.take(&[2, 0xff, 1]).unwrap();
    assert_eq!(parser.sample(), sample);
    for wrong in [&report[..24], &[&report[..], &[0]].concat(), &[7, 0], &[]] {
        assert!(parser.take(wrong).is_err());
        assert_eq!(parser.sample(), sample);
    }
    assert_eq!(parser.take(&[7, 0]), Err(Rejected::Unknown { report: 7 }));
    let mut parser = Reports::new(layout(&rhino()).input);
    let mut report = vec![1, 0x00, 0xf0, 0x00, 0x10, 0x01, 0x00, 1, 2, 3, 4];
    report.extend([0x02, 0, 0, 0, 0, 0]);
    parser.take(&report).unwrap();
    assert_eq!(
        (parser.sample().axes[..3].to_vec(), parser.sample().buttons),
        (vec![-4096, 4096, 1], 2)
    );
}

/// A device without numbers: its reports begin with the first field.
#[test]
fn reports_without_numbers_are_read_from_their_first_byte() {
    let bytes = Items::default()
        .page(0x01)
        .collection(0x04, 1, |i| {
            i.usages(&[0x30, 0x31]).input(8, 2, (-127, 127), VARIABLE)
        })
        .0;
    let descriptor = Descriptor::parse(&bytes).unwrap();
    let input = Part::of(&descriptor, Way::Input);
    let slots = [0x30, 0x31].map(|id| input.value(Usage::new(1, id)).unwrap());
    assert_eq!(slots.map(|s| s.get(&[0, 0x81, 5])), [Some(-127), Some(5)]);
    assert_eq!(descriptor.length(Way::Input, 0), 3);
    assert!(matches!(
        Layout::of(descriptor),
        Err(Missing("report to set an effect up"))
    ));
}

fn stick(kind: Kind) -> Stick {
    Stick::new("stick", &layout(&openffboard()), kind, Scale::default())
}

#[test]
fn a_stick_is_in_the_room_as_a_hand_holds_it() {
    let mut stick = stick(Kind::Spring);
    let mut sample = Sample::default();
    assert_eq!(stick.pose(None, 0.0), None);
    // Right, and pulled towards the user; the third axis takes no force and tells none.
    sample.axes[..3].copy_from_slice(&[32_767, 32_767, 32_767]);
    assert_eq!(
        stick.pose(Some((&sample, 0.0)), 0.0).unwrap().at,
        DVec3::new(60.0, -60.0, 0.0)
    );
    // 5 N over 60 mm.
    assert!((stick.abilities().stiffness - 83.333).abs() < 1e-3);
    let order = stick.order(DVec3::new(0.0, 3.0, 9.0), DVec3::ZERO);
    let share = 3.0 / 90.0_f64.sqrt();
    assert!((order.force[1] + share).abs() < 1e-12, "away is against the axis");
}

/// Runs the effects of a maker under some orders, each a millisecond after the other.
fn said(bytes: &[u8], kind: Kind, orders: &[[f64; 6]]) -> (Vec<Vec<u8>>, Vec<Vec<u8>>) {
    let load = layout(bytes).load.index.report;
    let mut fake = Fake::new(Clock::standing());
    fake.answer(Box::new(move |_, features| {
        vec![load, features.len() as u8, 1, 0, 1]
    }));
    let mut effects = Effects::begin(layout(bytes), kind, &mut fake).unwrap();
    let begun: Vec<_> = fake.written().into_iter().map(|(_, report)| report).collect();
    let mut said = Vec::new();
    for (ms, values) in orders.iter().enumerate() {
        let [x, y, z, a, b, c] = *values;
        let order = Order {
            force: [x, y, z],
            at: [a, b, c],
            flags: 0,
        };
        let mut out = |report: &[u8]| {
            said.push(report.to_vec());
            Ok(())
        };
        effects.write(&order, ms as f64 * 1e-3, &mut out).unwrap();
    }
    effects.leave(&mut |report: &[u8]| {
        said.push(report.to_vec());
        Ok(())
    });
    (begun, said)
}

#[test]
fn constant_forces_are_said_when_they_change_and_started_again_in_time() {
    let mut orders = vec![[0.0; 6], [0.5, 0.0, 0.0, 0.0, 0.0, 0.0]];
    orders.resize(120, orders[1]);
    let (begun, said) = said(&rhino(), Kind::Constant, &orders);
    // Stop, reset, gain, two effects and their forces, and the motors at the very end.
    assert_eq!(begun[..3], [vec![112, 3], vec![112, 4], vec![113, 255]]);
    assert_eq!(begun.last().unwrap(), &[112, 2]);
    let effects: Vec<_> = begun.iter().filter(|r| r[0] == 101).collect();
    assert_eq!(
        (effects[0][1], effects[0][12], effects[0][13]),
        (1, 0b101, 191),
        "X from the left"
    );
    assert_eq!(
        (effects[1][1], effects[1][12], effects[1][13]),
        (2, 0b110, 0),
        "Y from the far side"
    );
    let expected: [&[u8]; 12] = [
        &[105, 1, 0, 0],
        &[105, 2, 0, 0],
        &[105, 1, 0, 8],
        &[110, 1, 1, 1],
        &[110, 2, 1, 1],
        &[110, 1, 1, 1],
        &[110, 2, 1, 1],
        &[110, 1, 1, 1],
        &[110, 2, 1, 1],
        &[105, 1, 0, 0],
        &[105, 2, 0, 0],
        &[112, 3],
    ];
    assert_eq!(said[..12], expected);
    assert_eq!(said[12..], [[112, 1]]);
}

#[test]
fn a_spring_rests_ahead_of_the_hand_and_lets_it_leave() {
    let pushed = [0.25, -0.5, 0.0, 0.5, 0.0, 0.0];
    let (_, said) = said(&rhino(), Kind::Spring, &[pushed]);
    // The hand is at half of X and is pushed on by a quarter: the spring rests at three quarters, stiff only below that.
    assert_eq!(said[0][..9], [103, 1, 0, 0x00, 0x0c, 0, 0, 0x00, 0x10]);
    assert_eq!(said[1][..9], [103, 1, 1, 0x00, 0xf8, 0x00, 0x10, 0, 0]);
    assert_eq!(said[2], [110, 1, 1, 1], "one effect for all axes");
    // No force, no stiffness.
    let last = &said[said.len() - 4];
    assert_eq!(last[5..9], [0, 0, 0, 0]);
    assert_eq!(said[said.len() - 2..], [[112, 3], [112, 1]]);
}

/// The law of the device, fed with what is said, gives the force that was asked for, and never pulls.
#[test]
fn the_springs_force_is_the_one_asked_for() {
    for (force, at) in [(0.3, 0.1), (-0.3, 0.1), (0.02, -0.9), (-0.6, -0.3)] {
        let (_, said) = said(&openffboard(), Kind::Spring, &[[force, 0.0, 0.0, at, 0.0, 0.0]]);
        let number = |i: usize| f64::from(i16::from_le_bytes([said[0][i], said[0][i + 1]])) / 32_767.0;
        let (centre, positive, negative) = (number(3), number(5), number(7));
        let law = |q: f64| match q < centre {
            true => -negative * (q - centre),
            false => -positive * (q - centre),
        };
        assert!((law(at) - force).abs() < 1e-4, "{force} at {at}: {}", law(at));
        assert_eq!(law(centre + 0.2 * force.signum()), 0.0, "beyond the surface");
    }
}

/// Silent while nothing changes, as sticks are: the reader asks, so that the hand may hold still under a force.
#[test]
fn a_stick_held_still_keeps_its_force_until_it_answers_no_more() {
    let (clock, link) = (Clock::standing(), Arc::<Link>::default());
    let mut fake = Fake::new(clock.clone());
    let layout = layout(&rhino());
    let load = layout.load.index.report;
    fake.answer(Box::new(move |_, features| {
        vec![load, features.len() as u8, 1, 0, 1]
    }));
    fake.answer_input(&[1, 0x00, 0x08, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    let parser = Reports::new(layout.input.clone());
    let stick = Stick::new("stick", &layout, Kind::Constant, Scale::default());
    let effects = Effects::begin(layout, Kind::Constant, &mut fake).unwrap();
    let ends = || (Box::new(fake.clone()), link.clone(), clock.clone());
    let (transport, its, time) = ends();
    let mut reader = Reader::new(transport, Box::new(parser), its, time).asking(1);
    let (transport, its, time) = ends();
    let mut writer = Writer::new(transport, Box::new(effects), its, time, PERIOD);
    let mut device = Linked::new(Box::new(stick), link.clone(), clock.clone());
    let mut tick = |ms: u32| {
        clock.set(f64::from(ms) * 1e-3);
        reader.step();
        let done = device.read().and_then(|_| device.send(DVec3::X, DVec3::ZERO));
        writer.step();
        done
    };
    let begun = (1..10).filter(|ms| tick(*ms).is_ok()).count();
    assert!(begun > 4, "it is asked after 4 ms");
    for ms in 10..300 {
        tick(ms).unwrap();
    }
    let written = fake.written();
    let forces: Vec<_> = written.iter().filter(|(_, r)| r[..2] == [105, 1]).collect();
    // A fifth of 4096, said once and never taken back.
    assert_eq!(forces.last().unwrap().1, [105, 1, 0x33, 0x03]);
    assert!(forces.last().unwrap().0 < 0.01);
    fake.unplug();
    let gone = (300..310).find(|ms| matches!(tick(*ms), Err(DeviceError::Gone(_))));
    assert!(gone.is_some());
}

#[test]
fn a_device_that_cannot_begin_is_left_without_force() {
    let mut fake = Fake::new(Clock::standing());
    fake.answer(Box::new(|_, _| vec![6, 0, 2, 0, 0]));
    assert!(Effects::begin(layout(&rhino()), Kind::Spring, &mut fake).is_err());
    let written = fake.written();
    let last: Vec<_> = written[written.len() - 2..]
        .iter()
        .map(|(_, r)| r.clone())
        .collect();
    assert_eq!(last, [[112, 3], [112, 1]]);
}

#[test]
fn globals_are_pushed_and_popped_and_locals_are_not_kept() {
    let bytes = Items::default()
        .page(0x01)
        .item(0xa4, 0)
        .page(0x09)
        .usages(&[1])
        .input(4, 1, (0, 15), ARRAY)
        .item(0xb4, 0)
        .usages(&[0x30])
        .input(12, 1, (-2048, 2047), VARIABLE)
        .input(12, 1, (-2048, 2047), VARIABLE)
        .0;
    let descriptor = Descriptor::parse(&bytes).unwrap();
    // The last one has no usage: it only takes room.
    assert_eq!(descriptor.fields.len(), 2);
    assert_eq!(
        (descriptor.fields[1].bit, descriptor.length(Way::Input, 0)),
        (4, 5)
    );
    let slot = Part::of(&descriptor, Way::Input)
        .value(Usage::new(1, 0x30))
        .unwrap();
    assert_eq!(slot.get(&[0, 0xf5, 0xff]), Some(-1));
    assert_eq!(slot.get(&[0, 0xf5]), None);
    let mut report = [0, 0xf5, 0x00, 0xf0];
    slot.put(&mut report, -2048);
    assert_eq!(report, [0, 0x05, 0x80, 0xf0]);
}

#[test]
fn ranges_that_miss_their_sign_and_null_states_are_understood() {
    let with = |flags: u8| {
        let bytes = Items::default().page(1).usages(&[0x36]).0;
        // 255 in one byte.
        let more = [0x14, 0x25, 0xff, 0x75, 8, 0x95, 1, 0x81, flags];
        let bytes = [bytes, more.to_vec()].concat();
        let descriptor = Descriptor::parse(&bytes).unwrap();
        Part::of(&descriptor, Way::Input)
            .value(Usage::new(1, 0x36))
            .unwrap()
    };
    assert_eq!((with(2).min, with(2).max), (0, 255));
    let hat = Items::default()
        .page(1)
        .usages(&[0x39])
        .input(4, 1, (1, 8), 0x42)
        .0;
    let descriptor = Descriptor::parse(&hat).unwrap();
    let hat = Part::of(&descriptor, Way::Input)
        .value(Usage::new(1, 0x39))
        .unwrap();
    assert_eq!(
        [0, 1, 8, 15].map(|v| hat.get(&[0, v])),
        [None, Some(1), Some(8), None]
    );
}

#[test]
fn descriptors_that_are_none_are_refused() {
    let parse = Descriptor::parse;
    let huge = [0x75, 32, 0x97, 0xff, 0xff, 0xff, 0xff, 0x09, 1, 0x81, 2];
    for (bytes, why) in [
        (vec![0; 4097], DescriptorError::TooLong(4097)),
        (vec![0x05], DescriptorError::Truncated { at: 0 }),
        (vec![0x05, 1, 0x27, 0, 0, 0], DescriptorError::Truncated { at: 2 }),
        (vec![0xfe, 5, 0, 1], DescriptorError::Truncated { at: 0 }),
        (vec![0xc0], DescriptorError::Unbalanced { at: 0 }),
        (vec![0xb4], DescriptorError::Unbalanced { at: 0 }),
        (vec![0xa1, 1], DescriptorError::Unbalanced { at: 2 }),
        ([0xa1, 1].repeat(33), DescriptorError::TooDeep { at: 64 }),
        ([0xa4].repeat(33), DescriptorError::TooDeep { at: 32 }),
        ([0x09, 1].repeat(1025), DescriptorError::TooDeep { at: 2048 }),
        (vec![0x85, 0], DescriptorError::Value { at: 0, value: 0 }),
        (vec![0x75, 33], DescriptorError::Value { at: 0, value: 33 }),
        (vec![0x29, 3], DescriptorError::Value { at: 0, value: 3 }),
        (
            huge.to_vec(),
            DescriptorError::Value {
                at: 9,
                value: u32::MAX,
            },
        ),
    ] {
        assert_eq!(parse(&bytes), Err(why));
    }
    assert_eq!(parse(&[]), Ok(Descriptor::default()));
    // A long item is let pass.
    assert!(parse(&[0xfe, 1, 0, 7, 0x05, 1]).is_ok());
}

#[test]
fn a_usage_of_four_bytes_brings_its_page_and_a_range_has_places() {
    let bytes = Items::default()
        .page(0x09)
        .extended(0x0f, 0x40)
        .item(0x18, 3)
        .item(0x28, 6)
        .output(8, 1, (1, 5), ARRAY)
        .0;
    let descriptor = Descriptor::parse(&bytes).unwrap();
    let part = Part::of(&descriptor, Way::Output);
    let value = |usage| part.choice(usage).map(|c| c.value);
    assert_eq!(value(Usage::new(0x0f, 0x40)), Some(1));
    assert_eq!(
        [3, 6, 7].map(|id| value(Usage::new(9, id))),
        [Some(2), Some(5), None]
    );
}

proptest! {
    #[test]
    fn any_descriptor_is_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200), report in any::<[u8; 20]>()) {
        if let Ok(descriptor) = Descriptor::parse(&bytes)
            && let Ok(layout) = Layout::of(descriptor)
        {
            let _ = Reports::new(layout.input).take(&report);
        }
    }

    /// A descriptor of a device with some bytes changed, and reports of any bytes for it.
    #[test]
    fn damaged_descriptors_and_reports_do_no_harm(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        reports in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..40), 0..8),
        is_rhino in any::<bool>(),
    ) {
        let mut bytes = if is_rhino { rhino() } else { openffboard() };
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        let Ok(descriptor) = Descriptor::parse(&bytes) else { return Ok(()) };
        let Ok(layout) = Layout::of(descriptor) else { return Ok(()) };
        let mut parser = Reports::new(layout.input.clone());
        for report in &reports {
            let before = parser.sample();
            if parser.take(report).is_err() {
                prop_assert_eq!(parser.sample(), before);
            }
        }
        let mut stick = Stick::new("stick", &layout, Kind::Spring, Scale::default());
        prop_assert!(stick.pose(Some((&parser.sample(), 0.0)), 0.0).unwrap().is_finite());
        let _ = layout.set_effect(1, Kind::Constant, [true; 3], 27_000, 200);
        let _ = layout.set_spring(1, 2, &Spring { centre: -1.0, stiffness: [1.0; 2], saturation: 1.0 });
        let _ = layout.set_constant(1, -1.0);
    }

    #[test]
    fn slots_hold_what_was_put_and_leave_the_rest(bit in 0_u8..40, bits in 2_u8..33, value in any::<i32>(), rest in any::<u8>()) {
        let (low, high) = (-(1_i64 << (bits - 1)), (1_i64 << (bits - 1)) - 1);
        let bytes = Items::default().page(1)
            .item(0x74, 1).item(0x94, bit.into()).item(0x90, 1)
            .usages(&[0x30]).output(bits, 1, (low, high), VARIABLE).0;
        let descriptor = Descriptor::parse(&bytes).unwrap();
        let slot = Part::of(&descriptor, Way::Output).value(Usage::new(1, 0x30)).unwrap();
        let mut report = [rest; 12];
        slot.put(&mut report, value.into());
        prop_assert_eq!(slot.get(&report), Some(i64::from(value).clamp(low, high)));
        slot.put(&mut report, 0);
        let mut zeros = [rest; 12];
        for i in 0..usize::from(bits) {
            let at = 8 + usize::from(bit) + i;
            zeros[at / 8] &= !(1 << (at % 8));
        }
        prop_assert_eq!(report, zeros);
    }
}
