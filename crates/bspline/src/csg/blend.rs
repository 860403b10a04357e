use std::any::Any;
use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::{CsgError, Operation, changed_branches, node_of};
use crate::{Aabb, Field, Frame, Interval, Jet, vectors};

/// How a smooth union rounds the crease `f = g` of the sharp one; an intersection is the mirror image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rounding {
    /// `max(f, g) + h³/6k²` with `h = max(k - |f - g|, 0)`, `k` the range: the sharp operation wherever `|f - g| >= k`,
    /// to the bit, and C² wherever the branches are. Solids grow (unions) or shrink (intersections) by `k/6` along the
    /// crease; among distances whose surfaces meet at a right angle the fillet begins `k` from it.
    ///
    /// `0 < k`, in the unit of the field: for a distance the world's, else a length times the local `|∇f|`.
    /// [Quilez13, the cubic one of the polynomial smooth maxima; Pasko05 on blends limited in range]
    Bounded {
        /// `k`.
        range: f64,
    },
    /// `f + g + √(f² + g² + ε²)`, values counted from the iso-value: Rvachev's R₀ disjunction for `ε = 0`, whose
    /// surface is that of the sharp union to the point, and the field smooth as the branches but along the crease of
    /// the surfaces, `f = g = c`, where its gradient jumps. With `ε > 0` it is smooth there too, and the surface the
    /// hyperbola `2(f - c)(g - c) = ε²` near the crease.
    ///
    /// The gradient on a surface away from the crease is that of its branch, but elsewhere values are not those of the
    /// branches: up to `2 + √2` times as large inside both, down to `2 - √2` outside.
    /// [Rvachev82; Pasko95 eq. 4; Shapiro07]
    Rvachev {
        /// `ε >= 0`, in the unit of the field.
        rounding: f64,
    },
}

/// A smooth union or intersection of two fields.
///
/// Symmetric in its branches to the bit, and De Morgan's laws hold: it commutes with the complement at its iso-value.
#[derive(Clone)]
pub struct Blend {
    operation: Operation,
    rounding: Rounding,
    iso: f64,
    branches: [Arc<dyn Field>; 2],
}

/// A smooth function of the two branches: value, first derivatives, and `∂²/∂f²`, `∂²/∂f∂g`, `∂²/∂g²`.
#[derive(Clone, Copy)]
struct Mix {
    value: f64,
    first: [f64; 2],
    second: [f64; 3],
}

impl Mix {
    /// The sharp maximum; the first branch where both are equal.
    fn sharp(f: f64, g: f64) -> Self {
        let first = if g > f { [0.0, 1.0] } else { [1.0, 0.0] };
        Self {
            value: if g > f { g } else { f },
            first,
            second: [0.0; 3],
        }
    }
}

impl Rounding {
    fn check(self) -> Result<Self, CsgError> {
        let (name, value, is_allowed, allowed) = match self {
            Self::Bounded { range } => ("the range of a blend", range, range > 0.0, "positive"),
            Self::Rvachev { rounding } => ("the rounding of a blend", rounding, rounding >= 0.0, "0 or more"),
        };
        if !value.is_finite() {
            return Err(CsgError::NotFinite { name, value });
        }
        if !is_allowed {
            return Err(CsgError::OutOfRange { name, value, allowed });
        }
        Ok(self)
    }

    /// The smooth maximum of two values, counted from the iso-value.
    fn union(self, f: f64, g: f64) -> Mix {
        match self {
            Self::Bounded { range: k } => {
                let apart = (f - g).abs();
                if apart >= k {
                    return Mix::sharp(f, g);
                }
                let share = (k - apart) / k;
                let (loser, bend) = (0.5 * share * share, share / k);
                let sharp = Mix::sharp(f, g);
                Mix {
                    value: sharp.value + k * share * share * share / 6.0,
                    first: sharp.first.map(|w| if w == 1.0 { 1.0 - loser } else { loser }),
                    second: [bend, -bend, bend],
                }
            }
            Self::Rvachev { rounding } => {
                // Scaled, so that no square leaves the range of numbers.
                let m = f.abs().max(g.abs()).max(rounding);
                if m == 0.0 || !m.is_finite() {
                    return Mix::sharp(f, g);
                }
                let (f, g, e) = (f / m, g / m, rounding / m);
                let (f2, g2, e2) = (f * f, g * g, e * e);
                let s = (f2 + g2 + e2).sqrt();
                // The forms without cancellation: (s + a)(s - a) = s² - a².
                let value = match f + g {
                    sum if sum < 0.0 => (e2 - 2.0 * f * g) / (s - sum),
                    sum => sum + s,
                };
                let first = |a: f64, rest: f64| {
                    if a < 0.0 {
                        rest / ((s - a) * s)
                    } else {
                        1.0 + a / s
                    }
                };
                let s3 = s * s * s * m;
                Mix {
                    value: value * m,
                    first: [first(f, g2 + e2), first(g, f2 + e2)],
                    second: [(g2 + e2) / s3, -f * g / s3, (f2 + e2) / s3],
                }
            }
        }
    }

