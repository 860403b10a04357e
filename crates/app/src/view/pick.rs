//! Where a line meets the surface.

use bspline::{Aabb, Field};
use glam::DVec3;

use super::Ray;

/// Halvings of the line's way through the box after which a piece has one crossing at most.
const SHORTEST: u32 = 12;
/// Bisections of a crossing.
const BISECTIONS: usize = 40;

/// Where a line first goes into the solid, and the outward normal there, of length 1: of the side of the box where that cuts the solid off.
/// None where it passes by, or is inside from the start to the end.
pub fn pick(field: &dyn Field, iso: f64, within: &Aabb, ray: &Ray) -> Option<(DVec3, DVec3)> {
    let [from, to] = through(within, ray)?;
    let at = |t: f64| ray.from + t * ray.along;
    if from > 0.0 && field.value(at(from)) > iso {
        return Some((at(from), side(within, at(from))?));
    }
    let enters = crossing(field, iso, [at(from), at(to)], true, 0)?;
    let gradient = field.value_gradient(enters).1;
    let normal = -gradient.try_normalize()?;
    Some((enters, normal))
}

/// Outward normal of the side of a box that a place lies on, if it lies on one.
pub fn side(b: &Aabb, p: DVec3) -> Option<DVec3> {
    let far = 2.0 * (p - b.center()) / b.size();
    let axis = far.abs().max_position();
    (far[axis].abs() > 1.0 - 1e-9).then(|| DVec3::AXES[axis] * far[axis].signum())
}

/// Where a line that begins on the surface, and goes into the solid, leaves it first; none where it stays inside as far as the box goes.
pub fn leave(field: &dyn Field, iso: f64, within: &Aabb, from: DVec3, along: DVec3) -> Option<DVec3> {
    let [_, to] = through(within, &Ray { from, along })?;
    // Past what rounding leaves of the start outside.
    let start = 1e-6 * within.size().length();
    let at = |t: f64| from + t * along;
    crossing(field, iso, [at(start), at(to)], false, 0)
}

/// Ways along the line to where it goes into a box and out of it.
fn through(b: &Aabb, ray: &Ray) -> Option<[f64; 2]> {
    let (mut from, mut to) = (0.0_f64, f64::INFINITY);
    for a in 0..3 {
        let (start, step) = (ray.from[a], ray.along[a]);
        if step == 0.0 {
            if !(b.min[a]..=b.max[a]).contains(&start) {
                return None;
            }
            continue;
        }
        let ends = [(b.min[a] - start) / step, (b.max[a] - start) / step];
        from = from.max(ends[0].min(ends[1]));
        to = to.min(ends[0].max(ends[1]));
    }
    (from < to).then_some([from, to])
}

/// The first way in, or out, on a piece of the line, halved so often: pieces that the bounds of the field exclude are left out.
fn crossing(field: &dyn Field, iso: f64, [a, b]: [DVec3; 2], goes_in: bool, halvings: u32) -> Option<DVec3> {
    let range = field.bounds_along(a, b);
    if range.hi <= iso || range.lo > iso {
        return None;
    }
    let is_beyond = |p: DVec3| (field.value(p) > iso) == goes_in;
    if halvings < SHORTEST {
        let middle = 0.5 * (a + b);
        let first = crossing(field, iso, [a, middle], goes_in, halvings + 1);
        return first.or_else(|| crossing(field, iso, [middle, b], goes_in, halvings + 1));
    }
    if is_beyond(a) || !is_beyond(b) {
        return None;
    }
    let (mut before, mut beyond) = (a, b);
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (before + beyond);
        *(if is_beyond(middle) {
            &mut beyond
        } else {
            &mut before
        }) = middle;
    }
    Some(beyond)
}

#[cfg(test)]
mod tests {
    use bspline::HierarchicalSpline;
    use bspline::hierarchical::Lattice;
    use glam::DAffine3;

    use super::*;

    fn two_balls() -> HierarchicalSpline<f32> {
        let lattice = Lattice {
            world_from_lattice: DAffine3::from_translation(DVec3::splat(-12.0)),
            cells: [24; 3],
        };
        let ball = |p: DVec3, x: f64| 3.0 - p.distance(DVec3::new(x, 0.0, 0.0));
        HierarchicalSpline::schoenberg(lattice, 1.0, |p| ball(p, -5.0).max(ball(p, 5.0))).unwrap()
    }

