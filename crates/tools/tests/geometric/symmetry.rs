//! Strokes on both sides of a plane.

use bspline::Field;
use bspline::hierarchical::HierarchicalSpline;
use glam::DVec3;
use tools::coefficients::coefficient;

use super::{ISO, block, done, random};

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
