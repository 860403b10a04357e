//! S17: scenes from a tenth of the device's room to twenty times it.

use glam::DVec3;
use tools::haptics::simulated::{Path, SimulatedHand, World};
use tools::haptics::{Obstacle, Workspace};

use super::common::{Check, Edge, Groove, HalfSpace, Loop, Sheet, proxy};

const SCALES: [f64; 5] = [0.1, 0.5, 1.0, 5.0, 20.0];

fn of(x: f64, z: f64) -> DVec3 {
    DVec3::new(x, 0.0, z)
}

/// A scene that is as large for the hand at any scale.
fn zoomed(scale: f64, setup: &Loop, obstacle: impl Obstacle + 'static) -> Check {
    let mut options = setup.served();
    options.workspace.scale = scale;
    let radius = setup.radius * scale;
    let mut rig = setup.rig(World::still(obstacle), options, |k| {
        assert!((k * scale / setup.stiffness - 1.0).abs() < 1e-12);
        Box::new(proxy(radius, k))
    });
    let workspace = Workspace {
        scale,
        ..Workspace::default()
    };
    setup.check(rig.run(setup.seconds), &workspace)
}

#[test]
fn a_scene_feels_the_same_at_any_scale() {
    let press = Path::smooth([(0.1, of(0.0, 14.0)), (0.6, of(0.0, -4.0))]);
    let hit = Path::straight([(0.1, of(0.0, 15.0)), (0.16, of(0.0, -10.0))]);
    let into = Path::smooth([(0.1, of(3.0, 14.0)), (0.7, of(0.0, -1.0))]).trembling(0.02 * DVec3::X, 35.0);
    let over = Path::straight([
        (0.0, of(-12.0, 16.0)),
        (0.2, of(-12.0, -1.0)),
        (0.44, of(12.0, -1.0)),
    ]);
    let setup = |path: &Path, seconds| Loop::new(SimulatedHand::light(path.clone()), seconds);
    for scale in SCALES {
        let wall = zoomed(scale, &setup(&press, 3.0), HalfSpace::floor(0.0));
        let depth = 2.0 - wall.trace.last(1.0).iter().map(|t| t.read.at.z).sum::<f64>() / 1000.0;
        let sheet = zoomed(scale, &setup(&hit, 2.0), Sheet { thickness: scale });
        let groove = zoomed(scale, &setup(&into, 3.0), Groove { half: 0.6 });
        let edge = zoomed(scale, &setup(&over, 2.0), Edge { half: 0.785 });
        let flat = wall.measures.steady.z / (0.5 * depth) - 1.0;
        assert!(flat.abs() < 0.02, "P5 at {scale}: {flat}");
        assert_eq!(sheet.trace.crossings(|p| p.z > 0.0), 0, "P4 at {scale}");
        for (name, check) in [
            ("wall", wall),
            ("sheet", sheet),
            ("groove", groove),
            ("edge", edge),
        ] {
            check.assert(
                &format!("{name} at {scale}"),
                &[
                    ("it is felt", check.measures.force > 0.5),
                    ("P1", check.rests()),
                    ("P2", check.is_passive()),
                    ("P3", check.is_slewed()),
                    ("P4", check.stays_out()),
                ],
            );
        }
    }
}
