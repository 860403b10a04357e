//! Where on its edge each vertex of a block lies.

use glam::DVec3;

use super::Placement;
use super::blocks::{BlockCounts, Edge};
use super::roots::{Bracket, Step};
use crate::{Field, Frame};

/// Vertices keep this share of an edge from its ends, so that the up to six vertices round a node, and with
/// them the corners of every triangle, stay distinct: at 1e-3 by 16 units in the last place of f32 for a frame of
/// 512 cells from the origin. It moves 1 vertex in 500, by less than a chord's distance from its arc as soon as
/// the radius of curvature is below 100 cells.
pub(super) const CLAMP: f64 = 1e-3;

/// Field values at those nodes of a block that lie in the frame.
pub(super) struct SampledNodes<'a> {
    /// First of them, counted from the block's first node, and their number on each axis.
    pub skip: [usize; 3],
    pub count: [usize; 3],
    /// Their values, last axis fastest.
    pub values: &'a [f64],
    pub iso: f64,
}

impl SampledNodes<'_> {
    /// `f - iso` at a node of the block; `None` beyond the frame.
    fn at(&self, node: [usize; 3]) -> Option<f64> {
        let [i, j, k] = [0, 1, 2].map(|a| node[a].wrapping_sub(self.skip[a]));
        let [ni, nj, nk] = self.count;
        (i < ni && j < nj && k < nk).then(|| self.values[(i * nj + j) * nk + k] - self.iso)
    }
}

/// Buffers used again from block to block.
#[derive(Default)]
pub(super) struct PlacementScratch {
    points: Vec<DVec3>,
    answers: Vec<(f64, DVec3)>,
    /// Vertices not yet placed.
    brackets: Vec<(u32, Bracket)>,
}

/// Finds the parameter `t` of the vertex on each edge; `origin` is the block's first node.
///
/// All vertices of the block that still need an evaluation are asked for together.
pub(super) fn place_vertices(
    field: &dyn Field,
    frame: &Frame,
    placement: Placement,
    origin: [i64; 3],
    edges: &[Edge],
    nodes: &SampledNodes,
    scratch: &mut PlacementScratch,
    counts: &mut BlockCounts,
) -> Vec<f64> {
    let PlacementScratch {
        points,
        answers,
        brackets,
    } = scratch;
    brackets.clear();
    let mut t = Vec::with_capacity(edges.len());
    for (v, &(node, axis)) in edges.iter().enumerate() {
        let mut end = node;
        end[axis] += 1;
        t.push(match (nodes.at(node), nodes.at(end)) {
            (Some(g0), Some(g1)) => {
                let bracket = Bracket::new(g0, g1);
                brackets.push((v as u32, bracket));
                bracket.secant()
            }
            // One end lies beyond the frame: a vertex of the cap.
            (first, _) => {
                counts.cap_vertices += 1;
                if first.is_some() { 0.0 } else { 1.0 }
            }
        });
    }
    if let Placement::RootFinding { tolerance } = placement {
        let axes = frame.world_from_grid.matrix3;
        while !brackets.is_empty() {
            points.clear();
            points.extend(brackets.iter().map(|&(v, _)| {
                let (node, axis) = edges[v as usize];
                edge_point(frame, origin, node, axis, t[v as usize])
            }));
            answers.resize(points.len(), (0.0, DVec3::ZERO));
            field.values_gradients(points, answers);
            counts.root_evaluations += points.len() as u32;
            let mut answer = answers.iter();
            brackets.retain_mut(|(v, bracket)| {
                let v = *v as usize;
                let &(f, gradient) = answer.next().expect("one answer per bracket");
                let slope = gradient.dot(axes.col(edges[v].1));
                let step = bracket.advance(t[v], f - nodes.iso, slope, tolerance);
                let (Step::Try(at) | Step::Found(at) | Step::GivenUp(at)) = step;
                t[v] = at;
                counts.unconverged += matches!(step, Step::GivenUp(_)) as u32;
                matches!(step, Step::Try(_))
            });
        }
    }
    for t in &mut t {
        *t = t.clamp(CLAMP, 1.0 - CLAMP);
    }
    t
}

/// World position at parameter `t` of the edge from `origin + node` along `axis`.
#[inline(always)]
pub(super) fn edge_point(frame: &Frame, origin: [i64; 3], node: [usize; 3], axis: usize, t: f64) -> DVec3 {
    let mut p = DVec3::new(
        (origin[0] + node[0] as i64) as f64,
        (origin[1] + node[1] as i64) as f64,
        (origin[2] + node[2] as i64) as f64,
    );
    p[axis] += t;
    frame.world_from_grid.transform_point3(p)
}
