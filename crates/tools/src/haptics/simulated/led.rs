//! A hand that nothing holds back.

use super::super::{Obstacle, Pose, Renderer};
use super::{Path, Tick, Trace};

/// Time between two ticks, s.
const DT: f64 = 1e-3;

/// Ticks of 1 ms of a renderer whose hand is on a path, without a device: for hands faster than any, and for what a tick costs.
/// `clock` tells the time, s, for that.
pub fn led(
    path: &Path,
    seconds: f64,
    obstacle: &dyn Obstacle,
    renderer: &mut dyn Renderer,
    clock: Option<fn() -> f64>,
) -> Trace {
    let mut trace = Trace::default();
    let mut returned = 0.0;
    for i in 0..(seconds / DT).round() as u32 {
        let time = f64::from(i) * DT;
        let at = path.at(time).0;
        let start = clock.map(|c| c());
        let felt = renderer.tick(obstacle, &Pose::at(at), DT);
        let cost = clock.zip(start).map_or(0.0, |(c, start)| c() - start);
        if let Some(last) = trace.ticks.last() {
            returned += 0.5e-3 * (last.force + felt.force).dot(at - last.at);
        }
        trace.ticks.push(Tick {
            time,
            dt: DT,
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
            cost,
        });
    }
    trace
}
