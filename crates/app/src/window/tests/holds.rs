//! Boxes whose surface force tools leave where it is.

use bspline::Aabb;
use egui::Pos2;

use super::*;

fn places(sheet: &Sheet) -> Vec<DVec3> {
    let held = &sheet.objects[0].holds[0];
    assert!(held.lines.iter().all(|line| line.len() == 1));
    held.lines.iter().map(|line| line[0].0).collect()
}

/// How far the density moved at most by the last edit, at some places.
fn moved(document: &mut Document, places: &[DVec3]) -> f64 {
    let value = |state: &State, p: DVec3| state.objects()["clay"].field.as_field().value(p);
    let after = document.state().clone();
    document.undo(1).unwrap();
    let before = document.state().clone();
    let far = places
        .iter()
        .map(|p| (value(&after, *p) - value(&before, *p)).abs());
    far.fold(0.0, f64::max)
}

/// A click holds the surface in a box as large as the tool: a ridge right beside it leaves it alone until it is freed. All is as a script has it.
#[test]
fn a_click_holds_a_box_and_the_panel_frees_it() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = with_clay(window_of(home.path(), TALL));
    let at = middle(&window);
    press(&mut window, "Pin box");
    assert_eq!(window.state().bench().tool.kind, Kind::PinBox);
    click(&mut window, at);
    let sheet = edits(&mut window, 1);
    assert_eq!(sheet.history[0], "hold on clay");
    assert_eq!(sheet.objects[0].holds[0].name, "box 1");
    let held = places(&sheet);
    let radius = window.state().bench().tool_in_hand(egui::Modifiers::NONE).radius;
    let whole = Aabb::about(held.iter().copied()).unwrap();
    let wide = whole.size().max_element();
    assert!(wide > 1.5 * radius && wide < 2.001 * radius, "{wide} of {radius}");
    assert!(held.len() > 60, "{}", held.len());
    window.run_steps(3);
    assert!(window.query_by_label("box 1").is_some());
    let reach = window.state().pixels_of(window.state().drawn_in, radius);
    let ridge: Vec<Pos2> = (-6..=6)
        .map(|n| at + egui::vec2(1.3 * reach, 0.15 * n as f32 * reach))
        .collect();
    let ridged = |window: &mut Window, count: usize| {
        window.state_mut().bench.take(Kind::Crest);
        window.run_steps(2);
        draw(window, &ridge);
        edits(window, count)
    };
    let sheet = ridged(&mut window, 2);
    let mut document = on_disk(&sheet, scratch.path());
    let lines: Vec<serde_json::Value> = (0..2)
        .map(|n| document.command(n).unwrap()["stroke"].clone())
        .collect();
    assert!(lines[0]["hold"]["points"].is_array(), "{}", lines[0]);
    assert_is_script(&sheet, scratch.path(), &lines);
    let along: Vec<[f64; 3]> = serde_json::from_value(lines[1]["pull"]["along"].clone()).unwrap();
    let middle = DVec3::from_array(along[along.len() / 2]);
    let lifted = moved(&mut on_disk(&sheet, scratch.path()), &[middle]);
    let left = moved(&mut document, &held);
    choose(&mut window, "Edit", "Undo");
    until(&mut window, "undone", |sheet| sheet.done == 1);
    window.run_steps(3);
    press(&mut window, "Free");
    let sheet = until(&mut window, "freed", |sheet| sheet.objects[0].holds.is_empty());
    assert_eq!(sheet.done, 2);
    let sheet = ridged(&mut window, 3);
    let freed = moved(&mut on_disk(&sheet, scratch.path()), &held);
    assert!(
        freed > 0.1 && left < 0.01 * freed && lifted > 100.0 * left,
        "{lifted} {left} {freed}"
    );
}

/// A box whose corners are typed is held, and bounds strokes no more; one without a surface is told of, and stays.
#[test]
fn a_box_that_is_typed_is_held() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = with_clay(window_of(home.path(), TALL));
    press(&mut window, "Where it acts");
    press(&mut window, "Add a box");
    // The first box is round all of the block; this one is within.
    let corners = |window: &mut Window, all: [[f64; 3]; 2]| {
        for (corner, numbers) in ["from", "to"].into_iter().zip(all) {
            for (axis, number) in numbers.into_iter().enumerate() {
                set(window, (corner, axis), &number.to_string());
            }
        }
    };
    corners(&mut window, [[-4.0, -3.0, -4.0], [4.0, 3.0, 4.0]]);
    press(&mut window, "Pin");
    let last = window.state().bench().messages.back().cloned();
    assert!(last.is_some_and(|(_, text, is_failure)| is_failure && text.contains("no surface")));
    assert_eq!(window.state().bench().limits.boxes.len(), 1);
    corners(&mut window, [[-4.0, -3.0, 16.0], [4.0, 3.0, 24.0]]);
    press(&mut window, "Pin");
    let sheet = edits(&mut window, 1);
    assert!(window.state().bench().limits.boxes.is_empty());
    let whole = Aabb::about(places(&sheet)).unwrap();
    let (low, high) = (DVec3::new(-4.0, -3.0, 16.0), DVec3::new(4.0, 3.0, 24.0));
    assert!(
        whole.min.cmpge(low).all() && whole.max.cmple(high).all(),
        "{whole:?}"
    );
    assert!(whole.size().x > 7.0 && whole.size().y > 5.0, "{whole:?}");
    let command = on_disk(&sheet, scratch.path()).command(0).unwrap();
    assert_is_script(&sheet, scratch.path(), &[command["stroke"].clone()]);
}
