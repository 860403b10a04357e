//! A hand on a document, by a script.

use crate::common::Bench;

/// Down on the top of a ball of radius 1, a stroke along it, and up again; the force comes two seconds after arming.
const HAND: &str = r#"
[stroke.carve]
along = []
shape.sphere.radius = 0.06
tolerance = 0.01
[[target]]
time = 2.2
at = [0.0, 0.0, 1.2]
[[target]]
time = 2.8
at = [0.0, 0.0, 0.9]
[[target]]
time = 3.2
at = [-0.1, 0.0, 0.9]
buttons = 1
[[target]]
time = 3.8
at = [0.2, 0.0, 0.9]
[[target]]
time = 4.2
at = [0.2, 0.0, 1.3]
buttons = 0
"#;

fn ball() -> Bench {
    let bench = Bench::new();
    bench.json("phantom sphere -o cloud.ply --count 2000");
    bench.json("fit cloud.ply -o ball.iclay --max-depth 6");
    bench.write("hand.toml", HAND);
    bench
}

#[test]
fn a_session_by_a_hand_is_the_same_every_time_and_replays() {
    let bench = ball();
    let felt = |document: &str| {
        bench.json(&format!("new {document}.isoclay ball.iclay"));
        let told = bench.json(&format!(
            "feel {document}.isoclay --device sim:omni --script hand.toml -o {document}.csv"
        ));
        (
            told,
            std::fs::read_to_string(bench.path(&format!("{document}.csv"))).unwrap(),
        )
    };
    let (told, trace) = felt("one");
    let (same, again) = felt("two");
    assert_eq!(told["state_sha256"], same["state_sha256"]);
    assert!(trace == again, "the traces differ");
    let number = |key: &str| told[key].as_f64().unwrap_or_else(|| panic!("{key} in {told}"));
    assert_eq!(trace.lines().count() as f64, number("ticks") + 1.0);
    assert!(
        number("contact_share") > 0.1 && number("contact_share") < 0.6,
        "{told}"
    );
    assert!(
        number("largest_force_n") > 0.3 && number("largest_force_n") <= 3.3,
        "{told}"
    );
    assert!(number("largest_step_n") <= 0.2501, "{told}");
    assert_eq!((number("strokes"), number("done")), (1.0, 1.0), "{told}");
    assert!(told["tripped"].is_null(), "{told}");
    let replayed = bench.json("replay one.isoclay");
    assert_eq!(replayed["state_sha256"], told["state_sha256"]);
    assert!(bench.run("history one.isoclay --json").stdout.contains("by hand"));
}

#[test]
fn a_stiffness_that_the_device_cannot_hold_is_lowered_and_said() {
    let bench = ball();
    bench.json("new clay.isoclay ball.iclay");
    bench.write(
        "still.toml",
        "target = [{ time = 0, at = [0, 0, 1.3] }, { time = 1, at = [0, 0, 1.2] }]",
    );
    let told = bench.json("feel clay.isoclay --device sim:omni --script still.toml --stiffness 90000");
    let stiffness = told["stiffness_n_per_m"].as_f64().unwrap();
    assert!(stiffness < 90_000.0, "{told}");
    assert!(
        told["notes"].to_string().contains("90000 N/m was wished"),
        "{told}"
    );
    assert_eq!(told["done"].as_f64().unwrap(), 0.0);
}

#[test]
fn three_threads_by_the_clock_leave_a_journal_that_replays() {
    let bench = ball();
    bench.json("new clay.isoclay ball.iclay");
    let told = bench.json("feel clay.isoclay --device sim:omni --script hand.toml --real-time --contact vcp");
    assert_eq!(told["threads"]["torn"].as_f64().unwrap(), 0.0, "{told}");
    assert!(told["largest_step_n"].as_f64().unwrap() <= 0.2501, "{told}");
    let replayed = bench.json("replay clay.isoclay");
    assert_eq!(replayed["state_sha256"], told["state_sha256"]);
}

