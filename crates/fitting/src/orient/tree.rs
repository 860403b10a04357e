//! Octree over points in Morton order, for sums over all points at once \[Barnes86\].

use std::ops::Range;

use super::kernel::{Kernel, LANES, Source, Strength, Target};

/// Points in a leaf.
const LEAF: usize = 24;
/// Edge of the cells that the Morton order tells apart.
const SMALLEST: f32 = 1.0 / 65536.0;
/// A node stands for its points where its radius is below this share of its distance.
///
/// Against direct sums on the bunny the rms error of `w` is 0.004 at 0.5; see `docs/fitting.md`.
pub(crate) const OPENING: f32 = 0.5;

/// A node in depth-first order: its children follow it, and `skip` is the node after its last descendant.
#[derive(Clone, Debug)]
struct Node {
    /// Mean of its points by area.
    centre: [f32; 3],
    /// Largest distance of a point from the mean.
    radius: f32,
    begin: u32,
    end: u32,
    skip: u32,
}

/// The tree; it keeps its own copy of the positions.
#[derive(Debug)]
pub(crate) struct Tree {
    positions: Vec<[f32; 3]>,
    nodes: Vec<Node>,
    /// Points of each leaf.
    leaves: Vec<Range<usize>>,
}

impl Tree {
    /// Over points in Morton order. The centres of nodes are means weighted by `areas`.
    pub fn new(positions: Vec<[f32; 3]>, areas: &[f32]) -> Self {
        let mut tree = Self {
            positions,
            nodes: Vec::new(),
            leaves: Vec::new(),
        };
        tree.split(0..tree.positions.len(), [0.0; 3], 1.0, areas);
        tree
    }

    /// Positions, in the order given.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// Runs of points that lie together.
    pub fn leaves(&self) -> &[Range<usize>] {
        &self.leaves
    }

    fn split(&mut self, range: Range<usize>, corner: [f32; 3], size: f32, areas: &[f32]) {
        let at = self.nodes.len();
        self.nodes.push(self.node(&range, areas));
        if range.len() <= LEAF || size < SMALLEST {
            self.leaves.push(range);
        } else {
            let half = size * 0.5;
            let octant = |p: &[f32; 3]| (0..3).fold(0, |o, a| o << 1 | usize::from(p[a] >= corner[a] + half));
            let mut begin = range.start;
            for o in 0..8 {
                // Rounding to single precision may put a point beside the face its key was computed from; such a
                // point stays with its neighbours in the order.
                let rest = &self.positions[begin..range.end];
                let count = if o == 7 {
                    rest.len()
                } else {
                    rest.partition_point(|p| octant(p) <= o)
                };
                if count > 0 {
                    let child = [0, 1, 2].map(|a| corner[a] + half * ((o >> (2 - a)) & 1) as f32);
                    self.split(begin..begin + count, child, half, areas);
                    begin += count;
                }
            }
        }
        self.nodes[at].skip = self.nodes.len() as u32;
    }

    fn node(&self, range: &Range<usize>, areas: &[f32]) -> Node {
        let mut sum = [0.0f64; 4];
        for i in range.clone() {
            let a = f64::from(areas[i].max(f32::MIN_POSITIVE));
            for k in 0..3 {
                sum[k] += a * f64::from(self.positions[i][k]);
            }
            sum[3] += a;
        }
        let centre = [0, 1, 2].map(|k| (sum[k] / sum[3]) as f32);
        let farthest = self.positions[range.clone()]
            .iter()
            .map(|p| squared_distance(p, &centre))
            .fold(0.0, f32::max);
        Node {
            centre,
            radius: farthest.sqrt(),
            begin: range.start as u32,
            end: range.end as u32,
            skip: 0,
        }
    }

    /// Sums of `strengths` over the points of each node.
    fn moments<S: Strength>(&self, strengths: &[S]) -> Vec<S> {
        let mut out = vec![S::NONE; self.nodes.len()];
        for at in (0..self.nodes.len()).rev() {
            let node = &self.nodes[at];
            let mut sum = S::NONE;
            let mut add = |s: &S| sum.add(s);
            if node.skip as usize == at + 1 {
                strengths[node.begin as usize..node.end as usize]
                    .iter()
                    .for_each(&mut add);
            } else {
                let mut child = at + 1;
                while child < node.skip as usize {
                    add(&out[child]);
                    child = self.nodes[child].skip as usize;
                }
            }
            out[at] = sum;
        }
        out
    }

