//! Scripted scenes, as a user runs them.

use crate::common::{Bench, data, number};
use serde_json::Value;

/// A ball of radius 1, fitted, and a scene that pulls at it.
struct Ball(Bench);

const SCENE: &str = r#"
field = "ball.iclay"
[region]
min = [-0.5, -0.5, 0.1]
max = [0.5, 0.5, 1.14]
level = 0
[material]
mass = 0.05
damping = 1.0
[[pull]]
at = [0.0, 0.0, 1.0]
radius = 0.12
strength = 0.4
[time]
duration = 1.0
step = 0.05
"#;

impl Ball {
    fn new() -> Self {
        let bench = Bench::new();
        bench.json("phantom sphere -o ball.ply --count 4000");
        bench.json("fit ball.ply -o ball.iclay --max-depth 6");
        Self(bench)
    }

    /// Runs a scene; the objects of its steps and the last one.
    fn play(&self, scene: &str, options: &str) -> (Vec<Value>, Value) {
        self.0.write("scene.toml", scene);
        let run = self
            .0
            .run(&format!("simulate scene.toml -o moved.iclay --json {options}"));
        assert_eq!(run.code, 0, "{}", run.stderr);
        let mut lines: Vec<Value> = run
            .stdout
            .lines()
            .map(|l| serde_json::from_str(l).unwrap())
            .collect();
        let last = lines.pop().unwrap();
        (lines, last)
    }

    /// Densities of a field at points.
    fn values(&self, field: &str, points: &[[f64; 3]]) -> Vec<f64> {
        let text: Vec<String> = points.iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
        self.0.write("points.xyz", text.concat());
        let run = self.0.run(&format!("eval {field} --points points.xyz"));
        assert_eq!(run.code, 0, "{}", run.stderr);
        let column = |l: &str| l.split(',').nth(3).unwrap().parse().unwrap();
        run.stdout.lines().skip(1).map(column).collect()
    }
}

/// Well beside the region of [`SCENE`] and on its border.
const OUTSIDE: [[f64; 3]; 4] = [
    [0.0, 0.0, -1.0],
    [0.9, 0.3, 0.2],
    [-0.7, -0.7, 0.1],
    [0.0, 1.0, 0.0],
];

#[test]
fn a_pull_moves_the_surface_towards_it_and_nothing_beside_the_region() {
    let ball = Ball::new();
    let (steps, last) = ball.play(SCENE, "--mesh moved.ply");
    assert_eq!(steps.len(), 20);
    assert!(
        steps
            .iter()
            .all(|s| s["awake"] == true && number(s, "iterations") <= 8.0)
    );
    assert!((number(&steps[19], "time") - 1.0).abs() < 1e-12);
    let tip = [[0.0, 0.0, 1.0], [0.0, 0.0, 1.02]];
    assert!(ball.values("ball.iclay", &tip)[0].abs() < 1e-4);
    // The surface has passed 1.02.
    assert!(ball.values("moved.iclay", &tip)[1] > 0.0);
    assert_eq!(
        ball.values("ball.iclay", &OUTSIDE),
        ball.values("moved.iclay", &OUTSIDE)
    );
    let mesh = crate::common::read_mesh(&ball.0.path("moved.ply"));
    let highest = mesh.positions.iter().map(|p| p.z).fold(0.0, f64::max);
    let lowest = mesh.positions.iter().map(|p| p.z).fold(0.0, f64::min);
    assert!(
        highest > 1.02 && (lowest + 1.0).abs() < 1e-3,
        "{highest} {lowest}"
    );
    // What is not damped is left: damping only takes.
    let (energy, work) = (
        number(&steps[19], "kinetic") + number(&steps[19], "potential"),
        number(&steps[19], "work"),
    );
    assert!(
        energy > 0.0 && energy <= work * (1.0 + 1e-5),
        "{energy} of {work}"
    );
    assert_eq!(number(&last, "work"), work);
    assert_eq!(
        ball.0.json("info moved.iclay")["unit"],
        ball.0.json("info ball.iclay")["unit"]
    );
}

