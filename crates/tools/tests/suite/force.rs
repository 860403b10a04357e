//! Force tools: integrals, arrival, shape, what stays, and what is refused.

mod areas;
mod borders;
mod faces;
mod gaps;
mod holds;
mod limits;
mod shapes;
mod tracks;

use bspline::hierarchical::{HierarchicalSpline, Lattice};
use bspline::polygonize::{PolygonizeOptions, check_mesh, polygonize};
use bspline::primitives::Sphere;
use bspline::{Csg, Field, Frame, Real};
use dynamics::integrators::Integrator;
use dynamics::matter::Matter;
use dynamics::region::{Region, RegionOptions};
use dynamics::response::Against;
use fitting::Control;
use glam::{DAffine3, DVec3};
use std::sync::Arc;
use tools::canvas::Canvas;
use tools::force::quadrature::Tolerance;
use tools::force::{
    Arrival, Chisel, Drill, Extent, ForceReport, ForceStroke, How, Path, Pull, Rule, Solid, Target,
    nearest_surface,
};
use tools::session::Session;

/// Density of the surface, and its fall: tools work in lengths on any field.
const ISO: f64 = 300.0;
const SLOPE: f64 = 40.0;
/// Radius of tools: 1.6 samples of the block of 24³ cells.
const R: f64 = 1.2;

fn field_of<T: Real>(cells: u32, distance: impl Fn(DVec3) -> f64) -> HierarchicalSpline<T> {
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_scale(DVec3::splat(24.0 / f64::from(cells))),
        cells: [cells; 3],
    };
    HierarchicalSpline::schoenberg(lattice, SLOPE, |p| SLOPE * distance(p) + ISO).unwrap()
}

/// What lies below `z = 12` in a box of 24³: exact in splines.
fn block<T: Real>(cells: u32) -> HierarchicalSpline<T> {
    field_of(cells, |p| 12.0 - p.z)
}

fn ball<T: Real>(cells: u32, sign: f64) -> HierarchicalSpline<T> {
    field_of(cells, |p| sign * (6.0 - p.distance(DVec3::splat(12.0))))
}

fn pull(text: &str) -> Pull {
    toml::from_str(text).unwrap_or_else(|e| panic!("{text}: {e}"))
}

fn finished<T: Real>(mut stroke: ForceStroke<T>) -> (HierarchicalSpline<T>, ForceReport) {
    while !stroke.is_over() {
        stroke.step().unwrap_or_else(|e| panic!("{e}"));
    }
    let (field, report) = stroke.release().unwrap();
    println!("{report:?}");
    (field, report)
}

fn pulled<T: Real>(field: &HierarchicalSpline<T>, text: &str) -> (HierarchicalSpline<T>, ForceReport) {
    finished(
        pull(text)
            .begin(field, ISO)
            .unwrap_or_else(|e| panic!("{text}: {e}")),
    )
}

/// Height of the surface over `(x, y)`, from 12 up.
fn height<T: Real>(field: &HierarchicalSpline<T>, x: f64, y: f64) -> f64 {
    let (mut low, mut high) = (5.0, 19.0);
    for _ in 0..60 {
        let z = 0.5 * (low + high);
        let is_in = field.value(DVec3::new(x, y, z)) > ISO;
        *(if is_in { &mut low } else { &mut high }) = z;
    }
    low - 12.0
}

