//! Strokes on both sides of a plane.

use bspline::Field;
use bspline::hierarchical::HierarchicalSpline;
use fitting::Control;
use glam::DVec3;
use tools::coefficients::coefficient;
use tools::paint::{Substance, values};

use super::{Canvas, ISO, block, block_of, canvas, done, random, stroke};

/// Whether the field is even about the middle of its box along x, to the bit.
fn is_even(field: &HierarchicalSpline<f32>) -> bool {
    is_even_along(field, 0)
}

/// The same along an axis.
fn is_even_along(field: &HierarchicalSpline<f32>, axis: usize) -> bool {
    (0..field.level_count()).all(|level| {
        let last = field.lattice().cells_at(level)[axis] + 2;
        field.corrections(level).iter().all(|(key, functions)| {
            functions.iter().all(|(slot, value)| {
                let at = [slot / 64, slot / 8 % 8, slot % 8];
                let mut function: [u32; 3] = std::array::from_fn(|a| key.0[a] * 8 + at[a] as u32);
                function[axis] = last - function[axis];
                coefficient(field, level, function) == Some(value)
            })
        })
    })
}

/// New blocks are even about the middle of every axis, to the bit, whatever their lengths, and a stroke on both sides leaves them so.
#[test]
fn new_blocks_are_even_to_the_bit() {
    for (size, spacing) in [([4.0, 3.0, 2.0], 0.25), ([4.0, 4.1, 4.3], 0.3), ([7.0; 3], 0.25)] {
        let size = DVec3::from_array(size);
        let field = block_of(size, spacing, &mut Control::default()).unwrap();
        for axis in 0..3 {
            assert!(is_even_along(&field, axis), "{size} {axis}");
        }
        let mut off = 0.0_f64;
        let mut draw = random(5);
        for _ in 0..2000 {
            let p = 0.6 * size * DVec3::new(draw(-1.0, 1.0), draw(-1.0, 1.0), draw(-1.0, 1.0));
            let b = 0.5 * size - p.abs();
            // Away from the rounded edges it is the distance to the nearest face.
            if p.abs().cmplt(0.5 * size).all() && b.min_element() < 2.0 * spacing {
                let mut sides = b.to_array();
                sides.sort_by(f64::total_cmp);
                if sides[1] > 4.0 * spacing {
                    off = off.max((field.value(p) - sides[0]).abs());
                }
            }
        }
        assert!(off < 0.05 * spacing, "{size}: {off}");
        let text = format!(
            "symmetry = {{ at = [0, 0, 0], normal = [1, 0, 0] }}\ninflate = {{ along = [[0.1, 0.2, {}]], radius = 0.8, by = 0.2 }}",
            0.5 * size.z
        );
        let left = stroke(&text).apply(Canvas::alone(field, 0.0, 0), &mut Control::default());
        assert!(is_even(&left.unwrap().0.field), "{size}");
    }
}