#[test]
fn only_the_inside_of_a_mask_moves() {
    let ball = Ball::new();
    let masks = [
        "inside = \"x - 0.04\"",
        "boxes = [{ min = [0.04, -1, 0], max = [0.3, 1, 2] }, { min = [0.2, -1, 0], max = [1, 1, 2] }]",
        "inside = \"min(x - 0.04, 0.3 - abs(d))\"\nrim = \"free\"",
    ];
    let held = [[-0.1, 0.0, 1.0], [-0.3, 0.1, 0.9], [-0.1, 0.2, 0.8]];
    for mask in masks {
        let scene = SCENE.replace("level = 0", &format!("level = 0\n[region.mask]\n{mask}"));
        let (_, last) = ball.play(&scene, "");
        assert!(number(&last, "max_change") > 0.0, "{mask}");
        let of_both = |points: &[[f64; 3]]| {
            [
                ball.values("ball.iclay", points),
                ball.values("moved.iclay", points),
            ]
        };
        let [before, after] = of_both(&OUTSIDE);
        assert_eq!(before, after, "{mask}");
        // A free border lets functions move that reach over it.
        if !mask.contains("free") {
            let [before, after] = of_both(&held);
            assert_eq!(before, after, "{mask}");
        }
        let [before, after] = of_both(&[[0.25, 0.0, 0.97]]);
        assert_ne!(before, after, "{mask}");
        let hash = last["field_sha256"].clone();
        assert_eq!(ball.play(&scene, "--threads 1").1["field_sha256"], hash, "{mask}");
    }
}

#[test]
fn a_pushed_ball_is_dented() {
    let ball = Ball::new();
    ball.play(&SCENE.replace("strength = 0.4", "strength = -0.4"), "");
    assert!(ball.values("moved.iclay", &[[0.0, 0.0, 0.98]])[0] < 0.0);
}

#[test]
fn twice_the_force_moves_twice_as_far_and_twice_the_stiffness_half() {
    let ball = Ball::new();
    // Held until it rests: the static deflection of the linear law.
    let long = SCENE
        .replace("duration = 1.0", "duration = 20.0")
        .replace("step = 0.05", "step = 1.0");
    let deflection = |scene: &str| number(&ball.play(scene, "").1, "max_change");
    let once = deflection(&long);
    let force = deflection(&long.replace("strength = 0.4", "strength = 0.8"));
    let stiff = deflection(&long.replace("[material]", "[material]\nstiffness = 2"));
    let by_formula = deflection(&long.replace("[material]", "[material]\nstiffness = \"1 + 1^x + 0*d\""));
    for (name, ratio) in [
        ("force", force / once / 2.0),
        ("stiffness", 2.0 * stiff / once),
        ("formula", by_formula / stiff),
    ] {
        assert!((ratio - 1.0).abs() < 1e-3, "{name}: {ratio}");
    }
    // The surface stays where it is held.
    let hold = format!("{long}\n[[constraint]]\nalong = [[0.0, 0.0, 1.0]]\n");
    ball.play(&hold, "");
    assert!(ball.values("moved.iclay", &[[0.0, 0.0, 1.0]])[0].abs() < 1e-4);
}

#[test]
fn elastic_swings_back_and_clay_stays() {
    let ball = Ball::new();
    let held = format!("{SCENE}\n[sleep]\nspeed = 1e-3\nacceleration = 1e-2\n")
        .replace("duration = 1.0", "duration = 20.0");
    let tip = [[0.0, 0.0, 1.0]];
    let (steps, last) = ball.play(&format!("{held}[release]\nat = 1.0\nas = \"elastic\"\n"), "");
    assert!(number(&steps[19], "max_change") > 50.0 * number(&last, "max_change"));
    assert!(ball.values("moved.iclay", &tip)[0].abs() < 1e-3);
    assert!(steps.last().unwrap()["awake"] == false, "it has come to rest");
    let (steps, last) = ball.play(&format!("{held}[release]\nat = 1.0\nas = \"clay\"\n"), "");
    assert_eq!(number(&steps[19], "max_change"), number(&last, "max_change"));
    assert!(ball.values("moved.iclay", &tip)[0] > 0.02);
    assert_eq!(number(&last, "steps_awake"), 20.0);
}

#[test]
fn the_same_scene_gives_the_same_bits_on_any_number_of_threads() {
    let ball = Ball::new();
    let rich = format!(
        "{SCENE}{}",
        r#"
[[paint]]
substance = "stiffness"
value = 100
along = [[0.2, -0.3, 0.9], [0.2, 0.3, 0.9]]
radius = 0.15
fade = 1
at = 0.5
[[pull]]
at = [-0.2, 0, 0.95]
to = [0.2, 0, 0.95]
radius = 0.1
strength = -0.2
when = { from = 0.1, every = 0.2, ramp = 0.1 }
[law]
kind = "4-d"
[plasticity]
rate = 1
"#
    );
    let hash = |options: &str| ball.play(&rich, options).1["field_sha256"].clone();
    let once = hash("");
    assert_eq!(hash(""), once);
    assert_eq!(hash("--threads 1"), once);
    assert_eq!(hash("--threads 2"), once);
}