#[test]
fn integrals_equal_their_closed_forms() {
    let tolerance = Tolerance {
        relative: 1e-9,
        mean: 0.0,
    };
    let sphere = Sphere::new(DVec3::ZERO, 5.0).unwrap();
    let close = |found: f64, exact: f64, what: &str| {
        assert!((found / exact - 1.0).abs() < 1e-6, "{what}: {found} for {exact}");
    };
    for iso in [-1.5, -0.2, 0.0, 0.3, 2.0] {
        // The surface f = 5 - |p| = c is the sphere of radius 5 - c: along a ray, c - f = s - (5 - c).
        let surface = 5.0 - iso;
        for (angle, length) in [(0.1f64, 0.7), (1.0, 2.0), (2.5, 2.9)] {
            let out = DVec3::new(angle.cos(), 0.6 * angle.sin(), 0.8 * angle.sin());
            let from = surface * out;
            for (by, grows) in [(length, true), (-length, false)] {
                let path = Path::through([from, from + by * out]).unwrap();
                let target = Target::single(path, grows);
                let found = target.force_of(&sphere, iso, 1.0, 0.2, tolerance);
                close(found, 0.5 * by * by.abs(), "straight");
            }
        }
        // A quarter circle that leaves the surface along the normal, with the radius 2: |p|² = (a + 2 sin t)² + (2 - 2 cos t)².
        let at = |t: f64| {
            let angle = 0.5 * std::f64::consts::PI * t;
            Ok(DVec3::new(
                surface + 2.0 * libm::sin(angle),
                2.0 - 2.0 * libm::cos(angle),
                0.0,
            ))
        };
        let found =
            Target::single(Path::parametric(at).unwrap(), true).force_of(&sphere, iso, 1.0, 0.1, tolerance);
        let count = 200_000;
        let width = std::f64::consts::PI / count as f64;
        let exact: f64 = (0..count)
            .map(|i| {
                let p: Result<DVec3, String> = at((f64::from(i) + 0.5) / f64::from(count));
                (p.unwrap().length() - surface) * width
            })
            .sum();
        close(found, exact, "curved");
    }
    // Beyond its end the force turns round: from the surface at 5 back to 4.
    let path = Path::through([DVec3::X * 3.0, DVec3::X * 4.0]).unwrap();
    let found = Target::single(path, true).force_of(&sphere, 0.0, 1.0, 0.1, tolerance);
    close(found, -0.5, "beyond");
}

/// Voxels of scans are often much longer than wide.
#[test]
fn long_cells_take_no_more_samples_than_cubes_and_end_alike() {
    let text = "along = [[12, 12, 12], [15, 13, 12]]\nlift = 2\nradius = 1.2";
    let (cubes, of_cubes) = pulled(&block::<f32>(24), text);
    for cell in [
        DVec3::new(0.25, 0.25, 1.0),
        DVec3::new(0.5, 1.0, 0.125),
        DVec3::new(1.0, 0.3, 1.0),
    ] {
        let lattice = Lattice {
            world_from_lattice: DAffine3::from_scale(cell),
            cells: (24.0 / cell).to_array().map(|n| n as u32),
        };
        let block = HierarchicalSpline::<f32>::schoenberg(lattice, SLOPE, |p| SLOPE * (12.0 - p.z) + ISO);
        let (long, report) = pulled(&block.unwrap(), text);
        assert!(
            report.samples < 2 * of_cubes.samples,
            "{cell}: {}",
            report.samples
        );
        assert!(
            report.arrival.least > 0.99 && report.arrival.most < 1.01,
            "{cell}"
        );
        for (x, y) in [
            (12.0, 12.0),
            (13.5, 12.5),
            (13.0, 13.5),
            (14.0, 11.0),
            (16.5, 13.5),
        ] {
            let off = height(&long, x, y) - height(&cubes, x, y);
            assert!(off.abs() < 0.08, "{cell}: {off} at {x}, {y}");
        }
    }
}