    /// `{ ∂F/∂f }` over ranges of both values, counted from the iso-value.
    fn weight(self, f: Interval, g: Interval) -> Interval {
        match self {
            Self::Bounded { range: k } => {
                let d = f - g;
                let weight = |d: f64| {
                    let share = ((k - d.abs()) / k).max(0.0);
                    let loser = 0.5 * share * share;
                    if d < 0.0 { loser } else { 1.0 - loser }
                };
                Interval {
                    lo: weight(d.lo),
                    hi: weight(d.hi),
                }
            }
            Self::Rvachev { rounding } => {
                let rest = g.square() + Interval::point(rounding).square();
                Interval::point(1.0) + f.over_hypot(rest)
            }
        }
        .widened(16.0 * f64::EPSILON)
    }

    /// `{ F }`: it rises with both values.
    fn range(self, f: Interval, g: Interval) -> Interval {
        let end = |a: f64, b: f64| {
            // With one branch at -∞ the union is the other branch.
            let value = if a.is_finite() && b.is_finite() {
                self.union(a, b).value
            } else {
                a.max(b)
            };
            let size = match self {
                Self::Bounded { range } => range,
                Self::Rvachev { rounding } => rounding,
            };
            let magnitude = |x: f64| if x.is_finite() { x.abs() } else { 0.0 };
            (value, 16.0 * f64::EPSILON * (magnitude(a) + magnitude(b) + size))
        };
        let ((lo, lo_off), (hi, hi_off)) = (end(f.lo, g.lo), end(f.hi, g.hi));
        Interval {
            lo: (lo - lo_off).next_down(),
            hi: (hi + hi_off).next_up(),
        }
    }
}

impl Blend {
    /// `operation` on two fields about the iso-value `iso`.
    ///
    /// # Errors
    /// [`CsgError::NotFinite`], [`CsgError::OutOfRange`].
    pub fn new(
        operation: Operation,
        rounding: Rounding,
        branches: [Arc<dyn Field>; 2],
        iso: f64,
    ) -> Result<Self, CsgError> {
        if !iso.is_finite() {
            return Err(CsgError::NotFinite {
                name: "the iso-value",
                value: iso,
            });
        }
        Ok(Self {
            operation,
            rounding: rounding.check()?,
            iso,
            branches,
        })
    }

    /// Union or intersection.
    pub fn operation(&self) -> Operation {
        self.operation
    }

    /// How the crease is rounded.
    pub fn rounding(&self) -> Rounding {
        self.rounding
    }

    /// The two fields.
    pub fn branches(&self) -> &[Arc<dyn Field>; 2] {
        &self.branches
    }

    /// -1 for an intersection, which is the union of the complements, turned.
    fn sign(&self) -> f64 {
        match self.operation {
            Operation::Union => 1.0,
            Operation::Intersection => -1.0,
        }
    }

    /// What values are counted from; 0 where that makes no difference, so that values far from the crease keep their
    /// bits.
    fn origin(&self) -> f64 {
        match self.rounding {
            Rounding::Bounded { .. } => 0.0,
            Rounding::Rvachev { .. } => self.iso,
        }
    }

    fn mix(&self, f: f64, g: f64) -> Mix {
        let (sign, origin) = (self.sign(), self.origin());
        let mix = self.rounding.union(sign * (f - origin), sign * (g - origin));
        Mix {
            value: sign * mix.value + origin,
            first: mix.first,
            second: mix.second.map(|s| sign * s),
        }
    }

    /// Both ranges as the union sees them.
    fn counted(&self, ranges: [Interval; 2]) -> [Interval; 2] {
        let origin = Interval::point(self.origin());
        ranges.map(|r| match self.operation {
            Operation::Union => r - origin,
            Operation::Intersection => origin - r,
        })
    }

