//! Where a stroke may act.
//!
//! What lies outside keeps its coefficients to the bit: every function whose support meets it is fixed. All tools keep to
//! that, since they come in by one door ([`Stroke::apply`](crate::session::Stroke::apply)).

use std::sync::Arc;

use bspline::hierarchical::{BRICK, BrickChange, Corrections, DenseCorrections};
use bspline::primitives::Cuboid;
use bspline::{Aabb, Csg, Field, HierarchicalSpline, Real};
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::mix::{Faded, Mixed};
use crate::number::{Point, Positive};
use crate::tool::Others;

/// A box along the axes of the world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Corner of smallest coordinates.
    pub min: Point,
    /// Corner of largest coordinates.
    pub max: Point,
}

/// Which parts of space a stroke may change; exactly one of `boxes` and `object` is given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mask {
    /// What lies in one of these boxes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub boxes: Option<Vec<Region>>,
    /// What lies inside another object.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object: Option<String>,
    /// Turns the mask round: what it names stays as it is.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub outside: bool,
    /// Way inwards from the border on which the effect grows to its whole: a world length. Hard if missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub soft: Option<Positive>,
}

/// Where a stroke may act, made ready.
#[derive(Clone, Default)]
pub struct Limits {
    /// Positive where it may: a box, or any field.
    region: Option<(Aabb, Cuboid)>,
    mask: Option<Arc<dyn Field>>,
    weight: Option<Faded>,
    /// Level that the object is shaped to.
    detail: Option<usize>,
}

impl Region {
    /// The box.
    ///
    /// # Errors
    /// A sentence, if it has no size.
    pub fn aabb(&self) -> Result<Aabb, String> {
        match self.min.0.cmplt(self.max.0).all() {
            true => Ok(Aabb::new(self.min.0, self.max.0)),
            false => Err(format!(
                "the box {:?} to {:?} has no size; min has to lie below max on every axis",
                self.min.0.to_array(),
                self.max.0.to_array()
            )),
        }
    }

    fn solid(&self) -> Result<(Aabb, Cuboid), String> {
        let b = self.aabb()?;
        let solid = Cuboid::new(b.center(), 0.5 * b.size()).map_err(|e| e.to_string())?;
        Ok((b, solid))
    }
}

impl Limits {
    /// What a region and a mask leave. `others` are the objects that the mask may name.
    ///
    /// # Errors
    /// A sentence.
    pub fn new(region: Option<&Region>, mask: Option<&Mask>, others: &Others) -> Result<Self, String> {
        let region = region.map(Region::solid).transpose()?;
        let Some(mask) = mask else {
            return Ok(Self {
                region,
                ..Self::default()
            });
        };
        let named: Arc<dyn Field> = match (&mask.boxes, &mask.object) {
            (Some(boxes), None) => {
                let solids: Result<Vec<Arc<dyn Field>>, String> = boxes
                    .iter()
                    .map(|b| Ok(Arc::new(b.solid()?.1) as Arc<dyn Field>))
                    .collect();
                let union = Csg::union(solids?);
                Arc::new(union.map_err(|_| "the mask has no box; write at least one".to_string())?)
            }
            (None, Some(name)) => others.get(name)?,
            _ => return Err("a mask is given by exactly one of boxes and object".into()),
        };
        let named = match mask.outside {
            false => named,
            true => Arc::new(Csg::complement(named, 0.0).map_err(|e| e.to_string())?),
        };
        let weight = mask.soft.map(|soft| Faded::new(named.clone(), 0.0, soft.0));
        Ok(Self {
            region,
            mask: Some(named),
            weight,
            detail: None,
        })
    }

    /// With the level of the field that the object is shaped to.
    pub fn at_detail(self, level: usize) -> Self {
        Self {
            detail: Some(level),
            ..self
        }
    }

    /// Level of the field that the object is shaped to, if it is told.
    pub fn detail(&self) -> Option<usize> {
        self.detail
    }

    /// Whether all is free.
    pub fn is_none(&self) -> bool {
        self.region.is_none() && self.mask.is_none()
    }

    /// The part of a box in the region; where they share nothing, a box beside both.
    pub fn cut(&self, b: &Aabb) -> Aabb {
        self.region.as_ref().map_or(*b, |(region, _)| Aabb {
            min: b.min.max(region.min),
            max: b.max.min(region.max),
        })
    }

    /// Whether a function with this support, a world box, may change.
    pub fn is_free(&self, support: &Aabb) -> bool {
        let region = self
            .region
            .iter()
            .all(|(_, solid)| solid.bounds(support).lo > 0.0);
        region && self.mask.iter().all(|mask| mask.bounds(support).lo > 0.0)
    }

    /// What a tool makes of `field`, where the mask fades.
    pub fn mixed<'a>(&'a self, field: &'a dyn Field, target: &'a dyn Field) -> Option<Mixed<'a>> {
        self.weight.as_ref().map(|weight| Mixed {
            from: field,
            to: target,
            weight,
        })
    }

    /// The version `new` with the coefficients of `old` wherever nothing may change, and their part of the change where the
    /// mask fades. For tools that do not write by a fit.
    ///
    /// # Panics
    /// If the two are not versions of one field.
    pub fn kept<T: Real>(
        &self,
        old: &HierarchicalSpline<T>,
        new: &HierarchicalSpline<T>,
    ) -> HierarchicalSpline<T> {
        if self.is_none() {
            return new.clone();
        }
        let mut difference = old.difference(new).expect("versions of one field");
        for change in &mut difference.bricks {
            change.new = self.kept_brick(old, change);
        }
        old.applied(&difference).expect("the old version is at hand")
    }

    fn kept_brick<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        change: &BrickChange<T>,
    ) -> Option<Arc<Corrections<T>>> {
        let value = |side: &Option<Arc<Corrections<T>>>, slot| side.as_ref().and_then(|c| c.get(slot));
        let mut kept = DenseCorrections::empty();
        for slot in 0..BRICK * BRICK * BRICK {
            let at = [slot / BRICK / BRICK, slot / BRICK % BRICK, slot % BRICK];
            let (old, new) = (value(&change.old, slot), value(&change.new, slot));
            let function = std::array::from_fn(|a| change.key.0[a] * BRICK as u32 + at[a] as u32);
            let result = match old == new {
                true => old,
                false => {
                    let (knot, support) = support(field, change.level, function);
                    match (self.is_free(&support), &self.weight) {
                        (false, _) => old,
                        (true, None) => new,
                        (true, Some(weight)) => {
                            let zero = T::zero();
                            let (from, to) = (old.unwrap_or(zero), new.unwrap_or(zero));
                            Some(from + T::from_f64(weight.value(knot)) * (to - from))
                        }
                    }
                }
            };
            if let Some(result) = result {
                kept.set(at, result);
            }
        }
        let kept = kept.pack();
        (kept.count() > 0).then(|| Arc::new(kept))
    }
}

/// World place of a function's knot, and a world box about its support in the field's own box.
pub fn support<T: Real>(field: &HierarchicalSpline<T>, level: usize, function: [u32; 3]) -> (DVec3, Aabb) {
    let lattice = field.lattice();
    let spacing = 1.0 / (1u64 << level) as f64;
    // Function `s` is centred on knot `s - 1`.
    let knot = (DVec3::from_array(function.map(f64::from)) - 1.0) * spacing;
    let extent = lattice.extent();
    let end = |reach: f64| (knot + reach * spacing).clamp(DVec3::ZERO, extent);
    let map = &lattice.world_from_lattice;
    (
        map.transform_point3(knot),
        Aabb::new(end(-2.0), end(2.0)).transformed(map),
    )
}
