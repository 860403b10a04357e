//! Panels are moved, laid one before the other, closed, opened and kept.

use egui::{Pos2, Rect};

use super::*;
use crate::window::actions::{Action, Name};
use crate::window::layout::{Layout, Panel};

fn run(window: &mut Harness<'_, Modeler>, name: Name) {
    let context = window.ctx.clone();
    Action::Do(name).run(&mut window.state_mut().bench, &context);
    window.run_steps(3);
}

/// Where the scene is; windows under test have a margin of 8 points.
fn scene(window: &Harness<'_, Modeler>) -> Rect {
    window.state().drawn_in
}

/// The rim of a panel taken elsewhere.
fn drag(window: &mut Harness<'_, Modeler>, rim: &str, to: Pos2) {
    let from = window.get_by_label(rim).rect().center();
    window.hover_at(from);
    window.step();
    window.drag_at(from);
    window.step();
    for n in 1..=8 {
        window.hover_at(from + n as f32 / 8.0 * (to - from));
        window.step();
    }
    window.drop_at(to);
    window.run_steps(4);
}

/// At first the tools are on the left and the objects on the right, as wide as they always were; the scene has the rest.
#[test]
fn at_first_panels_are_beside_the_scene() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    window.run_steps(2);
    let first = scene(&window);
    assert!(
        (first.left() - 203.0).abs() < 1.5 && (first.right() - 1062.0).abs() < 1.5,
        "{first}"
    );
    assert_eq!(window.state().layout, None);
    for (name, left, right) in [(Name::Tools, 8.0, 1062.0), (Name::Objects, 8.0, 1272.0)] {
        run(&mut window, name);
        let now = scene(&window);
        assert!(
            (now.left() - left).abs() < 1.5 && (now.right() - right).abs() < 1.5,
            "{now}"
        );
    }
    assert!(window.query_by_label("History").is_none());
    for name in [Name::Objects, Name::Tools] {
        run(&mut window, name);
    }
    assert_eq!(scene(&window), first);
    run(&mut window, Name::Panels);
    assert!((scene(&window).width() - 1264.0).abs() < 1.5);
    // One that is asked for comes, though all were hidden.
    run(&mut window, Name::Objects);
    assert!((scene(&window).width() - 1054.0).abs() < 1.5);
}

/// What is opened comes before the objects, or below the scene; tabs and their crosses do what they say.
#[test]
fn panels_that_are_opened_come_to_the_front() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    let first = scene(&window);
    run(&mut window, Name::Simulation);
    assert!(window.query_by_label("Play").is_some() && window.query_by_label("History").is_none());
    assert_eq!(scene(&window), first);
    window
        .get_by_role_and_label(egui::accesskit::Role::Button, "Objects")
        .click();
    window.run_steps(3);
    assert!(window.query_by_label("Play").is_none() && window.query_by_label("History").is_some());
    run(&mut window, Name::Log);
    assert!(scene(&window).height() < first.height() - 100.0);
    run(&mut window, Name::Log);
    run(&mut window, Name::Simulation);
    assert_eq!(scene(&window), first);
    assert!(window.query_by_label("History").is_some());
    assert!(!window.state().bench().is_open(Panel::Simulation));
}

/// Three tabs fit into the narrow panel, under titles that are shortened if they have to be; a click on any brings it to the front.
#[test]
fn three_tabs_are_all_in_sight() {
    use egui::accesskit::Role;
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    run(&mut window, Name::Simulation);
    run(&mut window, Name::Performance);
    window.run_steps(3);
    assert!(window.query_by_label("Scroll tabs right").is_none());
    assert!(window.query_by_label("Scroll tabs left").is_none());
    let right = scene(&window).right();
    for (name, within) in [
        ("Objects", "History"),
        ("Simulation", "Play"),
        ("Performance", "Memory"),
    ] {
        let tab = window.get_by_role_and_label(Role::Button, name).rect();
        assert!(tab.left() >= right && tab.right() <= 1272.0, "{name}: {tab}");
        window.get_by_role_and_label(Role::Button, name).click();
        window.run_steps(3);
        assert!(window.query_by_label_contains(within).is_some(), "{name}");
        // The one in front can be closed.
        assert_eq!(window.get_all_by_label("Close").count(), 1);
    }
    window.get_by_label("Close").click();
    window.run_steps(3);
    assert!(!window.state().bench().is_open(Panel::Performance));
    assert!(window.state().bench().is_open(Panel::Simulation));
}

/// A panel that is moved is there in the next window too, until all are as at first.
#[test]
fn a_panel_that_is_moved_stays_there() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    let first = scene(&window);
    drag(
        &mut window,
        "Move Objects",
        first.center_bottom() - egui::vec2(0.0, 12.0),
    );
    let below = scene(&window);
    assert!(
        below.height() < first.height() - 100.0 && below.height() > 200.0,
        "{below}"
    );
    // Beside the tools it is as wide as it was.
    drag(&mut window, "Move Objects", egui::pos2(204.0, 300.0));
    let beside = scene(&window);
    assert!(
        (beside.left() - 413.0).abs() < 2.0 && (beside.right() - 1272.0).abs() < 2.0,
        "{beside}"
    );
    drag(
        &mut window,
        "Move Objects",
        beside.center_bottom() - egui::vec2(0.0, 12.0),
    );
    let moved = window.state().layout.clone().expect("another layout");
    assert!(moved.is_whole());
    assert!(scene(&window).height() < first.height() - 100.0, "{moved:?}");
    assert!(window.query_by_label("History").is_some());
    drop(window);
    let mut next = window_with_clay(home.path());
    next.run_steps(2);
    assert_eq!(next.state().layout.as_ref(), Some(&moved));
    run(&mut next, Name::AsAtFirst);
    assert_eq!((next.state().layout.as_ref(), scene(&next)), (None, first));
    run(&mut next, Name::Sides);
    assert!((scene(&next).left() - 218.0).abs() < 1.5, "{}", scene(&next));
    drop(next);
    // What makes no sense is as at first.
    let nonsense = Layout::Tabs(vec![Layout::Panel(Panel::Scene)], 7);
    let kept = serde_json::json!({ "layout": nonsense });
    std::fs::write(home.path().join("view.json"), kept.to_string()).unwrap();
    let mut last = window_with_clay(home.path());
    last.run_steps(2);
    assert_eq!(scene(&last), first);
}
