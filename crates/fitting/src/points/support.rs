//! Whether the neighbours of a point speak for it, before anything is fitted.
//!
//! A point is *isolated* if its neighbours are much closer to each other than to it (the local outlier factor of Breunig,
//! Kriegel, Ng and Sander, *LOF*, 2000, with the median in the place of the mean), and *contradicted* if few of them
//! face its way. Both compare with the neighbourhood, so that a scan may be thirty times as dense at one end as at the
//! other.

use std::num::NonZero;

use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use super::samples::Samples;

/// Neighbours that are asked.
const NEIGHBOURS: usize = 12;
/// Times the reach of its neighbours that the reach of a point may be.
const FACTOR: f64 = 3.0;
/// Cosine between normals from which two points face the same way.
const SAME_WAY: f64 = 0.5;
/// Neighbours that have to. At the corner of a cube a third do; of normals at random, a quarter.
const NEEDED: usize = 4;
/// Height of a neighbour over the tangent plane, in distances to it, up to which it lies beside the point: half of all
/// directions.
const BESIDE: f64 = 0.5;
/// Rounds in which points without support lose their voice. Where points lie at random one in twenty finds four
/// neighbours that agree; hardly one finds four that are left.
const ROUNDS: usize = 3;
/// Points asked before a fit that is not robust.
const ASKED: usize = 4000;
/// Shares of isolated and of contradicted points from which the user is told. Clean scans: none, and up to 1.4 % (thin
/// parts; 1.9 % with noise); 1 % of uniform outliers: 0.2 and 1 %.
const DOUBTS: [f64; 2] = [1e-3, 0.03];

/// Nearest neighbours among the points of a cloud.
pub(crate) type Tree = ImmutableKdTree<f64, 3>;

/// The tree over `positions`; `None` if there are too few.
pub(crate) fn tree(positions: &[DVec3]) -> Option<Tree> {
    let points: Vec<[f64; 3]> = positions.iter().map(|p| p.to_array()).collect();
    Tree::new_from_slice(&points).ok()
}

/// The neighbours of point `i` without itself, nearest first, and the square of the distance to the last.
fn neighbours(samples: &Samples, tree: &Tree, i: usize) -> ([u32; NEIGHBOURS], f64) {
    let found = tree
        .query(&samples.positions[i].to_array())
        .nearest_n::<SquaredEuclidean<f64>>(NonZero::new(NEIGHBOURS + 1).expect("not zero"))
        .execute();
    let reach = found.last().map_or(0.0, |n| n.distance);
    let mut others = found.iter().map(|n| n.item).filter(|&j| j as usize != i);
    (std::array::from_fn(|_| others.next().unwrap_or(i as u32)), reach)
}

fn face_alike(samples: &Samples, i: usize, j: usize) -> bool {
    let [a, b] = [i, j].map(|k| DVec3::from(samples.normals[k].map(f64::from)));
    i != j && a.dot(b) > SAME_WAY
}

/// Whether `reach²` is beyond the median of those of the five nearest neighbours, of which no more are asked for than decide.
fn is_isolated(reach: f64, nearest: impl Fn(usize) -> f64) -> bool {
    let (mut closer, mut others) = (0, 0);
    for k in 0..5 {
        if reach > FACTOR * FACTOR * nearest(k) {
            closer += 1;
        } else {
            others += 1;
        }
        if closer.max(others) == 3 {
            break;
        }
    }
    closer == 3
}

/// Weight 1 for points whose neighbours speak for them, 0 for the others.
pub(crate) fn weights(samples: &Samples, tree: &Tree) -> Vec<f32> {
    let n = samples.positions.len();
    let found: Vec<([u32; NEIGHBOURS], f64)> = (0..n)
        .into_par_iter()
        .with_min_len(256)
        .map(|i| neighbours(samples, tree, i))
        .collect();
    let agree = |i: usize, j: usize| {
        let way = samples.positions[j] - samples.positions[i];
        let height = way.dot(DVec3::from(samples.normals[i].map(f64::from)));
        face_alike(samples, i, j) && height.abs() <= BESIDE * way.length()
    };
    let mut live: Vec<bool> = found
        .iter()
        .map(|(near, reach)| !is_isolated(*reach, |k| found[near[k] as usize].1))
        .collect();
    for _ in 0..ROUNDS {
        live = (0..n)
            .into_par_iter()
            .with_min_len(1024)
            .map(|i| {
                let spoken = found[i].0.iter().map(|&j| j as usize);
                live[i] && spoken.filter(|&j| live[j] && agree(i, j)).count() >= NEEDED
            })
            .collect();
    }
    live.iter().map(|&l| f32::from(u8::from(l))).collect()
}

/// A sentence that advises a robust fit, if the data ask for one.
pub(crate) fn doubt(samples: &Samples, tree: &Tree) -> Option<String> {
    let n = samples.positions.len();
    let asked: Vec<[bool; 2]> = (0..n)
        .step_by(n.div_ceil(ASKED))
        .map(|i| {
            let (near, reach) = neighbours(samples, tree, i);
            let facing = near
                .iter()
                .filter(|&&j| face_alike(samples, i, j as usize))
                .count();
            let reach_of = |k: usize| neighbours(samples, tree, near[k] as usize).1;
            [is_isolated(reach, reach_of), facing < NEEDED]
        })
        .collect();
    let share = |k: usize| asked.iter().filter(|a| a[k]).count() as f64 / asked.len().max(1) as f64;
    let [isolated, contradicted] = [share(0), share(1)];
    (isolated > DOUBTS[0] || contradicted > DOUBTS[1]).then(|| {
        format!(
            "{:.1} % of the points stand apart from the others and {:.1} % are contradicted by their neighbours: if \
             these are outliers, fit them by the robust loss",
            100.0 * isolated,
            100.0 * contradicted
        )
    })
}
