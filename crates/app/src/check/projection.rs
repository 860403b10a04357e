use bspline::Field;
use fitting::points::crossing;
use glam::DVec3;

/// Newton steps in search of the surface.
const NEWTON_STEPS: usize = 40;

/// The point of the zero set of `field` that Newton's steps reach from `p`, if they do.
///
/// `spacing` is the finest knot spacing: no step is longer. Steps below `1e-6·spacing` count as arrived.
pub fn surface_point(field: &dyn Field, p: DVec3, spacing: f64) -> Option<DVec3> {
    let mut x = p;
    let (mut f, mut g) = field.value_gradient(x);
    for _ in 0..NEWTON_STEPS {
        let slope = g.length();
        let left = f.abs() / slope;
        if !left.is_finite() {
            return None;
        }
        if left <= 1e-6 * spacing {
            return Some(x);
        }
        let next = x - g * (f / slope / slope * (spacing / left).min(1.0));
        let (f_next, g_next) = field.value_gradient(next);
        // Across a crease Newton's steps go to and fro; what they bracket is found by halving.
        if f_next.abs() > 0.5 * f.abs() && (f_next > 0.0) != (f > 0.0) {
            return Some(crossing(field, [x, next], f > 0.0));
        }
        (x, f, g) = (next, f_next, g_next);
    }
    None
}
