//! One point: `Σ_c w_c Σ_b w_b Σ_a w_a C_abc`, x summed first. `N` is the order along z, so that a row of coefficients is
//! an array.

use crate::{Basis, Real};

/// The functions of the three axes at one point and the coefficients that they weigh.
pub(super) struct Cell<'a, T> {
    pub coefficients: &'a [T],
    /// Coefficients from one x to the next, and from one y to the next.
    pub stride: [usize; 2],
    pub basis: [Basis<T>; 3],
}

impl<T: Real> Cell<'_, T> {
    /// Value.
    pub fn value(&self) -> T {
        match self.basis[2].values().len() {
            2 => self.sum::<2>([0; 3]),
            3 => self.sum::<3>([0; 3]),
            4 => self.sum::<4>([0; 3]),
            5 => self.sum::<5>([0; 3]),
            _ => self.sum::<6>([0; 3]),
        }
    }

    /// Value and gradient by parameters; the value has the bits of [`Self::value`].
    pub fn value_gradient(&self) -> (T, [T; 3]) {
        match self.basis[2].values().len() {
            2 => self.first::<2>(),
            3 => self.first::<3>(),
            4 => self.first::<4>(),
            5 => self.first::<5>(),
            _ => self.first::<6>(),
        }
    }

    /// Second derivatives by parameters: `xx, yy, zz, xy, xz, yz`.
    pub fn second(&self) -> [T; 6] {
        const ORDERS: [[usize; 3]; 6] = [[2, 0, 0], [0, 2, 0], [0, 0, 2], [1, 1, 0], [1, 0, 1], [0, 1, 1]];
        ORDERS.map(|d| match self.basis[2].values().len() {
            2 => self.sum::<2>(d),
            3 => self.sum::<3>(d),
            4 => self.sum::<4>(d),
            5 => self.sum::<5>(d),
            _ => self.sum::<6>(d),
        })
    }

    #[inline(always)]
    fn row<const N: usize>(&self, a: usize, b: usize) -> &[T; N] {
        let [x, y, z] = self.basis.each_ref().map(Basis::first);
        let start = (x + a) * self.stride[0] + (y + b) * self.stride[1] + z;
        self.coefficients[start..start + N]
            .try_into()
            .expect("N of a row")
    }

    /// One derivative of order `d` on each axis.
    #[inline(always)]
    fn sum<const N: usize>(&self, d: [usize; 3]) -> T {
        let [x, y, z] = [0, 1, 2].map(|a| self.basis[a].derivative(d[a]));
        let mut plane = [T::zero(); N];
        for (b, wy) in y.iter().enumerate() {
            let mut line = [T::zero(); N];
            for (a, wx) in x.iter().enumerate() {
                add(&mut line, *wx, self.row(a, b));
            }
            add(&mut plane, *wy, &line);
        }
        dot(z, &plane)
    }

    #[inline(always)]
    fn first<const N: usize>(&self) -> (T, [T; 3]) {
        let [x, y, z] = self.basis.each_ref().map(Basis::values);
        let [dx, dy, dz] = self.basis.each_ref().map(|b| b.derivative(1));
        let (mut plane, mut plane_dx, mut plane_dy) = ([T::zero(); N], [T::zero(); N], [T::zero(); N]);
        for b in 0..y.len() {
            let (mut line, mut line_dx) = ([T::zero(); N], [T::zero(); N]);
            for a in 0..x.len() {
                let row = self.row(a, b);
                add(&mut line, x[a], row);
                add(&mut line_dx, dx[a], row);
            }
            add(&mut plane, y[b], &line);
            add(&mut plane_dx, y[b], &line_dx);
            add(&mut plane_dy, dy[b], &line);
        }
        (
            dot(z, &plane),
            [dot(z, &plane_dx), dot(z, &plane_dy), dot(dz, &plane)],
        )
    }
}

#[inline(always)]
fn add<T: Real, const N: usize>(sum: &mut [T; N], w: T, row: &[T; N]) {
    for c in 0..N {
        sum[c] += w * row[c];
    }
}

#[inline(always)]
fn dot<T: Real, const N: usize>(w: &[T], row: &[T; N]) -> T {
    w.iter().zip(row).fold(T::zero(), |sum, (w, c)| sum + *w * *c)
}
