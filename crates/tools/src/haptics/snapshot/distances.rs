//! Distances at the nodes of a grid, from the closest places of the surface.

use bspline::Aabb;
use glam::DVec3;

use super::beside::BesideNodes;
use super::changes::Changes;
use super::far::Far;
use super::grid::Grid;
use super::hull::Hull;
use super::nearest::{self, Way};
use super::region::{Flags, Region};
use super::samples::Samples;
use super::seek::{Seek, Seeker};
use super::surface::Surface;
use super::thin::{Thin, Unresolved};
use super::walk::{Firsts, walk};

/// Node distances beyond the band in which distances are as exact as in it.
const MARGIN: f64 = 2.0;
/// What a distance may be off by, over the node distance, where the field is not asked: at what a tool touches, and anywhere.
const TRUSTED: [f64; 2] = [1e-3, 1e-2];

/// What is known of a field round a tool. What is found at a node follows from the field and the box alone, not from what was known before.
#[derive(Clone, Debug)]
pub struct Distances {
    /// The nodes.
    pub grid: Grid,
    /// Up to here in the air, and up to [`MARGIN`] nodes in the solid, distances are exact, mm; beyond, no less than this.
    pub band: f64,
    /// Signed distance, mm, positive in the air.
    pub phi: Vec<f32>,
    /// What the nodes are too far apart for.
    pub unresolved: Unresolved,
    /// Nodes whose closest place was looked for anew.
    pub renewed: usize,
    /// Round the nodes that got another distance.
    pub changed: Region,
    samples: Samples,
    nodes: BesideNodes,
    /// To the node beside the surface that is nearest, if that is near.
    ways: Vec<Way>,
    /// What each exact distance was made from.
    hulls: Vec<[i32; 6]>,
    /// Whether the field was asked for it: what was not follows from nodes beside the surface alone.
    asked: Vec<bool>,
    /// Nodes whose distance was made from more than what is near.
    strays: Vec<u32>,
    far: Far,
    thin: Thin,
}

/// What is known of a box.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Known {
    Nothing,
    /// What was known of another box: nodes at the sides have other neighbours.
    Moved,
    Same,
}

impl Distances {
    /// Of a surface at the nodes of a grid, exact up to `band`.
    pub fn new(surface: &Surface<'_>, grid: Grid, band: f64) -> Self {
        let samples = Samples::new(surface, &grid);
        let mut all = Self::blank(grid, band, samples, BesideNodes::new(&grid));
        all.update(
            surface,
            Region::whole(&grid),
            Changes::new(&grid, &[]),
            Known::Nothing,
        );
        all
    }

    /// Nothing known but samples and nodes beside the surface.
    fn blank(grid: Grid, band: f64, samples: Samples, nodes: BesideNodes) -> Self {
        Self {
            grid,
            band,
            phi: vec![0.0; grid.len()],
            unresolved: Unresolved::default(),
            renewed: 0,
            changed: Region::NONE,
            samples,
            nodes,
            ways: vec![Way::UNKNOWN; grid.len()],
            hulls: vec![[0; 6]; grid.len()],
            asked: vec![false; grid.len()],
            strays: Vec::new(),
            far: Far::default(),
            thin: Thin::new(&grid),
        }
    }

    /// Brings it up to a later field and another box: only what can have changed is looked for anew. `changed` are boxes of the field's own
    /// world outside which it has the bits that it had. The old surface has the same iso-value and stands at the same place.
    pub fn renew(&mut self, surface: &Surface<'_>, grid: Grid, changed: &[Aabb]) {
        let overlaps = (0..3).all(|a| {
            grid.first[a].abs_diff(self.grid.first[a]) < self.grid.count[a].min(grid.count[a]) as u64
        });
        if grid.spacing != self.grid.spacing || !overlaps {
            *self = Self::new(surface, grid, self.band);
            return;
        }
        let of_world: Vec<Aabb> = changed.iter().map(|b| surface.to_world(b)).collect();
        let changes = Changes::new(&grid, &of_world);
        if grid == self.grid {
            let seen = self.samples.renew(surface, &grid, changed);
            return self.update(surface, seen, changes, Known::Same);
        }
        let samples = self.samples.moved(surface, &self.grid, &grid, changed);
        let nodes = self.nodes.moved(&self.grid, &grid);
        let mut all = Self::blank(grid, self.band, samples, nodes);
        let both = [grid.number([0; 3]), grid.number(grid.count.map(|n| n - 1))];
        let mut both_hull = Hull::of(both[0]);
        both_hull.add(both[1]);
        for (at, there) in both_hull.region(&self.grid).rows(&self.grid) {
            let to = grid.find(self.grid.number(at)).map(|at| grid.slot(at));
            let to = to
                .map(|start| start..start + there.len())
                .expect("a node of both");
            all.phi[to.clone()].copy_from_slice(&self.phi[there.clone()]);
            all.ways[to.clone()].copy_from_slice(&self.ways[there.clone()]);
            all.hulls[to.clone()].copy_from_slice(&self.hulls[there.clone()]);
            all.asked[to].copy_from_slice(&self.asked[there]);
        }
        let kept = self.strays.iter().filter_map(|slot| {
            let at = grid.find(self.grid.number(self.grid.node(*slot as usize)))?;
            Some(grid.slot(at) as u32)
        });
        all.strays.extend(kept);
        all.update(surface, Region::whole(&grid), changes, Known::Moved);
        *self = all;
    }