    /// `Σ_j K(x_j − t) strength_j` at every target `t`; targets come in runs that lie together.
    pub fn sum<K: Kernel>(
        &self,
        kernel: &K,
        strengths: &[K::Strength],
        targets: &[Target],
        runs: &[Range<usize>],
    ) -> Vec<K::Output> {
        use rayon::prelude::*;
        let moments = self.moments(strengths);
        let mut out = vec![K::Output::default(); targets.len()];
        let mut rest = out.as_mut_slice();
        let mut work = Vec::with_capacity(runs.len());
        for run in runs {
            let (here, after) = rest.split_at_mut(run.len());
            work.push((&targets[run.clone()], here));
            rest = after;
        }
        work.par_chunks_mut(16).for_each(|work| {
            let mut near: Vec<Source<K::Strength>> = Vec::new();
            for (targets, out) in work {
                near.clear();
                self.interactions(targets, strengths, &moments, &mut near);
                for (targets, out) in targets.chunks(LANES).zip(out.chunks_mut(LANES)) {
                    kernel.sum(&near, targets, out);
                }
            }
        });
        out
    }

    /// What acts on a run of targets: points of near leaves, means of far nodes.
    fn interactions<S: Copy>(
        &self,
        targets: &[Target],
        strengths: &[S],
        moments: &[S],
        out: &mut Vec<Source<S>>,
    ) {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for t in targets {
            for k in 0..3 {
                low[k] = low[k].min(t.position[k]);
                high[k] = high[k].max(t.position[k]);
            }
        }
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            let gap = [0, 1, 2].map(|k| (low[k] - node.centre[k]).max(node.centre[k] - high[k]).max(0.0));
            let distance2 = gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2];
            if node.radius * node.radius < OPENING * OPENING * distance2 {
                out.push(Source {
                    position: node.centre,
                    strength: moments[at],
                });
                at = node.skip as usize;
            } else if node.skip as usize == at + 1 {
                out.extend((node.begin as usize..node.end as usize).map(|j| Source {
                    position: self.positions[j],
                    strength: strengths[j],
                }));
                at += 1;
            } else {
                at += 1;
            }
        }
    }
}

fn squared_distance(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum()
}

#[cfg(test)]
mod tests {
    use super::super::kernel::{Adjoint, Gradient, Winding};
    use super::*;
    use crate::phantoms::SplitMix64;

    /// A ball of radius 0.4 in the unit box, in no order at all, its outward normals and areas.
    fn ball(count: usize) -> (Vec<[f32; 3]>, Vec<[f32; 3]>, Vec<f32>) {
        let mut random = SplitMix64::new(9);
        let normals: Vec<glam::DVec3> = (0..count).map(|_| random.normal3().normalize()).collect();
        let area = 4.0 * std::f32::consts::PI * 0.16 / count as f32;
        let single = |v: glam::DVec3| v.as_vec3().to_array();
        (
            normals.iter().map(|n| single(*n * 0.4 + 0.5)).collect(),
            normals.iter().map(|n| single(*n * f64::from(area))).collect(),
            vec![area; count],
        )
    }

