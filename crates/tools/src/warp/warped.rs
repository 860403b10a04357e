use std::sync::Arc;

use bspline::{Aabb, Field, Frame, Interval, Jet};
use glam::DVec3;

use super::Warp;

/// `f(w⁻¹(x))`: a field carried by a motion.
#[derive(Clone)]
pub struct Warped {
    field: Arc<dyn Field>,
    warp: Warp,
}

impl Warped {
    /// `field` carried by `warp`.
    pub fn new(field: Arc<dyn Field>, warp: Warp) -> Self {
        Self { field, warp }
    }
}

impl Field for Warped {
    fn value(&self, p: DVec3) -> f64 {
        self.field.value(self.warp.back(p))
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let (at, jacobian) = self.warp.back_jacobian(p);
        let (value, gradient) = self.field.value_gradient(at);
        (value, jacobian.transpose() * gradient)
    }

    fn jet(&self, p: DVec3) -> Jet {
        let mut places = vec![p];
        for step in self.warp.steps.iter().rev() {
            places.push(step.back(places[places.len() - 1]));
        }
        let jet = self.field.jet(places[places.len() - 1]);
        let back = self.warp.steps.iter().zip(places.iter().rev().skip(1));
        back.fold(jet, |jet, (step, place)| step.pulled_back(*place, &jet))
    }

    /// Step by step in boxes along the axes: wide for motions of many steps, and narrow only for narrow boxes.
    fn bounds(&self, b: &Aabb) -> Interval {
        self.field.bounds(&self.warp.back_box(b))
    }

    /// Where nothing moves, the field's own values to the bit.
    fn frame_values(&self, frame: &Frame, lo: [i64; 3], count: [usize; 3], out: &mut [f64]) {
        let last = std::array::from_fn(|a| lo[a] + count[a] as i64 - 1);
        if count.contains(&0) || self.warp.rests_in(&frame.world_box(lo, last)) {
            return self.field.frame_values(frame, lo, count, out);
        }
        for (i, value) in out.iter_mut().enumerate() {
            let at = [i / count[2] / count[1], i / count[2] % count[1], i % count[2]];
            *value = self.value(frame.node(std::array::from_fn(|a| lo[a] + at[a] as i64)));
        }
    }
}
