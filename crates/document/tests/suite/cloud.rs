//! Edits of an object in the cloud that it was fitted to.

use bspline::Field;
use document::{Command, Journey, revise_cloud};
use fitting::Control;
use glam::DVec3;
use tools::limits::Limits;
use tools::session::Stroke;

use super::common::{Draw, large};

/// Points about the ball of forty cells, with noise.
fn scan() -> Vec<DVec3> {
    let mut draw = Draw(9);
    let golden = 2.399_963_229_728_653;
    (0..16000)
        .map(|n| {
            let z = 1.0 - 2.0 * (f64::from(n) + 0.5) / 16000.0;
            let (sin, cos) = (golden * f64::from(n)).sin_cos();
            let r = (1.0 - z * z).sqrt();
            let noise = f64::from(draw.below(1000)) / 5000.0 - 0.1;
            DVec3::splat(20.0) + (16.0 + noise) * DVec3::new(r * cos, r * sin, z)
        })
        .collect()
}

/// A stroke of an object "ball", as it is written, and the stroke in it.
fn commanded(stroke: &str) -> (Vec<Command>, Stroke) {
    let named = |_: Option<&str>| Ok::<_, document::CommandError>("ball".to_string());
    let commands = Command::of_script(&format!("[[stroke]]\n{stroke}\n"), named).unwrap();
    let Command::Stroke { stroke, .. } = &commands[0] else {
        unreachable!()
    };
    let stroke = (**stroke).clone();
    (commands, stroke)
}

#[test]
fn a_cloud_without_edits_stays_as_it_is() {
    let changes = revise_cloud(&large(), &large(), &scan(), 0.0, &Journey::default()).unwrap();
    assert_eq!(changes, Default::default());
}

#[test]
fn points_follow_their_surface_go_with_it_and_cover_what_is_new() {
    for (text, goes, comes) in [
        (
            "add = { shape = { box = { size = [4, 4, 7] } }, along = [[20, 20, 36]] }",
            true,
            true,
        ),
        (
            "carve = { shape = { sphere = { radius = 5 } }, along = [[20, 20, 36]] }",
            false,
            true,
        ),
        (
            "move = { motion = { grab = { along = [[20, 20, 35], [20, 20, 37]], radius = 9 } } }",
            false,
            false,
        ),
    ] {
        let (commands, stroke) = commanded(text);
        let others = tools::others::Others::default();
        let (before, limits, control) = (large(), Limits::default(), &mut Control::default());
        let now = match stroke.tool().unwrap() {
            tools::tool::Tool::Carve(t) => {
                t.apply(
                    tools::geometric::Operation::Carve,
                    &before,
                    0.0,
                    &others,
                    &limits,
                    control,
                )
                .unwrap()
                .0
            }
            tools::tool::Tool::Add(t) => {
                t.apply(
                    tools::geometric::Operation::Add,
                    &before,
                    0.0,
                    &others,
                    &limits,
                    control,
                )
                .unwrap()
                .0
            }
            tools::tool::Tool::Move(t) => t.apply(&before, 0.0, &limits, control).unwrap().0,
            _ => unreachable!(),
        };
        let points = scan();
        let journey = Journey::new(&commands, "ball", &before.lattice().world_box(), |_| None);
        let changes = revise_cloud(&before, &now, &points, 0.0, &journey).unwrap();
        assert!(!changes.moved.is_empty(), "{text}");
        assert_eq!(
            comes,
            changes.added.len() > 5,
            "{text}: {} new",
            changes.added.len()
        );
        assert!(!goes || !changes.removed.is_empty(), "{text}");
        for moved in &changes.moved {
            // Its distance from the surface is that which it had: the noise stays.
            let off = now.value(moved.position) - before.value(points[moved.row]);
            assert!(off.abs() < 0.05, "{text}: row {} is off by {off}", moved.row);
            assert!((moved.normal.length() - 1.0).abs() < 1e-9);
            // The scan's spacing is 0.45: a point on what was taken away does not slide to the rim.
            let way = moved.position.distance(points[moved.row]);
            assert!(
                way < 0.5 || text.starts_with("move"),
                "{text}: row {} went {way}",
                moved.row
            );
        }
        for added in &changes.added {
            assert!(now.value(added.position).abs() < 0.2, "{text}");
        }
        // Far from the tool nothing happens.
        let far = |row: usize| points[row].distance(DVec3::new(20.0, 20.0, 36.0)) > 20.0;
        assert!(
            !changes
                .moved
                .iter()
                .map(|m| m.row)
                .chain(changes.removed.iter().copied())
                .any(far)
        );
    }
}

