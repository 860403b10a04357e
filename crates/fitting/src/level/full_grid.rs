//! Coefficients of a whole level, dense, with the bending energy and the two-scale maps.

use bspline::Real;

/// All `(n+3)³` coefficients of a level with `n` cells along the box; z fastest.
#[derive(Clone, Debug)]
pub(crate) struct FullGrid<T> {
    /// Cells along the box.
    pub n: usize,
    /// Coefficient of function `(i, j, k)` at `((i+1)·m + j+1)·m + k+1`, `m = n + 3`.
    pub values: Vec<T>,
}

impl<T: Real> FullGrid<T> {
    pub fn zeros(n: usize) -> Self {
        Self {
            n,
            values: vec![T::zero(); (n + 3).pow(3)],
        }
    }

    /// Coefficients along one axis.
    pub fn width(&self) -> usize {
        self.n + 3
    }

    /// The same in another precision.
    pub fn converted<U: Real>(&self) -> FullGrid<U> {
        FullGrid {
            n: self.n,
            values: self.values.iter().map(|v| U::from_f64(v.as_f64())).collect(),
        }
    }

    /// The same function on the next level.
    pub fn refined(&self) -> Self {
        let (m, w) = (self.width(), 2 * self.n + 3);
        let mut values = self.values.clone();
        for [outer, inner] in [[m * m, 1], [m, w], [1, w * w]] {
            values = refine_axis(&values, outer, m, inner);
        }
        Self {
            n: 2 * self.n,
            values,
        }
    }

    /// Transpose of [`FullGrid::refined`].
    pub fn restricted(&self) -> Self {
        let (m, w) = (self.width(), self.n / 2 + 3);
        let mut values = self.values.clone();
        for [outer, inner] in [[m * m, 1], [m, w], [1, w * w]] {
            values = restrict_axis(&values, outer, m, inner);
        }
        Self {
            n: self.n / 2,
            values,
        }
    }
}

/// Refines the middle index of an array `[outer][m][inner]`.
fn refine_axis<T: Real>(source: &[T], outer: usize, m: usize, inner: usize) -> Vec<T> {
    let w = 2 * m - 3;
    let (half, eighth, six) = (T::from_f64(0.5), T::from_f64(0.125), T::from_f64(6.0));
    let mut target = Vec::with_capacity(outer * w * inner);
    for block in source.chunks_exact(m * inner) {
        for j in 0..w {
            let row = |p: usize| &block[p * inner..(p + 1) * inner];
            let (a, b) = (row(j / 2), row(j / 2 + 1));
            if j % 2 == 0 {
                target.extend((0..inner).map(|z| (a[z] + b[z]) * half));
            } else {
                let c = row(j / 2 + 2);
                target.extend((0..inner).map(|z| (a[z] + six * b[z] + c[z]) * eighth));
            }
        }
    }
    target
}

fn restrict_axis<T: Real>(source: &[T], outer: usize, m: usize, inner: usize) -> Vec<T> {
    let w = (m + 3) / 2;
    let (half, eighth, six) = (T::from_f64(0.5), T::from_f64(0.125), T::from_f64(6.0));
    let mut target = vec![T::zero(); outer * w * inner];
    for (block, out) in source
        .chunks_exact(m * inner)
        .zip(target.chunks_exact_mut(w * inner))
    {
        for j in 0..m {
            let weights: &[T] = if j % 2 == 0 {
                &[half, half]
            } else {
                &[eighth, six * eighth, eighth]
            };
            for (p, weight) in weights.iter().enumerate() {
                let start = (j / 2 + p) * inner;
                for z in 0..inner {
                    out[start + z] += *weight * block[j * inner + z];
                }
            }
        }
    }
    target
}

