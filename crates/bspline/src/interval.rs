use std::ops::{Add, Mul, Neg, Sub};

/// A closed interval `[lo, hi]` of reals; every operation rounds outward, so the true result is never lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub lo: f64,
    /// Upper end, `>= lo`.
    pub hi: f64,
}

impl Interval {
    /// The whole line: the bound that is always sound.
    pub const EVERYTHING: Self = Self {
        lo: f64::NEG_INFINITY,
        hi: f64::INFINITY,
    };

    /// `[lo, hi]`.
    ///
    /// # Panics
    /// In debug builds if `lo > hi` or either is NaN.
    pub fn new(lo: f64, hi: f64) -> Self {
        debug_assert!(lo <= hi, "interval ends out of order: [{lo}, {hi}]");
        Self { lo, hi }
    }

    /// The interval that holds just `x`.
    pub fn point(x: f64) -> Self {
        Self { lo: x, hi: x }
    }

    /// `hi - lo`.
    pub fn width(self) -> f64 {
        self.hi - self.lo
    }

    /// Whether `x` lies inside, ends included.
    pub fn contains(self, x: f64) -> bool {
        self.lo <= x && x <= self.hi
    }

    /// Smallest interval holding both.
    pub fn hull(self, other: Self) -> Self {
        Self {
            lo: self.lo.min(other.lo),
            hi: self.hi.max(other.hi),
        }
    }

    /// What both allow: sound if both are. If rounding has left nothing between them, the gap itself.
    pub fn intersection(self, other: Self) -> Self {
        let (a, b) = (self.lo.max(other.lo), self.hi.min(other.hi));
        Self {
            lo: a.min(b),
            hi: a.max(b),
        }
    }

    /// `{ min(a, b) }`.
    pub fn min(self, other: Self) -> Self {
        Self {
            lo: self.lo.min(other.lo),
            hi: self.hi.min(other.hi),
        }
    }

    /// `{ max(a, b) }`.
    pub fn max(self, other: Self) -> Self {
        Self {
            lo: self.lo.max(other.lo),
            hi: self.hi.max(other.hi),
        }
    }

    /// Widened by `by >= 0` on both sides, rounded outward.
    pub fn widened(self, by: f64) -> Self {
        Self {
            lo: (self.lo - by).next_down(),
            hi: (self.hi + by).next_up(),
        }
    }

    /// `{ x² }`.
    pub fn square(self) -> Self {
        let (a, b) = (self.lo.abs(), self.hi.abs());
        let (small, large) = (a.min(b), a.max(b));
        let lo = if self.contains(0.0) {
            0.0
        } else {
            (small * small).next_down().max(0.0)
        };
        Self {
            lo,
            hi: (large * large).next_up(),
        }
    }

    /// `{ √x }` of the non-negative part.
    pub fn sqrt(self) -> Self {
        Self {
            lo: self.lo.max(0.0).sqrt().next_down().max(0.0),
            hi: self.hi.max(0.0).sqrt().next_up(),
        }
    }

    /// `{ x/√(x² + q) }` for `q` in `rest >= 0`: a component of a unit vector.
    ///
    /// It rises with `x`, and its magnitude falls with `q`. Where both may be 0 it is any number between -1 and 1.
    pub fn over_hypot(self, rest: Self) -> Self {
        if self.contains(0.0) && rest.lo <= 0.0 {
            return Self::new(-1.0, 1.0);
        }
        let at = |x: f64, q: f64| {
            if x == 0.0 {
                0.0
            } else {
                (1.0 / (1.0 + q.max(0.0) / x / x).sqrt()).copysign(x)
            }
        };
        let end = |x: f64, toward_one: bool| at(x, if toward_one { rest.lo } else { rest.hi });
        Self {
            lo: end(self.lo, self.lo < 0.0),
            hi: end(self.hi, self.hi > 0.0),
        }
        .widened(8.0 * f64::EPSILON)
    }

    /// `{ |x| }`.
    pub fn abs(self) -> Self {
        let (a, b) = (self.lo.abs(), self.hi.abs());
        Self {
            lo: if self.contains(0.0) { 0.0 } else { a.min(b) },
            hi: a.max(b),
        }
    }
}

/// `{ a·x }`, and the length of what lies in `a`, for a fixed vector and vectors known by their components' intervals.
pub(crate) mod vectors {
    use glam::{DMat3, DVec3};

    use super::Interval;

    /// `{ m v }`.
    pub fn transformed(m: DMat3, v: [Interval; 3]) -> [Interval; 3] {
        std::array::from_fn(|row| dot(m.row(row), v))
    }

    /// `{ a·v }`.
    pub fn dot(a: DVec3, v: [Interval; 3]) -> Interval {
        let terms: [Interval; 3] = std::array::from_fn(|i| Interval::point(a[i]) * v[i]);
        terms[0] + terms[1] + terms[2]
    }

    /// `{ |v| }`.
    pub fn length(v: [Interval; 3]) -> Interval {
        (v[0].square() + v[1].square() + v[2].square()).sqrt()
    }

    /// All vectors no longer than `length`, which may be infinite.
    pub fn ball(length: f64) -> [Interval; 3] {
        [Interval {
            lo: -length,
            hi: length,
        }; 3]
    }
}

impl Add for Interval {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self {
            lo: (self.lo + o.lo).next_down(),
            hi: (self.hi + o.hi).next_up(),
        }
    }
}

impl Sub for Interval {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self + -o
    }
}

impl Neg for Interval {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            lo: -self.hi,
            hi: -self.lo,
        }
    }
}

impl Mul for Interval {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        // 0·∞ is 0 here: the factor 0 is exact, the infinite end only a missing bound.
        let times = |a: f64, b: f64| if a == 0.0 || b == 0.0 { 0.0 } else { a * b };
        let p = [
            times(self.lo, o.lo),
            times(self.lo, o.hi),
            times(self.hi, o.lo),
            times(self.hi, o.hi),
        ];
        let lo = p.iter().copied().fold(f64::INFINITY, f64::min);
        let hi = p.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Self {
            lo: lo.next_down(),
            hi: hi.next_up(),
        }
    }
}
