//! Distances at the nodes of a grid, from the closest places of the surface.

use bspline::Aabb;
use glam::DVec3;

use super::foot::Foot;
use super::grid::Grid;
use super::hull::{Hull, Marks};
use super::nearest::{NONE, nearest};
use super::samples::{Before, Samples, meet};
use super::seek::{Seek, Seeker};
use super::surface::Surface;
use super::thin::{self, Unresolved};

/// Node distances beyond the band in which distances are as exact as in it.
const MARGIN: f64 = 2.0;
/// Closest places of neighbours that are tried, one after the other, each nearer than the one before.
const WALK: usize = 6;

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
    samples: Samples,
    /// Number among `beside` of a node beside the surface.
    near: Vec<u32>,
    beside: Vec<Beside>,
    /// The node beside the surface that is nearest.
    ways: Vec<u32>,
    /// What each distance was made from.
    hulls: Vec<Hull>,
}

/// What is known of a node beside the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Beside {
    node: [u16; 3],
    /// Where the surface was met first.
    start: DVec3,
    phi: f32,
    foot: Foot,
    hull: Hull,
}

/// What was known, on the way to what is.
struct Known<'a> {
    old: &'a Distances,
    before: Before<'a, Samples>,
    shift: [i64; 3],
    /// Cells in which the field has changed.
    changed: Marks,
}

impl Distances {
    /// Of a surface at the nodes of a grid, exact up to `band`.
    pub fn new(surface: &Surface<'_>, grid: Grid, band: f64) -> Self {
        Self::build(surface, grid, band, None)
    }

    /// The same from what was known of an earlier field: only what can have changed is looked for anew. `changed` are boxes of the
    /// field's own world outside which it has the bits that it had. The old surface has the same iso-value and stands at the same
    /// place.
    pub fn after(&self, surface: &Surface<'_>, grid: Grid, changed: &[Aabb]) -> Self {
        if grid.spacing != self.grid.spacing {
            return Self::new(surface, grid, self.band);
        }
        let before = Before {
            known: &self.samples,
            grid: &self.grid,
            changed,
        };
        Self::build(surface, grid, self.band, Some((self, before)))
    }