#[test]
fn clay_arrives_in_time_and_not_beyond() {
    let block = block::<f32>(24);
    let curve = "along = [[8, 12, 12], [16, 12.3, 12]]";
    let bent = "along = [[9, 10, 12], [12, 13, 12], [15, 10, 12]]";
    let mut cases = Vec::new();
    for d in [0.6, 1.92, 3.6] {
        for sign in [1.0, -1.0] {
            let lift = format!("lift = {}", sign * d);
            cases.push((&block, "along = [[12.1, 11.8, 12.5]]", lift.clone()));
            cases.push((&block, curve, lift));
        }
    }
    let tilted = "by = [0.8, 0.2, 1.5]".to_string();
    cases.push((&block, curve, tilted.clone()));
    cases.push((&block, bent, tilted));
    // A quarter of a circle up and aside.
    let way = (1..=16).map(|i| {
        let t = 0.098 * f64::from(i);
        format!("[{}, 0, {}]", 1.5 - 1.5 * t.cos(), 1.5 * t.sin())
    });
    let way = format!("way = [{}]", way.collect::<Vec<_>>().join(", "));
    cases.push((&block, "along = [[12.1, 11.8, 12]]", way));
    // Corners of 60, 90 and 135 degrees, and a closed curve of four.
    for corner in ["[14, 15.5, 12]", "[12, 16, 12]", "[9, 15, 12]"] {
        let turned = format!("along = [[8, 12, 12], [12, 12, 12], {corner}]");
        cases.push((&block, &*turned.leak(), "lift = 1.92".to_string()));
    }
    let square = "along = [[9, 9, 12], [15, 9, 12], [15, 15, 12], [9, 15, 12], [9, 9, 12]]";
    cases.push((&block, square, "lift = -1.92".to_string()));
    let (ball, hollow) = (ball::<f32>(24, 1.0), ball::<f32>(24, -1.0));
    for field in [&ball, &hollow] {
        for d in [1.5, -1.5] {
            let arc = "along = [[12, 12, 18], [13.5, 12, 17.8], [15, 12, 17.2]]";
            cases.push((field, arc, format!("lift = {d}")));
        }
    }
    for (field, along, way) in cases {
        let (_, report) = pulled(field, &format!("{along}\n{way}\nradius = {R}"));
        assert!(
            report.steps_to_99.is_some_and(|n| n <= 15),
            "{along} {way}: {report:?}"
        );
        assert!(report.overshoot <= 0.015, "{along} {way}: {report:?}");
        let end = report.arrival;
        assert!(end.least > 0.99 && end.most < 1.01, "{along} {way}: {report:?}");
        if report.paths == 1 {
            assert!(end.least > 0.998, "{along} {way}: {report:?}");
        }
    }
}

#[test]
fn areas_arrive_as_one() {
    let field = block::<f32>(24);
    for d in [1.92, -1.92] {
        let (after, report) = pulled(
            &field,
            &format!("along = [[12, 12, 12]]\ndisc = 2.4\nlift = {d}\nradius = {R}"),
        );
        assert!(report.steps_to_99.is_some_and(|n| n <= 15), "{report:?}");
        assert!(report.overshoot < 0.02, "{report:?}");
        for i in 0..=8 {
            let share = height(&after, 12.0 + 0.3 * f64::from(i), 12.0) / d;
            assert!((0.985..1.02).contains(&share), "{i}: {share}");
        }
    }
}

#[test]
fn the_sampling_does_not_show() {
    let profile = |cells: u32| -> Vec<f64> {
        let text = format!("along = [[12.1, 11.8, 12]]\nlift = 1.92\nradius = {R}");
        let (after, _) = pulled(&block::<f32>(cells), &text);
        (0..9)
            .map(|i| height(&after, 12.1 + 0.4 * f64::from(i), 11.8) / 1.92)
            .collect()
    };
    let [coarse, double, fourfold] = [24, 48, 96].map(profile);
    for i in 0..9 {
        assert!(
            (coarse[i] - fourfold[i]).abs() < 0.02,
            "{coarse:.4?} {fourfold:.4?}"
        );
        assert!(
            (double[i] - fourfold[i]).abs() < 0.02,
            "{double:.4?} {fourfold:.4?}"
        );
    }
}

#[test]
fn the_number_of_paths_does_not_show() {
    let field = block::<f32>(24);
    let profile = |count: usize, d: f64| -> Vec<f64> {
        let width = 7.2 / count as f64;
        let target = |i: usize| {
            let from = DVec3::new(8.4 + i as f64 * width, 12.1, 12.0);
            let is_end = i == 0 || i == count;
            Target {
                weight: if is_end { 0.5 * width + 0.5 * R } else { width },
                ..Target::single(Path::through([from, from + d * DVec3::Z]).unwrap(), true)
            }
        };
        let targets = (0..=count).map(target).collect();
        let (after, _) =
            finished(ForceStroke::new(&field, ISO, targets, Extent::Curve, R, &How::default()).unwrap());
        let along = (0..=20).map(|i| height(&after, 7.0 + 0.5 * f64::from(i), 12.1) / d);
        let across = (0..=6).map(|i| height(&after, 12.0, 12.1 + 0.5 * f64::from(i)) / d);
        along.chain(across).collect()
    };
    for (d, limit) in [(1.92, 0.02), (3.6, 0.03)] {
        let all = [12, 24, 48].map(|n| profile(n, d));
        for other in &all[1..] {
            let off = all[0]
                .iter()
                .zip(other)
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max);
            println!("{d}: {off}");
            assert!(off < limit, "{d}: {off}");
        }
    }
}

