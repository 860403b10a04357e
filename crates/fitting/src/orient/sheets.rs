//! Open sheets, such as terrain: no winding number tells their sides apart, so each point follows its neighbours.

use glam::DVec3;
use rayon::prelude::*;

use super::UNSURE;
use super::confidence::{Sides, sides};
use super::local::Neighbours;
use super::surface::Surface;

/// Neighbours that a point may follow.
const NEIGHBOURS: usize = 10;
/// Fewest points of a sheet: of fewer, neighbours lie on all sides of a closed surface.
const FEWEST: usize = 100;
/// Share of the area of an open sheet that has unsure signs, at least.
const OPEN: f64 = 0.25;
/// Share of the opposed neighbours that may be left when each point follows the others: terrain has 0 to 0.2, with noise
/// too, and noisy walls that nearly touch, where the winding number is the better guide, 0.5 to 0.8.
const LEFT: f64 = 0.25;
/// Share of the area of a sheet by which one of its sides has to be the more certain, to decide which is the outer one.
const DECISIVE: f64 = 0.1;
/// Share of the unsure area in all below which there is no sheet worth looking for.
const WORTH_LOOKING: f64 = 0.02;

/// Gives the points of open sheets one sign a sheet, along the spanning tree whose neighbours have the most parallel
/// normals \[Hoppe92\]; returns how many there are.
///
/// The outer side of a sheet is that with the more certain signs, as of a bowl; where neither is, that which faces along
/// the axis that the sheet faces most, as up from terrain.
pub(super) fn align(
    points: &[DVec3],
    surface: &Surface,
    signed: &mut [DVec3],
    confidence: &mut Vec<f32>,
) -> usize {
    let area = |i: usize| f64::from(surface.areas[i]);
    let all: f64 = (0..points.len()).map(area).sum();
    let unsure: f64 = (0..points.len())
        .filter(|&i| confidence[i] < UNSURE)
        .map(area)
        .sum();
    if unsure <= WORTH_LOOKING * all {
        return 0;
    }
    let edges = edges(points, surface);
    let forest = Forest::spanning(points.len(), &edges);
    let root = |i: usize| forest.parent[i].0 as usize;
    let followed: Vec<DVec3> = (0..points.len())
        .map(|i| {
            let local = surface.around[i].normal;
            if forest.parent[i].1 { -local } else { local }
        })
        .collect();
    let mut pieces = vec![Piece::default(); points.len()];
    for i in 0..points.len() {
        let piece = &mut pieces[root(i)];
        piece.count += 1;
        piece.area += area(i);
        if confidence[i] < UNSURE {
            piece.unsure += area(i);
        }
    }
    for edge in &edges {
        let [i, j] = edge.ends.map(|e| e as usize);
        let piece = &mut pieces[root(i)];
        piece.torn += usize::from(signed[i].dot(signed[j]) < 0.0);
        piece.still_torn += usize::from(followed[i].dot(followed[j]) < 0.0);
    }
    let on_sheet: Vec<usize> = (0..points.len()).filter(|&i| pieces[root(i)].is_open()).collect();
    if on_sheet.is_empty() {
        return 0;
    }
    for &i in &on_sheet {
        signed[i] = followed[i];
    }
    let told = sides(points, signed, surface);
    for &i in &on_sheet {
        let piece = &mut pieces[root(i)];
        piece.certain += area(i) * f64::from(told[i].confidence() - told[i].turned().confidence());
        piece.facing += signed[i] * area(i);
    }
    for &i in &on_sheet {
        if pieces[root(i)].is_inside_out() {
            signed[i] = -signed[i];
        }
    }
    *confidence = sides(points, signed, surface)
        .iter()
        .map(Sides::confidence)
        .collect();
    on_sheet.len()
}

/// What is known of the points that the neighbours join.
#[derive(Clone, Copy, Default)]
struct Piece {
    count: usize,
    area: f64,
    unsure: f64,
    /// Pairs of neighbours whose normals are opposed, and that would be if each point followed its neighbours.
    torn: usize,
    still_torn: usize,
    /// Area by certainty, of the signs less of their opposites.
    certain: f64,
    /// Area by normals.
    facing: DVec3,
}

impl Piece {
    fn is_open(&self) -> bool {
        let is_torn = self.still_torn as f64 >= LEFT * self.torn as f64;
        self.count >= FEWEST && self.unsure > OPEN * self.area && !is_torn
    }

    fn is_inside_out(&self) -> bool {
        if self.certain.abs() > DECISIVE * self.area {
            return self.certain < 0.0;
        }
        let most = self.facing.abs().max_position();
        self.facing[most] < 0.0
    }
}

/// Two neighbours.
struct Edge {
    /// One less the cosine between their normals, whichever way they point.
    slant: f32,
    /// The earlier point first.
    ends: [u32; 2],
    /// Whether the normals of their surroundings are opposed.
    is_opposed: bool,
}

/// Points and their neighbours, those with the most parallel normals first.
fn edges(points: &[DVec3], surface: &Surface) -> Vec<Edge> {
    let near = Neighbours::new(points);
    let mut edges: Vec<Edge> = (0..points.len())
        .into_par_iter()
        .with_min_len(256)
        .flat_map_iter(|i| {
            let near: Vec<usize> = near.nearest(points[i], NEIGHBOURS + 1).map(|n| n.0).collect();
            near.into_iter().filter(move |&j| j != i).map(move |j| {
                let cosine = surface.around[i].normal.dot(surface.around[j].normal);
                Edge {
                    slant: (1.0 - cosine.abs()) as f32,
                    ends: [i.min(j), i.max(j)].map(|e| e as u32),
                    is_opposed: cosine < 0.0,
                }
            })
        })
        .collect();
    edges.par_sort_unstable_by(|a, b| a.slant.total_cmp(&b.slant).then(a.ends.cmp(&b.ends)));
    edges
}

/// Trees of points.
struct Forest {
    /// A point nearer to the root, never a later one, and whether the normals there and here are opposed.
    parent: Vec<(u32, bool)>,
}

impl Forest {
    /// Over the first edges that join all they can.
    fn spanning(count: usize, edges: &[Edge]) -> Self {
        let mut forest = Self {
            parent: (0..count as u32).map(|i| (i, false)).collect(),
        };
        for edge in edges {
            forest.join(edge);
        }
        // Parents come first, so each has its root already.
        for i in 0..count as u32 {
            forest.shorten(i);
        }
        forest
    }

    /// Makes the parent of a point that of its parent.
    fn shorten(&mut self, point: u32) -> u32 {
        let (parent, is_opposed) = self.parent[point as usize];
        let (above, is_opposed_there) = self.parent[parent as usize];
        self.parent[point as usize] = (above, is_opposed ^ is_opposed_there);
        above
    }

    /// The root of a point, and whether the normals there and here are opposed.
    fn find(&mut self, point: u32) -> (u32, bool) {
        let (mut at, mut is_opposed) = (point, false);
        while self.parent[at as usize].0 != at {
            let above = self.shorten(at);
            is_opposed ^= self.parent[at as usize].1;
            at = above;
        }
        (at, is_opposed)
    }

    /// Joins the trees of two neighbours, if they are two.
    fn join(&mut self, edge: &Edge) {
        let [(a, from_a), (b, from_b)] = edge.ends.map(|e| self.find(e));
        if a != b {
            self.parent[a.max(b) as usize] = (a.min(b), from_a ^ from_b ^ edge.is_opposed);
        }
    }
}
