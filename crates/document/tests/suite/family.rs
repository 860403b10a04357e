//! Objects that go and get other names, and scripts of all that was done.

use document::{Command, CommandError, Document, Options, State};
use fitting::Control;
use tempfile::tempdir;

use super::clay::{again, plate};

fn commands(script: &str) -> Vec<Command> {
    Command::of_script::<CommandError>(script, |own| Ok(own.unwrap_or("clay").into())).unwrap()
}

fn done(document: &mut Document, script: &str) {
    for command in commands(script) {
        let next = command
            .apply(document.state(), &mut Control::default())
            .unwrap()
            .0;
        document
            .commit(&command.title(), command.to_value(), next)
            .unwrap();
    }
}

const FAMILY: &str = r#"{"copy": {"to": "hat"}}
{"object": "hat", "place": {"parent": "clay"}}
{"object": "hat", "place": {"by": [0, 0, 3]}}
{"object": "clay", "place": {"turn": [0, 0, 30], "by": [1, 2, 0]}}
{"tool": "rename", "object": "clay", "to": "head"}
{"object": "hat", "inflate": {"along": [[12, 12, 13.6]], "radius": 3, "by": 0.4}}
"#;

/// The child of an object that is renamed or removed stays where it is; both are undone to the bit.
#[test]
fn what_hangs_on_an_object_stays_where_it_is() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("a.isoclay");
    let mut document = Document::create(&path, plate(), Options::default()).unwrap();
    done(&mut document, FAMILY);
    let before = document.state().clone();
    let parent = |state: &State| state.object("hat").unwrap().properties.parent.clone();
    assert_eq!(parent(&before).as_deref(), Some("head"));
    let placed = before.placement("hat").unwrap();
    done(&mut document, r#"{"tool": "remove", "object": "head"}"#);
    let left = document.state().clone();
    assert_eq!((left.objects().len(), parent(&left)), (1, None));
    assert!(left.placement("hat").unwrap().abs_diff_eq(placed, 1e-12));
    drop(document);
    let mut document = Document::open(&path, Options::default()).unwrap().document;
    assert_eq!(document.state().sha256(), left.sha256());
    document.undo(1).unwrap();
    assert_eq!(document.state().sha256(), before.sha256());
    document.undo(99).unwrap();
    assert_eq!(document.state().sha256(), plate().sha256());
    document.redo(99).unwrap();
    assert_eq!(document.state().sha256(), left.sha256());
    assert_eq!(again(&mut document, 2).sha256(), left.sha256());
}

#[test]
fn the_last_object_and_a_name_that_is_taken_are_refused() {
    let told = |script: &str| {
        let mut state = plate();
        let mut told = String::new();
        for command in commands(script) {
            match command.apply(&state, &mut Control::default()) {
                Ok((next, _)) => state = next,
                Err(why) => told = why.to_string(),
            }
        }
        told
    };
    assert!(told(r#"{"tool": "remove", "object": "clay"}"#).contains("only object"));
    let taken = "{\"copy\": {\"to\": \"b\"}}\n{\"tool\": \"rename\", \"object\": \"clay\", \"to\": \"b\"}";
    assert!(told(taken).contains("another name"));
    assert!(told(r#"{"tool": "rename", "object": "clay", "to": " b"}"#).contains("space"));
    let unknown = r#"{"tool": "rename", "object": "clay", "as": "b"}"#;
    let why = Command::of_script::<CommandError>(unknown, |_| Ok("clay".into())).unwrap_err();
    assert!(why.to_string().contains("line 1"), "{why}");
}

/// What a document did, written as a script, is done again to the same state: strokes, scenes, names, and nothing that is undone.
#[test]
fn the_script_of_a_document_does_all_of_it_again() {
    let directory = tempdir().unwrap();
    let mut document =
        Document::create(&directory.path().join("a.isoclay"), plate(), Options::default()).unwrap();
    done(&mut document, FAMILY);
    let scene = "field = \"hat.iclay\"\n[region]\nmin = [6, 6, 10]\nmax = [16, 16, 16]\nlevel = 0\n[material]\nrest-scale = 1.5\n[time]\nduration = 0.2\nstep = 0.05\n";
    let scene = Command::Scene {
        object: "hat".into(),
        script: scene.into(),
    };
    let next = scene.apply(document.state(), &mut Control::default()).unwrap().0;
    assert!(document.commit(&scene.title(), scene.to_value(), next).unwrap());
    let wanted = document.state().sha256();
    done(
        &mut document,
        r#"{"object": "head", "material": {"solid": "elastic"}}"#,
    );
    document.undo(1).unwrap();
    let script = document.script().unwrap();
    assert_eq!(script.lines().count(), 7);
    let mut twin =
        Document::create(&directory.path().join("b.isoclay"), plate(), Options::default()).unwrap();
    done(&mut twin, &script);
    assert_eq!(twin.state().sha256(), wanted);
}
