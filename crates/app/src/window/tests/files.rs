//! Files that are written and read from menus are those of the command line.

use egui::accesskit::Role;

use super::*;

fn told(window: &mut Window, what: &str) {
    steps_until(window, what, |window| {
        let messages = &window.state().bench().messages;
        messages
            .iter()
            .any(|(_, text, is_failure)| !is_failure && text.contains(what))
    });
}

/// Meshes and fields that are exported are those that `mesh` and `export` write.
#[test]
fn exports_are_those_of_the_command_line() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    drag(&mut window);
    let sheet = edits(&mut window, 1);
    let document = scratch.path().join("copy.isoclay");
    std::fs::copy(&sheet.path, &document).unwrap();
    for (name, subcommand) in [("block.stl", "mesh"), ("block.iclay", "export")] {
        let [by_window, by_command] = ["window", "command"].map(|of| {
            let directory = scratch.path().join(of);
            std::fs::create_dir_all(&directory).unwrap();
            directory.join(name)
        });
        choose(&mut window, "File", "Export");
        write(&mut window, Role::TextInput, "File", by_window.to_str().unwrap());
        window.get_by_role_and_label(Role::Button, "Export").click();
        told(&mut window, &format!("{name} is written"));
        command_line(subcommand, &[&document, &"-o", &by_command]);
        let [a, b] = [by_window, by_command].map(|path| std::fs::read(path).unwrap());
        assert!(
            a.len() > 10_000 && a == b,
            "{name}: {} and {} bytes",
            a.len(),
            b.len()
        );
    }
    assert_eq!(edits(&mut window, 1).done, 1);
}

/// The dialog says what cannot be, replaces files by a button alone, and passes on how the mesh is wished; what was written is told.
#[test]
fn meshes_are_exported_as_they_are_wished_and_replace_nothing_unasked() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    let sheet = edits(&mut window, 0);
    let document = scratch.path().join("copy.isoclay");
    std::fs::copy(&sheet.path, &document).unwrap();
    let [nowhere, there, by_command] =
        ["nowhere/a.stl", "there.stl", "command.stl"].map(|name| scratch.path().join(name));
    std::fs::write(&there, "something else").unwrap();
    choose(&mut window, "File", "Export");
    write(&mut window, Role::TextInput, "File", nowhere.to_str().unwrap());
    window.run_steps(2);
    assert!(window.query_by_label_contains("there is no directory").is_some());
    window.key_press(egui::Key::Enter);
    window.run_steps(2);
    write(&mut window, Role::TextInput, "File", there.to_str().unwrap());
    window.run_steps(2);
    assert!(window.query_by_label_contains("is there already").is_some());
    window.key_press(egui::Key::Enter);
    window.run_steps(20);
    assert_eq!(std::fs::read(&there).unwrap(), b"something else");
    for wish in ["cm", "x and y reversed", "the largest"] {
        window.get_by_label(wish).click();
        window.run_steps(2);
    }
    window.get_by_label("Replace").click();
    wait_for(&mut window, "Written");
    let wished: [&dyn AsRef<std::ffi::OsStr>; 8] = [
        &document,
        &"-o",
        &by_command,
        &"--unit",
        &"cm",
        &"--axes",
        &"lps",
        &"--keep=largest",
    ];
    let told = command_line("mesh", &wished);
    assert!(std::fs::read(&there).unwrap() == std::fs::read(&by_command).unwrap());
    let written = window.state().bench().written.as_ref().unwrap();
    let row = |what: &str| {
        let mut rows = written.rows().iter().filter(|row| row.0 == what);
        rows.next()
            .map(|(_, figure, is_well)| (figure.as_str(), *is_well))
            .unwrap()
    };
    let triangles = told["triangles"].as_u64().unwrap() as usize;
    assert_eq!(row("Triangles").0, crate::cli::quantity::human_count(triangles));
    assert_eq!(
        [row("Closed"), row("Manifold"), row("Unit")],
        [("yes", true), ("yes", true), ("cm", true)]
    );
}

/// A script that is run from the menu leaves what `sculpt` leaves.
#[test]
fn a_script_from_the_menu_does_what_sculpt_does() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    let sheet = edits(&mut window, 0);
    let document = scratch.path().join("other.isoclay");
    std::fs::copy(&sheet.path, &document).unwrap();
    let script = scratch.path().join("two.jsonl");
    let lines = "{\"carve\": {\"shape\": {\"sphere\": {\"radius\": 6}}, \"along\": [[0, 0, 20]]}}\n\
                 {\"smooth\": {\"radius\": 5, \"level\": 2, \"along\": [[0, 6, 20]]}}\n";
    std::fs::write(&script, lines).unwrap();
    choose(&mut window, "File", "Run script");
    write(&mut window, Role::TextInput, "File", script.to_str().unwrap());
    window.get_by_role_and_label(Role::Button, "Run script").click();
    let sheet = edits(&mut window, 2);
    command_line("sculpt", &[&document, &"--script", &script]);
    assert_eq!(
        on_disk(&sheet, scratch.path()).state().sha256(),
        opened(&document).state().sha256()
    );
    assert_is_script(
        &sheet,
        scratch.path(),
        &lines
            .lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect::<Vec<_>>(),
    );
}
