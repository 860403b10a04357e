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

/// Points below which none is doubted: so few neighbours reach round a corner, or round a whole ball.
const LEAST_ASKED: usize = 8 * NEIGHBOURS;
/// Cosine between normals below which two points face against each other; it is 0 at the edges of a cube.
const AGAINST: f64 = -0.5;
/// Neighbours beside a point that more than half of have to face against it.
const LEAST_BESIDE: usize = 6;
/// Mean height over the tangent plane, in distances, up to which points that face against each other lie on one sheet. It is the
/// half of a point's own sheet that noise puts above and the half below; another sheet is on one side.
const ONE_SHEET: f64 = 0.1;

/// Share of pairs that face against each other from which the other side of a wall is no contradiction.
const WALL: f64 = 0.02;

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

/// What the neighbours of a point say.
struct Asked {
    is_isolated: bool,
    is_contradicted: bool,
    /// The same if those beside it that face against it are the other side of a wall.
    is_without_wall: bool,
    /// Whether most of those beside it face against it.
    is_against: bool,
    /// Sum and number of the heights, in distances, of those beside it that do, and how many are beside it.
    heights: (f64, usize),
    beside: usize,
}

impl Asked {
    fn of(samples: &Samples, tree: &Tree, i: usize) -> Self {
        let (near, reach) = neighbours(samples, tree, i);
        let normal = |k: usize| DVec3::from(samples.normals[k].map(f64::from));
        let reach_of = |k: usize| neighbours(samples, tree, near[k] as usize).1;
        let (mut facing, mut beside) = (0, 0);
        let mut heights = (0.0, 0);
        for j in near.map(|j| j as usize) {
            facing += usize::from(face_alike(samples, i, j));
            let way = samples.positions[j] - samples.positions[i];
            let height = way.dot(normal(i)) / way.length();
            // Not so for two samples at one place.
            if height.abs() <= BESIDE {
                beside += 1;
                if normal(i).dot(normal(j)) < AGAINST {
                    heights = (heights.0 + height, heights.1 + 1);
                }
            }
        }
        Self {
            is_isolated: is_isolated(reach, reach_of),
            is_contradicted: facing < NEEDED,
            is_without_wall: facing + heights.1 < NEEDED,
            is_against: beside >= LEAST_BESIDE && 2 * heights.1 > beside,
            heights,
            beside,
        }
    }
}

/// A sentence that advises a robust fit, or directions from the positions, if the data ask for one.
pub(crate) fn doubt(samples: &Samples, tree: &Tree) -> Option<String> {
    let n = samples.positions.len();
    if n < LEAST_ASKED {
        return None;
    }
    let asked: Vec<Asked> = (0..n)
        .step_by(n.div_ceil(ASKED))
        .map(|i| Asked::of(samples, tree, i))
        .collect();
    let share = |is: fn(&Asked) -> bool| asked.iter().filter(|a| is(a)).count() as f64 / asked.len() as f64;
    let against = share(|a| a.is_against);
    let (sum, count) = asked.iter().fold((0.0, 0), |(sum, count), a| {
        (sum + a.heights.0, count + a.heights.1)
    });
    // Where a share p is turned at random, 2p (1 − p) of the pairs face against each other.
    let pairs = count as f64 / asked.iter().map(|a| a.beside).sum::<usize>().max(1) as f64;
    let turned = 0.5 - 0.5 * (1.0 - 2.0 * pairs).max(0.0).sqrt();
    let is_one_sheet = sum.abs() <= ONE_SHEET * count as f64;
    if against > DOUBTS[1] && is_one_sheet {
        return Some(format!(
            "the normals of about {:.0} % of the points are turned against those of the points beside them: find the directions \
             from the positions alone",
            100.0 * turned.max(against.min(0.5))
        ));
    }
    let contradicted = if is_one_sheet || pairs < WALL {
        share(|a| a.is_contradicted)
    } else {
        share(|a| a.is_without_wall)
    };
    let isolated = share(|a| a.is_isolated);
    (isolated > DOUBTS[0] || contradicted > DOUBTS[1]).then(|| {
        format!(
            "{:.1} % of the points stand apart from the others and {:.1} % are contradicted by their neighbours: if \
             these are outliers, fit them by the robust loss",
            100.0 * isolated,
            100.0 * contradicted
        )
    })
}
