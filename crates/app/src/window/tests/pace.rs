//! Strokes of a mouse that are the stronger the slower they are.

use super::*;

/// Moves that a mouse tells a second.
const RATE: f64 = 60.0;
/// When a stroke begins, seconds.
const BEGINS: f64 = 100.0;

/// Draws 72 points to the right, so many points a second, in so many pictures a second: the command that it becomes, and the hash.
fn drawn(kind: Kind, speed: f64, pictures: usize, is_on: bool) -> (serde_json::Value, [u8; 32]) {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    window.state_mut().bench.take(kind);
    window.run_steps(2);
    if is_on {
        press(&mut window, "Slower is stronger");
    }
    let at = |n: usize| egui::pos2(620.0 + (speed / RATE * n as f64) as f32, 400.0);
    window.hover_at(at(0));
    window.input_mut().time = Some(BEGINS - 1.0 / RATE);
    window.step();
    let last = (72.0 / speed * RATE).round() as usize;
    let moves = (1..=last).map(|n| egui::Event::PointerMoved(at(n)));
    let events = [button(at(0), true)]
        .into_iter()
        .chain(moves)
        .chain([button(at(last), false)]);
    let events: Vec<egui::Event> = events.collect();
    let mut told = 0;
    for some in events.chunks(RATE as usize / pictures) {
        told += some.len();
        window.input_mut().events.extend(some.iter().cloned());
        window.input_mut().time = Some(BEGINS + (told - 1) as f64 / RATE);
        window.step();
    }
    let sheet = edits(&mut window, 1);
    let mut document = on_disk(&sheet, scratch.path());
    assert_eq!(again(&mut document).sha256(), document.state().sha256());
    (document.command(0).unwrap(), document.state().sha256())
}

fn presses(command: &serde_json::Value) -> Vec<f64> {
    let all = command["stroke"]["press"].as_array();
    let all = all.unwrap_or_else(|| panic!("{command}"));
    all.iter().map(|press| press.as_f64().unwrap()).collect()
}

/// The same journal at 10, 20 and 60 pictures a second; a slow stroke is stronger than a fast one.
#[test]
fn slow_strokes_are_stronger_at_any_rate_of_pictures() {
    let mut mean = Vec::new();
    for speed in [120.0, 720.0] {
        let (command, digest) = drawn(Kind::Inflate, speed, 60, true);
        for pictures in [10, 20] {
            let seldom = drawn(Kind::Inflate, speed, pictures, true);
            assert_eq!(seldom.0, command);
            assert_eq!(seldom.1, digest);
        }
        let all = presses(&command);
        let places = command["stroke"]["inflate"]["along"].as_array().unwrap();
        assert_eq!(all.len(), places.len());
        assert!(all.len() > 8 && all.iter().all(|press| (0.1..=1.0).contains(press)));
        mean.push(all.iter().sum::<f64>() / all.len() as f64);
    }
    assert!(mean[0] > 0.75 && mean[1] < 0.5, "{mean:?}");
}

/// A ball goes less deep; a click has all of the strength, and so has a stroke while that is off.
#[test]
fn what_presses_do_is_what_a_pen_does() {
    let height = |command: &serde_json::Value| {
        let along = command["stroke"]["carve"]["along"].as_array().unwrap();
        along[along.len() - 1][2].as_f64().unwrap()
    };
    let [slow, fast] = [60.0, 720.0].map(|speed| height(&drawn(Kind::Carve, speed, 20, true).0));
    assert!(fast > slow + 0.1, "{fast} {slow}");
    let off = drawn(Kind::Carve, 720.0, 20, false).0;
    assert!((height(&off) - slow).abs() < 0.05, "{off} {slow}");
    let off = drawn(Kind::Inflate, 720.0, 20, false).0;
    assert!(off["stroke"]["press"].is_null(), "{off}");
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    window.state_mut().bench.take(Kind::Inflate);
    window.run_steps(2);
    press(&mut window, "Slower is stronger");
    click(&mut window, egui::pos2(620.0, 400.0));
    // Where all is at its strongest journals say nothing of it.
    let mut document = on_disk(&edits(&mut window, 1), scratch.path());
    let clicked = document.command(0).unwrap();
    assert!(clicked["stroke"]["press"].is_null(), "{clicked}");
}

/// It is off at first, kept from one window to the next, and there for tools alone that a pen could press.
#[test]
fn the_switch_is_kept() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    assert!(!window.state().bench().by_speed);
    press(&mut window, "Slower is stronger");
    assert!(window.state().bench().by_speed);
    window.state_mut().bench.take(Kind::Grab);
    window.run_steps(3);
    assert!(window.query_by_label("Slower is stronger").is_none());
    drop(window);
    assert!(window_with_clay(home.path()).state().bench().by_speed);
}

/// Esc drops a stroke that waits for its first step: nothing is left, and nothing begins later.
#[test]
fn what_is_dropped_does_not_begin() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    press(&mut window, "Slower is stronger");
    let at = egui::pos2(620.0, 400.0);
    window.hover_at(at);
    window.step();
    window.drag_at(at);
    window.step();
    window.key_press(egui::Key::Escape);
    window.step();
    window.drop_at(at);
    window.run_steps(3);
    drag(&mut window);
    let sheet = edits(&mut window, 1);
    assert!(sheet.history[0].contains("carve"), "{:?}", sheet.history);
}