/// Height of the surface above a place, where a solid ends within 3 of it.
fn height(field: &HierarchicalSpline<f32>, x: f64, y: f64) -> f64 {
    let (mut low, mut high) = (-0.5, 3.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if field.value(DVec3::new(x, y, middle)) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// A stroke over the plane acts once: its lengths are as told, on an object that is even, on one that is nearly so, and on one that is not;
/// and one that lies on one side is the same on both.
#[test]
fn strokes_over_the_plane_act_once() {
    let even = block_of(DVec3::new(4.0, 3.0, 2.0), 0.25, &mut Control::default()).unwrap();
    let with = |field: &HierarchicalSpline<f32>, text: &str| {
        let left = stroke(text).apply(Canvas::alone(field.clone(), 0.0, 0), &mut Control::default());
        left.unwrap_or_else(|e| panic!("{text}: {e}")).0.field
    };
    let uneven = with(
        &even,
        "carve = { shape = { sphere = { radius = 0.3 } }, along = [[0.1, -0.9, 1.0]] }",
    );
    let rounding = |field: &HierarchicalSpline<f32>| {
        let change = bspline::hierarchical::BlockEdit {
            level: 0,
            first: [12, 12, 12],
            shape: [1; 3],
            change: bspline::hierarchical::Change::Add(vec![2e-5]),
        };
        field.edited_blocks(&[change]).unwrap()
    };
    let near = rounding(&even);
    for x in [0.0, 0.3] {
        for tool in [
            format!("pull = {{ along = [[{x}, 0.2, 1]], lift = 0.5, radius = 0.4 }}"),
            format!("inflate = {{ along = [[{x}, 0.2, 1]], radius = 1, by = 0.3 }}"),
            format!("chisel = {{ along = [[{x}, -0.3, 1], [{x}, 0.6, 1]], depth = 0.2, radius = 0.3 }}"),
            format!("push = {{ along = [[{x}, 0.2, 1]], radius = 1, speed = 0.2, force = -1 }}"),
        ] {
            let both = format!("symmetry = {{ at = [0, 0, 0], normal = [1, 0, 0] }}\n{tool}");
            for (name, field) in [("even", &even), ("near", &near), ("uneven", &uneven)] {
                let (one, two) = (with(field, &tool), with(field, &both));
                let once = height(&one, x, 0.2) - height(field, x, 0.2);
                let twice = height(&two, x, 0.2) - height(field, x, 0.2);
                let other = height(&two, -x, 0.2) - height(field, -x, 0.2);
                let most = 0.03 * once.abs();
                assert!(once.abs() > 0.15, "{name} {tool}: {once}");
                assert!((twice - once).abs() < most, "{name} {tool}: {once} {twice}");
                assert!((other - twice).abs() < most, "{name} {tool}: {twice} {other}");
                assert!(name != "even" || is_even(&two), "{tool}");
            }
        }
    }
}

/// About a plane of the lattice an even field stays even to the bit, beside the plane and over it, whatever the tool.
#[test]
fn strokes_about_a_plane_of_the_lattice_are_even_to_the_bit() {
    let mut field = block();
    let mut draw = random(7);
    for n in 0..12 {
        let (x, y) = (draw(7.0, if n % 2 == 0 { 8.0 } else { 12.5 }), draw(6.0, 18.0));
        let tool = [
            format!("carve = {{ shape = {{ sphere = {{ radius = 1.3 }} }}, along = [[{x}, {y}, 12]] }}"),
            format!(
                "add = {{ shape = {{ capsule = {{ axis = [1, 1, 1], radius = 0.8, height = 2.0 }} }}, along = [[{x}, {y}, 12]] }}"
            ),
            format!(
                "move = {{ motion = {{ grab = {{ along = [[{x}, {y}, 12], [{x}, {y}, 13.5]], radius = 2.0 }} }} }}"
            ),
            format!("inflate = {{ along = [[{x}, {y}, 12]], radius = 2.0, by = 0.5 }}"),
            format!("smooth = {{ along = [[{x}, {y}, 12]], radius = 3.0, level = 2 }}"),
            format!(
                "sweep = {{ operation = 'carve', shape = {{ sphere = {{ radius = 0.9 }} }}, along = {{ spline = {{ through = [[{x}, {y}, 12], [{x}, {}, 11]] }} }} }}",
                y + 2.0
            ),
        ];
        let before = field.sha256();
        let normal = if n % 3 == 0 { "[1, 0, 0]" } else { "[-2, 0, 0]" };
        let text = format!(
            "symmetry = {{ at = [12, 3, 4], normal = {normal} }}\n{}",
            tool[n % 6]
        );
        field = done(&field, &text);
        assert!(is_even(&field), "{text}");
        assert!(field.sha256() != before || n % 6 == 4, "{text}");
    }
}

/// About any other plane, both sides come out to the tolerance; and a solid that is not even is shaped on both sides as it is.
#[test]
fn strokes_about_any_plane_happen_on_both_sides() {
    let field = block();
    let tool = "carve = { shape = { sphere = { radius = 2.0 } }, along = [[8.1, 10.2, 12.3]] }";
    let (at, normal) = (
        DVec3::new(12.03, 12.0, 12.0),
        DVec3::new(1.0, 0.3, 0.0).normalize(),
    );
    let text = format!(
        "symmetry = {{ at = {:?}, normal = {:?} }}\n{tool}",
        at.to_array(),
        normal.to_array()
    );
    let left = done(&field, &text);
    let mut draw = random(8);
    let mut count = 0;
    for _ in 0..4000 {
        let p = DVec3::new(draw(5.0, 11.0), draw(7.0, 13.0), draw(9.5, 12.5));
        let other = p - 2.0 * normal * normal.dot(p - at);
        let (a, b) = (left.value_gradient(p), left.value_gradient(other));
        if (a.0 - ISO).abs() < 0.1 * a.1.length()
            && p.distance(DVec3::new(8.1, 10.2, 12.3)) < 2.2
            && p.z < 11.0
        {
            count += 1;
            let off = (a.0 - b.0).abs() / a.1.length();
            assert!(off < 0.02, "{p}: {off}");
        }
    }
    assert!(count > 50, "{count}");
}

/// What is painted and what is held comes along on both sides, and a brush paints on both.
#[test]
fn paint_and_holds_go_to_both_sides() {
    let both = "symmetry = { at = [12, 12, 12], normal = [1, 0, 0] }";
    let strokes = [
        format!(
            "{both}\npaint = {{ layer = 'stiffness', brush = {{ value = 9, along = [[6, 12, 12]], radius = 3, rate = 0.5 }} }}"
        ),
        format!(
            "{both}\npaint = {{ layer = 'mass', brush = {{ value = 2, along = [[11, 8, 12]], radius = 3 }} }}"
        ),
        "hold = { name = 'both', points = [[6, 12, 12], [18, 12, 12], [12, 20, 12]] }".into(),
        format!(
            "{both}\nmove = {{ motion = {{ grab = {{ along = [[6, 12, 12], [6, 12, 14]], radius = 3, rigid = 1 }} }} }}"
        ),
    ];
    let mut left = canvas(&block());
    for text in &strokes {
        left = stroke(text).apply(left, &mut Control::default()).unwrap().0;
    }
    let at = |substance, p: [f64; 3]| values(&left.layers, substance, &[DVec3::from_array(p)]).unwrap()[0];
    assert!(is_even(&left.field));
    assert!((at(Substance::Stiffness, [6.0, 12.0, 14.0]) - 5.0).abs() < 1e-6);
    let mut draw = random(3);
    for _ in 0..200 {
        let [x, y, z] = [draw(0.0, 24.0), draw(0.0, 24.0), draw(6.0, 18.0)];
        for substance in [Substance::Stiffness, Substance::Mass] {
            let [one, other] = [[x, y, z], [24.0 - x, y, z]].map(|p| at(substance, p));
            assert!(
                (one - other).abs() < 1e-5,
                "{substance:?} {x} {y} {z}: {one} {other}"
            );
        }
    }
    let places: Vec<_> = left.holds[0].lines.iter().map(|line| line[0].0).collect();
    let expected = [[6.0, 12.0, 14.0], [18.0, 12.0, 14.0], [12.0, 20.0, 12.0]];
    for (found, expected) in places.iter().zip(expected) {
        assert!(found.abs_diff_eq(DVec3::from_array(expected), 1e-9), "{places:?}");
    }
    let formula = format!("{both}\npaint = {{ layer = 'mass', formula = '2 + x' }}");
    let told = stroke(&formula)
        .apply(left, &mut Control::default())
        .unwrap_err()
        .to_string();
    assert!(told.contains("both sides"), "{told}");
}
