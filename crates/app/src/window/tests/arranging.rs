//! Objects turned and scaled by keys and numbers.

use egui::Key;
use serde_json::json;

use super::*;

/// Keys, then a number, then what ends it.
fn arrange(window: &mut Window, keys: &[Key], number: &str, end: Key) {
    let over = middle(window);
    window.hover_at(over);
    window.run_steps(2);
    for key in keys {
        window.key_press(*key);
        window.run_steps(2);
    }
    types(window, number);
    window.key_press(end);
    window.run_steps(2);
}

/// R and S with numbers, on an axis or on all, are strokes of a script; Escape leaves nothing, and an axis typed twice is none.
#[test]
fn numbers_turn_and_scale_as_a_script_does() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    window.key_press_modifiers(egui::Modifiers::COMMAND, Key::Tab);
    window.run_steps(2);
    assert!(window.state().bench().arranging);
    arrange(&mut window, &[Key::R, Key::Z], "30", Key::Escape);
    arrange(&mut window, &[Key::R, Key::Z], "90", Key::Enter);
    edits(&mut window, 1);
    arrange(&mut window, &[Key::S], "1.5", Key::Enter);
    edits(&mut window, 2);
    arrange(&mut window, &[Key::S, Key::Y], "2", Key::Enter);
    edits(&mut window, 3);
    arrange(&mut window, &[Key::S, Key::X, Key::X], "0.5", Key::Enter);
    let sheet = edits(&mut window, 4);
    let mut document = on_disk(&sheet, scratch.path());
    let strokes: Vec<_> = (0..4)
        .map(|n| document.command(n).unwrap()["stroke"].clone())
        .collect();
    // To the last bit of an angle that went through radians.
    let turn: [f64; 3] = serde_json::from_value(strokes[0]["place"]["turn"].clone()).unwrap();
    assert!(
        (DVec3::from_array(turn) - 90.0 * DVec3::Z).length() < 1e-9,
        "{turn:?}"
    );
    assert_eq!(strokes[1], json!({ "place": { "scale": 1.5 } }));
    assert_eq!(strokes[3], json!({ "place": { "scale": 0.5 } }));
    assert_is_script(&sheet, scratch.path(), &strokes);
    // Along y of the world, which is x of the block since it was turned.
    let axes = sheet.objects[0].world_from_object.matrix3;
    let lengths = [axes.x_axis, axes.y_axis, axes.z_axis].map(|axis| axis.length());
    for (length, wanted) in lengths.into_iter().zip([1.5, 0.75, 0.75]) {
        assert!((length - wanted).abs() < 1e-9, "{lengths:?}");
    }
    assert!((axes.x_axis.normalize() - DVec3::Y).length() < 1e-9, "{axes}");
}

/// What the mouse leads is left by its right button, and done by its left one.
#[test]
fn the_mouse_scales_about_the_middle() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    window.key_press_modifiers(egui::Modifiers::COMMAND, Key::Tab);
    window.run_steps(2);
    let over = middle(&window);
    let far = over + egui::vec2(0.0, 150.0);
    for button in [egui::PointerButton::Secondary, egui::PointerButton::Primary] {
        window.hover_at(over + egui::vec2(0.0, 75.0));
        window.run_steps(2);
        window.key_press(Key::S);
        window.run_steps(2);
        window.hover_at(far);
        window.run_steps(2);
        for pressed in [true, false] {
            window.event(egui::Event::PointerButton {
                pos: far,
                button,
                pressed,
                modifiers: egui::Modifiers::NONE,
            });
            window.run_steps(2);
        }
    }
    let sheet = edits(&mut window, 1);
    let command = on_disk(&sheet, scratch.path()).command(0).unwrap();
    // Twice as far from the middle, or nearly: that is not where the mouse was to the point.
    let by = command["stroke"]["place"]["scale"].as_f64().unwrap();
    assert!((1.6..2.6).contains(&by), "{command}");
    assert_is_script(&sheet, scratch.path(), &[command["stroke"].clone()]);
}
