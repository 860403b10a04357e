//! Sessions of geometric tools, as a user runs them: each checked by what it should leave, undone to the first state and replayed.

use crate::common::{Bench, number};
use bspline::polygonize::Mesh;
use glam::DVec3;
use serde_json::Value;

/// A document with a block of 12 × 10 × 6 about the origin, in intervals of half a unit.
struct Clay {
    bench: Bench,
    first: String,
}

impl Clay {
    fn new() -> Self {
        let bench = Bench::new();
        let made = bench.json("new clay.isoclay --box 12,10,6 --spacing 0.5");
        let first = made["state_sha256"].as_str().unwrap().to_string();
        Self { bench, first }
    }

    /// Runs one stroke after the other.
    fn sculpt(&self, strokes: &[&str]) -> Value {
        let text: String = strokes.iter().map(|s| format!("[[stroke]]\n{s}\n")).collect();
        self.bench.write("session.toml", text);
        self.bench
            .json("sculpt clay.isoclay --script session.toml --object block")
    }

    fn export(&self, object: &str) {
        let export = format!("export clay.isoclay --object {object} -o now.iclay");
        std::fs::remove_file(self.bench.path("now.iclay")).ok();
        self.bench.json(&export);
    }

    /// Values of the object `block` at places.
    fn values(&self, places: &[DVec3]) -> Vec<f64> {
        self.export("block");
        let lines: String = places
            .iter()
            .map(|p| format!("{} {} {}\n", p.x, p.y, p.z))
            .collect();
        self.bench.write("places.xyz", lines);
        let told = self.bench.run("eval now.iclay --points places.xyz").stdout;
        let rows = told.lines().skip(1);
        rows.map(|row| row.split(',').nth(3).unwrap().parse().unwrap())
            .collect()
    }

    /// Heights at which the solid ends above places, between z = 1 and 5.
    fn heights(&self, places: &[[f64; 2]]) -> Vec<f64> {
        const STEPS: usize = 400;
        let z = |n: usize| 1.0 + 4.0 * n as f64 / STEPS as f64;
        let column = |[x, y]: &[f64; 2]| {
            (0..=STEPS)
                .map(move |n| DVec3::new(*x, *y, z(n)))
                .collect::<Vec<_>>()
        };
        let all: Vec<DVec3> = places.iter().flat_map(column).collect();
        let values = self.values(&all);
        let end = |column: &[f64]| {
            let n = column
                .windows(2)
                .position(|v| v[0] > 0.0 && v[1] <= 0.0)
                .expect("a surface");
            z(n) + (z(1) - z(0)) * column[n] / (column[n] - column[n + 1])
        };
        values.chunks_exact(STEPS + 1).map(end).collect()
    }

    fn mesh(&self) -> Mesh {
        self.export("block");
        self.bench.json("mesh now.iclay -o now.ply --check");
        crate::common::read_mesh(&self.bench.path("now.ply"))
    }

    /// All edits give the same again, and undone they leave the first state.
    fn ends(&self) {
        for threads in [1, 8] {
            self.bench
                .json(&format!("replay clay.isoclay --threads {threads}"));
        }
        let undone = self.bench.json("undo clay.isoclay 99");
        assert_eq!(undone["state_sha256"].as_str().unwrap(), self.first);
    }
}

fn volume(mesh: &Mesh) -> f64 {
    let sixfold = mesh.triangles.iter().map(|t| {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        a.dot(b.cross(c))
    });
    sixfold.sum::<f64>() / 6.0
}

