//! Strokes near the faces of a field's box.

use super::*;

fn ended(field: &HierarchicalSpline<f32>, stroke: &str) -> Result<(Canvas, Vec<String>), String> {
    let session: Session = toml::from_str(&format!("[[stroke]]\n{stroke}")).unwrap();
    let canvas = Canvas::alone(field.clone(), ISO, 0);
    let left = session.stroke[0].apply(canvas, &mut Control::default());
    left.map_err(|e| e.to_string())
}

/// A ball whose top is two knot intervals from the face: the box grows, though no path leaves it.
#[test]
fn what_ends_beside_a_face_has_room() {
    let ball = field_of(24, |p| 10.0 - p.distance(DVec3::splat(12.0)));
    for (stroke, by) in [
        ("pull = { along = [[12, 12, 22]], lift = 0.5, radius = 1.5 }", 0.5),
        ("pull = { along = [[12, 12, 22]], lift = 1.2, radius = 1.5 }", 1.2),
        (
            "extrude = { area = [[9, 9, 22], [15, 9, 22], [15, 15, 22], [9, 15, 22]], by = [0, 0, 1.6], radius = 1 }",
            1.6,
        ),
    ] {
        let (left, notes) = ended(&ball, stroke).unwrap_or_else(|e| panic!("{stroke}: {e}"));
        assert!(
            notes.iter().any(|n| n.contains("has grown")),
            "{stroke}: {notes:?}"
        );
        let value = |z: f64| left.field.value(DVec3::new(12.0, 12.0, z)) - ISO;
        let (mut low, mut high) = (20.0, 26.0);
        for _ in 0..40 {
            let z = 0.5 * (low + high);
            *(if value(z) > 0.0 { &mut low } else { &mut high }) = z;
        }
        let gained = low - 22.0;
        assert!((gained / by - 1.0).abs() < 0.05, "{stroke}: {gained}");
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
