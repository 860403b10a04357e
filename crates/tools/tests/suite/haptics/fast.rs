//! S13: hands that move by millimetres in a tick.

use glam::DVec3;
use tools::haptics::Renderer;
use tools::haptics::simulated::Path;

use super::common::{Check, Rod, Rubbing, Sheet, penalty, proxy, scripted, vcp};

const SPEEDS: [f64; 4] = [1000.0, 2000.0, 3700.0, 5000.0];

/// Straight down at a speed, mm/s, through the height 0, at x.
fn through(x: f64, speed: f64) -> (Path, f64) {
    let of = |z| DVec3::new(x, 0.0, z);
    let time = 40.0 / speed;
    (
        Path::straight([(0.005, of(20.3)), (0.005 + time, of(-19.7))]),
        0.03 + time,
    )
}

fn sheet(speed: f64, radius: f64, renderer: impl Renderer + 'static) -> Check {
    let (path, seconds) = through(0.0, speed);
    scripted(
        &path,
        seconds,
        &Sheet { thickness: 0.3 },
        renderer,
        (radius, 500.0),
    )
}

fn slid_past(x: f64, speed: f64, radius: f64, renderer: impl Renderer + 'static) -> Check {
    let (path, seconds) = through(x, speed);
    scripted(&path, seconds, &Rod { radius: 0.5 }, renderer, (radius, 500.0))
}

fn is_above(p: DVec3) -> bool {
    p.z > 0.0
}

#[test]
fn no_speed_takes_the_tool_through_a_sheet() {
    for speed in SPEEDS {
        for radius in [0.0, 0.5, 2.0] {
            let check = sheet(speed, radius, proxy(radius, 500.0));
            check.assert(
                &format!("{radius} mm at {speed} mm/s"),
                &[
                    ("P4", check.stays_out() && check.trace.crossings(is_above) == 0),
                    ("P3", check.measures.expansion < 1e-3),
                ],
            );
        }
    }
}

/// A rod that holds what touches it: friction tells whether it was met at all.
#[test]
fn no_speed_takes_the_tool_through_a_rod() {
    let rod = Rubbing {
        solid: Rod { radius: 0.5 },
        coefficient: 100.0,
    };
    for speed in SPEEDS {
        for (radius, x) in [(0.0, 0.2), (0.0, -0.4), (0.5, 0.3), (2.0, 1.0)] {
            let name = format!("{radius} mm at {speed} mm/s, {x} mm beside the middle");
            let (path, seconds) = through(x, speed);
            let check = scripted(&path, seconds, &rod, proxy(radius, 500.0), (radius, 500.0));
            assert!(check.measures.force > 5.0, "{name}: {:#?}", check.measures);
            // Where it was met, or where it slid to in that tick.
            let end = check.trace.ticks.last().expect("ticks").proxy.at;
            let off = end.length() - (radius + 0.5);
            assert!(
                off.abs() < 0.01 && end.z > 0.0 && end.x * x > 0.0,
                "{name}: at {end}"
            );
            check.assert(&name, &[("P4", check.stays_out()), ("P2", check.is_passive())]);
        }
    }
}

#[test]
fn a_smooth_rod_is_left_on_the_side_where_it_was_met() {
    for speed in SPEEDS {
        for (radius, x) in [(0.0, 0.2), (0.0, -0.4), (0.5, 0.3), (2.0, 1.0)] {
            let check = slid_past(x, speed, radius, proxy(radius, 500.0));
            let name = format!("{radius} mm at {speed} mm/s, {x} mm beside the middle");
            check.assert(&name, &[("P4", check.stays_out()), ("P2", check.is_passive())]);
            let is_here = |t: &tools::haptics::simulated::Tick| t.proxy.at.x * x > 0.0;
            assert!(check.trace.ticks.iter().all(is_here), "{name}");
        }
    }
}

#[test]
fn methods_without_memory_fly_through() {
    for speed in SPEEDS {
        for check in [
            sheet(speed, 0.0, penalty(0.0, 500.0)),
            sheet(speed, 0.0, vcp(0.0, 500.0)),
        ] {
            assert_eq!(check.trace.crossings(is_above), 1);
        }
    }
    // Not a single tick notices a rod.
    let unnoticed = SPEEDS
        .iter()
        .filter(|s| slid_past(0.4, **s, 0.0, penalty(0.0, 500.0)).measures.force == 0.0);
    assert!(unnoticed.count() > 0);
}