#[test]
fn brushes_inflate_and_smooth_what_they_pass_over() {
    let clay = Clay::new();
    clay.sculpt(&["inflate = { along = [[0, 0, 3]], radius = 4, by = 0.5 }"]);
    let [middle, beside] = clay.heights(&[[0.0, 0.0], [4.6, 0.0]])[..] else {
        unreachable!()
    };
    assert!(
        (middle - 3.5).abs() < 0.01 && (beside - 3.0).abs() < 0.01,
        "{middle}, {beside}"
    );
    let lifted = volume(&clay.mesh());
    clay.sculpt(&["inflate = { along = [[0, 0, 3.5]], radius = 4, by = -0.5 }"]);
    let [middle] = clay.heights(&[[0.0, 0.0]])[..] else {
        unreachable!()
    };
    assert!(
        (middle - 3.0).abs() < 0.03 && volume(&clay.mesh()) < lifted - 1.0,
        "{middle}"
    );
    // Bumps are evened out, and a flat place beside them stays flat.
    let bump =
        "add = { shape = { sphere = { radius = 0.8 } }, along = [[-3, -2, 3], [-3, 2, 3]], each = true }";
    clay.sculpt(&[bump]);
    let [before] = clay.heights(&[[-3.0, 2.0]])[..] else {
        unreachable!()
    };
    let done = clay.sculpt(&["smooth = { along = [[-3, -3, 3], [-3, 3, 3]], radius = 4, level = 2 }"]);
    let [bump, flat] = clay.heights(&[[-3.0, 2.0], [3.0, -3.0]])[..] else {
        unreachable!()
    };
    assert!(
        (before - 3.8).abs() < 0.02 && bump < 3.4 && (flat - 3.0).abs() < 0.01,
        "{before}, {bump}, {flat}"
    );
    assert_eq!(number(&done, "done"), 4.0);
    clay.ends();
}

#[test]
fn parts_are_copied_cut_and_pasted() {
    let clay = Clay::new();
    let ball = "add = { shape = { sphere = { radius = 1.5 } }, along = [[-2, 0, 3]], blend = 0.3 }";
    let made = clay.sculpt(&[ball, "copy = { to = \"spare\" }"]);
    assert_eq!(made["field_sha256"]["spare"], made["field_sha256"]["block"]);
    let whole = made["field_sha256"]["block"].clone();
    let full = volume(&clay.mesh());
    let region = "region = { min = [1, -3, 0], max = [5, 3, 4] }";
    clay.sculpt(&[&format!("cut = {{ {region}, to = \"clip\" }}")]);
    let left = volume(&clay.mesh());
    // The block ends at z = 3.
    assert!(
        (full - left - 4.0 * 6.0 * 3.0).abs() < 0.01 * 72.0,
        "{full} less {left}"
    );
    let back = clay.sculpt(&[&format!("paste = {{ from = \"clip\", {region} }}")]);
    assert_eq!(
        back["field_sha256"]["block"], whole,
        "pasted where it was, it is as it was"
    );
    // The ball with what is about it, elsewhere.
    let there = "paste = { from = \"spare\", region = { min = [-4, -2, 2], max = [0, 2, 5] }, by = [5, 0, 0], blend = 0.5 }";
    clay.sculpt(&[there]);
    let [here, there] = clay.heights(&[[-2.0, 0.0], [3.0, 0.0]])[..] else {
        unreachable!()
    };
    assert!(
        (here - 4.5).abs() < 0.02 && (there - here).abs() < 0.01,
        "{here}, {there}"
    );
    clay.ends();
}

#[test]
fn knots_come_and_go_without_a_move_of_the_surface() {
    let clay = Clay::new();
    let places: Vec<DVec3> = (0..300)
        .map(|n| DVec3::new(0.017, 0.011, 0.013) * f64::from(n) + DVec3::new(-2.0, -1.5, 0.2))
        .collect();
    let count = |clay: &Clay| {
        clay.export("block");
        number(&clay.bench.json("info now.iclay"), "coefficients")
    };
    let (before, few) = (clay.values(&places), count(&clay));
    clay.sculpt(&["refine = { along = [[0, 0, 3]], radius = 2 }"]);
    let (finer, many) = (clay.values(&places), count(&clay));
    let off = |a: &[f64], b: &[f64]| {
        a.iter()
            .zip(b)
            .fold(0.0f64, |most, (a, b)| most.max((a - b).abs()))
    };
    assert!(
        many > few + 100.0 && off(&before, &finer) < 1e-5,
        "{few}, {many}, {}",
        off(&before, &finer)
    );
    clay.sculpt(&["simplify = { along = [[0, 0, 3]], radius = 3, tolerance = 0.01 }"]);
    let (slim, least) = (clay.values(&places), count(&clay));
    assert!(
        least <= few && off(&before, &slim) < 0.01,
        "{few}, {least}, {}",
        off(&before, &slim)
    );
    clay.ends();
}

