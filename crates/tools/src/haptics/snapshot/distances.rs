//! Distances at the nodes of a grid, from the closest places of the surface.

use bspline::Jet;
use glam::DVec3;

use super::foot::{Foot, creased};
use super::grid::Grid;
use super::nearest::{NONE, nearest};
use super::surface::Surface;

/// Nodes along the edge of a block that is asked for at once.
const BLOCK: i64 = 8;
/// Newton steps of a place before it is taken for one at an edge.
const ROUNDS: usize = 8;
/// Step, in node distances, after which a closest place is found: what is left is of the order of its square.
const SETTLED: f64 = 0.02;
/// Closest places of neighbours that are tried, one after the other, each nearer than the one before.
const WALK: usize = 6;

/// What is known of a field round a tool.
#[derive(Clone, Debug)]
pub struct Distances {
    /// The nodes.
    pub grid: Grid,
    /// Up to here distances are exact, mm; beyond, no less than this.
    pub band: f64,
    /// `f − c`; no number where a whole block lies on one side.
    values: Vec<f64>,
    inside: Vec<bool>,
    /// Number of a node's own foot, of nodes beside the surface.
    near: Vec<u32>,
    feet: Vec<Foot>,
    /// Signed distance, mm, positive in the air.
    pub phi: Vec<f32>,
}

/// Halvings of a way between neighbours.
const HALVES: usize = 24;

/// A node on the way to its closest place.
#[derive(Clone, Copy)]
struct Seeker {
    slot: u32,
    /// A place of the surface, near enough.
    start: DVec3,
    at: DVec3,
    /// The neighbour on the other side, of nodes beside the surface.
    other: Option<DVec3>,
}

impl Distances {
    /// Of a surface at the nodes of a grid, exact up to `band`.
    pub fn new(surface: &Surface<'_>, grid: Grid, band: f64) -> Self {
        let mut all = Self {
            grid,
            band,
            values: vec![f64::NAN; grid.len()],
            inside: vec![false; grid.len()],
            near: vec![NONE; grid.len()],
            feet: Vec::new(),
            phi: vec![0.0; grid.len()],
        };
        all.sample(surface);
        all.step_out(surface);
        all.spread(surface);
        all
    }

    /// Whether no surface is in the box.
    pub fn is_empty(&self) -> bool {
        self.feet.is_empty()
    }

    /// Asks for values, block by block, where a block does not lie on one side as a whole.
    fn sample(&mut self, surface: &Surface<'_>) {
        let frame = surface.frame(&self.grid);
        let grid = self.grid;
        let last: [i64; 3] = std::array::from_fn(|a| grid.first[a] + grid.count[a] as i64);
        let blocks: [Vec<i64>; 3] = std::array::from_fn(|a| {
            let first = grid.first[a].div_euclid(BLOCK);
            (first..=(last[a] - 1).div_euclid(BLOCK)).collect()
        });
        let mut values = Vec::new();
        for &x in &blocks[0] {
            for &y in &blocks[1] {
                for &z in &blocks[2] {
                    let lo = [x, y, z].map(|b| b * BLOCK);
                    let hi = lo.map(|l| l + BLOCK);
                    let range = surface.field().frame_bounds_about(&frame, lo, hi, surface.iso());
                    let from: [i64; 3] = std::array::from_fn(|a| lo[a].max(grid.first[a]));
                    let count: [usize; 3] =
                        std::array::from_fn(|a| (hi[a].min(last[a]) - from[a]).max(0) as usize);
                    let at: [usize; 3] = std::array::from_fn(|a| (from[a] - grid.first[a]) as usize);
                    let is_crossed = range.lo <= surface.iso() && range.hi > surface.iso();
                    values.clear();
                    values.resize(count.iter().product(), f64::NAN);
                    if is_crossed {
                        surface.field().frame_values(&frame, from, count, &mut values);
                        values.iter_mut().for_each(|v| *v -= surface.iso());
                    }
                    let is_inside = range.lo > surface.iso();
                    for (row, values) in values.chunks_exact(count[2]).enumerate() {
                        let start = grid.slot([at[0] + row / count[1], at[1] + row % count[1], at[2]]);
                        let to = start..start + count[2];
                        self.values[to.clone()].copy_from_slice(values);
                        for (inside, value) in self.inside[to].iter_mut().zip(values) {
                            *inside = if is_crossed { *value > 0.0 } else { is_inside };
                        }
                    }
                }
            }
        }
    }

