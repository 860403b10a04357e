//! Strokes by hand: what they leave, what their scripts leave, and what is left of them when they are not ended.

use std::path::Path;

use bspline::Field;
use document::{Command, CommandError, Document, Live, Options, State};
use fitting::Control;
use glam::DVec3;
use tempfile::tempdir;
use tools::live::Pose;
use tools::session::Stroke;

use super::clay::{ISO, again, block, height, state_of};
use super::common::Draw;

fn document(directory: &Path, state: &State) -> Document {
    Document::create(&directory.join("live.isoclay"), state.clone(), Options::default()).unwrap()
}

fn stroke(text: &str) -> Stroke {
    toml::from_str(text).unwrap_or_else(|e| panic!("{text}: {e}"))
}

fn begun(state: &State, text: &str) -> Live {
    Live::begin(state, "clay", stroke(text)).unwrap_or_else(|e| panic!("{text}: {e}"))
}

/// A stroke by hand, at once; gives what was told.
fn made(document: &mut Document, text: &str, poses: &[Pose]) -> Vec<String> {
    let control = &mut Control::default();
    let mut live = begun(document.state(), text);
    for pose in poses {
        live.step(*pose, control)
            .unwrap_or_else(|e| panic!("{text}: {e}"));
    }
    let (is_changed, notes) = live
        .end(document, control)
        .unwrap_or_else(|e| panic!("{text}: {e}"));
    assert!(is_changed, "{text}");
    notes
}

/// A hand that wanders over the plane `z`, now fast, now standing.
fn wandering(seed: u64, z: f64, count: usize) -> Vec<Pose> {
    let mut draw = Draw(seed);
    let mut at = DVec3::new(9.0, 10.0, z);
    let mut number = |range: f64| (f64::from(draw.below(2001)) / 1000.0 - 1.0) * range;
    (0..count)
        .map(|_| {
            let pace = number(1.0);
            if pace > -0.3 {
                at += pace * pace * DVec3::new(0.9 + number(0.6), number(1.2), number(0.1));
            }
            Pose::at(at)
        })
        .collect()
}

/// A block with something for moves and smoothing to do.
fn rippled() -> State {
    state_of(|p| 12.0 - p.z + 0.2 * (1.7 * p.x).sin() * (1.3 * p.y).cos())
}

#[test]
fn strokes_by_hand_and_their_scripts_leave_the_same() {
    let shape = "along = [], shape = { sphere = { radius = 0.9 } }, tolerance = 0.02";
    let bar = "along = [], shape = { box = { size = [1.6, 1.0, 1.2] } }, tolerance = 0.05";
    let tools = [
        "pull = { along = [[9, 10, 12]], radius = 1.2 }".to_string(),
        "pull = { along = [[9, 10, 12]], disc = 1.5, radius = 1.2 }\nwithin = { min = [1, 1, 1], max = [23, 19, 23] }".into(),
        "chisel = { along = [], depth = 0.5, radius = 0.8 }".into(),
        "squirt = { along = [], depth = 0.5, radius = 0.8 }\nsymmetry = { at = [12, 12, 12], normal = [0, 1, 0] }".into(),
        format!("carve = {{ {shape} }}"),
        format!("add = {{ {bar} }}"),
        "paint = { layer = 'stiffness', brush = { along = [], radius = 1.5, value = 5, rate = 0.3 } }".into(),
        "smooth = { along = [], radius = 2, level = 2 }".into(),
        "inflate = { along = [], radius = 2, by = 0.1 }\ncoarse = 0".into(),
        "push = { along = [], radius = 2, speed = 0.1 }".into(),
        "push = { along = [], radius = 2, speed = 0.1, force = -2 }\nsymmetry = { at = [12, 12, 12], normal = [0, 1, 0] }".into(),
        "move = { motion = { grab = { along = [], radius = 4 } } }".into(),
    ];
    for (n, text) in tools.iter().enumerate() {
        let directory = tempdir().unwrap();
        let first = rippled();
        let mut document = document(directory.path(), &first);
        let mut poses = wandering(n as u64, 12.2, 8);
        for (n, pose) in poses.iter_mut().enumerate() {
            pose.turn = DVec3::new(0.0, 3.0, 10.0 * n as f64);
            pose.force = 0.3 * n as f64;
        }
        made(&mut document, text, &poses);
        let left = document.state().sha256();
        for threads in [1, 8] {
            assert_eq!(
                again(&mut document, threads).sha256(),
                left,
                "{text}, {threads} threads"
            );
        }
        // The stroke as a line of a session.
        let command = document.command(0).unwrap();
        let name = |_: Option<&str>| Ok::<_, CommandError>("clay".into());
        let line = command["stroke"].to_string();
        let commands = Command::of_script(&format!("\n{line}\n"), name);
        let commands = commands.unwrap_or_else(|_| {
            // Begins with an empty line, so it is no JSON.
            Command::of_script(&line, name).unwrap()
        });
        let (scripted, _) = commands[0].apply(&first, &mut Control::default()).unwrap();
        assert_eq!(scripted.sha256(), left, "{text}");
    }
}