/// A turned and enlarged copy hangs on the block: both are meshed and asked where they are, and neither field changes.
#[test]
fn objects_are_placed_and_move_with_their_parents() {
    let clay = Clay::new();
    clay.sculpt(&[
        "copy = { to = 'part' }",
        "object = 'part'\nplace = { turn = [0, 0, 90], scale = 2, by = [0, 0, 10] }",
        "object = 'part'\nplace = { parent = 'block' }",
        "place = { by = [100, 0, 0], turn = [90, 0, 0], about = [0, 0, 0] }",
    ]);
    let part = || {
        clay.bench
            .json("mesh clay.isoclay --object part -o part.ply --tolerance 1%");
        let mesh = crate::common::read_mesh(&clay.bench.path("part.ply"));
        let first = mesh.positions[0];
        let ends = mesh
            .positions
            .iter()
            .fold([first; 2], |[lo, hi], p| [lo.min(*p), hi.max(*p)]);
        (volume(&mesh), ends)
    };
    // 12 × 10 × 6 becomes 20 × 24 × 12 by the first turn; the second lays y on z, and z on -y.
    let (large, [lo, hi]) = part();
    let expected = [DVec3::new(90.0, -16.0, -12.0), DVec3::new(110.0, -4.0, 12.0)];
    assert!(
        lo.abs_diff_eq(expected[0], 0.5) && hi.abs_diff_eq(expected[1], 0.5),
        "{lo} {hi}"
    );
    clay.bench
        .json("mesh clay.isoclay --object block -o now.ply --tolerance 1%");
    let own = volume(&crate::common::read_mesh(&clay.bench.path("now.ply")));
    assert!((large / own - 8.0).abs() < 0.05, "{large} of {own}");
    let value = |object: &str, place: &str| {
        clay.bench.write("place.xyz", place);
        let told = clay
            .bench
            .run(&format!("eval clay.isoclay --object {object} --points place.xyz"))
            .stdout;
        let row = told.lines().nth(1).unwrap().split(',');
        row.map(|n| n.parse::<f64>().unwrap()).collect::<Vec<_>>()
    };
    let [above, below] = ["100 -10 11\n", "100 -10 13\n"].map(|place| value("part", place)[3]);
    assert!(above > 0.0 && below < 0.0, "{above} {below}");
    let fields = clay.bench.json("info clay.isoclay");
    let placed = &fields["objects"][1];
    assert_eq!(placed["parent"], "block");
    assert_eq!(placed["field_sha256"], fields["objects"][0]["field_sha256"]);
    // Without its parent it stays where it is; a mirror image has its outside outside.
    clay.sculpt(&["object = 'part'\nplace = { parent = '' }"]);
    let (again, [low, high]) = part();
    assert!((again / large - 1.0).abs() < 1e-3 && low.abs_diff_eq(lo, 1e-3) && high.abs_diff_eq(hi, 1e-3));
    clay.sculpt(&["object = 'part'\nplace = { map = [[-1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]] }"]);
    assert!((part().0 / own - 1.0).abs() < 1e-2);
    clay.ends();
}

/// Who runs a session again after an error would do its first strokes twice.
#[test]
fn a_session_that_fails_tells_what_it_has_done() {
    let clay = Clay::new();
    let good = "carve = { shape = { sphere = { radius = 1 } }, along = [[0, 0, 3]] }";
    let bad = "smooth = { along = [[0, 0, 3]], radius = 2, level = 99 }";
    for (strokes, done, told) in [
        (&[bad][..], 0, None),
        (
            &[good, bad, good],
            1,
            Some("stroke 2 of 3 (those before it are done, undo takes them back)"),
        ),
    ] {
        let text: String = strokes.iter().map(|s| format!("[[stroke]]\n{s}\n")).collect();
        clay.bench.write("session.toml", text);
        let run = clay
            .bench
            .run("sculpt clay.isoclay --script session.toml --object block");
        assert_eq!(run.code, 3, "{}", run.stderr);
        assert_eq!(run.stderr.contains("stroke "), told.is_some(), "{}", run.stderr);
        assert!(
            told.is_none_or(|told| run.stderr.contains(told)),
            "{}",
            run.stderr
        );
        assert!(run.stderr.contains("write 1 to 10"), "{}", run.stderr);
        assert_eq!(clay.bench.json("info clay.isoclay")["done"], done);
    }
}

