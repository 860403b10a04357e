//! Paths that meet what was there before: the far side of a slit, the air behind a wall.

use super::*;

/// A scan falls off within its edges: holes much wider than those still open, and reach as far as they are told to.
#[test]
fn holes_wider_than_the_edges_of_a_scan_open() {
    // Air of 0 and a solid of 600, over about a length.
    let scan = |p: DVec3| 300.0 / SLOPE * (1.5 * (12.0 - p.z)).tanh();
    let field = field_of::<f32>(24, scan);
    for radius in [1.5, 2.5] {
        let drill: Drill = toml::from_str(&format!(
            "along = [[12, 12, 12]]\nby = [0, 0, -5]\nradius = {radius}"
        ))
        .unwrap();
        let (after, report) = finished(drill.begin(&field, ISO, false).unwrap());
        assert!(
            report.arrival.least > 0.9 && report.arrival.most < 1.1,
            "{radius}: {report:?}"
        );
        for depth in [0.5, 2.0, 4.0] {
            let value = after.value(DVec3::new(12.0, 12.0, 12.0 - depth));
            assert!(value < ISO, "{radius} {depth}: {value}");
        }
    }
}

/// Growth closes a slit, even where the solid beyond outweighs it on the path, and carving opens a wall; what lies beyond
/// stays as it was.
#[test]
fn paths_end_at_what_was_there_before() {
    for (low, high) in [(12.0, 13.6), (12.0, 14.2), (11.4, 13.0)] {
        for solid in [true, false] {
            let sign = if solid { 1.0 } else { -1.0 };
            // A slit between two solids, or a wall between two rooms.
            let gap = |p: DVec3| sign * (low - p.z).max(p.z - high);
            let field = field_of::<f32>(24, gap);
            for (size, text) in [
                ("point", format!("along = [[12, 12, {low}]]")),
                ("curve", format!("along = [[10, 12, {low}], [14, 12, {low}]]")),
            ] {
                let (after, report) = pulled(&field, &format!("{text}\nby = [0, 0, 2.56]\nradius = {R}"));
                let what = format!("{size}, {low} to {high}, solid {solid}: {report:?}");
                println!("{what}");
                assert!(
                    report.arrival.least > 0.99 && report.arrival.most < 1.01,
                    "{what}"
                );
                assert!(report.overshoot < 0.05, "{what}");
                for i in 0..=10 {
                    let z = low + 0.256 * f64::from(i);
                    let value = sign * (after.value(DVec3::new(12.0, 12.0, z)) - ISO);
                    assert!(value > -0.4, "{what} {z}: {value}");
                }
                let beyond = DVec3::new(12.0, 12.0, 18.0);
                let moved = after.value(beyond) - field.value(beyond);
                assert!(moved.abs() < 4.0, "{what}: {moved}");
            }
        }
    }
}
