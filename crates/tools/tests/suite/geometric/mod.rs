//! Geometric tools: volumes, what stays, and what is refused.

mod brushes;
mod interior;
mod limits;
mod moves;
mod parts;
mod push;
mod sweeps;
mod symmetry;

use std::f64::consts::PI;
use std::sync::Arc;

use bspline::hierarchical::{HierarchicalSpline, Lattice};
use bspline::polygonize::{PolygonizeOptions, check_mesh, polygonize};
use bspline::{Aabb, Field, Frame};
use fitting::Control;
use glam::{DAffine3, DVec3};
use tools::canvas::Canvas;
use tools::geometric::{Geometric, GeometricError, Operation, block as block_of};
use tools::limits::Limits;
use tools::malleable::Malleable;
use tools::others::Others;
use tools::session::{Session, Stroke};

/// Cells of the block's box, half a world length each.
const CELLS: u32 = 48;

/// What lies below `z = 12` in a box of 24³, with a slope that is not 1: exact in splines.
fn block() -> HierarchicalSpline<f32> {
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_scale(DVec3::splat(0.5)),
        cells: [CELLS; 3],
    };
    HierarchicalSpline::schoenberg(lattice, SLOPE, |p| SLOPE * (12.0 - p.z) + ISO).unwrap()
}

const SLOPE: f64 = 40.0;
const ISO: f64 = 300.0;

/// A stroke as a session writes it.
fn stroke(text: &str) -> Stroke {
    toml::from_str(text).unwrap_or_else(|e| panic!("{text}: {e}"))
}

/// A canvas with nothing beside it.
fn canvas(field: &HierarchicalSpline<f32>) -> Canvas {
    Canvas::alone(field.clone(), ISO, 0)
}

/// What a stroke leaves.
fn done(field: &HierarchicalSpline<f32>, text: &str) -> HierarchicalSpline<f32> {
    let left = stroke(text).apply(canvas(field), &mut Control::default());
    left.unwrap_or_else(|e| panic!("{text}: {e}")).0.field
}

/// Why a stroke is refused.
fn refused(field: &HierarchicalSpline<f32>, text: &str) -> String {
    let left = stroke(text).apply(canvas(field), &mut Control::default());
    left.expect_err(text).to_string()
}

/// Numbers at random between two bounds, the same for the same seed.
fn random(seed: u64) -> impl FnMut(f64, f64) -> f64 {
    let mut state = seed.wrapping_mul(2).wrapping_add(1);
    move |low, high| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 40) as f64 / (1u64 << 24) as f64
    }
}

fn tool(text: &str) -> Geometric {
    stroke(&format!("carve = {{ {text} }}")).carve.unwrap()
}

fn apply(field: &HierarchicalSpline<f32>, operation: Operation, text: &str) -> HierarchicalSpline<f32> {
    let done = tool(text).apply(
        operation,
        field,
        ISO,
        &Others::default(),
        &Limits::default(),
        &mut Control::default(),
    );
    let (field, report) = done.unwrap();
    assert_eq!(report.left.unwrap().wrong_signs, 0, "{text}");
    field
}

/// Volume of the solid.
fn volume(field: &dyn Field) -> f64 {
    let frame = Frame {
        world_from_grid: DAffine3::from_scale(DVec3::splat(0.125)),
        cells: [4 * CELLS; 3],
    };
    let options = PolygonizeOptions {
        iso: ISO,
        ..Default::default()
    };
    let (mesh, _) = polygonize(field, &frame, &options).unwrap();
    let check = check_mesh(&mesh);
    assert!(check.is_closed_manifold());
    check.volume
}

