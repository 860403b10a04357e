//! Documents: edits, undo, and files that crashes and faults have cut.

mod any_order;
mod clay;
mod cloud;
mod common;
mod densities;
mod family;
mod fineness;
mod killed;
mod knots;
mod live;
mod preview;
mod revision;
mod sessions;

use std::collections::BTreeSet;
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

use bspline::AnyField;
use bspline::hierarchical::{BlockEdit, Change as BlockChange, HierarchicalSpline, LevelEdit};
use common::{Draw, ball, dented, object, random_edit};
use document::{Change, Document, DocumentError, Options, Properties, State};
use formats::field::FieldMeta;
use glam::{DAffine3, DVec3};
use serde_json::{Value, json};
use tempfile::tempdir;

fn open(path: &Path) -> Document {
    let opened = Document::open(path, Options::default()).unwrap();
    assert_eq!(opened.lost, None);
    opened.document
}

#[test]
fn what_was_committed_is_there_after_reopening() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("two.isoclay");
    let state = State::new().with("ball", object(&ball())).unwrap();
    let mut document = Document::create(&path, state.clone(), Options::default()).unwrap();
    assert!(!document.commit("nothing", Value::Null, state.clone()).unwrap());
    let mut second = object(&ball());
    second.properties = Properties::placed(DAffine3::from_translation(DVec3::new(0.1, 1.0 / 3.0, 1e-300)));
    second.properties.parent = Some("ball".into());
    let next = state.with("kugel ü", second).unwrap();
    let command = json!({"tool": "add", "at": [0.1, 1.0 / 3.0]});
    assert!(
        document
            .commit("a second ball", command.clone(), next.clone())
            .unwrap()
    );
    drop(document);
    let mut document = open(&path);
    assert_eq!(document.state().sha256(), next.sha256());
    let placed = |state: &State| state.object("kugel ü").unwrap().properties.clone();
    assert_eq!(placed(document.state()), placed(&next));
    let history = document.history().unwrap();
    assert_eq!(history.len(), 1);
    assert_eq!(history[0].title, "a second ball");
    assert_eq!(document.command(0).unwrap(), command);
    assert_eq!(document.undo(7).unwrap(), 1);
    drop(document);
    let mut document = open(&path);
    assert_eq!(document.state().sha256(), state.sha256());
    let counts = document.counts().unwrap();
    assert_eq!((counts.done, counts.undone, counts.forgotten), (0, 1, 0));
    assert_eq!(document.redo(1).unwrap(), 1);
    assert_eq!(document.state().sha256(), next.sha256());
}

#[test]
fn a_thousand_mixed_edits_are_undone_to_the_first_hash_and_redone_to_the_last() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("long.isoclay");
    let first = State::new().with("a", object(&ball())).unwrap();
    let mut document = Document::create(&path, first.clone(), Options::default()).unwrap();
    let mut draw = Draw(7);
    let mut hashes = vec![first.sha256()];
    while hashes.len() <= 1000 {
        let next = random_edit(document.state(), &mut draw);
        if document.commit("edit", Value::Null, next).unwrap() {
            hashes.push(document.state().sha256());
        }
        if hashes.len() % 173 == 0 {
            drop(document);
            document = open(&path);
            assert_eq!(document.state().sha256(), *hashes.last().unwrap());
        }
    }
    assert_eq!(document.undo(400).unwrap(), 400);
    assert_eq!(document.state().sha256(), hashes[600]);
    drop(document);
    let mut document = open(&path);
    assert_eq!(document.state().sha256(), hashes[600]);
    assert_eq!(document.undo(usize::MAX).unwrap(), 600);
    assert_eq!(document.state().sha256(), hashes[0]);
    assert_eq!(document.redo(usize::MAX).unwrap(), 1000);
    assert_eq!(document.state().sha256(), hashes[1000]);
    // An edit after an undo takes the place of what was undone.
    document.undo(10).unwrap();
    let next = random_edit(document.state(), &mut draw);
    document.commit("another way", Value::Null, next.clone()).unwrap();
    drop(document);
    let mut document = open(&path);
    assert_eq!(document.state().sha256(), next.sha256());
    assert_eq!(document.redo(1).unwrap(), 0);
    assert_eq!(document.history().unwrap().len(), 991);
}