    fn build(
        surface: &Surface<'_>,
        grid: Grid,
        band: f64,
        known: Option<(&Self, Before<'_, Samples>)>,
    ) -> Self {
        let samples = Samples::new(surface, &grid, known.as_ref().map(|(_, before)| before));
        let known = known.map(|(old, before)| Known {
            old,
            shift: before.shift(&grid),
            changed: changed_cells(surface, &grid, before.changed),
            before,
        });
        let mut all = Self {
            grid,
            band,
            phi: vec![0.0; grid.len()],
            unresolved: Unresolved::default(),
            renewed: 0,
            samples,
            near: vec![NONE; grid.len()],
            beside: Vec::new(),
            ways: Vec::new(),
            hulls: Vec::new(),
        };
        all.step_out(surface, known.as_ref());
        if all.beside.is_empty() {
            all.fill(surface);
        } else {
            all.spread(surface, known.as_ref());
        }
        all.unresolved = thin::look(surface, &grid, &all.samples, |slot| all.foot_at(slot));
        all
    }

    /// The closest place of a node beside the surface.
    fn foot_at(&self, slot: usize) -> Option<&Foot> {
        let near = self.near[slot];
        (near != NONE).then(|| &self.beside[near as usize].foot)
    }

    /// Where the surface is met, about, on the way to the neighbour that it is nearest on, and that neighbour; none if all neighbours
    /// are on the same side.
    fn crossing(&self, at: [usize; 3], slot: usize) -> Option<[DVec3; 2]> {
        let (grid, strides) = (&self.grid, self.grid.strides());
        let Samples { values, inside } = &self.samples;
        let mut best: Option<(f64, usize, f64)> = None;
        for axis in 0..3 {
            for (sign, is_there) in [(-1.0, at[axis] > 0), (1.0, at[axis] + 1 < grid.count[axis])] {
                if !is_there {
                    continue;
                }
                let other = slot.wrapping_add_signed(sign as isize * strides[axis] as isize);
                if inside[other] == inside[slot] {
                    continue;
                }
                let share = values[slot] / (values[slot] - values[other]);
                // Where a block beside is known only as a whole.
                let share = if share.is_finite() {
                    share.clamp(0.0, 1.0)
                } else {
                    0.5
                };
                if best.is_none_or(|(least, ..)| share < least) {
                    best = Some((share, axis, sign));
                }
            }
        }
        best.map(|(share, axis, sign)| {
            let [mut place, mut other] = [grid.place(at); 2];
            place[axis] += sign * share * grid.spacing;
            other[axis] += sign * grid.spacing;
            [place, other]
        })
    }

    /// Finds the closest places of the nodes beside the surface.
    fn step_out(&mut self, surface: &Surface<'_>, known: Option<&Known<'_>>) {
        let grid = self.grid;
        let mut seekers = Vec::new();
        let mut numbers = Vec::new();
        for (slot, at) in grid.nodes().enumerate() {
            let Some([start, other]) = self.crossing(at, slot) else {
                continue;
            };
            let (number, node) = (self.beside.len(), at.map(|n| n as u16));
            self.near[slot] = number as u32;
            let old = known.and_then(|known| known.beside(&grid, at, start));
            self.beside.push(match old {
                Some(old) => Beside { node, ..old },
                None => {
                    numbers.push(number);
                    let hull = Hull::of(at);
                    seekers.push(Seeker {
                        slot: slot as u32,
                        start,
                        at: start,
                        other: Some(other),
                        hull,
                    });
                    Beside {
                        node,
                        start,
                        phi: 0.0,
                        foot: Foot::flat(start),
                        hull,
                    }
                }
            });
        }
        let seek = Seek {
            surface,
            grid: &grid,
            inside: &self.samples.inside,
        };
        seek.all(&mut seekers);
        let places: Vec<DVec3> = seekers.iter().map(|s| s.at).collect();
        let mut jets = Vec::new();
        surface.jets(&places, &mut jets);
        for ((number, seeker), jet) in numbers.into_iter().zip(&mut seekers).zip(&jets) {
            let beside = &mut self.beside[number];
            seeker.hull.add_place(&grid, seeker.at);
            beside.phi = seek.signed(seeker);
            beside.hull = seeker.hull;
            beside.foot = Foot::new(seeker.at, jet).unwrap_or(Foot::flat(seeker.at));
        }
        self.renewed = seekers.len();
    }

    /// Finds those of all other nodes, from those beside the surface that are nearest.
    fn spread(&mut self, surface: &Surface<'_>, known: Option<&Known<'_>>) {
        let grid = self.grid;
        let same = known.filter(|known| known.has_same_marks(&grid, &self.near));
        self.ways = match same {
            Some(known) => known.old.ways.clone(),
            None => nearest(&grid, |slot| self.near[slot] != NONE),
        };
        let kept = known.map(|known| Kept::new(self, known, same.is_some()));
        self.hulls = vec![Hull::of([0; 3]); grid.len()];
        let mut seekers = Vec::new();
        let mut coarse = Vec::new();
        let is_inside = |slot: usize| self.samples.inside[slot];
        for (slot, at) in grid.nodes().enumerate() {
            if self.is_coarse(at, slot) {
                coarse.push((slot, at));
                continue;
            }
            if let Some((phi, hull)) = kept.as_ref().and_then(|kept| kept.answer(at, slot)) {
                (self.phi[slot], self.hulls[slot]) = (phi, hull);
                continue;
            }
            let p = grid.place(at);
            let mut hull = Hull::of(at);
            let (number, there) = self.walk(at, slot, p, &mut hull);
            self.hulls[slot] = hull;
            if self.near[slot] == number {
                self.phi[slot] = self.beside[number as usize].phi;
                continue;
            }
            let start = self.beside[number as usize].foot.at;
            let far = p.distance(there).min(p.distance(start));
            // A spline between nodes also follows those two further on.
            if far <= self.exact(slot) {
                seekers.push(Seeker {
                    slot: slot as u32,
                    start,
                    at: there,
                    other: None,
                    hull,
                });
            } else {
                self.phi[slot] = (if is_inside(slot) { -far } else { far }) as f32;
            }
        }
        let seek = Seek {
            surface,
            grid: &grid,
            inside: &self.samples.inside,
        };
        seek.all(&mut seekers);
        for seeker in &seekers {
            let slot = seeker.slot as usize;
            self.phi[slot] = seek.signed(seeker);
            self.hulls[slot] = seeker.hull;
        }
        self.renewed += seekers.len();
        for (slot, at) in coarse {
            self.phi[slot] = self.mean(at, slot);
        }
    }

    /// Distance up to which closest places are looked for on a node's side.
    fn exact(&self, slot: usize) -> f64 {
        let margin = MARGIN * self.grid.spacing;
        if self.samples.inside[slot] {
            2.0 * margin
        } else {
            self.band + margin
        }
    }

    /// Whether a node is so far from the surface, and between others, that the mean of those will do: those of even numbers.
    fn is_coarse(&self, at: [usize; 3], slot: usize) -> bool {
        let grid = &self.grid;
        let is_odd = |a: usize| (grid.first[a] + at[a] as i64) & 1 == 1;
        let has_both = |a: usize| at[a] > 0 && at[a] + 1 < grid.count[a];
        if !(0..3).any(is_odd) || !(0..3).all(|a| !is_odd(a) || has_both(a)) {
            return false;
        }
        let there = self.beside[self.near[self.ways[slot] as usize] as usize].node;
        let square: usize = (0..3).map(|a| at[a].abs_diff(there[a] as usize).pow(2)).sum();
        // A node beside the surface is at most one away from it.
        square as f64 > (self.exact(slot) / grid.spacing + 1.0).powi(2)
    }

    /// Mean of the nodes of even numbers round one.
    fn mean(&self, at: [usize; 3], slot: usize) -> f32 {
        let (grid, strides) = (&self.grid, self.grid.strides());
        let (mut sum, mut count, mut is_mixed) = (0.0, 0.0, false);
        let step = |a: usize| {
            if (grid.first[a] + at[a] as i64) & 1 == 1 {
                strides[a]
            } else {
                0
            }
        };
        let steps: [usize; 3] = std::array::from_fn(step);
        for corner in 0..8usize {
            let is_twice = (0..3).any(|a| steps[a] == 0 && corner >> a & 1 == 1);
            if is_twice {
                continue;
            }
            let back: usize = steps.iter().sum();
            let on: usize = (0..3).map(|a| (corner >> a & 1) * 2 * steps[a]).sum();
            let phi = self.phi[slot - back + on];
            is_mixed |= (phi < 0.0) != self.samples.inside[slot];
            sum += phi;
            count += 1.0;
        }
        if !is_mixed {
            return sum / count;
        }
        let p = grid.place(at);
        let (number, there) = self.walk(at, slot, p, &mut Hull::of(at));
        let far = p
            .distance(there)
            .min(p.distance(self.beside[number as usize].foot.at));
        (if self.samples.inside[slot] { -far } else { far }) as f32
    }

    /// The foot to begin with, and where it points to: of those that the node and its neighbours are nearest to the closest one, and from
    /// there on to closer ones round the place that it points to.
    fn walk(&self, at: [usize; 3], slot: usize, p: DVec3, hull: &mut Hull) -> (u32, DVec3) {
        let (grid, strides) = (&self.grid, self.grid.strides());
        let mut best = (f64::INFINITY, NONE);
        let try_foot = |best: &mut (f64, u32), number: u32| {
            let far = p.distance_squared(self.beside[number as usize].foot.at);
            if far < best.0 {
                *best = (far, number);
            }
        };
        let mut last = NONE;
        let mut try_way = |best: &mut (f64, u32), from: usize| {
            let number = self.near[self.ways[from] as usize];
            if number != last {
                last = number;
                hull.add(self.beside[number as usize].node.map(usize::from));
                try_foot(best, number);
            }
        };
        try_way(&mut best, slot);
        for axis in 0..3 {
            if at[axis] > 0 {
                try_way(&mut best, slot - strides[axis]);
            }
            if at[axis] + 1 < grid.count[axis] {
                try_way(&mut best, slot + strides[axis]);
            }
        }
        let point = |best: (f64, u32)| self.beside[best.1 as usize].foot.toward(p, grid.spacing);
        let mut there = point(best);
        for _ in 0..WALK {
            let Some(cell) = grid.cell(there) else {
                hull.leave();
                break;
            };
            hull.add(cell);
            hull.add(cell.map(|n| n + 1));
            let before = best.1;
            for corner in 0..8usize {
                let node = std::array::from_fn(|a| cell[a] + (corner >> (2 - a) & 1));
                let number = self.near[grid.slot(node)];
                if number != NONE {
                    try_foot(&mut best, number);
                }
            }
            if best.1 == before {
                break;
            }
            there = point(best);
        }
        (best.1, there)
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
    }
}

/// Cells of a grid that boxes of a field's own world meet.
fn changed_cells(surface: &Surface<'_>, grid: &Grid, changed: &[Aabb]) -> Marks {
    let mut marks = vec![false; grid.len()];
    for b in changed {
        let b = surface.to_world(b).widened(1e-6 * grid.spacing);
        if !meet(&b, &grid.world_box().widened(grid.spacing)) {
            continue;
        }
        let end = |p: DVec3, a: usize| {
            let cell = (p[a] / grid.spacing).floor() - grid.first[a] as f64;
            cell.clamp(0.0, (grid.count[a] - 1) as f64) as usize
        };
        let range = |a: usize| end(b.min, a)..=end(b.max, a);
        for x in range(0) {
            for y in range(1) {
                for z in range(2) {
                    marks[grid.slot([x, y, z])] = true;
                }
            }
        }
    }
    Marks::new(grid, |slot| marks[slot])
}

impl Known<'_> {
    /// What was known of a node beside the surface, if nothing of it can have changed.
    fn beside(&self, grid: &Grid, at: [usize; 3], start: DVec3) -> Option<Beside> {
        let slot = self.before.slot(self.shift, at)?;
        let number = self.old.near[slot];
        let old = self.old.beside.get(number as usize)?;
        let hull = old.hull.within(grid, self.shift.map(|n| -n))?;
        let stays = old.start == start && !self.changed.any(hull);
        stays.then(|| Beside {
            hull: moved(&old.hull, self.shift),
            ..*old
        })
    }

