//! Parts of a solid, and gaps in it, that are too thin for a grid.

use bspline::Jet;
use glam::DVec3;

use super::beside::Beside;
use super::foot::Foot;
use super::grid::Grid;
use super::region::Region;
use super::samples::{Samples, blocks, nodes_of};
use super::surface::Surface;

/// Share of the steepest fall to a neighbour within which a node may be near a surface that no neighbour is behind. From a surface that
/// is seen, nodes with all neighbours on their side are farther away.
const NEAR: f32 = 0.75;
/// Cosine between the normals of two surfaces that face one another, rather than meet at an edge.
const FACING: f64 = -0.5;
/// Share of a cell beyond which a place is not in it.
const TOUCHES: f64 = 0.1;
/// Newton steps towards a surface that may be there.
const STEPS: usize = 4;
/// Nodes round one that it is judged by: as far as these steps lead.
const NEIGHBOURS: usize = 6;

/// What the nodes of a grid are too far apart for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Unresolved {
    /// Places where a sheet or a gap is only one node thick.
    pub thin: usize,
    /// Thickness of the thinnest of these, mm.
    pub thinnest: f64,
    /// Nodes beside a surface that passes between the nodes unseen. What lies there cannot be touched.
    pub missed: usize,
}

impl Unresolved {
    /// Whether anything is.
    pub fn any(&self) -> bool {
        self.thin + self.missed > 0
    }
}

/// What is too thin, block by block.
#[derive(Clone, Debug)]
pub struct Thin {
    blocks: Vec<Unresolved>,
}

impl Thin {
    /// Nothing looked at.
    pub fn new(grid: &Grid) -> Self {
        Self {
            blocks: vec![Unresolved::default(); blocks(grid).count()],
        }
    }

    /// Looks at the blocks of a grid that have a part near a region in which something has changed. `beside` gives what is known of a node beside the
    /// surface.
    pub fn update<'a>(
        &mut self,
        surface: &Surface<'_>,
        grid: &Grid,
        samples: &Samples,
        changed: Region,
        beside: impl Fn(usize) -> Option<&'a Beside>,
    ) -> Unresolved {
        let near = changed.grown(NEIGHBOURS, grid);
        for (found, block) in self.blocks.iter_mut().zip(blocks(grid)) {
            let own = nodes_of(block, grid);
            if (0..3).all(|a| own.lo[a] < near.end[a] && near.lo[a] < own.end[a]) {
                *found = look(surface, grid, samples, own, &beside);
            }
        }
        let mut all = Unresolved::default();
        for found in &self.blocks {
            if found.thin > 0 {
                let before = if all.thin > 0 { all.thinnest } else { f64::INFINITY };
                all.thinnest = before.min(found.thinnest);
            }
            all.thin += found.thin;
            all.missed += found.missed;
        }
        all
    }
}

/// Looks through a part of a grid.
fn look<'a>(
    surface: &Surface<'_>,
    grid: &Grid,
    samples: &Samples,
    part: Region,
    beside: impl Fn(usize) -> Option<&'a Beside>,
) -> Unresolved {
    let mut found = Unresolved {
        thinnest: f64::INFINITY,
        ..Unresolved::default()
    };
    let strides = grid.strides();
    let mut doubtful = Vec::new();
    let inner = Region {
        lo: part.lo.map(|n| n.max(1)),
        end: std::array::from_fn(|a| part.end[a].min(grid.count[a] - 1)),
    };
    for (first, slots) in inner.rows(grid) {
        for (z, slot) in slots.enumerate() {
            if beside(slot).is_some() {
                let between = strides.iter().filter_map(|stride| {
                    let both = [slot - stride, slot + stride];
                    let is_alone = both.iter().all(|s| samples.inside[*s] != samples.inside[slot]);
                    is_alone.then(|| both.map(&beside)).and_then(thickness)
                });
                if let Some(thick) = between.reduce(f64::min) {
                    found.thin += 1;
                    found.thinnest = found.thinnest.min(thick);
                }
                continue;
            }
            let value = samples.values[slot];
            // No number is not near.
            if value.is_nan() {
                continue;
            }
            let steepest = strides
                .iter()
                .flat_map(|stride| [slot - stride, slot + stride])
                .fold(0.0, |m: f32, other| m.max((samples.values[other] - value).abs()));
            if value.abs() < NEAR * steepest && is_among_its_like(grid, samples, slot) {
                doubtful.push(grid.place([first[0], first[1], first[2] + z]));
            }
        }
    }
    found.missed = doubtful
        .iter()
        .filter(|p| is_unseen(surface, grid, samples, **p))
        .count();
    if found.thin == 0 {
        found.thinnest = 0.0;
    }
    found
}

/// Distance of two surfaces that face one another, by their closest places.
fn thickness(nodes: [Option<&Beside>; 2]) -> Option<f64> {
    let [a, b] = [nodes[0]?, nodes[1]?];
    let (m, n) = (a.foot.inward, b.foot.inward);
    (m.dot(n) < FACING).then(|| (a.at - b.at).dot(m).abs())
}

/// Whether all 26 neighbours are on the side of a node that is not at the rim.
fn is_among_its_like(grid: &Grid, samples: &Samples, slot: usize) -> bool {
    let [sx, sy, _] = grid.strides();
    let first = slot - sx - sy - 1;
    let side = samples.inside[slot];
    (0..9).all(|row| {
        let start = first + row / 3 * sx + row % 3 * sy;
        samples.inside[start..start + 3].iter().all(|s| *s == side)
    })
}

/// Whether there is a surface near a node in a cell whose corners are all on one side.
fn is_unseen(surface: &Surface<'_>, grid: &Grid, samples: &Samples, p: DVec3) -> bool {
    let (mut x, mut jets): (DVec3, Vec<Jet>) = (p, Vec::new());
    for _ in 0..STEPS {
        surface.jets(&[x], &mut jets);
        let Some(foot) = Foot::new(x, &jets[0]) else {
            return false;
        };
        x -= foot.depth.clamp(-grid.spacing, grid.spacing) * foot.inward;
        if foot.depth.abs() < 0.02 * grid.spacing {
            break;
        }
    }
    surface.jets(&[x], &mut jets);
    let Some(foot) = Foot::new(x, &jets[0]) else {
        return false;
    };
    if foot.depth.abs() > 0.02 * grid.spacing || x.distance(p) > 1.2 * grid.spacing {
        return false;
    }
    // Of all cells that nearly hold it: edges and faces that pass through nodes are seen from the other side.
    let end = |by: f64| grid.cell(x + by * grid.spacing);
    let (Some(lo), Some(hi)) = (end(-TOUCHES), end(TOUCHES)) else {
        return false;
    };
    let side = samples.inside[grid.slot(lo)];
    let mut nodes = (lo[0]..=hi[0] + 1)
        .flat_map(|x| (lo[1]..=hi[1] + 1).flat_map(move |y| (lo[2]..=hi[2] + 1).map(move |z| [x, y, z])));
    nodes.all(|node| samples.inside[grid.slot(node)] == side)
}
