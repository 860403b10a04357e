//! Keys that are given to other actions.

use egui::accesskit::Role;
use egui::{Key, Modifiers};

use super::*;
use crate::window::actions::{Action, Name};

/// The table with the rows of some words, one of which waits for keys.
fn waits(window: &mut Window, words: &str, keys: &str) {
    write(window, Role::TextInput, "Find", words);
    window.run_steps(2);
    window.get_by_role_and_label(Role::Button, keys).click();
    window.run_steps(2);
    assert!(window.query_by_label("press keys…").is_some());
}

/// Keys that are changed do it from then on, in the next window too; those of another action are taken only if that is wished.
#[test]
fn keys_are_changed_and_taken_from_others_if_that_is_wished() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    let text = |window: &Window, action| window.state().bench().keys.text(action);
    let (slices, log) = (Action::Do(Name::Slices), Action::Do(Name::Log));
    choose(&mut window, "Edit", "Shortcuts");
    waits(&mut window, "slices", "none");
    window.key_press_modifiers(Modifiers::ALT, Key::T);
    window.run_steps(2);
    assert_eq!(text(&window, slices), "Alt+T");
    window.key_press_modifiers(Modifiers::ALT, Key::T);
    window.run_steps(2);
    assert!(window.state().bench().slices.is_some());
    window.key_press_modifiers(Modifiers::ALT, Key::T);
    window.run_steps(2);
    assert!(window.state().bench().slices.is_none());

    // Escape leaves it, and closes nothing.
    waits(&mut window, "log", "none");
    window.key_press(Key::Escape);
    window.run_steps(2);
    assert_eq!(text(&window, log), "");
    for (answer, [carve, taken]) in [("Leave it", ["C", ""]), ("Take it for Log", ["", "C"])] {
        waits(&mut window, "log", "none");
        window.key_press(Key::C);
        window.run_steps(2);
        assert!(window.query_by_label("C belongs to Carve already").is_some());
        window.get_by_label(answer).click();
        window.run_steps(2);
        assert_eq!(text(&window, Action::Take(Kind::Carve)), carve);
        assert_eq!(text(&window, log), taken);
    }
    drop(window);

    let mut next = window_with_clay(home.path());
    next.key_press(Key::C);
    next.run_steps(2);
    assert!(next.state().bench().shows_log);
    choose(&mut next, "Edit", "Shortcuts");
    next.get_by_label("All as usual").click();
    next.run_steps(2);
    assert_eq!([text(&next, slices), text(&next, log)], ["", ""]);
    assert_eq!(text(&next, Action::Take(Kind::Carve)), "C");
}