/// Adds `μ Σ[Σ_a (δ_aa C)² + 2 Σ_{a<b} (δ_ab C)²]`'s gradient/2 to `out`.
///
/// `δ_aa = (1, -2, 1)`, `δ_ab` the forward four-point difference, both only where all taps exist (natural
/// boundary). So the operator is `Σ_a S_a + 2 Σ_{a<b} G_a G_b` with the 1-D Gram matrices `S = δ₂ᵀδ₂` and
/// `G = δ₁ᵀδ₁`.
pub(crate) fn add_bending<T: Real>(x: &FullGrid<T>, mu: T, out: &mut FullGrid<T>) {
    let m = x.width();
    let strides = [m * m, m, 1];
    let mut gz = vec![T::zero(); x.values.len()];
    first_gram(&x.values, m, strides[2], T::one(), &mut gz);
    let mut gyz = gz.clone();
    first_gram(&x.values, m, strides[1], T::one(), &mut gyz);
    let two_mu = mu + mu;
    first_gram(&gz, m, strides[1], two_mu, &mut out.values);
    first_gram(&gyz, m, strides[0], two_mu, &mut out.values);
    for stride in strides {
        second_gram(&x.values, m, stride, mu, &mut out.values);
    }
}

/// Entry of the operator of [`add_bending`] with `μ = 1`, for the slots `a` and `b`.
pub(crate) fn bending_entry(m: usize, a: [usize; 3], b: [usize; 3]) -> f64 {
    if (0..3).any(|axis| a[axis].abs_diff(b[axis]) > 2) {
        return 0.0;
    }
    let equal: [f64; 3] = std::array::from_fn(|axis| f64::from(a[axis] == b[axis]));
    let first: [f64; 3] = std::array::from_fn(|axis| match a[axis].abs_diff(b[axis]) {
        0 if a[axis] == 0 || a[axis] == m - 1 => 1.0,
        0 => 2.0,
        1 => -1.0,
        _ => 0.0,
    });
    let second: [f64; 3] = std::array::from_fn(|axis| {
        let tap = |center: usize, i: usize| match center.abs_diff(i) {
            0 => -2.0,
            1 => 1.0,
            _ => 0.0,
        };
        let centers = a[axis].saturating_sub(1).max(1)..(a[axis] + 2).min(m - 1);
        centers.map(|c| tap(c, a[axis]) * tap(c, b[axis])).sum()
    });
    let mut sum = 0.0;
    for axis in 0..3 {
        let [next, last] = [(axis + 1) % 3, (axis + 2) % 3];
        sum += second[axis] * equal[next] * equal[last] + 2.0 * equal[axis] * first[next] * first[last];
    }
    sum
}

/// Diagonal of the operator of [`add_bending`] with `μ = 1`, at slot `(x, y, z)`.
pub(crate) fn bending_diagonal(m: usize, at: [usize; 3]) -> f64 {
    bending_entry(m, at, at)
}

/// Calls `f` with the start of every block `[m][stride]` of an array of `m³`.
#[inline(always)]
fn for_blocks(m: usize, stride: usize, mut f: impl FnMut(usize)) {
    for outer in 0..m * m / stride {
        f(outer * m * stride);
    }
}

/// `out += w·δ₁ᵀδ₁ x` along the axis of `stride`.
fn first_gram<T: Real>(x: &[T], m: usize, stride: usize, w: T, out: &mut [T]) {
    for_blocks(m, stride, |start| {
        for i in 0..m - 1 {
            let at = start + i * stride;
            for z in at..at + stride {
                let d = w * (x[z + stride] - x[z]);
                out[z + stride] += d;
                out[z] -= d;
            }
        }
    });
}

/// `out += w·δ₂ᵀδ₂ x` along the axis of `stride`.
fn second_gram<T: Real>(x: &[T], m: usize, stride: usize, w: T, out: &mut [T]) {
    for_blocks(m, stride, |start| {
        for i in 1..m - 1 {
            let at = start + i * stride;
            for z in at..at + stride {
                let d = w * (x[z + stride] - x[z] - x[z] + x[z - stride]);
                out[z + stride] += d;
                out[z] -= d + d;
                out[z - stride] += d;
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_those_of_the_operator() {
        let mut unit = FullGrid::<f64>::zeros(4);
        let m = unit.width();
        let place = |i: usize| [i / (m * m), i / m % m, i % m];
        for column in 0..m * m * m {
            let mut bent = FullGrid::zeros(4);
            unit.values[column] = 1.0;
            add_bending(&unit, 1.0, &mut bent);
            unit.values[column] = 0.0;
            for (row, found) in bent.values.iter().enumerate() {
                assert_eq!(
                    bending_entry(m, place(row), place(column)),
                    *found,
                    "{row} {column}"
                );
            }
        }
    }
}
