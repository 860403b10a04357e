//! Planes through the chosen object, and the densities along a line in one.

use super::*;

fn with_planes(home: &Path) -> Window {
    let mut window = window_with_clay(home);
    command(&mut window, "slices");
    window.run_steps(3);
    window
}

/// Where the picture of a plane is: below the name of it, as wide as the window of slices has it.
fn below(window: &Window, plane: &str) -> egui::Rect {
    let name = window.get_by_label(plane).rect();
    egui::Rect::from_min_size(
        name.left_bottom() + egui::vec2(0.0, 8.0),
        egui::vec2(200.0, 200.0),
    )
}

/// A line that is drawn in a plane has the densities of the field under it, and those of the field after an edit.
#[test]
fn a_line_in_a_plane_has_the_densities_under_it() {
    let home = tempfile::tempdir().unwrap();
    let mut window = with_planes(home.path());
    window.get_by_label("Profile").click();
    window.run_steps(2);
    let picture = below(&window, "Axial");
    let y = picture.center().y;
    let way: Vec<egui::Pos2> = (0..9)
        .map(|n| egui::pos2(picture.left() + 5.0 + 22.0 * n as f32, y))
        .collect();
    draw(&mut window, &way);
    window.run_steps(2);
    let is_as_the_field = |window: &Window| {
        let bench = window.state().bench();
        let line = bench.slices.as_ref().unwrap().line().unwrap();
        let field = bench.sheet.as_ref().unwrap().objects[0].field.clone();
        let last = (line.values.len() - 1) as f64;
        let place = |n: usize| line.ends[0].lerp(line.ends[1], n as f64 / last);
        let all = line.values.iter().enumerate();
        all.into_iter().all(|(n, value)| *value == field.value(place(n)))
    };
    let bench = window.state().bench();
    let line = bench.slices.as_ref().unwrap().line().unwrap();
    let [from, to] = line.ends;
    // Along x, through the block from side to side.
    assert!(
        line.axis == 2 && from.z == to.z && (from.y - to.y).abs() < 1e-9,
        "{from} {to}"
    );
    assert!(from.x < -20.0 && to.x > 15.0, "{from} {to}");
    assert!(line.values[0] < 0.0 && line.values[line.values.len() / 2] > 0.0);
    let before = line.values.clone();
    assert!(is_as_the_field(&window));
    assert!(bench.sheet.as_ref().unwrap().history.is_empty());

    let carve = serde_json::json!({ "carve": { "shape": { "sphere": { "radius": 6.0 } }, "along": [[0, from.y, from.z]] } });
    bench.stroke(carve);
    edits(&mut window, 1);
    window.run_steps(2);
    assert!(is_as_the_field(&window));
    let after = &window
        .state()
        .bench()
        .slices
        .as_ref()
        .unwrap()
        .line()
        .unwrap()
        .values;
    assert_ne!(*after, before);
    window.get_by_label("Clear").click();
    window.run_steps(2);
    assert!(window.state().bench().slices.as_ref().unwrap().line().is_none());
}

/// In four views the scene is worked on as alone: where its quarter shows the block, a drag is a stroke; in a plane it moves the cursor.
#[test]
fn the_scene_among_four_views_is_worked_on() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = with_planes(home.path());
    window.get_by_label("Four views").click();
    window.run_steps(3);
    let [set, plane] = ["Four views", "Axial"].map(|label| window.get_by_label(label).rect());
    assert!(set.max.y <= plane.min.y, "{set} lies over {plane}");
    // The middle of the lower right quarter, between the panels.
    let at = egui::pos2(850.0, 590.0);
    let way: Vec<egui::Pos2> = (0..8).map(|n| at + egui::vec2(4.0 * n as f32, 0.0)).collect();
    draw(&mut window, &way);
    let sheet = edits(&mut window, 1);
    let mut document = on_disk(&sheet, scratch.path());
    let stroke = document.command(0).unwrap()["stroke"].clone();
    let first: [f64; 3] = serde_json::from_value(stroke["carve"]["along"][0].clone()).unwrap();
    assert!(DVec3::from_array(first).length() < 30.0, "{stroke}");
    assert_is_script(&sheet, scratch.path(), &[stroke]);
    let cursor = |window: &Window| {
        let bench = window.state().bench();
        let thing = &bench.sheet.as_ref().unwrap().objects[0];
        bench.slices.as_ref().unwrap().cursor(thing)
    };
    let before = cursor(&window);
    let at = below(&window, "Sagittal").center() + egui::vec2(10.0, -30.0);
    click(&mut window, at);
    let after = cursor(&window);
    assert!(
        after.x == before.x && after.y != before.y && after.z != before.z,
        "{before} {after}"
    );
    assert_eq!(edits(&mut window, 1).done, 1);
}
