//! A hand that nothing holds back, judged.

use tools::haptics::simulated::{Limits, Measures, Path, led};
use tools::haptics::{Obstacle, Renderer};

use super::Check;

/// Ticks of 1 ms along a path, without a device, for a tool, mm, and a stiffness, N/m.
pub fn scripted(
    path: &Path,
    seconds: f64,
    obstacle: &dyn Obstacle,
    mut renderer: impl Renderer,
    (radius, stiffness): (f64, f64),
) -> Check {
    let trace = led(path, seconds, obstacle, &mut renderer, None);
    let limits = Limits::new(stiffness, 1e-3, 0.0, radius);
    Check {
        measures: Measures::of(&trace, &limits),
        limits,
        most: f64::INFINITY,
        trace,
    }
}