/// A bar through a slab, and one between two.
#[test]
fn holes_and_bridges_by_hand_and_their_scripts_are_the_same() {
    let slab = state_of(|p| 3.0 - (p.z - 9.0).abs());
    let two = state_of(|p| (p.z - 12.0).abs() - 2.0);
    let poses: Vec<Pose> = (0..6)
        .map(|n| Pose::at(DVec3::new(9.0 + 0.7 * f64::from(n), 12.0, 12.0)))
        .collect();
    let low = |pose: &Pose| Pose::at(pose.at - 2.0 * DVec3::Z);
    for (tool, first, poses, middle) in [
        (
            "drill = { along = [], by = [0, 0, -9], radius = 1.2 }",
            slab,
            poses.clone(),
            9.0,
        ),
        (
            "join = { along = [], by = [0, 0, 6], radius = 1.2 }",
            two,
            poses.iter().map(low).collect(),
            12.0,
        ),
    ] {
        let directory = tempdir().unwrap();
        let mut document = document(directory.path(), &first);
        made(&mut document, tool, &poses);
        let field = document.state().object("clay").unwrap().field.as_field();
        let is_solid = field.value(DVec3::new(11.0, 12.0, middle)) > ISO;
        assert_eq!(is_solid, tool.starts_with("join"), "{tool}");
        let left = document.state().sha256();
        for threads in [1, 8] {
            assert_eq!(
                again(&mut document, threads).sha256(),
                left,
                "{tool}, {threads} threads"
            );
        }
    }
}

/// A tower that is added, and one that is pulled, out of the box of the field; a leap beyond all reason is refused as before.
#[test]
fn boxes_grow_with_strokes_by_hand() {
    let high = state_of(|p| 8.0 - p.distance(DVec3::new(12.0, 12.0, 13.0)));
    for (text, from) in [
        (
            "add = { along = [], shape = { sphere = { radius = 1.5 } }, tolerance = 0.05 }",
            21.0,
        ),
        (
            "add = { along = [], shape = { sphere = { radius = 1.5 } }, tolerance = 0.05 }\nsymmetry = { at = [12, 12, 13], normal = [0, 0, 1] }",
            21.0,
        ),
        ("pull = { along = [[12, 12, 21]], radius = 2 }", 21.0),
        (
            "move = { motion = { grab = { along = [], radius = 5, rigid = 2 } } }",
            20.5,
        ),
    ] {
        let directory = tempdir().unwrap();
        let mut document = document(directory.path(), &high);
        let control = &mut Control::default();
        let mut live = begun(&high, text);
        let end = if text.starts_with("move") {
            from + 5.0
        } else {
            26.0
        };
        for n in 0..=10 {
            let z = from + (end - from) * f64::from(n) / 10.0;
            live.step(Pose::at(DVec3::new(12.0, 12.0, z)), control)
                .unwrap_or_else(|e| panic!("{text}: {e}"));
        }
        let (state, boxes) = live.look().unwrap();
        let seen = &state.object("clay").unwrap().field;
        assert!(boxes.iter().any(|b| b.max.z >= 24.0), "{text}: {boxes:?}");
        assert!(seen.world_box().max.z > 25.0, "{text}");
        let far = live.step(Pose::at(DVec3::splat(1e300)), control);
        assert!(far.is_err() || text.starts_with("add"), "{text}");
        let (is_edit, notes) = live.end(&mut document, control).unwrap();
        assert!(
            is_edit && notes.iter().any(|n| n.contains("has grown")),
            "{text}: {notes:?}"
        );
        let field = document.state().object("clay").unwrap().field.as_field();
        assert!(field.value(DVec3::new(12.0, 12.0, end - 0.2)) > ISO, "{text}");
        for threads in [1, 8] {
            let again = again(&mut document, threads);
            assert_eq!(
                again.sha256(),
                document.state().sha256(),
                "{text}, {threads} threads"
            );
        }
        document.undo(1).unwrap();
        assert_eq!(document.state().sha256(), high.sha256(), "{text}");
    }
}

