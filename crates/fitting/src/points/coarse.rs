//! The full coarse levels, 4³ to 32³ cells: where the sign far from the data is decided.
//!
//! The energy is that of [`full_operator`](crate::level::full_operator),
//! with `a_k` from the [clusters](super::clusters), `β = max(h, β_s)`. No factor of the sample count appears,
//! so the balance is the same for a sparse and a dense scan; without that, false solids appear far away.

use super::clusters::{clusters, coarser, doubt_the_sparse};
use super::samples::Samples;
use crate::level::full_grid::FullGrid;
use crate::level::full_operator::Operator;
use crate::level::v_cycle::VCycle;
use crate::level::{BASE_DEPTH, SolverOutcome};

/// Weight `μ'` of the bending energy. Far from the data only `μ'/(β/h)²` counts: 4e-4 was compared with 1e-3 and
/// 4e-3 on five draws of holes in one scan and on a thin scan; 1e-3 has the most right signs.
const BENDING: f64 = 1e-3;
/// Relative preconditioned residual at which the solves up to 16³ stop.
const TOLERANCE: f64 = 1e-3;
/// Iterations after which they give up; a handful is usual.
const ITERATIONS: usize = 60;
/// Iterations on 32³, on purpose too few to converge: they mend pockets near the data but leave the smooth
/// continuation of 16³ in holes (2 to 10 are alike, 25 lose a third of the accuracy in holes).
const BASE_ITERATIONS: usize = 5;

/// Coefficients of the 32³ level, distances in units of the box, positive inside, and how each level was solved. Under `suspicion` a half-cell that
/// holds fewer samples than most weighs less: what is left of the outliers lies in such.
pub(crate) fn solve(samples: &Samples, beta_s: f64, suspicion: bool) -> (FullGrid<f64>, Vec<SolverOutcome>) {
    let mut by_depth = vec![clusters(samples, BASE_DEPTH)];
    for depth in (2..BASE_DEPTH).rev() {
        let finer = by_depth.last().expect("starts with one");
        by_depth.push(coarser(finer, depth));
    }
    by_depth.reverse();
    if suspicion {
        by_depth.iter_mut().for_each(|data| doubt_the_sparse(data));
    }
    let beta = |n: usize| (1.0 / n as f64).max(beta_s);
    let mut x = FullGrid::zeros(4);
    let mut solves = Vec::with_capacity(BASE_DEPTH - 1);
    for (level, data) in by_depth.iter().enumerate().take(BASE_DEPTH - 2) {
        let n = 4usize << level;
        if level > 0 {
            x = x.refined();
        }
        let cycle = VCycle::new(&by_depth[..=level], beta(n), BENDING);
        let top = Operator::<f64>::new(data, n, beta(n), 1.0, BENDING);
        solves.push(top.solve(&mut x, |r| cycle.apply(r), TOLERANCE, ITERATIONS));
    }
    x = x.refined();
    let n = 1 << BASE_DEPTH;
    let top = Operator::<f64>::new(&by_depth[BASE_DEPTH - 2], n, beta(n), 1.0, BENDING);
    let inverse = top.inverse_diagonal();
    let jacobi = |r: &FullGrid<f64>| FullGrid {
        n: r.n,
        values: r.values.iter().zip(&inverse).map(|(r, d)| r * d).collect(),
    };
    solves.push(top.solve(&mut x, jacobi, 0.0, BASE_ITERATIONS));
    (x, solves)
}
