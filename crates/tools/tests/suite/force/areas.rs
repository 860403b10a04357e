//! Areas: any outline, any number of paths.

use super::*;

/// Heights over a block in which the area within an outline was lifted.
fn lifted(
    field: &HierarchicalSpline<f32>,
    outline: &str,
    way: &str,
) -> (HierarchicalSpline<f32>, ForceReport) {
    pulled(field, &format!("area = {outline}\n{way}\nradius = {R}"))
}

#[test]
fn outlined_areas_arrive_as_one() {
    let field = block::<f32>(24);
    let star: Vec<String> = (0..10)
        .map(|i| {
            let (r, turn) = (if i % 2 == 0 { 4.0 } else { 2.4 }, 0.628 * f64::from(i));
            format!("[{}, {}, 12]", 12.0 + r * turn.cos(), 12.0 + r * turn.sin())
        })
        .collect();
    for (outline, inside) in [
        (
            "[[9, 9, 12], [15, 9, 12], [15, 15, 12], [9, 15, 12]]",
            [[12.0, 12.0], [9.2, 14.8], [14.7, 10.0]],
        ),
        (
            "{ meet = { formulas = ['((x - 12)/4)^2 + ((y - 12)/2.4)^2 - 1', 'z - 12'] } }",
            [[12.0, 12.0], [15.7, 12.0], [12.0, 9.9]],
        ),
        (
            &format!("[{}]", star.join(", ")),
            [[12.0, 12.0], [15.5, 12.0], [10.5, 12.0]],
        ),
        (
            "[[9, 9, 12], [15, 9, 12], [15, 12, 12], [12, 12, 12], [12, 15, 12], [9, 15, 12]]",
            [[10.5, 10.5], [14.5, 9.6], [9.4, 14.6]],
        ),
    ] {
        for d in [1.92, -1.2] {
            let (after, report) = lifted(&field, outline, &format!("lift = {d}"));
            for [x, y] in inside {
                let share = height(&after, x, y) / d;
                println!("{share} {x} {y}");
                assert!(
                    (0.985..1.02).contains(&share),
                    "{outline} {d}: {share} at {x}, {y}"
                );
            }
            assert!(report.overshoot < 0.02, "{outline} {d}: {report:?}");
            assert!(report.arrival.least > 0.985, "{outline} {d}: {report:?}");
        }
    }
    // Curved ways, and a surface that is not flat.
    let (_, report) = lifted(
        &field,
        "[[10, 10, 12], [14, 10, 12], [12, 14, 12]]",
        "way = [[0.1, 0, 0.6], [0.4, 0, 1.1], [0.9, 0, 1.5]]",
    );
    assert!(
        report.arrival.least > 0.985 && report.arrival.most < 1.02,
        "{report:?}"
    );
    let (_, report) = lifted(
        &ball(24, 1.0),
        "{ formulas = { x = '12 + 2.5*cos(t)', y = '12 + 2.5*sin(t)', z = '17.5', from = 0, to = 6.283185307179586 } }",
        "lift = 1.2",
    );
    assert!(
        report.arrival.least > 0.985 && report.arrival.most < 1.02,
        "{report:?}"
    );
}

#[test]
fn areas_of_uneven_ground_are_lifted_as_one() {
    // Bumps two radii wide, as steep as 30° or 40°; along their normals paths of a radius and a half cross.
    let k = std::f64::consts::TAU / (2.0 * R);
    for (steep, angle) in [(0.6, 0.0), (0.8, 0.4)] {
        let (sin, cos) = f64::sin_cos(angle);
        let height = |x: f64, y: f64| {
            steep / k * (0.7 * (k * (cos * x + sin * y)).sin() + 0.7 * (k * (cos * y - sin * x)).cos())
        };
        let field = field_of::<f32>(48, |p| 12.0 + height(p.x, p.y) - p.z);
        for way in ["lift = 1.8", "lift = -1.8"] {
            for area in [
                "along = [[12.3, 11.8, 12]]\ndisc = 2.4",
                "area = [[9, 10, 12], [15, 9, 12], [14, 14, 12], [11, 15, 12]]",
            ] {
                let (_, report) = pulled(&field, &format!("{area}\n{way}\nradius = {R}"));
                let Arrival { least, most } = report.arrival;
                assert!(least > 0.985 && most < 1.02, "{area} {way} {steep}: {report:?}");
            }
        }
    }
}

/// Rings as a disc has them, `n` of them, all places `size/n` apart.
fn rings(n: usize, size: f64, d: f64) -> Vec<Target> {
    use std::f64::consts::{PI, TAU};
    let width = size / n as f64;
    let target = |x: f64, y: f64, weight: f64| {
        let from = DVec3::new(12.1 + x, 11.9 + y, 12.0);
        Target {
            weight,
            ..Target::single(Path::through([from, from + d * DVec3::Z]).unwrap(), d > 0.0)
        }
    };
    let mut all = vec![target(0.0, 0.0, PI * (0.5 * width).powi(2))];
    for ring in 1..=n {
        let r = ring as f64 * width;
        let count = (TAU * r / width).ceil();
        let outer = if ring == n { r } else { r + 0.5 * width };
        let open = if ring == n { 0.5 * R * TAU * r } else { 0.0 };
        let area = PI * (outer.powi(2) - (r - 0.5 * width).powi(2)) + open;
        for i in 0..count as usize {
            let (sin, cos) = (TAU * i as f64 / count).sin_cos();
            all.push(target(r * cos, r * sin, area / count));
        }
    }
    all
}

#[test]
fn the_number_of_paths_of_a_disc_does_not_show() {
    let field = block::<f32>(24);
    for (d, limit) in [(1.92, 0.02), (-1.92, 0.02), (3.6, 0.03)] {
        let all = [4, 8, 16].map(|n| {
            let targets = rings(n, 2.4, d);
            let (after, report) =
                finished(ForceStroke::new(&field, ISO, targets, Extent::Area, R, &How::default()).unwrap());
            println!("{n}: {report:?}");
            let row = (0..=12).map(|i| height(&after, 12.1 + 0.4 * f64::from(i), 11.9) / d);
            row.collect::<Vec<_>>()
        });
        for other in &all[1..] {
            let off = all[0].iter().zip(other).map(|(a, b)| (a - b).abs());
            let off = off.fold(0.0, f64::max);
            println!("{d}: {off}");
            assert!(off < limit, "{d}: {off} {all:.4?}");
        }
    }
}

#[test]
fn outlines_that_enclose_nothing_are_refused() {
    let field = block::<f32>(24);
    for (text, word) in [
        ("area = [[9, 9, 12], [15, 9, 12]]", "encloses nothing"),
        (
            "area = [[9, 9, 12], [12, 9, 12], [15, 9, 12]]",
            "encloses nothing",
        ),
        (
            "area = [[9, 9, 12], [15, 15, 12], [15, 9, 12], [10, 14, 12]]",
            "crosses itself",
        ),
        (
            "area = [[9, 9, 12], [15, 9, 12], [12, 15, 12]]\ndisc = 1",
            "leave along and disc out",
        ),
        (
            "area = { meet = { formulas = ['z - 12', '(x^2 + y^2 - 150)^2 - 20'] } }",
            "parts",
        ),
    ] {
        let told = pull(&format!("{text}\nlift = 1\nradius = {R}")).begin(&field, ISO);
        let told = told.map(|_| ()).expect_err(text).to_string();
        assert!(told.contains(word), "{text}: {told}");
    }
}