    fn combine(&self, ranges: [Interval; 2]) -> Interval {
        let [f, g] = self.counted(ranges);
        let range = self.rounding.range(f, g);
        let range = match self.operation {
            Operation::Union => range,
            Operation::Intersection => -range,
        };
        range + Interval::point(self.origin())
    }

    /// The branch that alone counts where values lie in `ranges`, if there is one.
    fn only(&self, [f, g]: [Interval; 2]) -> Option<&dyn Field> {
        let Rounding::Bounded { range } = self.rounding else {
            return None;
        };
        // Differences round in order, so that what holds for the ends holds for the values.
        let (first, second) = match self.operation {
            Operation::Union => (f.lo - g.hi >= range, g.lo - f.hi >= range),
            Operation::Intersection => (g.lo - f.hi >= range, f.lo - g.hi >= range),
        };
        match (first, second) {
            (true, _) => Some(self.branches[0].as_ref()),
            (_, true) => Some(self.branches[1].as_ref()),
            _ => None,
        }
    }

    fn value_gradient_of(&self, f: (f64, DVec3), g: (f64, DVec3)) -> (f64, DVec3) {
        let mix = self.mix(f.0, g.0);
        match mix.first {
            // A branch that does not count may have any gradient.
            [_, 0.0] if mix.first[0] == 1.0 => (mix.value, f.1),
            [0.0, _] if mix.first[1] == 1.0 => (mix.value, g.1),
            [u, v] => (mix.value, u * f.1 + v * g.1),
        }
    }
}

impl Field for Blend {
    fn value(&self, p: DVec3) -> f64 {
        let [f, g] = self.branches.each_ref().map(|b| b.value(p));
        self.mix(f, g).value
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let [f, g] = self.branches.each_ref().map(|b| b.value_gradient(p));
        self.value_gradient_of(f, g)
    }

    /// `F_f ∇²f + F_g ∇²g + F_ff ∇f∇fᵀ + F_fg (∇f∇gᵀ + ∇g∇fᵀ) + F_gg ∇g∇gᵀ`.
    fn jet(&self, p: DVec3) -> Jet {
        let values = self.branches.each_ref().map(|b| b.value_gradient(p));
        let (value, gradient) = self.value_gradient_of(values[0], values[1]);
        let mix = self.mix(values[0].0, values[1].0);
        let [f, g] = self.branches.each_ref().map(|b| b.jet(p));
        let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
        let (a, b) = (f.gradient, g.gradient);
        let mut hessian = DMat3::ZERO;
        for (w, branch) in mix.first.into_iter().zip([&f, &g]) {
            if w != 0.0 {
                hessian += branch.hessian * w;
            }
        }
        if mix.second != [0.0; 3] {
            hessian += outer(a, a) * mix.second[0]
                + (outer(a, b) + outer(b, a)) * mix.second[1]
                + outer(b, b) * mix.second[2];
        }
        Jet {
            value,
            gradient,
            hessian,
        }
    }

    fn bounds(&self, b: &Aabb) -> Interval {
        self.combine(self.branches.each_ref().map(|branch| branch.bounds(b)))
    }

    fn gradient_bounds(&self, b: &Aabb) -> [Interval; 3] {
        let ranges = self.branches.each_ref().map(|branch| branch.bounds(b));
        let [f, g] = self.counted(ranges);
        let weights = [self.rounding.weight(f, g), self.rounding.weight(g, f)];
        let [u, v] = self.branches.each_ref().map(|branch| branch.gradient_bounds(b));
        std::array::from_fn(|a| {
            let sum = weights[0] * u[a] + weights[1] * v[a];
            match self.rounding {
                // The weights sum to 1.
                Rounding::Bounded { .. } => {
                    sum.intersection(u[a].hull(v[a]).widened(1e-14 * (u[a].abs().hi + v[a].abs().hi)))
                }
                Rounding::Rvachev { .. } => sum,
            }
        })
    }

    fn bounds_along(&self, from: DVec3, to: DVec3) -> Interval {
        self.combine(
            self.branches
                .each_ref()
                .map(|branch| branch.bounds_along(from, to)),
        )
    }

    fn changed_boxes(&self, before: &dyn Field, within: &Aabb) -> Vec<Aabb> {
        let kind = |node: &Self| (node.operation, node.rounding, node.iso);
        let before = node_of::<Self>(before).filter(|before| kind(self) == kind(before));
        changed_branches(
            before.map(|before| self.branches.iter().zip(&before.branches)),
            within,
        )
    }

