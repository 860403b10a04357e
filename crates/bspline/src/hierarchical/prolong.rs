use super::brick::{HALO, HALO_LEN};
use crate::Real;
use crate::vectorized::vectorized;

/// Refines a block of `SPAN³` coefficients to the `OUT³` of the next level that it determines, `SPAN = OUT/2 + 2`
/// for even `OUT`, `(OUT + 3)/2` for odd.
///
/// Two-scale relation of the uniform cubic B-spline, axis by axis: function `2k` of the finer level takes
/// `(C_{k-1} + 6 C_k + C_{k+1})/8`, function `2k+1` takes `(C_k + C_{k+1})/2`. The first output is an odd
/// function; it takes the first two inputs. `work` needs `SPAN²·OUT + SPAN·OUT²` slots.
///
/// # Panics
/// If a slice is too short.
#[inline(always)]
pub fn refine_block<T: Real, const SPAN: usize, const OUT: usize>(
    source: &[T],
    work: &mut [T],
    target: &mut [T],
) {
    let (along_z, along_y) = work.split_at_mut(SPAN * SPAN * OUT);
    for line in 0..SPAN * SPAN {
        refine_line(
            &source[line * SPAN..(line + 1) * SPAN],
            &mut along_z[line * OUT..(line + 1) * OUT],
        );
    }
    for x in 0..SPAN {
        for j in 0..OUT {
            let start = (x * OUT + j) * OUT;
            refine_rows(
                along_z,
                (x * SPAN + j / 2) * OUT,
                OUT,
                j,
                &mut along_y[start..start + OUT],
            );
        }
    }
    let plane = OUT * OUT;
    for i in 0..OUT {
        refine_rows(
            along_y,
            i / 2 * plane,
            plane,
            i,
            &mut target[i * plane..(i + 1) * plane],
        );
    }
}

/// Totals of a child brick from its parent's, before the child's own corrections. A parent's 11 coefficients
/// hold all that either half needs, so no neighbour is read. `octant` is the child's half on each axis.
pub(crate) fn prolong<T: Real>(parent: &[T; HALO_LEN], octant: [usize; 3], child: &mut [T; HALO_LEN]) {
    const SPAN: usize = HALO / 2 + 2;
    let mut source = [T::zero(); SPAN * SPAN * SPAN];
    for x in 0..SPAN {
        for y in 0..SPAN {
            let row = ((x + 4 * octant[0]) * HALO + y + 4 * octant[1]) * HALO + 4 * octant[2];
            source[(x * SPAN + y) * SPAN..][..SPAN].copy_from_slice(&parent[row..row + SPAN]);
        }
    }
    let mut work = [T::zero(); SPAN * SPAN * HALO + SPAN * HALO * HALO];
    vectorized(
        #[inline(always)]
        || refine_block::<T, SPAN, HALO>(&source, &mut work, child),
    );
}

/// One of the totals that [`prolong`] makes, to the bit: number `at` of the child.
pub(super) fn prolonged_at<T: Real>(parent: &[T; HALO_LEN], octant: [usize; 3], at: [usize; 3]) -> T {
    let start = (4 * octant[0] * HALO + 4 * octant[1]) * HALO + 4 * octant[2];
    refined(at[0], |x| {
        refined(at[1], |y| {
            refined(at[2], |z| parent[start + (x * HALO + y) * HALO + z])
        })
    })
}

/// Coefficient `j` of the finer level along a line of the coarser one's.
#[inline(always)]
fn refined<T: Real>(j: usize, coarse: impl Fn(usize) -> T) -> T {
    let p = j / 2;
    if j.is_multiple_of(2) {
        (coarse(p) + coarse(p + 1)) * T::from_f64(0.5)
    } else {
        (coarse(p) + T::from_f64(6.0) * coarse(p + 1) + coarse(p + 2)) * T::from_f64(0.125)
    }
}

#[inline(always)]
fn refine_line<T: Real>(source: &[T], target: &mut [T]) {
    for (j, target) in target.iter_mut().enumerate() {
        *target = refined(j, |p| source[p]);
    }
}

/// The same rule for whole rows: `target` is child row `j`, `source[start..]` its first parent row, `stride` apart.
#[inline(always)]
fn refine_rows<T: Real>(source: &[T], start: usize, stride: usize, j: usize, target: &mut [T]) {
    // Slices of one length, so that no index is checked.
    let n = target.len();
    let row = |p: usize| &source[start + p * stride..][..n];
    let (a, b) = (row(0), row(1));
    if j.is_multiple_of(2) {
        for z in 0..n {
            target[z] = refined(0, |p| [a[z], b[z]][p]);
        }
    } else {
        let c = row(2);
        for z in 0..n {
            target[z] = refined(1, |p| [a[z], b[z], c[z]][p]);
        }
    }
}
