use glam::{DAffine3, DMat3, DVec3};

use crate::{Aabb, Frame, Interval, Jet, vectors};

/// The box on which a spline is defined, in its own coordinates, where it lies in the world, and how the field goes on
/// outside it: `f(clamp x) - g·|x - clamp x|`, clamped in the box's own coordinates, distance in the world.
#[derive(Clone, Debug)]
pub(crate) struct PlacedBox {
    pub min: DVec3,
    pub max: DVec3,
    pub world_from_local: DAffine3,
    pub local_from_world: DAffine3,
    /// `g`, per world length.
    pub slope: f64,
}

impl PlacedBox {
    /// World box round the box.
    pub fn world_box(&self) -> Aabb {
        Aabb {
            min: self.min,
            max: self.max,
        }
        .transformed(&self.world_from_local)
    }

    /// Local coordinates of `p`, clamped to the box, and the clamped-off part in world units.
    #[inline]
    pub fn clamp(&self, p: DVec3) -> (DVec3, DVec3) {
        let q = self.local_from_world.transform_point3(p);
        let inside = q.clamp(self.min, self.max);
        (inside, self.world_from_local.transform_vector3(q - inside))
    }

    /// How the clamped point follows `x`: only along the axes that are not clamped.
    fn follow(&self, q: DVec3) -> DMat3 {
        let free = DMat3::from_diagonal(DVec3::from_array(std::array::from_fn(|a| {
            f64::from(q[a] > self.min[a] && q[a] < self.max[a])
        })));
        self.world_from_local.matrix3 * free * self.local_from_world.matrix3
    }

    /// Adds the linear fall outside the box to value and gradient at the clamped point `q`.
    #[inline]
    pub fn extend(&self, inside: (f64, DVec3), q: DVec3, beyond: DVec3) -> (f64, DVec3) {
        let distance = beyond.length();
        if distance == 0.0 {
            return inside;
        }
        let follow = self.follow(q);
        let away = (DMat3::IDENTITY - follow).transpose() * (beyond / distance);
        (
            inside.0 - self.slope * distance,
            follow.transpose() * inside.1 - self.slope * away,
        )
    }

    /// [`Self::extend`] with the Hessian: `Fᵀ∇²f F - g Aᵀ(1 - nnᵀ)A/d`, where the clamped point moves by `F dx` and
    /// the distance `d n` to it by `A dx`.
    pub fn extend_jet(&self, inside: Jet, q: DVec3, beyond: DVec3) -> Jet {
        let distance = beyond.length();
        if distance == 0.0 {
            return inside;
        }
        let (value, gradient) = self.extend((inside.value, inside.gradient), q, beyond);
        let follow = self.follow(q);
        let leave = DMat3::IDENTITY - follow;
        let n = beyond / distance;
        let across = DMat3::IDENTITY - DMat3::from_cols(n * n.x, n * n.y, n * n.z);
        Jet {
            value,
            gradient,
            hessian: follow.transpose() * inside.hessian * follow
                - leave.transpose() * across * leave * (self.slope / distance),
        }
    }

    /// Interval of the fall `g·|x - clamp x|` over the local box `b`, of which `inside` is the clamped part.
    pub fn fall(&self, b: &Aabb, inside: &Aabb) -> Interval {
        let most = (inside.min - b.min).max(b.max - inside.max).max(DVec3::ZERO);
        if most == DVec3::ZERO {
            return Interval::point(0.0);
        }
        // Least distance beyond the box on each axis: only where the whole interval lies outside.
        let least = (b.min - self.max).max(self.min - b.max).max(DVec3::ZERO);
        let m = self.world_from_local.matrix3;
        let columns = [m.x_axis, m.y_axis, m.z_axis];
        let tilt = columns[0].dot(columns[1]).abs()
            + columns[1].dot(columns[2]).abs()
            + columns[0].dot(columns[2]).abs();
        let lengths = DVec3::from_array(columns.map(|c| c.length()));
        let (lo, hi) = if tilt <= 1e-12 * lengths.length_squared() {
            ((least * lengths).length(), (most * lengths).length())
        } else {
            (0.0, (most * lengths).element_sum())
        };
        let slack = 1e-12 * hi;
        Interval::new((lo - slack).max(0.0), hi + slack) * Interval::point(self.slope)
    }

    /// Intervals of the gradient over the local box `b`, of which `inside` is the clamped part, from those inside.
    pub fn extend_slopes(&self, inside_slopes: [Interval; 3], b: &Aabb, inside: &Aabb) -> [Interval; 3] {
        if self.fall(b, inside) == Interval::point(0.0) && b == inside {
            return inside_slopes;
        }
        // The clamped point moves by `F dx`, the way to it by `(1 - F) dx`, where `F` keeps some of the box's axes.
        let m = self.world_from_local.matrix3;
        let is_diagonal = m == DMat3::from_diagonal(m.diagonal());
        let norm = |m: DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
        let most = if is_diagonal {
            1.0
        } else {
            norm(m) * norm(self.local_from_world.matrix3)
        };
        let steepest = vectors::length(inside_slopes).hi * most;
        let fall = self.slope * if is_diagonal { 1.0 } else { 1.0 + most };
        vectors::ball((steepest + fall) * (1.0 + 1e-12))
    }

    /// Local coordinates of node `i` of a frame are `start + step·i`, axis by axis, if the frame lies along the box.
    pub fn alignment(&self, frame: &Frame) -> Option<(DVec3, DVec3)> {
        let map = self.local_from_world * frame.world_from_grid;
        let m = map.matrix3;
        let step = DVec3::new(m.x_axis.x, m.y_axis.y, m.z_axis.z);
        let turned = [
            m.x_axis.y, m.x_axis.z, m.y_axis.x, m.y_axis.z, m.z_axis.x, m.z_axis.y,
        ];
        let aligned =
            step.min_element() > 0.0 && turned.iter().all(|x| x.abs() <= 1e-12 * step.min_element());
        aligned.then_some((map.translation, step))
    }

    /// The cells of a frame from node `lo` to node `hi` in local coordinates; for an aligned frame without any slack,
    /// with the very coordinates that the nodes are evaluated at.
    pub fn frame_box(&self, frame: &Frame, lo: [i64; 3], hi: [i64; 3]) -> Aabb {
        let v = |a: [i64; 3]| DVec3::new(a[0] as f64, a[1] as f64, a[2] as f64);
        match self.alignment(frame) {
            Some((start, step)) => Aabb {
                min: start + step * v(lo),
                max: start + step * v(hi),
            },
            None => frame.world_box(lo, hi).transformed(&self.local_from_world),
        }
    }
}
