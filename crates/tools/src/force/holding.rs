//! What a stroke may not move: places outside of its limits, and the constraints of the object.

use bspline::{Aabb, Field, HierarchicalSpline, Real};
use dynamics::constraints::{Constraint, Hold, On, curve};
use dynamics::patch::PatchError;
use dynamics::region::Region;
use glam::DVec3;

use super::ForceError;
use super::path::nearest_surface;
use super::row::Functions;
use super::spread::axes;
use crate::hold::Held;
use crate::limits::Limits;

/// Knot intervals between the points of a curve: at one the surface still leaves it between them by 1 % of the drag.
const APART: f64 = 0.5;
/// Share of the functions at a place that have to be free for it to be held: near the rim of a region nothing moves.
const REACH: f64 = 0.25;
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

    /// The constraints on a region that was cut from `field`.
    pub(super) fn on<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        region: &Region<T>,
        radius: f64,
    ) -> Result<Drawn, ForceError> {
        let functions = Functions::of(field, region);
        let is_free = |p: DVec3| self.limits.is_free(&Aabb::new(p, p)) && functions.weight(p) > REACH;
        let (origin, axes) = (region.sample_position([0; 3]), axes(region));
        let world = |[x, y, z]: [f64; 3]| origin + x * axes[0] + y * axes[1] + z * axes[2];
        let value = |at| field.value(world(at));
        let spacing = APART * field.lattice().spacing(region.cells().level).min_element();
        let mut rows = Vec::new();
        for held in &self.holds {
            let hold = |length: f64| held.spring.map_or(Hold::Hard, |k| Hold::Spring(k.0 * length));
            for line in &held.lines {
                let local: Vec<[f64; 3]> = line.iter().map(|p| region.local(p.0)).collect();
                let points = match local[..] {
                    [at] => vec![Constraint {
                        label: held.name.clone(),
                        on: On::Point { at, field: value(at) },
                        density: self.iso,
                        hold: hold(radius),
                    }],
                    _ => curve(&held.name, &local, spacing, self.iso, hold(1.0), value)
                        .map_err(PatchError::from)?,
                };
                rows.extend(points.into_iter().filter_map(|mut row| {
                    let On::Point { at, field: here } = &mut row.on else {
                        return Some(row);
                    };
                    let mut place = world(*at);
                    if let Some(depth) = held.depth {
                        place = above(field, self.iso, place, depth.0, radius);
                        *at = region.local(place);
                        *here = field.value(place);
                    }
                    is_free(place).then_some(row)
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

/// Where the surface is to lie for `place` to be `depth` deep below it: out along the normal of the surface nearest to it. The density
/// that lies so deep is that of the field as it is, and not of the surface that comes.
fn above<F: Field>(field: &F, iso: f64, place: DVec3, depth: f64, reach: f64) -> DVec3 {
    let foot = nearest_surface(field, iso, place, reach).unwrap_or(place);
    place - depth * field.value_gradient(foot).1.normalize_or_zero()
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
