//! The surface within a box, in places near each other: what a box holds is held there.

use bspline::{Aabb, Field};
use glam::DVec3;
use tools::force::nearest_surface;

/// Places along an edge of the box, and how many there may be in all: each is an equation that force tools solve for.
const ALONG: f64 = 14.0;
const MOST: usize = 400;
/// How much farther apart places are if there are too many.
const APART: f64 = 1.25;
/// Places are not nearer to each other than this share of the distance that is wished.
const NEAR: f64 = 0.6;

/// Places of the surface `field = iso` within a box, at about equal distances.
///
/// # Errors
/// That there are none.
pub fn surface_within(field: &dyn Field, iso: f64, b: &Aabb) -> Result<Vec<DVec3>, String> {
    let mut apart = b.size().max_element() / ALONG;
    loop {
        match places(field, iso, b, apart) {
            Some(places) if places.is_empty() => {
                return Err("no surface lies within the box; move it, or make it larger".into());
            }
            Some(places) => return Ok(places),
            None => apart *= APART,
        }
    }
}

/// None if there are too many.
fn places(field: &dyn Field, iso: f64, b: &Aabb, apart: f64) -> Option<Vec<DVec3>> {
    let counts = (b.size() / apart).ceil().max(DVec3::ONE);
    let steps = b.size() / counts;
    let [nx, ny, nz] = counts.to_array().map(|n| n as usize);
    let mut found: Vec<DVec3> = Vec::new();
    for n in 0..(nx + 1) * (ny + 1) * (nz + 1) {
        let node = [n / ((ny + 1) * (nz + 1)), n / (nz + 1) % (ny + 1), n % (nz + 1)];
        let p = b.min + steps * DVec3::from_array(node.map(|k| k as f64));
        let (value, gradient) = field.value_gradient(p);
        if (value - iso).abs() > 1.5 * apart * gradient.length() {
            continue;
        }
        let Ok(at) = nearest_surface(field, iso, p, apart) else {
            continue;
        };
        let is_within = at.cmpge(b.min).all() && at.cmple(b.max).all();
        if is_within && found.iter().all(|other| other.distance(at) > NEAR * apart) {
            found.push(at);
        }
        if found.len() > MOST {
            return None;
        }
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::desk_files;

    /// They lie on the surface, within, as many as are borne, and leave no hole.
    #[test]
    fn places_cover_the_surface_within_a_box() {
        let (_, object) = desk_files::clay_block().unwrap();
        let (field, iso) = (object.field.as_field(), object.iso().unwrap());
        // An edge of the block of 40 mm, and the middle of its front.
        for b in [
            Aabb::new(DVec3::new(-5.0, 14.0, 14.0), DVec3::new(5.0, 24.0, 24.0)),
            Aabb::new(DVec3::new(-3.0, -3.0, 17.0), DVec3::new(3.0, 3.0, 23.0)),
        ] {
            let places = surface_within(field, iso, &b).unwrap();
            assert!((60..=MOST).contains(&places.len()), "{}", places.len());
            let apart = b.size().max_element() / ALONG;
            for p in &places {
                let (value, gradient) = field.value_gradient(*p);
                assert!((value - iso).abs() < 1e-3 * gradient.length(), "{p}");
                assert!(p.cmpge(b.min).all() && p.cmple(b.max).all(), "{p}");
            }
            for (x, y) in (0..100).map(|n| (f64::from(n / 10), f64::from(n % 10))) {
                let on_front = b.min + DVec3::new(x + 0.5, y + 0.5, 0.0) / 10.0 * b.size();
                let Ok(at) = nearest_surface(field, iso, on_front.with_z(20.0), apart) else {
                    continue;
                };
                let near = places
                    .iter()
                    .map(|p| p.distance(at))
                    .fold(f64::INFINITY, f64::min);
                let is_within = at.cmpge(b.min).all() && at.cmple(b.max).all();
                assert!(!is_within || near < 2.0 * apart, "{near} at {at}");
            }
        }
        let away = Aabb::new(DVec3::splat(-2.0), DVec3::splat(2.0));
        assert!(
            surface_within(field, iso, &away)
                .unwrap_err()
                .contains("no surface")
        );
    }
}
