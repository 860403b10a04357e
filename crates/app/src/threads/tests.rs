use std::path::Path as FilePath;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use bspline::AnyField;
use bspline::hierarchical::{HierarchicalSpline, Lattice};
use document::{Command, Document, Object, Options, State};
use fitting::Control;
use formats::field::FieldMeta;
use glam::{DAffine3, DVec3};
use tools::haptics::gates::{GateOptions, held};
use tools::haptics::simulated::{Path, Preset, SimulatedDevice, SimulatedHand};
use tools::haptics::{
    Contact, Coupling, Demand, Proxy, ProxyOptions, Servo, ServoOptions, TickRecord, Workspace,
};
use tools::session::Stroke;

use super::clock::now;
use super::rehearsal::Rehearsal;
use super::sculpting::Sculpting;
use super::touch::Toucher;
use super::{Session, Show};

/// Radius of the ball that is worked on, mm; its middle is at (12, 12, 12).
const BALL: f64 = 9.0;
/// Radius of the tool, mm.
const TOOL: f64 = 1.0;

fn document(directory: &FilePath) -> Document {
    let lattice = Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [24; 3],
    };
    let ball = |p: DVec3| BALL - p.distance(DVec3::splat(12.0));
    let field = HierarchicalSpline::schoenberg(lattice, 1.0, ball).unwrap();
    let meta = FieldMeta {
        iso: Some(0.0),
        ..FieldMeta::default()
    };
    let object = Object::new(&AnyField::F32(field), meta).unwrap();
    let state = State::new().with("ball", object).unwrap();
    Document::create(&directory.join("felt.isoclay"), state, Options::default()).unwrap()
}

fn carve() -> Stroke {
    toml::from_str("carve = { along = [], shape = { sphere = { radius = 1.0 } }, tolerance = 0.05 }").unwrap()
}

/// A hand that comes down on the ball, presses, carves twice and goes up again, in 2.5 s.
fn hand(workspace: &Workspace) -> SimulatedHand {
    let top = |x: f64, height: f64| DVec3::new(12.0 + x, 12.0, 12.0 + BALL + TOOL + height);
    let places = [
        (0.3, top(0.0, 3.0)),
        (0.6, top(0.0, -4.0)),
        (0.9, top(-1.0, -4.0)),
        (1.5, top(2.0, -4.0)),
        (1.9, top(0.0, -5.0)),
        (2.1, top(0.0, 3.0)),
    ];
    let in_device = |(time, p): (f64, DVec3)| (time, (p - workspace.shift) / workspace.scale);
    SimulatedHand::light(Path::smooth(places.map(in_device))).pressing([
        (0.9, 1),
        (1.4, 0),
        (1.5, 1),
        (1.8, 0),
    ])
}

fn parts() -> (SimulatedDevice, Servo, Show) {
    let workspace = Workspace {
        shift: DVec3::splat(12.0),
        ..Workspace::default()
    };
    let device = SimulatedDevice::new(Preset::Omni.mechanics(), hand(&workspace));
    let options = ServoOptions {
        workspace,
        gates: GateOptions {
            ramp: 0.1,
            ..GateOptions::default()
        },
        ..ServoOptions::default()
    };
    let abilities = Preset::Omni.mechanics().abilities();
    let servo = Servo::new(&abilities, options, |stiffness, damping| {
        Box::new(Proxy::new(ProxyOptions {
            radius: TOOL,
            coupling: Coupling { stiffness, damping },
            ..ProxyOptions::default()
        }))
    });
    let demand = Demand {
        reach: 8.0,
        ..Demand::of_ball(TOOL)
    };
    let mut toucher = Toucher::new(demand);
    let show = Box::new(move |state: &State, at| toucher.show(state, at));
    (device, servo.unwrap(), show)
}

/// What the journal of a document leaves when all of it is done again.
fn again(document: &mut Document) -> State {
    let first = document.first_state().unwrap();
    (0..document.counts().unwrap().done).fold(first, |state, n| {
        let command: Command = serde_json::from_value(document.command(n).unwrap()).unwrap();
        command.apply(&state, &mut Control::default()).unwrap().0
    })
}

/// Asserts what holds of every force, however late it came: the limit of the device, and the slew limit from what the hand still
/// felt. Gives the largest.
fn assert_bounded_and_continuous(records: &[TickRecord]) -> f64 {
    let force = |record: &TickRecord| DVec3::from_array(record.force.map(f64::from));
    for pair in records.windows(2) {
        let felt = force(&pair[0]) * held(f64::from(pair[1].dt));
        let step = (force(&pair[1]) - felt).length();
        assert!(
            step <= 0.25 + 1e-5,
            "{step} N from {:?} to {:?}",
            pair[0],
            pair[1]
        );
    }
    let largest = records.iter().map(|r| force(r).length()).fold(0.0, f64::max);
    assert!(largest <= 3.3 + 1e-5, "{largest}");
    largest
}

