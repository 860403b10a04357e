//! Polygons into triangles: the fan of the file where it lies flat, ears cut one by one where it would fold.
//!
//! Every simple polygon of n corners has n − 2 triangles in any triangulation, so a fan is replaced where it stands
//! [Meisters 1975, two ears theorem].

use glam::{DVec2, DVec3};

/// Tests a corner may cost before the fan is kept, so that no file makes the time grow faster than its size. A
/// polygon of 500 corners, half of them reflex, needs some 130.
const TESTS_PER_CORNER: usize = 1000;

/// What cutting a polygon holds for each of its corners, lists that have doubled included.
pub(crate) const BYTES_PER_CORNER: usize =
    2 * size_of::<DVec2>() + 2 * size_of::<[u32; 2]>() + 2 * size_of::<[u32; 3]>() + size_of::<u32>() * 2;

/// Cuts polygons, with its scratch space.
#[derive(Debug, Default)]
pub(crate) struct Cutter {
    flat: Vec<DVec2>,
    neighbours: Vec<[u32; 2]>,
    triangles: Vec<[u32; 3]>,
    /// Polygons that cross themselves or cost too much; they stay fans.
    pub uncut: usize,
}

impl Cutter {
    /// Whether the polygon of `fan` has to be cut otherwise; then [`Self::apply`] does it.
    pub fn cut(&mut self, positions: &[DVec3], fan: &[[u32; 3]]) -> bool {
        let at = |v: u32| positions[v as usize];
        let origin = at(fan[0][0]);
        // Twice the vector area: Newell's normal.
        let cross = |t: &[u32; 3]| (at(t[1]) - origin).cross(at(t[2]) - origin);
        let normal: DVec3 = fan.iter().map(cross).sum();
        if !normal.is_finite() || fan.iter().all(|t| cross(t).dot(normal) >= 0.0) {
            return false;
        }
        // Onto the plane of two axes that shows most of it, counterclockwise.
        let a = normal.abs();
        let project = |v: u32| {
            let p = at(v) - origin;
            let (flat, up) = if a.z >= a.x && a.z >= a.y {
                (DVec2::new(p.x, p.y), normal.z)
            } else if a.y >= a.x {
                (DVec2::new(p.z, p.x), normal.y)
            } else {
                (DVec2::new(p.y, p.z), normal.x)
            };
            if up < 0.0 {
                DVec2::new(-flat.x, flat.y)
            } else {
                flat
            }
        };
        self.flat.clear();
        self.flat.extend(corners(fan).map(project));
        let is_cut = self.clip();
        self.uncut += usize::from(!is_cut);
        is_cut
    }

    /// Writes the corners of `fan` in the order that the last [`Self::cut`] found.
    pub fn apply<T: Copy>(&self, fan: &mut [[T; 3]]) {
        let corner: Vec<T> = corners(fan).collect();
        for (slot, t) in fan.iter_mut().zip(&self.triangles) {
            *slot = t.map(|i| corner[i as usize]);
        }
    }

    fn clip(&mut self) -> bool {
        let n = self.flat.len();
        let mut left_tests = n * TESTS_PER_CORNER;
        self.triangles.clear();
        self.neighbours.clear();
        self.neighbours
            .extend((0..n).map(|i| [((i + n - 1) % n) as u32, ((i + 1) % n) as u32]));
        let mut at = 0u32;
        let mut left = n;
        // Corners passed since the last ear; a second round takes corners of no area, too.
        let mut passed = 0;
        while left > 3 {
            let [before, after] = self.neighbours[at as usize];
            if self.is_ear([before, at, after], passed >= left, &mut left_tests) {
                self.triangles.push([before, at, after]);
                self.neighbours[before as usize][1] = after;
                self.neighbours[after as usize][0] = before;
                left -= 1;
                passed = 0;
                at = after;
            } else {
                passed += 1;
                at = after;
            }
            if passed > 2 * left || left_tests == 0 {
                return false;
            }
        }
        let [before, after] = self.neighbours[at as usize];
        self.triangles.push([before, at, after]);
        true
    }

    fn is_ear(&self, [i, j, k]: [u32; 3], flat_too: bool, left_tests: &mut usize) -> bool {
        let [a, b, c] = [i, j, k].map(|v| self.flat[v as usize]);
        let area = turn(a, b, c);
        if area < 0.0 || area == 0.0 && !flat_too {
            *left_tests = left_tests.saturating_sub(1);
            return false;
        }
        let mut v = self.neighbours[k as usize][1];
        while v != i {
            if *left_tests == 0 {
                return false;
            }
            *left_tests -= 1;
            let p = self.flat[v as usize];
            let is_inside = turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
            // A slit names its corners twice; its twin is no obstacle.
            if is_inside && p != a && p != b && p != c {
                return false;
            }
            v = self.neighbours[v as usize][1];
        }
        true
    }
}

