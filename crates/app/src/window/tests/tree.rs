//! The tree of objects: what is seen, what is put together, what moves with what.

use serde_json::json;

use super::*;

/// Two blocks, the second one 20 mm to the right of the first, and what a script says of that.
fn two(home: &Path) -> (Window, Vec<serde_json::Value>) {
    let mut window = window_with_clay(home);
    choose(&mut window, "Edit", "Duplicate");
    until(&mut window, "duplicated", |sheet| sheet.objects.len() == 2);
    let over = middle(&window);
    window.hover_at(over);
    window.run_steps(3);
    window.key_press(egui::Key::X);
    window.step();
    types(&mut window, "20");
    window.key_press(egui::Key::Enter);
    window.run_steps(2);
    edits(&mut window, 2);
    let script = vec![
        json!({ "copy": { "to": "clay 2" } }),
        json!({ "object": "clay 2", "place": { "by": [20, 0, 0] } }),
    ];
    (window, script)
}

/// What the menu of an object has below another entry.
fn below(window: &mut Window, object: &str, entry: &str, item: &str) {
    // The tree has names too.
    let in_tree: Vec<egui::Rect> = window.query_all_by_label(item).map(|node| node.rect()).collect();
    window.get_by_label(object).click_secondary();
    window.run_steps(4);
    window.get_by_label_contains(entry).click();
    window.run_steps(6);
    let is_new = |node: &egui_kittest::Node<'_>| !in_tree.contains(&node.rect());
    let found = window.get_all_by_label(item).find(is_new);
    found.unwrap_or_else(|| panic!("no {item} below {entry}")).click();
    window.run_steps(4);
}

#[test]
fn what_is_hidden_is_no_edit() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (mut window, script) = two(home.path());
    let hidden = |window: &Window| window.state().bench().hidden.iter().cloned().collect::<Vec<_>>();
    press(&mut window, "clay is seen");
    assert_eq!(hidden(&window), ["clay"]);
    press(&mut window, "clay is seen");
    assert!(hidden(&window).is_empty());
    // The second one is chosen.
    choose(&mut window, "View", "Hide the object");
    window.key_press(egui::Key::Escape);
    window.run_steps(2);
    assert_eq!(hidden(&window), ["clay 2"]);
    choose(&mut window, "View", "Show this object alone");
    window.key_press(egui::Key::Escape);
    window.run_steps(2);
    assert_eq!(hidden(&window), ["clay"]);
    choose(&mut window, "View", "Show all objects");
    assert!(hidden(&window).is_empty());
    let sheet = edits(&mut window, 2);
    assert_is_script(&sheet, scratch.path(), &script);
}

/// An object that is not seen is not worked on.
#[test]
fn no_stroke_meets_what_is_hidden() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    press(&mut window, "clay is seen");
    drag(&mut window);
    window.run_steps(5);
    press(&mut window, "clay is seen");
    drag(&mut window);
    assert_eq!(edits(&mut window, 1).done, 1);
}

#[test]
fn objects_are_put_together_and_hang_on_others_as_by_a_script() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (mut window, mut script) = two(home.path());
    let other = json!({ "shape": { "object": { "name": "clay 2" } }, "along": [[20, 0, 0]] });
    for (n, (entry, tool)) in [("Add another", "add"), ("Take out another", "carve")]
        .into_iter()
        .enumerate()
    {
        below(&mut window, "clay", entry, "clay 2");
        let sheet = edits(&mut window, 3 + n);
        assert_eq!(sheet.objects[sheet.chosen].name, "clay");
        script.push(json!({ "object": "clay", tool: other }));
        assert_is_script(&sheet, scratch.path(), &script);
    }
    below(&mut window, "clay 2", "Moves with", "clay");
    let sheet = edits(&mut window, 5);
    assert_eq!(sheet.objects[1].parent.as_deref(), Some("clay"));
    script.push(json!({ "object": "clay 2", "place": { "parent": "clay" } }));
    assert_is_script(&sheet, scratch.path(), &script);
    below(&mut window, "clay 2", "Moves with", "nothing");
    let sheet = edits(&mut window, 6);
    assert_eq!(sheet.objects[1].parent, None);
    script.push(json!({ "object": "clay 2", "place": { "parent": "" } }));
    assert_is_script(&sheet, scratch.path(), &script);
}
