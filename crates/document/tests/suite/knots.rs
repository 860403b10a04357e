//! Blocks on knots of their own: kept, changed, and written in levels where a tool asks for them.

use std::path::Path;

use bspline::{Field, TensorSpline};
use document::{Change, Command, Document, Object, Options, State};
use fitting::Control;
use formats::field::FieldMeta;
use glam::{DAffine3, DVec3};
use tempfile::tempdir;
use tools::body::Body;
use tools::knots::block;

use super::clay::again;
use super::common::Draw;

/// A block of 8 × 6 × 4 with close knots about one edge.
pub fn uneven() -> TensorSpline<f32> {
    let x: Vec<f64> = (0..=16).map(|i| 1.0 + 0.25 * f64::from(i)).collect();
    let z: Vec<f64> = (0..=10).map(|i| 1.0 + 0.2 * f64::from(i)).collect();
    block(DVec3::new(8.0, 6.0, 4.0), 0.5, [&x, &[], &z]).unwrap()
}

pub fn state_of(field: TensorSpline<f32>) -> State {
    let meta = FieldMeta {
        iso: Some(0.0),
        ..FieldMeta::default()
    };
    State::new()
        .with("block", Object::of(field.into(), meta))
        .unwrap()
}

pub fn commands(session: &str) -> Vec<Command> {
    Command::of_script::<document::CommandError>(session, |_| Ok("block".into())).unwrap()
}

/// Does what a session says, each stroke an edit; what was told.
fn sculpted(document: &mut Document, session: &str) -> Vec<String> {
    let mut told = Vec::new();
    for command in commands(session) {
        let (next, notes) = command.apply(document.state(), &mut Control::default()).unwrap();
        assert!(
            document
                .commit(&command.title(), command.to_value(), next)
                .unwrap()
        );
        told.extend(notes);
    }
    told
}

fn opened(path: &Path) -> Document {
    let opened = Document::open(path, Options::default()).unwrap();
    assert_eq!(opened.lost, None);
    opened.document
}

fn body(state: &State) -> &Body {
    &state.object("block").unwrap().field
}

const DIRECT: &str = "[[stroke]]\nplace = { by = [1, 2, 3], turn = [0, 0, 30] }\n\
    [[stroke]]\npaint = { layer = 'stiffness', brush = { along = [[2, 1, 1]], radius = 1.5, value = 4 } }\n\
    [[stroke]]\nrefine = { along = [[3, 2, 1]], radius = 0.6 }\n\
    [[stroke]]\nhold = { name = 'top', points = [[1, 0, 2]] }\n\
    [[stroke]]\npaint = { layer = 'mass', formula = '2 + x^2' }\n\
    [[stroke]]\nfree = { name = 'top' }\n\
    [[stroke]]\nmaterial = { solid = 'elastic' }\n\
    [[stroke]]\ncopy = { to = 'twin' }\n";

/// What works on knots as they are leaves them; it is kept, undone to the first hash, and done again by any number of threads.
#[test]
fn knots_stay_where_tools_work_on_them_as_they_are() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("knots.isoclay");
    let first = state_of(uneven());
    let mut document = Document::create(&path, first.clone(), Options::default()).unwrap();
    assert_eq!(document.state().sha256(), first.sha256());
    let told = sculpted(&mut document, DIRECT);
    assert_eq!(told, [""; 0]);
    assert!(body(document.state()).knots().is_some());
    assert!(document.state().object("twin").unwrap().field.knots().is_some());
    let left = document.state().sha256();
    drop(document);
    let mut document = opened(&path);
    assert_eq!(document.state().sha256(), left);
    for threads in [1, 2, 8] {
        assert_eq!(again(&mut document, threads).sha256(), left, "{threads}");
    }
    assert_eq!(document.undo(8).unwrap(), 8);
    assert_eq!(document.state().sha256(), first.sha256());
    assert_eq!(document.redo(8).unwrap(), 8);
    assert_eq!(document.state().sha256(), left);
}