/// The forces that an elastic stroke ends with hold the shape that it ends with, by a direct solve.
fn static_error<T: Real>(text: &str) -> (f64, ForceReport) {
    let field = block::<T>(24);
    let mut stroke = pull(text).begin(&field, ISO).unwrap();
    for _ in 0..60 {
        stroke.step().unwrap();
    }
    let mut region = stroke.region().clone();
    let held = &region
        .static_response(Against::Painted, &[stroke.load()])
        .unwrap()[0]
        .p
        .clone();
    let now = &region.patch().state().p;
    let most = |list: &mut dyn Iterator<Item = f64>| list.map(f64::abs).fold(0.0, f64::max);
    let off = most(&mut held.iter().zip(now).map(|(a, b)| a.as_f64() - b.as_f64()));
    let error = off / most(&mut held.iter().map(|a| a.as_f64()));
    let (after, report) = stroke.release().unwrap();
    assert_eq!(after.sha256(), field.sha256());
    (error, report)
}

#[test]
fn elastic_strokes_end_in_balance_and_leave_the_field() {
    for rule in ["arrive", "compliance"] {
        for (along, lift) in [
            ("[[12.1, 11.8, 12]]", 1.92),
            ("[[9, 12, 12], [15, 12, 12]]", -1.2),
        ] {
            let text = format!(
                "along = {along}\nlift = {lift}\nradius = {R}\nhow = {{ solid = 'elastic', rule = '{rule}' }}"
            );
            let (error, report) = static_error::<f64>(&text);
            println!("{text} {error:e} {report:?}");
            assert!(error < 1e-6, "{text}: {error}");
            let (error, _) = static_error::<f32>(&text);
            println!("{error:e}");
            assert!(error < 1e-4, "{text}: {error}");
            if rule == "arrive" || report.paths == 1 {
                // b/(1 + b) of the way.
                assert!((report.arrival.least - 0.8).abs() < 0.02, "{text}: {report:?}");
            }
        }
    }
}

#[test]
fn painted_matter_shows() {
    let field = block::<f32>(24);
    let paint = "[[stroke]]\npaint = { layer = 'stiffness', formula = '1 + 9 * (x < 12)' }";
    let session: Session = toml::from_str(paint).unwrap();
    let canvas = Canvas::alone(field.clone(), ISO, 0);
    let (canvas, _) = session.stroke[0].apply(canvas, &mut Control::default()).unwrap();
    let travel = |x: f64, rule: &str| {
        let text = format!(
            "along = [[{x}, 12, 12]]\nlift = 1.2\nradius = {R}\nhow = {{ solid = 'elastic', rule = '{rule}', gain = 0.1 }}"
        );
        let mut stroke = pull(&text)
            .begin(&field, ISO)
            .unwrap()
            .painted(&canvas.layers)
            .unwrap();
        for _ in 0..40 {
            stroke.step().unwrap();
        }
        let mut region = stroke.region().clone();
        let held = region
            .static_response(Against::Painted, &[stroke.load()])
            .unwrap()[0]
            .p
            .clone();
        let now = &region.patch().state().p;
        let most = |list: &[f32]| list.iter().fold(0.0, |m: f32, v| m.max(v.abs()));
        let off: Vec<f32> = held.iter().zip(now).map(|(a, b)| a - b).collect();
        assert!(
            most(&off) < 1e-3 * most(&held),
            "{text}: {} of {}",
            most(&off),
            most(&held)
        );
        stroke.release().unwrap().1.arrival.least
    };
    let (stiff, soft) = (travel(9.0, "compliance"), travel(15.0, "compliance"));
    println!("{stiff} {soft}");
    assert!(stiff < 0.2 * soft, "{stiff} {soft}");
    // Every side arrives where it has to.
    let (stiff, soft) = (travel(9.0, "arrive"), travel(15.0, "arrive"));
    assert!((stiff / soft - 1.0).abs() < 0.02, "{stiff} {soft}");
}