/// Where a sphere is carved from a ball the new points are as dense as those of the scan, be these even or thrown at random.
#[test]
fn bared_surface_is_as_dense_as_the_scan() {
    let (commands, stroke) =
        commanded("carve = { shape = { sphere = { radius = 9 } }, along = [[20, 20, 36]] }");
    let before = large();
    let tools::tool::Tool::Carve(carve) = stroke.tool().unwrap() else {
        unreachable!()
    };
    let others = tools::others::Others::default();
    let (limits, control) = (Limits::default(), &mut Control::default());
    let operation = tools::geometric::Operation::Carve;
    let (now, _) = carve
        .apply(operation, &before, 0.0, &others, &limits, control)
        .unwrap();
    let journey = Journey::new(&commands, "ball", &before.lattice().world_box(), |_| None);
    // What of the carved sphere lies more than a spacing inside of the ball.
    let top = DVec3::new(20.0, 20.0, 36.0);
    let inner: f64 = 15.0;
    let cosine = (inner * inner - 16.0 * 16.0 - 81.0) / (2.0 * 16.0 * 9.0);
    let area = std::f64::consts::TAU * 81.0 * (1.0 + cosine);
    let mut draw = Draw(4);
    let mut thrown = |n: usize| -> Vec<DVec3> {
        let coordinate = |draw: &mut Draw| f64::from(draw.below(200_001)) / 1e5 - 1.0;
        let ways = std::iter::from_fn(|| Some(DVec3::from_array([(); 3].map(|()| coordinate(&mut draw)))));
        let ways = ways.filter(|p| (0.01..1.0).contains(&p.length_squared()));
        ways.take(n)
            .map(|p| DVec3::splat(20.0) + 16.0 * p.normalize())
            .collect()
    };
    for (name, points) in [
        ("even", scan()),
        ("8000", thrown(8000)),
        ("16000", thrown(16000)),
        ("40000", thrown(40000)),
    ] {
        let changes = revise_cloud(&before, &now, &points, 0.0, &journey).unwrap();
        // Beyond two knot intervals the tool left waves, which are no edit.
        let ways = changes.moved.iter().map(|m| points[m.row].distance(top) - 9.0);
        let farthest = ways.fold(0.0, f64::max);
        assert!(farthest < 2.0, "{name}: {farthest}");
        let inside = changes
            .added
            .iter()
            .filter(|a| a.position.distance(DVec3::splat(20.0)) < inner);
        let inside = inside
            .filter(|a| (a.position.distance(top) - 9.0).abs() < 0.2)
            .count();
        let scanned = points.len() as f64 / (4.0 * std::f64::consts::PI * 256.0);
        let ratio = inside as f64 / area / scanned;
        println!("{name}: {inside} points, {ratio:.3} as dense as the scan");
        assert!((ratio - 1.0).abs() < 0.1, "{name}: {ratio}");
    }
}

/// The fit closed the solid below; that is no surface that anybody scanned, and an edit that moves it does not make it one.
#[test]
fn surface_without_points_gets_none_when_it_is_moved() {
    let (_, stroke) = commanded("inflate = { along = [[20, 20, 4]], radius = 9, by = 1.5 }");
    let before = large();
    let inflate = stroke.inflate.as_ref().unwrap();
    let (now, _) = inflate
        .apply(&before, 0.0, &Limits::default(), &mut Control::default())
        .unwrap();
    let journey = Journey::default();
    let whole = scan();
    let open: Vec<DVec3> = whole.iter().copied().filter(|p| p.z > 12.0).collect();
    let changes = revise_cloud(&before, &now, &open, 0.0, &journey).unwrap();
    assert_eq!(changes.added.len(), 0);
    // Where there are points they move along.
    let changes = revise_cloud(&before, &now, &whole, 0.0, &journey).unwrap();
    assert!(changes.moved.len() > 400, "{}", changes.moved.len());
}
