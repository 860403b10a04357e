//! What makes snapshots, on the thread of the simulation.

use std::sync::Arc;

use bspline::hierarchical::BrickKey;
use bspline::{Aabb, Field, HierarchicalSpline};
use glam::{DAffine3, DVec3};

use super::brick::{BrickOptions, DistanceBrick};
use super::distances::Distances;
use super::field_obstacle::FieldObstacle;
use super::spline::Interpolation;
use super::state::{Part, Shape, Snapshot};
use super::surface::Surface;
use super::touch_map::TouchMap;
use crate::haptics::{PointTool, Touch};
use crate::paint::{Layers, Substance};

/// Cells of a brick of coefficients on an axis.
const BRICK: u32 = 8;
/// Share of the way to the sides of a box that a tool goes before the box follows.
const SLACK: f64 = 0.25;
/// From a tool of many points to the sides of its box, mm: as a ball of 2 mm has it.
const ROOM: f64 = 9.0;
/// Closest nodes for tools of many points, mm.
const FINEST: f64 = 0.5;
/// Nodes on an axis for such a tool, where they are not closer than that: a box that follows is made anew in two steps of a simulation.
const TOOL_NODES: f64 = 64.0;
/// Most nodes on an axis.
const MOST: f64 = 200.0;

/// What a tool asks of snapshots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// Radius of the tool, mm; of a tool of many points that of its largest ball. Points, 0, touch the field itself where they can.
    pub radius: f64,
    /// From the tool to the sides of the box, mm: what it can reach until the next snapshot, and the depth of the hand.
    pub reach: f64,
    /// Distance of nodes, mm; by radius and knots if missing.
    pub spacing: Option<f64>,
    /// Shortest knot interval of fields that do not know theirs, mm of the world.
    pub detail: f64,
    /// Nodes of an object up to which thin parts make them closer.
    pub most_nodes: usize,
    /// Between nodes.
    pub interpolation: Interpolation,
}

impl Demand {
    /// Of a ball, or of a point. As far as a hand goes at 0.2 m/s until the next of 30 snapshots a second, and 6 mm in depth.
    pub fn of_ball(radius: f64) -> Self {
        Self {
            radius,
            reach: (2.0 * radius + 13.0).max(15.0),
            spacing: None,
            detail: 0.5,
            most_nodes: 300_000,
            interpolation: Interpolation::default(),
        }
    }

    /// Of a tool of many points. The box still holds all of it, with the same room as for a ball, when the tool has gone so far that the box is to
    /// follow; distances are exact as far as the tool looks between its points.
    pub fn of_points(tool: &PointTool) -> Self {
        let reach = (tool.extent() + ROOM) / (1.0 - SLACK);
        Self {
            radius: tool.gap() + tool.nose(),
            reach,
            spacing: Some((2.0 * reach / TOOL_NODES).max(FINEST)),
            ..Self::of_ball(0.0)
        }
    }
}

/// An object of the scene.
pub struct TouchedObject<'a> {
    /// Which: the same number in every snapshot.
    pub id: u64,
    /// Its field.
    pub field: Arc<dyn Field>,
    /// Where its surface is.
    pub iso: f64,
    /// Where it stands.
    pub world_from_object: DAffine3,
    /// What is painted on it.
    pub layers: &'a Layers,
    /// What it feels like elsewhere.
    pub default: Touch,
}

/// What is kept of an object from one snapshot to the next.
struct Kept {
    id: u64,
    field: Arc<dyn Field>,
    iso: f64,
    world_from_object: DAffine3,
    layers: Layers,
    default: Touch,
    options: BrickOptions,
    center: DVec3,
    distances: Option<Distances>,
    shape: Shape,
    painted: Option<Arc<TouchMap>>,
}

/// Makes snapshots, from what changed since the last one. It keeps a handle of each, so that the haptic thread never frees one.
pub struct SnapshotMaker {
    demand: Demand,
    kept: Vec<Kept>,
    made: Vec<Arc<Snapshot>>,
    heartbeat: u64,
    renewed: usize,
}

impl SnapshotMaker {
    /// For a tool.
    pub fn new(demand: Demand) -> Self {
        Self {
            demand,
            kept: Vec::new(),
            made: Vec::new(),
            heartbeat: 0,
            renewed: 0,
        }
    }

    /// For another tool.
    pub fn demand(&mut self, demand: Demand) {
        if demand != self.demand {
            self.demand = demand;
            self.kept.clear();
        }
    }

    /// Nodes whose closest place was looked for anew in the last snapshot.
    pub fn renewed(&self) -> usize {
        self.renewed
    }