#[test]
fn clay_stays_to_the_bit() {
    let field = block::<f32>(24);
    let text = format!("along = [[12.1, 11.8, 12]]\nlift = 1.92\nradius = {R}");
    let (after, _) = pulled(&field, &text);
    assert_eq!(after.sha256(), pulled(&field, &text).0.sha256());
    let stroke = pull(&text).begin(&after, ISO).unwrap();
    let cells = *stroke.region().cells();
    let mut region = Region::new(
        &after,
        cells,
        Matter::default(),
        &RegionOptions::of(&after, cells.level),
    )
    .unwrap();
    for _ in 0..10 {
        region.patch_mut().step(Integrator::Paper, 0.1).unwrap();
    }
    assert!(region.patch().state().p.iter().all(|p| *p == 0.0));
    assert_eq!(region.bake(&after).unwrap().sha256(), after.sha256());
}

#[test]
fn grooves_and_ridges_have_their_depth() {
    // Longer than two stages, bent, and across itself.
    let text = "along = [[5, 10, 12], [18, 10, 12], [18, 14, 12], [11, 8, 12]]\ndepth = 0.4\nradius = 0.6";
    let tool: Chisel = toml::from_str(text).unwrap();
    let field = block::<f32>(24);
    for (grows, depth) in [(false, -0.4), (true, 0.4)] {
        let (after, report) = finished(tool.begin(&field, ISO, grows).unwrap());
        assert!(report.cuts > 2);
        println!("{report:?}");
        for i in 0..=26 {
            let found = height(&after, 5.0 + 0.5 * f64::from(i), 10.0) / depth;
            println!("{i} {found}");
            assert!((found - 1.0).abs() < 0.02, "{i}: {found}");
        }
    }
}

/// Pieces, and handles of all, of what a session leaves of a field.
fn topology(field: &HierarchicalSpline<f32>, script: &str) -> (u64, i64) {
    let session: Session = toml::from_str(script).unwrap_or_else(|e| panic!("{e}"));
    let mut canvas = Canvas::alone(field.clone(), ISO, 0);
    for stroke in &session.stroke {
        let (after, notes) = stroke
            .apply(canvas, &mut Control::default())
            .unwrap_or_else(|e| panic!("{e}"));
        println!("{notes:?}");
        canvas = after;
    }
    let frame = Frame {
        world_from_grid: DAffine3::from_scale(DVec3::splat(0.25)),
        cells: [96; 3],
    };
    let options = PolygonizeOptions {
        iso: ISO,
        ..Default::default()
    };
    let (mesh, _) = polygonize(&canvas.field, &frame, &options).unwrap();
    let check = check_mesh(&mesh);
    assert!(check.is_closed_manifold());
    println!("{check:?}");
    (
        check.components,
        check.components as i64 - check.euler_characteristic / 2,
    )
}

#[test]
fn drills_cut_and_joins_bridge() {
    let plate = field_of(24, |p: DVec3| {
        let q = (p - 12.0).abs() - DVec3::new(8.0, 6.0, 1.6);
        -(q.max(DVec3::ZERO).length() + q.max_element().min(0.0))
    });
    assert_eq!(topology(&plate, "stroke = []"), (1, 0));
    let hole = "[[stroke]]\ndrill = { along = [[12, 12, 13.6]], by = [0, 0, -6], radius = 1.0 }";
    assert_eq!(topology(&plate, hole), (1, 1));
    let cut =
        "[[stroke]]\ndrill = { along = [[12, 6, 13.6], [12, 18, 13.6]], by = [0, 0, -6], radius = 1.0 }";
    assert_eq!(topology(&plate, cut), (2, 0));
    let balls: Vec<Arc<dyn Field>> = [7.0, 17.0]
        .map(|x| Arc::new(Sphere::new(DVec3::new(x, 12.0, 12.0), 3.5).unwrap()) as Arc<dyn Field>)
        .into();
    let both = Csg::union(balls).unwrap();
    let both = field_of(24, |p| both.value(p));
    assert_eq!(topology(&both, "stroke = []"), (2, 0));
    let bridge = "[[stroke]]\njoin = { along = [[10.5, 12, 12]], by = [5, 0, 0], radius = 1.2 }";
    assert_eq!(topology(&both, bridge), (1, 0));
}

