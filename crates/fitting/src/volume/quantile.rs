//! Exact quantiles of many floats by two histograms over their ordered bit patterns.

use rayon::prelude::*;

use super::voxels::Number;

const CHUNK: usize = 1 << 20;
const BINS: usize = 1 << 16;

/// Bits that order like the values; NaN sorts outside all numbers.
#[inline(always)]
fn ordered(v: f32) -> u32 {
    let bits = v.to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

fn value(ordered: u32) -> f32 {
    f32::from_bits(if ordered >> 31 == 1 {
        ordered & !(1 << 31)
    } else {
        !ordered
    })
}

/// Histogram of `bin(v)` over the values for which there is one.
fn histogram<N: Number>(values: &[N], bin: impl Fn(f32) -> Option<usize> + Sync) -> Vec<usize> {
    let count = |chunk: &[N]| {
        let mut h = vec![0_u32; BINS];
        for b in chunk.iter().filter_map(|&v| bin(v.float())) {
            h[b] += 1;
        }
        h
    };
    let parts: Vec<Vec<u32>> = values.par_chunks(CHUNK).map(count).collect();
    let mut sum = vec![0_usize; BINS];
    for part in parts {
        for (s, p) in sum.iter_mut().zip(part) {
            *s += p as usize;
        }
    }
    sum
}

/// Bin that holds the element of rank `rank`, and how many lie in bins before it.
fn bin_of_rank(histogram: &[usize], rank: usize) -> (usize, usize) {
    let mut before = 0;
    for (bin, &count) in histogram.iter().enumerate() {
        if rank < before + count {
            return (bin, before);
        }
        before += count;
    }
    unreachable!("rank {rank} of {before} values");
}

/// The elements of rank `round(q·(n-1))` in rising order, one for each `q` in `0..=1`.
///
/// # Panics
/// If `values` is empty.
pub(crate) fn quantiles<N: Number, const Q: usize>(values: &[N], qs: [f64; Q]) -> [f32; Q] {
    assert!(!values.is_empty(), "no values, no quantile");
    let high = histogram(values, |v| Some((ordered(v) >> 16) as usize));
    qs.map(|q| {
        let rank = (q * (values.len() - 1) as f64).round() as usize;
        let (top, before) = bin_of_rank(&high, rank);
        let low = histogram(values, |v| {
            let k = ordered(v);
            ((k >> 16) as usize == top).then_some((k & 0xffff) as usize)
        });
        let (bottom, _) = bin_of_rank(&low, rank - before);
        value((top as u32) << 16 | bottom as u32)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_sorted_list() {
        let values: Vec<f32> = (0..10_001_u32)
            .map(|i| ((i * 7919 % 10_007) as f32 - 5000.0) * 1.7e-3)
            .collect();
        let mut sorted = values.clone();
        sorted.sort_by(f32::total_cmp);
        let qs = [0.0, 0.01, 0.5, 0.95, 1.0];
        let expected = qs.map(|q| sorted[(q * 10_000.0) as usize]);
        assert_eq!(quantiles(&values, qs), expected);
        assert_eq!(quantiles(&[-2.5], [0.0, 1.0]), [-2.5, -2.5]);
        assert_eq!(quantiles(&[0.0, -0.0, 3e38, -3e38], [0.0, 1.0]), [-3e38, 3e38]);
    }
}
