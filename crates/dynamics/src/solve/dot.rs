use bspline::Real;
use bspline::vectorized;

const LANES: usize = 16;
const CHUNK: usize = 1024;

/// `Σ a_i b_i`: lanes and chunks of fixed size, chunks added in double precision, so that the sum has the same bits
/// however the work is divided.
pub(crate) fn dot<T: Real>(a: &[T], b: &[T]) -> f64 {
    assert_eq!(a.len(), b.len(), "vectors of one length");
    vectorized(
        #[inline(always)]
        || {
            let chunks = a.chunks(CHUNK).zip(b.chunks(CHUNK));
            chunks.map(|(a, b)| dot_chunk(a, b)).sum()
        },
    )
}

#[inline(always)]
fn dot_chunk<T: Real>(a: &[T], b: &[T]) -> f64 {
    let mut sum = [T::zero(); LANES];
    let (a, a_rest) = a.as_chunks::<LANES>();
    let (b, b_rest) = b.as_chunks::<LANES>();
    for (a, b) in a.iter().zip(b) {
        for l in 0..LANES {
            sum[l] += a[l] * b[l];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| (*x * *y).as_f64()).sum();
    sum.iter().map(|s| s.as_f64()).sum::<f64>() + rest
}
