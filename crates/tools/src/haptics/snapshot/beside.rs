//! Nodes beside the surface, and the closest place of each.

use glam::DVec3;

use super::changes::Changes;
use super::crossing::{crossing, is_alike};
use super::foot::Foot;
use super::grid::Grid;
use super::hull::Hull;
use super::region::Region;
use super::samples::Samples;
use super::seek::{Seek, Seeker};
use super::surface::Surface;

/// No node.
const NONE: u32 = u32::MAX;

/// What is known of a node beside the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beside {
    /// Its number in the world.
    pub node: [i32; 3],
    /// Where the surface was met first.
    start: DVec3,
    /// Its signed distance.
    pub phi: f32,
    /// Its closest place.
    pub at: DVec3,
    /// What the field is like there, or as near to it as it was asked.
    pub foot: Foot,
    /// How far the surface leaves what `foot` says of it to second order, over the third power of the way: by the places of nodes
    /// next to this one. Not finite where none of them tells.
    pub rough: f64,
    hull: Hull,
}

/// All of them.
#[derive(Clone, Debug)]
pub struct BesideNodes {
    /// Place in the list of each node of a grid.
    near: Vec<u32>,
    list: Vec<Beside>,
    /// The closest place of each in the list: what is asked most.
    places: Vec<DVec3>,
    /// Places of the list that nothing leads to.
    free: Vec<u32>,
    /// Nodes whose neighbours may be others since the grid has moved.
    doubtful: Vec<usize>,
}

/// What an [update](BesideNodes::update) did.
#[derive(Default)]
pub struct Updated {
    /// Nodes, by their places in lists, of which something is other than it was.
    pub others: Vec<usize>,
    /// Those of them that came or went.
    pub came_or_went: Vec<usize>,
    /// Nodes whose closest place was looked for.
    pub sought: usize,
}

impl BesideNodes {
    /// None.
    pub fn new(grid: &Grid) -> Self {
        Self {
            near: vec![NONE; grid.len()],
            list: Vec::new(),
            places: Vec::new(),
            free: Vec::new(),
            doubtful: Vec::new(),
        }
    }

    /// Those that are also in another grid.
    pub fn moved(&self, old: &Grid, grid: &Grid) -> Self {
        let mut all = Self::new(grid);
        for (_, beside) in self.all(old) {
            if let Some(at) = grid.find(beside.node) {
                let was = old.find(beside.node).expect("a node of the old grid");
                if grid.is_rim(at) || old.is_rim(was) {
                    all.doubtful.push(grid.slot(at));
                }
                all.near[grid.slot(at)] = all.list.len() as u32;
                all.list.push(*beside);
                all.places.push(beside.at);
            }
        }
        all
    }

    /// Their places in lists and what is known of them.
    pub fn all(&self, grid: &Grid) -> impl Iterator<Item = (usize, &Beside)> {
        self.list.iter().enumerate().filter_map(|(number, beside)| {
            let slot = grid.slot(grid.find(beside.node)?);
            (self.near[slot] == number as u32).then_some((slot, beside))
        })
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.list.len() == self.free.len()
    }

    /// Whether a node is one, by its place in lists.
    pub fn is(&self, slot: usize) -> bool {
        self.near[slot] != NONE
    }

    /// Number of a node, if it is one.
    pub fn number(&self, slot: usize) -> Option<u32> {
        Some(self.near[slot]).filter(|number| *number != NONE)
    }

    /// Closest place of that of a number.
    pub fn place(&self, number: u32) -> DVec3 {
        self.places[number as usize]
    }

    /// What is known of that of a number.
    pub fn at(&self, number: u32) -> &Beside {
        &self.list[number as usize]
    }

    /// What is known of a node, if it is one.
    pub fn get(&self, slot: usize) -> Option<&Beside> {
        self.list.get(self.near[slot] as usize)
    }