/// Twice the signed area of a triangle.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Corners of the polygon that a fan came from.
fn corners<T: Copy>(fan: &[[T; 3]]) -> impl Iterator<Item = T> + '_ {
    fan[0][..2].iter().copied().chain(fan.iter().map(|t| t[2]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fan(n: u32) -> Vec<[u32; 3]> {
        (2..n).map(|i| [0, i - 1, i]).collect()
    }

    /// Cuts the polygon in a tilted plane; the triangles, if it had to be cut.
    fn cut(outline: &[[f64; 2]]) -> Option<Vec<[u32; 3]>> {
        let (u, v) = (DVec3::new(0.8, 0.0, 0.6), DVec3::new(-0.36, 0.8, 0.48));
        let positions: Vec<_> = outline
            .iter()
            .map(|p| u * p[0] + v * p[1] + DVec3::splat(9.0))
            .collect();
        let mut triangles = fan(positions.len() as u32);
        let mut cutter = Cutter::default();
        if !cutter.cut(&positions, &triangles) {
            return None;
        }
        cutter.apply(&mut triangles);
        Some(triangles)
    }

    fn area(outline: &[[f64; 2]], t: &[u32; 3]) -> f64 {
        let [a, b, c] = t.map(|v| DVec2::from_array(outline[v as usize]));
        0.5 * turn(a, b, c)
    }

    #[test]
    fn convex_polygons_keep_the_fan_of_the_file() {
        assert_eq!(cut(&[[0., 0.], [2., 0.], [3., 1.], [1., 2.], [0., 1.]]), None);
    }

    #[test]
    fn triangles_of_reflex_polygons_have_positive_area_and_fill_them() {
        let arrow = [[0., 0.], [2., -1.], [0., 3.], [-2., -1.]];
        let arrow: Vec<[f64; 2]> = (0..4).map(|i| arrow[(i + 1) % 4]).collect();
        let letter_l = vec![[1., 1.], [1., 3.], [0., 3.], [0., 0.], [3., 0.], [3., 1.]];
        let comb: Vec<[f64; 2]> = (0..40)
            .map(|i| [f64::from(i), if i % 2 == 0 { 5.0 } else { 1.0 }])
            .chain([[39., 0.], [0., 0.]])
            .rev()
            .collect();
        for outline in [arrow, letter_l, comb] {
            let n = outline.len();
            let whole: f64 = fan(n as u32).iter().map(|t| area(&outline, t)).sum();
            let Some(triangles) = cut(&outline) else {
                // Some corner may see all others.
                assert!(fan(n as u32).iter().all(|t| area(&outline, t) >= 0.0));
                continue;
            };
            assert_eq!(triangles.len(), n - 2);
            assert!(triangles.iter().all(|t| area(&outline, t) > 0.0), "{triangles:?}");
            let sum: f64 = triangles.iter().map(|t| area(&outline, t)).sum();
            assert!((sum - whole).abs() < 1e-12 && whole > 0.0, "{sum} for {whole}");
        }
    }

    /// A square hole joined to the outline by a slit, as many writers store it.
    #[test]
    fn a_hole_with_a_slit_stays_open() {
        let outline = vec![
            [0., 0.],
            [4., 0.],
            [4., 4.],
            [0., 4.],
            [0., 0.],
            [1., 1.],
            [1., 3.],
            [3., 3.],
            [3., 1.],
            [1., 1.],
        ];
        let triangles = cut(&outline).unwrap();
        let sum: f64 = triangles.iter().map(|t| area(&outline, t)).sum();
        assert!((sum - 12.0).abs() < 1e-12);
        let in_hole = |t: &[u32; 3]| {
            let c = t
                .map(|v| DVec2::from_array(outline[v as usize]))
                .iter()
                .sum::<DVec2>()
                / 3.0;
            (c - DVec2::splat(2.0)).abs().max_element() < 1.0
        };
        assert!(triangles.iter().all(|t| area(&outline, t) >= 0.0 && !in_hole(t)));
    }

    #[test]
    fn crossing_and_endless_polygons_stay_fans_and_end_soon() {
        let mut cutter = Cutter::default();
        let bow_tie = [[0., 0.], [2., 2.], [2., 0.], [0., 3.]].map(|p| DVec3::new(p[0], p[1], 0.0));
        let _ = cutter.cut(&bow_tie, &fan(4));
        // Points of a seeded walk: no simple polygon, and far too many to try all pairs of.
        let mut state = 1u64;
        let mut next = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 40) as f64
        };
        let walk: Vec<_> = (0..100_000).map(|_| DVec3::new(next(), next(), 0.0)).collect();
        let before = cutter.uncut;
        assert!(!cutter.cut(&walk, &fan(100_000)));
        assert_eq!(cutter.uncut, before + 1);
    }
}