#[test]
fn changes_lead_both_ways() {
    let mut draw = Draw(3);
    let mut state = State::new().with("a", object(&ball())).unwrap();
    for _ in 0..200 {
        let next = random_edit(&state, &mut draw);
        let changes = Change::between(&state, &next);
        let back: Vec<Change> = changes.iter().rev().map(Change::reversed).collect();
        let kind = |c: &Change| std::mem::discriminant(c);
        let mut around: Vec<_> = Change::between(&next, &state).iter().map(kind).collect();
        let mut expected: Vec<_> = back.iter().map(kind).collect();
        around.sort_by_key(|d| format!("{d:?}"));
        expected.sort_by_key(|d| format!("{d:?}"));
        assert_eq!(around, expected);
        state = next;
    }
}

/// A short document, its bytes, and the hashes of its states in order.
fn short(directory: &Path) -> (Vec<u8>, Vec<[u8; 32]>) {
    let path = directory.join("short.isoclay");
    let first = State::new().with("a", object(&ball())).unwrap();
    let mut document = Document::create(&path, first.clone(), Options::default()).unwrap();
    let mut hashes = vec![first.sha256()];
    for step in 0..4 {
        let next = dented(document.state(), "a", step);
        document.commit("dent", Value::Null, next).unwrap();
        hashes.push(document.state().sha256());
    }
    document.undo(2).unwrap();
    hashes.push(document.state().sha256());
    let next = dented(document.state(), "a", 9);
    document.commit("dent", Value::Null, next).unwrap();
    hashes.push(document.state().sha256());
    drop(document);
    let bytes = std::fs::read(&path).unwrap();
    std::fs::remove_file(&path).unwrap();
    (bytes, hashes)
}

#[test]
fn a_document_cut_at_any_byte_opens_as_it_once_was_or_is_refused() {
    let directory = tempdir().unwrap();
    let (bytes, hashes) = short(directory.path());
    let path = directory.path().join("cut.isoclay");
    let mut met = BTreeSet::new();
    let mut is_refused = false;
    std::fs::write(&path, &bytes).unwrap();
    for length in (0..=bytes.len()).rev() {
        let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
        file.set_len(length as u64).unwrap();
        match Document::open(&path, Options::default()) {
            Err(DocumentError::File(_)) => is_refused = true,
            Err(other) => panic!("{other}"),
            Ok(mut opened) => {
                assert!(!is_refused, "opened at {length}, refused when longer");
                let hash = opened.document.state().sha256();
                let at = hashes
                    .iter()
                    .rposition(|h| *h == hash)
                    .expect("a state that once was");
                met.insert(at);
                assert_eq!(opened.lost.is_none(), opened.document.size() == length as u64);
                if let Some(lost) = &opened.lost {
                    assert!(lost.is_torn, "{length}: {lost:?}");
                }
                if length % 101 == 0 {
                    let next = dented(opened.document.state(), "a", 5);
                    opened
                        .document
                        .commit("after", Value::Null, next.clone())
                        .unwrap();
                    drop(opened);
                    assert_eq!(open(&path).state().sha256(), next.sha256());
                    std::fs::write(&path, &bytes).unwrap();
                }
            }
        }
    }
    // State 2 is met again after the undo.
    assert_eq!(met, BTreeSet::from([0, 1, 3, 4, 5, 6]));
    assert_eq!(
        std::fs::read_dir(directory.path()).unwrap().count(),
        1,
        "nothing else is left"
    );
}

