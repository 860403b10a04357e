//! Which cubes of the solids are drawn: as fine as there is room for, first those that are seen large.

use std::collections::{BTreeMap, BinaryHeap, HashMap};

use bytemuck::{Pod, Zeroable};
use eframe::egui_wgpu::wgpu::{self, util::DeviceExt};
use glam::{DAffine3, DVec3};

use super::Solid;
use super::atlas::{Atlas, Slot};
use super::cube::{Cube, Octant, Totals, Wish, make};
use super::eye::Record;
use crate::view::Look;

/// Bricks that come onto the card for one picture; more let a window wait.
const AT_ONCE: usize = 6000;
/// How much later than others cubes get room that are not in the picture.
const UNSEEN: f64 = 1e-3;

/// See `shaders/rays.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Node {
    octants: [u32; 8],
    brick: u32,
    low: f32,
    high: f32,
    room: u32,
}

const OWN: u32 = u32::MAX;
const OUTSIDE: u32 = u32::MAX - 1;
const INSIDE: u32 = u32::MAX - 2;

/// Numbers of cubes that are coarser than all bricks, by object, level and place.
pub type Made = HashMap<(String, i8, [u32; 3]), Totals>;

/// What the card draws.
pub struct Plan {
    /// Trees of all solids.
    pub nodes: wgpu::Buffer,
    /// The solids, the nearest first.
    pub records: wgpu::Buffer,
    /// Whether all are as fine as they are.
    pub is_whole: bool,
    /// Whether there is room for more that is not there yet.
    pub is_begun: bool,
}

/// Cubes while they are chosen.
struct Choice<'a> {
    solids: Vec<(&'a String, &'a Solid, Wish)>,
    cubes: Vec<(Cube<'a>, [Octant; 8])>,
    /// Cubes whose numbers are drawn, and those of them that are not on the card.
    drawn: usize,
    new: usize,
    is_whole: bool,
}

/// A cube that might be looked into, the largest in the picture first.
#[derive(PartialEq)]
struct Next {
    size: f64,
    cube: u32,
}

impl Eq for Next {}

impl Ord for Next {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let first = self.size.total_cmp(&other.size);
        first.then(other.cube.cmp(&self.cube))
    }
}

impl PartialOrd for Next {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl<'a> Choice<'a> {
    /// Looks into cubes until `most` are drawn, or `most_new` are new on the card.
    fn new(
        solids: Vec<(&'a String, &'a Solid, Wish)>,
        look: &Look,
        atlas: &Atlas,
        most: usize,
        most_new: usize,
    ) -> Self {
        let mut choice = Self {
            solids,
            cubes: Vec::new(),
            drawn: 0,
            new: 0,
            is_whole: true,
        };
        let mut heap = BinaryHeap::new();
        for n in 0..choice.solids.len() {
            let root = Cube::root(n, choice.solids[n].1);
            choice.add(root, look, atlas, &mut heap);
        }
        while let Some(next) = heap.pop() {
            let (cube, _) = choice.cubes[next.cube as usize];
            let (_, solid, wish) = &choice.solids[cube.solid];
            let Some(finer) = cube.finer(solid, wish) else {
                continue;
            };
            let added = finer.iter().filter(|octant| octant.is_ok()).count();
            if choice.drawn + added > most || choice.new + added > most_new {
                choice.is_whole = false;
                continue;
            }
            choice.count(&cube, atlas, false);
            let octants = finer.map(|octant| match octant {
                Ok(cube) => Octant::Cube(choice.add(cube, look, atlas, &mut heap)),
                Err(octant) => octant,
            });
            if octants.contains(&Octant::Own) {
                choice.count(&cube, atlas, true);
            }
            choice.cubes[next.cube as usize].1 = octants;
        }
        choice
    }

    fn add(&mut self, cube: Cube<'a>, look: &Look, atlas: &Atlas, heap: &mut BinaryHeap<Next>) -> u32 {
        let number = self.cubes.len() as u32;
        self.cubes.push((cube, [Octant::Own; 8]));
        self.count(&cube, atlas, true);
        heap.push(Next {
            size: size(&cube, self.solids[cube.solid].1, look),
            cube: number,
        });
        number
    }

    fn count(&mut self, cube: &Cube, atlas: &Atlas, is_drawn: bool) {
        let is_new = cube.brick.is_none_or(|brick| !atlas.has(brick.totals()));
        let by = |n: &mut usize, more: usize| *n = if is_drawn { *n + more } else { *n - more };
        by(&mut self.drawn, 1);
        by(&mut self.new, usize::from(is_new));
    }

    /// Numbers of all cubes that are drawn.
    fn totals(&self, made: &mut Made) -> Vec<Option<Totals>> {
        let place = |cube: &Cube| (self.solids[cube.solid].0.clone(), cube.level, cube.key);
        let is_drawn = |octants: &[Octant; 8]| octants.contains(&Octant::Own);
        let coarse = |(cube, octants): &&(Cube, [Octant; 8])| cube.brick.is_none() && is_drawn(octants);
        for (n, (_, solid, _)) in self.solids.iter().enumerate() {
            let of_solid = self.cubes.iter().filter(coarse).map(|(cube, _)| cube);
            let missing = of_solid.filter(|cube| cube.solid == n && !made.contains_key(&place(cube)));
            let missing: Vec<&Cube> = missing.collect();
            let places: Vec<_> = missing.iter().map(|cube| (cube.level, cube.key)).collect();
            let all = missing.iter().map(|cube| place(cube));
            made.extend(all.zip(make(&solid.field, &places)));
        }
        let all = self.cubes.iter().map(|(cube, octants)| {
            is_drawn(octants).then(|| match cube.brick {
                Some(brick) => brick.totals().clone(),
                None => made[&place(cube)].clone(),
            })
        });
        all.collect()
    }

