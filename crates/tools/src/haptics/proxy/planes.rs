//! The place nearest to a goal in front of a few planes.

use glam::{DMat3, DVec3};

/// Most planes kept: three meet in a corner, one more while a smooth hollow is followed.
const MOST: usize = 4;
/// Share of a length by which rounding may put a place behind a plane.
const ROUNDING: f64 = 1e-9;

/// A half space `n·x ≥ b` that the proxy stays in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    /// Normal of length 1, into the air.
    pub normal: DVec3,
    pub at: f64,
}

impl Plane {
    pub fn through(p: DVec3, normal: DVec3) -> Self {
        Self {
            normal,
            at: normal.dot(p),
        }
    }

    /// How far in front of it a place is.
    pub fn height(&self, p: DVec3) -> f64 {
        self.normal.dot(p) - self.at
    }
}

/// Planes that the proxy rests on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Planes {
    planes: [Plane; MOST],
    count: usize,
}

impl Planes {
    pub fn none() -> Self {
        let plane = Plane {
            normal: DVec3::Z,
            at: 0.0,
        };
        Self {
            planes: [plane; MOST],
            count: 0,
        }
    }

    pub fn clear(&mut self) {
        self.count = 0;
    }

    fn all(&self) -> &[Plane] {
        &self.planes[..self.count]
    }

    /// Adds a plane, if there is one.
    pub fn add_all(&mut self, plane: Option<Plane>, p: DVec3) {
        if let Some(plane) = plane {
            self.add(plane, p);
        }
    }

    /// Adds a plane that is not there yet; where there are too many, the one farthest below `p` goes.
    pub fn add(&mut self, plane: Plane, p: DVec3) {
        let is_same = |old: &&mut Plane| old.normal.dot(plane.normal) > 1.0 - ROUNDING;
        if let Some(old) = self.planes[..self.count].iter_mut().find(is_same) {
            *old = plane;
            return;
        }
        if self.count < MOST {
            self.planes[self.count] = plane;
            self.count += 1;
            return;
        }
        let height = |i: &usize| self.planes[*i].height(p);
        let farthest = (0..MOST).max_by(|a, b| height(a).total_cmp(&height(b)));
        self.planes[farthest.expect("there are planes")] = plane;
    }

    /// The place nearest to `goal` in front of all planes. Where no place is in front of all, or planes meet too flat to tell
    /// where, `here`.
    pub fn nearest(&self, goal: DVec3, here: DVec3) -> DVec3 {
        let slack = ROUNDING * (1.0 + goal.distance(here));
        let is_in_front = |p: DVec3| self.all().iter().all(|plane| plane.height(p) >= -slack);
        if is_in_front(goal) {
            return goal;
        }
        let mut best: Option<(f64, DVec3)> = None;
        let mut offer = |p: Option<DVec3>| {
            if let Some(p) = p.filter(|p| is_in_front(*p)) {
                let away = p.distance_squared(goal);
                if best.is_none_or(|(least, _)| away < least) {
                    best = Some((away, p));
                }
            }
        };
        // The nearest place in front lies on one plane, on the line of two, or in the corner of three.
        for (i, a) in self.all().iter().enumerate() {
            offer(Some(goal - a.height(goal) * a.normal));
            for (j, b) in self.all()[..i].iter().enumerate() {
                offer(on_line(a, b, goal));
                for c in &self.all()[..j] {
                    offer(in_corner(a, b, c));
                }
            }
        }
        best.map_or(here, |(_, p)| p)
    }
}

/// The place on the line of two planes nearest to `goal`.
fn on_line(a: &Plane, b: &Plane, goal: DVec3) -> Option<DVec3> {
    let across = a.normal.dot(b.normal);
    let det = 1.0 - across * across;
    if det < ROUNDING {
        return None;
    }
    let (ha, hb) = (a.height(goal), b.height(goal));
    let (x, y) = ((ha - across * hb) / det, (hb - across * ha) / det);
    Some(goal - x * a.normal - y * b.normal)
}

fn in_corner(a: &Plane, b: &Plane, c: &Plane) -> Option<DVec3> {
    let rows = DMat3::from_cols(a.normal, b.normal, c.normal).transpose();
    (rows.determinant().abs() > ROUNDING).then(|| rows.inverse() * DVec3::new(a.at, b.at, c.at))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn planes(of: &[(DVec3, DVec3)]) -> Planes {
        let mut planes = Planes::none();
        for (p, n) in of {
            planes.add(Plane::through(*p, n.normalize()), DVec3::ZERO);
        }
        planes
    }

    #[test]
    fn the_nearest_place_is_that_of_many_tries() {
        let corner = planes(&[
            (DVec3::ZERO, DVec3::new(1.0, 0.2, 0.1)),
            (DVec3::ZERO, DVec3::new(-0.3, 1.0, 0.2)),
            (DVec3::ZERO, DVec3::new(0.1, -0.4, 1.0)),
        ]);
        let mut state = 7u64;
        let mut random = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        for _ in 0..200 {
            let goal = 4.0 * DVec3::new(random(), random(), random());
            let found = corner.nearest(goal, DVec3::splat(9.0));
            assert!(corner.all().iter().all(|p| p.height(found) > -1e-7));
            for _ in 0..300 {
                let other = found + 0.5 * DVec3::new(random(), random(), random());
                if corner.all().iter().all(|p| p.height(other) >= 0.0) {
                    assert!(other.distance(goal) >= found.distance(goal) - 1e-9);
                }
            }
        }
    }

    #[test]
    fn planes_that_leave_no_room_leave_the_proxy_where_it_is() {
        let gap = planes(&[(DVec3::X, DVec3::X), (-DVec3::X, -DVec3::X)]);
        assert_eq!(gap.nearest(DVec3::Y, DVec3::Z), DVec3::Z);
    }
}