    /// Brings them up to what the samples are now. Those in `seen` may be others than before; in it and elsewhere the closest places
    /// that the field's changes touch are looked for anew.
    pub fn update(
        &mut self,
        surface: &Surface<'_>,
        grid: &Grid,
        samples: &Samples,
        seen: Region,
        changes: &Changes,
    ) -> Updated {
        let mut done = Updated::default();
        let seen = seen.grown(1, grid);
        let mut seekers = Vec::new();
        let known: Vec<(usize, DVec3, Hull)> =
            self.all(grid).map(|(slot, b)| (slot, b.start, b.hull)).collect();
        for (slot, start, hull) in known {
            let at = grid.node(slot);
            let is_touched = changes.touch(&hull);
            if !is_touched && !seen.contains(at) {
                continue;
            }
            match crossing(grid, samples, at, slot) {
                None => {
                    self.free.push(self.near[slot]);
                    self.near[slot] = NONE;
                    done.came_or_went.push(slot);
                }
                Some(met) if is_touched || met[0] != start => seekers.push(seeker(grid, at, slot, met)),
                Some(_) => {}
            }
        }
        for (first, slots) in seen.rows(grid) {
            if is_alike(grid, samples, first, slots.clone()) {
                continue;
            }
            for (z, slot) in slots.enumerate() {
                let at = [first[0], first[1], first[2] + z];
                if self.near[slot] == NONE
                    && let Some(met) = crossing(grid, samples, at, slot)
                {
                    done.came_or_went.push(slot);
                    seekers.push(seeker(grid, at, slot, met));
                }
            }
        }
        done.sought = seekers.len();
        done.others.clone_from(&done.came_or_went);
        self.look(surface, grid, samples, seekers, &mut done);
        self.measure(grid, &mut done);
        done
    }

    /// Finds closest places.
    fn look(
        &mut self,
        surface: &Surface<'_>,
        grid: &Grid,
        samples: &Samples,
        mut seekers: Vec<Seeker>,
        done: &mut Updated,
    ) {
        let seek = Seek {
            surface,
            grid,
            inside: &samples.inside,
        };
        let mut feet = Vec::new();
        seek.all(&mut seekers, Some(&mut feet));
        for (seeker, foot) in seekers.iter().zip(feet) {
            let slot = seeker.slot as usize;
            let now = Beside {
                node: grid.number(grid.node(slot)),
                start: seeker.start,
                phi: seek.signed(seeker),
                at: seeker.at,
                foot,
                rough: f64::INFINITY,
                hull: seeker.hull,
            };
            let number = self.near[slot] as usize;
            if let Some(place) = self.places.get_mut(number) {
                *place = now.at;
            }
            match self.list.get_mut(number) {
                Some(before) => {
                    let now = Beside {
                        rough: before.rough,
                        ..now
                    };
                    if (now.phi, now.at, now.foot) != (before.phi, before.at, before.foot) {
                        done.others.push(slot);
                    }
                    *before = now;
                }
                None => match self.free.pop() {
                    Some(number) => {
                        self.list[number as usize] = now;
                        self.places[number as usize] = now.at;
                        self.near[slot] = number;
                    }
                    None => {
                        self.near[slot] = self.list.len() as u32;
                        self.list.push(now);
                        self.places.push(now.at);
                    }
                },
            }
        }
    }

    /// Measures what surfaces leave their second order by, where a place or one next to it is another.
    fn measure(&mut self, grid: &Grid, done: &mut Updated) {
        let mut slots: Vec<usize> = std::mem::take(&mut self.doubtful);
        if 4 * done.others.len() > self.list.len() {
            slots = self.all(grid).map(|(slot, _)| slot).collect();
        } else {
            for slot in &done.others {
                slots.push(*slot);
                slots.extend(grid.neighbours(grid.node(*slot), *slot));
            }
            slots.sort_unstable();
            slots.dedup();
        }
        for slot in slots {
            let Some(own) = self.get(slot) else { continue };
            let mut rough = f64::INFINITY;
            for other in grid.neighbours(grid.node(slot), slot).filter_map(|s| self.get(s)) {
                let way = own.foot.at.distance(other.at);
                // Nearer ones tell of rounding.
                if way > 0.1 * grid.spacing {
                    let off = own.foot.depth_at(other.at).abs() / (way * way * way);
                    rough = if rough.is_finite() { rough.max(off) } else { off };
                }
            }
            let own = &mut self.list[self.near[slot] as usize];
            if own.rough != rough {
                own.rough = rough;
                done.others.push(slot);
            }
        }
    }
}

fn seeker(grid: &Grid, at: [usize; 3], slot: usize, [start, other]: [DVec3; 2]) -> Seeker {
    Seeker {
        slot: slot as u32,
        start,
        at: start,
        other: Some(other),
        hull: Hull::of(grid.number(at)),
    }
}
