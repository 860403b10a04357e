//! Crossing triangles cut along their partners, so that each piece has one thing on each side.

use glam::DVec3;

use super::sides::Sides;
use super::topology::area_vector;
use super::winding::WindingTree;

/// Partners whose planes cut a triangle at once: `k` planes make up to `k²/2` pieces.
const PLANES: usize = 6;
/// Quarterings that separate partners when there are more.
const QUARTERINGS: u32 = 12;
/// Lengths in the unit box below which a corner counts as on a plane.
const ON_PLANE: f64 = 1e-13;

/// The pieces of `points` that bound the solid, and whether they are all of it.
pub(crate) fn boundary_pieces(
    winding: &WindingTree,
    points: &[DVec3; 3],
    partners: &[[DVec3; 3]],
) -> (Vec<[DVec3; 3]>, bool) {
    let normal = area_vector(points).normalize_or_zero();
    let mut polygons = Vec::new();
    cut(points, partners, QUARTERINGS, &mut polygons);
    let mut out = Vec::new();
    let mut whole = true;
    for polygon in polygons {
        let middle = polygon.iter().sum::<DVec3>() / polygon.len() as f64;
        if !Sides::at(winding, middle, normal).is_boundary() {
            whole = false;
            continue;
        }
        for i in 2..polygon.len() {
            let piece = [polygon[0], polygon[i - 1], polygon[i]];
            if area_vector(&piece).length() > 0.0 {
                out.push(piece);
            }
        }
    }
    (out, whole)
}

fn cut(points: &[DVec3; 3], partners: &[[DVec3; 3]], quarterings: u32, out: &mut Vec<Vec<DVec3>>) {
    if partners.len() > PLANES && quarterings > 0 {
        let [a, b, c] = *points;
        let [ab, bc, ca] = [(a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5];
        for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
            let near: Vec<[DVec3; 3]> = partners.iter().filter(|p| may_touch(&part, p)).copied().collect();
            cut(&part, &near, quarterings - 1, out);
        }
        return;
    }
    let mut polygons = vec![points.to_vec()];
    for partner in partners.iter().take(4 * PLANES) {
        let normal = area_vector(partner).normalize_or_zero();
        polygons = polygons
            .iter()
            .flat_map(|p| split(p, partner[0], normal))
            .collect();
    }
    out.append(&mut polygons);
}

/// Whether a triangle may touch another: their boxes do, and neither lies on one side of the other's plane.
fn may_touch(a: &[DVec3; 3], b: &[DVec3; 3]) -> bool {
    let low = |t: &[DVec3; 3]| t[0].min(t[1]).min(t[2]);
    let high = |t: &[DVec3; 3]| t[0].max(t[1]).max(t[2]);
    let apart = |t: &[DVec3; 3], u: &[DVec3; 3]| {
        let n = area_vector(t).normalize_or_zero();
        let d = u.map(|p| (p - t[0]).dot(n));
        d.iter().all(|&d| d > ON_PLANE) || d.iter().all(|&d| d < -ON_PLANE)
    };
    low(a).cmple(high(b)).all() && low(b).cmple(high(a)).all() && !apart(a, b) && !apart(b, a)
}

/// The parts of a convex polygon in front of and behind a plane; those without corners off the plane are left out.
fn split(polygon: &[DVec3], on: DVec3, normal: DVec3) -> Vec<Vec<DVec3>> {
    let height: Vec<f64> = polygon.iter().map(|p| (*p - on).dot(normal)).collect();
    if height.iter().all(|&h| h <= ON_PLANE) || height.iter().all(|&h| h >= -ON_PLANE) {
        return vec![polygon.to_vec()];
    }
    [1.0, -1.0]
        .map(|side| {
            let mut part = Vec::with_capacity(polygon.len() + 1);
            for i in 0..polygon.len() {
                let j = (i + 1) % polygon.len();
                let (h, k) = (side * height[i], side * height[j]);
                if h >= -ON_PLANE {
                    part.push(polygon[i]);
                }
                if (h > ON_PLANE && k < -ON_PLANE) || (h < -ON_PLANE && k > ON_PLANE) {
                    part.push(polygon[i] + (polygon[j] - polygon[i]) * (h / (h - k)));
                }
            }
            part
        })
        .into_iter()
        .collect()
}
