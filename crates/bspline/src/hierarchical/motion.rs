//! A block of coefficients that moves between two states, laid over a field.

use glam::{DMat3, DVec3};

use super::LevelEdit;
use crate::placed_box::PlacedBox;
use crate::{Aabb, Interval, Real, cubic, vectors};

/// What a moving region adds to a field: coefficients of a block of functions of one level at two moments. Between them
/// they go straight from one to the other.
#[derive(Clone, Debug)]
pub struct Motion<T> {
    level: usize,
    first: [u32; 3],
    shape: [usize; 3],
    /// z fastest.
    states: [Vec<T>; 2],
    times: [f64; 2],
}

impl<T: Real> Motion<T> {
    /// The functions `first .. first + shape` of `level`, numbered as in [`LevelEdit`], with the coefficients that they
    /// add at each of two times.
    ///
    /// # Panics
    /// If a state does not have a coefficient for each function, or the second time is not later than the first.
    pub fn new(
        level: usize,
        first: [u32; 3],
        shape: [usize; 3],
        states: [Vec<T>; 2],
        times: [f64; 2],
    ) -> Self {
        let count = shape.iter().product::<usize>();
        assert!(
            states.iter().all(|s| s.len() == count),
            "a coefficient for each function"
        );
        assert!(times[0] < times[1], "a motion takes time");
        Self {
            level,
            first,
            shape,
            states,
            times,
        }
    }

    /// What the last state adds, as edits.
    pub fn edits(&self) -> impl Iterator<Item = LevelEdit<T>> {
        let [_, ny, nz] = self.shape;
        self.states[1].iter().enumerate().map(move |(i, &delta)| {
            let at = [i / nz / ny, i / nz % ny, i % nz];
            LevelEdit {
                level: self.level,
                function: std::array::from_fn(|a| self.first[a] + at[a] as u32),
                delta,
            }
        })
    }

    /// How far the motion has come: 0 at the first state, 1 at the last.
    fn share(&self, t: f64) -> f64 {
        ((t - self.times[0]) / (self.times[1] - self.times[0])).clamp(0.0, 1.0)
    }

    /// Calls `visit` with the weights of derivatives `order` on each axis and the coefficient at both times of every
    /// function that reaches lattice point `q`.
    #[inline]
    fn gather(&self, q: DVec3, mut visit: impl FnMut([[f64; 3]; 3], [f64; 2])) {
        let scaled = q * self.scale();
        let cell = scaled.floor();
        let t = scaled - cell;
        let weights: [[[f64; 4]; 3]; 3] =
            std::array::from_fn(|a| [cubic::values(t[a]), cubic::first(t[a]), cubic::second(t[a])]);
        let start: [i64; 3] = std::array::from_fn(|a| cell[a] as i64 - i64::from(self.first[a]));
        let range = |a: usize| {
            let end = self.shape[a] as i64 - start[a];
            (-start[a]).clamp(0, 4) as usize..end.clamp(0, 4) as usize
        };
        for i in range(0) {
            for j in range(1) {
                for k in range(2) {
                    let at = [0, 1, 2].map(|a| (start[a] + [i, j, k][a] as i64) as usize);
                    let n = (at[0] * self.shape[1] + at[1]) * self.shape[2] + at[2];
                    let w = std::array::from_fn(|a| weights[a].map(|w| w[[i, j, k][a]]));
                    visit(w, [0, 1].map(|s| self.states[s][n].as_f64()));
                }
            }
        }
    }

    fn scale(&self) -> f64 {
        (1u64 << self.level) as f64
    }

