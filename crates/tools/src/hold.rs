//! Constraints of an object: points and curves that later force tools keep on the surface.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::curve::Along;
use crate::force::{Path, nearest_surface};
use crate::malleable::Malleable;
use crate::number::{Finite, Point, Positive};

/// Finest knot intervals that a surface may lie beside a place that is held where it is.
const NEAR: f64 = 0.5;
/// Share of the field's longest edge in which a sketch finds the surface.
const REACH: f64 = 0.1;
/// Points of a sketch at most, and least knot intervals between them.
const MOST: f64 = 1000.0;
const APART: f64 = 0.5;

/// Stiffest spring, over the stiffness of the solid: rounding in single precision leaves less of that beside it than steps need.
const STIFFEST: f64 = 1e6;

/// Puts a constraint on the object. Exactly one of `points`, `along` and `sketch` is given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hold {
    /// Name by which it is freed.
    pub name: String,
    /// Single places.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<Vec<Point>>,
    /// A curve in space.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub along: Option<Along>,
    /// A curve that is drawn to the nearest surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sketch: Option<Along>,
    /// How deep in the solid the places are to lie, a length; outside if negative, on the surface if missing. With `spring` only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<Finite>,
    /// Stiffness of a spring over that of the solid: of curves per length, of points per radius of the tool. Without it the density there
    /// stays as it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spring: Option<Positive>,
}

/// Takes a constraint off the object, or all.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Free {
    /// Name of one; all if missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
}

/// A constraint that an object has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Held {
    /// Its name.
    pub name: String,
    /// Its parts: single points, or polylines, of which closed ones end where they begin.
    pub lines: Vec<Vec<Point>>,
    /// How deep in the solid they are to lie.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<Finite>,
    /// Stiffness of its spring; what is held stays as it is if missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spring: Option<Positive>,
}

impl Hold {
    /// The constraint on a field whose surface lies at `iso`.
    ///
    /// # Errors
    /// A sentence.
    pub fn on<F: Malleable>(&self, field: &F, iso: f64) -> Result<Held, String> {
        if self.name.trim().is_empty() {
            return Err("a hold needs a name; free takes it off by that".into());
        }
        let whole = field.whole();
        let lines = match (&self.points, &self.along, &self.sketch) {
            (Some(points), None, None) => points.iter().map(|p| vec![p.0]).collect(),
            (None, Some(along), None) => along.lines(&whole)?,
            (None, None, Some(sketch)) => sketch
                .lines(&whole)?
                .iter()
                .map(|line| sketched(field, iso, line))
                .collect::<Result<_, _>>()?,
            _ => return Err("a hold is given by exactly one of points, along and sketch".into()),
        };
        if lines.is_empty() {
            return Err("a hold without points holds nothing; write at least one".into());
        }
        let places = || lines.iter().flatten();
        if let Some(p) = places().find(|p| !(p.cmpge(whole.min).all() && p.cmple(whole.max).all())) {
            return Err(format!(
                "hold {:?} goes through {:?}, and the field reaches from {:?} to {:?}; stay within",
                self.name,
                p.to_array(),
                whole.min.to_array(),
                whole.max.to_array()
            ));
        }
        if let Some(spring) = self.spring.filter(|spring| spring.0 > STIFFEST) {
            return Err(format!(
                "a spring of {:e} is too stiff for steps in single precision; write {STIFFEST:e} at most, or leave it out, which holds \
                 exactly what lies on the surface",
                spring.0
            ));
        }
        if self.spring.is_none() {
            if self.depth.is_some() {
                return Err("depth asks for a spring; without one the density stays as it is".into());
            }
            let far = |p: &DVec3| (field.value(*p) - iso).abs() / field.steepness();
            let near = NEAR * field.shortest();
            if let Some((p, far)) = places().map(|p| (p, far(p))).find(|(_, far)| *far > near) {
                return Err(format!(
                    "hold {:?} would keep the surface where it is, and at {:?} it is about {far:.3} away; give a spring, which draws \
                     it there, or sketch in place of along",
                    self.name,
                    p.to_array()
                ));
            }
        }
        let points = |line: Vec<DVec3>| line.into_iter().map(Point).collect();
        Ok(Held {
            name: self.name.clone(),
            lines: lines.into_iter().map(points).collect(),
            depth: self.depth,
            spring: self.spring,
        })
    }

    /// The constraints `holds` of an object and this one.
    ///
    /// # Errors
    /// A sentence.
    pub fn joined<F: Malleable>(&self, field: &F, iso: f64, holds: &[Held]) -> Result<Vec<Held>, String> {
        if holds.iter().any(|h| h.name == self.name) {
            return Err(format!(
                "there is a hold {:?} already; free it first, or take another name",
                self.name
            ));
        }
        let new = self.on(field, iso)?;
        Ok(holds.iter().cloned().chain([new]).collect())
    }
}

impl Held {
    /// The constraint with every place brought elsewhere.
    pub(crate) fn carried(&self, to: impl Fn(DVec3) -> DVec3) -> Self {
        let line = |line: &Vec<Point>| line.iter().map(|p| Point(to(p.0))).collect();
        Self {
            lines: self.lines.iter().map(line).collect(),
            ..self.clone()
        }
    }
}

impl Free {
    /// The constraints of an object without what is freed.
    ///
    /// # Errors
    /// A sentence, if there is none to free.
    pub fn left(&self, holds: &[Held]) -> Result<Vec<Held>, String> {
        let known: Vec<&str> = holds.iter().map(|h| h.name.as_str()).collect();
        match &self.name {
            _ if known.is_empty() => Err("there is no hold to free".into()),
            Some(name) if !known.contains(&name.as_str()) => Err(format!(
                "there is no hold {name:?}; there are {}",
                known.join(", ")
            )),
            Some(name) => Ok(holds.iter().filter(|h| h.name != *name).cloned().collect()),
            None => Ok(Vec::new()),
        }
    }
}

/// Points of a line, close to each other, on the nearest surface.
fn sketched<F: Malleable>(field: &F, iso: f64, line: &[DVec3]) -> Result<Vec<DVec3>, String> {
    let size = field.whole().size();
    let reach = REACH * size.max_element();
    let drawn = |p: DVec3| {
        nearest_surface(field, iso, p, reach).map_err(|_| {
            format!(
                "no surface lies within {reach:.3} of {:?}; sketch closer to it",
                p.to_array()
            )
        })
    };
    if line.iter().all(|p| *p == line[0]) {
        return Ok(vec![drawn(line[0])?]);
    }
    let path = Path::through(line.iter().copied()).map_err(|e| e.to_string())?;
    let length = path.length();
    let count = (length / (length / MOST).max(APART * field.shortest())).ceil();
    let drawn = (0..=count as usize).map(|i| drawn(path.at(length * i as f64 / count)));
    let mut drawn: Vec<DVec3> = drawn.collect::<Result<_, _>>()?;
    drawn.dedup();
    Ok(drawn)
}