#[test]
fn three_threads_sculpt_while_the_simulation_stalls_a_second() {
    let directory = tempfile::tempdir().unwrap();
    let sculpting = Sculpting::new(document(directory.path()), "ball".into(), Some(carve()));
    let (device, servo, mut show) = parts();
    // The fourth snapshot of a changed state takes a second more: in the middle of a stroke.
    let has_stalled = Arc::new(AtomicBool::new(false));
    let stalled = has_stalled.clone();
    let mut made = 0;
    let slow = move |state: &State, at: DVec3| {
        made += 1;
        if made > 6 && at.z < 12.0 + BALL && !stalled.swap(true, Ordering::Relaxed) {
            std::thread::sleep(Duration::from_secs(1));
        }
        show(state, at)
    };
    let session = Session {
        device: Box::new(device.self_timed()),
        servo,
        sculpting,
        show: Box::new(slow),
        tick: Duration::from_millis(1),
        step: Duration::from_millis(33),
    };
    let start = now();
    let mut records = Vec::with_capacity(8000);
    // The time of the device is that of its ticks; under load they are fewer than a thousand a second.
    let ticks = Arc::new(std::sync::atomic::AtomicU64::new(0));
    let seen = ticks.clone();
    let goes_on = || ticks.load(Ordering::Relaxed) < 2500 && now() - start < Duration::from_secs(30);
    let keep = |record: &TickRecord| {
        seen.store(record.tick, Ordering::Relaxed);
        records.push(*record);
    };
    let (sculpting, report) = session.run(goes_on, keep).unwrap();
    println!("{report:#?}");
    assert!(has_stalled.load(Ordering::Relaxed));
    assert!(report.haptic.ticks >= 2500, "{}", report.haptic.ticks);
    assert_eq!(report.haptic.lost_records, 0);
    assert_eq!(records.len() as u64, report.haptic.ticks);
    assert!(records.windows(2).all(|pair| pair[0].tick + 1 == pair[1].tick));
    assert_eq!((report.haptic.torn, report.graphics.torn), (0, 0));
    // How many depends on how crowded the machine is; that some come after the stall does not.
    assert!(report.haptic.snapshots > 6 && report.graphics.snapshots > 6);
    assert_eq!(report.haptic.trip, None);
    let largest = assert_bounded_and_continuous(&records);
    assert!(largest > 0.5, "nothing was felt: {largest}");
    let (mut document, strokes, notes) = sculpting.close();
    assert!(strokes >= 1, "{notes:?}");
    assert_eq!(
        again(&mut document).sha256(),
        document.state().sha256(),
        "{notes:?}"
    );
}

fn rehearsed(directory: &FilePath) -> (Document, Vec<TickRecord>) {
    let sculpting = Sculpting::new(document(directory), "ball".into(), Some(carve()));
    let (device, servo, show) = parts();
    let mut rehearsal = Rehearsal {
        device,
        servo,
        sculpting,
        show,
        step: 1.0 / 30.0,
    };
    let mut records = Vec::new();
    let keep = |record: &TickRecord| records.push(*record);
    rehearsal
        .run(2.5, &mut Control::default(), |_| true, keep)
        .unwrap();
    let (document, strokes, notes) = rehearsal.sculpting.close();
    assert_eq!((strokes, notes), (2, Vec::new()));
    (document, records)
}

#[test]
fn a_rehearsal_is_the_same_every_time_and_its_journal_too() {
    let directories = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let [(mut document, records), (other, same)] =
        [&directories[0], &directories[1]].map(|d| rehearsed(d.path()));
    assert_eq!(records.len(), 2500);
    assert_eq!(records, same);
    assert_eq!(document.state().sha256(), other.state().sha256());
    assert_eq!(again(&mut document).sha256(), document.state().sha256());
    let largest = assert_bounded_and_continuous(&records);
    assert!(largest > 0.5, "{largest}");
    // Poses of steps are those of the hand: two strokes with a pose for each thirtieth of a second.
    let history = document.history().unwrap();
    assert!(history[0].title.ends_with("15 steps"), "{}", history[0].title);
    assert!(history[1].title.ends_with("9 steps"), "{}", history[1].title);
}