    /// Brings all that follows from the samples up to what these are now. Those in `seen` may be others than before.
    fn update(&mut self, surface: &Surface<'_>, seen: Region, changes: Changes, known: Known) {
        let grid = self.grid;
        let done = self.nodes.update(surface, &grid, &self.samples, seen, &changes);
        self.renewed = done.sought;
        self.changed = Region::NONE;
        // Of a box of which nothing was known, everything is new.
        let others: &[usize] = match known {
            Known::Nothing => &[],
            _ => &done.others,
        };
        let (changes, others) = (changes.with(others), Changes::of_nodes(&grid, others));
        let has_moved = known != Known::Same;
        if self.nodes.is_empty() {
            self.fill(surface);
            self.changed = Region::whole(&grid);
        } else if has_moved || !done.others.is_empty() || !changes.hull().region(&grid).is_empty() {
            let mut came = Region::NONE;
            done.came_or_went
                .iter()
                .for_each(|slot| came.add(grid.node(*slot)));
            let turned = self.turn(if has_moved { Region::whole(&grid) } else { came });
            self.spread(surface, (&changes, &others), &turned, has_moved);
            let is_same = done.came_or_went.is_empty();
            let mut cells = self
                .far
                .update(&grid, &self.samples, &self.nodes, (&others, is_same));
            cells.mark(seen);
            let (limits, ways) = (self.limits(), &self.ways);
            let (samples, least) = (&self.samples, [self.exact(false), self.exact(true)]);
            let filled = self.far.fill(
                &grid,
                samples,
                (&cells, &turned),
                |slot| is_exact(ways[slot], samples.inside[slot], limits),
                |is_inside| least[usize::from(is_inside)] as f32,
                &mut self.phi,
            );
            self.changed = self.changed.hull(filled);
        }
        let looked = match has_moved {
            true => Region::whole(&grid),
            false => seen.hull(changes.hull().region(&grid)),
        };
        let nodes = &self.nodes;
        self.unresolved = self
            .thin
            .update(surface, &grid, &self.samples, looked, |slot| nodes.get(slot));
    }

    /// Distance up to which closest places are looked for on a side.
    fn exact(&self, is_inside: bool) -> f64 {
        let margin = MARGIN * self.grid.spacing;
        if is_inside {
            2.0 * margin
        } else {
            self.band + margin
        }
    }

    /// What a distance may be off by where the field is not asked, mm: the less, the nearer it is to the radius of the tool.
    fn trusted(&self, far: f64, is_inside: bool) -> f64 {
        let radius = self.band - MARGIN * self.grid.spacing;
        let beside = (if is_inside { -far } else { far } - radius) / self.grid.spacing;
        let [least, most] = TRUSTED;
        (least * (1.0 + 4.0 * beside * beside)).min(most) * self.grid.spacing
    }

    /// Squares of the nodes to one beside the surface up to which distances are exact, in the air and in the solid.
    fn limits(&self) -> [u32; 2] {
        // A node beside the surface is at most one away from it.
        [false, true].map(|side| (self.exact(side) / self.grid.spacing + 1.0).powi(2) as u32)
    }

    /// Nodes up to which one beside the surface is near.
    fn reach(&self) -> usize {
        let most = self.limits().into_iter().fold(0, u32::max);
        (f64::from(most).sqrt() as usize + 1).min(nearest::FARTHEST)
    }

    /// Finds the nodes beside the surface that are nearest where some `came_or_went`. Returns the nodes from which another is
    /// nearest than before.
    fn turn(&mut self, came_or_went: Region) -> Flags {
        let grid = self.grid;
        let reach = self.reach();
        let region = came_or_went.grown(reach, &grid);
        let mut turned = Flags::new(region);
        let (nodes, ways) = (&self.nodes, &mut self.ways);
        nearest::near(
            &grid,
            |slot| nodes.is(slot),
            region,
            reach,
            |at, slot, way| {
                if ways[slot] != way {
                    ways[slot] = way;
                    turned.set(at);
                }
            },
        );
        turned
    }