#[test]
fn a_flipped_bit_costs_no_more_than_what_hangs_on_it_and_the_damaged_file_is_kept() {
    let directory = tempdir().unwrap();
    let (bytes, hashes) = short(directory.path());
    let path = directory.path().join("flipped.isoclay");
    let copy = directory.path().join("flipped.isoclay.damaged");
    let mut opened_count = 0;
    std::fs::write(&path, &bytes).unwrap();
    let put = |at: usize, byte: u8| {
        let mut file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
        file.seek(SeekFrom::Start(at as u64)).unwrap();
        file.write_all(&[byte]).unwrap();
    };
    let mut before = None;
    for at in (0..bytes.len()).step_by(3) {
        if let Some(before) = before.replace(at) {
            put(before, bytes[before]);
        }
        put(at, bytes[at] ^ 1 << (at % 8));
        let mut opened = match Document::open(&path, Options::default()) {
            Ok(opened) => opened,
            Err(DocumentError::File(_)) => continue,
            Err(other) => panic!("{other}"),
        };
        opened_count += 1;
        let hash = opened.document.state().sha256();
        assert!(hashes.contains(&hash), "flip at {at}");
        // An undone edit is not needed; else the flip is noticed.
        assert!(opened.lost.is_some() || hash == *hashes.last().unwrap());
        if at % 50 == 0 {
            let next = dented(opened.document.state(), "a", 5);
            opened
                .document
                .commit("after", Value::Null, next.clone())
                .unwrap();
            let is_kept = opened.lost.is_some_and(|lost| !lost.is_torn);
            drop(opened.document);
            assert_eq!(open(&path).state().sha256(), next.sha256());
            assert_eq!(copy.exists(), is_kept);
            if is_kept {
                let mut flipped = bytes.clone();
                flipped[at] ^= 1 << (at % 8);
                assert_eq!(std::fs::read(&copy).unwrap(), flipped);
                std::fs::remove_file(&copy).unwrap();
            }
            std::fs::write(&path, &bytes).unwrap();
        }
    }
    assert!(opened_count > 100);
}

#[test]
fn a_document_is_open_once() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("one.isoclay");
    let document = Document::create(&path, State::new(), Options::default()).unwrap();
    let again = Document::open(&path, Options::default());
    assert!(matches!(again, Err(DocumentError::InUse(p)) if p == path));
    let over = Document::create(&path, State::new(), Options::default());
    assert!(matches!(over, Err(DocumentError::Exists(p)) if p == path));
    drop(document);
    open(&path);
}

#[test]
fn a_file_keeps_to_its_quota_by_forgetting_the_oldest_edits() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("quota.isoclay");
    let options = Options {
        quota: 200_000,
        ..Options::default()
    };
    let first = State::new().with("a", object(&ball())).unwrap();
    let mut document = Document::create(&path, first, options).unwrap();
    let mut draw = Draw(11);
    let mut hashes = Vec::new();
    for _ in 0..600 {
        let next = random_edit(document.state(), &mut draw);
        if document.commit("edit", Value::Null, next).unwrap() {
            hashes.push(document.state().sha256());
        }
        assert!(document.trouble().is_none());
        assert!(
            document.size() <= options.quota + 60_000,
            "{} bytes",
            document.size()
        );
        assert_eq!(std::fs::metadata(&path).unwrap().len(), document.size());
    }
    let counts = document.counts().unwrap();
    assert!(counts.forgotten > 0);
    assert_eq!(counts.forgotten as usize + counts.done, hashes.len());
    let undone = document.undo(usize::MAX).unwrap();
    assert_eq!(document.state().sha256(), hashes[hashes.len() - 1 - undone]);
    drop(document);
    let mut document = open(&path);
    assert_eq!(document.redo(usize::MAX).unwrap(), undone);
    assert_eq!(document.state().sha256(), *hashes.last().unwrap());
}