#[test]
fn a_button_pressed_between_two_looks_is_not_missed() {
    let directory = tempfile::tempdir().unwrap();
    let mut sculpting = Sculpting::new(document(directory.path()), "ball".into(), Some(carve()));
    let mut control = Control::default();
    let mut hand = super::hand::Hand::nobody();
    hand.pose = Some(tools::haptics::Pose::at(DVec3::new(12.0, 12.0, 12.0 + BALL)));
    assert!(!sculpting.step(&hand, &mut control).unwrap());
    // Down and up.
    hand.press(1);
    hand.press(0);
    assert!(sculpting.step(&hand, &mut control).unwrap());
    assert!(!sculpting.step(&hand, &mut control).unwrap());
    // Down, up and down: the first ends as the second begins.
    hand.press(1);
    sculpting.step(&hand, &mut control).unwrap();
    hand.press(0);
    hand.press(1);
    hand.pose = Some(tools::haptics::Pose::at(DVec3::new(14.0, 12.0, 12.0 + BALL)));
    sculpting.step(&hand, &mut control).unwrap();
    hand.press(0);
    sculpting.step(&hand, &mut control).unwrap();
    let (mut document, _, notes) = sculpting.close();
    let titles: Vec<_> = document.history().unwrap().into_iter().map(|e| e.title).collect();
    assert!(
        titles.len() >= 2 && titles.iter().all(|t| t.contains("1 step")),
        "{titles:?} {notes:?}"
    );
}

#[test]
fn a_stroke_that_cannot_begin_is_noted_and_the_hand_goes_on() {
    let directory = tempfile::tempdir().unwrap();
    let given: Stroke =
        toml::from_str("carve = { along = [[1, 2, 3]], shape = { sphere = { radius = 1.0 } } }").unwrap();
    let mut sculpting = Sculpting::new(document(directory.path()), "ball".into(), Some(given));
    let mut hand = super::hand::Hand::nobody();
    hand.pose = Some(tools::haptics::Pose::at(DVec3::splat(12.0)));
    hand.press(1);
    for _ in 0..3 {
        assert!(!sculpting.step(&hand, &mut Control::default()).unwrap());
    }
    let (_, strokes, notes) = sculpting.close();
    assert_eq!((strokes, notes.len()), (0, 1), "{notes:?}");
}

/// A hand takes hold of the top of a ball of clay and drags it in by three radii of the tool.
#[test]
fn a_pull_is_felt_along_its_way_without_steps() {
    let directory = tempfile::tempdir().unwrap();
    let pull: Stroke = toml::from_str("pull = { along = [[12, 12, 21]], radius = 1.5 }").unwrap();
    // In the device's room, whose middle is that of the ball.
    let at = |z: f64| DVec3::new(0.0, 0.0, z);
    let path = Path::smooth([
        (0.3, at(BALL + 4.0)),
        (0.6, at(BALL)),
        (1.6, at(BALL - 4.5)),
        (2.2, at(BALL - 4.5)),
        (2.5, at(BALL + 4.0)),
    ]);
    let hand = SimulatedHand::light(path).pressing([(0.7, 1), (2.0, 0)]);
    let (_, servo, show) = parts();
    let mut rehearsal = Rehearsal {
        device: SimulatedDevice::new(Preset::Omni.mechanics(), hand),
        servo,
        sculpting: Sculpting::new(document(directory.path()), "ball".into(), Some(pull)),
        show,
        step: 1.0 / 30.0,
    };
    let mut records = Vec::new();
    let keep = |record: &TickRecord| records.push(*record);
    rehearsal
        .run(2.6, &mut Control::default(), |_| true, keep)
        .unwrap();
    let (mut document, strokes, notes) = rehearsal.sculpting.close();
    assert_eq!((strokes, notes), (1, Vec::new()));
    assert_bounded_and_continuous(&records);
    let pulling: Vec<_> = records
        .iter()
        .filter(|r| r.status.contact() == Contact::Pulls)
        .collect();
    assert!(pulling.len() > 1200, "{}", pulling.len());
    // Against the drag, along it.
    let most = pulling.iter().map(|r| r.force[2]).fold(0.0, f32::max);
    let aside = pulling
        .iter()
        .map(|r| r.force[0].hypot(r.force[1]))
        .fold(0.0, f32::max);
    assert!(most > 0.5 && aside < 0.1 * most, "{most} N, {aside} N aside");
    // The hand got nothing that it had not given.
    let mut given = 0.0;
    for pair in records.windows(2) {
        let way = DVec3::from(pair[1].hand.map(f64::from)) - DVec3::from(pair[0].hand.map(f64::from));
        given -= 1e-3 * way.dot(DVec3::from(pair[0].force.map(f64::from)));
        assert!(given > -1e-4, "{given} J");
    }
    assert_eq!(again(&mut document).sha256(), document.state().sha256());
}
