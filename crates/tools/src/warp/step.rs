use bspline::{Aabb, Interval, Jet};
use glam::{DMat3, DVec3};

use super::zone::{Zone, outer_product};

/// A turn about an axis and a shift, in which each point takes part by its share `k` of a zone; given by the way back,
/// `v(y) = c + R(-θ k(y))(y - c) - k(y) δ`, which needs no solving. It does not fold where
/// `|∇k|·(|θ|·|distance from the axis| + |δ|) < 1`; turns that leave the share of a point as it is never do.
#[derive(Clone, Debug)]
pub(super) struct Step {
    pub zone: Zone,
    /// `c`.
    pub pivot: DVec3,
    /// Unit vector.
    pub axis: DVec3,
    /// `θ`.
    pub angle: f64,
    /// `δ`.
    pub shift: DVec3,
}

/// `v` at a point, and what its derivatives are made of.
struct Parts {
    /// `R(-θk)(y - c)`.
    turned: DVec3,
    /// `R`.
    turn: DMat3,
    k: f64,
    gradient: DVec3,
    hessian: DMat3,
}

impl Step {
    /// `v(y)`; `y` to the bit where it takes no part.
    pub fn back(&self, y: DVec3) -> DVec3 {
        let k = self.zone.value(y);
        if k == 0.0 {
            return y;
        }
        if self.angle == 0.0 {
            return y - k * self.shift;
        }
        self.pivot + rotation(self.axis, -self.angle * k) * (y - self.pivot) - k * self.shift
    }

    /// The point that `v` takes to `x`: by Newton's method, from a guess that is exact for turns that leave the share.
    pub fn forth(&self, x: DVec3) -> DVec3 {
        let k = self.zone.value(x);
        let mut y = self.pivot + rotation(self.axis, self.angle * k) * (x - self.pivot) + k * self.shift;
        for _ in 0..30 {
            let (at, jacobian) = self.back_jacobian(y);
            let step = jacobian.inverse() * (x - at);
            y += step;
            if step.length() <= 1e-15 * y.length().max(self.shift.length()) {
                break;
            }
        }
        y
    }

    /// `v` and its matrix of derivatives.
    pub fn back_jacobian(&self, y: DVec3) -> (DVec3, DMat3) {
        let parts = self.parts(y);
        (self.at(&parts), self.jacobian(&parts))
    }

    fn parts(&self, y: DVec3) -> Parts {
        let (k, gradient, hessian) = self.zone.jet(y);
        let turn = rotation(self.axis, -self.angle * k);
        Parts {
            turned: turn * (y - self.pivot),
            turn,
            k,
            gradient,
            hessian,
        }
    }

    fn at(&self, p: &Parts) -> DVec3 {
        self.pivot + p.turned - p.k * self.shift
    }

    /// `∂v = R + (-θ e×R(y - c) - δ) ∇kᵀ`.
    fn jacobian(&self, p: &Parts) -> DMat3 {
        p.turn + outer_product(-self.angle * self.axis.cross(p.turned) - self.shift, p.gradient)
    }

    /// The jet at `y` of `f(v(y))` from that of `f` at `v(y)`.
    pub fn pulled_back(&self, y: DVec3, f: &Jet) -> Jet {
        let p = self.parts(y);
        let jacobian = self.jacobian(&p);
        let g = f.gradient;
        // Derivatives of `g·R(α)(y - c)` by the angle, `α = -θk`.
        let along = g.dot(self.axis.cross(p.turned));
        let twice = g.dot(self.axis.cross(self.axis.cross(p.turned)));
        // By the angle and by y: `gᵀ [e]× R`.
        let mixed = p.turn.transpose() * g.cross(self.axis);
        let theta = -self.angle;
        let bend = outer_product(p.gradient, p.gradient) * (theta * theta * twice)
            + p.hessian * (theta * along - g.dot(self.shift))
            + (outer_product(p.gradient, mixed) + outer_product(mixed, p.gradient)) * theta;
        Jet {
            value: f.value,
            gradient: jacobian.transpose() * g,
            hessian: jacobian.transpose() * f.hessian * jacobian + bend,
        }
    }

    /// A box that holds `v(b)`.
    pub fn back_box(&self, b: &Aabb) -> Aabb {
        let k = self.zone.range(b);
        if k.hi == 0.0 {
            return *b;
        }
        // y - kδ + sin α (e×u) + (1 - cos α) e×(e×u), u = y - c.
        let (sine, versine) = turn_ranges(Interval::point(-self.angle) * k);
        let u: [Interval; 3] =
            std::array::from_fn(|a| Interval::new(b.min[a], b.max[a]) - Interval::point(self.pivot[a]));
        let once = cross(self.axis, u);
        let twice = cross(self.axis, once);
        let moved: [Interval; 3] = std::array::from_fn(|a| {
            Interval::new(b.min[a], b.max[a]) - k * Interval::point(self.shift[a])
                + sine * once[a]
                + versine * twice[a]
        });
        // Rounding of `back`, which sums in another order.
        let size = b.min.abs().max(b.max.abs()) + self.pivot.abs() + self.shift.abs();
        let slack = 1e-14 * size.element_sum();
        let end = |of: fn(&Interval) -> f64| DVec3::from_array(moved.each_ref().map(of));
        Aabb::new(end(|i| i.lo) - slack, end(|i| i.hi) + slack)
    }
}

/// Turns by `angle` about the unit vector `axis` (Rodrigues).
pub fn rotation(axis: DVec3, angle: f64) -> DMat3 {
    if angle == 0.0 {
        return DMat3::IDENTITY;
    }
    let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
    let cross = DMat3::from_cols(
        DVec3::new(0.0, axis.z, -axis.y),
        DVec3::new(-axis.z, 0.0, axis.x),
        DVec3::new(axis.y, -axis.x, 0.0),
    );
    DMat3::IDENTITY * cosine + cross * sine + outer_product(axis, axis) * (1.0 - cosine)
}

fn cross(a: DVec3, u: [Interval; 3]) -> [Interval; 3] {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        Interval::point(a[j]) * u[k] - Interval::point(a[k]) * u[j]
    })
}

/// `sin` and `1 - cos` over angles: neither changes faster than the angle.
fn turn_ranges(angle: Interval) -> (Interval, Interval) {
    let middle = 0.5 * (angle.lo + angle.hi);
    let reach = 0.5 * angle.width() + 1e-14 * (1.0 + middle.abs());
    let about = |value: f64, lo: f64, hi: f64| {
        Interval::point(value)
            .widened(reach)
            .intersection(Interval::new(lo, hi))
    };
    (
        about(libm::sin(middle), -1.0, 1.0),
        about(1.0 - libm::cos(middle), 0.0, 2.0),
    )
}
