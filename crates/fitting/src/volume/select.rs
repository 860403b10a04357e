//! The largest of many scores, the same at any thread count.

use bspline::Real;
use rayon::prelude::*;

/// Scores of one task of the histogram.
const CHUNK: usize = 1 << 16;
/// Low bits dropped from a score's bit pattern to get its histogram bin: 8 exponent and 5 mantissa bits remain.
const DROPPED_BITS: u32 = 18;
const BINS: usize = 1 << (31 - DROPPED_BITS);

/// Splits scores into kept and not: those above a key, and at the key those before an index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Cutoff {
    key: u32,
    before: usize,
}

impl Cutoff {
    /// Keeps every score above `threshold`.
    pub fn above(threshold: f64) -> Self {
        Self {
            key: key(threshold as f32),
            before: 0,
        }
    }

    /// This cutoff, but nothing at or below `threshold`.
    pub fn at_least(self, threshold: f64) -> Self {
        let floor = Self::above(threshold);
        if floor.key >= self.key { floor } else { self }
    }

    /// Whether the score at `index`, counted through all lists, is kept.
    #[inline(always)]
    pub fn keeps<T: Real>(&self, score: T, index: usize) -> bool {
        let k = key(score.as_f64() as f32);
        k > 0 && (k > self.key || k == self.key && index < self.before)
    }
}

/// Order-preserving bits of a score; negative and NaN count as 0, which is never kept.
#[inline(always)]
fn key(score: f32) -> u32 {
    if score > 0.0 { score.to_bits() } else { 0 }
}

/// The cutoff that keeps the `count` largest of the positive scores in all `lists` together (all of them, if
/// there are fewer); of equal scores, the earlier ones.
pub(crate) fn largest<T: Real>(lists: &[&[T]], count: usize) -> Cutoff {
    let mut histogram = vec![0_usize; BINS];
    for list in lists {
        let parts: Vec<Vec<u32>> = list
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut h = vec![0_u32; BINS];
                for &s in chunk {
                    h[(key(s.as_f64() as f32) >> DROPPED_BITS) as usize] += 1;
                }
                h
            })
            .collect();
        for part in parts {
            for (h, p) in histogram.iter_mut().zip(part) {
                *h += p as usize;
            }
        }
    }
    // The bin where the count is reached from above, and how many are kept of it.
    let mut above = 0;
    let mut bin = BINS;
    while bin > 0 && above + histogram[bin - 1] < count {
        bin -= 1;
        above += histogram[bin];
    }
    if bin == 0 {
        return Cutoff { key: 0, before: 0 };
    }
    let bin = bin as u32 - 1;
    let wanted = count - above;
    if wanted == 0 {
        return Cutoff {
            key: ((bin + 1) << DROPPED_BITS) - 1,
            before: 0,
        };
    }
    let mut members: Vec<(u32, usize)> = Vec::with_capacity(histogram[bin as usize]);
    let mut offset = 0;
    for list in lists {
        members.extend(list.iter().enumerate().filter_map(|(i, &s)| {
            let k = key(s.as_f64() as f32);
            (k >> DROPPED_BITS == bin).then_some((k, offset + i))
        }));
        offset += list.len();
    }
    let order = |a: &(u32, usize), b: &(u32, usize)| b.0.cmp(&a.0).then(a.1.cmp(&b.1));
    let (_, &mut (key, index), _) = members.select_nth_unstable_by(wanted - 1, order);
    Cutoff {
        key,
        before: index + 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(lists: &[&[f64]], cutoff: Cutoff) -> Vec<usize> {
        lists
            .iter()
            .flat_map(|l| l.iter())
            .enumerate()
            .filter(|&(i, &s)| cutoff.keeps(s, i))
            .map(|(i, _)| i)
            .collect()
    }

    #[test]
    fn keeps_the_largest_and_of_equals_the_first() {
        let a: Vec<f64> = (0..300_000_u64)
            .map(|i| (i * 7919 % 1000) as f64 - 10.0)
            .collect();
        let (first, second) = a.split_at(123_457);
        let lists = [first, second];
        let mut order: Vec<usize> = (0..a.len()).filter(|&i| a[i] > 0.0).collect();
        order.sort_by(|&i, &j| a[j].total_cmp(&a[i]).then(i.cmp(&j)));
        for count in [0, 1, 299, 300, 301, 1234, 200_000, order.len(), a.len()] {
            let mut expected = order[..count.min(order.len())].to_vec();
            expected.sort_unstable();
            assert_eq!(kept(&lists, largest(&lists, count)), expected, "{count} wanted");
        }
    }

    #[test]
    fn zero_negative_and_nan_are_never_kept() {
        let scores = [0.0, -1.0, f64::NAN, 0.0];
        assert!(kept(&[&scores], largest(&[&scores], 4)).is_empty());
        assert!(kept(&[&scores], Cutoff::above(0.0)).is_empty());
        assert_eq!(
            kept(&[&[1.0, 2.0, 3.0]], Cutoff::above(2.0)),
            [2],
            "strictly above"
        );
    }
}
