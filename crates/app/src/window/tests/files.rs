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
                 {\"smooth\": {\"radius\": 5, \"strength\": 0.5, \"along\": [[0, 6, 20]]}}\n";
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
