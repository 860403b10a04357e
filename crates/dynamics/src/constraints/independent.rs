//! Hard constraints as few orthonormal rows.

use super::constraint::{ConstraintError, Row};
use crate::solve::OrthonormalRows;

/// Length of what a normalized row adds to the others, below which it counts as implied by them.
const RANK: f64 = 1e-7;
/// Share of the densities that an implied row may be off by: that of single-precision input.
const CONSISTENT: f64 = 1e-6;
/// Share of the densities that a row may stay off by where it adds little to the others, and by which it may move a coefficient there. Points of a
/// curve a tenth of a knot interval apart that miss the surface by 10⁻⁵ moved it by several lengths.
const NEAR: f64 = 1e-4;
const MAGNIFIED: f64 = 0.1;
/// Share of its weight that a row has to have on free coefficients.
const REACH: f64 = 1e-6;

/// `Q u = c`.
#[derive(Clone, Debug, Default)]
pub(crate) struct Independent {
    pub rows: OrthonormalRows,
    pub c: Vec<f64>,
    /// How `c` is made of the targets, a row of as many numbers as there are constraints for each.
    shares: Vec<f64>,
    /// Whether some constraints are implied by others, or by what is fixed.
    dependent: bool,
}

/// A row in the making: `rest = (row - Σ along_k q_k)/length`, `c` likewise.
struct Candidate<'a> {
    label: &'a str,
    row: &'a Row,
    rest: Vec<f64>,
    c: f64,
    /// What `c` is of all targets.
    shares: Vec<f64>,
    along: Vec<f64>,
    /// Length of the row, by which all is divided.
    length: f64,
    done: bool,
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Candidate<'_> {
    /// Takes out the part along `q`, which is row `k`.
    fn reduce(&mut self, q: &[f64], c: f64, shares: &[f64], k: usize) {
        let along = product(&self.rest, q);
        for (r, q) in self.rest.iter_mut().zip(q) {
            *r -= along * q;
        }
        self.c -= along * c;
        for (s, q) in self.shares.iter_mut().zip(shares) {
            *s -= along * q;
        }
        self.along[k] += along;
    }
}

impl Independent {
    /// From rows on the unknowns, by Gram–Schmidt with the longest remaining row next and every chosen row
    /// orthogonalized twice.
    ///
    /// # Errors
    /// [`ConstraintError::Inconsistent`], [`ConstraintError::Unreachable`].
    pub fn new(rows: &[(&str, &Row)]) -> Result<Self, ConstraintError> {
        let mut columns: Vec<usize> = rows.iter().flat_map(|r| r.1.terms.iter().map(|t| t.0)).collect();
        columns.sort_unstable();
        columns.dedup();
        let width = columns.len();
        let mut out = Self::default();
        out.rows.columns = columns;
        let mut left = Vec::new();
        for (number, (label, row)) in rows.iter().enumerate() {
            let length = row.terms.iter().map(|t| t.1 * t.1).sum::<f64>().sqrt();
            if length <= REACH * row.weight {
                if row.target.abs() > CONSISTENT * row.size {
                    return Err(ConstraintError::Unreachable {
                        label: (*label).to_owned(),
                        gap: row.target,
                    });
                }
                continue;
            }
            let mut rest = vec![0.0; width];
            for (i, w) in &row.terms {
                let place = out.rows.columns.binary_search(i).expect("collected above");
                rest[place] = w / length;
            }
            left.push(Candidate {
                label,
                row,
                rest,
                c: row.target / length,
                shares: (0..rows.len())
                    .map(|i| if i == number { 1.0 / length } else { 0.0 })
                    .collect(),
                along: vec![0.0; rows.len()],
                length,
                done: false,
            });
        }
        let mut chosen: Vec<(usize, f64)> = Vec::new();
        loop {
            let lengths = left.iter().enumerate().filter(|(_, r)| !r.done);
            let lengths = lengths.map(|(i, r)| (i, product(&r.rest, &r.rest)));
            let longest = lengths.reduce(|a, b| if b.1 > a.1 { b } else { a });
            let Some((next, _)) = longest else { break };
            let row = &mut left[next];
            let done = out
                .rows
                .q
                .chunks_exact(width)
                .zip(out.shares.chunks_exact(rows.len()));
            for (k, (q, shares)) in done.enumerate() {
                row.reduce(q, out.c[k], shares, k);
            }
            let length = product(&row.rest, &row.rest).sqrt();
            if length <= RANK {
                break;
            }
            row.done = true;
            let q: Vec<f64> = row.rest.iter().map(|r| r / length).collect();
            // Over a short rest, what is too little to be seen would move matter far.
            let size = row.row.size / row.length;
            let is_nothing = row.c.abs() <= NEAR * size && row.c.abs() > MAGNIFIED * size * length;
            let kept = if is_nothing { 0.0 } else { 1.0 / length };
            out.dependent |= is_nothing;
            let c = kept * row.c;
            let shares: Vec<f64> = row.shares.iter().map(|s| kept * s).collect();
            let k = chosen.len();
            for other in left.iter_mut().filter(|r| !r.done) {
                other.reduce(&q, c, &shares, k);
            }
            out.rows.q.extend(q);
            out.shares.extend(shares);
            out.c.push(c);
            chosen.push((next, length));
        }
        for row in left.iter().filter(|r| !r.done) {
            out.check(row, &left, &chosen)?;
        }
        out.dependent |= chosen.len() < rows.len();
        out.aim(rows.iter().map(|r| r.1.target));
        Ok(out)
    }

    /// Whether the targets can be moved without asking whether they still agree.
    pub fn can_be_aimed(&self) -> bool {
        !self.dependent
    }

    /// Sets `c` for other targets.
    pub fn aim(&mut self, targets: impl ExactSizeIterator<Item = f64> + Clone) {
        let rows = targets.len().max(1);
        for (c, shares) in self.c.iter_mut().zip(self.shares.chunks_exact(rows)) {
            *c = shares.iter().zip(targets.clone()).map(|(s, t)| s * t).sum();
        }
    }

    /// Whether a row that the chosen ones imply has the value that they give it.
    fn check(
        &self,
        row: &Candidate<'_>,
        all: &[Candidate<'_>],
        chosen: &[(usize, f64)],
    ) -> Result<(), ConstraintError> {
        // row = Σ share_k chosen_k, from the last to the first.
        let mut along = row.along[..chosen.len()].to_vec();
        let mut shares = vec![0.0; chosen.len()];
        for k in (0..chosen.len()).rev() {
            let (index, length) = chosen[k];
            shares[k] = along[k] / length;
            for (a, l) in along[..k].iter_mut().zip(&all[index].along) {
                *a -= shares[k] * l;
            }
        }
        let others = chosen.iter().zip(&shares);
        let sizes = others.map(|((i, _), s)| s.abs() * all[*i].row.size / all[*i].length);
        let size = row.row.size / row.length + sizes.sum::<f64>();
        if row.c.abs() <= CONSISTENT * size {
            return Ok(());
        }
        let largest = shares.iter().fold(0.0_f64, |a, s| a.max(s.abs()));
        let involved = chosen
            .iter()
            .zip(&shares)
            .filter(|(_, s)| s.abs() > 1e-6 * largest);
        let mut named: Vec<usize> = involved.map(|((i, _), _)| *i).collect();
        named.sort_unstable();
        let mut rows: Vec<String> = named.iter().map(|i| all[*i].label.to_owned()).collect();
        rows.push(row.label.to_owned());
        Err(ConstraintError::Inconsistent {
            rows,
            gap: row.c * row.length,
        })
    }
}