/// Poses that were refused, and paint on the way.
#[test]
fn what_a_hand_was_refused_is_not_in_its_script() {
    let paint: Stroke =
        stroke("paint = { layer = 'stiffness', brush = { along = [[12, 12, 12]], radius = 4, value = 9 } }");
    let paint = paint.paint.unwrap();
    let control = &mut Control::default();
    for (text, is_force) in [
        ("chisel = { along = [], depth = 0.4, radius = 1.2 }", true),
        (
            "pull = { along = [[9, 10, 12]], radius = 1.2, how = { rule = 'compliance' } }",
            true,
        ),
        ("move = { motion = { grab = { along = [], radius = 4 } } }", false),
    ] {
        let directory = tempdir().unwrap();
        let mut document = document(directory.path(), &rippled());
        let mut live = begun(document.state(), text);
        let nowhere = Pose::at(DVec3::new(12.0, 12.0, f64::NAN));
        assert!(live.step(nowhere, control).is_err(), "{text}");
        for (n, pose) in wandering(3, 12.1, 8).into_iter().enumerate() {
            live.step(pose, control).unwrap_or_else(|e| panic!("{text}: {e}"));
            if n == 3 {
                assert_eq!(live.paint(&paint, control).is_ok(), is_force, "{text}");
            }
            let leap = if is_force {
                Pose::at(DVec3::splat(1e300))
            } else {
                nowhere
            };
            assert!(live.step(leap, control).is_err(), "{text}");
        }
        let (is_edit, notes) = live.end(&mut document, control).unwrap();
        assert!(is_edit, "{text}: {notes:?}");
        assert_eq!(
            again(&mut document, 2).sha256(),
            document.state().sha256(),
            "{text}"
        );
    }
}

/// Slow, fast, and in one leap; standing still, and across its own track.
#[test]
fn a_moving_tool_leaves_its_depth_at_any_speed() {
    let (depth, r) = (0.6, 1.2);
    let track = [[6.0, 10.0], [15.0, 10.0], [15.0, 14.0], [11.0, 6.0]].map(|[x, y]| DVec3::new(x, y, 12.0));
    for (tool, sign, paces) in [("chisel", -1.0, &[0.05, 0.4, 3.0][..]), ("squirt", 1.0, &[100.0])] {
        for &pace in paces {
            let mut poses = vec![Pose::at(track[0]); 3];
            for leg in track.windows(2) {
                let count = (leg[0].distance(leg[1]) / (pace * r)).ceil();
                let place = |n: usize| Pose::at(leg[0].lerp(leg[1], n as f64 / count));
                poses.extend((1..=count as usize).map(place));
            }
            let directory = tempdir().unwrap();
            let mut document = document(directory.path(), &block());
            let text = format!("{tool} = {{ along = [], depth = {depth}, radius = {r} }}");
            let notes = made(&mut document, &text, &poses);
            assert!(notes.is_empty(), "{text} {pace}: {notes:?}");
            let places = (0..=18).map(|n| [6.0 + 0.5 * f64::from(n), 10.0]);
            let shares: Vec<f64> = places
                .map(|[x, y]| height(document.state(), x, y) / (sign * depth))
                .collect();
            println!("{tool} {pace}: {shares:.4?}");
            assert!(
                shares.iter().all(|s| (s - 1.0).abs() < 0.015),
                "{tool}, {pace} r a step: {shares:.4?}"
            );
        }
    }
}

