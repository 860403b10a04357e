//! Panels: what they do to a document is what a command does, and what they only show is no edit.

use egui::accesskit::Role;

use super::*;
use crate::window::actions::Action;

/// A stroke has the tool, the radius and the strength of the panel, and the journal repeats it to the bit.
#[test]
fn the_panel_of_tools_sets_what_a_stroke_is_made_with() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    window.get_by_label_contains("Inflate").click();
    window.step();
    let size = window.state().bench().scene.1;
    write(&mut window, Role::SpinButton, "Radius  F", "5");
    window.key_press(egui::Key::Enter);
    window.step();
    write(&mut window, Role::SpinButton, "Strength", "0.25");
    window.key_press(egui::Key::Enter);
    window.step();
    let tool = window.state().bench().tool;
    assert_eq!((tool.kind, tool.strength), (Kind::Inflate, 0.25));
    assert!((tool.radius * size - 5.0).abs() < 1e-9, "{}", tool.radius * size);
    drag(&mut window);
    let sheet = edits(&mut window, 1);
    let mut document = on_disk(&sheet, scratch.path());
    let command = document.command(0).unwrap().to_string();
    assert!(
        command.contains("inflate") && command.contains("5.0"),
        "{command}"
    );
    assert_eq!(again(&mut document).sha256(), document.state().sha256());
}

/// The density that is typed into the panel is that of a stroke in a script.
#[test]
fn the_density_of_the_panel_is_that_of_a_script() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    window.get_by_label("Surface density").click();
    window.run_steps(20);
    write(&mut window, Role::SpinButton, "Surface at", "1.5");
    window.key_press(egui::Key::Enter);
    window.step();
    let sheet = edits(&mut window, 1);
    assert_eq!(sheet.objects[0].iso, 1.5);
    let by_panel = on_disk(&sheet, scratch.path()).state().sha256();
    let other = tempfile::tempdir().unwrap();
    let mut desk = Bare::new(other.path());
    desk.order(Order::Clay);
    desk.sheet(0, 0);
    let surface = serde_json::from_value(serde_json::json!({ "surface": { "iso": 1.5 } })).unwrap();
    desk.order(Order::Do(Box::new(surface)));
    let by_script = on_disk(&desk.sheet(1, 1), scratch.path()).state().sha256();
    desk.end();
    assert_eq!(by_panel, by_script);
}

/// Menus undo, redo, save and open; the files have what the document has.
#[test]
fn menus_and_boxes_for_paths_do_what_commands_do() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    drag(&mut window);
    edits(&mut window, 1);
    choose(&mut window, "Edit", "Undo");
    until(&mut window, "undone", |sheet| sheet.done == 0);
    choose(&mut window, "Edit", "Redo");
    let sheet = until(&mut window, "redone", |sheet| sheet.done == 1);
    let state = on_disk(&sheet, scratch.path()).state().sha256();

    choose(&mut window, "File", "Save as");
    let saved = scratch.path().join("named");
    write(&mut window, Role::TextInput, "File", saved.to_str().unwrap());
    window.get_by_role_and_label(Role::Button, "Save as").click();
    let named = until(&mut window, "saved", |sheet| !sheet.is_untitled);
    assert_eq!(named.path, saved.with_extension("isoclay"));
    assert_eq!(on_disk(&named, scratch.path()).state().sha256(), state);

    // Another document, and the first again.
    choose(&mut window, "File", "New block");
    until(&mut window, "new", |sheet| sheet.is_untitled);
    choose(&mut window, "File", "Open");
    write(&mut window, Role::TextInput, "File", named.path.to_str().unwrap());
    window.get_by_role_and_label(Role::Button, "Open").click();
    let again = until(&mut window, "opened", |sheet| !sheet.is_untitled);
    assert_eq!((again.history.len(), again.done), (1, 1));
    assert_eq!(on_disk(&again, scratch.path()).state().sha256(), state);
}

