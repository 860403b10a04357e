//! Parts of an object cut out, and put in elsewhere.

use std::sync::Arc;

use bspline::primitives::Cuboid;
use bspline::{Aabb, Csg, Field, HierarchicalSpline, Real};
use fitting::Control;
use fitting::field::FieldFitReport;
use glam::{DAffine3, DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::write::{Fineness, MARGIN, Writer};
use super::{Geometric, GeometricError, Operation, Shape, rotation_of};
use crate::coefficients::{changed, support, with_functions};
use crate::limits::{Limits, Region};
use crate::mix::{Faded, Mixed};
use crate::number::{NonNegative, Point, Positive};
use crate::others::Others;

/// Least width over which a paste passes into what is there, in knot intervals: in a narrower one waves of the splines throw up specks of
/// solid in the empty space about what is pasted.
const PASSAGE: f64 = 1.0;

/// Keeps a copy of the object, as it is now, under another name. It shares all that does not change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Copy {
    /// Name of the copy.
    pub to: String,
}

/// Takes a box out of the object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cut {
    /// What goes.
    pub region: Region,
    /// Keeps a copy of the object as it was under this name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<String>,
    /// As for [`Geometric`].
    #[serde(default)]
    pub blend: NonNegative,
}

/// Puts a box of an object in place of what is there: its solid and the empty space about it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Paste {
    /// Name of the object.
    pub from: String,
    /// The box, where it lies in that object.
    pub region: Region,
    /// Way from there to where it goes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<Point>,
    /// How it is turned about its middle: the axis, as long as the angle in degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turn: Option<Point>,
    /// How much larger it becomes; 1 if missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<Positive>,
    /// Width about the box over which it passes into what is there; four knot intervals of the object's detail if missing, and one at least
    /// (of those that `finer` adds).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blend: Option<Positive>,
    /// As for [`Geometric`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<Positive>,
    /// As for [`Geometric`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finer: Option<u8>,
}

impl Cut {
    /// What is left of a field whose surface lies at `iso`.
    ///
    /// # Errors
    /// Any [`GeometricError`].
    pub fn apply<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
        limits: &Limits,
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<T>, FieldFitReport), GeometricError> {
        let b = self.region.aabb().map_err(GeometricError::Shape)?;
        let size = b.size().to_array().map(Positive);
        let tool = Geometric {
            shape: Shape::Box { size },
            along: vec![Point(b.center())],
            turn: Vec::new(),
            each: false,
            blend: self.blend,
            tolerance: None,
            finer: None,
        };
        tool.apply(Operation::Carve, field, iso, &Others::default(), limits, control)
    }
}

impl Paste {
    /// What it makes of a field whose surface lies at `iso`.
    ///
    /// About the box the two pass into one another, outside of it: pasted where it was cut out, it leaves what was there before, to
    /// the bit.
    ///
    /// # Errors
    /// Any [`GeometricError`].
    pub fn apply(
        &self,
        field: &HierarchicalSpline<f32>,
        iso: f64,
        others: &Others,
        limits: &Limits,
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<f32>, FieldFitReport), GeometricError> {
        let writer = Writer { field, iso, limits };
        let b = self.region.aabb().map_err(GeometricError::Shape)?;
        let (clip, _) = others.get(&self.from).map_err(GeometricError::Shape)?;
        let (map, scale) = self.map(b.center()).map_err(GeometricError::Shape)?;
        let solid = Cuboid::new(b.center(), 0.5 * b.size()).map_err(GeometricError::shape)?;
        let around = MARGIN * writer.spacing();
        let least = PASSAGE * writer.spacing() / f64::from(1u32 << self.finer.unwrap_or(0).min(31));
        let blend = self.blend.map_or(around, |blend| blend.0.max(least));
        // What a cut rounds off lies a few knots beside the box; elsewhere that would be a moat about what is pasted.
        let margin = if map == DAffine3::IDENTITY { around } else { 0.0 };
        let to = b.transformed(&map);
        let [kept, reach] = [margin, margin + blend].map(|by| Aabb::new(to.min - by, to.max + by));
        let within = writer.within(&reach)?;
        let twin = others.own(&self.from);
        let twin = twin.filter(|(_, twin_iso)| map == DAffine3::IDENTITY && *twin_iso == iso);
        let begun = match twin.and_then(|(twin, _)| copied(field, twin, &kept, &reach, limits)) {
            Some((pasted, true)) => return Ok((pasted, FieldFitReport::default())),
            Some((begun, false)) if !limits.is_soft() => begun,
            _ => field.clone(),
        };
        let [clip, cover] = [clip, Arc::new(solid) as Arc<dyn Field>].map(|part| carried(part, map));
        let (clip, cover) = (clip?, cover?);
        // Between scans densities go as they are; else the surface goes to that of the object.
        let between_scans = others
            .densities(&self.from)
            .filter(|_| limits.density().is_some());
        let (steep, level) = between_scans.unwrap_or((scale * field.slope(), iso));
        let clip = Csg::sum(vec![(steep, clip)], level).map_err(GeometricError::shape)?;
        let weight = Faded::new(cover, -(margin + blend) / scale, -margin / scale);
        let mixed = Mixed {
            from: field,
            to: &clip,
            weight: &weight,
        };
        let writer = Writer {
            field: &begun,
            ..writer
        };
        let fineness = Fineness {
            tolerance: self.tolerance,
            finer: self.finer,
            feature: None,
            densities: Some(1.0),
        };
        // A box that is turned fills little of the upright one about it: no function acts far beside it.
        let beside = (margin + blend + 3f64.sqrt() * around) / scale;
        let own = Aabb::new(b.min - beside, b.max + beside);
        let back = map.inverse();
        let is_near = |support: &Aabb| {
            let support = support.transformed(&back);
            self.turn.is_none() || support.min.cmpge(own.min).all() && support.max.cmple(own.max).all()
        };
        writer.written_where(&mixed, &within, &fineness, &is_near, control)
    }

