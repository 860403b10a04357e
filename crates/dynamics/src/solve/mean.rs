//! Geometric means of weights that change in a box.

use bspline::Real;

use crate::lattice::SampleBox;
use crate::springs::Weights;
use crate::units::{binary_unit, largest};

/// Weights below this share of the largest count as so much: some may be 0.
const FLOOR: f64 = 1e-9;

/// Sums of the logarithms of rows along z, so that the mean follows a change at the cost of its box.
#[derive(Clone, Debug, Default)]
pub(super) struct GeometricMean {
    floor: f64,
    rows: Vec<f64>,
}

impl GeometricMean {
    /// Of weights on `dims` samples that have changed in a box since the last time; the bits are those of a mean over all.
    pub fn of<T: Real>(&mut self, weights: &Weights<T>, dims: [usize; 3], at: SampleBox) -> f64 {
        let list = match weights {
            Weights::Constant(w) => {
                self.rows.clear();
                return w.as_f64();
            }
            Weights::Each(list) => list,
        };
        // A power of two, so that it seldom moves.
        let floor = binary_unit(FLOOR * largest(list)).max(f64::MIN_POSITIVE);
        let count = dims[0] * dims[1];
        let at = if self.rows.len() == count && self.floor == floor {
            at
        } else {
            SampleBox::all(dims)
        };
        self.floor = floor;
        self.rows.resize(count, 0.0);
        for i in at.first[0]..at.first[0] + at.count[0] {
            for row in i * dims[1] + at.first[1]..i * dims[1] + at.first[1] + at.count[1] {
                let weights = &list[row * dims[2]..(row + 1) * dims[2]];
                self.rows[row] = log_of_product(weights.iter().map(|w| w.as_f64().max(floor)));
            }
        }
        libm::exp(self.rows.iter().sum::<f64>() / list.len() as f64)
    }
}

/// `log Π w` of positive normal numbers, by one logarithm.
fn log_of_product(weights: impl Iterator<Item = f64>) -> f64 {
    const MANTISSA: u64 = (1 << 52) - 1;
    const ONE: u64 = 1023 << 52;
    let (mut exponents, mut product) = (0, 1.0);
    let split = |w: f64| {
        let bits = w.to_bits();
        ((bits >> 52) as i64 - 1023, f64::from_bits(bits & MANTISSA | ONE))
    };
    for w in weights {
        let (exponent, mantissa) = split(w);
        let (carried, rest) = split(product * mantissa);
        exponents += exponent + carried;
        product = rest;
    }
    exponents as f64 * std::f64::consts::LN_2 + libm::log(product)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_that_follows_a_box_is_that_of_all() {
        let dims = [5, 6, 7];
        let mut list: Vec<f32> = (0..210).map(|i| (1 + i * i % 97) as f32 * 1e-3).collect();
        let mut mean = GeometricMean::default();
        for round in 0..40 {
            let at = SampleBox {
                first: [round % 4, round % 5, round % 3],
                count: [1 + round % 2, 1, 1 + round % 4],
            };
            for i in at.indices(dims) {
                list[i] *= [3.0, 1e-4, 2e3, 0.0][round % 4];
            }
            let weights = Weights::Each(list.clone());
            let followed = mean.of(&weights, dims, at);
            assert_eq!(
                followed,
                GeometricMean::default().of(&weights, dims, at),
                "{round}"
            );
            let most = list.iter().fold(0.0_f64, |m, w| m.max(f64::from(*w)));
            let logs = list
                .iter()
                .map(|w| f64::from(*w).max(binary_unit(FLOOR * most)).ln());
            let exact = (logs.sum::<f64>() / 210.0).exp();
            assert!(
                (followed / exact - 1.0).abs() < 1e-12,
                "{round}: {followed} {exact}"
            );
        }
    }
}