/// Knots put in change values by the rounding of the coefficients alone, and halve what the brush meets on each axis.
#[test]
fn knots_are_put_in_without_a_change_of_values() {
    let mut draw = Draw(5);
    let mut number =
        |low: f64, high: f64| low + (high - low) * f64::from(draw.below(1 << 20)) / f64::from(1 << 20);
    for seed in 0..20 {
        let at: [f64; 3] = [number(-6.0, 6.0), number(-5.0, 5.0), number(-4.0, 4.0)];
        let session = format!(
            "[[stroke]]\nrefine = {{ along = [{at:?}], radius = {}, finer = {} }}",
            number(0.1, 2.0),
            1 + seed % 3
        );
        let old = state_of(uneven());
        let (new, told) = commands(&session)[0]
            .apply(&old, &mut Control::default())
            .unwrap();
        assert_eq!(told, [""; 0]);
        let [old, new] = [&old, &new].map(|s| body(s).knots().unwrap().clone());
        for axis in 0..3 {
            assert!(new.shape()[axis] > old.shape()[axis], "{session}");
            let kept = old.knots()[axis].knots();
            assert!(kept.iter().all(|k| new.knots()[axis].knots().contains(k)));
        }
        for _ in 0..400 {
            let p = DVec3::new(number(-9.0, 9.0), number(-8.0, 8.0), number(-7.0, 7.0));
            let off = (old.value(p) - new.value(p)).abs();
            assert!(
                off <= 1e-6 * old.value(p).abs().max(1.0),
                "{session} {p}: {off:e}"
            );
        }
    }
}

/// Any other tool gets the field in levels, whose surface is where it was, and says so.
#[test]
fn other_tools_get_levels_and_say_so() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("levels.isoclay");
    let first = state_of(uneven());
    let mut document = Document::create(&path, first.clone(), Options::default()).unwrap();
    sculpted(
        &mut document,
        "[[stroke]]\npaint = { layer = 'stiffness', brush = { along = [[2, 1, 1]], radius = 1.5, value = 4 } }",
    );
    let painted = document.state().object("block").unwrap().layers.clone();
    let told = sculpted(
        &mut document,
        "[[stroke]]\ncarve = { along = [[4, 3, 2]], shape = { sphere = { radius = 0.6 } } }",
    );
    assert!(told[0].contains("knots were given up"), "{told:?}");
    let object = document.state().object("block").unwrap();
    let levels = object.field.levels().expect("it was carved");
    let knots = body(&first).knots().unwrap();
    // Beside the ball, at the surface.
    for i in 0..400 {
        let [u, v] = [f64::from(i / 20) / 10.0 - 1.0, f64::from(i % 20) / 10.0 - 1.0];
        for p in [
            DVec3::new(2.5 * u, 2.5 * v, 2.0),
            DVec3::new(-4.0, 2.5 * u, 1.5 * v),
        ] {
            let off = (levels.value(p) - knots.value(p)).abs();
            assert!(off <= 0.02 * 0.2, "{p}: {off}");
        }
    }
    let stiff = &object.layers[&tools::paint::Substance::Stiffness];
    let old = &painted[&tools::paint::Substance::Stiffness];
    assert_eq!(stiff.tree().sha256(), old.tree().sha256());
    let left = document.state().sha256();
    assert_eq!(again(&mut document, 2).sha256(), left);
    assert_eq!(document.undo(2).unwrap(), 2);
    assert_eq!(document.state().sha256(), first.sha256());
}

