//! Many points at once: the way down the tree of bricks is saved where the next point lies in the same brick.

use glam::{DMat3, DVec3};

use super::HierarchicalSpline;
use super::brick::BRICK;
use super::kernel;
use super::spline::Place;
use crate::{Jet, Real};

impl<T: Real> HierarchicalSpline<T> {
    /// The order of `points` by the level, the brick and the cell that evaluate them, as indices into `points`.
    ///
    /// Asked in this order, [`values_gradients`](crate::Field::values_gradients) reads each brick once. Points of
    /// one cell keep their order.
    ///
    /// # Panics
    /// If there are more than `u32::MAX` points.
    pub fn evaluation_order(&self, points: &[DVec3]) -> Vec<u32> {
        assert!(
            u32::try_from(points.len()).is_ok(),
            "points are numbered with 32 bits"
        );
        let mut last = None;
        let mut keyed: Vec<(u128, u32)> = Vec::with_capacity(points.len());
        for (i, p) in points.iter().enumerate() {
            let at = self.place_after(last.as_ref(), self.place.clamp(*p).0);
            let start = at.brick.level as u128;
            let brick = at
                .brick
                .key
                .0
                .iter()
                .fold(start, |key, &k| key << 32 | u128::from(k));
            let cell = (at.cell[0] * BRICK + at.cell[1]) * BRICK + at.cell[2];
            keyed.push((brick << (3 * BRICK.ilog2()) | cell as u128, i as u32));
            last = Some(at);
        }
        keyed.sort_unstable();
        keyed.into_iter().map(|(_, i)| i).collect()
    }
}

/// Value and gradient of each point, with the bits that the single point would have.
pub(super) fn values_gradients<T: Real>(
    f: &HierarchicalSpline<T>,
    points: &[DVec3],
    out: &mut [(f64, DVec3)],
) {
    assert_eq!(points.len(), out.len(), "one output slot per point");
    let mut last = None;
    let (pairs, alone) = points.as_chunks::<2>();
    let (pairs_out, alone_out) = out.as_chunks_mut::<2>();
    for ([p, r], [o, s]) in pairs.iter().zip(pairs_out) {
        let ((q, beyond), (u, beyond_too)) = (f.place.clamp(*p), f.place.clamp(*r));
        let a = f.place_after(last.as_ref(), q);
        let b = f.place_after(Some(&a), u);
        let [at_a, at_b] = kernel::values_gradients_of_two([a.cell_point(), b.cell_point()]);
        *o = f.place.extend(a.in_world(&f.place, at_a), q, beyond);
        *s = f.place.extend(b.in_world(&f.place, at_b), u, beyond_too);
        last = Some(b);
    }
    for (p, o) in alone.iter().zip(alone_out) {
        let (q, beyond) = f.place.clamp(*p);
        let at = f.place_after(last.as_ref(), q);
        *o = f.place.extend(at.value_gradient(&f.place), q, beyond);
    }
}

/// Value, gradient and Hessian of each point, with the bits that the single point would have.
pub(super) fn jets<T: Real>(f: &HierarchicalSpline<T>, points: &[DVec3], out: &mut [Jet]) {
    assert_eq!(points.len(), out.len(), "one output slot per point");
    let mut last = None;
    for (p, o) in points.iter().zip(out) {
        let (jet, place) = jet_after(f, last.as_ref(), *p);
        *o = jet;
        last = Some(place);
    }
}

/// Value, gradient and Hessian of a point, and where it was found.
#[inline]
pub(super) fn jet_after<'a, T: Real>(
    f: &'a HierarchicalSpline<T>,
    last: Option<&Place<'a, T>>,
    p: DVec3,
) -> (Jet, Place<'a, T>) {
    let (q, beyond) = f.place.clamp(p);
    let at = f.place_after(last, q);
    let (value, gradient, second) = kernel::jet(at.brick.own_totals(), at.cell, at.t);
    let [xx, yy, zz, xy, xz, yz] = second.map(T::as_f64);
    let h = DMat3::from_cols(
        DVec3::new(xx, xy, xz),
        DVec3::new(xy, yy, yz),
        DVec3::new(xz, yz, zz),
    );
    let m = f.lattice_from_world().matrix3 * at.brick.scale();
    let inside = Jet {
        value: value.as_f64(),
        gradient: at.world_gradient(&f.place, gradient),
        hessian: m.transpose() * h * m,
    };
    (f.place.extend_jet(inside, q, beyond), at)
}
