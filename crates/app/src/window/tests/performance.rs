//! What the work costs, as it is told.

use tools::scene::{Scene, Simulation};

use super::*;
use crate::cli::quantity::{human_bytes, human_count, human_number};

/// What is told of a scene is what its last step did, and of the fields what they hold; it is no edit.
#[test]
fn figures_are_those_of_the_last_step_and_of_the_fields() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    command(&mut window, "performance");
    window.run_steps(3);
    for told in ["none was played", "none lately", "none in the hand"] {
        assert!(window.query_by_label(told).is_some(), "{told}");
    }
    let sheet = edits(&mut window, 0);
    let levels = sheet.objects[0].object.field.levels().unwrap();
    let bytes = 4 * levels.coefficient_count() + levels.totals_bytes();
    let fields = format!(
        "{} coefficients, {}",
        human_count(levels.coefficient_count()),
        human_bytes(bytes as u64)
    );
    assert!(window.query_by_label(&fields).is_some(), "{fields}");

    let script = {
        let bench = window.state().bench();
        let still = bench.simulation.script(bench.chosen().unwrap());
        still.replace("rest-scale = 1.0", "rest-scale = 1.1")
    };
    let scene: Scene = toml::from_str(&script).unwrap();
    let thing = &sheet.objects[0];
    let layers = &thing.object.layers;
    let mut simulation = Simulation::new(&scene, levels.clone(), thing.object.iso(), layers).unwrap();
    let mut last = simulation.step().unwrap();
    while !simulation.is_over() {
        last = simulation.step().unwrap();
    }
    window
        .state()
        .bench()
        .order(Order::Command(Box::new(Command::Scene {
            script,
            object: thing.name.clone(),
        })));
    edits(&mut window, 1);
    window.run_steps(3);
    let told = match last.awake {
        true => format!(
            "{} iterations, residual {:.1e}, {} samples awake at {} s",
            last.iterations,
            last.residual,
            human_count(last.awake_samples),
            human_number(last.time)
        ),
        false => format!("asleep at {} s", human_number(last.time)),
    };
    assert!(window.query_by_label(&told).is_some(), "{told}");
    // A stroke is a step or more.
    drag(&mut window);
    edits(&mut window, 2);
    window.run_steps(2);
    assert!(window.query_by_label_contains("ms a step").is_some());
}