/// Both ways, half of a tool whose centre is on the block's face is taken or put.
#[test]
fn tools_take_and_put_their_volume() {
    let block = block();
    let before = volume(&block);
    for (text, whole) in [
        ("shape = { sphere = { radius = 4.0 } }", 4.0 / 3.0 * PI * 64.0),
        ("shape = { box = { size = [6.0, 7.0, 8.0] } }", 336.0),
        (
            "shape = { cylinder = { axis = [0, 0, 2], radius = 3.0, height = 8.0 } }",
            72.0 * PI,
        ),
        (
            "shape = { capsule = { axis = [1, 0, 0], radius = 3.0, height = 6.0 } }",
            (54.0 + 36.0) * PI,
        ),
        (
            "shape = { torus = { axis = [0, 0, 1], major = 6.0, minor = 2.0 } }",
            2.0 * PI * PI * 24.0,
        ),
    ] {
        let text = format!("{text}, along = [[12.0, 12.0, 12.0]], finer = 2");
        for (operation, sign) in [(Operation::Carve, -1.0), (Operation::Add, 1.0)] {
            let changed = sign * (volume(&apply(&block, operation, &text)) - before);
            assert!(
                (changed / (0.5 * whole) - 1.0).abs() < 0.005,
                "{operation:?} {text}: {changed} of {}",
                0.5 * whole
            );
        }
    }
}

/// Cubes, plates and rods of few and many intervals: their own volume, faces where they belong, room about them.
#[test]
fn a_block_is_as_large_as_asked() {
    for (size, spacing) in [
        ([10.0, 6.0, 4.0], 0.2),
        ([1.0, 1.0, 1.0], 0.25),
        ([40.0, 2.0, 2.0], 0.5),
        ([3e3, 3e3, 200.0], 50.0),
        ([2e-6, 1e-6, 1e-6], 1e-7),
    ] {
        let size = DVec3::from_array(size);
        let made = block_of(size, spacing, &mut Control::default()).unwrap();
        let within = made.lattice().world_box();
        assert!(within.max.cmpge(0.9 * size).all() && within.min.cmple(-0.9 * size).all());
        // The middles of the faces.
        for axis in 0..3 {
            for side in [-0.5, 0.5] {
                let mut face = DVec3::ZERO;
                face[axis] = side * size[axis];
                let off = made.value(face).abs();
                assert!(off <= 0.05 * spacing, "{size}: face {face} is off by {off}");
            }
        }
        let frame = Frame::over(&within, (within.size() / spacing * 4.0).as_uvec3().to_array());
        let (mesh, _) = polygonize(&made, &frame, &PolygonizeOptions::default()).unwrap();
        let check = check_mesh(&mesh);
        assert!(check.is_closed_manifold());
        // Edges are rounded by an interval and a half, or a quarter of the shortest edge; no corner stands out.
        let r = (1.5 * spacing).min(0.25 * size.min_element());
        let inner = size - 2.0 * r;
        let faces = 4.0 * r * (inner.x * inner.y + inner.y * inner.z + inner.z * inner.x) / 2.0;
        let round = PI * r * r * inner.element_sum() + 4.0 / 3.0 * PI * r.powi(3);
        let (found, whole) = (check.volume, inner.element_product() + faces + round);
        assert!((found - whole).abs() < 0.01 * whole, "{size}: {found} of {whole}");
        let out = mesh
            .positions
            .iter()
            .map(|p| (p.abs() - 0.5 * size).max_element());
        let lip = out.fold(0.0, f64::max);
        assert!(lip < 0.06 * spacing, "{size}: a lip of {lip}");
    }
    for (size, spacing) in [
        (DVec3::ONE, 0.6),
        (DVec3::ONE, f64::NAN),
        (DVec3::ZERO, 0.1),
        (DVec3::ONE, 1e-9),
    ] {
        let refused = block_of(size, spacing, &mut Control::default());
        assert!(matches!(refused, Err(GeometricError::Shape(_))));
    }
}

