//! `isoclay charts dynamics`: what it prints and draws.

use crate::common::{Bench, number};
use serde_json::Value;

const KEYS: [&str; 12] = [
    "coefficients",
    "samples",
    "contrast",
    "pattern",
    "dt_over_limit",
    "iterations",
    "preconditioner",
    "law",
    "integrator",
    "precision",
    "increment_error",
    "step_seconds",
];

#[test]
fn lines_have_all_figures_and_show_what_the_default_gains_over_plain_iterations() {
    let bench = Bench::new();
    let run = bench.run("charts dynamics --quick --json -o charts");
    assert_eq!(run.code, 0, "{}", run.stderr);
    let lines: Vec<Value> = run
        .stdout
        .lines()
        .map(|l| serde_json::from_str(l).unwrap())
        .collect();
    for line in &lines {
        let object = line.as_object().unwrap();
        assert!(KEYS.iter().all(|k| object.contains_key(*k)), "{line}");
        assert_eq!(object.len(), 12 + usize::from(line["default"] == true), "{line}");
        assert!(
            number(line, "step_seconds") > 0.0 && number(line, "increment_error") >= 0.0,
            "{line}"
        );
    }
    // What is demanded of the default step: small patches ≤ 0.1 %, uniform ones ≤ 1e-5, within 8 iterations.
    let default: Vec<&Value> = lines.iter().filter(|l| l["default"] == true).collect();
    assert!(default.len() > 5);
    for line in default {
        let bound = if line["pattern"] == "uniform" { 1e-5 } else { 1e-3 };
        assert!(number(line, "increment_error") <= bound, "{line}");
        assert!(number(line, "iterations") <= 8.0, "{line}");
        assert_eq!(line["law"], "linear", "{line}");
    }
    // Two plain iterations, as the source paper has them, do not get there.
    let plain =
        |l: &&Value| l["preconditioner"] == "none" && l["iterations"] == 2 && number(l, "contrast") >= 100.0;
    let mut paper = lines.iter().filter(plain).peekable();
    assert!(paper.peek().is_some());
    assert!(paper.all(|l| number(l, "increment_error") > 0.1));
    for name in [
        "table2",
        "materials",
        "steps",
        "solvers-100",
        "anisotropy",
        "cost",
    ] {
        let svg = std::fs::read_to_string(bench.path(&format!("charts/dynamics-{name}.svg"))).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("<circle"), "{name}");
    }
}

#[test]
fn masks_are_solved_by_every_way_and_best_by_the_default() {
    let bench = Bench::new();
    let run = bench.run("charts masks --quick --json -o charts");
    assert_eq!(run.code, 0, "{}", run.stderr);
    let lines = run.stdout.lines().map(|l| serde_json::from_str(l).unwrap());
    let lines: Vec<Value> = lines.collect();
    // Four masks, four ways.
    assert_eq!(lines.len(), 16);
    for line in &lines {
        let cycle = line["way"] == "tensor V-cycle of the box";
        let bound = if cycle { 1e-2 } else { 1e-5 };
        assert!(
            number(line, "increment_error") < bound && number(line, "step_ms") > 0.0,
            "{line}"
        );
        assert!(
            line["converged"] == true && number(line, "moving") > 100.0,
            "{line}"
        );
    }
    assert_eq!(lines.iter().filter(|l| l["default"] == true).count(), 4);
    for name in ["error", "step", "setup"] {
        let svg = std::fs::read_to_string(bench.path(&format!("charts/masks-{name}.svg"))).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("<circle"), "{name}");
    }
}

const TOOL_KEYS: [&str; 12] = [
    "tool",
    "paths",
    "drag_over_r",
    "sampling_factor",
    "law",
    "arrival",
    "overshoot",
    "steps_to_99",
    "profile_error",
    "loop_ms",
    "printed_ms",
    "default",
];

#[test]
fn tools_arrive_by_default_whatever_the_sampling_and_the_number_of_paths() {
    let bench = Bench::new();
    let run = bench.run("charts tools --quick --json -o charts");
    assert_eq!(run.code, 0, "{}", run.stderr);
    let lines = run.stdout.lines().map(|l| serde_json::from_str(l).unwrap());
    let lines: Vec<Value> = lines.collect();
    for line in &lines {
        let object = line.as_object().unwrap();
        assert!(TOOL_KEYS.iter().all(|k| object.contains_key(*k)), "{line}");
        assert!(number(line, "loop_ms") > 0.0, "{line}");
    }
    let named = |name: &str| -> Vec<&Value> {
        let is = |l: &&Value| l["tool"].as_str().unwrap().starts_with(name);
        lines.iter().filter(is).collect()
    };
    // The rule is as exact as it is asked to be.
    let integrals = named("integral");
    let default = integrals.iter().filter(|l| l["default"] == true);
    assert_eq!(default.clone().count(), 4);
    assert!({ default }.all(|l| number(l, "profile_error") < 2e-4));
    assert!(integrals.iter().any(|l| number(l, "profile_error") > 1e-3));
    // Clay that has to arrive does, however finely it is sampled and by however many paths it is held.
    let strokes = lines
        .iter()
        .filter(|l| !l["arrival"].is_null() && l["printed_ms"].is_null());
    let (mut arrived, mut raw) = (0, 0);
    for line in strokes {
        let (arrival, error) = (number(line, "arrival"), number(line, "profile_error"));
        match line["law"].as_str().unwrap() {
            "clay, arrive" => {
                arrived += 1;
                // Seven paths are farther apart than half a radius: the ridge is right on its curve and ends more steeply.
                let limits = if line["paths"] == 7 {
                    [0.015, 0.11]
                } else {
                    [0.01, 0.02]
                };
                assert!((arrival - 1.0).abs() < limits[0] && error < limits[1], "{line}");
                assert!(
                    number(line, "overshoot") < 0.015 && number(line, "steps_to_99") <= 15.0,
                    "{line}"
                );
            }
            "elastic, arrive" => assert!((arrival - 0.8).abs() < 0.02 && error < 0.03, "{line}"),
            law if law.contains("raw") => {
                raw += 1;
                assert!(arrival < 0.9, "{line}");
            }
            _ => (),
        }
    }
    assert_eq!((arrived, raw), (4, 4));
    let table = named("point, table 2");
    assert_eq!(table.len(), 6);
    for line in table {
        assert!(number(line, "printed_ms") > 0.0, "{line}");
        assert!((number(line, "arrival") - 1.0).abs() < 0.01, "{line}");
    }
    // Three tools that pull and one that carves, of two sizes.
    let brushes = lines
        .iter()
        .filter(|l| l["tool"].as_str().unwrap().contains("radius"));
    assert_eq!(brushes.count(), 8);
    for name in ["quadrature", "sampling", "paths", "paths-cost", "brush", "table2"] {
        let svg = std::fs::read_to_string(bench.path(&format!("charts/tools-{name}.svg"))).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("<circle"), "{name}");
    }
}
