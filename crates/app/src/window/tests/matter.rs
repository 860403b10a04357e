//! What objects are made of, and how scenes are set.

use serde_json::json;

use super::*;

/// Paint all over by the panel, and the matter, are strokes of a script.
#[test]
fn the_panel_of_material_paints_as_a_script_does() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = with_clay(window_of(home.path(), TALL));
    press(&mut window, "Material");
    set(&mut window, ("Value", 0), "3");
    press(&mut window, "Lay on");
    edits(&mut window, 1);
    window.run_steps(3);
    assert!(window.query_by_label("Stiffness is painted").is_some());
    window.get_by_label("All over").click();
    window.run_steps(3);
    press(&mut window, "Friction");
    set(&mut window, ("Value", 0), "0.5");
    press(&mut window, "Lay on");
    edits(&mut window, 2);
    press(&mut window, "Elastic");
    let sheet = edits(&mut window, 3);
    let strokes = [
        json!({ "paint": { "layer": "stiffness", "formula": "3" } }),
        json!({ "paint": { "layer": "friction", "formula": "0.5" } }),
        json!({ "material": { "solid": "elastic" } }),
    ];
    assert_is_script(&sheet, scratch.path(), &strokes);
}

/// Numbers typed into the panel of simulation are those of the scene that is played, and the scene is that of `sculpt`.
#[test]
fn numbers_of_the_simulation_are_those_of_its_scene() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = with_clay(window_of(home.path(), TALL));
    let sheet = edits(&mut window, 0);
    let document = scratch.path().join("other.isoclay");
    std::fs::copy(&sheet.path, &document).unwrap();
    command(&mut window, "simulation");
    let typed = [
        ("Moves", "0.5"),
        ("Rest length", "1.2"),
        ("Damping", "2"),
        ("Time", "0.1"),
        ("Step", "0.05"),
    ];
    for (name, number) in typed {
        set(&mut window, (name, 0), number);
    }
    press(&mut window, "Play");
    let sheet = edits(&mut window, 1);
    let played = on_disk(&sheet, scratch.path());
    let text = r#"
field = "object.iclay"
[region]
min = [-MIN, -MIN, -MIN]
max = [MIN, MIN, MIN]
level = 0
[material]
mass = 1
stiffness = 1
damping = 2
ground = 0
rest-scale = 1.2
[law]
kind = "linear"
[time]
duration = 0.1
step = 0.05
integrator = "tr-bdf2"
[plasticity]
rate = 2
[release]
as = "clay"
"#;
    let half = 0.25 * sheet.objects[0].own_box.size().x;
    let script = scratch.path().join("scene.toml");
    std::fs::write(&script, text.replace("MIN", &format!("{half:?}"))).unwrap();
    command_line("sculpt", &[&document, &"--script", &script]);
    assert_eq!(played.state().sha256(), opened(&document).state().sha256());
}
