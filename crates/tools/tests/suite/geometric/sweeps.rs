//! Solids carried along curves, against tubes of known volume.

use std::f64::consts::{PI, TAU};

use bspline::hierarchical::HierarchicalSpline;
use bspline::polygonize::{PolygonizeOptions, check_mesh, polygonize};
use bspline::{Aabb, Frame};
use glam::DVec3;

use super::{ISO, block, done, random, refused};

/// Half a circle of radius 5 about the middle of the block's face, in it, as points, by formulas, and as a whole.
fn circle(turns: f64, count: usize) -> String {
    let points: Vec<String> = (0..=count)
        .map(|i| {
            let t = PI * turns * i as f64 / count as f64;
            format!(
                "[{}, {}, 12]",
                12.0 + 5.0 * libm::cos(t),
                12.0 + 5.0 * libm::sin(t)
            )
        })
        .collect();
    format!("[{}]", points.join(", "))
}

/// Volume of the solid about the circle.
fn volume(field: &HierarchicalSpline<f32>) -> f64 {
    let about = Aabb::new(DVec3::new(4.0, 4.0, 9.0), DVec3::new(20.0, 20.0, 15.0));
    let options = PolygonizeOptions {
        iso: ISO,
        ..Default::default()
    };
    let (mesh, _) = polygonize(field, &Frame::over(&about, [128, 128, 48]), &options).unwrap();
    check_mesh(&mesh).volume
}

fn formulas(to: f64) -> String {
    format!("{{ formulas = {{ x = '12 + 5*cos(t)', y = '12 + 5*sin(t)', z = '12', from = 0, to = {to} }} }}")
}

/// All curves lie in the face of the block, so half of what is swept counts. Volumes of tubes do not depend on their curvature.
#[test]
fn tubes_have_their_volume_at_any_spacing() {
    let block = block();
    let before = volume(&block);
    let ends = 4.0 / 3.0 * PI;
    // Its outer corners run on a wider circle than its middle, its inner face on its own.
    let outer = (5.75_f64.powi(2) + 0.5_f64.powi(2)).sqrt();
    let ring = 2.0 * PI * (outer.powi(2) - 4.25_f64.powi(2));
    let rod = |length: f64| PI * length + ends;
    for (n, (shape, along, whole)) in [
        // However the curve is told, and however far apart its points are.
        ("sphere = { radius = 1.0 }", formulas(1.0), rod(5.0)),
        ("sphere = { radius = 1.0 }", circle(1.0, 64), rod(5.0 * PI)),
        (
            "sphere = { radius = 1.0 }",
            "{ meet = { formulas = ['(x-12)^2 + (y-12)^2 - 25', 'z - 12'] } }".into(),
            PI * 5.0 * TAU,
        ),
        (
            "sphere = { radius = 1.0 }",
            "{ spline = { through = [[9, 12, 12], [15, 12, 12]] } }".into(),
            rod(6.0),
        ),
        // A disc round a corner: two strips that share a square, two half discs and a quarter.
        (
            "cylinder = { axis = [0, 0, 1], radius = 1.0, height = 2.0 }",
            "[[7, 9, 12], [13, 9, 12], [13, 15, 12]]".into(),
            2.0 * (24.0 - 1.0 + 1.25 * PI),
        ),
        (
            "formula = { text = '1 - x^2 - y^2 - z^2', size = [2.2, 2.2, 2.2] }",
            formulas(1.0),
            rod(5.0),
        ),
        // Turned with the curve.
        ("box = { size = [1.5, 1, 2] }, along_follow", formulas(TAU), ring),
        // Not turned: what a disc runs through.
        (
            "cylinder = { axis = [0, 0, 1], radius = 1.0, height = 2.0 }",
            formulas(TAU),
            2.0 * 2.0 * TAU * 5.0,
        ),
        (
            "torus = { axis = [0, 1, 0], major = 1.5, minor = 0.5 }, along_follow",
            formulas(TAU),
            3.0 * PI * 10.0 * PI,
        ),
    ]
    .into_iter()
    .enumerate()
    {
        let (shape, follow) = match shape.strip_suffix(", along_follow") {
            Some(shape) => (shape, true),
            None => (shape, false),
        };
        let (operation, sign) = [("carve", -1.0), ("add", 1.0)][n % 2];
        let text = format!(
            "sweep = {{ operation = '{operation}', shape = {{ {shape} }}, along = {along}, follow = {follow}, finer = {} }}",
            if shape.starts_with("formula") { 1 } else { 2 }
        );
        let changed = sign * (volume(&done(&block, &text)) - before);
        let off = changed / (0.5 * whole) - 1.0;
        println!("{off:+.5} {changed:.4} {text:.80}");
        assert!(off.abs() < 0.005, "{text}: {changed}, off by {off}");
    }
}

/// Any number of threads gives the same.
#[test]
fn sweeps_do_not_depend_on_threads() {
    let text = format!(
        "sweep = {{ operation = 'add', shape = {{ box = {{ size = [2, 1, 1] }} }}, along = {}, follow = true }}",
        formulas(1.0)
    );
    let hashes = [1, 2, 8].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| done(&block(), &text).sha256())
    });
    assert!(hashes.iter().all(|hash| *hash == hashes[0]));
}

#[test]
fn sweeps_that_make_no_sense_are_refused() {
    let block = block();
    let mut draw = random(2);
    let wild: Vec<[f64; 3]> = (0..20_000)
        .map(|_| [draw(8.0, 16.0), draw(8.0, 16.0), 12.0])
        .collect();
    let ball = "operation = 'carve', shape = { sphere = { radius = 1 } }";
    for (text, why) in [
        (format!("{ball}, along = []"), "at least one point"),
        (format!("{ball}, along = [[99, 12, 12]]"), "the field from"),
        (
            format!("{ball}, along = {{ meet = {{ formulas = ['x - 99', 'y'] }} }}"),
            "nowhere",
        ),
        (
            format!("{ball}, along = {wild:?}"),
            "pieces",
        ),
        (
            "operation = 'add', shape = { object = { name = 'cow' } }, along = [[9, 9, 9]]".into(),
            "does not sweep",
        ),
        (
            "operation = 'add', shape = { formula = { text = '1/x', size = [2, 2, 2] } }, along = [[9, 9, 9]]".into(),
            "finite",
        ),
    ] {
        let error = refused(&block, &format!("sweep = {{ {text} }}"));
        assert!(error.contains(why), "{text:.200}: {error}");
    }
}