/// The threads with a device that is not simulated: a trajectory, since nothing is plugged in. Its button works as any other.
#[test]
fn a_session_by_a_trajectory_is_an_edit_like_any_other() {
    let bench = ball();
    bench.json("new clay.isoclay ball.iclay");
    bench.write(
        "stroke.toml",
        "[stroke.carve]\nalong = []\nshape.sphere.radius = 0.06\ntolerance = 0.01\n",
    );
    // In the device's room, of which the ball fills the width: down on its top, along it, and up again.
    bench.write(
        "way.txt",
        "0 0 0 120\n0.5 0 0 98\n0.6 0 0 98 1\n1.2 12 0 98 1\n1.3 12 0 98 0\n1.6 12 0 120 0\n",
    );
    let told = bench.json("feel clay.isoclay --device script:way.txt --script stroke.toml --seconds 3");
    assert_eq!(told["strokes"], 1, "{told}");
    assert!(told["threads"].is_object() && told["tripped"].is_null(), "{told}");
    let replayed = bench.json("replay clay.isoclay");
    assert_eq!(replayed["state_sha256"], told["state_sha256"]);
    let run = bench.run("feel clay.isoclay --device sim:omni --script stroke.toml");
    assert!(
        run.code == 3 && run.stderr.contains("[[target]]"),
        "{}",
        run.stderr
    );
    let run = bench.run("feel clay.isoclay --device script:nowhere.txt --script stroke.toml");
    assert!(
        run.code == 3 && run.stderr.contains("check the path"),
        "{}",
        run.stderr
    );
}

/// A plate that lies on the top of the ball, held off its middle: the torque is the arm times the force, and a ball has none.
#[test]
fn a_plate_pressed_beside_its_middle_returns_torque() {
    let bench = ball();
    bench.json("new clay.isoclay ball.iclay");
    bench.write(
        "press.toml",
        "target = [{ time = 0, at = [0.08, 0, 1.3], turn = [0, 90, 0] }, { time = 1, at = [0.08, 0, 1.2] }, \
         { time = 3, at = [0.08, 0, 0.97] }]",
    );
    let felt = |options: &str| {
        let told = bench.json(&format!(
            "feel clay.isoclay --device sim:omni --script press.toml -o trace.csv {options}"
        ));
        let trace = std::fs::read_to_string(bench.path("trace.csv")).unwrap();
        let names: Vec<String> = trace
            .lines()
            .next()
            .unwrap()
            .split(',')
            .map(String::from)
            .collect();
        let last: Vec<String> = trace
            .lines()
            .last()
            .unwrap()
            .split(',')
            .map(String::from)
            .collect();
        let of = move |name: &str| {
            let column = names.iter().position(|n| n == name).unwrap();
            last[column].parse::<f64>().unwrap()
        };
        (told, of)
    };
    let (told, last) = felt("--tool plate:20x30x1");
    let arm = last("proxy_x") / told["scale"].as_f64().unwrap();
    let torque = arm * last("wished");
    assert!(last("force_z") > 0.3 && torque > 1.0, "{told}");
    // The plate gives way a little: it then touches beside the top.
    assert!(
        (last("torque_y") / torque - 1.0).abs() < 0.08,
        "{} {torque}",
        last("torque_y")
    );
    assert!(
        told["largest_torque_nmm"].as_f64().unwrap() >= last("torque_y"),
        "{told}"
    );
    // That device gives none.
    assert_eq!(last("torque_sent"), 0.0);
    // Four points as wide, with nothing between them, do not touch a ball with a face: two of them straddle its top.
    bench.write("tool.xyz", "3 -10 -3\n3 10 -3\n3 -10 9\n3 10 9\n");
    let (told, last) = felt("--tool points:tool.xyz");
    assert!(
        last("force_z") > 0.1 && told["largest_torque_nmm"].as_f64().unwrap() > 0.1,
        "{told}"
    );
    let (told, last) = felt("");
    assert!(
        last("force_z") > 0.3 && told["largest_torque_nmm"] == 0.0,
        "{told}"
    );
    let run = bench
        .run("feel clay.isoclay --device sim:omni --script press.toml --tool knife:8x20x1 --contact vcp");
    assert!(run.code == 2 && run.stderr.contains("--tool"), "{}", run.stderr);
}
