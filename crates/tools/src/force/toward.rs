//! A whole surface brought to where a goal has it, by forces, stage by stage.
//!
//! In each stage the surface of a goal is covered with places half a radius apart; the path of a place leads along the goal's
//! normal from where the surface is now to the place. Places whose surface is there already hold it, if they are near to others that move.

use std::collections::BTreeMap;

use bspline::polygonize::{Mesh, PolygonizeOptions, polygonize};
use bspline::{Aabb, Field, Frame, HierarchicalSpline, Real};
use fitting::Control;
use glam::DVec3;

use super::path::{Path, first_crossing};

use super::extent::Extent;
use super::stroke::{ADVANCE, ForceStroke};
use super::target::Target;
use super::track::{DENSITY, few};
use super::{ForceError, Holding, How, Solid};
use crate::paint::Layers;

/// Radii that a surface goes in a stage.
pub(super) const STAGE: f64 = 1.5;
/// Radii within which the surface is looked for from its place in the goal.
const NEAR: f64 = 3.0;
/// Radii by which a surface has to be off to move.
const OFF: f64 = 0.02;
/// Radii about what moves in which the rest is held.
const HELD: f64 = 3.0;
/// Share of the distance of places below which two are one.
const APART: f64 = 0.7;
/// Steps after the goals of a stage stand still, and at the last goal. Places that are held have paths too short to tell whether they have arrived.
const SETTLE: [usize; 2] = [2, 10];
/// Strokes at the last goal.
const LAST: usize = 2;

/// A field on its way to goals.
pub(super) struct Toward<'a, T> {
    pub field: &'a HierarchicalSpline<T>,
    pub iso: f64,
    pub layers: &'a Layers,
    pub holding: &'a Holding,
    pub radius: f64,
    pub how: &'a How,
}

