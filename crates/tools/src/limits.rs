//! Where a stroke may act.
//!
//! What lies outside keeps its coefficients to the bit: every function whose support meets it is fixed. All tools keep to
//! that, since they come in by one door ([`Stroke::apply`](crate::session::Stroke::apply)).

use std::sync::Arc;

use bspline::primitives::Cuboid;
use bspline::{Aabb, Csg, Field, Frame, HierarchicalSpline, Interval, Real};
use glam::{DAffine3, DVec3};
use serde::{Deserialize, Serialize};

use crate::coefficients::{changed, coefficient, support, with_functions};
use crate::formula_solid::FormulaSolid;
use crate::interior::Interior;
use crate::mix::Faded;
use crate::number::{Point, Positive};
use crate::others::Others;

/// Knot intervals below a wall at which a change begins, and at which it is whole; of a solid that has at least so many there.
const ENTERED: [f64; 2] = [2.0, 5.0];
const ROOM: f64 = 10.0;

/// A box along the axes of the world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Corner of smallest coordinates.
    pub min: Point,
    /// Corner of largest coordinates.
    pub max: Point,
}

/// Which parts of space a stroke may change; exactly one of `boxes`, `object` and `formula` is given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mask {
    /// What lies in one of these boxes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub boxes: Option<Vec<Region>>,
    /// What lies inside another object.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object: Option<String>,
    /// Where a formula of `x`, `y` and `z` is above 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub formula: Option<String>,
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
    /// What lies deep enough below the outer surface.
    interior: Option<Arc<Interior>>,
    /// Where a stroke happens on the other side too.
    mirror: Option<DAffine3>,
    /// Finest level that may change.
    finest: Option<usize>,
    /// Level that the object is shaped to.
    detail: Option<usize>,
    /// What densities off the surface may be off by, where they count.
    density: Option<f64>,
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
    /// What a region and a mask leave. `others` are the objects that the mask may name, `whole` is the
    /// box of the field.
    ///
    /// # Errors
    /// A sentence.
    pub fn new(
        region: Option<&Region>,
        mask: Option<&Mask>,
        others: &Others,
        whole: &Aabb,
    ) -> Result<Self, String> {
        let region = region.map(Region::solid).transpose()?;
        let Some(mask) = mask else {
            return Ok(Self {
                region,
                ..Self::default()
            });
        };
        let named: Arc<dyn Field> = match (&mask.boxes, &mask.object, &mask.formula) {
            (Some(boxes), None, None) => {
                let solids: Result<Vec<Arc<dyn Field>>, String> = boxes
                    .iter()
                    .map(|b| Ok(Arc::new(b.solid()?.1) as Arc<dyn Field>))
                    .collect();
                let union = Csg::union(solids?);
                Arc::new(union.map_err(|_| "the mask has no box; write at least one".to_string())?)
            }
            (None, Some(name), None) => others.get(name)?.0,
            (None, None, Some(text)) => Arc::new(FormulaSolid::new(text, whole)?),
            _ => return Err("a mask is given by exactly one of boxes, object and formula".into()),
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
            ..Self::default()
        })
    }

    /// Without what lies within `wall` of the outer surface of `field`; of a stroke on both sides of a mirror, of what
    /// lies there on either of them. The wall of a closed cavity is no outer surface.
    ///
    /// # Errors
    /// A sentence, where nothing is left.
    pub fn below<T: Real>(
        self,
        field: &HierarchicalSpline<T>,
        iso: f64,
        wall: f64,
        mirror: Option<DAffine3>,
    ) -> Result<Self, String> {
        let interior = Interior::new(field, iso, wall);
        if interior.room() <= 0.0 {
            let deepest = interior.deepest();
            return Err(format!(
                "no place of the solid lies deeper than {deepest:.4} below its outer surface, so a wall of {wall} leaves nothing to \
                 work on; make it thinner"
            ));
        }
        Ok(Self {
            interior: Some(Arc::new(interior)),
            mirror,
            ..self
        })
    }

    /// With no functions finer than those of a level.
    pub fn up_to(self, finest: usize) -> Self {
        Self {
            finest: Some(finest),
            ..self
        }
    }

    /// With the level of the field that the object is shaped to.
    pub fn at_detail(self, level: usize) -> Self {
        Self {
            detail: Some(level),
            ..self
        }
    }

    /// With what densities off the surface may be off by, of an object where they count.
    pub fn at_density(self, density: Option<f64>) -> Self {
        Self { density, ..self }
    }

    /// What densities off the surface may be off by, of an object where they count.
    pub fn density(&self) -> Option<f64> {
        self.density
    }

    /// Finest level that may change.
    pub fn finest(&self) -> Option<usize> {
        self.finest
    }

    /// Level of the field that the object is shaped to, if it is told.
    pub fn detail(&self) -> Option<usize> {
        self.detail
    }

    /// Whether all is free.
    pub fn is_none(&self) -> bool {
        self.region.is_none() && self.mask.is_none() && self.interior.is_none()
    }

    /// Whether the outer surface stays.
    pub fn is_inside(&self) -> bool {
        self.interior.is_some()
    }

    /// Whether the mask fades.
    pub fn is_soft(&self) -> bool {
        self.weight.is_some()
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
        let is_deep =
            |interior: &Arc<Interior>| self.each_side(support).all(|b| interior.bounds(&b).lo > 0.0);
        region && self.mask.iter().all(|mask| is_in(&**mask, support)) && self.interior.iter().all(is_deep)
    }

    /// The same for functions that may not be active yet: of the outer surface no bit is to change.
    pub fn may_change(&self, support: &Aabb) -> bool {
        let may = |interior: &Arc<Interior>| self.each_side(support).all(|b| interior.may_change(&b));
        self.is_free(support) && self.interior.iter().all(may)
    }

    /// A box, and where it is on the other side.
    fn each_side(&self, b: &Aabb) -> impl Iterator<Item = Aabb> {
        let other = self.mirror.map(|mirror| b.transformed(&mirror));
        std::iter::once(*b).chain(other)
    }

    /// Whether nothing in a world box may change.
    pub fn is_shut(&self, part: &Aabb) -> bool {
        let region = self.region.iter().any(|(_, solid)| solid.bounds(part).hi <= 0.0);
        region || self.mask.iter().any(|mask| is_out(&**mask, part))
    }

    /// How much of a change happens at a place, 0 to 1.
    pub fn share(&self, p: DVec3) -> f64 {
        match (&self.weight, self.is_free(&Aabb { min: p, max: p })) {
            (_, false) => 0.0,
            (Some(weight), true) => weight.value(p),
            (None, true) => 1.0,
        }
    }

    /// How much of a change happens where, 0 to 1, for tools that write by a fit on knots so far apart; `None` if all of it everywhere.
    /// Below a wall it begins where the fit is free: else the border would be that of its functions, in steps.
    pub fn weight(&self, spacing: f64) -> Option<Arc<dyn Field>> {
        let mask = self
            .weight
            .clone()
            .map(|weight| Arc::new(weight) as Arc<dyn Field>);
        let below = self.interior.clone().map(|interior| -> Arc<dyn Field> {
            let [none, full] = ENTERED.map(|n| n * spacing.min(interior.room() / ROOM));
            Arc::new(Faded::new(interior, none, full))
        });
        match (mask, below) {
            (Some(mask), Some(below)) => Some(Arc::new(
                Csg::intersection(vec![mask, below]).expect("two fields"),
            )),
            (one, other) => one.or(other),
        }
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
        let mut functions = changed(old, new).expect("versions of one field");
        functions.retain(|(level, function), value| {
            let (knot, support) = support(old, *level, *function);
            if let Some(weight) = &self.weight {
                let [from, to] =
                    [coefficient(old, *level, *function), *value].map(|c| c.unwrap_or(T::zero()));
                *value = Some(from + T::from_f64(weight.value(knot)) * (to - from));
            }
            self.may_change(&support)
        });
        with_functions(old, &functions).expect("functions of the lattice")
    }
}

