//! Small dense products along the axes of a three-dimensional array: the transforms of fast diagonalization.
//!
//! Multiplications and additions stay separate, so that all processors round alike.

use bspline::Real;
use nalgebra::DMatrix;

/// Lanes that the fastest axis is padded to.
pub(crate) const PAD: usize = 8;
/// Rows of the product computed together.
const ROWS: usize = 6;

/// `aᵀb`, summed in order: nalgebra's own product fuses multiplications and additions on machines that can.
pub(crate) fn transposed_product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(a.ncols(), b.ncols(), |i, j| {
        let terms = (0..a.nrows()).map(|k| a[(k, i)] * b[(k, j)]);
        terms.sum()
    })
}

/// A square matrix and its transpose, padded for products along any axis.
#[derive(Clone, Debug)]
pub(crate) struct DenseAxis<T> {
    /// Row-major, `n × n`.
    pub matrix: Vec<T>,
    /// Row-major, `n × n`.
    pub transposed: Vec<T>,
    /// Rows padded with zeros to a multiple of [`PAD`].
    pub matrix_padded: Vec<T>,
    /// Rows padded with zeros to a multiple of [`PAD`].
    pub transposed_padded: Vec<T>,
}

impl<T: Real> DenseAxis<T> {
    pub fn new(v: &DMatrix<f64>) -> Self {
        let n = v.nrows();
        let rows = |at: &dyn Fn(usize, usize) -> f64, width: usize| {
            let element = |e: usize| {
                let (i, j) = (e / width, e % width);
                T::from_f64(if j < n { at(i, j) } else { 0.0 })
            };
            (0..n * width).map(element).collect::<Vec<T>>()
        };
        let (straight, turned) = (|i: usize, j: usize| v[(i, j)], |i: usize, j: usize| v[(j, i)]);
        let width = n.next_multiple_of(PAD);
        Self {
            matrix: rows(&straight, n),
            transposed: rows(&turned, n),
            matrix_padded: rows(&straight, width),
            transposed_padded: rows(&turned, width),
        }
    }
}

/// `c = a b` with `a` of `m × k`, `b` of `k × n`, all row-major, `n` a multiple of [`PAD`].
#[inline(always)]
pub(crate) fn multiply<T: Real>(a: &[T], b: &[T], c: &mut [T], m: usize, k: usize, n: usize) {
    strips(a, k, b, n, c, n, m, k);
}

/// `c[line] = a[line] b` along the fastest axis: `a` has lines of `stride >= k` numbers, of which the first `k`
/// count; `b` is `k × n`, lines of `c` are `n` long, `n` a multiple of [`PAD`].
#[inline(always)]
pub(crate) fn multiply_last<T: Real>(a: &[T], stride: usize, b: &[T], c: &mut [T], k: usize, n: usize) {
    let m = a.len() / stride;
    strips(a, stride, b, n, c, n, m, k);
}

#[inline(always)]
fn strips<T: Real>(
    a: &[T],
    a_stride: usize,
    b: &[T],
    b_stride: usize,
    c: &mut [T],
    n: usize,
    m: usize,
    k: usize,
) {
    debug_assert!(n.is_multiple_of(PAD) && a.len() >= (m - 1) * a_stride + k && c.len() >= m * n);
    // Twelve vector registers of sums: two strips of eight lanes in single precision, of four in double.
    let wide = if size_of::<T>() == 4 { 2 * PAD } else { PAD };
    let mut j = 0;
    while j + wide <= n {
        let (b, c) = (&b[j..], &mut c[j..]);
        if size_of::<T>() == 4 {
            strip::<T, 16>(a, a_stride, b, b_stride, c, n, m, k);
        } else {
            strip::<T, PAD>(a, a_stride, b, b_stride, c, n, m, k);
        }
        j += wide;
    }
    if j < n {
        strip::<T, PAD>(a, a_stride, &b[j..], b_stride, &mut c[j..], n, m, k);
    }
}

/// `L` columns of the product.
#[inline(always)]
fn strip<T: Real, const L: usize>(
    a: &[T],
    a_stride: usize,
    b: &[T],
    b_stride: usize,
    c: &mut [T],
    c_stride: usize,
    m: usize,
    k: usize,
) {
    let whole = m / ROWS * ROWS;
    for i in (0..whole).step_by(ROWS) {
        let (a, c) = (&a[i * a_stride..], &mut c[i * c_stride..]);
        tile::<T, ROWS, L>(a, a_stride, b, b_stride, c, c_stride, k);
    }
    if whole == m {
        return;
    }
    let (a, c) = (&a[whole * a_stride..], &mut c[whole * c_stride..]);
    match m - whole {
        1 => tile::<T, 1, L>(a, a_stride, b, b_stride, c, c_stride, k),
        2 => tile::<T, 2, L>(a, a_stride, b, b_stride, c, c_stride, k),
        3 => tile::<T, 3, L>(a, a_stride, b, b_stride, c, c_stride, k),
        4 => tile::<T, 4, L>(a, a_stride, b, b_stride, c, c_stride, k),
        _ => tile::<T, 5, L>(a, a_stride, b, b_stride, c, c_stride, k),
    }
}

/// `R` rows by `L` columns of the product.
#[inline(always)]
fn tile<T: Real, const R: usize, const L: usize>(
    a: &[T],
    a_stride: usize,
    b: &[T],
    b_stride: usize,
    c: &mut [T],
    c_stride: usize,
    k: usize,
) {
    let rows: [&[T]; R] = std::array::from_fn(|r| &a[r * a_stride..r * a_stride + k]);
    let mut sum = [[T::zero(); L]; R];
    for (p, line) in b.chunks(b_stride).take(k).enumerate() {
        let line: &[T; L] = line.first_chunk().expect("L lanes");
        for r in 0..R {
            let v = rows[r][p];
            for l in 0..L {
                sum[r][l] += v * line[l];
            }
        }
    }
    for r in 0..R {
        c[r * c_stride..r * c_stride + L].copy_from_slice(&sum[r]);
    }
}
