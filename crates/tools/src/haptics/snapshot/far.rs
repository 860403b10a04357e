//! Distances far from the surface, where only the way matters: looked for at every [`STEP`]th node, linear between these.

use super::beside::BesideNodes;
use super::changes::Changes;
use super::grid::{Grid, STEP};
use super::hull::Hull;
use super::nearest;
use super::region::{Flags, Region};
use super::samples::Samples;
use super::walk::walk;

/// Signed distances, mm, at every [`STEP`]th node of a grid.
#[derive(Clone, Debug, Default)]
pub struct Far {
    phi: Vec<f32>,
    /// The node beside the surface that is nearest to each.
    near: Vec<Option<u32>>,
    /// What each was made from.
    hulls: Vec<[i32; 6]>,
}

impl Far {
    /// Looks anew for those that may be others; tells round which of them something has changed. `is_same` says that no node beside the surface
    /// came or went.
    pub fn update(
        &mut self,
        grid: &Grid,
        samples: &Samples,
        nodes: &BesideNodes,
        (changes, is_same): (&Changes, bool),
    ) -> Cells {
        let count = grid.count.map(|n| (n - 1) / STEP + 1);
        let is_new = self.phi.is_empty();
        if is_new {
            let all = count.iter().product();
            self.phi = vec![f32::NAN; all];
            self.near = vec![None; all];
            self.hulls = vec![[0; 6]; all];
        }
        let mut before = None;
        if is_new || !is_same {
            let marked = nodes.all(grid).map(|(slot, _)| grid.node(slot));
            before = Some(std::mem::replace(&mut self.near, nearest::every(grid, marked)));
        }
        let mut changed = vec![is_new; count.iter().map(|n| n - 1).product()];
        for at in 0..self.phi.len() {
            let ijk = [
                at / (count[1] * count[2]),
                at / count[2] % count[1],
                at % count[2],
            ];
            let slot = grid.slot(ijk.map(|n| n * STEP));
            let is_inside = samples.inside[slot];
            let is_turned = before.as_ref().is_some_and(|before| before[at] != self.near[at]);
            let far = if is_new || is_turned || changes.touch(&Hull::unpack(&self.hulls[at])) {
                let p = grid.place(ijk.map(|n| n * STEP));
                let first = self.near[at].map(|slot| (slot as usize, grid.number(grid.node(slot as usize))));
                let mut hull = Hull::of(grid.number(ijk.map(|n| n * STEP)));
                let walked = walk(grid, nodes, p, first.as_slice(), &mut hull);
                self.hulls[at] = hull.pack();
                walked.map_or(f64::INFINITY, |walked| walked.far(p)) as f32
            } else {
                self.phi[at].abs()
            };
            let phi = if is_inside { -far } else { far };
            if self.phi[at].to_bits() != phi.to_bits() {
                self.phi[at] = phi;
                for corner in 0..8usize {
                    let cell: [usize; 3] = std::array::from_fn(|a| ijk[a].wrapping_sub(corner >> a & 1));
                    if (0..3).all(|a| cell[a] < count[a] - 1) {
                        changed[(cell[0] * (count[1] - 1) + cell[1]) * (count[2] - 1) + cell[2]] = true;
                    }
                }
            }
        }
        Cells {
            count: count.map(|n| n - 1),
            changed,
        }
    }

    /// Fills in what is not `exact`: in the cells that have changed, and where a region's flags are set. `least` is what distances are at least, on
    /// either side. Returns round the nodes that got another number.
    pub fn fill(
        &self,
        grid: &Grid,
        samples: &Samples,
        (cells, turned): (&Cells, &Flags),
        is_exact: impl Fn(usize) -> bool,
        least: impl Fn(bool) -> f32,
        phi: &mut [f32],
    ) -> Region {
        let [_, cy, cz] = grid.count.map(|n| (n - 1) / STEP + 1);
        let wide = (STEP as f64 * grid.spacing) as f32;
        let mut found = Region::NONE;
        let mut line = vec![0.0f32; cz];
        for x in 0..grid.count[0] {
            for y in 0..grid.count[1] {
                let (tx, ty) = (part(x, grid.count[0]), part(y, grid.count[1]));
                let is_other = |k: usize| cells.changed[(tx.0 * cells.count[1] + ty.0) * cells.count[2] + k];
                let is_turned = |at: [usize; 3]| turned.get(at);
                let own = turned.region();
                let may_turn = !own.is_empty()
                    && (own.lo[0]..own.end[0]).contains(&x)
                    && (own.lo[1]..own.end[1]).contains(&y);
                if !may_turn && !(0..cells.count[2]).any(is_other) {
                    continue;
                }
                let corner = |a: usize, b: usize| &self.phi[((tx.0 + a) * cy + ty.0 + b) * cz..][..cz];
                let rows = [corner(0, 0), corner(0, 1), corner(1, 0), corner(1, 1)];
                for (k, value) in line.iter_mut().enumerate() {
                    let mix = |t: f32, a: f32, b: f32| a + t * (b - a);
                    let [a, b] = [[0, 1], [2, 3]].map(|[a, b]: [usize; 2]| mix(ty.1, rows[a][k], rows[b][k]));
                    *value = mix(tx.1, a, b);
                }
                let start = grid.slot([x, y, 0]);
                for z in 0..grid.count[2] {
                    let tz = part(z, grid.count[2]);
                    let slot = start + z;
                    let is_open = is_other(tz.0) || may_turn && is_turned([x, y, z]);
                    if !is_open || is_exact(slot) {
                        continue;
                    }
                    let linear = line[tz.0] + tz.1 * (line[tz.0 + 1] - line[tz.0]);
                    let is_inside = samples.inside[slot];
                    let far = if is_inside { -linear } else { linear };
                    // Between nodes that are `wide` apart a distance bends up by at most `wide²/4φ`: what is told is no more than what is.
                    let far = (far - 0.25 * wide * wide / far.max(wide)).max(least(is_inside));
                    let now = if is_inside { -far } else { far };
                    if phi[slot].to_bits() != now.to_bits() {
                        phi[slot] = now;
                        found.add([x, y, z]);
                    }
                }
            }
        }
        found
    }
}

/// The interval of a node on an axis of so many, and how far in it it is.
fn part(n: usize, count: usize) -> (usize, f32) {
    let cell = (n / STEP).min((count - 1) / STEP - 1);
    (cell, (n - cell * STEP) as f32 / STEP as f32)
}

/// Intervals of [`STEP`] nodes in which something has changed.
pub struct Cells {
    count: [usize; 3],
    changed: Vec<bool>,
}

impl Cells {
    /// Marks those of some nodes.
    pub fn mark(&mut self, nodes: Region) {
        if nodes.is_empty() {
            return;
        }
        let [_, cy, cz] = self.count;
        let range = |a: usize| {
            let most = self.count[a] - 1;
            (nodes.lo[a] / STEP).min(most)..(nodes.end[a].div_ceil(STEP)).min(most + 1)
        };
        let [xs, ys, zs] = [range(0), range(1), range(2)];
        for x in xs {
            for y in ys.clone() {
                for z in zs.clone() {
                    self.changed[(x * cy + y) * cz + z] = true;
                }
            }
        }
    }
}