/// Slices, the clipping plane, views and the log show, and edit nothing.
#[test]
fn what_is_only_seen_is_no_edit() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    drag(&mut window);
    let before = on_disk(&edits(&mut window, 1), scratch.path()).state().sha256();
    for (menus, item) in [
        ("View/Windows", "Slices"),
        ("View", "Clipping plane"),
        ("View/Windows", "Log"),
        ("View/Look from", "Top"),
        ("View", "Light"),
        ("View/Look from", "All"),
    ] {
        choose(&mut window, menus, item);
        window.key_press(egui::Key::Escape);
        window.run_steps(3);
    }
    let bench = window.state().bench();
    assert!(bench.slices.is_some() && bench.look.cut.is_some() && bench.shows_log);
    write(&mut window, Role::SpinButton, "Clipping plane", "3");
    window.key_press(egui::Key::Enter);
    window.run_steps(3);
    let bench = window.state().bench();
    let (at, normal) = bench.look.cut.unwrap();
    assert!(((at - bench.scene.0).dot(normal) - 3.0).abs() < 1e-9, "{at}");
    // The wheel with Alt takes it toward the eye, which stays.
    let away = bench.look.camera.distance();
    let over = middle(&window);
    window.hover_at(over);
    window.event(egui::Event::MouseWheel {
        unit: egui::MouseWheelUnit::Line,
        delta: egui::vec2(0.0, 2.0),
        phase: egui::TouchPhase::Move,
        source: egui::MouseWheelSource::Wheel,
        modifiers: egui::Modifiers::ALT,
    });
    window.run_steps(20);
    let bench = window.state().bench();
    assert!(bench.plane_height().unwrap() > 3.1, "{:?}", bench.plane_height());
    assert_eq!(bench.look.camera.distance(), away);
    let sheet = bench.sheet.clone().unwrap();
    assert_eq!((sheet.history.len(), sheet.done), (1, 1));
    assert_eq!(on_disk(&sheet, scratch.path()).state().sha256(), before);
}

/// Clicks measure where they are told to, and edit nothing.
#[test]
fn places_walls_area_and_volume_are_measured() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    window.key_press(egui::Key::M);
    window.step();
    for x in [600.0, 640.0, 660.0] {
        click(&mut window, egui::pos2(x, 400.0));
    }
    window.run_steps(2);
    window.get_by_label("Area and volume").click();
    steps_until(&mut window, "measured", |window| {
        window.state().bench().measure.as_ref().unwrap().size.is_some()
    });
    let bench = window.state().bench();
    let measure = bench.measure.clone().unwrap();
    let ways: Vec<f64> = measure.distances().collect();
    assert!((ways[0] / ways[1] - 2.0).abs() < 0.2, "{ways:?}");
    // The block is 40 mm on each side, its edges rounded.
    assert!(
        measure.marks.iter().all(|m| (m.wall.unwrap() - 40.0).abs() < 1.0),
        "{measure:?}"
    );
    let [area, volume] = measure.size.unwrap().1;
    assert!(
        (8500.0..9600.0).contains(&area) && (58e3..64e3).contains(&volume),
        "{area} {volume}"
    );
    assert!(bench.sheet.as_ref().unwrap().history.is_empty());
    window.get_by_label("Clear").click();
    window.run_steps(2);
    assert_eq!(window.state().bench().measure, Some(Default::default()));
}

/// Objects are duplicated, renamed, moved by typed numbers and removed, as a script does it.
#[test]
fn objects_are_arranged_as_by_a_script() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    choose(&mut window, "Edit", "Duplicate");
    until(&mut window, "duplicated", |sheet| sheet.objects.len() == 2);
    // The copy is in the hand: 50 along X, then Enter.
    let middle = egui::pos2(640.0, 400.0);
    window.hover_at(middle);
    window.run_steps(3);
    window.key_press(egui::Key::X);
    window.step();
    for text in ["5", "0"] {
        window.event(egui::Event::Text(text.into()));
        window.step();
    }
    window.key_press(egui::Key::Enter);
    window.run_steps(2);
    let sheet = edits(&mut window, 2);
    assert_eq!(sheet.objects[sheet.chosen].name, "clay 2");
    let script =
        "{\"copy\": {\"to\": \"clay 2\"}}\n{\"object\": \"clay 2\", \"place\": {\"by\": [50, 0, 0]}}\n";
    assert_eq!(
        on_disk(&sheet, scratch.path()).state().sha256(),
        by_script(script)
    );

    // Another name, by the tree.
    window.get_by_label("clay 2").click_secondary();
    window.run_steps(3);
    window.get_by_label("Rename").click();
    window.run_steps(3);
    write(&mut window, Role::TextInput, "Name", "twin");
    window.key_press(egui::Key::Enter);
    window.run_steps(2);
    let sheet = edits(&mut window, 3);
    assert_eq!(sheet.objects[sheet.chosen].name, "twin");
    choose(&mut window, "Edit", "Remove");
    let sheet = edits(&mut window, 4);
    let all = format!(
        "{script}{}\n{}",
        r#"{"tool": "rename", "object": "clay 2", "to": "twin"}"#, r#"{"tool": "remove", "object": "twin"}"#
    );
    assert_eq!(on_disk(&sheet, scratch.path()).state().sha256(), by_script(&all));
    assert_eq!(sheet.objects.len(), 1);
}

