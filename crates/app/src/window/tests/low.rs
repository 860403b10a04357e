//! A window as low and narrow as half of a small screen: nothing lies over the menu, nor out of sight.

use super::*;

const LOW: [f32; 2] = [640.0, 360.0];

fn low_with_clay(home: &Path) -> Window {
    let mut window = window_of(home, LOW);
    window.step();
    window.state_mut().bench.order(Order::Clay);
    wait_for(&mut window, "History");
    window
}

/// All of the menu of views is there, and what it opens leaves the menu free.
#[test]
fn menus_and_windows_fit_into_a_low_window() {
    let home = tempfile::tempdir().unwrap();
    let mut window = low_with_clay(home.path());
    window.get_by_label("View").click();
    window.run_steps(4);
    let last = window.get_by_label("As the system").rect();
    assert!(last.max.y < LOW[1], "{last}");
    window.key_press(egui::Key::Escape);
    window.run_steps(3);
    for (item, inside) in [
        ("Touch", "Take it in the hand"),
        ("Measure", "Area and volume"),
        ("Picture", "Save picture"),
        ("Slices", "Value and place are told under the mouse"),
    ] {
        choose(&mut window, "View/Windows", item);
        window.run_steps(5);
        let heads = window.get_all_by_label_contains(item).map(|node| node.rect());
        let top = heads.map(|head| head.min.y).fold(f32::INFINITY, f32::min);
        assert!(top > 24.0, "{item} is over the menu: {top}");
        let inside = window.get_by_label(inside).rect();
        assert!(inside.max.y < LOW[1] && inside.max.x < LOW[0], "{item}: {inside}");
        if item == "Slices" {
            let last = window.get_by_label("Sagittal").rect();
            assert!(last.max.x < LOW[0], "{last}");
            window.get_by_label("Four views").click();
            window.run_steps(5);
            let set = window.get_by_label("Profile").rect();
            let plane = window.get_by_label("Axial").rect();
            assert!(set.max.x < LOW[0] && set.max.y <= plane.min.y, "{set} {plane}");
        }
    }
}

/// What is told at length ends before the window does.
#[test]
fn the_status_line_ends_within_the_window() {
    let home = tempfile::tempdir().unwrap();
    let mut window = low_with_clay(home.path());
    let told = "what is told at length ".repeat(12);
    window.state_mut().bench.tell(told, true);
    window.run_steps(2);
    let told = window.get_by_label_contains("what is told at length").rect();
    assert!(told.max.x <= LOW[0] - 8.0, "{told}");
}