    fn sorted(mut p: Vec<[f32; 3]>, mut m: Vec<[f32; 3]>) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
        let key = |p: &[f32; 3]| crate::points::samples::morton(glam::DVec3::from_array(p.map(f64::from)));
        let mut order: Vec<usize> = (0..p.len()).collect();
        order.sort_by_key(|&i| key(&p[i]));
        p = order.iter().map(|&i| p[i]).collect();
        m = order.iter().map(|&i| m[i]).collect();
        (p, m)
    }

    fn targets(positions: &[[f32; 3]], width: f32) -> Vec<Target> {
        positions
            .iter()
            .map(|&position| Target { position, width })
            .collect()
    }

    /// Without the tree, by the same kernel.
    fn direct<K: Kernel>(kernel: &K, p: &[[f32; 3]], s: &[K::Strength], at: &[Target]) -> Vec<K::Output> {
        let sources: Vec<_> = p
            .iter()
            .zip(s)
            .map(|(&position, &strength)| Source { position, strength })
            .collect();
        let mut out = vec![K::Output::default(); at.len()];
        for (at, out) in at.chunks(LANES).zip(out.chunks_mut(LANES)) {
            kernel.sum(&sources, at, out);
        }
        out
    }

    #[test]
    fn sums_over_the_tree_are_those_over_all_points() {
        let (p, m, areas) = ball(4000);
        let (p, m) = sorted(p, m);
        let tree = Tree::new(p.clone(), &areas);
        assert_eq!(tree.leaves().iter().map(|r| r.len()).sum::<usize>(), 4000);
        let at = targets(&p, 0.02);
        let (near, exact) = (
            tree.sum(&Winding, &m, &at, tree.leaves()),
            direct(&Winding, &p, &m, &at),
        );
        let rms = |e: f64| (e / 4000.0).sqrt();
        let error = rms(near
            .iter()
            .zip(&exact)
            .map(|(a, b)| f64::from(a - b).powi(2))
            .sum());
        assert!(error < 0.02, "{error}");
        let (near, exact) = (
            tree.sum(&Gradient, &m, &at, tree.leaves()),
            direct(&Gradient, &p, &m, &at),
        );
        let square = |a: &[f32; 3]| a.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
        let error: f64 = near
            .iter()
            .zip(&exact)
            .map(|(a, b)| square(&[0, 1, 2].map(|k| a[k] - b[k])))
            .sum();
        let relative = (error / exact.iter().map(square).sum::<f64>()).sqrt();
        assert!(relative < 0.03, "{relative}");
    }

    #[test]
    fn the_winding_number_is_one_inside_and_none_outside() {
        let (p, m, areas) = ball(20_000);
        let (p, m) = sorted(p, m);
        let tree = Tree::new(p, &areas);
        let at = targets(
            &[[0.5; 3], [0.6, 0.4, 0.5], [0.98, 0.5, 0.5], [0.1, 0.1, 0.1]],
            0.0,
        );
        let w = tree.sum(&Winding, &m, &at, &[0..2, 2..4]);
        for (w, expected) in w.iter().zip([1.0, 1.0, 0.0, 0.0]) {
            // The areas of random points are known to about one part in the root of their number in view.
            assert!((w - expected).abs() < 0.05, "{w} for {expected}");
        }
    }

    #[test]
    fn the_gradient_is_the_difference_of_winding_numbers() {
        let (p, m, _) = ball(500);
        let x = [0.52f32, 0.3, 0.41];
        let step = 1e-3f32;
        let [g] = direct(&Gradient, &p, &m, &targets(&[x], 0.1))[..] else {
            panic!("one target");
        };
        for k in 0..3 {
            let side = |sign: f32| {
                let mut y = x;
                y[k] += sign * step;
                direct(&Winding, &p, &m, &targets(&[y], 0.1))[0]
            };
            let slope = (side(1.0) - side(-1.0)) / (2.0 * step);
            assert!((slope + g[k]).abs() < 2e-3, "{slope} {}", g[k]);
        }
    }

    #[test]
    fn the_adjoint_is_one() {
        let (p, m, _) = ball(300);
        let at = targets(&p, 0.05);
        let mut random = SplitMix64::new(4);
        let s: Vec<[f32; 1]> = p.iter().map(|_| [random.normal() as f32]).collect();
        let w = direct(&Winding, &p, &m, &at);
        let g = direct(&Adjoint, &p, &s, &at);
        let one: f64 = w.iter().zip(&s).map(|(w, [s])| f64::from(w * s)).sum();
        let other: f64 = g
            .iter()
            .zip(&m)
            .map(|(g, m)| (0..3).map(|k| f64::from(g[k] * m[k])).sum::<f64>())
            .sum();
        assert!((one - other).abs() < 1e-4 * one.abs().max(1.0), "{one} {other}");
    }
}