/// Where the objects alone outgrow the quota, or an edit does, the last one is kept all the same.
#[test]
fn what_is_larger_than_its_quota_can_still_be_undone() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("large.isoclay");
    let large = object(&common::large());
    let first = State::new().with("a", large.clone()).unwrap();
    let quota = 20_000;
    let mut document = Document::create(
        &path,
        first,
        Options {
            quota,
            ..Options::default()
        },
    )
    .unwrap();
    assert!(document.size() > quota);
    for number in 0..200 {
        let before = document.state().sha256();
        let next = dented(document.state(), "a", number);
        document.commit("dent", Value::Null, next).unwrap();
        assert_eq!(document.undo(1).unwrap(), 1);
        assert_eq!(document.state().sha256(), before);
        document.redo(1).unwrap();
    }
    assert!(document.counts().unwrap().forgotten > 0);
    for number in 0..5 {
        let before = document.state().sha256();
        let next = document
            .state()
            .with(&format!("b{number}"), large.clone())
            .unwrap();
        document.commit("put in", Value::Null, next).unwrap();
        assert_eq!(document.undo(1).unwrap(), 1);
        assert_eq!(document.state().sha256(), before);
        document.redo(1).unwrap();
    }
}

#[test]
fn states_refuse_what_makes_no_sense() {
    let ball = object(&ball());
    let state = State::new().with("a", ball.clone()).unwrap();
    for name in ["", " a", "a/b", "a\n", &"x".repeat(101)] {
        assert!(
            matches!(state.with(name, ball.clone()), Err(DocumentError::Name { .. })),
            "{name:?}"
        );
    }
    let with = |change: fn(&mut Properties)| {
        let mut object = ball.clone();
        change(&mut object.properties);
        state.with("b", object)
    };
    let refused = |state: Result<State, DocumentError>| {
        assert!(matches!(state, Err(DocumentError::Properties { .. })));
    };
    refused(with(|p| p.placement[3][0] = f64::NAN));
    refused(with(|p| p.placement[1] = p.placement[0]));
    refused(with(|p| p.parent = Some("nobody".into())));
    refused(with(|p| p.parent = Some("b".into())));
    let chain = with(|p| p.parent = Some("a".into())).unwrap();
    refused(chain.without("a"));
    let mut turned = chain.object("a").unwrap().clone();
    turned.properties.parent = Some("b".into());
    refused(chain.with("a", turned));
    let missing = state.object("c").unwrap_err().to_string();
    assert_eq!(missing, r#"there is no object "c"; there is "a""#);
}

#[test]
fn double_precision_is_rounded_and_what_does_not_fit_is_refused() {
    let single = ball();
    let levels = |scale: f64| {
        let level = |level| {
            let wide = |c: &bspline::hierarchical::Corrections<f32>| {
                let values = c.values().iter().map(|v| f64::from(*v) * scale);
                bspline::hierarchical::Corrections::new(*c.mask(), values.collect())
            };
            let bricks = single.corrections(level).into_iter();
            bricks.map(|(key, c)| (key, wide(&c).into())).collect()
        };
        (0..single.level_count()).map(level).collect()
    };
    let double = |scale| {
        let field =
            HierarchicalSpline::<f64>::from_corrections(*single.lattice(), single.slope(), levels(scale));
        document::Object::new(&AnyField::F64(field), FieldMeta::default())
    };
    assert_eq!(double(1.0).unwrap().field.sha256(), single.sha256());
    assert!(double(1e300).is_err());
}

#[test]
fn what_is_no_document_is_refused_by_name() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("field.iclay");
    formats::field::save(&path, &ball(), &FieldMeta::default()).unwrap();
    let message = Document::open(&path, Options::default()).unwrap_err().to_string();
    assert!(
        message.contains("field.iclay") && message.contains("none of a document's"),
        "{message}"
    );
    assert!(Document::open(&directory.path().join("nothing"), Options::default()).is_err());
    assert!(Document::open(directory.path(), Options::default()).is_err());
}

