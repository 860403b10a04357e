//! The stateless contact of the second source: a ray along the gradient at the hand \[Kim03 §4.2, §4.3\].
//!
//! Kept beside [`Proxy`](super::Proxy) for comparison: it has no memory of the side from which the hand came, so it lets the hand
//! through thin solid. Mended: the midpoint is a sum, not a difference; the search ends when the value is small *or* the steps
//! are used up; the side is that of the midpoint; the factor of friction is cut to 0…1.

use glam::DVec3;

use super::coupling::{Coupling, Stretching, pressing};
use super::{Contact, Felt, Obstacle, Pose, Renderer};

/// What the stateless contact is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VcpOptions {
    /// Radius of the ball that touches, mm; 0 for a point.
    pub radius: f64,
    /// Between hand and contact.
    pub coupling: Coupling,
    /// Step along the ray, mm.
    pub step: f64,
    /// Most steps along the ray.
    pub steps: usize,
    /// Halvings of the step that crosses the surface.
    pub halvings: usize,
    /// Growth of friction with the depth, 1/mm.
    pub friction_per_mm: f64,
}

impl Default for VcpOptions {
    /// A ball of 2 mm on a spring of 500 N/m; contacts to 10⁻⁴ mm.
    fn default() -> Self {
        Self {
            radius: 2.0,
            coupling: Coupling::spring(500.0),
            step: 0.2,
            steps: 100,
            halvings: 11,
            friction_per_mm: 0.0,
        }
    }
}

/// The stateless contact.
#[derive(Clone, Debug)]
pub struct Vcp {
    options: VcpOptions,
    /// Contact of the last tick, for friction alone.
    last: Option<DVec3>,
    stretching: Stretching,
}

impl Vcp {
    /// A tool that has not been anywhere yet.
    pub fn new(options: VcpOptions) -> Self {
        Self {
            options,
            last: None,
            stretching: Stretching::default(),
        }
    }

    /// Where a ray leaves what is nearer to the solid than the radius; `None` if it does not.
    fn leaves(&self, obstacle: &dyn Obstacle, from: DVec3, direction: DVec3) -> Option<DVec3> {
        let is_clear = |p: DVec3| obstacle.distance(p).0 >= self.options.radius;
        let place = |n: usize| from + (n as f64 * self.options.step) * direction;
        let n = (1..=self.options.steps).find(|n| is_clear(place(*n)))?;
        let (mut inside, mut outside) = (place(n - 1), place(n));
        for _ in 0..self.options.halvings {
            let middle = 0.5 * (inside + outside);
            *(if is_clear(middle) {
                &mut outside
            } else {
                &mut inside
            }) = middle;
        }
        Some(outside)
    }

    /// The contact of a hand that is inside.
    fn contact(&mut self, obstacle: &dyn Obstacle, hand: DVec3, normal: DVec3) -> Option<DVec3> {
        let next = self.leaves(obstacle, hand, normal)?;
        let coefficient = obstacle.touch(next).friction;
        let Some(last) = self.last.filter(|_| coefficient > 0.0) else {
            return Some(next);
        };
        let depth = next.distance(hand);
        let held = (coefficient * (1.0 + depth * self.options.friction_per_mm)).clamp(0.0, 1.0);
        let lagging = last + (1.0 - held) * (next - last);
        let ray = (lagging - hand).try_normalize()?;
        self.leaves(obstacle, hand, ray).or(Some(next))
    }
}

impl Renderer for Vcp {
    fn tick(&mut self, obstacle: &dyn Obstacle, hand: &Pose, dt: f64) -> Felt {
        let (distance, gradient) = obstacle.distance(hand.at);
        let is_in = distance < self.options.radius;
        let normal = gradient.try_normalize().filter(|_| is_in);
        self.last = normal.and_then(|normal| self.contact(obstacle, hand.at, normal));
        let Some(at) = self.last else {
            self.stretching.end();
            return Felt::nothing(hand);
        };
        let stretch = at - hand.at;
        let speed = self.stretching.of(stretch, dt);
        let stiffness = self.options.coupling.in_series(obstacle.touch(at).stiffness);
        Felt {
            force: pressing(stretch, stiffness, self.options.coupling.damping, speed),
            torque: DVec3::ZERO,
            proxy: Pose { at, ..*hand },
            contact: Contact::Slides,
        }
    }

    fn reset(&mut self) {
        *self = Self::new(self.options);
    }
}
