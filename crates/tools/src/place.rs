//! Where an object lies: the whole of it, beside its field.

use glam::{DAffine3, DMat3, DVec3};
use serde::{Deserialize, Serialize};

use crate::canvas::{Canvas, Placement};
use crate::geometric::rotation_of;
use crate::malleable::Malleable;
use crate::number::{Point, Positive};

/// Puts the whole object elsewhere, without a change of its field. Lengths and places are those of its parent's world.
///
/// In this order: it gets the parent and stays where it is; it is scaled and turned about a place; it is shifted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Object that it moves with from now on; an empty name for none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parent: Option<String>,
    /// In place of all that placed it before: the images of its axes, then of its origin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<[Point; 4]>,
    /// Factor on its size.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<Positive>,
    /// Axis of a turn, as long as its angle in degrees; anticlockwise as seen from the axis' tip.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turn: Option<Point>,
    /// What stays where it is as it is scaled and turned; the middle of the field's box if missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about: Option<Point>,
    /// Shift.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<Point>,
}

impl Place {
    /// Where a canvas lies after it.
    ///
    /// # Errors
    /// A sentence.
    pub fn apply<F: Malleable>(&self, canvas: &Canvas<F>) -> Result<Placement, String> {
        if self.parent.is_none() && self.map.is_none() && self.by.is_none() && !self.is_turning() {
            return Err("place says nothing; write one of by, turn, scale, map and parent".into());
        }
        if self.about.is_some() && !self.is_turning() {
            return Err(
                "about is what a turn or a scale leaves where it is; write one of them, or leave it out"
                    .into(),
            );
        }
        let mut after = self.hung(canvas)?;
        if let Some([x, y, z, origin]) = self.map {
            after.map = DAffine3::from_mat3_translation(DMat3::from_cols(x.0, y.0, z.0), origin.0);
        }
        if self.is_turning() {
            let middle = after.map.transform_point3(canvas.field.whole().center());
            let about = self.about.map_or(middle, |p| p.0);
            let turn = rotation_of(self.turn.map_or(DVec3::ZERO, |turn| turn.0))?;
            let turn = DMat3::from_quat(turn) * self.scale.map_or(1.0, |scale| scale.0);
            after.map = DAffine3::from_mat3_translation(turn, about - turn * about) * after.map;
        }
        after.map.translation += self.by.map_or(DVec3::ZERO, |by| by.0);
        Ok(after)
    }

    fn is_turning(&self) -> bool {
        self.scale.is_some() || self.turn.is_some()
    }

    /// The same place, with the parent that is asked for.
    fn hung<F>(&self, canvas: &Canvas<F>) -> Result<Placement, String> {
        let before = &canvas.placement;
        let shared = before.shared_from_parent * before.map;
        Ok(match self.parent.as_deref() {
            None => before.clone(),
            Some(name) if Some(name) == before.parent.as_deref() => before.clone(),
            Some("") => Placement {
                map: shared,
                ..Placement::default()
            },
            Some(name) => {
                let map = canvas.others.map(name)?.inverse();
                Placement {
                    map,
                    shared_from_parent: shared * map.inverse(),
                    parent: Some(name.into()),
                }
            }
        })
    }
}
