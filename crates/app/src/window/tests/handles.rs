//! Handles do what the command line does.

use egui::{Pos2, Vec2};
use serde_json::Value;

use super::*;
use crate::window::handles::Handle;

/// Places on a handle, from its beginning to its end.
fn line(window: &Harness<'_, Modeler>, handle: Handle) -> Vec<Pos2> {
    let modeler = window.state();
    let all = modeler.handles(modeler.drawn_in, modeler.bench().chosen().unwrap());
    all.into_iter().find(|(which, _)| *which == handle).unwrap().1
}

/// A window in which a handle was dragged: what the place of it and the way are, the command that it became, and the hash.
fn dragged(
    handle: Handle,
    pictures: usize,
    from_to: impl Fn(&[Pos2]) -> [Pos2; 2],
) -> (Modeling, Value, [u8; 32]) {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    window.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::Tab);
    window.run_steps(2);
    assert!(window.state().bench().arranging);
    let [from, to] = from_to(&line(&window, handle));
    let modeler = window.state();
    let thing = modeler.bench().chosen().unwrap();
    let seen = Modeling {
        size: thing.own_box.size().max_element(),
        point: modeler.length_of_point(modeler.drawn_in, thing.own_box.center()),
    };
    window.hover_at(from);
    window.run_steps(2);
    let button = |at, pressed| egui::Event::PointerButton {
        pos: at,
        button: egui::PointerButton::Primary,
        pressed,
        modifiers: egui::Modifiers::NONE,
    };
    let moves = (1..=8).map(|n| egui::Event::PointerMoved(from + n as f32 / 8.0 * (to - from)));
    let events = [button(from, true)]
        .into_iter()
        .chain(moves)
        .chain([button(to, false)]);
    for (n, event) in events.enumerate() {
        window.input_mut().events.push(event);
        if pictures > 1 || n == 9 {
            window.step();
        }
    }
    let sheet = edits(&mut window, 1);
    let mut document = on_disk(&sheet, scratch.path());
    let command = document.command(0).unwrap();
    assert_eq!(command["tool"], "stroke");
    let place = command["stroke"]["place"].clone();
    (seen, place, document.state().sha256())
}

/// How large things are there.
struct Modeling {
    size: f64,
    point: f64,
}

fn numbers(of: &Value) -> [f64; 3] {
    serde_json::from_value(of.clone()).unwrap()
}

/// An arrow moves along its axis, as far as the mouse goes along it.
#[test]
fn arrows_move_along_their_axis() {
    for pictures in [1, 8] {
        let (seen, place, digest) = dragged(Handle::Arrow(0), pictures, |line| {
            let way = line[1] - line[0];
            [line[0] + 0.5 * way, line[0] + 1.2 * way]
        });
        let [x, y, z] = numbers(&place["by"]);
        // A way across the line of sight is as long on the screen as it is foreshortened; the arrow is three quarters of 86 points.
        let due = 0.7 * 0.75 * 86.0 * seen.point;
        assert!(
            (x / due - 1.0).abs() < 0.05 && (y, z) == (0.0, 0.0),
            "{place} of {due}"
        );
        assert!(x < seen.size);
        let script = format!("{{\"place\": {{\"by\": [{x:?}, 0, 0]}}}}\n");
        assert_eq!(digest, by_script(&script));
    }
}

/// A ring turns about its axis, as far as the mouse goes round.
#[test]
fn rings_turn_about_their_axis() {
    for (axis, at) in [(0, [20, 26]), (1, [14, 22]), (2, [12, 24])] {
        let (_, place, digest) = dragged(Handle::Ring(axis), 8, |line| at.map(|n| line[n]));
        let turn = numbers(&place["turn"]);
        let due = 360.0 / 64.0 * (at[1] - at[0]) as f64;
        for (n, found) in turn.into_iter().enumerate() {
            let due = if n == axis { due } else { 0.0 };
            assert!((found - due).abs() < 1.5, "{axis}: {place} of {due}");
        }
        let [x, y, z] = turn;
        let script = format!("{{\"place\": {{\"turn\": [{x:?}, {y:?}, {z:?}]}}}}\n");
        assert_eq!(digest, by_script(&script));
    }
}

/// The box scales by how much farther it is taken from the middle.
#[test]
fn the_box_scales() {
    let (_, place, digest) = dragged(Handle::Box, 8, |at| {
        let way = 0.5 * 86.0 * Vec2::new(0.8, -0.8);
        [at[0], at[0] + way]
    });
    let factor = place["scale"].as_f64().unwrap();
    assert!((factor - 1.5).abs() < 1e-3, "{place}");
    assert_eq!(
        digest,
        by_script(&format!("{{\"place\": {{\"scale\": {factor:?}}}}}\n"))
    );
}

/// Escape leaves the object where it was, and so does a handle that is let go where it was taken.
#[test]
fn a_handle_that_is_left_does_nothing() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    window.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::Tab);
    window.run_steps(2);
    let at = line(&window, Handle::Box)[0];
    window.hover_at(at);
    window.step();
    window.drag_at(at);
    window.step();
    window.hover_at(at + egui::vec2(60.0, -60.0));
    window.step();
    assert!(window.state().arrange.is_some());
    window.key_press(egui::Key::Escape);
    window.step();
    assert!(window.state().arrange.is_none());
    window.drop_at(at);
    window.step();
    click(&mut window, at);
    window.run_steps(4);
    assert!(window.state().arrange.is_none());
    let bench = window.state().bench();
    assert!(bench.arranging && bench.sheet.as_ref().unwrap().history.is_empty());
}
