use glam::DVec3;

/// Central differences of a function.
pub fn slope(step: f64, p: DVec3, of: impl Fn(DVec3) -> f64) -> DVec3 {
    DVec3::from_array(DVec3::AXES.map(|axis| (of(p + step * axis) - of(p - step * axis)) / (2.0 * step)))
}