    /// Trees as the card has them, cubes before those in them.
    fn nodes(&self, slots: &[Option<Slot>]) -> Vec<Node> {
        let mut nodes: Vec<Node> = Vec::with_capacity(self.cubes.len());
        for ((_, octants), slot) in self.cubes.iter().zip(slots) {
            let octants = octants.map(|octant| match octant {
                Octant::Own => OWN,
                Octant::Outside => OUTSIDE,
                Octant::Inside => INSIDE,
                Octant::Cube(n) => n,
            });
            let [low, high] = slot.map_or([f32::INFINITY, f32::NEG_INFINITY], |slot| slot.range);
            nodes.push(Node {
                brick: slot.map_or(OUTSIDE, |slot| slot.number),
                low: if octants.contains(&OUTSIDE) {
                    f32::NEG_INFINITY
                } else {
                    low
                },
                high: if octants.contains(&INSIDE) {
                    f32::INFINITY
                } else {
                    high
                },
                octants,
                room: 0,
            });
        }
        for n in (0..nodes.len()).rev() {
            let finer = nodes[n].octants.into_iter().filter(|octant| *octant < INSIDE);
            let ranges = finer.map(|m| [nodes[m as usize].low, nodes[m as usize].high]);
            let own = [nodes[n].low, nodes[n].high];
            let [low, high] = ranges.fold(own, |[a, b], [c, d]| [a.min(c), b.max(d)]);
            (nodes[n].low, nodes[n].high) = (low, high);
        }
        nodes
    }
}

impl Plan {
    /// What a look shows of solids whose places are told from `origin`.
    pub fn new(
        solids: &BTreeMap<String, Solid>,
        look: &Look,
        origin: DVec3,
        (atlas, made): (&mut Atlas, &mut Made),
        device: &wgpu::Device,
    ) -> Self {
        let eye = look.camera.ray(glam::DVec2::ZERO);
        let mut all: Vec<_> = solids
            .iter()
            .map(|(name, solid)| {
                let map = solid.world_from_object * solid.field.lattice().world_from_lattice;
                let middle = map.transform_point3(0.5 * solid.field.lattice().extent());
                (
                    (middle - eye.from).dot(eye.along),
                    (name, solid, Wish::new(solid, look)),
                )
            })
            .collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let all: Vec<_> = all.into_iter().map(|(_, solid)| solid).collect();
        let choose = |most_new| Choice::new(all.clone(), look, atlas, atlas.most(), most_new);
        let mut choice = choose(usize::MAX);
        let soon = choice.drawn;
        let is_begun = choice.new > AT_ONCE;
        if is_begun {
            choice = choose(AT_ONCE);
        }
        let totals = choice.totals(made);
        let drawn: Vec<&Totals> = totals.iter().flatten().collect();
        let mut slots = atlas.hold(&drawn, soon).into_iter();
        let slots: Vec<Option<Slot>> = totals
            .iter()
            .map(|t| t.as_ref().and_then(|_| slots.next()))
            .collect();
        let nodes = choice.nodes(&slots);
        let records = choice
            .solids
            .iter()
            .enumerate()
            .map(|(root, (_, solid, _))| Record::new(solid, origin, root as u32));
        let mut records: Vec<Record> = records.collect();
        let count = records.len();
        // Buffers hold something.
        records.resize(count.max(1), Record::zeroed());
        let buffer = |label, contents: &[u8]| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some(label),
                contents,
                usage: wgpu::BufferUsages::STORAGE,
            })
        };
        let nothing = [Node::zeroed()];
        let nodes = if nodes.is_empty() { &nothing[..] } else { &nodes };
        Self {
            nodes: buffer("cubes", bytemuck::cast_slice(nodes)),
            records: buffer("solids", bytemuck::cast_slice(&records)),
            is_whole: choice.is_whole,
            is_begun,
        }
    }
}

/// Edge of a cube's cells in heights of the picture; of those beside it far less.
fn size(cube: &Cube, solid: &Solid, look: &Look) -> f64 {
    let lattice = solid.field.lattice();
    let map: DAffine3 = solid.world_from_object * lattice.world_from_lattice;
    let middle = map.transform_point3(cube.corner() + 0.5 * cube.width());
    let edge = [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis].map(DVec3::length);
    let longest = edge.into_iter().fold(0.0, f64::max) * cube.width();
    let camera = &look.camera;
    let [right, _, back] = camera.axes();
    // Not nearer than its own nearest point.
    let behind = (camera.center - middle).dot(back) + camera.distance();
    let nearest = (behind - longest).max(0.05 * longest);
    let share = if camera.perspective {
        camera.distance() / nearest
    } else {
        1.0
    };
    let seen = longest * share / camera.height;
    let is_before = !camera.perspective || behind > -longest;
    let at = camera.place(middle);
    let aside = [at.x.abs() - 1.0, at.y.abs() - 0.5].map(|d| d - seen);
    let is_seen = is_before && aside.into_iter().all(|d| d < 0.0) && right.is_finite();
    if is_seen { seen } else { UNSEEN * seen }
}