#[test]
fn frames_show_the_motion() {
    let ball = Ball::new();
    ball.0.write("scene.toml", SCENE);
    let run = ball
        .0
        .run("simulate scene.toml -o moved.iclay --frames frames --every 10 --mesh moved.glb");
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(
        run.stdout.contains("steps") && run.stdout.contains("awake"),
        "{}",
        run.stdout
    );
    let height = |n: usize| {
        let mesh = crate::common::read_mesh(&ball.0.path(&format!("frames/frame-{n:05}.ply")));
        mesh.positions.iter().map(|p| p.z).fold(0.0, f64::max)
    };
    assert!((height(0) - 1.0).abs() < 1e-3);
    assert!(height(10) > height(0) + 0.02 && height(20) > height(0) + 0.02);
    assert_eq!(std::fs::read_dir(ball.0.path("frames")).unwrap().count(), 3);
    assert!(number(&ball.0.json("info moved.glb"), "faces") > 1000.0);
}

#[test]
fn adaptive_steps_end_where_fixed_ones_do() {
    let ball = Ball::new();
    let tip = [[0.0, 0.0, 1.0]];
    ball.play(&SCENE.replace("step = 0.05", "step = 0.005"), "");
    let fine = ball.values("moved.iclay", &tip)[0];
    let (steps, last) = ball.play(&format!("{SCENE}\nintegrator = \"adaptive\""), "");
    let adaptive = ball.values("moved.iclay", &tip)[0];
    assert!((adaptive / fine - 1.0).abs() < 0.01, "{adaptive} for {fine}");
    assert!((number(&last, "simulated_seconds") - 1.0).abs() < 1e-3);
    let lengths: Vec<f64> = steps.iter().map(|s| number(s, "dt")).collect();
    assert!(lengths.iter().any(|dt| *dt != lengths[0]), "the step adapts");
}