#[test]
fn edits_of_a_field_take_the_bytes_of_what_they_change() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("small.isoclay");
    let field = common::large();
    let first = State::new().with("a", object(&field)).unwrap();
    let mut document = Document::create(&path, first, Options::default()).unwrap();
    let whole = document.size();
    let edit = LevelEdit {
        level: 0,
        function: [9; 3],
        delta: 0.5,
    };
    let mut object = document.state().object("a").unwrap().clone();
    object.field = object.field.levels().unwrap().edited(&[edit]).unwrap().into();
    let next = document.state().with("a", object).unwrap();
    document.commit("one", Value::Null, next).unwrap();
    let one = document.size() - whole;
    assert!(one < 6000, "{one} bytes for one brick, {whole} for all");
    let block = BlockEdit {
        level: 0,
        first: [0; 3],
        shape: [3; 3],
        change: BlockChange::Deactivate,
    };
    let mut object = document.state().object("a").unwrap().clone();
    object.field = object
        .field
        .levels()
        .unwrap()
        .edited_blocks(&[block])
        .unwrap()
        .into();
    let next = document.state().with("a", object).unwrap();
    document.commit("fewer", Value::Null, next.clone()).unwrap();
    drop(document);
    assert_eq!(open(&path).state().sha256(), next.sha256());
}

#[test]
fn paint_is_kept_with_its_object_and_felt_by_scenes() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("painted.isoclay");
    let mut large = object(&common::large());
    large.meta = FieldMeta {
        iso: Some(0.0),
        ..FieldMeta::default()
    }
    .into();
    let state = State::new().with("ball", large).unwrap();
    let plain = state.sha256();
    let mut document = Document::create(&path, state.clone(), Options::default()).unwrap();
    let session = r#"
[[stroke]]
paint = { layer = "stiffness", brush = { value = 50, along = [[20, 20, 34]], radius = 6 } }
[[stroke]]
paint = { layer = "friction", formula = "0.1 + 0.01 * z" }
"#;
    let named = |_: Option<&str>| Ok::<_, document::CommandError>("ball".to_string());
    for command in document::Command::of_script(session, named).unwrap() {
        let (next, _) = command
            .apply(document.state(), &mut fitting::Control::default())
            .unwrap();
        assert!(document.commit(&command.title(), json!(command), next).unwrap());
    }
    let painted = document.state().clone();
    assert_ne!(painted.sha256(), plain);
    let size = std::fs::metadata(&path).unwrap().len();
    drop(document);
    let mut document = open(&path);
    assert_eq!(document.state().sha256(), painted.sha256());
    assert_eq!(document.state().objects()["ball"].layers.len(), 2);
    assert!(document.undo(2).is_ok());
    assert_eq!(document.state().sha256(), plain);
    assert!(document.redo(2).is_ok());
    assert_eq!(document.state().sha256(), painted.sha256());
    // An object that goes and comes takes its paint along.
    let without = document.state().without("ball").unwrap();
    document.commit("away", Value::Null, without).unwrap();
    drop(document);
    let mut document = open(&path);
    document.undo(1).unwrap();
    assert_eq!(document.state().sha256(), painted.sha256());
    assert!(size < 3 << 20, "{size} bytes");

    let scene = r#"
field = "unused"
[region]
min = [12, 12, 27]
max = [28, 28, 39]
[[pull]]
at = [20, 20, 36]
radius = 2.5
strength = 30.0
[material]
mass = 0.01
damping = 0.5
[time]
duration = 0.3
step = 0.05
"#;
    let pulled = |state: &State| {
        let command = document::Command::of_script(scene, named).unwrap().remove(0);
        let (next, _) = command.apply(state, &mut fitting::Control::default()).unwrap();
        let moved = next.objects()["ball"].field.as_field();
        let before = state.objects()["ball"].field.as_field();
        let top = DVec3::new(20.0, 20.0, 36.0);
        bspline::Field::value(moved, top) - bspline::Field::value(before, top)
    };
    let (soft, stiff) = (pulled(&state), pulled(&painted));
    assert!(soft > 0.05 && stiff < 0.4 * soft && stiff > 0.0, "{soft} {stiff}");
}

