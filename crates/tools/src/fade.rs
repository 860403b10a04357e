//! How an effect ends.

/// Steepest fall of [`fade`].
pub const STEEPEST: f64 = 1.875;

/// 1 up to `t = 0`, 0 from `t = 1` on, `1 - t³(10 - 15t + 6t²)` between: value, first and second derivative, all continuous.
pub fn fade(t: f64) -> [f64; 3] {
    if t <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    if t >= 1.0 {
        return [0.0; 3];
    }
    let value = 1.0 - t * t * t * (10.0 - t * (15.0 - 6.0 * t));
    let rest = t * (1.0 - t);
    [value, -30.0 * rest * rest, -60.0 * rest * (1.0 - 2.0 * t)]
}