#[test]
fn what_makes_no_sense_is_refused() {
    let field = block::<f32>(24);
    let refused = |text: &str, word: &str| {
        let session = toml::from_str::<Session>(&format!("[[stroke]]\n{text}"));
        let told = match session {
            Err(e) => e.to_string(),
            Ok(session) => {
                let canvas = Canvas::alone(field.clone(), ISO, 0);
                let stroke = &session.stroke[0];
                let done = stroke.apply(canvas, &mut Control::default());
                done.map(|_| ()).expect_err(text).to_string()
            }
        };
        assert!(told.contains(word), "{text}: {told}");
    };
    for (text, word) in [
        (
            "pull = { along = [[nan, 12, 12]], lift = 1, radius = 1 }",
            "finite",
        ),
        (
            "pull = { along = [[12, 12, 12]], by = [0, 0, 0], radius = 1 }",
            "no length",
        ),
        (
            "pull = { along = [[12, 12, 12]], lift = 0, radius = 1 }",
            "no length",
        ),
        (
            "pull = { along = [[12, 12, 12]], lift = 1, radius = 0 }",
            "above 0",
        ),
        (
            "pull = { along = [[12, 12, 12]], lift = 1, radius = 1e-9 }",
            "too small",
        ),
        (
            "pull = { along = [[12, 12, 12]], lift = 100, radius = 1 }",
            "stay within",
        ),
        (
            "pull = { along = [[12, 12, 12]], lift = 1, radius = 1e9 }",
            "wider than the field",
        ),
        (
            "pull = { along = [[12, 12, 60]], lift = 1, radius = 1 }",
            "stay within",
        ),
        (
            "pull = { along = [[12, 12, 20]], lift = 1, radius = 1 }",
            "no surface",
        ),
        (
            "pull = { along = [], lift = 1, radius = 1 }",
            "at least one point",
        ),
        ("pull = { along = [[12, 12, 12]], radius = 1 }", "exactly one"),
        (
            "pull = { along = [[12, 12, 12]], lift = 1, by = [0, 0, 1], radius = 1 }",
            "exactly one",
        ),
        (
            "pull = { along = [[12, 12, 12], [13, 12, 12]], disc = 2, lift = 1, radius = 1 }",
            "one middle",
        ),
        (
            "pull = { along = [[12, 12, 12]], lift = 1, radius = 1, strength = 2 }",
            "strength",
        ),
        (
            "pull = { along = [[12, 12, 12]], lift = 1, radius = 1, how = { rule = { raw = -1 } } }",
            "above 0",
        ),
        (
            "pull = { along = [[12, 12, 12]], lift = 1, radius = 1, how = { filter = { formula = 'x +' } } }",
            "ends too early",
        ),
        (
            "pull = { along = [[12, 12, 12]], lift = 1, radius = 1, how = { filter = { formula = '1/(d-d)' } } }",
            "finite",
        ),
        (
            "drill = { along = [[12, 12, 12]], by = [0, 0, 3], radius = 1 }",
            "turn it round",
        ),
        (
            "join = { along = [[12, 12, 12]], by = [0, 0, -3], radius = 1 }",
            "turn it round",
        ),
        (
            "chisel = { along = [[1, 1, 12], [23, 23, 12]], depth = 0.1, radius = 0.001 }",
            "paths",
        ),
    ] {
        refused(text, word);
    }
    let none = Target::single(Path::through([DVec3::ZERO, DVec3::X]).unwrap(), true);
    let how = How {
        rule: Rule::Arrive,
        solid: Some(Solid::Clay),
        ..How::default()
    };
    assert!(ForceStroke::new(&field, ISO, Vec::new(), Extent::Curve, R, &how).is_err());
    // Nothing to take hold of: no panic, and nothing changes.
    let stroke = ForceStroke::new(&field, -1e9, vec![none], Extent::Curve, R, &how).unwrap();
    assert_eq!(finished(stroke).0.sha256(), field.sha256());
    let _: Drill = toml::from_str("along = [[0, 0, 0]]\nby = [0, 0, 1]\nradius = 1").unwrap();
}