#[test]
fn strokes_after_strokes_get_no_finer_by_themselves() {
    let mut large = object(&common::large());
    large.meta = FieldMeta {
        iso: Some(0.0),
        ..FieldMeta::default()
    }
    .into();
    let mut state = State::new().with("ball", large).unwrap();
    let stroke = |n: u32| {
        let z = 30.0 + f64::from(n % 3);
        format!(
            "[[stroke]]\ncarve = {{ shape = {{ sphere = {{ radius = 4 }} }}, along = [[{}, 20, {z}]] }}\n",
            10 + n
        )
    };
    let mut sizes = Vec::new();
    for n in 0..8 {
        let named = |_: Option<&str>| Ok::<_, document::CommandError>("ball".to_string());
        let command = document::Command::of_script(&stroke(n), named).unwrap().remove(0);
        (state, _) = command.apply(&state, &mut fitting::Control::default()).unwrap();
        let field = &state.objects()["ball"].field;
        sizes.push(field.coefficient_count());
        assert_eq!(field.level_count(), 2, "stroke {n}");
    }
    let grown = sizes[7] - sizes[0];
    assert!(grown < 4 * sizes[0], "{sizes:?}");
}

#[test]
fn holds_are_kept_with_the_object_and_undone() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("held.isoclay");
    let lattice = bspline::hierarchical::Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [24; 3],
    };
    let block = HierarchicalSpline::<f32>::schoenberg(lattice, 1.0, |p| 12.0 - p.z).unwrap();
    let meta = FieldMeta {
        iso: Some(0.0),
        ..object(&ball()).meta.as_ref().clone()
    };
    let first = State::new()
        .with("a", document::Object::new(&AnyField::F32(block), meta).unwrap())
        .unwrap();
    let mut document = Document::create(&path, first.clone(), Options::default()).unwrap();
    let session = "[[stroke]]\nhold = { name = 'rim', sketch = { meet = { formulas = ['(x - 12)^2 + (y - 12)^2 - 9', 'z - 12'] } } }\n\
                   [[stroke]]\npull = { along = [[12, 12, 12]], lift = 1.5, radius = 1.2 }\n[[stroke]]\nfree = { name = 'rim' }";
    let commands =
        document::Command::of_script::<document::CommandError>(session, |_| Ok("a".into())).unwrap();
    let mut hashes = vec![first.sha256()];
    for command in &commands {
        // As the journal has it.
        let command: document::Command =
            serde_json::from_value(serde_json::to_value(command).unwrap()).unwrap();
        let (next, _) = command.apply(document.state(), &mut Default::default()).unwrap();
        let text = serde_json::to_value(&command).unwrap();
        assert!(document.commit(&command.title(), text, next).unwrap());
        hashes.push(document.state().sha256());
        drop(document);
        document = open(&path);
        assert_eq!(document.state().sha256(), *hashes.last().unwrap());
    }
    assert!(document.state().object("a").unwrap().properties.holds.is_empty());
    assert_eq!(document.undo(1).unwrap(), 1);
    assert_eq!(
        document.state().object("a").unwrap().properties.holds[0].name,
        "rim"
    );
    let held = document.state().object("a").unwrap().field.as_field();
    let on_curve = bspline::Field::value(held, DVec3::new(15.0, 12.0, 12.0));
    assert!(on_curve.abs() < 0.01, "{on_curve}");
    assert_eq!(document.undo(2).unwrap(), 2);
    assert_eq!(document.state().sha256(), hashes[0]);
}
