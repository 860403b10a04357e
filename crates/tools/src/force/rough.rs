//! What forces on paths move, roughly: what the solve of a step begins with.
//!
//! A step solves `(m² − ∇²)u = F/K` with `m²` of mass and damping. A Gaussian of radius `r` moves what is `d` away by
//! `∫₀^∞ e^{-t} s⁻³ e^{-d²/2s²} dt` with `s² = r² + 2t/m²`, here by four nodes of Gauss and Laguerre. Paths are scaled to what the
//! region was found to do. With neighbours half a radius apart the matrix is nearly singular, and across a border of stiffness what
//! it says of forces that alternate is not what the region does: there a share is added to the diagonal.

use glam::DVec3;

/// Nodes and weights of Gauss and Laguerre.
const LAGUERRE: [(f64, f64); 4] = [
    (0.322_547_689_619_392_3, 0.603_154_104_341_633_6),
    (1.745_761_101_158_346_6, 0.357_418_692_437_799_7),
    (4.536_620_296_921_128, 0.038_887_908_515_005_38),
    (9.395_070_912_301_133, 5.392_947_055_613_275e-4),
];
/// Paths up to which distances count: the work grows by the third power.
const MOST: usize = 192;
/// Contrast of stiffness up to which they do: at 100 a disc across the border went 6 % too far.
const STEEP: f64 = 30.0;
/// Least share of the diagonal that is added to it where matter is painted.
const FIRM: f64 = 0.03;

/// A path as it is seen from others.
pub struct Seen {
    pub at: DVec3,
    /// What it stands for.
    pub weight: f64,
    /// Of what it moves.
    pub stiffness: f64,
    /// How far it goes if the force on each is its weight times its stiffness.
    pub goes: f64,
}

impl Seen {
    /// The same for a unit of force on all, about.
    fn gives(&self) -> f64 {
        self.goes / (self.weight * self.stiffness)
    }
}

/// An approximate inverse.
#[derive(Clone, Debug)]
pub enum Rough {
    /// What is divided by.
    Diagonal(Vec<f64>),
    /// Triangles of a matrix, row by row, and the order of its rows.
    Factor(Vec<f64>, Vec<usize>),
}

impl Rough {
    /// Of each path alone, with `soft` added.
    pub fn diagonal(seen: &[Seen], soft: &[f64]) -> Self {
        let each = seen.iter().zip(soft);
        Self::Diagonal(each.map(|(s, soft)| s.gives() + soft).collect())
    }

    /// Of paths with a kernel of radius `r` that see each other, in matter where what has stiffness 1 fades by `e` within `1/m`.
    pub fn new(seen: &[Seen], soft: &[f64], r: f64, m: f64) -> Self {
        let n = seen.len();
        let range = |(low, high): (f64, f64), s: &Seen| (low.min(s.stiffness), high.max(s.stiffness));
        let (low, high) = seen.iter().fold((f64::INFINITY, 0.0), range);
        if !(2..=MOST).contains(&n) || high > STEEP * low {
            return Self::diagonal(seen, soft);
        }
        let mut matrix = vec![0.0; n * n];
        for (j, a) in seen.iter().enumerate() {
            for (l, b) in seen[..=j].iter().enumerate() {
                let stiffness = (a.stiffness * b.stiffness).sqrt();
                let d2 = a.at.distance_squared(b.at) / (r * r);
                let one = |(t, weight): (f64, f64)| {
                    let s2 = 1.0 + 2.0 * t * stiffness / (m * r).powi(2);
                    weight / (s2 * s2.sqrt()) * libm::exp(-0.5 * d2 / s2)
                };
                let share: f64 = LAGUERRE.into_iter().map(one).sum();
                (matrix[j * n + l], matrix[l * n + j]) = (share, share);
            }
        }
        let firm = if low == high { 0.0 } else { FIRM };
        for (j, row) in matrix.chunks_exact_mut(n).enumerate() {
            let whole: f64 = row.iter().zip(seen).map(|(share, s)| share * s.weight).sum();
            let unit = seen[j].goes / whole;
            for (share, s) in row.iter_mut().zip(seen) {
                *share *= unit / s.stiffness;
            }
            row[j] += soft[j].max(firm * seen[j].gives());
        }
        Self::factor(matrix, n).unwrap_or_else(|| Self::diagonal(seen, soft))
    }

