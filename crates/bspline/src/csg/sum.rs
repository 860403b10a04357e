use std::any::Any;
use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::{CsgError, changed_branches, node_of};
use crate::{Aabb, Field, Frame, Interval, Jet};

/// `f = constant + Σ_i w_i f_i`, added in the order given.
///
/// Bounds add the branches' own, and so do those of the gradient; for several terms the mean-value form
/// `f(c) + ∇f(b)·(b - c)`, `c` the centre of the box, tells the first how the terms vary together.
#[derive(Clone)]
pub struct Sum {
    terms: Vec<(f64, Arc<dyn Field>)>,
    constant: f64,
}

impl Sum {
    /// # Errors
    /// [`CsgError::NotFinite`].
    pub fn new(terms: Vec<(f64, Arc<dyn Field>)>, constant: f64) -> Result<Self, CsgError> {
        let finite = |name, value: f64| {
            if value.is_finite() {
                Ok(())
            } else {
                Err(CsgError::NotFinite { name, value })
            }
        };
        finite("the constant", constant)?;
        terms.iter().try_for_each(|(w, _)| finite("a weight", *w))?;
        Ok(Self { terms, constant })
    }

    /// Weights and fields.
    pub fn terms(&self) -> &[(f64, Arc<dyn Field>)] {
        &self.terms
    }

    /// What is added to the weighted fields.
    pub fn constant(&self) -> f64 {
        self.constant
    }

    /// For several terms, if their gradients are known: `f(c) + ∇f(b)·(b - c)`.
    fn mean_value_form(&self, b: &Aabb) -> Option<Interval> {
        if self.terms.len() < 2 {
            return None;
        }
        let slopes = self.gradient_bounds(b);
        if slopes.iter().any(|g| !g.width().is_finite()) {
            return None;
        }
        // A box that is a point bounds the value there, rounding included.
        let (center, half) = (b.center(), b.size() * 0.5);
        let middle = Aabb {
            min: center,
            max: center,
        };
        let at_center = self.add_intervals(|field| field.bounds(&middle));
        let off = 2.0 * f64::EPSILON * center.abs().max_element();
        Some((0..3).fold(at_center, |sum, a| {
            sum + slopes[a] * Interval::new(-half[a], half[a]).widened(off)
        }))
    }

    fn add_intervals(&self, of: impl Fn(&dyn Field) -> Interval) -> Interval {
        self.terms
            .iter()
            .fold(Interval::point(self.constant), |sum, (w, field)| {
                sum + Interval::point(*w) * of(field.as_ref())
            })
    }
}

impl Field for Sum {
    fn value(&self, p: DVec3) -> f64 {
        self.terms
            .iter()
            .fold(self.constant, |sum, (w, field)| sum + w * field.value(p))
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        self.terms
            .iter()
            .fold((self.constant, DVec3::ZERO), |sum, (w, field)| {
                let (value, gradient) = field.value_gradient(p);
                (sum.0 + w * value, sum.1 + *w * gradient)
            })
    }

    fn jet(&self, p: DVec3) -> Jet {
        let zero = Jet {
            value: self.constant,
            gradient: DVec3::ZERO,
            hessian: DMat3::ZERO,
        };
        self.terms.iter().fold(zero, |sum, (w, field)| {
            let jet = field.jet(p);
            Jet {
                value: sum.value + w * jet.value,
                gradient: sum.gradient + *w * jet.gradient,
                hessian: sum.hessian + jet.hessian * *w,
            }
        })
    }

    fn bounds(&self, b: &Aabb) -> Interval {
        let plain = self.add_intervals(|field| field.bounds(b));
        self.mean_value_form(b)
            .map_or(plain, |mean| plain.intersection(mean))
    }

    fn gradient_bounds(&self, b: &Aabb) -> [Interval; 3] {
        self.terms
            .iter()
            .fold([Interval::point(0.0); 3], |sum, (w, field)| {
                let term = field.gradient_bounds(b);
                std::array::from_fn(|a| sum[a] + Interval::point(*w) * term[a])
            })
    }

    fn bounds_along(&self, from: DVec3, to: DVec3) -> Interval {
        self.add_intervals(|field| field.bounds_along(from, to))
    }

    fn changed_boxes(&self, before: &dyn Field, within: &Aabb) -> Vec<Aabb> {
        let same_weights = |before: &&Self| {
            let weights = |node: &Self| node.terms.iter().map(|t| t.0).collect::<Vec<_>>();
            self.constant == before.constant && weights(self) == weights(before)
        };
        let before = node_of::<Self>(before).filter(same_weights);
        let pairs = before.map(|before| self.terms.iter().zip(&before.terms));
        changed_branches(pairs.map(|p| p.map(|(now, before)| (&now.1, &before.1))), within)
    }

    fn as_any(&self) -> Option<&dyn Any> {
        Some(self)
    }

    fn hessian_bound(&self, b: &Aabb) -> f64 {
        let terms = self.terms.iter().filter(|(w, _)| *w != 0.0);
        terms
            .map(|(w, field)| w.abs() * field.hessian_bound(b))
            .sum::<f64>()
            * (1.0 + 1e-12)
    }

    fn values_gradients(&self, points: &[DVec3], out: &mut [(f64, DVec3)]) {
        assert_eq!(points.len(), out.len(), "one output slot per point");
        out.fill((self.constant, DVec3::ZERO));
        let mut term = vec![(0.0, DVec3::ZERO); points.len()];
        for (w, field) in &self.terms {
            field.values_gradients(points, &mut term);
            for (o, t) in out.iter_mut().zip(&term) {
                *o = (o.0 + w * t.0, o.1 + *w * t.1);
            }
        }
    }

    fn frame_values(&self, frame: &Frame, lo: [i64; 3], count: [usize; 3], out: &mut [f64]) {
        assert_eq!(
            out.len(),
            count.iter().product::<usize>(),
            "one output slot per node"
        );
        out.fill(self.constant);
        let mut term = vec![0.0; out.len()];
        for (w, field) in &self.terms {
            field.frame_values(frame, lo, count, &mut term);
            for (o, t) in out.iter_mut().zip(&term) {
                *o += w * t;
            }
        }
    }

    fn frame_bounds(&self, frame: &Frame, lo: [i64; 3], hi: [i64; 3]) -> Interval {
        let plain = self.add_intervals(|field| field.frame_bounds(frame, lo, hi));
        let mean = self.mean_value_form(&frame.world_box(lo, hi));
        mean.map_or(plain, |mean| plain.intersection(mean))
    }

    /// A single term is asked on which side of its own level it lies.
    fn frame_bounds_about(&self, frame: &Frame, lo: [i64; 3], hi: [i64; 3], level: f64) -> Interval {
        match self.terms[..] {
            [(w, ref field)] if w > 0.0 => {
                self.add_intervals(|_| field.frame_bounds_about(frame, lo, hi, (level - self.constant) / w))
            }
            _ => self.frame_bounds(frame, lo, hi),
        }
    }
}