    #[test]
    fn lines_stop_at_the_first_of_two_balls() {
        let field = two_balls();
        let b = field.lattice().world_box();
        for n in 0..200 {
            let (sine, cosine) = (0.031 * f64::from(n)).sin_cos();
            let aim = DVec3::new(-5.0, 1.8 * cosine, 1.8 * sine);
            let from = DVec3::new(-40.0, 3.0 * sine, 5.0 * cosine);
            let ray = Ray {
                from,
                along: (aim - from).normalize(),
            };
            let (p, normal) = pick(&field, 0.0, &b, &ray).expect("it hits");
            assert!(field.value(p).abs() < 1e-6 && p.x < -3.0, "{p}");
            assert!(normal.dot(ray.along) < 0.0);
            // By many small steps.
            let first = (0..80_000).map(|n| from + 1e-3 * f64::from(n) * ray.along);
            let first = first.into_iter().find(|q| field.value(*q) > 0.0).unwrap();
            assert!(first.distance(p) < 2e-3, "{first} and {p}");
        }
    }

    #[test]
    fn a_line_into_a_ball_leaves_it_at_the_other_side() {
        let field = two_balls();
        let b = field.lattice().world_box();
        for n in 0..100 {
            let (sine, cosine) = (0.063 * f64::from(n)).sin_cos();
            let from = DVec3::new(-40.0, 1.5 * sine, 2.0 * cosine);
            let ray = Ray {
                from,
                along: DVec3::X,
            };
            let (p, normal) = pick(&field, 0.0, &b, &ray).expect("it hits");
            let out = leave(&field, 0.0, &b, p, -normal).expect("the ball ends");
            assert!(field.value(out).abs() < 1e-6, "{out}");
            // Through the middle, which the normal goes through as far as the spline is a ball.
            let through = 0.5 * (out + p);
            assert!(through.distance(DVec3::new(-5.0, 0.0, 0.0)) < 0.3, "{through}");
            // From one ball into the other: the first way out counts.
            let first = leave(&field, 0.0, &b, p, DVec3::X).expect("it ends");
            assert!(first.x < -1.9, "{first}");
        }
        assert_eq!(leave(&field, 0.0, &b, DVec3::ZERO, DVec3::Y), None);
    }

    /// The box cuts both balls through the middle.
    #[test]
    fn lines_stop_where_the_box_cuts_the_solid_off() {
        let field = two_balls();
        let b = Aabb::new(DVec3::splat(-12.0), DVec3::new(12.0, 12.0, 0.5));
        for n in 0..100 {
            let (sine, cosine) = (0.063 * f64::from(n)).sin_cos();
            let aim = DVec3::new(-5.0 + 2.0 * cosine, 2.0 * sine, 0.5);
            let along = DVec3::new(0.3 * sine, 0.2 * cosine, -1.0).normalize();
            let from = aim - 30.0 * along;
            let (p, normal) = pick(&field, 0.0, &b, &Ray { from, along }).expect("it hits");
            assert!(p.distance(aim) < 1e-9 && normal == DVec3::Z, "{p} {normal}");
        }
        // An eye in the solid looks out of it, and into the other ball.
        let from = DVec3::new(-5.0, 0.0, 0.0);
        let along = DVec3::X;
        let (p, _) = pick(&field, 0.0, &b, &Ray { from, along }).expect("it hits");
        assert!((p.x - 2.0).abs() < 0.2, "{p}");
    }

    #[test]
    fn lines_that_pass_by_meet_nothing() {
        let field = two_balls();
        let b = field.lattice().world_box();
        for (from, along) in [
            (DVec3::new(0.0, -40.0, 0.0), DVec3::Y),
            (DVec3::new(-40.0, 0.0, 9.0), DVec3::X),
            (DVec3::new(-40.0, 0.0, 90.0), DVec3::X),
            (DVec3::new(-40.0, 0.0, 0.0), -DVec3::X),
        ] {
            assert_eq!(pick(&field, 0.0, &b, &Ray { from, along }), None);
        }
    }
}