    fn as_any(&self) -> Option<&dyn Any> {
        Some(self)
    }

    /// The formula of [`Field::jet`] with norms; the second derivatives of both roundings have the sign pattern of a
    /// square, so that `|F_fg| <= √(F_ff F_gg)`.
    fn hessian_bound(&self, b: &Aabb) -> f64 {
        let ranges = self.branches.each_ref().map(|branch| branch.bounds(b));
        if let Some(only) = self.only(ranges) {
            return only.hessian_bound(b);
        }
        let [f, g] = self.counted(ranges);
        let weights = [self.rounding.weight(f, g), self.rounding.weight(g, f)].map(|w| w.abs().hi);
        let slopes = self
            .branches
            .each_ref()
            .map(|branch| vectors::length(branch.gradient_bounds(b)).hi);
        let bend = match self.rounding {
            Rounding::Bounded { range } => {
                let apart = (f - g).abs().lo;
                (1.0 - apart / range).max(0.0) / range
            }
            // `∂²/∂f² <= 1/s`, `s² = f² + g² + ε²`.
            Rounding::Rvachev { rounding } => {
                1.0 / (f.square() + g.square() + Interval::point(rounding).square())
                    .sqrt()
                    .lo
            }
        };
        let branches = self.branches.each_ref().map(|branch| branch.hessian_bound(b));
        let sum: f64 = (0..2)
            .map(|i| {
                if weights[i] == 0.0 {
                    0.0
                } else {
                    weights[i] * branches[i]
                }
            })
            .sum();
        let crease = if bend == 0.0 {
            0.0
        } else {
            bend * (slopes[0] + slopes[1]).powi(2)
        };
        (sum + crease) * (1.0 + 1e-9)
    }

    fn values_gradients(&self, points: &[DVec3], out: &mut [(f64, DVec3)]) {
        assert_eq!(points.len(), out.len(), "one output slot per point");
        let mut second = vec![(0.0, DVec3::ZERO); points.len()];
        self.branches[0].values_gradients(points, out);
        self.branches[1].values_gradients(points, &mut second);
        for (o, g) in out.iter_mut().zip(second) {
            *o = self.value_gradient_of(*o, g);
        }
    }

    fn frame_values(&self, frame: &Frame, lo: [i64; 3], count: [usize; 3], out: &mut [f64]) {
        assert_eq!(
            out.len(),
            count.iter().product::<usize>(),
            "one output slot per node"
        );
        if out.is_empty() {
            return;
        }
        let hi = std::array::from_fn(|a| lo[a] + count[a] as i64 - 1);
        let ranges = self.branches.each_ref().map(|b| b.frame_bounds(frame, lo, hi));
        if let Some(only) = self.only(ranges) {
            return only.frame_values(frame, lo, count, out);
        }
        let mut second = vec![0.0; out.len()];
        self.branches[0].frame_values(frame, lo, count, out);
        self.branches[1].frame_values(frame, lo, count, &mut second);
        for (o, g) in out.iter_mut().zip(second) {
            *o = self.mix(*o, g).value;
        }
    }

    /// Where the first branch is known.
    fn frame_values_from(
        &self,
        known: &dyn Field,
        values: &[f64],
        frame: &Frame,
        lo: [i64; 3],
        count: [usize; 3],
        out: &mut [f64],
    ) -> bool {
        let [first, second] = &self.branches;
        if !first.frame_values_from(known, values, frame, lo, count, out) {
            return false;
        }
        if out.is_empty() {
            return true;
        }
        let mut other = vec![0.0; out.len()];
        second.frame_values(frame, lo, count, &mut other);
        // Where one branch alone counts, as in the whole, rounding leaves its bits.
        let hi = std::array::from_fn(|a| lo[a] + count[a] as i64 - 1);
        let ranges = self.branches.each_ref().map(|b| b.frame_bounds(frame, lo, hi));
        match self.only(ranges) {
            Some(only) if std::ptr::addr_eq(only, first.as_ref()) => {}
            Some(_) => out.copy_from_slice(&other),
            None => {
                for (o, g) in out.iter_mut().zip(other) {
                    *o = self.mix(*o, g).value;
                }
            }
        }
        true
    }

    fn frame_bounds(&self, frame: &Frame, lo: [i64; 3], hi: [i64; 3]) -> Interval {
        self.combine(self.branches.each_ref().map(|b| b.frame_bounds(frame, lo, hi)))
    }
}
