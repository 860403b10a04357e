use std::sync::Arc;

use bspline::{Aabb, Field, HierarchicalSpline, Interval, Jet, Real};
use fitting::Control;
use glam::{DMat3, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use super::area::Flat;
use super::crumbs::grown;
use super::toward::{STAGE, Toward};
use super::{ForceError, Holding, How};
use crate::curve::Along;
use crate::number::{Point, Positive};
use crate::paint::Layers;
use crate::slope::slope;

/// Radii across an outline at least: what is narrower does not keep its section.
const ACROSS: f64 = 4.0;

/// Draws the surface within an outline out along a vector; what is drawn keeps the outline as its section.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Extrude {
    /// Outline of the area, seen along `by`: a closed curve on the surface or near it.
    pub area: Along,
    /// Direction and length.
    pub by: Point,
    /// Standard deviation of the spread of its force, a world length; edges are rounded by about it.
    pub radius: Positive,
    /// How it works.
    #[serde(default)]
    pub how: How,
}

impl Extrude {
    /// What it leaves of a field whose surface lies at `iso`, and what is left to say of it, in sentences.
    ///
    /// # Errors
    /// Any [`ForceError`].
    pub fn apply<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
        layers: &Layers,
        holding: &Holding,
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<T>, Vec<String>), ForceError> {
        let radius = self.radius.0;
        let mut line = self
            .area
            .line(&field.lattice().world_box())
            .map_err(ForceError::Tool)?;
        for p in &line {
            super::track::within(field, *p)?;
            super::track::within(field, *p + self.by.0)?;
        }
        let length = self.by.0.length();
        let way = self.by.0.try_normalize().ok_or_else(|| {
            ForceError::tool("by has no length; write the direction and how far the area is to go")
        })?;
        let zone = Aabb::about(line.iter().flat_map(|p| [*p, *p + self.by.0]));
        let zone = zone.expect("a curve has a place").widened(2.0 * STAGE * radius);
        // Seen along the way.
        let middle = line.iter().sum::<DVec3>() / line.len() as f64;
        for p in &mut line {
            *p -= (*p - middle).dot(way) * way;
        }
        let outline = Flat::new(&line)?;
        let [low, high] = outline.bounds();
        if (high - low).min_element() < ACROSS * radius {
            return Err(ForceError::tool(format!(
                "the outline is {} wide and the radius {radius}; a section that is to keep takes {ACROSS} radii across at least",
                (high - low).min_element()
            )));
        }
        let field_now: Arc<HierarchicalSpline<T>> = Arc::new(field.clone());
        let stages = (length / (STAGE * radius)).ceil().max(1.0);
        if stages > 1000.0 {
            return Err(ForceError::tool(format!(
                "by is {length} long, {stages} stages of {STAGE} radii; make it shorter or the radius larger"
            )));
        }
        let toward = Toward {
            field,
            iso,
            layers,
            holding,
            radius,
            how: &self.how,
        };
        let pillar = |share: f64| {
            Ok(Box::new(Pillar {
                field: field_now.clone(),
                iso,
                slope: field.slope(),
                outline: &outline,
                way,
                length: share * length,
                step: STAGE * radius,
            }) as Box<dyn Field>)
        };
        let (drawn, _) = toward.driven(stages as usize, &zone, pillar, control)?;
        // The forces that hold the surface beside it thin the matter of scans below.
        let drawn = grown(field, drawn, iso, &holding.limits, control)?;
        Ok((drawn, Vec::new()))
    }
}

/// A solid with the part of it within an outline drawn out.
struct Pillar<'a, T> {
    field: Arc<HierarchicalSpline<T>>,
    iso: f64,
    slope: f64,
    outline: &'a Flat,
    way: DVec3,
    length: f64,
    /// The solid is as thick as this at least where it is drawn out.
    step: f64,
}

impl<T: Real> Pillar<'_, T> {
    /// Distances by which the solid was shifted.
    fn shifts(&self) -> impl Iterator<Item = f64> + '_ {
        let count = (self.length / self.step).ceil().max(1.0) as usize;
        (0..=count).map(move |i| self.length * i as f64 / count as f64)
    }

    /// Distance from the wall, positive inside, and where it rises.
    fn wall(&self, p: DVec3) -> f64 {
        let flat: DVec2 = self.outline.flat(p);
        let (is_in, near) = self.outline.place(flat);
        if is_in { near } else { -near }
    }
}

impl<T: Real> Field for Pillar<'_, T> {
    fn value(&self, p: DVec3) -> f64 {
        let wall = self.iso + self.slope * self.wall(p);
        let own = self.field.value(p);
        let most = self.shifts().skip(1).map(|s| self.field.value(p - s * self.way));
        own.max(wall.min(most.fold(own, f64::max)))
    }

    /// By central differences: near edges of the pillar about their mean.
    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        (self.value(p), slope(0.05 * self.step, p, |p| self.value(p)))
    }

    fn jet(&self, p: DVec3) -> Jet {
        let (value, gradient) = self.value_gradient(p);
        Jet {
            value,
            gradient,
            hessian: DMat3::ZERO,
        }
    }

    fn bounds(&self, b: &Aabb) -> Interval {
        let wall = Interval::point(self.iso + self.slope * self.wall(b.center()));
        let wall = wall.widened(0.5 * self.slope * b.size().length());
        let own = self.field.bounds(b);
        let shifted = self.shifts().map(|s| {
            let by = s * self.way;
            self.field.bounds(&Aabb::new(b.min - by, b.max - by))
        });
        let most = shifted.fold(own, |a, b| Interval::new(a.lo.max(b.lo), a.hi.max(b.hi)));
        let drawn = Interval::new(wall.lo.min(most.lo), wall.hi.min(most.hi));
        Interval::new(own.lo.max(drawn.lo), own.hi.max(drawn.hi))
    }
}
