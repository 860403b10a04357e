//! Strokes near the faces of a field's box.

use super::*;

fn ended(field: &HierarchicalSpline<f32>, stroke: &str) -> Result<(Canvas, Vec<String>), String> {
    let session: Session = toml::from_str(&format!("[[stroke]]\n{stroke}")).unwrap();
    let canvas = Canvas::alone(field.clone(), ISO, 0);
    let left = session.stroke[0].apply(canvas, &mut Control::default());
    left.map_err(|e| e.to_string())
}

/// How far a stroke lifts the top, at (12, 12, `top`), of a ball of radius 8.
fn gained(top: f64, stroke: &str) -> (f64, Vec<String>) {
    let ball = field_of(24, |p| 8.0 - p.distance(DVec3::new(12.0, 12.0, top - 8.0)));
    let (left, notes) = ended(&ball, stroke).unwrap_or_else(|e| panic!("{stroke}: {e}"));
    let is_inside = |z: f64| left.field.value(DVec3::new(12.0, 12.0, z)) > ISO;
    let (mut low, mut high) = (top - 2.0, top + 4.0);
    for _ in 0..40 {
        let z = 0.5 * (low + high);
        *(if is_inside(z) { &mut low } else { &mut high }) = z;
    }
    (low - top, notes)
}

/// The box grows, though no path leaves it: what is gained two knot intervals from a face is gained far from any.
#[test]
fn what_ends_beside_a_face_has_room() {
    let strokes: [fn(f64) -> String; 3] = [
        |z| format!("pull = {{ along = [[12, 12, {z}]], lift = 0.5, radius = 1.5 }}"),
        |z| format!("pull = {{ along = [[12, 12, {z}]], lift = 1.2, radius = 1.5 }}"),
        |z| {
            let area = format!("[[10, 10, {z}], [14, 10, {z}], [14, 14, {z}], [10, 14, {z}]]");
            format!("extrude = {{ area = {area}, by = [0, 0, 1.6], radius = 1 }}")
        },
    ];
    for stroke in strokes {
        let (by, notes) = gained(22.0, &stroke(22.0));
        assert!(notes.iter().any(|n| n.contains("has grown")), "{notes:?}");
        let (roomy, notes) = gained(18.0, &stroke(18.0));
        assert!(notes.is_empty(), "{notes:?}");
        assert!((by / roomy - 1.0).abs() < 1e-3, "{by} for {roomy}");
    }
}

/// Nobody knows how the solid goes on where it is cut off.
#[test]
fn where_the_solid_is_cut_off_nothing_grows() {
    let block = block::<f32>(24);
    let why = ended(
        &block,
        "pull = { along = [[23.5, 12, 12]], lift = 0.5, radius = 1.5 }",
    )
    .unwrap_err();
    assert!(why.contains("cut off"), "{why}");
}