/// Wherever the hand goes, the surface ends where it is; the region follows it.
#[test]
fn the_surface_follows_a_hand_that_pulls() {
    for (n, end) in [
        [0.0, 0.0, 3.0],
        [2.0, 1.0, 6.0],
        [0.3, -0.4, -3.0],
        [0.0, 0.0, -0.6],
    ]
    .into_iter()
    .enumerate()
    {
        let (from, end) = (DVec3::new(11.0, 12.0, 12.0), DVec3::from_array(end));
        // There by a detour, in leaps and steps.
        let steps = 6 + 7 * n;
        let way = (0..=steps).map(|i| {
            let t = i as f64 / steps as f64;
            from + t * end + (t * (1.0 - t)) * DVec3::new(0.8, -0.5, 0.7)
        });
        let poses: Vec<Pose> = way.map(Pose::at).collect();
        let directory = tempdir().unwrap();
        let mut document = document(directory.path(), &block());
        let text = "pull = { along = [[11, 12, 12]], radius = 1.2 }";
        let notes = made(&mut document, text, &poses);
        assert!(notes.is_empty(), "{notes:?}");
        // Along the way of the hand the surface is at its end.
        let field = document.state().object("clay").unwrap().field.as_field();
        let [before, behind] = [0.97, 1.03].map(|t| field.value(from + t * end) > ISO);
        assert_eq!(
            [before, behind],
            if end.z > 0.0 { [true, false] } else { [false, true] },
            "{end}"
        );
    }
    // A hand that comes back leaves next to nothing.
    let there = (0..=20).map(|i| 2.0 * libm::sin(f64::from(i) * 0.05 * std::f64::consts::PI));
    let poses: Vec<Pose> = there
        .map(|z| Pose::at(DVec3::new(11.0, 12.0, 12.0 + z)))
        .collect();
    let directory = tempdir().unwrap();
    let mut document = document(directory.path(), &block());
    made(
        &mut document,
        "pull = { along = [[11, 12, 12]], radius = 1.2 }",
        &poses,
    );
    let left = height(document.state(), 11.0, 12.0);
    assert!(left.abs() < 0.02, "{left}");
}

/// Each step shows a surface between the one before and the next, as much farther as the hand pushes then.
#[test]
fn a_push_goes_as_fast_as_the_hand_is_strong() {
    let directory = tempdir().unwrap();
    let mut document = document(directory.path(), &block());
    let control = &mut Control::default();
    let mut live = begun(document.state(), "push = { along = [], radius = 3, speed = 0.1 }");
    let (mut depth, at) = (0.0, DVec3::new(12.0, 12.0, 12.1));
    for force in [0.5, 1.0, 3.0, 6.0, 0.0, 2.0, -4.0, -1.0] {
        // The hand goes with the surface, or stays behind it.
        let at = at - DVec3::Z * depth;
        live.step(
            Pose {
                force,
                ..Pose::at(at)
            },
            control,
        )
        .unwrap();
        depth += 0.1 * force;
        let (now, _) = live.look().unwrap();
        let found = -height(&now, 12.0, 12.0);
        assert!((found - depth).abs() < 0.02, "{force}: {found} of {depth}");
    }
    assert!(live.end(&mut document, control).unwrap().0);
    assert_eq!(again(&mut document, 2).sha256(), document.state().sha256());
    let command = document.command(0).unwrap();
    assert_eq!(command["stroke"]["push"]["force"].as_array().unwrap().len(), 8);
}

