//! The same scene gives the same bits.

use glam::DVec3;
use tools::haptics::simulated::{Path, SimulatedHand, Timing};

use super::common::{Groove, Loop, proxy};

#[test]
fn a_scene_is_a_function_of_its_seed() {
    let of = |x, z| DVec3::new(x, 0.0, z);
    let path = Path::smooth([(0.1, of(3.0, 14.0)), (0.7, of(0.0, -1.0))]);
    let trace = |seed| {
        let setup = Loop {
            timing: Timing {
                jitter: 0.5,
                seed,
                stalls: vec![(0.9, 8e-3)],
            },
            ..Loop::new(SimulatedHand::light(path.clone()), 1.0)
        };
        setup.touch(Groove { half: 0.6 }, proxy(2.0, 500.0)).trace
    };
    assert_eq!(trace(1), trace(1));
    assert_ne!(trace(1), trace(2));
}