    /// What is added to value and gradient at lattice point `q`, and its rate.
    pub(super) fn value_gradient_rate(&self, place: &PlacedBox, q: DVec3, t: f64) -> (f64, DVec3, f64) {
        let share = self.share(t);
        let (mut value, mut rate, mut gradient) = (0.0, 0.0, DVec3::ZERO);
        self.gather(q, |[x, y, z], [from, to]| {
            let c = from + share * (to - from);
            let w = x[0] * y[0] * z[0];
            value += w * c;
            rate += w * (to - from);
            gradient += c * DVec3::new(x[1] * y[0] * z[0], x[0] * y[1] * z[0], x[0] * y[0] * z[1]);
        });
        let moves = (self.times[0]..=self.times[1]).contains(&t);
        let rate = if moves {
            rate / (self.times[1] - self.times[0])
        } else {
            0.0
        };
        let gradient = place.local_from_world.matrix3.transpose() * (gradient * self.scale());
        (value, gradient, rate)
    }

    /// What the last state adds to the Hessian at lattice point `q`.
    pub(super) fn hessian(&self, place: &PlacedBox, q: DVec3) -> DMat3 {
        let mut sum = DMat3::ZERO;
        self.gather(q, |[x, y, z], [_, c]| {
            let (xy, xz, yz) = (x[1] * y[1] * z[0], x[1] * y[0] * z[1], x[0] * y[1] * z[1]);
            sum += c * DMat3::from_cols(
                DVec3::new(x[2] * y[0] * z[0], xy, xz),
                DVec3::new(xy, x[0] * y[2] * z[0], yz),
                DVec3::new(xz, yz, x[0] * y[0] * z[2]),
            );
        });
        let m = place.local_from_world.matrix3 * self.scale();
        m.transpose() * sum * m
    }

    /// Places in the block of the functions that reach a lattice box, and the one before the block's first.
    fn reached(&self, b: &Aabb) -> [std::ops::Range<i64>; 3] {
        std::array::from_fn(|a| {
            let [lo, hi] = [b.min[a], b.max[a]].map(|q| q * self.scale());
            let first = i64::from(self.first[a]);
            let clamp = |n: i64| n.clamp(-1, self.shape[a] as i64);
            clamp(lo.floor() as i64 - first)..clamp(hi.floor() as i64 + 4 - first).max(0)
        })
    }

    /// Least and largest coefficient at either time, at a place of the block; 0 beside it.
    fn at(&self, n: [i64; 3]) -> Interval {
        let is_inside = (0..3).all(|a| (0..self.shape[a] as i64).contains(&n[a]));
        if !is_inside {
            return Interval::point(0.0);
        }
        let [x, y, z] = n.map(|n| n as usize);
        let i = (x * self.shape[1] + y) * self.shape[2] + z;
        let [a, b] = [0, 1].map(|s| self.states[s][i].as_f64());
        Interval::new(a.min(b), a.max(b))
    }

    /// What is added over a lattice box, at any time.
    pub(super) fn bounds(&self, b: &Aabb) -> Interval {
        let [x, y, z] = self.reached(b);
        let mut hull: Option<Interval> = None;
        for i in x {
            for j in y.clone() {
                for k in z.clone() {
                    let own = self.at([i, j, k]);
                    hull = Some(hull.map_or(own, |hull| hull.hull(own)));
                }
            }
        }
        let hull = hull.unwrap_or(Interval::point(0.0));
        hull.widened(64.0 * f64::EPSILON * hull.lo.abs().max(hull.hi.abs()))
    }

    /// What is added to the gradient over a lattice box, at any time.
    pub(super) fn gradient_bounds(&self, place: &PlacedBox, b: &Aabb) -> [Interval; 3] {
        let [x, y, z] = self.reached(b);
        let mut hull = [Interval::point(0.0); 3];
        let mut largest = 0f64;
        for i in x {
            for j in y.clone() {
                for k in z.clone() {
                    let own = self.at([i, j, k]);
                    largest = largest.max(own.lo.abs()).max(own.hi.abs());
                    for (axis, hull) in hull.iter_mut().enumerate() {
                        let next = std::array::from_fn(|a| [i, j, k][a] + i64::from(a == axis));
                        *hull = hull.hull(self.at(next) - own);
                    }
                }
            }
        }
        let rounding = 64.0 * f64::EPSILON * largest;
        let local = hull.map(|h| h.widened(rounding) * Interval::point(self.scale()));
        vectors::transformed(place.local_from_world.matrix3.transpose(), local)
    }
}