#[test]
fn what_cannot_be_is_refused_by_line_or_table_with_a_remedy_and_writes_nothing() {
    let ball = Ball::new();
    let before = ball.0.files();
    let cases = [
        ("mass = 0.05", "mass = -1", ["line 8", "-1"]),
        ("mass = 0.05", "mass = 0", ["[material] mass", "above 0"]),
        ("mass = 0.05", "mass = nan", ["line 8", "finite"]),
        ("mass = 0.05", "mass = \"x\"", ["[material] mass", "above 0"]),
        ("mass = 0.05", "mass = \"1/(x-x)\"", ["[material] mass", "finite"]),
        ("mass = 0.05", "mass = \"x^^2\"", ["line 8", "max(a, b)"]),
        ("mass = 0.05", "maas = 1", ["line 8", "maas"]),
        (
            "damping = 1.0",
            "damping = \"w\"",
            ["line 9", "no variable or function called w"],
        ),
        (
            "max = [0.5, 0.5, 1.14]",
            "max = [0.5, 0.5, 9]",
            ["[region]", "outside the field"],
        ),
        (
            "max = [0.5, 0.5, 1.14]",
            "max = [0.5, -0.6, 1.14]",
            ["[region]", "below max"],
        ),
        ("max = [0.5, 0.5, 1.14]", "", ["[region]", "first and count"]),
        (
            "level = 0",
            "level = 0\n[region.mask]\ninside = \"z > 50\"",
            ["[region.mask]", "no sample"],
        ),
        (
            "level = 0",
            "level = 0\n[region.mask]\ninside = \"1/(z - z)\"",
            ["[region.mask] inside", "finite"],
        ),
        (
            "level = 0",
            "level = 0\n[region.mask]\ninside = 3",
            ["[region.mask] inside", "positive inside"],
        ),
        (
            "level = 0",
            "level = 0\n[region.mask]\nrim = \"free\"",
            ["[region.mask]", "boxes"],
        ),
        (
            "level = 0",
            "level = 0\n[region.mask]\nboxes = [{ min = [0, 0, 0], max = [1, 0, 1] }]",
            ["[region.mask] boxes, number 1", "below max"],
        ),
        ("level = 0", "level = 60", ["[region]", "60"]),
        (
            "level = 0",
            "level = 0\nsamples-per-cell = 0",
            ["line 7", "positive"],
        ),
        ("radius = 0.12", "radius = 0", ["line 12", "positive"]),
        (
            "radius = 0.12",
            "radius = 1e-4",
            ["[[pull]] 1 radius", "no sample"],
        ),
        (
            "at = [0.0, 0.0, 1.0]",
            "at = [0, 0, 5]",
            ["[[pull]] 1 at", "outside the region"],
        ),
        ("strength = 0.4", "strength = inf", ["line 13", "finite"]),
        (
            "strength = 0.4",
            "strength = 1\nwhen = { from = 2, until = 1 }",
            ["[[pull]] 1 when", "after it begins"],
        ),
        ("duration = 1.0", "duration = 0", ["line 15", "positive"]),
        ("step = 0.05", "step = 2", ["[time] step", "longer"]),
        ("step = 0.05", "step = 1e-9", ["[time] step", "10 million"]),
        (
            "step = 0.05",
            "step = 0.5\nintegrator = \"symplectic\"",
            ["unstable beyond", "shorter steps"],
        ),
        (
            "step = 0.05",
            "step = 0.5\nintegrator = \"euler\"",
            ["line 17", "tr-bdf2"],
        ),
        (
            "step = 0.05",
            "step = 0.5\ntolerance = 1",
            ["[time] tolerance", "adaptive"],
        ),
        (
            "step = 0.05",
            "step = 0.5\nintegrator = \"adaptive\"\nshortest = 2\nlongest = 1",
            ["[time] shortest", "longer than the longest step"],
        ),
        (
            "step = 0.05",
            "step = 0.5\n[release]\nat = 3\nas = \"clay\"",
            ["[release] at", "after the end"],
        ),
        (
            "step = 0.05",
            "step = 0.5\n[law]\nneighbours = 7",
            ["[law] neighbours", "26"],
        ),
        (
            "step = 0.05",
            "step = 0.5\n[[constraint]]\nname = \"a\"\nalong = [[0,0,1]]\n[[constraint]]\nname = \"b\"\nalong = [[0,0,1]]\ndensity = 0.1",
            ["[[constraint]]", "hard constraints a, b contradict"],
        ),
        (
            "step = 0.05",
            "step = 0.5\n[[force]]\nsamples = [[0, 0, 99]]\nvalues = [1]",
            ["[[force]] 1 samples", "numbered from 0"],
        ),
        (
            "step = 0.05",
            "step = 0.5\n[[paint]]\nsubstance = \"mass\"\nvalue = 0\nalong = [[0,0,1]]\nradius = 1",
            ["[[paint]] 1", "above 0"],
        ),
        (
            "field = \"ball.iclay\"",
            "field = \"none.iclay\"",
            ["none.iclay", "No such file"],
        ),
        ("field = \"ball.iclay\"", "field = 3", ["line 2", "string"]),
        ("field = \"ball.iclay\"", "", ["names no field", "--field"]),
    ];
    for (from, to, words) in cases {
        assert!(SCENE.contains(from), "{from}");
        ball.0.write("scene.toml", SCENE.replace(from, to));
        let run = ball.0.run("simulate scene.toml -o moved.iclay");
        assert_eq!(run.code, 3, "{to}: {}{}", run.stdout, run.stderr);
        for word in words {
            assert!(run.stderr.contains(word), "{to}: no {word:?} in {}", run.stderr);
        }
    }
    std::fs::remove_file(ball.0.path("scene.toml")).unwrap();
    assert_eq!(ball.0.files(), before);
}

#[test]
fn a_scene_without_a_field_moves_the_one_named_beside_it() {
    let ball = Ball::new();
    let (_, own) = ball.play(SCENE, "");
    let (_, beside) = ball.play(&SCENE.replace("field = \"ball.iclay\"", ""), "--field ball.iclay");
    assert_eq!(own["field_sha256"], beside["field_sha256"]);
}

#[test]
fn the_example_pulls_a_hump_out_of_the_bunny() {
    let bench = Bench::new();
    bench.json(&format!("fit {} -o bunny.iclay", data("bunny.obj.gz")));
    let scene = data("bunny-pull.toml");
    let last = bench.json(&format!(
        "simulate {scene} --field bunny.iclay -o pulled.iclay --mesh pulled.ply"
    ));
    assert!(number(&last, "max_change") > 0.6, "{last}");
    let mesh = crate::common::read_mesh(&bench.path("pulled.ply"));
    // The back, whose height was 6.3; the ears are elsewhere.
    let on_the_back = mesh
        .positions
        .iter()
        .filter(|p| (p.x - 1.25).abs() < 0.5 && (p.z - 1.0).abs() < 0.5);
    let height = on_the_back.map(|p| p.y).fold(0.0, f64::max);
    assert!((6.8..7.5).contains(&height), "{height}");
}
