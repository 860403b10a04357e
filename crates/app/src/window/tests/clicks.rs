//! Tools that a click uses.

use serde_json::json;

use super::*;

/// A tool that is taken by the command palette, and used by a click there; the stroke that it became, as the journal has it.
fn used(window: &mut Window, scratch: &Path, tool: &str, at: egui::Pos2, count: usize) -> serde_json::Value {
    command(window, tool);
    window.hover_at(at);
    window.run_steps(5);
    // What it would leave is shown, and is no edit.
    assert_eq!(
        window.state().bench().sheet.as_ref().unwrap().history.len(),
        count - 1
    );
    click(window, at);
    let sheet = edits(window, count);
    let mut document = on_disk(&sheet, scratch);
    document.command(count - 1).unwrap()["stroke"].clone()
}

/// Where a stroke names a place, and where the solid is under the mouse.
fn is_on_the_front(at: &serde_json::Value) {
    let [_, _, z]: [f64; 3] = serde_json::from_value(at.clone()).unwrap();
    // The block is 40 mm high.
    assert!((z - 20.0).abs() < 0.1, "{at}");
}

#[test]
fn clicks_stamp_whirl_cut_and_paste_as_a_script_does() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    let at = middle(&window);
    let radius = {
        let bench = window.state().bench();
        bench.tool.radius * bench.scene.1
    };
    let mut script = Vec::new();
    let mut is_so_far = |window: &mut Window, stroke: &serde_json::Value| {
        script.push(stroke.clone());
        let sheet = edits(window, script.len());
        assert_is_script(&sheet, scratch.path(), &script);
        sheet
    };

    let stamp = used(&mut window, scratch.path(), "stamp", at, 1);
    // With half the strength its middle is on the surface.
    is_on_the_front(&stamp["add"]["along"][0]);
    assert!(stamp["add"]["shape"].is_object(), "{stamp}");
    is_so_far(&mut window, &stamp);

    // On the ball, beside its top: a flat face that is turned about its normal stays as it is.
    let whirl = used(
        &mut window,
        scratch.path(),
        "whirl",
        at + egui::vec2(14.0, 0.0),
        2,
    );
    let twist = &whirl["move"]["motion"]["twist"];
    let [_, _, z]: [f64; 3] = serde_json::from_value(twist["at"].clone()).unwrap();
    assert!(z > 20.0 && z < 20.0 + radius + 0.1, "{whirl}");
    assert!(
        (twist["radius"].as_f64().unwrap() - radius).abs() < 1e-9,
        "{whirl}"
    );
    is_so_far(&mut window, &whirl);

    // With the ball that is on it: what is as flat as the rest would change nothing where it is pasted.
    let cut = used(&mut window, scratch.path(), "cut out", at, 3);
    assert_eq!(cut["cut"]["to"], "part 1");
    let [min, max] = ["min", "max"].map(|end| cut["cut"]["region"][end].clone());
    let [min, max] = [min, max].map(|p| serde_json::from_value::<[f64; 3]>(p).unwrap());
    assert!(
        (0..3).all(|n| (max[n] - min[n] - 2.0 * radius).abs() < 1e-9),
        "{cut}"
    );
    let sheet = is_so_far(&mut window, &cut);
    assert_eq!(sheet.objects.len(), 2);
    assert!(window.state().bench().hidden.contains("part 1"));

    let paste = used(
        &mut window,
        scratch.path(),
        "paste",
        at + egui::vec2(0.0, 60.0),
        4,
    );
    assert_eq!(paste["paste"]["from"], "part 1");
    assert_eq!(paste["paste"]["region"], json!({ "min": min, "max": max }));
    is_so_far(&mut window, &paste);
}

/// A click of the tool Copy is no edit; what it took can be pasted as often as one likes.
#[test]
fn what_is_copied_is_pasted_twice() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = window_with_clay(home.path());
    let at = middle(&window);
    // A groove: what is as flat as the rest would change nothing where it is pasted.
    drag(&mut window);
    let groove = on_disk(&edits(&mut window, 1), scratch.path())
        .command(0)
        .unwrap()["stroke"]
        .clone();
    command(&mut window, "copy");
    assert_eq!(window.state().bench().tool.kind, Kind::Copy);
    click(&mut window, at);
    steps_until(&mut window, "copied", |window| {
        let last = window.state().bench().messages.back();
        last.is_some_and(|(_, text, _)| text.contains("copied"))
    });
    let mut script = vec![groove];
    for n in [2, 3] {
        let over = at + egui::vec2(60.0 * n as f32 - 90.0, 60.0);
        let paste = used(&mut window, scratch.path(), "paste", over, n);
        assert_eq!(paste["paste"]["from"], "clay");
        script.push(paste);
    }
    let sheet = edits(&mut window, 3);
    assert_is_script(&sheet, scratch.path(), &script);
}