/// A sweep has no gaps and takes the same at any spacing of its poses. All go through the face of the block, so half counts.
#[test]
fn swept_tools_take_the_same_at_any_spacing_of_poses() {
    let block = block();
    let before = volume(&block);
    let along = |from: [f64; 2], to: [f64; 2], count: usize| {
        let at = |i: usize, a: usize| from[a] + (to[a] - from[a]) * i as f64 / (count - 1) as f64;
        let places: Vec<String> = (0..count)
            .map(|i| format!("[{}, {}, 12.0]", at(i, 0), at(i, 1)))
            .collect();
        format!("along = [{}]", places.join(", "))
    };
    let turned = |count: usize| {
        let turns: Vec<String> = (0..count)
            .map(|i| format!("[0, 0, {}]", 90.0 * i as f64 / (count - 1) as f64))
            .collect();
        format!("turn = [{}]", turns.join(", "))
    };
    let diagonal = |count| along([7.0, 8.0], [15.0, 14.0], count);
    for (shape, way, whole) in [
        (
            "sphere = { radius = 2.0 }",
            &|n| along([7.0, 12.0], [17.0, 12.0], n) as String,
            PI * 4.0 * 10.0 + 4.0 / 3.0 * PI * 8.0,
        ),
        // Its own volume, and what its faces run through.
        (
            "box = { size = [4.0, 3.0, 5.0] }",
            &diagonal,
            60.0 + 8.0 * 15.0 + 6.0 * 20.0,
        ),
        (
            "cylinder = { axis = [0, 0, 1], radius = 2.0, height = 4.0 }",
            &diagonal,
            16.0 * PI + 10.0 * 16.0,
        ),
        (
            "capsule = { axis = [0, 0, 1], radius = 2.0, height = 4.0 }",
            &diagonal,
            16.0 * PI + 32.0 / 3.0 * PI + 10.0 * (16.0 + 4.0 * PI),
        ),
        // Half of it lies in what the other half runs through.
        (
            "torus = { axis = [3, 4, 0], major = 4.0, minor = 1.5 }",
            &|n| along([9.0, 10.0], [12.0, 14.0], n),
            2.0 * PI * 4.0 * (PI * 2.25 + 5.0 * 3.0),
        ),
        (
            "box = { size = [9.0, 2.0, 4.0] }",
            &|n| format!("{}, {}", along([12.0, 12.0], [12.0, 12.0], n), turned(n)),
            4.0 * swept_rectangle(4.5, 1.0),
        ),
    ] as [(&str, &dyn Fn(usize) -> String, f64); 6]
    {
        for count in [2, 5] {
            let text = format!("shape = {{ {shape} }}, {}, finer = 2", way(count));
            let taken = before - volume(&apply(&block, Operation::Carve, &text));
            let off = taken / (0.5 * whole) - 1.0;
            assert!(off.abs() < 0.005, "{shape}, {count} poses: {taken}, off by {off}");
        }
    }
}

/// Area that a rectangle of these half edges runs through when it turns by a right angle about its middle.
fn swept_rectangle(a: f64, b: f64) -> f64 {
    let (side, angles) = (800, 400);
    let reach = (a * a + b * b).sqrt();
    let cell = 2.0 * reach / f64::from(side);
    let is_hit = |x: f64, y: f64| {
        (0..=angles).any(|n| {
            let (sine, cosine) = (0.5 * PI * f64::from(n) / f64::from(angles)).sin_cos();
            (cosine * x + sine * y).abs() <= a && (cosine * y - sine * x).abs() <= b
        })
    };
    let at = |i: i32| (f64::from(i) + 0.5) * cell - reach;
    let hits = (0..side * side)
        .filter(|n| is_hit(at(n / side), at(n % side)))
        .count();
    hits as f64 * cell * cell
}

