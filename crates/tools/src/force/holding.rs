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
/// Radii of the tool within which springs find the surface.
const NEAR: f64 = 2.0;
/// Radii by which a stroke draws it: from half a radius on a drop of solid, or a bubble, comes up there in its place in one case of eight.
const FARTHEST: f64 = 0.45;
/// Radii by which a step draws it.
const STRIDE: f64 = 0.3;
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
            let way = |place: DVec3| match held.spring {
                None => Some([place; 2]),
                Some(_) => self.way(field, place, held.depth.map_or(0.0, |d| d.0), radius),
            };
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
                rows.extend(points.into_iter().filter_map(|mut constraint| {
                    let On::Point { at, field: here } = constraint.on else {
                        return None;
                    };
                    if held.spring.is_none() {
                        // What is there stays.
                        constraint.density = here;
                    }
                    let way = way(world(at)).filter(|way| is_free(way[1]))?;
                    Some(Row { constraint, way })
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
        Ok(Drawn::new(rows, STRIDE * radius))
    }

    /// From the surface to where it is to lie for `place` to be `depth` deep below it: out along the normal of the surface nearest to it.
    /// Not by the density that lies so deep, which is that of the field as it is. What is farther is left for the next stroke; none where no
    /// surface is near.
    fn way<F: Field>(&self, field: &F, place: DVec3, depth: f64, radius: f64) -> Option<[DVec3; 2]> {
        let foot = nearest_surface(field, self.iso, place, NEAR * radius).ok()?;
        let normal = field.value_gradient(foot).1.normalize_or_zero();
        let way = place - depth * normal - foot;
        Some([foot, foot + way.clamp_length_max(FARTHEST * radius)])
    }
}

/// A constraint, and the way that the surface has to go.
#[derive(Clone, Debug)]
struct Row {
    constraint: Constraint,
    way: [DVec3; 2],
}

/// Constraints of a region, to which springs draw the surface bit by bit: all at once would leave a drop of solid there, or a bubble.
#[derive(Clone, Debug, Default)]
pub(super) struct Drawn {
    rows: Vec<Row>,
    done: usize,
    steps: usize,
}

impl Drawn {
    /// By at most `stride` a step.
    fn new(rows: Vec<Row>, stride: f64) -> Self {
        let longest = rows
            .iter()
            .map(|row| row.way[0].distance(row.way[1]))
            .fold(0.0, f64::max);
        Self {
            steps: if rows.is_empty() {
                0
            } else {
                (longest / stride).ceil().max(1.0) as usize
            },
            rows,
            done: 0,
        }
    }

    /// Whether they are where they have to be.
    pub fn is_done(&self) -> bool {
        self.done == self.steps
    }

    /// The constraints of the next step on the region that was cut from `field`; `None` if they are those of the one before.
    pub fn next<T: Real>(
        &mut self,
        field: &HierarchicalSpline<T>,
        region: &Region<T>,
    ) -> Option<Vec<Constraint>> {
        if self.is_done() {
            return None;
        }
        self.done += 1;
        let share = self.done as f64 / self.steps as f64;
        let rows = self.rows.iter().map(|Row { constraint, way }| {
            let place = way[0].lerp(way[1], share);
            let on = On::Point {
                at: region.local(place),
                field: field.value(place),
            };
            Constraint {
                on,
                ..constraint.clone()
            }
        });
        Some(rows.collect())
    }
}
