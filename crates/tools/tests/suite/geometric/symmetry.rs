//! Strokes on both sides of a plane.

use bspline::Field;
use bspline::hierarchical::HierarchicalSpline;
use fitting::Control;
use glam::DVec3;
use tools::coefficients::coefficient;
use tools::paint::{Substance, values};

use super::{ISO, block, canvas, done, random, stroke};

/// Whether the field is even about the middle of its box along x, to the bit.
fn is_even(field: &HierarchicalSpline<f32>) -> bool {
    (0..field.level_count()).all(|level| {
        let last = field.lattice().cells_at(level)[0] + 2;
        field.corrections(level).iter().all(|(key, functions)| {
            functions.iter().all(|(slot, value)| {
                let at = [slot / 64, slot / 8 % 8, slot % 8];
                let mut function: [u32; 3] = std::array::from_fn(|a| key.0[a] * 8 + at[a] as u32);
                function[0] = last - function[0];
                coefficient(field, level, function) == Some(value)
            })
        })
    })
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
