//! A lasso on the picture that becomes a formula of place: what lies within, as seen from the eye, to any depth.

use egui::Pos2;
use glam::DVec3;

use crate::view::Ray;

/// Corners of a lasso at most: as many planes bound what lies within.
const MOST: usize = 16;

/// The formula that is above 0 within the convex hull of a lasso, a distance from its border, in the world of the lines; nothing for a lasso
/// that encloses nothing. A lasso is the place and the line of sight of each of its points.
pub fn formula(lasso: &[(Pos2, Ray)]) -> Option<String> {
    let hull = thinned(hull(lasso));
    if hull.len() < 3 {
        return None;
    }
    let middle = hull.iter().map(|(_, ray)| ray.from + ray.along).sum::<DVec3>() / hull.len() as f64;
    let planes = (0..hull.len()).map(|n| {
        let (one, next) = (hull[n].1, hull[(n + 1) % hull.len()].1);
        let across = one
            .along
            .cross(next.from + next.along - one.from)
            .try_normalize()?;
        let inward = if across.dot(middle - one.from) < 0.0 {
            -across
        } else {
            across
        };
        let [x, y, z] = inward.to_array();
        Some(format!("{x}*x + {y}*y + {z}*z + {}", -inward.dot(one.from)).replace("+ -", "- "))
    });
    let planes: Option<Vec<String>> = planes.collect();
    planes?
        .into_iter()
        .reduce(|all, plane| format!("min({all}, {plane})"))
}

/// The convex hull, anticlockwise, by its chains \[Andrew79\].
fn hull(lasso: &[(Pos2, Ray)]) -> Vec<(Pos2, Ray)> {
    let mut all = lasso.to_vec();
    all.sort_by(|a, b| a.0.x.total_cmp(&b.0.x).then(a.0.y.total_cmp(&b.0.y)));
    let chain = |points: &mut dyn Iterator<Item = &(Pos2, Ray)>| {
        let mut chain: Vec<(Pos2, Ray)> = Vec::new();
        for point in points {
            while let [.., a, b] = chain[..]
                && (b.0 - a.0).x * (point.0 - a.0).y - (b.0 - a.0).y * (point.0 - a.0).x <= 0.0
            {
                chain.pop();
            }
            chain.push(*point);
        }
        chain.pop();
        chain
    };
    let mut hull = chain(&mut all.iter());
    hull.extend(chain(&mut all.iter().rev()));
    hull
}

fn thinned(hull: Vec<(Pos2, Ray)>) -> Vec<(Pos2, Ray)> {
    let every = hull.len().div_ceil(MOST).max(1);
    hull.into_iter().step_by(every).collect()
}

#[cfg(test)]
mod tests {
    use tools::scene::Formula;

    use super::*;

    /// Seen along −z by parallel lines, and from an eye: places are within where the picture has them within, to any depth.
    #[test]
    fn places_are_within_where_the_picture_has_them_within() {
        let eye = DVec3::new(0.0, 0.0, 50.0);
        for is_parallel in [true, false] {
            let ray = |x: f64, y: f64| match is_parallel {
                true => Ray {
                    from: DVec3::new(x, y, 50.0),
                    along: -DVec3::Z,
                },
                false => Ray {
                    from: eye,
                    along: (DVec3::new(x, y, 0.0) - eye).normalize(),
                },
            };
            // A square with a dent, which the hull fills.
            let corners = [(-4.0, -4.0), (4.0, -4.0), (4.0, 4.0), (0.0, 2.0), (-4.0, 4.0)];
            let lasso: Vec<(Pos2, Ray)> = corners
                .iter()
                .map(|(x, y)| (Pos2::new(*x as f32, -*y as f32), ray(*x, *y)))
                .collect();
            let formula = Formula::parse(&formula(&lasso).unwrap()).unwrap();
            for (x, y, is_in) in [
                (0.0, 0.0, true),
                (3.5, -3.5, true),
                (0.0, 3.0, true),
                (5.0, 0.0, false),
            ] {
                for depth in [40.0, 50.0] {
                    let line = ray(x, y);
                    let p = line.from + depth * line.along;
                    assert_eq!(formula.at(p, 0.0).unwrap() > 0.0, is_in, "{x} {y} {is_parallel}");
                }
            }
        }
        assert_eq!(formula(&[]), None);
    }
}