#[test]
fn strokes_happen_on_both_sides_and_on_coarse_levels_alone() {
    let clay = Clay::new();
    let both = "symmetry = { at = [0, 0, 0], normal = [1, 0, 0] }";
    clay.sculpt(&[
        &format!("{both}\nadd = {{ shape = {{ sphere = {{ radius = 1 }} }}, along = [[4, 1, 3], [3, -2, 3]], blend = 0.4 }}"),
        &format!("{both}\ninflate = {{ along = [[-4, -4, 3]], radius = 2, by = -0.4 }}"),
    ]);
    let places: Vec<DVec3> = (0..400)
        .map(|n| {
            DVec3::new(
                0.5 + 0.0125 * f64::from(n),
                -4.5 + 0.02 * f64::from(n),
                2.0 + 0.005 * f64::from(n),
            )
        })
        .collect();
    let mirrored: Vec<DVec3> = places.iter().map(|p| *p * DVec3::new(-1.0, 1.0, 1.0)).collect();
    let [here, there] = [&places, &mirrored].map(|p| clay.values(p));
    for ((a, b), p) in here.iter().zip(&there).zip(&places) {
        assert!((a - b).abs() < 1e-4, "{a} and {b} at {p}");
    }
    // A fine groove stays while what it lies on is lifted by less than its depth.
    let groove = "carve = { shape = { sphere = { radius = 0.4 } }, along = [[-1.5, -3, 3], [-1.5, 3, 3]] }";
    clay.sculpt(&[groove]);
    let [groove, beside] = clay.heights(&[[-1.5, 0.0], [0.0, 0.0]])[..] else {
        unreachable!()
    };
    clay.sculpt(&["coarse = 0\ninflate = { along = [[-1, 0, 3]], radius = 4, by = 0.15 }"]);
    let [lifted, level] = clay.heights(&[[-1.5, 0.0], [0.0, 0.0]])[..] else {
        unreachable!()
    };
    assert!((level - beside - 0.15).abs() < 0.02, "{beside} to {level}");
    assert!((level - lifted) > 0.8 * (beside - groove), "{groove} to {lifted}");
    clay.ends();
}

/// The block's box leaves 6 free on each side.
#[test]
fn a_box_grows_where_a_stroke_needs_more_room() {
    let clay = Clay::new();
    let box_of = |clay: &Clay| {
        clay.export("block");
        clay.bench.json("info now.iclay")["box"].clone()
    };
    let paint = "paint = { layer = \"stiffness\", formula = \"1 + (x > 0)\" }";
    clay.sculpt(&[paint]);
    let (small, before) = (box_of(&clay), volume(&clay.mesh()));
    let long = "add = { shape = { capsule = { axis = [1, 0, 0], radius = 1.5, height = 4 } }, along = [[4, 0, 0], [16, 0, 0]] }";
    let done = clay.sculpt(&[long, "pull = { along = [[6, 3, 0]], lift = 0.5, radius = 0.6 }"]);
    assert!(
        done["notes"][0]
            .as_str()
            .unwrap()
            .contains("box of the field has grown"),
        "{done}"
    );
    assert_ne!(box_of(&clay), small);
    let mesh = clay.mesh();
    let end = mesh.positions.iter().fold(0.0f64, |most, p| most.max(p.x));
    assert!((end - 19.5).abs() < 0.02, "{end}");
    // A rod of radius 1.5 from the face at x = 6 to 18, and half a ball.
    let rod = std::f64::consts::PI * (2.25 * 12.0 + 1.5f64.powi(3) * 2.0 / 3.0);
    let grown = volume(&mesh) - before;
    assert!((grown - rod).abs() < 0.03 * rod, "{grown} of {rod}");
    // Both ways, on both sides of a plane, by a move; and what is cut off at a face is not made up.
    clay.sculpt(&[
        "symmetry = { at = [0, 0, 0], normal = [0, 1, 0] }\nadd = { shape = { sphere = { radius = 2 } }, along = [[0, 4, 0], [0, 13, 0]] }",
        "move = { motion = { grab = { along = [[-6, 0, 0], [-16, 0, 0]], radius = 6, rigid = 1 } } }",
    ]);
    let (low, high) = clay
        .mesh()
        .positions
        .iter()
        .fold((DVec3::ZERO, DVec3::ZERO), |(a, b), p| (a.min(*p), b.max(*p)));
    assert!(
        (high.y - 15.0).abs() < 0.02 && (low.y + 15.0).abs() < 0.02 && (low.x + 16.0).abs() < 0.1,
        "{low} {high}"
    );
    clay.ends();
}
