//! Strokes by pens.

use super::*;

/// A stroke by a pen that is pressed harder and harder, told in so many pictures: the command that it becomes, and the hash.
fn drawn(
    kind: Kind,
    pictures: usize,
    prepare: impl FnOnce(&mut Harness<'_, Modeler>),
) -> (serde_json::Value, [u8; 32]) {
    const MOVES: usize = 24;
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    window.state_mut().pens.pretend(None, &[], false);
    window.state_mut().bench.take(kind);
    window.run_steps(2);
    prepare(&mut window);
    let at = |n: usize| egui::pos2(620.0 + 3.0 * n as f32, 400.0);
    window.hover_at(at(0));
    window.step();
    window.state_mut().pens.pretend(Some(0.1), &[], false);
    window.input_mut().events.push(button(at(0), true));
    for n in 1..=MOVES {
        let press = 0.1 + 0.9 * n as f64 / MOVES as f64;
        window.state_mut().pens.pretend(None, &[press], n == MOVES);
        window.input_mut().events.push(egui::Event::PointerMoved(at(n)));
        if n % (MOVES / pictures) == 0 {
            if n == MOVES {
                window.input_mut().events.push(button(at(n), false));
            }
            window.step();
        }
    }
    let sheet = edits(&mut window, 1);
    let mut document = on_disk(&sheet, scratch.path());
    let command = document.command(0).unwrap();
    assert_eq!(again(&mut document).sha256(), document.state().sha256());
    (command, document.state().sha256())
}

fn heights(command: &serde_json::Value) -> Vec<f64> {
    let along = command["stroke"]["carve"]["along"].as_array().unwrap();
    along.iter().map(|p| p[2].as_f64().unwrap()).collect()
}

/// The harder it is pressed the deeper a ball goes, in one picture as in many; the switch below the strength turns that off.
#[test]
fn a_pen_that_is_pressed_harder_goes_deeper() {
    let (command, digest) = drawn(Kind::Carve, 24, |_| {});
    let by_pen = heights(&command);
    assert!(by_pen.len() > 8, "{by_pen:?}");
    assert!(by_pen.windows(2).all(|pair| pair[1] < pair[0]), "{by_pen:?}");
    for pictures in [1, 4] {
        assert_eq!(drawn(Kind::Carve, pictures, |_| {}).1, digest, "{pictures}");
    }
    // It is a pen, whatever a mouse would do.
    let by_speed = |window: &mut Harness<'_, Modeler>| window.state_mut().bench.by_speed = true;
    assert_eq!(drawn(Kind::Carve, 4, by_speed).1, digest);
    let off = |window: &mut Harness<'_, Modeler>| {
        window.get_by_label("Pen pressure").click();
        window.run_steps(2);
    };
    let flat = heights(&drawn(Kind::Carve, 4, off).0);
    let most = flat.iter().fold(0.0_f64, |most, z| most.max((z - flat[0]).abs()));
    // The surface is as flat as the fit of the block.
    assert!(most < 0.01, "{flat:?}");
}

/// Brushes have the presses in the journal, one a step.
#[test]
fn brushes_do_as_much_as_the_pen_is_pressed() {
    for (kind, tool) in [(Kind::Inflate, "inflate"), (Kind::Stiffen, "paint")] {
        let (command, _) = drawn(kind, 4, |_| {});
        let stroke = &command["stroke"];
        let presses = stroke["press"].as_array().unwrap();
        let places = match tool {
            "paint" => &stroke[tool]["brush"]["along"],
            _ => &stroke[tool]["along"],
        };
        assert_eq!(presses.len(), places.as_array().unwrap().len());
        let presses: Vec<f64> = presses.iter().map(|press| press.as_f64().unwrap()).collect();
        assert_eq!(presses[0], 0.1);
        assert!(
            presses.is_sorted() && presses[presses.len() - 1] > 0.9,
            "{presses:?}"
        );
    }
    // What takes hold goes where the pen goes.
    let (command, _) = drawn(Kind::Grab, 4, |_| {});
    assert_eq!(command["stroke"]["press"], serde_json::Value::Null);
}
