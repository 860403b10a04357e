//! Strokes on matter that is painted stiff in part.

use super::*;
use tools::paint::Layers;

/// Stiffness of `ratio` where a formula is below 0.
fn painted(field: &HierarchicalSpline<f32>, ratio: f64, side: &str) -> Layers {
    let paint = format!(
        "[[stroke]]\npaint = {{ layer = 'stiffness', formula = '1 + {} * ({side} < 0)' }}",
        ratio - 1.0
    );
    let session: Session = toml::from_str(&paint).unwrap();
    let canvas = Canvas::alone(field.clone(), ISO, 0);
    let (canvas, _) = session.stroke[0].apply(canvas, &mut Control::default()).unwrap();
    canvas.layers
}

/// Borders across the tool, aslant, and along the surface, under which it is stiff.
#[test]
fn strokes_arrive_on_both_sides_of_a_border() {
    let (block, ball) = (block::<f32>(24), ball::<f32>(24, 1.0));
    let mut cases = Vec::new();
    for ratio in [3.0, 10.0, 100.0] {
        for side in ["x - 12", "x + 0.6*y - 19.5", "z - 12.3"] {
            cases.extend([1.92, -0.6].map(|d| (&block, 12.0, ratio, side, d)));
        }
        cases.push((&ball, 17.9, ratio, "x - 12", -1.92));
        cases.push((&ball, 17.9, ratio, "x + 0.6*y - 19.5", 1.92));
    }
    for (field, z, ratio, side, d) in cases {
        let layers = painted(field, ratio, side);
        for (tool, limit) in [
            (format!("along = [[9, 12, {z}], [15, 12.3, {z}]]"), 0.015),
            (format!("along = [[12, 9, {z}], [12.2, 15, {z}]]"), 0.015),
            (format!("along = [[12, 12, {z}]]\ndisc = 1.8"), 0.02),
        ] {
            let text = format!("{tool}\nlift = {d}\nradius = {R}");
            let stroke = pull(&text).begin(field, ISO).unwrap();
            let (_, report) = finished(stroke.painted(&layers).unwrap());
            let what = format!("{ratio} {side}: {text}: {report:?}");
            assert!(report.overshoot <= limit, "{what}");
            // Through a layer on the surface clay of a hundredth comes last.
            let least = if ratio == 100.0 && side.starts_with('z') {
                0.98
            } else {
                0.985
            };
            assert!(
                report.arrival.least >= least && report.arrival.most <= 1.0 + limit,
                "{what}"
            );
            assert!(report.solves <= 9 * report.steps, "{what}");
        }
    }
}

#[test]
fn grooves_and_ridges_cross_borders() {
    let field = block::<f32>(24);
    let text = format!("along = [[8, 11, 12], [16, 12.5, 12]]\ndepth = 0.8\nradius = {R}");
    let tool: Chisel = toml::from_str(&text).unwrap();
    for side in ["x - 12", "x + 0.6*y - 19.5", "z - 12.3"] {
        for (ratio, grows) in [(10.0, false), (100.0, true)] {
            let layers = painted(&field, ratio, side);
            let stroke = tool.begin(&field, ISO, grows).unwrap().painted(&layers).unwrap();
            let (_, report) = finished(stroke);
            let what = format!("{ratio} {side} {grows}: {report:?}");
            // For one step, as the second stage begins.
            assert!(report.overshoot <= 0.025, "{what}");
            assert!(
                report.arrival.least >= 0.985 && report.arrival.most <= 1.015,
                "{what}"
            );
        }
    }
}

/// A path every half radius, against eight times as many.
#[test]
fn the_shape_of_a_curve_is_that_of_many_paths() {
    let field = block::<f64>(24);
    let at = |i: usize, n: usize, length: f64| 12.0 - 0.5 * length + length * i as f64 / n as f64;
    let profile = |count: usize, d: f64| -> Vec<f64> {
        let width = 6.0 * R / count as f64;
        let target = |i: usize| {
            let from = DVec3::new(at(i, count, 6.0 * R), 12.1, 12.0);
            let is_end = i == 0 || i == count;
            Target {
                weight: if is_end { 0.5 * (width + R) } else { width },
                ..Target::single(Path::through([from, from + d * DVec3::Z]).unwrap(), true)
            }
        };
        let targets = (0..=count).map(target).collect();
        let (after, _) =
            finished(ForceStroke::new(&field, ISO, targets, Extent::Curve, R, &How::default()).unwrap());
        let along = (0..=24).map(|i| height(&after, at(i, 24, 10.0 * R), 12.1) / d);
        let across = (1..=6).map(|i| height(&after, 12.0, 12.1 + 0.5 * f64::from(i)) / d);
        along.chain(across).collect()
    };
    for (d, limit) in [(1.6 * R, 0.02), (3.0 * R, 0.03)] {
        let [few, many] = [12, 96].map(|n| profile(n, d));
        let off = few.iter().zip(&many).map(|(a, b)| (a - b).abs());
        let off = off.fold(0.0, f64::max);
        println!("{d}: {off}");
        assert!(off < limit, "{d}: {off}");
    }
}

#[test]
fn zigzags_arrive_in_time() {
    let field = block::<f32>(24);
    for along in [
        "[[7, 11, 12], [9, 14, 12], [11, 11, 12], [13, 14, 12], [15, 11, 12], [17, 14, 12]]",
        "[[8, 11, 12], [10, 12.5, 12], [12, 11, 12], [14, 12.5, 12], [16, 11, 12]]",
        "[[9, 12, 12], [13, 12, 12], [11, 15.4, 12]]",
        "[[8, 12, 12], [12, 12, 12], [14, 15.5, 12]]",
    ] {
        for d in [1.92, 3.6, -3.6] {
            let (_, report) = pulled(&field, &format!("along = {along}\nlift = {d}\nradius = {R}"));
            assert!(
                report.steps_to_99.is_some_and(|n| n <= 15),
                "{along} {d}: {report:?}"
            );
            assert!(report.overshoot <= 0.015, "{along} {d}: {report:?}");
        }
    }
}
