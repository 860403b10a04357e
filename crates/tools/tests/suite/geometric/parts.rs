//! Parts cut, copied and pasted.

use bspline::Field;
use bspline::hierarchical::HierarchicalSpline;
use fitting::Control;
use glam::{DAffine3, DVec3};
use tools::canvas::Canvas;

use super::{ISO, apply, block, canvas, random, refused, stroke};

/// What a stroke leaves beside another object, "clip".
fn beside(
    field: &HierarchicalSpline<f32>,
    clip: &HierarchicalSpline<f32>,
    text: &str,
) -> HierarchicalSpline<f32> {
    let mut canvas: Canvas = canvas(field);
    canvas
        .others
        .put("clip", &clip.clone().into(), ISO, DAffine3::IDENTITY, false)
        .unwrap();
    let left = stroke(text).apply(canvas, &mut Control::default());
    left.unwrap_or_else(|e| panic!("{text}: {e}")).0.field
}

fn bump() -> HierarchicalSpline<f32> {
    let ball = "shape = { sphere = { radius = 2.0 } }, along = [[8, 12, 12]], blend = 0.5";
    apply(&block(), tools::geometric::Operation::Add, ball)
}

/// Distances between the two surfaces at places at random near them: what 99 % stay below, and the largest.
fn off(a: &HierarchicalSpline<f32>, b: &HierarchicalSpline<f32>, shift: DVec3) -> [f64; 2] {
    let mut draw = random(9);
    let mut all = Vec::new();
    for _ in 0..20_000 {
        let p = DVec3::new(draw(4.0, 12.0), draw(8.0, 16.0), draw(10.0, 15.0));
        let (value, gradient) = a.value_gradient(p);
        if (value - ISO).abs() < 0.2 * gradient.length() {
            all.push((value - b.value(p + shift)).abs() / gradient.length());
        }
    }
    all.sort_by(f64::total_cmp);
    [all[all.len() * 99 / 100], all[all.len() - 1]]
}

#[test]
fn cut_and_pasted_in_place_nothing_has_changed() {
    let field = bump();
    let region = "region = { min = [5, 9, 11], max = [11, 15, 16] }";
    let text = format!("cut = {{ {region}, to = \"clip\" }}");
    let (left, _) = stroke(&text)
        .apply(canvas(&field), &mut Control::default())
        .unwrap();
    assert_eq!(left.copies, ["clip"]);
    assert!(left.field.value(DVec3::new(8.0, 12.0, 13.0)) < ISO);
    let back = beside(
        &left.field,
        &field,
        &format!("paste = {{ from = \"clip\", {region} }}"),
    );
    assert_ne!(left.field.sha256(), field.sha256());
    assert_eq!(
        back.sha256(),
        field.sha256(),
        "the coefficients themselves come back"
    );
    // What was done beside it in between stays, and so does what a mask keeps.
    let ball = "add = { shape = { sphere = { radius = 1.5 } }, along = [[17, 12, 12]] }";
    let (more, _) = stroke(ball)
        .apply(canvas(&left.field), &mut Control::default())
        .unwrap();
    let paste = format!("paste = {{ from = \"clip\", {region} }}");
    let both = beside(&more.field, &field, &paste);
    let [_, largest] = off(&field, &both, DVec3::ZERO);
    assert!(largest < 0.02 * 0.25, "{largest}");
    assert!(both.value(DVec3::new(17.0, 12.0, 13.3)) > ISO);
    let half = beside(
        &left.field,
        &field,
        &format!("{paste}\nwithin = {{ min = [0, 0, 0], max = [8, 24, 24] }}"),
    );
    for p in [[8.3, 11.0, 13.0], [12.0, 12.0, 12.0]].map(DVec3::from_array) {
        assert_eq!(half.value(p), left.field.value(p), "{p}");
    }
}

#[test]
fn a_pasted_part_is_the_part_elsewhere() {
    let field = bump();
    let text = "paste = { from = \"clip\", region = { min = [4.5, 8.5, 10], max = [11.5, 15.5, 15] }, by = [9, 0, 0], blend = 1 }";
    let both = beside(&field, &field, text);
    let [_, largest] = off(&field, &both, DVec3::X * 9.0);
    assert!(largest < 0.02, "{largest}");
    // Turned, twice as large: its top is where it should be.
    let text = "paste = { from = \"clip\", region = { min = [5, 9, 12], max = [11, 15, 14.5] }, by = [6, 0, 1.25], turn = [0, 0, 90], scale = 1.5, blend = 1 }";
    let large = beside(&block(), &field, text);
    let top = DVec3::new(14.0, 12.0, 14.5 + 1.5 * 0.75);
    let (value, gradient) = large.value_gradient(top);
    assert!((value - ISO).abs() < 0.03 * gradient.length(), "{value}");
}

/// A passage narrower than splines can be throws up no specks of solid in the empty space about what is pasted.
#[test]
fn narrow_passages_leave_empty_space_empty() {
    let block = block();
    let half = DVec3::new(4.0, 3.3, 2.7);
    let inside = |p: DVec3| 1.0 - ((p - 12.0) / half).length();
    let clip = HierarchicalSpline::schoenberg(*block.lattice(), block.slope(), |p| {
        ISO + 2.7 * block.slope() * inside(p)
    })
    .unwrap();
    for margin in [0.5, 1.0] {
        let [min, max] = [-1.0, 1.0].map(|side| (12.0 + side * (half + margin)).to_array());
        for blend in [0.1, 0.25, 0.5] {
            let text = format!(
                "paste = {{ from = \"clip\", region = {{ min = {min:?}, max = {max:?} }}, by = [0, 0, 5.5], blend = {blend} }}"
            );
            let both = beside(&block, &clip, &text);
            for n in 0..40u32.pow(3) {
                let p = DVec3::from([n / 1600, n / 40 % 40, n % 40].map(|n| 0.6 * f64::from(n)));
                let is_air = p.z > 12.5 && inside(p - DVec3::Z * 5.5) < -0.15;
                assert!(!is_air || both.value(p) < ISO, "{margin} {blend}: {p}");
            }
        }
    }
}

#[test]
fn parts_that_make_no_sense_are_refused() {
    let field = block();
    for (text, why) in [
        (
            "cut = { region = { min = [9, 9, 9], max = [9, 12, 12] } }",
            "no size",
        ),
        (
            "paste = { from = \"cow\", region = { min = [9, 9, 9], max = [10, 12, 12] } }",
            "cow",
        ),
        (
            "symmetry = { at = [0, 0, 0], normal = [0, 0, 0] }\ncut = { region = { min = [9, 9, 9], max = [10, 12, 12] } }",
            "no direction",
        ),
    ] {
        let error = refused(&field, text);
        assert!(error.contains(why), "{text}: {error}");
    }
}
