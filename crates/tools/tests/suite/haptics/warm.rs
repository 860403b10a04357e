//! S16: a minute at the device's largest force.

use glam::DVec3;
use tools::haptics::simulated::{Path, SimulatedHand};

use super::common::{HalfSpace, Loop, proxy};

#[test]
fn a_minute_of_full_force_folds_back_below_what_the_motors_bear() {
    let of = |z| DVec3::new(0.0, 0.0, z);
    // 15 N would be needed to hold this hand.
    let path = Path::smooth([(0.1, of(8.0)), (0.6, of(-50.0))]);
    let setup = Loop::new(SimulatedHand::light(path), 60.0);
    let check = setup.serve(HalfSpace::floor(0.0), |k| Box::new(proxy(2.0, k)));
    let forces: Vec<f64> = check.trace.ticks.iter().map(|t| t.force.length()).collect();
    assert!((check.measures.force - 3.3).abs() < 1e-9, "full at first");
    let end = check.trace.last(1.0);
    assert!(
        end.iter().all(|t| t.force.length() < 0.88),
        "{} N after a minute",
        forces[forces.len() - 1]
    );
    assert!(
        end.iter().all(|t| t.force.length() > 0.5),
        "but not without force"
    );
    let steps = forces[1000..].windows(2).map(|w| (w[1] - w[0]).abs());
    let largest = steps.fold(0.0, f64::max);
    assert!(largest < 5e-3, "a step of {largest} N");
}
