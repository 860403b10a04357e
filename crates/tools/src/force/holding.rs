//! What a stroke may not move: places outside of its limits, and the constraints of the object.

use bspline::{Aabb, HierarchicalSpline, Real};
use dynamics::constraints::{Constraint, Hold, On, curve};
use dynamics::lattice::Rim;
use dynamics::matter::Matter;
use dynamics::patch::PatchError;
use dynamics::region::{Cells, Region, RegionError, RegionMask, RegionOptions};
use glam::DVec3;

use super::ForceError;
use super::row::Functions;
use super::spread::axes;
use super::target::Target;
use crate::hold::Held;
use crate::limits::Limits;

/// Knot intervals between the points of a curve: at one the surface still leaves it between them by 1 % of the drag.
const APART: f64 = 0.5;
/// Share of the functions at a place that have to be free for it to be held: near the rim of a region nothing moves.
const REACH: f64 = 0.25;
/// The same for a path to be able to move its place.
const GIVES: f64 = 0.75;
/// Numbers that constraints may take, points times unknowns.
const MOST: usize = 1 << 27;
/// Points at most.
const MOST_POINTS: usize = 2000;

/// Where a stroke may move anything, and what it must not.
#[derive(Clone, Default)]
pub struct Holding {
    /// Density of the surface.
    pub iso: f64,
    /// Constraints of the object.
    pub holds: Vec<Held>,
    /// Limits of the stroke.
    pub limits: Limits,
}

impl Holding {
    /// Whether nothing is held.
    pub fn is_none(&self) -> bool {
        self.holds.is_empty() && self.limits.is_none()
    }

    /// A region in which only what the limits allow can move. Where they allow nothing it is the whole box: what it changes
    /// is then taken back afterwards.
    pub(super) fn cut<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        cells: Cells,
        matter: Matter,
        options: &RegionOptions,
    ) -> Result<Region<T>, RegionError> {
        let whole = || Region::new(field, cells, matter.clone(), options);
        if self.is_free(field, &cells) {
            return whole();
        }
        // Functions that move have all their samples inside. The boxes about these hold the whole support.
        let cell = field.lattice().spacing(cells.level);
        let half = cell / DVec3::from_array(options.samples_per_cell);
        let free = |p: DVec3| self.limits.is_free(&Aabb::new(p - half, p + half));
        let mask = RegionMask::new(free, Rim::Fixed);
        match Region::masked(field, cells, &mask, matter.clone(), options) {
            Err(RegionError::Patch(PatchError::Mask(_))) => whole(),
            other => other,
        }
    }

    /// Whether the limits allow all of a box.
    fn is_free<T: Real>(&self, field: &HierarchicalSpline<T>, cells: &Cells) -> bool {
        let scale = 1.0 / (1u64 << cells.level) as f64;
        let corner = |ijk: [u32; 3]| DVec3::from_array(ijk.map(f64::from)) * scale;
        let end = std::array::from_fn(|a| cells.first[a] + cells.count[a]);
        let local = Aabb::new(corner(cells.first), corner(end));
        let world = local.transformed(&field.lattice().world_from_lattice);
        self.limits.is_none() || self.limits.is_free(&world)
    }

    /// Whether most of the paths that begin where the limits allow it can move the surface there.
    pub(super) fn gives_way<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        region: &Region<T>,
        targets: &[&Target],
    ) -> bool {
        let Some(mask) = region.patch().mask() else {
            return self.is_free(field, region.cells());
        };
        let functions = Functions::of(field, region);
        let is_free = |p: DVec3| self.limits.is_free(&Aabb::new(p, p));
        let starts = targets.iter().map(|t| t.path.at(0.0)).filter(|p| is_free(*p));
        let (mut all, mut moved) = (0, 0);
        for p in starts {
            all += 1;
            let weight = functions.weight(p, |i| mask.moving().binary_search(&i).is_ok());
            moved += usize::from(weight > GIVES);
        }
        10 * moved >= 9 * all
    }

    /// The constraints on a region that was cut from `field`.
    pub(super) fn on<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        region: &Region<T>,
        radius: f64,
    ) -> Result<Drawn, ForceError> {
        let functions = Functions::of(field, region);
        let moves = region.patch().mask().map(|mask| mask.moving());
        let is_free = |i: usize| moves.is_none_or(|moves| moves.binary_search(&i).is_ok());
        let (origin, axes) = (region.sample_position([0; 3]), axes(region));
        let world = |[x, y, z]: [f64; 3]| origin + x * axes[0] + y * axes[1] + z * axes[2];
        let value = |at| bspline::Field::value(field, world(at));
        let spacing = APART * field.lattice().spacing(region.cells().level).min_element();
        let mut rows = Vec::new();
        for held in &self.holds {
            let density = self.iso + held.depth.map_or(0.0, |d| d.0) * field.slope();
            let hold = |length: f64| held.spring.map_or(Hold::Hard, |k| Hold::Spring(k.0 * length));
            for line in &held.lines {
                let local: Vec<[f64; 3]> = line.iter().map(|p| region.local(p.0)).collect();
                let points = match local[..] {
                    [at] => vec![Constraint {
                        label: held.name.clone(),
                        on: On::Point { at, field: value(at) },
                        density,
                        hold: hold(radius),
                    }],
                    _ => curve(&held.name, &local, spacing, density, hold(1.0), value)
                        .map_err(PatchError::from)?,
                };
                rows.extend(points.into_iter().filter(|c| match &c.on {
                    On::Point { at, .. } => functions.weight(world(*at), is_free) > REACH,
                    On::Samples(_) => true,
                }));
            }
        }
        let unknowns = region.patch().lattice().coefficient_count();
        if rows.len() > MOST_POINTS || rows.len().saturating_mul(unknowns) > MOST {
            return Err(ForceError::tool(format!(
                "the holds near the tool come to {} points; free some, or use a larger radius",
                rows.len()
            )));
        }
        Ok(Drawn::new(rows, 0.3 * radius * field.slope()))
    }
}

/// Constraints of a region, to which springs draw the surface bit by bit.
#[derive(Clone, Debug, Default)]
pub(super) struct Drawn {
    rows: Vec<Constraint>,
    done: usize,
    steps: usize,
}

impl Drawn {
    /// By densities of at most `stride` a step.
    fn new(mut rows: Vec<Constraint>, stride: f64) -> Self {
        let mut most = 0.0_f64;
        for row in &mut rows {
            let On::Point { field, .. } = row.on else { continue };
            match row.hold {
                Hold::Hard => row.density = field,
                Hold::Spring(_) => most = most.max((row.density - field).abs()),
            }
        }
        Self {
            steps: if rows.is_empty() {
                0
            } else {
                (most / stride).ceil().max(1.0) as usize
            },
            rows,
            done: 0,
        }
    }

    /// Whether they are where they have to be.
    pub fn is_done(&self) -> bool {
        self.done == self.steps
    }

    /// The constraints of the next step; `None` if they are those of the one before.
    pub fn next(&mut self) -> Option<Vec<Constraint>> {
        if self.is_done() {
            return None;
        }
        self.done += 1;
        let share = self.done as f64 / self.steps as f64;
        let mut rows = self.rows.clone();
        for row in &mut rows {
            if let On::Point { field, .. } = row.on {
                row.density = if self.is_done() {
                    row.density
                } else {
                    field + share * (row.density - field)
                };
            }
        }
        Some(rows)
    }
}