impl<T: Real> Toward<'_, T> {
    /// The field after `stages` goals, `goal(share)` at shares of the way, in a box; and how far its surface is from the last at most, and where.
    ///
    /// # Errors
    /// Any [`ForceError`].
    pub fn driven<'g>(
        &self,
        stages: usize,
        zone: &Aabb,
        goal: impl Fn(f64) -> Result<Box<dyn Field + 'g>, ForceError>,
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<T>, Option<(f64, DVec3)>), ForceError> {
        if self.how.solid() == Solid::Elastic {
            return Err(ForceError::tool(
                "an elastic solid would spring back after every stage; leave solid out",
            ));
        }
        let mut field = self.field.clone();
        for stage in 1..stages + LAST {
            let share = stage.min(stages) as f64 / stages as f64;
            let goal = goal(share)?;
            let targets = self.targets(&field, &*goal, zone)?;
            if targets.is_empty() {
                continue;
            }
            let longest = targets.iter().map(|t| t.path.length()).fold(0.0, f64::max);
            let settle = SETTLE[usize::from(stage >= stages)];
            let most = (longest / (ADVANCE * self.radius)).ceil() as usize + settle;
            let stroke = ForceStroke::new(&field, self.iso, targets, Extent::Whole, self.radius, self.how)?;
            let mut stroke = stroke.with_room()?.painted(self.layers)?.held(self.holding)?;
            let mut steps = 0;
            while !stroke.is_over() && steps < most {
                let done = (stage - 1) as f64 + stroke.progress();
                control
                    .step("pulling", done / (stages + LAST - 1) as f64)
                    .map_err(ForceError::Cancelled)?;
                stroke.step()?;
                steps += 1;
            }
            field = stroke.release()?.0;
        }
        let goal = goal(1.0)?;
        let off = self.places(&*goal, zone)?.into_iter().filter_map(|place| {
            let now = self.surface(&field, &place)?;
            Some((now.distance(place.at), place.at))
        });
        let worst = off.reduce(|a, b| if b.0 > a.0 { b } else { a });
        Ok((field, worst))
    }

    /// How far a motion carries the surface in a box, at most.
    ///
    /// # Errors
    /// [`ForceError::Tool`] where there is no surface, or too much.
    pub fn farthest(&self, zone: &Aabb, to: impl Fn(DVec3) -> DVec3) -> Result<f64, ForceError> {
        let places = self.places(self.field, zone)?;
        let far = places.iter().map(|place| to(place.at).distance(place.at));
        far.reduce(f64::max)
            .ok_or_else(|| ForceError::tool("no surface lies in the region; move it to the surface"))
    }

    /// Paths to a goal.
    fn targets(
        &self,
        field: &HierarchicalSpline<T>,
        goal: &dyn Field,
        zone: &Aabb,
    ) -> Result<Vec<Target>, ForceError> {
        let places = self.places(goal, zone)?;
        let found = places.iter().filter_map(|place| {
            let now = self.surface(field, place)?;
            Some((place, now))
        });
        let found: Vec<(&Spot, DVec3)> = found.collect();
        let side = HELD * self.radius;
        let bin = |p: DVec3| (p / side).floor().to_array().map(|c| c as i64);
        let mut moved: BTreeMap<[i64; 3], Vec<DVec3>> = BTreeMap::new();
        for (place, now) in &found {
            if now.distance(place.at) > OFF * self.radius {
                moved.entry(bin(place.at)).or_default().push(place.at);
            }
        }
        let is_near = |p: DVec3| {
            let [x, y, z] = bin(p);
            let about = (0..27).filter_map(|n| moved.get(&[x + n / 9 - 1, y + n / 3 % 3 - 1, z + n % 3 - 1]));
            about
                .flatten()
                .any(|other| other.distance_squared(p) <= side * side)
        };
        let near = found.into_iter().filter(|(place, _)| is_near(place.at));
        near.map(|(place, now)| {
            let least = 1e-3 * self.radius;
            let (from, grows) = match now.distance(place.at) {
                off if off < least => (place.at - least * place.normal, true),
                _ => (now, (place.at - now).dot(place.normal) > 0.0),
            };
            Ok(Target {
                weight: place.area,
                ..Target::single(Path::through([from, place.at])?, grows)
            })
        })
        .collect()
    }

    /// Where the surface crosses the normal through a place, with the same side out.
    fn surface(&self, field: &HierarchicalSpline<T>, place: &Spot) -> Option<DVec3> {
        let above = |s: f64| field.value(place.at + s * place.normal) - self.iso;
        let (ahead, step) = (NEAR * self.radius, 0.125 * self.radius);
        let (s, sign) = match above(0.0) > 0.0 {
            true => (first_crossing(above, 0.0, ahead, step), 1.0),
            false => (first_crossing(|s| -above(-s), 0.0, ahead, step), -1.0),
        };
        let s = s
            .filter(|s| *s < ahead)
            .or_else(|| (above(0.0) == 0.0).then_some(0.0))?;
        Some(place.at + sign * s * place.normal)
    }

    /// Places of a surface about half a radius apart, those beside the rim of the box left out.
    fn places(&self, goal: &dyn Field, zone: &Aabb) -> Result<Vec<Spot>, ForceError> {
        let apart = self.radius / DENSITY;
        let cells = (zone.size() / apart).ceil().max(DVec3::ONE);
        few(cells.element_product() / cells.max_element() * 0.1)?;
        let options = PolygonizeOptions {
            iso: self.iso,
            open: true,
            ..Default::default()
        };
        let frame = Frame::over(zone, cells.to_array().map(|n| n as u32));
        let (mesh, _) = polygonize(goal, &frame, &options).map_err(|e| ForceError::tool(e.to_string()))?;
        let spots = thinned(&mesh, APART * apart);
        few(spots.len() as f64)?;
        let whole = self.field.lattice().extent();
        let spots = spots.into_iter().filter_map(|(at, area)| {
            let normal = (-goal.value_gradient(at).1).try_normalize()?;
            let local = self.field.lattice_from_world().transform_point3(at);
            let is_in = local.cmpgt(DVec3::ZERO).all() && local.cmplt(whole).all();
            is_in.then_some(Spot { at, normal, area })
        });
        Ok(spots.collect())
    }
}

/// A place of a goal.
struct Spot {
    at: DVec3,
    /// Out of the solid.
    normal: DVec3,
    area: f64,
}

/// Vertices of a mesh no nearer to one another than `apart`, with the area of those about them.
fn thinned(mesh: &Mesh, apart: f64) -> Vec<(DVec3, f64)> {
    let mut areas = vec![0.0; mesh.positions.len()];
    for (i, triangle) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = mesh.corners(i);
        for v in triangle {
            areas[*v as usize] += (b - a).cross(c - a).length() / 6.0;
        }
    }
    let bin = |p: DVec3| (p / apart).floor().to_array().map(|c| c as i64);
    let mut bins: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    let mut kept: Vec<(DVec3, f64)> = Vec::new();
    for (p, area) in mesh.positions.iter().zip(areas) {
        let [x, y, z] = bin(*p);
        let about = (0..27).filter_map(|n| bins.get(&[x + n / 9 - 1, y + n / 3 % 3 - 1, z + n % 3 - 1]));
        let nearest = about
            .flatten()
            .map(|i| (kept[*i].0.distance(*p), *i))
            .reduce(|a, b| if b.0 < a.0 { b } else { a });
        match nearest {
            Some((far, i)) if far < apart => kept[i].1 += area,
            _ => {
                bins.entry([x, y, z]).or_default().push(kept.len());
                kept.push((*p, area));
            }
        }
    }
    kept
}