/// The difference of two versions on the same knots is the box of coefficients that differ; a file of it leads both ways.
#[test]
fn coefficients_that_change_are_kept_as_their_box() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("changed.isoclay");
    let first = state_of(uneven());
    let mut document = Document::create(&path, first.clone(), Options::default()).unwrap();
    let mut draw = Draw(9);
    let mut hashes = vec![first.sha256()];
    for _ in 0..20 {
        let field = body(document.state()).knots().unwrap();
        let mut coefficients = field.coefficients().to_vec();
        let at = draw.below(coefficients.len() as u32) as usize;
        coefficients[at] += 0.25;
        let new = field.with_coefficients(coefficients).unwrap();
        let mut object = document.state().object("block").unwrap().clone();
        object.field = Body::Knots(new);
        let next = document.state().with("block", object).unwrap();
        let changes = Change::between(document.state(), &next);
        assert!(matches!(&changes[..], [Change::Field { .. }]), "{changes:?}");
        let before = document.size();
        document.commit("one", serde_json::Value::Null, next).unwrap();
        assert!(document.size() - before < 2000);
        hashes.push(document.state().sha256());
    }
    drop(document);
    let mut document = opened(&path);
    for hash in hashes.iter().rev().skip(1) {
        assert_eq!(document.undo(1).unwrap(), 1);
        assert_eq!(document.state().sha256(), *hash);
    }
}

#[test]
fn what_cannot_be_done_says_why() {
    let refused = |session: &str| {
        let applied = commands(session)[0].apply(&state_of(uneven()), &mut Control::default());
        applied.expect_err(session).to_string()
    };
    for (session, part) in [
        (
            "[[stroke]]\nrefine = { along = [[30, 0, 0]], radius = 1 }",
            "move the tool",
        ),
        (
            "[[stroke]]\nrefine = { along = [[0, 0, 0]], radius = 1, finer = 9 }",
            "1 to 8",
        ),
        (
            "[[stroke]]\nrefine = { along = [[0, 0, 0]], radius = 3, finer = 8 }",
            "smaller brush",
        ),
        (
            "[[stroke]]\nrefine = { along = [[0, 0, 0]], radius = 1 }\nwithin = { min = [0, 0, 0], max = [1, 1, 1] }",
            "leave within",
        ),
        (
            "[[stroke]]\nhold = { name = 'a', points = [[0, 0, 0]] }",
            "give a spring",
        ),
        ("[[stroke]]\nfree = { name = 'a' }", "no hold"),
    ] {
        let why = refused(session);
        assert!(why.contains(part), "{session}: {why}");
    }
    let wrong = |size: [f64; 3], spacing: f64, x: &[f64]| {
        block(DVec3::from_array(size), spacing, [x, &[], &[]])
            .expect_err("refused")
            .to_string()
    };
    for (why, part) in [
        (
            wrong([1.0; 3], 0.1, &[1.0, 0.5]),
            "axis x: the knot 0.5 follows 1",
        ),
        (wrong([1.0; 3], 0.1, &[0.5, 0.5]), "write each once"),
        (wrong([1.0; 3], 0.1, &[0.5]), "two at least"),
        (wrong([1.0; 3], 0.1, &[5.0, 6.0]), "some within"),
        (wrong([1.0; 3], 0.1, &[0.0, f64::NAN]), "write numbers"),
        (wrong([1.0; 3], 1e-5, &[]), "larger --spacing"),
        (wrong([1.0; 3], 0.005, &[]), "fewer knots"),
        (wrong([0.0; 3], 0.1, &[]), "above 0"),
    ] {
        assert!(why.contains(part), "{why}");
    }
}

/// Its surface lies where the block's faces do, on even and uneven knots.
#[test]
fn a_block_has_its_faces_where_they_were_asked_for() {
    let field = uneven();
    for i in 0..400 {
        let [u, v] = [f64::from(i / 20) / 10.0 - 1.0, f64::from(i % 20) / 10.0 - 1.0];
        for (p, share) in [
            (DVec3::new(4.0, 2.0 * u, 1.0 * v), 0.01),
            (DVec3::new(2.5 * u, -3.0, 1.0 * v), 0.01),
            (DVec3::new(2.5 * u, 1.5 * v, 2.0), 0.01),
        ] {
            assert!(field.value(p).abs() < share * 0.5, "{p}: {}", field.value(p));
        }
    }
    let placed = field.placed(DAffine3::from_translation(DVec3::X));
    assert_eq!(placed.value(DVec3::X), field.value(DVec3::ZERO));
    assert_ne!(placed.sha256(), field.sha256());
}
