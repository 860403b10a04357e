//! Where strokes act: what is drawn or typed bounds them as a script does.

use egui::Pos2;
use glam::DVec3;

use super::*;

/// The only stroke of a document: its command, and where on the front its way begins and ends.
fn stroke(document: &mut Document) -> (serde_json::Value, [DVec3; 2]) {
    let command = document.command(0).unwrap();
    let way = &command["stroke"]["carve"]["along"];
    let places: Vec<[f64; 3]> =
        serde_json::from_value(way.clone()).unwrap_or_else(|why| panic!("{why}: {command}"));
    // The tool is above the surface, which is at 20 mm.
    let below = |[x, y, _]: [f64; 3]| DVec3::new(x, y, 20.0);
    let ends = [places[0], places[places.len() - 1]].map(below);
    (command, ends)
}

/// How far the density at a place has changed.
fn change(document: &mut Document, p: DVec3) -> f64 {
    let value = |state: &State| state.objects()["clay"].field.as_field().value(p);
    let first = value(&document.first_state().unwrap());
    (value(document.state()) - first).abs()
}

/// A stroke over the middle begins within a lasso round its left half, and leaves the right half as it was; with Ctrl it is
/// the other way round.
#[test]
fn a_lasso_of_the_mouse_bounds_strokes() {
    let scratch = tempfile::tempdir().unwrap();
    for keeps in [false, true] {
        let home = tempfile::tempdir().unwrap();
        let mut window = window_with_clay(home.path());
        let at = middle(&window);
        window.key_press(egui::Key::K);
        window.step();
        let ring: Vec<Pos2> = (0..=16)
            .map(|n| {
                at - egui::vec2(40.0, 0.0)
                    + 40.0 * egui::Vec2::angled(n as f32 * std::f32::consts::TAU / 16.0)
            })
            .collect();
        if keeps {
            window.event(egui::Event::ModifiersChanged(egui::Modifiers::COMMAND));
        }
        draw(&mut window, &ring);
        window.event(egui::Event::ModifiersChanged(egui::Modifiers::NONE));
        window.run_steps(2);
        assert!(window.state().bench().limits.lasso.is_some());
        assert_eq!(window.state().bench().limits.keeps, keeps);
        assert!(window.state().bench().sheet.as_ref().unwrap().history.is_empty());
        window.key_press(egui::Key::C);
        window.step();
        let way: Vec<Pos2> = (0..15)
            .map(|n| at + egui::vec2(10.0 * n as f32 - 40.0, 0.0))
            .collect();
        draw(&mut window, &way);
        let sheet = edits(&mut window, 1);
        let mut document = on_disk(&sheet, scratch.path());
        let (command, [within, outside]) = stroke(&mut document);
        let mask = &command["stroke"]["mask"];
        assert!(mask["formula"].is_string(), "{command}");
        assert_eq!(mask["outside"].as_bool().unwrap_or(false), keeps, "{command}");
        let [within, outside] = [within, outside].map(|p| change(&mut document, p));
        let (changed, left) = if keeps {
            (outside, within)
        } else {
            (within, outside)
        };
        assert!(changed > 0.1 && left < 1e-6, "{within} {outside}");
        assert_is_script(&sheet, scratch.path(), &[command["stroke"].clone()]);
    }
}

/// A box whose corners are typed, its soft border, and the box taken away again.
#[test]
fn a_box_that_is_typed_bounds_strokes() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = with_clay(window_of(home.path(), TALL));
    drag(&mut window);
    let (_, [from, to]) = stroke(&mut on_disk(&edits(&mut window, 1), scratch.path()));
    choose(&mut window, "Edit", "Undo");
    until(&mut window, "undone", |sheet| sheet.done == 0);
    press(&mut window, "Where it acts");
    press(&mut window, "Add a box");
    let border = (50.0 * (from.x + to.x)).round() / 100.0;
    for (corner, numbers) in [("from", [-30.0; 3]), ("to", [border, 30.0, 30.0])] {
        for (axis, number) in numbers.into_iter().enumerate() {
            set(&mut window, (corner, axis), &number.to_string());
        }
    }
    press(&mut window, "Spare what is inside");
    drag(&mut window);
    let sheet = until(&mut window, "edited again", |sheet| sheet.done == 1);
    let mut document = on_disk(&sheet, scratch.path());
    let (command, ends) = stroke(&mut document);
    let mask = serde_json::json!({
        "boxes": [{ "min": [-30.0, -30.0, -30.0], "max": [border, 30.0, 30.0] }], "outside": true,
    });
    assert_eq!(command["stroke"]["mask"], mask);
    let [spared, changed] = ends.map(|p| change(&mut document, p));
    assert!(spared < 1e-6 && changed > 0.1, "{spared} {changed}");
    assert_is_script(&sheet, scratch.path(), &[command["stroke"].clone()]);
    press(&mut window, "None");
    drag(&mut window);
    let sheet = edits(&mut window, 2);
    let second = on_disk(&sheet, scratch.path()).command(1).unwrap();
    assert!(second["stroke"]["mask"].is_null(), "{second}");
}
