//! Vectors that may be only so long, and change only so fast.

use glam::DVec3;

/// The vector, shortened to a length where it is longer. Never axis by axis: that would turn it.
pub fn clamped(v: DVec3, most: f64) -> DVec3 {
    let length = v.length();
    if length > most { v * (most / length) } else { v }
}

/// The vector, or what a step of a length leads to on the way there.
pub fn slewed(from: DVec3, to: DVec3, step: f64) -> DVec3 {
    let way = to - from;
    if way.length() > step {
        from + clamped(way, step)
    } else {
        to
    }
}
