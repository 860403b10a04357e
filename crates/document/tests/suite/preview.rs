//! Edits that are shown before they are made.

use bspline::Field;
use document::{Command, CommandError, Document, Options, Preview, State};
use fitting::Control;
use glam::DVec3;
use tempfile::tempdir;
use tools::live::Pose;

use super::clay::{again, block, height};
use super::common::Draw;

fn command(text: &str) -> Command {
    let name = |_: Option<&str>| Ok::<_, CommandError>("clay".into());
    Command::of_script(&format!("[[stroke]]\n{text}"), name)
        .unwrap_or_else(|e| panic!("{text}: {e}"))
        .remove(0)
}

fn shown(state: &State, text: &str) -> Preview {
    Preview::of(state, command(text), &mut Control::default()).unwrap_or_else(|e| panic!("{text}: {e}"))
}

/// However often a solid or a brush is put elsewhere: the document stays until it acts, gets what was shown, as one edit, and a script does
/// the same.
#[test]
fn what_is_shown_is_what_the_document_gets() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("a.isoclay");
    let mut document = Document::create(&path, block(), Options::default()).unwrap();
    let bytes = || std::fs::read(&path).unwrap();
    let control = &mut Control::default();
    let mut draw = Draw(11);
    let mut number = |low: f64, high: f64| low + (high - low) * f64::from(draw.below(1001)) / 1000.0;
    for (n, text) in [
        "carve = { shape = { box = { size = [3, 2, 2] } }, along = [[12, 12, 12]] }",
        "add = { shape = { sphere = { radius = 1.5 } }, along = [[12, 12, 12]], blend = 0.5 }",
        "smooth = { along = [[12, 12, 12]], radius = 3, level = 2 }",
        "inflate = { along = [[12, 12, 12]], radius = 3, by = 0.4 }",
        "push = { along = [[12, 12, 12]], radius = 3, speed = 0.1 }",
        "symmetry = { at = [12, 12, 12], normal = [1, 0, 0] }\ncarve = { shape = { sphere = { radius = 1 } }, along = [[12, 12, 12]] }",
    ]
    .into_iter()
    .enumerate()
    {
        let (file, before) = (bytes(), document.state().clone());
        let mut preview = shown(document.state(), text);
        for _ in 0..3 {
            let pose = Pose {
                turn: DVec3::new(0.0, number(0.0, 90.0), 0.0),
                force: number(1.0, 3.0),
                ..Pose::at(DVec3::new(number(6.0, 18.0), number(6.0, 18.0), number(11.6, 12.4)))
            };
            preview.put(pose, control).unwrap();
            // Nothing of where it was before is left, and what is shown changes within the boxes told.
            let boxes = preview.changed().unwrap();
            let [old, new] = [&before, preview.state()].map(|s| s.object("clay").unwrap().field.levels().unwrap());
            for _ in 0..300 {
                let p = DVec3::new(number(2.0, 22.0), number(2.0, 22.0), number(8.0, 16.0));
                let is_told = boxes.iter().any(|b| p.cmpge(b.min).all() && p.cmple(b.max).all());
                assert!(is_told || old.value(p) == new.value(p), "{text}: {p}");
            }
        }
        assert_eq!((bytes(), document.state().sha256()), (file, before.sha256()), "{text}");
        let seen = preview.state().sha256();
        let is_changed = preview.apply(&mut document).unwrap();
        // A plane stays a plane when it is smoothed; by now it is none.
        assert!(is_changed, "{text}");
        assert_eq!(document.state().sha256(), seen, "{text}");
        assert_eq!(document.counts().unwrap().done, n + 1);
    }
    let last = document.state().sha256();
    for threads in [1, 8] {
        assert_eq!(again(&mut document, threads).sha256(), last, "{threads} threads");
    }
    document.undo(6).unwrap();
    assert_eq!(document.state().sha256(), block().sha256());
}

#[test]
fn what_is_not_applied_leaves_nothing() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("a.isoclay");
    let mut document = Document::create(&path, block(), Options::default()).unwrap();
    let bytes = || std::fs::read(&path).unwrap();
    let (file, hash) = (bytes(), document.state().sha256());
    let control = &mut Control::default();
    let text = "carve = { shape = { sphere = { radius = 2 } }, along = [[12, 12, 12]] }";
    let mut preview = shown(document.state(), text);
    assert!((height(preview.state(), 12.0, 12.0) + 2.0).abs() < 0.1);
    // Where it cannot act what is shown stays.
    let seen = preview.state().sha256();
    for at in [DVec3::splat(99.0), DVec3::NAN] {
        assert!(preview.put(Pose::at(at), control).is_err(), "{at}");
        assert_eq!(preview.state().sha256(), seen);
    }
    drop(preview);
    assert_eq!((bytes(), document.state().sha256()), (file, hash));
    // A document that went on refuses it.
    let [first, second] = [0, 1].map(|_| shown(document.state(), text));
    assert!(first.apply(&mut document).unwrap());
    let hash = document.state().sha256();
    let late = second.apply(&mut document).unwrap_err();
    assert!(matches!(late, CommandError::Changed(_)), "{late}");
    assert_eq!(document.state().sha256(), hash);
    // Tools without a place are shown, and not put.
    let mut preview = shown(
        document.state(),
        "move = { motion = { grab = { along = [[12, 12, 12], [12, 12, 13]], radius = 3 } } }",
    );
    let told = preview.put(Pose::at(DVec3::splat(12.0)), control).unwrap_err();
    assert!(told.to_string().contains("move is not put in place"), "{told}");
}