    /// The box that is taken, and how it goes to its place.
    ///
    /// # Errors
    /// [`GeometricError::Shape`] for a box without a size, or a turn that is no angle.
    pub fn carried(&self) -> Result<(Aabb, DAffine3), GeometricError> {
        let b = self.region.aabb().map_err(GeometricError::Shape)?;
        let (map, _) = self.map(b.center()).map_err(GeometricError::Shape)?;
        Ok((b, map))
    }

    /// From where the box lies to where it goes, and by how much that stretches.
    fn map(&self, center: DVec3) -> Result<(DAffine3, f64), String> {
        let scale = self.scale.map_or(1.0, |s| s.0);
        if self.turn.is_none() && scale == 1.0 {
            let by = self.by.map_or(DVec3::ZERO, |by| by.0);
            return Ok((DAffine3::from_translation(by), scale));
        }
        let turn = rotation_of(self.turn.map_or(DVec3::ZERO, |t| t.0))?;
        let matrix = DMat3::from_quat(turn) * scale;
        let to = center + self.by.map_or(DVec3::ZERO, |by| by.0);
        Ok((
            DAffine3::from_mat3_translation(matrix, to - matrix * center),
            scale,
        ))
    }
}

/// `field` with those functions of `twin` that lie within `reach`, and whether nothing in `kept` is left to be done: whether the two
/// differ in no function that reaches from there out of `reach`. None if they are no versions of one field.
fn copied(
    field: &HierarchicalSpline<f32>,
    twin: &HierarchicalSpline<f32>,
    kept: &Aabb,
    reach: &Aabb,
    limits: &Limits,
) -> Option<(HierarchicalSpline<f32>, bool)> {
    let mut functions = changed(field, twin).ok()?;
    let mut is_all = field.slope() == twin.slope();
    functions.retain(|(level, function), _| {
        let (_, b) = support(field, *level, *function);
        let is_within = b.min.cmpge(reach.min).all() && b.max.cmple(reach.max).all();
        let is_beside = b.max.cmple(kept.min).any() || b.min.cmpge(kept.max).any();
        is_all &= is_within || is_beside;
        is_within && limits.finest().is_none_or(|finest| *level <= finest)
    });
    let pasted = with_functions(field, &functions).ok()?;
    Some((limits.kept(field, &pasted), is_all))
}

/// A field carried by a map; the very same where that leads nowhere.
fn carried(field: Arc<dyn Field>, map: DAffine3) -> Result<Arc<dyn Field>, GeometricError> {
    match map == DAffine3::IDENTITY {
        true => Ok(field),
        false => Ok(Arc::new(Csg::affine(field, map).map_err(GeometricError::shape)?)),
    }
}
