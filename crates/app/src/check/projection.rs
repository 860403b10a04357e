use bspline::Field;
use glam::DVec3;
use rayon::prelude::*;

/// Where a point lies against the surface `{ f = 0 }`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected {
    /// Distance to the nearest point of the surface that was found.
    pub distance: f64,
    /// Whether the surface was reached at all; if not, `distance` is what was walked and still estimated.
    pub converged: bool,
}

/// Newton steps in search of the surface.
const NEWTON_STEPS: usize = 40;
/// Rounds of sliding along the surface toward the foot of the perpendicular.
const SLIDES: usize = 8;

/// Distances of `points` from the zero set of `field`, each by iteration to the foot of the perpendicular.
///
/// `spacing` is the finest knot spacing: no step is longer. Steps below `1e-6·spacing` count as arrived.
pub fn project_points(field: &dyn Field, points: &[DVec3], spacing: f64) -> Vec<Projected> {
    points
        .par_iter()
        .with_min_len(256)
        .map(|&p| project(field, p, spacing))
        .collect()
}

/// The point of the surface that Newton's steps reach from `p`, if they do.
pub fn surface_point(field: &dyn Field, p: DVec3, spacing: f64) -> Option<DVec3> {
    newton(field, p, spacing).ok().map(|hit| hit.0)
}

fn project(field: &dyn Field, p: DVec3, spacing: f64) -> Projected {
    let (mut foot, mut normal) = match newton(field, p, spacing) {
        Ok(hit) => hit,
        Err((x, estimate)) => {
            return Projected {
                distance: p.distance(x) + estimate,
                converged: false,
            };
        }
    };
    // [Hartmann99]: step in the tangent plane below `p`, then back to the surface.
    let mut distance = p.distance(foot);
    for _ in 0..SLIDES {
        let offset = p - foot;
        let across = offset - normal * offset.dot(normal);
        if across.length() <= 1e-3 * distance.max(1e-6 * spacing) {
            break;
        }
        let Ok((next, n)) = newton(field, foot + across, spacing) else {
            break;
        };
        let closer = p.distance(next);
        if closer >= distance {
            break;
        }
        (foot, normal, distance) = (next, n, closer);
    }
    Projected {
        distance,
        converged: true,
    }
}

/// Follows the gradient to the surface: foot and unit gradient, or where it got lost and how far is left by first
/// order.
fn newton(field: &dyn Field, start: DVec3, spacing: f64) -> Result<(DVec3, DVec3), (DVec3, f64)> {
    let mut x = start;
    let (mut f, mut g) = field.value_gradient(x);
    let mut left = f64::INFINITY;
    for _ in 0..NEWTON_STEPS {
        let slope = g.length();
        left = f.abs() / slope;
        if !left.is_finite() {
            return Err((x, spacing));
        }
        if left <= 1e-6 * spacing {
            return Ok((x, g / slope));
        }
        let next = x - g * (f / slope / slope * (spacing / left).min(1.0));
        let (f_next, g_next) = field.value_gradient(next);
        // Across a crease Newton's steps go to and fro; what they bracket is found by halving.
        if f_next.abs() > 0.5 * f.abs() && (f_next > 0.0) != (f > 0.0) {
            return Ok(bisect(field, [x, next], f > 0.0));
        }
        (x, f, g) = (next, f_next, g_next);
    }
    Err((x, left))
}

/// The zero between two points of different sign, and the unit gradient there; `inside` is the sign at the first.
fn bisect(field: &dyn Field, [mut a, mut b]: [DVec3; 2], inside: bool) -> (DVec3, DVec3) {
    for _ in 0..40 {
        let middle = (a + b) * 0.5;
        if (field.value(middle) > 0.0) == inside {
            a = middle
        } else {
            b = middle
        }
    }
    (b, field.value_gradient(b).1.normalize_or_zero())
}

#[cfg(test)]
mod tests {
    use super::*;
    use bspline::{Aabb, Interval, Jet};
    use glam::DMat3;

    /// `f = 1 - (x²/4 + y² + z²)`: its gradient lines are not its normals.
    struct Ellipsoid;

    impl Field for Ellipsoid {
        fn value(&self, p: DVec3) -> f64 {
            self.value_gradient(p).0
        }
        fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
            let g = DVec3::new(-0.5 * p.x, -2.0 * p.y, -2.0 * p.z);
            (1.0 + 0.5 * g.dot(p), g)
        }
        fn jet(&self, p: DVec3) -> Jet {
            let (value, gradient) = self.value_gradient(p);
            Jet {
                value,
                gradient,
                hessian: DMat3::from_diagonal(DVec3::new(-0.5, -2.0, -2.0)),
            }
        }
        fn bounds(&self, _: &Aabb) -> Interval {
            Interval::EVERYTHING
        }
    }

    #[test]
    fn distance_is_that_to_the_foot_of_the_perpendicular() {
        for i in 0..200 {
            let (a, t) = (0.0314 * i as f64, 0.6 * ((i * 37 % 100) as f64 / 100.0 - 0.5));
            let s = DVec3::new(2.0 * a.cos(), 0.6 * a.sin(), 0.8 * a.sin());
            let n = DVec3::new(0.5 * s.x, 2.0 * s.y, 2.0 * s.z).normalize();
            let [found] = project_points(&Ellipsoid, &[s + n * t], 0.1)[..] else {
                unreachable!()
            };
            assert!(found.converged);
            // The tangent offset left is 1e-3 of the distance, which enters the distance squared.
            assert!(
                (found.distance - t.abs()).abs() <= 1e-5 * t.abs() + 1e-7,
                "{found:?} against {t}"
            );
        }
    }

    #[test]
    fn a_point_where_the_gradient_vanishes_is_reported() {
        let [found] = project_points(&Ellipsoid, &[DVec3::ZERO], 0.1)[..] else {
            unreachable!()
        };
        assert!(!found.converged);
        assert!(found.distance.is_finite());
    }
}
