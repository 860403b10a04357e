//! A hand that nothing holds back: the renderer alone, on a path.

use tools::haptics::simulated::{Limits, Measures, Path, Tick, Trace};
use tools::haptics::{Obstacle, Pose, Renderer};

use super::Check;

/// Ticks of 1 ms along a path, without a device.
pub fn scripted(
    path: &Path,
    seconds: f64,
    obstacle: &dyn Obstacle,
    mut renderer: impl Renderer,
    (radius, stiffness): (f64, f64),
) -> Check {
    let mut trace = Trace::default();
    let dt = 1e-3;
    let mut returned = 0.0;
    for i in 0..(seconds / dt).round() as u32 {
        let time = f64::from(i) * dt;
        let at = path.at(time).0;
        let felt = renderer.tick(obstacle, &Pose::at(at), dt);
        if let Some(last) = trace.ticks.last() {
            let last: &Tick = last;
            returned += 0.5e-3 * (last.force + felt.force).dot(at - last.at);
        }
        trace.ticks.push(Tick {
            time,
            dt,
            read: Pose::at(at),
            at,
            target: at,
            force: felt.force,
            torque: felt.torque,
            applied: felt.force,
            proxy: felt.proxy,
            distance: obstacle.distance(felt.proxy.at).0,
            contact: felt.contact,
            returned,
            work: returned,
            age: 0.0,
            cost: 0.0,
        });
    }
    let limits = Limits::new(stiffness, dt, 0.0, radius);
    Check {
        measures: Measures::of(&trace, &limits),
        limits,
        most: f64::INFINITY,
        trace,
    }
}