    /// Where the surface is met, about, on the way to the neighbour that it is nearest on, and that neighbour; none if all neighbours
    /// are on the same side.
    fn crossing(&self, at: [usize; 3]) -> Option<[DVec3; 2]> {
        let (grid, slot) = (&self.grid, self.grid.slot(at));
        let strides = grid.strides();
        let mut best: Option<(f64, usize, f64)> = None;
        for axis in 0..3 {
            for (sign, is_there) in [(-1.0, at[axis] > 0), (1.0, at[axis] + 1 < grid.count[axis])] {
                if !is_there {
                    continue;
                }
                let other = slot.wrapping_add_signed(sign as isize * strides[axis] as isize);
                if self.inside[other] == self.inside[slot] {
                    continue;
                }
                let (a, b) = (self.values[slot], self.values[other]);
                let share = a / (a - b);
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
    fn step_out(&mut self, surface: &Surface<'_>) {
        let grid = self.grid;
        let mut seekers = Vec::new();
        for slot in 0..grid.len() {
            if let Some([start, other]) = self.crossing(grid.node(slot)) {
                self.near[slot] = seekers.len() as u32;
                seekers.push(Seeker {
                    slot: slot as u32,
                    start,
                    at: start,
                    other: Some(other),
                });
            }
        }
        let seek = Seek {
            surface,
            grid: &grid,
            inside: &self.inside,
        };
        let found = seek.all(&seekers);
        for (seeker, (at, _)) in seekers.iter().zip(&found) {
            self.phi[seeker.slot as usize] = seek.signed(seeker, *at);
        }
        let places: Vec<DVec3> = found.iter().map(|(at, _)| *at).collect();
        let mut jets = Vec::new();
        surface.jets(&places, &mut jets);
        self.feet = places
            .iter()
            .zip(&jets)
            .map(|(at, jet)| Foot::new(*at, jet).unwrap_or(Foot::flat(*at)))
            .collect();
    }

    /// Finds those of all other nodes, from those beside the surface that are nearest.
    fn spread(&mut self, surface: &Surface<'_>) {
        let grid = self.grid;
        let h = grid.spacing;
        if self.feet.is_empty() {
            self.fill(surface);
            return;
        }
        let ways = nearest(&grid, |slot| self.near[slot] != NONE);
        let mut seekers = Vec::new();
        for slot in 0..grid.len() {
            let at = grid.node(slot);
            let p = grid.place(at);
            let foot = self.walk(&ways, at, slot, p);
            if self.near[slot] == foot {
                continue;
            }
            let foot = &self.feet[foot as usize];
            let seeker = Seeker {
                slot: slot as u32,
                start: foot.at,
                at: foot.toward(p, h),
                other: None,
            };
            let far = p.distance(seeker.at).min(p.distance(foot.at));
            if far <= self.band {
                seekers.push(seeker);
            } else {
                self.phi[slot] = (if self.inside[slot] { -far } else { far }) as f32;
            }
        }
        let seek = Seek {
            surface,
            grid: &grid,
            inside: &self.inside,
        };
        let found = seek.all(&seekers);
        for (seeker, (at, _)) in seekers.iter().zip(&found) {
            self.phi[seeker.slot as usize] = seek.signed(seeker, *at);
        }
    }

    /// The foot to begin with: of those that the node and its neighbours are nearest to the closest one, and from there on to closer
    /// ones round the place where it points to.
    fn walk(&self, ways: &[u32], at: [usize; 3], slot: usize, p: DVec3) -> u32 {
        let (grid, strides) = (&self.grid, self.grid.strides());
        let mut best = (f64::INFINITY, NONE);
        let try_foot = |best: &mut (f64, u32), foot: u32| {
            let far = p.distance_squared(self.feet[foot as usize].at);
            if far < best.0 {
                *best = (far, foot);
            }
        };
        try_foot(&mut best, self.near[ways[slot] as usize]);
        for axis in 0..3 {
            if at[axis] > 0 {
                try_foot(&mut best, self.near[ways[slot - strides[axis]] as usize]);
            }
            if at[axis] + 1 < grid.count[axis] {
                try_foot(&mut best, self.near[ways[slot + strides[axis]] as usize]);
            }
        }
        for _ in 0..WALK {
            let there = self.feet[best.1 as usize].toward(p, 2.0 * grid.spacing);
            let Some(cell) = grid.cell(there) else { break };
            let before = best.1;
            for corner in 0..8usize {
                let node = std::array::from_fn(|a| cell[a] + (corner >> (2 - a) & 1));
                let foot = self.near[grid.slot(node)];
                if foot != NONE {
                    try_foot(&mut best, foot);
                }
            }
            if best.1 == before {
                break;
            }
        }
        best.1
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

/// The search for closest places, many at a time.
struct Seek<'a> {
    surface: &'a Surface<'a>,
    grid: &'a Grid,
    inside: &'a [bool],
}

impl Seek<'_> {
    fn place(&self, seeker: &Seeker) -> DVec3 {
        self.grid.place(self.grid.node(seeker.slot as usize))
    }

    fn signed(&self, seeker: &Seeker, at: DVec3) -> f32 {
        let far = self.place(seeker).distance(at);
        (if self.inside[seeker.slot as usize] {
            -far
        } else {
            far
        }) as f32
    }

    /// The closest place of each, and how far from the node the field was looked at.
    fn all(&self, seekers: &[Seeker]) -> Vec<(DVec3, f64)> {
        let h = self.grid.spacing;
        let mut found: Vec<(DVec3, f64)> = seekers.iter().map(|s| (s.at, 0.0)).collect();
        let mut open: Vec<u32> = (0..seekers.len() as u32).collect();
        let (mut places, mut jets): (Vec<DVec3>, Vec<Jet>) = (Vec::new(), Vec::new());
        let mut stuck: Vec<u32> = Vec::new();
        // No answer may be farther than this: a place of the surface is known that is as near.
        let mut most: Vec<f64> = seekers
            .iter()
            .map(|s| self.place(s).distance(s.start) + 0.02 * h)
            .collect();
        for round in 0..ROUNDS {
            if open.is_empty() {
                break;
            }
            places.clear();
            places.extend(open.iter().map(|i| found[*i as usize].0));
            self.surface.jets(&places, &mut jets);
            let mut left = Vec::new();
            for (i, jet) in open.iter().zip(&jets) {
                let seeker = &seekers[*i as usize];
                let p = self.place(seeker);
                let (at, looked) = &mut found[*i as usize];
                *looked = looked.max(p.distance(*at));
                let Some(foot) = Foot::new(*at, jet) else {
                    stuck.push(*i);
                    continue;
                };
                if round == 0 && seeker.other.is_some() {
                    most[*i as usize] += foot.depth.abs();
                }
                let next = foot.toward(p, h);
                let step = next.distance(*at);
                *at = next;
                if step > SETTLED * h {
                    left.push(*i);
                    continue;
                }
                if p.distance(next) > most[*i as usize] {
                    stuck.push(*i);
                }
            }
            open = left;
        }
        stuck.extend(open);
        for i in stuck {
            let seeker = &seekers[i as usize];
            let (p, is_inside) = (self.place(seeker), self.inside[seeker.slot as usize]);
            let start = seeker
                .other
                .map_or(seeker.start, |other| self.between(p, other, is_inside));
            let (at, looked) = &mut found[i as usize];
            let (better, far) = creased(self.surface, p, is_inside, start, h);
            (*at, *looked) = (better, looked.max(far));
        }
        found
    }

    /// Where the surface lies between two neighbours, by halves.
    fn between(&self, p: DVec3, other: DVec3, is_inside: bool) -> DVec3 {
        let (mut same, mut beyond) = (0.0, 1.0);
        for _ in 0..HALVES {
            let middle = 0.5 * (same + beyond);
            let value = self.surface.value_gradient(p.lerp(other, middle)).0;
            if (value > 0.0) == is_inside {
                same = middle;
            } else {
                beyond = middle;
            }
        }
        p.lerp(other, beyond)
    }
}