#[test]
fn a_stroke_that_is_not_ended_leaves_the_document_as_it_was() {
    let directory = tempdir().unwrap();
    let mut document = document(directory.path(), &block());
    let bytes = || std::fs::read(directory.path().join("live.isoclay")).unwrap();
    let (before, hash) = (bytes(), document.state().sha256());
    let control = &mut Control::default();
    let text = "squirt = { along = [], depth = 0.5, radius = 1 }";
    let mut live = begun(document.state(), text);
    let mut seen = document.state().clone();
    for n in 0..30 {
        let at = DVec3::new(6.0 + 0.3 * f64::from(n), 12.0, 12.1);
        let force = live.step(Pose::at(at), control).unwrap();
        assert!(n > 0 && n < 25 || force.z > 0.0, "{n}: {force}");
        if n % 3 == 0 {
            let (now, boxes) = live.look().unwrap();
            let [old, new] = [&seen, &now].map(|s| s.object("clay").unwrap().field.levels().unwrap());
            assert!(!boxes.is_empty());
            for i in 0..2000 {
                let p = DVec3::new(
                    f64::from(i % 20),
                    f64::from(i / 20 % 10) * 2.0,
                    f64::from(i / 200),
                ) + 2.1;
                let is_told = boxes.iter().any(|b| p.cmpge(b.min).all() && p.cmple(b.max).all());
                assert!(is_told || old.value(p) == new.value(p), "{p}");
            }
            seen = now;
        }
    }
    assert!(height(&seen, 8.0, 12.0) > 0.4);
    assert_eq!(bytes(), before);
    // Poses that make no sense are refused one by one.
    let nan = live
        .step(Pose::at(DVec3::new(f64::NAN, 0.0, 0.0)), control)
        .unwrap_err();
    assert!(nan.to_string().contains("finite"), "{nan}");
    let far = live.step(Pose::at(DVec3::splat(1e300)), control).unwrap_err();
    assert!(far.to_string().contains("within reason"), "{far}");
    live.step(Pose::at(DVec3::new(15.0, 12.0, 12.0)), control)
        .unwrap();
    drop(live);
    assert_eq!((bytes(), document.state().sha256()), (before, hash));
    // A document that goes on meanwhile refuses it.
    let mut live = begun(document.state(), text);
    live.step(Pose::at(DVec3::splat(12.0)), control).unwrap();
    made(&mut document, text, &[Pose::at(DVec3::new(6.0, 6.0, 12.0))]);
    let hash = document.state().sha256();
    let late = live.end(&mut document, control).unwrap_err();
    assert!(matches!(late, CommandError::Changed(_)), "{late}");
    assert_eq!(document.state().sha256(), hash);
    // An elastic stroke leaves no edit.
    let mut live = begun(
        document.state(),
        "pull = { along = [[9, 12, 12]], radius = 1.2, how = { solid = 'elastic' } }",
    );
    for n in 0..40 {
        let z = 12.0 + 0.15 * f64::from(n);
        live.step(Pose::at(DVec3::new(9.0, 12.0, z)), control).unwrap();
    }
    assert!(!live.end(&mut document, control).unwrap().0);
    assert_eq!(document.state().sha256(), hash);
}

#[test]
fn a_hand_beside_the_object_does_nothing_and_says_so() {
    let directory = tempdir().unwrap();
    let mut document = document(directory.path(), &block());
    let places = |list: &[[f64; 3]]| -> Vec<Pose> { list.iter().map(|p| Pose::at((*p).into())).collect() };
    let [ball, groove] = [
        "carve = { along = [], shape = { sphere = { radius = 1 } }, tolerance = 0.05 }",
        "chisel = { along = [], depth = 0.4, radius = 0.8 }",
    ];
    // From the air onto the surface, off it, and on again.
    let way = [
        [12.0, 5.0, 60.0],
        [12.0, 5.0, 40.0],
        [8.0, 12.0, 12.0],
        [14.0, 12.0, 12.0],
    ];
    let notes = made(&mut document, ball, &places(&way));
    assert_eq!(notes.len(), 1, "{notes:?}");
    assert!(notes[0].contains("in 2 of 4 steps"), "{notes:?}");
    let way = [
        [5.0, 5.0, 20.0],
        [5.0, 6.0, 12.0],
        [5.0, 9.0, 12.0],
        [5.0, 12.0, 20.0],
        [5.0, 18.0, 12.0],
    ];
    let notes = made(&mut document, groove, &places(&way));
    assert!(
        notes.iter().any(|n| n.contains("nothing to work on")),
        "{notes:?}"
    );
    let hash = document.state().sha256();
    let control = &mut Control::default();
    for text in [ball, groove] {
        let mut live = begun(document.state(), text);
        live.step(Pose::at(DVec3::new(5.0, 5.0, 90.0)), control).unwrap();
        let nothing = live.end(&mut document, control).unwrap_err().to_string();
        assert!(
            nothing.contains("field reaches") || nothing.contains("the field"),
            "{nothing}"
        );
    }
    for (text, word) in [
        ("pull = { along = [[12, 12, 20]], radius = 1 }", "no surface"),
        (
            "pull = { along = [[12, 12, 12]], lift = 1, radius = 1 }",
            "by hand",
        ),
        (
            "chisel = { along = [[1, 2, 3]], depth = 1, radius = 1 }",
            "one by one",
        ),
        ("copy = { to = 'b' }", "by hand"),
        ("paint = { layer = 'mass', formula = 'x' }", "by hand"),
    ] {
        let refused = Live::begin(document.state(), "clay", stroke(text)).err();
        let refused = refused.unwrap_or_else(|| panic!("{text}")).to_string();
        assert!(refused.contains(word), "{text}: {refused}");
    }
    assert_eq!(document.state().sha256(), hash);
}