    /// By elimination with pivots.
    fn factor(mut a: Vec<f64>, n: usize) -> Option<Self> {
        let mut order: Vec<usize> = (0..n).collect();
        for k in 0..n {
            let size = |i: &usize| a[i * n + k].abs();
            let pivot = (k..n).max_by(|i, j| size(i).total_cmp(&size(j)))?;
            if !(size(&pivot) > 0.0 && size(&pivot).is_finite()) {
                return None;
            }
            order.swap(k, pivot);
            if pivot != k {
                for c in 0..n {
                    a.swap(k * n + c, pivot * n + c);
                }
            }
            let (above, below) = a.split_at_mut((k + 1) * n);
            let row = &above[k * n..];
            for below in below.chunks_exact_mut(n) {
                let factor = below[k] / row[k];
                below[k] = factor;
                for (b, r) in below[k + 1..].iter_mut().zip(&row[k + 1..]) {
                    *b -= factor * r;
                }
            }
        }
        Some(Self::Factor(a, order))
    }

    /// What it makes of a vector.
    pub fn solve(&self, v: &[f64]) -> Vec<f64> {
        let n = v.len();
        match self {
            Self::Diagonal(each) => v.iter().zip(each).map(|(v, d)| v / d).collect(),
            Self::Factor(a, order) => {
                let mut x: Vec<f64> = order.iter().map(|i| v[*i]).collect();
                let sum = |row: &[f64], x: &[f64]| row.iter().zip(x).map(|(a, x)| a * x).sum::<f64>();
                for i in 0..n {
                    x[i] -= sum(&a[i * n..][..i], &x[..i]);
                }
                for i in (0..n).rev() {
                    let row = &a[i * n..][..n];
                    x[i] = (x[i] - sum(&row[i + 1..], &x[i + 1..])) / row[i];
                }
                x
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of paths in a row, stiff at one end: it undoes the matrix, and gives forces that move all about as far where all of them act.
    #[test]
    fn it_undoes_what_forces_do() {
        let path = |i: usize| Seen {
            at: DVec3::new(0.5 * i as f64, 0.0, 0.0),
            weight: 0.5,
            stiffness: if i < 6 { 10.0 } else { 1.0 },
            goes: 0.3 + 0.02 * i as f64,
        };
        let seen: Vec<Seen> = (0..12).map(path).collect();
        let soft = vec![0.0; 12];
        let goes: Vec<f64> = seen.iter().map(|s| s.goes).collect();
        let forces = Rough::new(&seen, &soft, 1.0, 4.0).solve(&goes);
        for (force, s) in forces.iter().zip(&seen) {
            let expected = s.weight * s.stiffness;
            assert!((force / expected - 1.0).abs() < 0.1, "{force} {expected}");
        }
        // Pivots that are not there, and orders of rows.
        let matrix = vec![0.0, 2.0, 1.0, 1.0, 1.0, 0.0, 4.0, 0.0, 1.0];
        let x = [1.0, -2.0, 3.0];
        let b: Vec<f64> = matrix
            .chunks(3)
            .map(|row| (0..3).map(|i| row[i] * x[i]).sum())
            .collect();
        let found = Rough::factor(matrix, 3).expect("a regular matrix").solve(&b);
        assert!(
            found.iter().zip(x).all(|(a, b)| (a - b).abs() < 1e-14),
            "{found:?}"
        );
        assert!(Rough::factor(vec![1.0; 4], 2).is_none());
    }
}