    /// Finds the closest places of the nodes near the surface, from those beside it that are nearest.
    /// Where the field has changed, only those that it was asked for are looked at; where nodes beside the surface are `others`, all.
    fn spread(
        &mut self,
        surface: &Surface<'_>,
        (changes, others): (&Changes, &Changes),
        turned: &Flags,
        has_moved: bool,
    ) {
        let grid = self.grid;
        let limits = self.limits();
        let mut seekers = Vec::new();
        let mut found = Region::NONE;
        let mut ask = |all: &mut Self, at: [usize; 3], slot: usize| {
            let inside = all.samples.inside[slot];
            if !is_exact(all.ways[slot], inside, limits) {
                return;
            }
            let known = Hull::unpack(&all.hulls[slot]);
            let cause = if all.asked[slot] { changes } else { others };
            let is_other = cause.touch(&known)
                || (all.phi[slot] < 0.0) != inside
                || turned.any_beside(at)
                || has_moved && (grid.is_rim(at) || !known.is_within(&grid));
            if !is_other {
                return;
            }
            let p = grid.place(at);
            let mut hull = Hull::of(grid.number(at));
            let walked = walk(
                &grid,
                &all.nodes,
                p,
                Firsts::of(&grid, &all.ways, at, slot).list(),
                &mut hull,
            );
            let Some(walked) = walked else { return };
            let far = walked.far(p);
            let phi = if walked.beside.node == grid.number(at) {
                walked.beside.phi
            } else if far > all.exact(inside) || walked.off(p) < all.trusted(far, inside) {
                (if inside { -far } else { far }) as f32
            } else {
                // A spline between nodes also follows those a little farther on.
                seekers.push(Seeker {
                    slot: slot as u32,
                    start: walked.beside.at,
                    at: walked.there,
                    other: None,
                    hull,
                });
                return;
            };
            all.found(slot, phi, (hull, false), &mut found);
        };
        let mut near = Region::whole(&grid);
        if !has_moved {
            let changed = changes.hull().grown(self.wide()).region(&grid);
            near = changed.hull(turned.region().grown(1, &grid));
            for slot in self.strays.clone() {
                let at = grid.node(slot as usize);
                if !near.contains(at) {
                    ask(self, at, slot as usize);
                }
            }
        }
        for (first, slots) in near.rows(&grid) {
            for (z, slot) in slots.enumerate() {
                ask(self, [first[0], first[1], first[2] + z], slot);
            }
        }
        let seek = Seek {
            surface,
            grid: &grid,
            inside: &self.samples.inside,
        };
        seek.all(&mut seekers, None);
        let sought: Vec<f32> = seekers.iter().map(|seeker| seek.signed(seeker)).collect();
        for (seeker, phi) in seekers.iter().zip(sought) {
            self.found(seeker.slot as usize, phi, (seeker.hull, true), &mut found);
        }
        self.renewed += seekers.len();
        self.changed = self.changed.hull(found);
        self.strays.sort_unstable();
        self.strays.dedup();
    }

    /// Notes an exact distance, what it was made from and whether the field was asked.
    fn found(&mut self, slot: usize, phi: f32, (hull, asked): (Hull, bool), changed: &mut Region) {
        let at = self.grid.node(slot);
        (self.hulls[slot], self.asked[slot]) = (hull.pack(), asked);
        if hull.is_wider(self.grid.number(at), self.wide()) {
            self.strays.push(slot as u32);
        }
        if self.phi[slot].to_bits() != phi.to_bits() {
            self.phi[slot] = phi;
            changed.add(at);
        }
    }

    /// Nodes from one up to the farthest that its distance follows from, but for some.
    fn wide(&self) -> i32 {
        self.reach() as i32 + 2
    }

    /// Without a surface in the box: how far it is at least, as the field falls in the middle.
    fn fill(&mut self, surface: &Surface<'_>) {
        let b = self.grid.world_box();
        let (value, gradient) = surface.value_gradient(b.center());
        let inward = gradient.try_normalize().unwrap_or(DVec3::NEG_Z);
        // So far away that no node is nearer than the rim.
        let far = self.band + b.size().length();
        for slot in 0..self.grid.len() {
            let along = (self.grid.place(self.grid.node(slot)) - b.center()).dot(inward);
            self.phi[slot] = (if value > 0.0 { -far } else { far } - along) as f32;
        }
        // What comes after this begins anew.
        self.ways.fill(Way::UNKNOWN);
        self.far = Far::default();
    }
}

/// Whether a node is so near to one beside the surface that its distance is exact.
fn is_exact(way: Way, is_inside: bool, limits: [u32; 2]) -> bool {
    way.square()
        .is_some_and(|square| square <= limits[usize::from(is_inside)])
}