/// What a brush does in a step is as much as the hand presses; the script has the presses, and presses that make no sense are refused.
#[test]
fn a_brush_does_as_much_as_the_hand_presses() {
    let directory = tempdir().unwrap();
    let mut document = document(directory.path(), &block());
    let control = &mut Control::default();
    let pressed = |at, press| Pose {
        press,
        ..Pose::at(at)
    };
    let at = DVec3::new(12.0, 12.0, 12.0);
    let mut live = begun(document.state(), "inflate = { along = [], radius = 3, by = 0.4 }");
    let mut due = 0.0;
    for press in [0.25, 0.0, 1.0, 0.5] {
        live.step(pressed(at, press), control).unwrap();
        due += 0.4 * press;
        let (now, _) = live.look().unwrap();
        let found = height(&now, 12.0, 12.0);
        assert!((found - due).abs() < 0.02, "{press}: {found} of {due}");
    }
    for press in [-0.1, 1.5, f64::NAN] {
        let why = live.step(pressed(at, press), control).unwrap_err().to_string();
        assert!(why.contains("0 to 1"), "{why}");
    }
    assert!(live.end(&mut document, control).unwrap().0);
    assert_eq!(again(&mut document, 1).sha256(), document.state().sha256());
    let command = document.command(0).unwrap();
    assert_eq!(
        command["stroke"]["press"],
        serde_json::json!([0.25, 0.0, 1.0, 0.5])
    );

    for text in [
        "push = { along = [], radius = 3, speed = 0.1 }",
        "smooth = { along = [], radius = 3, level = 4 }",
        "paint = { layer = 'stiffness', brush = { along = [], radius = 3, value = 5 } }",
    ] {
        let poses: Vec<Pose> = (0..4)
            .map(|n| pressed(at + DVec3::X * f64::from(n), 0.25 + 0.25 * f64::from(n)))
            .collect();
        made(&mut document, text, &poses);
        let last = document.counts().unwrap().done - 1;
        let presses = &document.command(last).unwrap()["stroke"]["press"];
        assert_eq!(*presses, serde_json::json!([0.25, 0.5, 0.75, 1.0]), "{text}");
    }
    assert_eq!(again(&mut document, 4).sha256(), document.state().sha256());
    // A solid does not know how hard it is pressed.
    let solid = "carve = { shape = { sphere = { radius = 1 } }, along = [] }";
    made(&mut document, solid, &[pressed(at, 0.5)]);
    let command = document.command(4).unwrap();
    assert_eq!(command["stroke"]["press"], serde_json::Value::Null);

    for (text, word) in [
        (
            "press = [1]\ninflate = { along = [[12, 12, 12]], radius = 3, by = 0.1 }",
            "paced",
        ),
        (
            "press = [1, 1]\npaced = true\ninflate = { along = [[12, 12, 12]], radius = 3, by = 0.1 }",
            "1 places and 2 presses",
        ),
        (
            "press = [1]\npaced = true\nchisel = { along = [[12, 12, 12]], radius = 3, depth = 0.1 }",
            "alone",
        ),
        (
            "press = [2]\npaced = true\ninflate = { along = [[12, 12, 12]], radius = 3, by = 0.1 }",
            "0 to 1",
        ),
    ] {
        let command = Command::Stroke {
            object: "clay".into(),
            stroke: Box::new(stroke(text)),
        };
        let why = command.apply(document.state(), control).unwrap_err().to_string();
        assert!(why.contains(word), "{text}: {why}");
    }
}
