//! Parts of an object cut out, and put in elsewhere.

use std::sync::Arc;

use bspline::primitives::Cuboid;
use bspline::{Csg, Field, HierarchicalSpline, Real};
use fitting::Control;
use fitting::field::FieldFitReport;
use glam::{DAffine3, DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::write::{Fineness, MARGIN, Writer};
use super::{Geometric, GeometricError, Operation, Shape, rotation_of};
use crate::limits::{Limits, Region};
use crate::mix::{Faded, Mixed};
use crate::number::{NonNegative, Point, Positive};
use crate::others::Others;

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
    /// Width about the box over which it passes into what is there; four finest knot intervals if missing.
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
    /// About the box the two pass into one another, outside of it: pasted where it was cut out, it leaves what was there before.
    ///
    /// # Errors
    /// Any [`GeometricError`].
    pub fn apply<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
        others: &Others,
        limits: &Limits,
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<T>, FieldFitReport), GeometricError> {
        let writer = Writer { field, iso, limits };
        let b = self.region.aabb().map_err(GeometricError::Shape)?;
        let (clip, _) = others.get(&self.from).map_err(GeometricError::Shape)?;
        let (map, scale) = self.map(b.center());
        let solid = Cuboid::new(b.center(), 0.5 * b.size()).map_err(GeometricError::shape)?;
        let [clip, cover] = [clip, Arc::new(solid) as Arc<dyn Field>].map(|part| carried(part, map));
        let (clip, cover) = (clip?, cover?);
        let clip = Csg::sum(vec![(scale * field.slope(), clip)], iso).map_err(GeometricError::shape)?;
        // What a cut rounds off lies a few knots beside the box.
        let margin = MARGIN * field.finest_spacing();
        let blend = self.blend.map_or(margin, |blend| blend.0);
        let weight = Faded::new(cover, -(margin + blend) / scale, -margin / scale);
        let mixed = Mixed {
            from: field,
            to: &clip,
            weight: &weight,
        };
        let mut reach = b.transformed(&map);
        reach.min -= margin + blend;
        reach.max += margin + blend;
        let within = writer.within(&reach)?;
        let fineness = Fineness {
            tolerance: self.tolerance,
            finer: self.finer,
            feature: None,
        };
        writer.written(&mixed, &within, &fineness, control)
    }

    /// From where the box lies to where it goes, and by how much that stretches.
    fn map(&self, center: DVec3) -> (DAffine3, f64) {
        let scale = self.scale.map_or(1.0, |s| s.0);
        if self.turn.is_none() && scale == 1.0 {
            let by = self.by.map_or(DVec3::ZERO, |by| by.0);
            return (DAffine3::from_translation(by), scale);
        }
        let turn = rotation_of(self.turn.map_or(DVec3::ZERO, |t| t.0));
        let matrix = DMat3::from_quat(turn) * scale;
        let to = center + self.by.map_or(DVec3::ZERO, |by| by.0);
        (
            DAffine3::from_mat3_translation(matrix, to - matrix * center),
            scale,
        )
    }
}

/// A field carried by a map; the very same where that leads nowhere.
fn carried(field: Arc<dyn Field>, map: DAffine3) -> Result<Arc<dyn Field>, GeometricError> {
    match map == DAffine3::IDENTITY {
        true => Ok(field),
        false => Ok(Arc::new(Csg::affine(field, map).map_err(GeometricError::shape)?)),
    }
}
