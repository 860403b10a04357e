//! What makes snapshots, on the thread of the simulation.

use std::sync::Arc;

use bspline::hierarchical::BrickKey;
use bspline::{Aabb, Field, HierarchicalSpline};
use glam::{DAffine3, DVec3};

use super::brick::{BrickOptions, DistanceBrick};
use super::distances::Distances;
use super::spline::Interpolation;
use super::state::{Part, Snapshot};
use super::surface::Surface;
use super::touch_map::TouchMap;
use crate::haptics::{PointTool, Touch};
use crate::paint::{Layers, Substance};

/// Cells of a brick of coefficients on an axis.
const BRICK: u32 = 8;
/// Share of the way to the sides of a box that a tool goes before the box follows.
const SLACK: f64 = 0.25;
/// From a point to the sides of its box, mm: it feels what is at itself alone, so its box is small and its nodes are close.
const POINT_REACH: f64 = 7.5;
/// From a tool of many points to the sides of its box, mm: as a ball of 2 mm has it.
const ROOM: f64 = 9.0;
/// Closest nodes for tools of many points, mm.
const FINEST: f64 = 0.5;
/// Nodes on an axis for such a tool, where they are not closer than that.
const TOOL_NODES: f64 = 100.0;

/// What a tool asks of snapshots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// Radius of the tool, mm; of a tool of many points that of its largest ball; 0 of a point.
    pub radius: f64,
    /// From the tool to the sides of the box, mm: what it can reach until the next snapshot, and the depth of the hand.
    pub reach: f64,
    /// Distance of nodes, mm; by radius and knots if missing.
    pub spacing: Option<f64>,
    /// Shortest knot interval of fields that do not know theirs, mm of the world.
    pub detail: f64,
    /// Most nodes of an object, whatever its radius, its knots and its thin parts ask for.
    pub most_nodes: usize,
    /// Between nodes.
    pub interpolation: Interpolation,
}

impl Demand {
    /// Of a ball, or of a point. As far as a hand goes at 0.2 m/s until the next of 30 snapshots a second, and 6 mm in depth of a ball.
    pub fn of_ball(radius: f64) -> Self {
        Self {
            radius,
            reach: if radius > 0.0 {
                (2.0 * radius + 13.0).max(15.0)
            } else {
                POINT_REACH
            },
            spacing: None,
            detail: 0.5,
            most_nodes: 380_000,
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
    distances: Distances,
    shape: Arc<DistanceBrick>,
    /// Distance of nodes before thin parts made them closer, and where the tool was then.
    wanted: (f64, DVec3),
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
    fn renew(
        &mut self,
        at: DVec3,
        object: &TouchedObject<'_>,
        old: Option<Kept>,
    ) -> (Kept, Option<Arc<DistanceBrick>>) {
        let surface = Surface::new(&*object.field, object.iso).placed(object.world_from_object);
        let old =
            old.filter(|old| old.iso == object.iso && old.world_from_object == object.world_from_object);
        let Some(mut old) = old else {
            return (self.begin(at, object, &surface), None);
        };
        let stays = (at - old.center).abs().max_element() <= SLACK * self.demand.reach;
        let center = if stays { old.center } else { at };
        let look = old
            .options
            .grid(center)
            .world_box()
            .widened(9.0 * old.options.spacing);
        let changed = match Arc::ptr_eq(&old.field, &object.field) {
            true => Vec::new(),
            false => object.field.changed_boxes(&*old.field, &surface.to_field(&look)),
        };
        let has_changed = !changed.is_empty();
        if !stays || has_changed {
            // A box elsewhere may need other nodes. Closer ones for a thin part stay until the tool has left it.
            if !stays {
                let coarse = self.options(object, center);
                let (spacing, place) = old.wanted;
                let is_near = (center - place).abs().max_element() <= self.demand.reach;
                if coarse.spacing != spacing || old.options.spacing != spacing && !is_near {
                    let begun = self.begin(at, object, &surface);
                    return (begun, has_changed.then_some(old.shape));
                }
            }
            old.distances.renew(&surface, old.options.grid(center), &changed);
            self.renewed += old.distances.renewed;
            self.finer(&surface, &mut old.distances, center, &mut old.options);
        }
        let before = old.shape.clone();
        if !stays || has_changed {
            old.shape = Arc::new(DistanceBrick::of(
                &old.distances,
                old.options.interpolation,
                Some(&before),
            ));
        }
        let now = Kept {
            painted: self.painted(object, &old.options, center, Some(&old)),
            center,
            field: object.field.clone(),
            layers: object.layers.clone(),
            default: object.default,
            ..old
        };
        // A box that follows the tool shows the same surface: there is nothing to move.
        (now, has_changed.then_some(before))
    }

    fn begin(&mut self, at: DVec3, object: &TouchedObject<'_>, surface: &Surface<'_>) -> Kept {
        let mut options = self.options(object, at);
        let wanted = (options.spacing, at);
        let mut distances = Distances::new(surface, options.grid(at), options.band);
        self.renewed += distances.renewed;
        self.finer(surface, &mut distances, at, &mut options);
        Kept {
            id: object.id,
            shape: Arc::new(DistanceBrick::of(&distances, options.interpolation, None)),
            painted: self.painted(object, &options, at, None),
            field: object.field.clone(),
            iso: object.iso,
            world_from_object: object.world_from_object,
            layers: object.layers.clone(),
            default: object.default,
            options,
            center: at,
            distances,
            wanted,
        }
    }

    /// Takes closer nodes where some part is too thin for those at hand, as long as they are not too many.
    fn finer(
        &mut self,
        surface: &Surface<'_>,
        found: &mut Distances,
        center: DVec3,
        options: &mut BrickOptions,
    ) {
        while found.unresolved.any() {
            let half = BrickOptions {
                spacing: 0.5 * options.spacing,
                ..*options
            };
            if half.most_nodes() > self.demand.most_nodes {
                break;
            }
            *options = half;
            *found = Distances::new(surface, half.grid(center), half.band);
            self.renewed += found.renewed;
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
            let map = old.painted.as_ref();
            map.is_some_and(|map| *map.grid() == options.grid(center))
                && old.default == object.default
                && are_same(&old.layers, object.layers)
        };
        if let Some(old) = old.filter(|old| is_same(old)) {
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
        let of = |spacing: f64| BrickOptions {
            reach: demand.reach,
            spacing,
            band: demand.radius + 2.0 * spacing,
            interpolation: demand.interpolation,
        };
        let mut options = of(wanted);
        while options.most_nodes() > demand.most_nodes {
            options = of(1.0625 * options.spacing);
        }
        options
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