    /// Whether the same nodes are beside the surface.
    fn has_same_marks(&self, grid: &Grid, near: &[u32]) -> bool {
        let both = || near.iter().zip(&self.old.near);
        self.old.grid == *grid
            && !self.old.ways.is_empty()
            && both().all(|(a, b)| (*a == NONE) == (*b == NONE))
    }
}

fn moved(hull: &Hull, shift: [i64; 3]) -> Hull {
    hull.moved(shift.map(|n| -n))
}

/// Which old distances still hold.
struct Kept<'a> {
    known: &'a Known<'a>,
    grid: Grid,
    /// Nodes beside the surface that are other than before, and cells in which the field has changed.
    changed: Marks,
    /// Nodes from which another node is nearest than before.
    turned: Vec<bool>,
}

impl<'a> Kept<'a> {
    fn new(all: &Distances, known: &'a Known<'a>, has_same_ways: bool) -> Self {
        let (grid, old) = (all.grid, known.old);
        let is_still = old.grid == grid;
        let old_slot = |slot: usize| match is_still {
            true => Some(slot),
            false => known.before.slot(known.shift, grid.node(slot)),
        };
        let is_other = |slot: usize| {
            let now = all.foot_at(slot);
            match old_slot(slot) {
                Some(before) => now != old.foot_at(before),
                None => true,
            }
        };
        let cells = &known.changed;
        let changed = Marks::new(&grid, |slot| {
            let at = grid.node(slot);
            cells.any([at, at]) || is_other(slot)
        });
        let turned = |slot: usize| {
            let Some(before) = old_slot(slot) else { return true };
            let Some(way) = old.ways.get(before) else {
                return true;
            };
            old_slot(all.ways[slot] as usize) != Some(*way as usize)
        };
        let turned = match has_same_ways {
            true => vec![false; grid.len()],
            false => (0..grid.len()).map(turned).collect(),
        };
        Self {
            known,
            grid,
            changed,
            turned,
        }
    }

    /// The distance of a node, if it is as before.
    fn answer(&self, at: [usize; 3], slot: usize) -> Option<(f32, Hull)> {
        let (known, strides) = (self.known, self.grid.strides());
        let before = known.before.slot(known.shift, at)?;
        let is_still = known.old.grid == self.grid;
        if self.turned[slot] {
            return None;
        }
        for axis in 0..3 {
            let is_rim = |grid: &Grid, n: usize| n == 0 || n + 1 == grid.count[axis];
            if at[axis] > 0 && self.turned[slot - strides[axis]]
                || at[axis] + 1 < self.grid.count[axis] && self.turned[slot + strides[axis]]
            {
                return None;
            }
            // At a rim a neighbour is missing.
            let old_at = (at[axis] as i64 + known.shift[axis]) as usize;
            if !is_still && (is_rim(&self.grid, at[axis]) || is_rim(&known.old.grid, old_at)) {
                return None;
            }
        }
        let hull = known.old.hulls.get(before)?;
        let b = hull.within(&self.grid, known.shift.map(|n| -n))?;
        (!self.changed.any(b)).then(|| (known.old.phi[before], moved(hull, known.shift)))
    }
}
