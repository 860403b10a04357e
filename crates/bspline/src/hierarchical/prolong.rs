use super::brick::{HALO, HALO_LEN};
use crate::Real;

/// Totals of a child brick from its parent's, before the child's own corrections.
///
/// Two-scale relation of the uniform cubic B-spline, axis by axis: function `2k` of the finer level takes
/// `(C_{k-1} + 6 C_k + C_{k+1})/8`, function `2k+1` takes `(C_k + C_{k+1})/2`. A parent's 11 coefficients hold
/// all that either half needs, so no neighbour is read. `octant` is the child's half on each axis.
pub(crate) fn prolong<T: Real>(parent: &[T; HALO_LEN], octant: [usize; 3], child: &mut [T; HALO_LEN]) {
    const SPAN: usize = 7;
    let mut along_z = [T::zero(); SPAN * SPAN * HALO];
    for x in 0..SPAN {
        for y in 0..SPAN {
            let row = ((x + 4 * octant[0]) * HALO + y + 4 * octant[1]) * HALO + 4 * octant[2];
            let source: &[T; SPAN] = parent[row..row + SPAN].try_into().expect("7 of a row of 11");
            let target = (x * SPAN + y) * HALO;
            refine_line(source, &mut along_z[target..target + HALO]);
        }
    }
    let mut along_y = [T::zero(); SPAN * HALO * HALO];
    for x in 0..SPAN {
        for j in 0..HALO {
            let (target, p) = ((x * HALO + j) * HALO, x * SPAN + j / 2);
            refine_rows(&along_z, p * HALO, HALO, j, &mut along_y[target..target + HALO]);
        }
    }
    const PLANE: usize = HALO * HALO;
    for i in 0..HALO {
        refine_rows(
            &along_y,
            i / 2 * PLANE,
            PLANE,
            i,
            &mut child[i * PLANE..(i + 1) * PLANE],
        );
    }
}

fn refine_line<T: Real>(source: &[T; 7], target: &mut [T]) {
    let (half, eighth, six) = (T::from_f64(0.5), T::from_f64(0.125), T::from_f64(6.0));
    for j in 0..HALO {
        let p = j / 2;
        target[j] = if j % 2 == 0 {
            (source[p] + source[p + 1]) * half
        } else {
            (source[p] + six * source[p + 1] + source[p + 2]) * eighth
        };
    }
}

/// The same rule for whole rows: `target` is child row `j`, `source[start..]` its first parent row, `stride` apart.
#[inline(always)]
fn refine_rows<T: Real>(source: &[T], start: usize, stride: usize, j: usize, target: &mut [T]) {
    let (half, eighth, six) = (T::from_f64(0.5), T::from_f64(0.125), T::from_f64(6.0));
    let n = target.len();
    let (a, b) = (
        &source[start..start + n],
        &source[start + stride..start + stride + n],
    );
    if j.is_multiple_of(2) {
        for z in 0..n {
            target[z] = (a[z] + b[z]) * half;
        }
    } else {
        let c = &source[start + 2 * stride..start + 2 * stride + n];
        for z in 0..n {
            target[z] = (a[z] + six * b[z] + c[z]) * eighth;
        }
    }
}