/// A scene that the panel plays is the scene of a script.
#[test]
fn a_scene_is_played_as_by_a_script() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    choose(&mut window, "View/Windows", "Simulation");
    window.key_press(egui::Key::Escape);
    window.run_steps(3);
    window.get_by_label("Swelling clay").click();
    window.run_steps(2);
    let bench = window.state().bench();
    let script = bench.simulation.script(bench.chosen().unwrap());
    window.get_by_label("Play").click();
    let sheet = edits(&mut window, 1);
    assert!(sheet.history[0].contains("scene"));
    assert_eq!(
        on_disk(&sheet, scratch.path()).state().sha256(),
        by_script(&script)
    );
}

/// What the window did, saved as a script, is done again to the same state.
#[test]
fn a_saved_script_does_it_again() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    drag(&mut window);
    edits(&mut window, 1);
    window.get_by_label("Material").click();
    window.run_steps(20);
    window.get_by_label("Elastic").click();
    let sheet = edits(&mut window, 2);
    choose(&mut window, "File", "Save script");
    let file = scratch.path().join("done.jsonl");
    write(&mut window, Role::TextInput, "File", file.to_str().unwrap());
    window.get_by_role_and_label(Role::Button, "Save script").click();
    steps_until(&mut window, "saved", |_| file.exists());
    let script = std::fs::read_to_string(&file).unwrap();
    assert_eq!(
        by_script(&script),
        on_disk(&sheet, scratch.path()).state().sha256()
    );
}

/// The command palette finds and does; the table of keys is shown.
#[test]
fn the_palette_of_commands_finds_and_does() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    command(&mut window, "chis");
    assert_eq!(window.state().bench().tool.kind, Kind::Chisel);
    assert!(window.state().bench().commands.is_none());
    assert!(window.state().bench().keys.text(Action::Take(Kind::Chisel)) == "H");
    choose(&mut window, "Edit", "Shortcuts");
    assert!(window.query_by_label("All as usual").is_some());
}

/// Words and Enter that a slow picture sees at once choose what was typed, not what stood in the list before.
#[test]
fn the_palette_of_commands_is_right_at_any_frame_rate() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    let press = |key| egui::Event::Key {
        key,
        physical_key: None,
        pressed: true,
        repeat: false,
        modifiers: egui::Modifiers::NONE,
    };
    let typed = [
        press(egui::Key::F3),
        egui::Event::Text("chis".into()),
        press(egui::Key::Enter),
    ];
    for together in [1, 2, 3] {
        window.key_press(egui::Key::C);
        window.step();
        assert_eq!(window.state().bench().tool.kind, Kind::Carve);
        for events in typed.chunks(together) {
            window.input_mut().events.extend(events.iter().cloned());
            window.step();
        }
        window.run_steps(2);
        assert_eq!(
            window.state().bench().tool.kind,
            Kind::Chisel,
            "{together} at once"
        );
        assert!(window.state().bench().commands.is_none());
    }
}

/// Symmetry, a box and a wall of the panel are those of the stroke in the journal.
#[test]
fn strokes_keep_to_the_limits_that_are_set() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    window.get_by_label("Where it acts").click();
    window.run_steps(20);
    window.get_by_role_and_label(Role::Button, "X").click();
    window.run_steps(2);
    drag(&mut window);
    let sheet = edits(&mut window, 1);
    let mut document = on_disk(&sheet, scratch.path());
    let command = document.command(0).unwrap();
    assert_eq!(
        command["stroke"]["symmetry"]["normal"],
        serde_json::json!([1.0, 0.0, 0.0]),
        "{command}"
    );
    assert_eq!(again(&mut document).sha256(), document.state().sha256());
}