/// Whether a field is above 0 in all of a box. The bounds of a scan that is placed aslant cost as much as hundreds of values: most boxes that
/// are not in have a corner that tells, and most that are need no more than their side.
fn is_in(field: &dyn Field, b: &Aabb) -> bool {
    probes(b).all(|p| field.value(p) > 0.0) && (side(field, b).lo > 0.0 || field.bounds(b).lo > 0.0)
}

/// Whether a field is above 0 nowhere in a box.
fn is_out(field: &dyn Field, b: &Aabb) -> bool {
    probes(b).all(|p| field.value(p) <= 0.0) && (side(field, b).hi <= 0.0 || field.bounds(b).hi <= 0.0)
}

/// Bounds over a box that are as tight as it takes to tell its side of 0.
fn side(field: &dyn Field, b: &Aabb) -> Interval {
    field.frame_bounds_about(&Frame::over(b, [1; 3]), [0; 3], [1; 3], 0.0)
}

/// The middle and the corners of a box.
fn probes(b: &Aabb) -> impl Iterator<Item = DVec3> {
    let ends = [b.min, b.max];
    let corner = move |n: usize| DVec3::from_array([0, 1, 2].map(|a| ends[n >> a & 1][a]));
    std::iter::once(b.center()).chain((0..8).map(corner))
}