/// Strokes at random: beyond the tool, its blend and a few knot intervals nothing changes, to the bit; any number of
/// threads gives the same.
#[test]
fn no_coefficient_changes_beyond_the_tool() {
    let block = block();
    let mut random = random(0);
    for _ in 0..20 {
        let (radius, blend) = (random(0.6, 3.0), random(0.0, 1.0));
        let places = [0, 1].map(|_| [random(4.0, 20.0), random(4.0, 20.0), random(9.0, 15.0)]);
        let text =
            format!("shape = {{ sphere = {{ radius = {radius} }} }}, along = {places:?}, blend = {blend}");
        let operation = if random(0.0, 1.0) < 0.5 {
            Operation::Carve
        } else {
            Operation::Add
        };
        let changed = apply(&block, operation, &text);
        let reach = radius + blend + 4.0;
        let [a, b] = places.map(DVec3::from_array);
        let allowed = Aabb::new(a.min(b) - reach, a.max(b) + reach);
        for found in changed.changed_boxes(&block, &block.lattice().world_box()) {
            // Bricks change whole.
            let brick = 8.0 * 0.5;
            assert!(
                found.min.cmpge(allowed.min - brick).all() && found.max.cmple(allowed.max + brick).all(),
                "{text}: {found:?} beyond {allowed:?}"
            );
        }
        let difference = block.difference(&changed).unwrap();
        for brick in &difference.bricks {
            let spacing = 0.5 / f64::from(1u32 << brick.level);
            for slot in 0..512 {
                let value = |side: &Option<Arc<bspline::hierarchical::Corrections<f32>>>| {
                    side.as_ref().and_then(|c| c.get(slot))
                };
                if value(&brick.old) != value(&brick.new) {
                    let at = [slot / 64, slot / 8 % 8, slot % 8];
                    let knot = std::array::from_fn(|a| f64::from(8 * brick.key.0[a] + at[a] as u32) - 1.0);
                    let at = DVec3::from_array(knot) * spacing;
                    let is_within = at.cmpge(allowed.min).all() && at.cmple(allowed.max).all();
                    assert!(is_within, "{text}: the function at {at} changed");
                }
            }
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(7).build().unwrap();
        let again = pool.install(|| apply(&block, operation, &text));
        assert_eq!(again.sha256(), changed.sha256());
    }
}

/// A formula and an object take what a shape of their form takes; a formula masks too.
#[test]
fn carving_air_changes_nothing() {
    let before = block();
    let after = |tool: &str, z: f64| {
        let text = format!("{tool} = {{ along = [[12, 12, {z}]], shape.sphere.radius = 2 }}");
        done(&before, &text).sha256()
    };
    assert_eq!(after("carve", 16.0), before.sha256());
    assert_ne!(after("carve", 13.5), before.sha256());
    assert_ne!(after("add", 16.0), before.sha256());
}

#[test]
fn formulas_and_objects_are_tools() {
    let block = block();
    let before = volume(&block);
    let half_ball = 2.0 / 3.0 * PI * 27.0;
    let formula = "shape = { formula = { text = \"9 - x^2 - y^2 - z^2\", size = [7, 7, 7] } }";
    let taken = before
        - volume(&apply(
            &block,
            Operation::Carve,
            &format!("{formula}, along = [[12, 12, 12]], finer = 2"),
        ));
    assert!((taken / half_ball - 1.0).abs() < 0.005, "{taken} of {half_ball}");
    // What a comparison says is 1 or 0, and on a plateau of 0 there is no solid.
    for text in ["x^2 + y^2 + z^2 < 9", "max(0, 9 - x^2 - y^2 - z^2)"] {
        let tool = format!(
            "shape = {{ formula = {{ text = \"{text}\", size = [7, 7, 7] }} }}, along = [[12, 12, 12]]"
        );
        let left = done(&block, &format!("carve = {{ {tool} }}"));
        let taken = (before - volume(&left)) / half_ball;
        assert!((taken - 1.0).abs() < 0.15, "{text}: {taken}");
        let masked = done(
            &block,
            &format!("mask = {{ formula = \"x < 12\", outside = true }}\ncarve = {{ {tool} }}"),
        );
        let taken = (before - volume(&masked)) / half_ball;
        assert!((0.3..0.6).contains(&taken), "{text}: {taken}");
    }
    // A root of a higher order is a surface, and no plateau.
    let cube = "shape = { formula = { text = \"(0 - z)^3\", size = [6, 6, 6] } }";
    let taken = before
        - volume(&done(
            &block,
            &format!("carve = {{ {cube}, along = [[12, 12, 11]] }}"),
        ));
    assert!((taken / 108.0 - 1.0).abs() < 0.01, "{taken}");
    // The ball on the block, laid into another block as a tool.
    let ball = done(
        &block,
        "add = { shape = { sphere = { radius = 3.0 } }, along = [[12, 12, 12]], finer = 2 }",
    );
    let mut canvas = canvas(&block);
    canvas
        .others
        .put("ball", &ball.clone().into(), ISO, DAffine3::IDENTITY, false)
        .unwrap();
    let text = "within = { min = [6, 6, 12.5], max = [18, 18, 20] }
        add = { shape = { object = { name = \"ball\" } }, along = [[12, 12, 13]], finer = 2 }";
    let (left, _) = stroke(text).apply(canvas, &mut Control::default()).unwrap();
    let top = left.field.value(DVec3::new(12.0, 12.0, 16.0)) - ISO;
    assert!(top.abs() < 0.03 * SLOPE, "{top}");
    let masked = done(
        &block,
        &format!(
            "mask = {{ formula = \"x - 12\" }}\ncarve = {{ {formula}, along = [[12, 12, 12]], finer = 2 }}"
        ),
    );
    let taken = before - volume(&masked);
    assert!((0.3..0.52).contains(&(taken / half_ball)), "{taken}");
    for (text, why) in [
        ("formula = { text = \"1/x\", size = [2, 2, 2] }", "x = 0"),
        ("formula = { text = \"1 - x +\", size = [2, 2, 2] }", "too early"),
        (
            "formula = { text = \"1 - x y\", size = [2, 2, 2] }",
            "before \"y\"",
        ),
        ("formula = { text = \"1 - d\", size = [2, 2, 2] }", "reads d"),
        ("object = { name = \"cow\" }", "cow"),
    ] {
        let text = format!("carve = {{ shape = {{ {text} }}, along = [[12, 12, 12]] }}");
        assert!(refused(&block, &text).contains(why), "{text}");
    }
    let two = format!("carve = {{ {formula}, along = [[12, 12, 12], [13, 12, 12]] }}");
    assert!(refused(&block, &two).contains("each = true"));
}

#[test]
fn a_blend_rounds_the_crease_within_its_width() {
    let block = block();
    let at = "along = [[12.0, 12.0, 12.0]], finer = 2";
    let sharp = apply(
        &block,
        Operation::Add,
        &format!("shape = {{ sphere = {{ radius = 4.0 }} }}, {at}"),
    );
    let smooth = apply(
        &block,
        Operation::Add,
        &format!("shape = {{ sphere = {{ radius = 4.0 }} }}, blend = 2.0, {at}"),
    );
    // The fillet adds; far from the crease both have the same surface.
    assert!(volume(&smooth) > volume(&sharp) + 1.0);
    let top = DVec3::new(12.0, 12.0, 16.0);
    let beside = DVec3::new(12.0, 19.0, 12.0);
    for p in [top, beside] {
        let off = |f: &HierarchicalSpline<f32>| (f.value(p) - ISO).abs() / SLOPE;
        assert!(
            off(&sharp) < 0.02 && off(&smooth) < 0.02,
            "{p}: {} {}",
            off(&sharp),
            off(&smooth)
        );
    }
    let in_the_corner = DVec3::new(12.0, 16.2, 12.2);
    assert!(smooth.value(in_the_corner) > ISO && sharp.value(in_the_corner) < ISO);
}

/// Blocks, with knots of their own or not, have lengths that single precision holds.
#[test]
fn blocks_of_lengths_beyond_single_precision_are_refused() {
    for (size, spacing, value) in [
        (1e300, 1e299, "1e300"),
        (1e-40, 1e-41, "1e-40"),
        (1.0, 1e-31, "1e-31"),
    ] {
        let size = DVec3::splat(size);
        let told = block_of(size, spacing, &mut Control::default())
            .unwrap_err()
            .to_string();
        assert!(
            told.contains(value) && told.contains("from 1e-30 to 1e30"),
            "{told}"
        );
        let told = tools::knots::block(size, spacing, [&[], &[], &[]])
            .unwrap_err()
            .to_string();
        assert!(told.contains(value), "{told}");
    }
    for size in [8e29, 4e-30] {
        let left = block_of(DVec3::splat(size), 0.25 * size, &mut Control::default());
        assert!(left.is_ok(), "{size}");
    }
}

/// What works by levels on knots that lie close refuses levels that would be too many, in time.
#[test]
fn knots_too_close_for_levels_are_refused() {
    let field = tools::knots::block(DVec3::new(4.0, 3.0, 2.0), 0.25, [&[0.0, 1e-4, 1.0], &[], &[]]).unwrap();
    let (levels, _) = tools::knots::in_levels(&field, 0.0, &mut Control::default()).unwrap();
    let carve = "carve = { shape = { sphere = { radius = 0.4 } }, along = [[0.5, 0.2, 1.0]] }";
    let canvas = Canvas::alone(levels, 0.0, field.depth() - 1);
    let left = stroke(carve).apply(canvas, &mut Control::default());
    let told = left.expect_err(carve).to_string();
    assert!(told.contains("farther apart"), "{told}");
}

#[test]
fn tools_that_make_no_sense_are_refused() {
    let block = block();
    let refused = |text: &str| {
        tool(text)
            .apply(
                Operation::Carve,
                &block,
                ISO,
                &Others::default(),
                &Limits::default(),
                &mut Control::default(),
            )
            .unwrap_err()
    };
    let error = refused("shape = { sphere = { radius = 1.0 } }, along = []");
    assert!(matches!(error, GeometricError::Shape(_)), "{error}");
    let error = refused(
        "shape = { cylinder = { axis = [0, 0, 0], radius = 1.0, height = 1.0 } }, along = [[9, 9, 9]]",
    );
    assert!(error.to_string().contains("no direction"), "{error}");
    let error =
        refused("shape = { torus = { axis = [0, 0, 1], major = 1.0, minor = 2.0 } }, along = [[9, 9, 9]]");
    assert!(error.to_string().contains("less than"), "{error}");
    let error = refused("shape = { sphere = { radius = 1.0 } }, along = [[99, 99, 99]]");
    assert!(matches!(error, GeometricError::Outside { .. }), "{error}");
    let error = refused(
        "shape = { box = { size = [1, 1, 1] } }, along = [[9, 9, 9], [9, 9, 8], [9, 8, 8]], turn = [[0, 0, 9], [0, 0, 0]]",
    );
    assert!(error.to_string().contains("3 places and 2 turns"), "{error}");
    let error = refused("shape = { sphere = { radius = 1.0 } }, along = [[9, 9, 9]], turn = [[0, 0, 1e300]]");
    assert!(error.to_string().contains("to be an angle"), "{error}");
    let error = refused("shape = { sphere = { radius = 1.0 } }, along = [[9, 9, 12]], finer = 30");
    assert!(
        error.to_string().contains("finer is 30; write 0 to 20"),
        "{error}"
    );
    let error = refused("shape = { sphere = { radius = 3.0 } }, along = [[9, 9, 12]], finer = 20");
    assert!(error.to_string().contains("lower finer"), "{error}");
    for text in [
        "shape = { sphere = { radius = -1.0 } }, along = [[9, 9, 9]]",
        "shape = { sphere = { radius = nan } }, along = [[9, 9, 9]]",
        "shape = { sphere = { radius = 1.0 } }, along = [[9, inf, 9]]",
        "shape = { cube = { size = 1.0 } }, along = [[9, 9, 9]]",
        "shape = { sphere = { radius = 1.0 } }, along = [[9, 9, 9]], blend = -1.0",
        "shape = { sphere = { radius = 1.0 } }, along = [[9, 9, 9]], colour = 1",
    ] {
        let script = format!("\n[[stroke]]\ncarve = {{ {text} }}");
        let error = toml::from_str::<Session>(&script).unwrap_err().to_string();
        assert!(error.contains("line 3"), "{error}");
    }
}