    /// The objects round a tool at `at`, in a state that is called `edit`. An object that stands elsewhere than before is another: nothing leads
    /// from the old one to the new one.
    pub fn make(&mut self, at: DVec3, objects: &[TouchedObject<'_>], edit: u64) -> Arc<Snapshot> {
        self.heartbeat += 1;
        self.renewed = 0;
        let mut kept = Vec::with_capacity(objects.len());
        let mut parts = Vec::with_capacity(objects.len());
        for object in objects {
            let old = self.kept.iter().position(|k| k.id == object.id);
            let old = old.map(|n| self.kept.swap_remove(n));
            let (now, before) = self.renew(at, object, old);
            parts.push(Part {
                object: now.id,
                shape: now.shape.clone(),
                before,
                default: now.default,
                painted: now.painted.clone(),
            });
            kept.push(now);
        }
        self.kept = kept;
        let snapshot = Arc::new(Snapshot {
            parts,
            edit,
            heartbeat: self.heartbeat,
            at,
        });
        self.made.push(snapshot.clone());
        snapshot
    }

    /// Frees the snapshots that nobody else holds any more; returns how many are left.
    pub fn free(&mut self) -> usize {
        self.made.retain(|snapshot| Arc::strong_count(snapshot) > 1);
        self.made.len()
    }

    /// An object as it is now, and the shape that it had if that was another.
    fn renew(&mut self, at: DVec3, object: &TouchedObject<'_>, old: Option<Kept>) -> (Kept, Option<Shape>) {
        let surface = Surface::new(&*object.field, object.iso).placed(object.world_from_object);
        let old =
            old.filter(|old| old.iso == object.iso && old.world_from_object == object.world_from_object);
        let Some(old) = old else {
            return (self.begin(at, object, &surface), None);
        };
        let stays = (at - old.center).abs().max_element() <= SLACK * self.demand.reach;
        let center = if stays { old.center } else { at };
        let grid = old.options.grid(center);
        let look = surface.to_field(&grid.world_box().widened(9.0 * grid.spacing));
        let changed = match Arc::ptr_eq(&old.field, &object.field) {
            true => Vec::new(),
            false => object.field.changed_boxes(&*old.field, &look),
        };
        if stays && changed.is_empty() {
            let painted = self.painted(object, &old.options, center, Some(&old));
            let now = Kept {
                layers: object.layers.clone(),
                default: object.default,
                field: object.field.clone(),
                painted,
                ..old
            };
            return (now, None);
        }
        let has_changed = !changed.is_empty();
        // A box elsewhere may need other nodes.
        let coarse = self.options(object, center);
        let options = if stays || coarse.spacing == old.options.spacing {
            old.options
        } else {
            coarse
        };
        let (distances, options) = match &old.distances {
            Some(distances) if options == old.options => {
                let found = distances.after(&surface, grid, &changed);
                self.renewed += found.renewed;
                self.finer(&surface, found, center, options)
            }
            Some(_) => self.sample(&surface, center, options),
            None => (None, options),
        };
        let shape = self.shape(object, distances.as_ref(), center, &options);
        let now = Kept {
            painted: self.painted(object, &options, center, Some(&old)),
            options,
            center,
            distances,
            shape,
            field: object.field.clone(),
            layers: object.layers.clone(),
            default: object.default,
            ..old
        };
        // A box that follows the tool shows the same surface: there is nothing to move.
        (now, has_changed.then_some(old.shape))
    }

    fn begin(&mut self, at: DVec3, object: &TouchedObject<'_>, surface: &Surface<'_>) -> Kept {
        let options = self.options(object, at);
        let is_point = self.demand.radius == 0.0 && levels(&object.field).is_some();
        let (distances, options) = match is_point {
            true => (None, options),
            false => self.sample(surface, at, options),
        };
        Kept {
            id: object.id,
            shape: self.shape(object, distances.as_ref(), at, &options),
            painted: self.painted(object, &options, at, None),
            field: object.field.clone(),
            iso: object.iso,
            world_from_object: object.world_from_object,
            layers: object.layers.clone(),
            default: object.default,
            options,
            center: at,
            distances,
        }
    }

    fn sample(
        &mut self,
        surface: &Surface<'_>,
        center: DVec3,
        options: BrickOptions,
    ) -> (Option<Distances>, BrickOptions) {
        let found = Distances::new(surface, options.grid(center), options.band);
        self.renewed += found.renewed;
        self.finer(surface, found, center, options)
    }

    /// With closer nodes where some part is too thin for those at hand, as long as they are not too many.
    fn finer(
        &mut self,
        surface: &Surface<'_>,
        mut found: Distances,
        center: DVec3,
        mut options: BrickOptions,
    ) -> (Option<Distances>, BrickOptions) {
        while found.unresolved.any() {
            let half = BrickOptions {
                spacing: 0.5 * options.spacing,
                ..options
            };
            let grid = half.grid(center);
            if grid.len() > self.demand.most_nodes {
                break;
            }
            options = half;
            found = Distances::new(surface, grid, options.band);
            self.renewed += found.renewed;
        }
        (Some(found), options)
    }

    fn shape(
        &self,
        object: &TouchedObject<'_>,
        distances: Option<&Distances>,
        center: DVec3,
        options: &BrickOptions,
    ) -> Shape {
        let levels = levels(&object.field);
        match (distances, levels) {
            (Some(distances), _) => {
                Shape::Brick(Arc::new(DistanceBrick::of(distances, options.interpolation)))
            }
            (None, Some(levels)) => {
                let surface = Surface::new(levels, object.iso).placed(object.world_from_object);
                let around = Aabb::new(center, center).widened(options.reach);
                let local = Arc::new(levels.local(&surface.to_field(&around)));
                let detail = self.detail(object, center);
                let place = object.world_from_object;
                Shape::Field(Arc::new(FieldObstacle::new(local, object.iso, place, detail)))
            }
            (None, None) => unreachable!("fields without levels are sampled"),
        }
    }

    /// What is painted, shared with what was known where that is the same.
    fn painted(
        &self,
        object: &TouchedObject<'_>,
        options: &BrickOptions,
        center: DVec3,
        old: Option<&Kept>,
    ) -> Option<Arc<TouchMap>> {
        if !TouchMap::is_needed(object.layers) {
            return None;
        }
        let is_same = |old: &Kept| {
            old.center == center
                && old.options == *options
                && old.default == object.default
                && are_same(&old.layers, object.layers)
        };
        if let Some(old) = old.filter(|old| is_same(old))
            && old.painted.is_some()
        {
            return old.painted.clone();
        }
        let back = object.world_from_object.inverse();
        let map = TouchMap::new(&options.grid(center), object.layers, &object.default, |p| {
            back.transform_point3(p)
        });
        Some(Arc::new(map))
    }

    fn options(&self, object: &TouchedObject<'_>, center: DVec3) -> BrickOptions {
        let demand = &self.demand;
        let detail = self.detail(object, center);
        let wanted = demand
            .spacing
            .unwrap_or_else(|| BrickOptions::of_tool(demand.radius, detail).spacing);
        let spacing = wanted.max(2.0 * demand.reach / MOST);
        BrickOptions {
            reach: demand.reach,
            spacing,
            band: demand.radius + 2.0 * spacing,
            interpolation: demand.interpolation,
        }
    }

    /// Shortest knot interval in the box, mm of the world.
    fn detail(&self, object: &TouchedObject<'_>, center: DVec3) -> f64 {
        let Some(levels) = levels(&object.field) else {
            return self.demand.detail;
        };
        let surface = Surface::new(levels, object.iso).placed(object.world_from_object);
        let around = Aabb::new(center, center).widened(self.demand.reach);
        let level = finest_level(levels, &surface.to_field(&around));
        let m = object.world_from_object.matrix3;
        let least = m.col(0).length().min(m.col(1).length()).min(m.col(2).length());
        levels.lattice().spacing(level).min_element() * least
    }
}

/// The field, if it has levels.
fn levels(field: &Arc<dyn Field>) -> Option<&HierarchicalSpline<f32>> {
    field.as_any()?.downcast_ref()
}

/// Whether the layers that are felt hold the same numbers.
fn are_same(a: &Layers, b: &Layers) -> bool {
    [Substance::SurfaceStiffness, Substance::Friction]
        .iter()
        .all(|s| match (a.get(s), b.get(s)) {
            (None, None) => true,
            (Some(a), Some(b)) => {
                let whole = b.tree().lattice().world_box();
                a.tree().lattice() == b.tree().lattice()
                    && b.tree().changed_boxes(a.tree(), &whole).is_empty()
            }
            _ => false,
        })
}

/// The finest level by which a field is evaluated somewhere in a box of its world.
fn finest_level(field: &HierarchicalSpline<f32>, b: &Aabb) -> usize {
    let b = b.transformed(field.lattice_from_world());
    let extent = field.lattice().extent();
    let [lo, hi] = [b.min, b.max].map(|q| q.clamp(DVec3::ZERO, extent));
    let is_there = |level: &usize| {
        let cells = field.lattice().cells_at(*level);
        let scale = (1u64 << *level) as f64;
        let key = |q: DVec3| -> [u32; 3] {
            std::array::from_fn(|a| ((q[a] * scale) as u32).min(cells[a] - 1) / BRICK)
        };
        let (first, last) = (key(lo), key(hi));
        let mut keys = (first[0]..=last[0]).flat_map(|x| {
            (first[1]..=last[1]).flat_map(move |y| (first[2]..=last[2]).map(move |z| [x, y, z]))
        });
        keys.any(|key| field.brick(*level, BrickKey(key)).is_some())
    };
    (0..field.level_count()).rev().find(is_there).unwrap_or(0)
}
