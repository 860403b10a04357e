//! Turns and the vectors along their axes, as long as their angle.

use glam::{DQuat, DVec3};

/// Turn about a vector by its length, rad.
pub(super) fn exponential(w: DVec3) -> DQuat {
    let half = 0.5 * w.length();
    // sin(h)/h to rounding.
    let share = if half < 1e-4 {
        1.0 - half * half / 6.0
    } else {
        libm::sin(half) / half
    };
    let v = 0.5 * share * w;
    DQuat::from_xyzw(v.x, v.y, v.z, libm::cos(half)).normalize()
}

/// Axis times angle of a turn of length 1, at most π long.
pub(super) fn logarithm(q: DQuat) -> DVec3 {
    let v = DVec3::new(q.x, q.y, q.z);
    let (v, w) = if q.w < 0.0 { (-v, -q.w) } else { (v, q.w) };
    let sine = v.length();
    if sine < 1e-9 {
        2.0 * v
    } else {
        v * (2.0 * libm::atan2(sine, w) / sine)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_undo_exponentials() {
        for w in [
            DVec3::ZERO,
            DVec3::new(1e-7, 0.0, 0.0),
            DVec3::new(0.3, -1.0, 2.0),
            DVec3::new(0.0, 3.1, 0.0),
        ] {
            assert!((logarithm(exponential(w)) - w).length() < 1e-12, "{w}");
            assert!((logarithm(-exponential(w)) - w).length() < 1e-12, "{w}");
        }
    }
}
