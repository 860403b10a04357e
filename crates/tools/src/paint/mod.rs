//! Paint: what an object is made of, and what its surface feels like, from place to place.
//!
//! Two kinds of layers, which nothing links by itself: *matter* (stiffness, mass, damping and rest length of the density springs,
//! as factors on those of the object) drives the motion; *touch* (stiffness of the surface in newtons per metre, friction) drives the
//! force that is felt. [`Paint::of_stiffness`] is the one map between them, and only where a stroke asks for it.

mod brush;
mod layer;

use std::collections::BTreeMap;

use bspline::Aabb;
use glam::DVec3;
use serde::{Deserialize, Serialize};

pub use brush::Brush;
pub(crate) use brush::distance;
pub use layer::{Layer, LayerError};

use crate::malleable::Malleable;
use crate::scene::Formula;

/// Nodes that a stroke may fill: beyond it the stroke needs a smaller box.
const MOST_NODES: u64 = 1 << 24;

/// Largest number that can be painted: a factor beyond it makes no difference that a solver could follow.
const LARGEST: f64 = 1e6;

/// Smallest factor of what must not vanish. Layers keep single-precision differences from 1, and those end at 6e-8.
const SMALLEST: f64 = 1e-6;

/// What can be painted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Substance {
    /// Factor on the stiffness of the springs, 1e-6 or above.
    Stiffness,
    /// Factor on the mass, 1e-6 or above.
    Mass,
    /// Factor on the damping, 0 or above.
    Damping,
    /// Factor on the rest lengths of the springs, 0 or above: above 1 the surface swells, below 1 it shrinks.
    RestLength,
    /// Stiffness of the surface under a fingertip, N/m, 0 or above.
    SurfaceStiffness,
    /// Coefficient of friction of the surface, 0 or above.
    Friction,
}

impl Substance {
    /// What stands where nothing was painted.
    pub fn unpainted(self) -> f64 {
        match self {
            Self::SurfaceStiffness | Self::Friction => 0.0,
            _ => 1.0,
        }
    }

    fn check(self, value: f64) -> Result<(), String> {
        let least = match self {
            Self::Stiffness | Self::Mass => SMALLEST,
            _ => 0.0,
        };
        match (least..=LARGEST).contains(&value) {
            true => Ok(()),
            false => Err(format!(
                "{} cannot be {value}; it is {least:?} or above, and at most {LARGEST:e}",
                self.name()
            )),
        }
    }

    /// Its name, as sessions write it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Stiffness => "stiffness",
            Self::Mass => "mass",
            Self::Damping => "damping",
            Self::RestLength => "rest-length",
            Self::SurfaceStiffness => "surface-stiffness",
            Self::Friction => "friction",
        }
    }
}

/// The layers of an object; those not painted are missing.
pub type Layers = BTreeMap<Substance, Layer>;

/// A stroke of paint: a layer, and exactly one source of its values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Paint {
    /// What is painted.
    pub layer: Substance,
    /// A brush along a path.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub brush: Option<Brush>,
    /// A formula of `x`, `y`, `z` and the density `d`, at every node of the stroke's box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub formula: Option<String>,
    /// Values at densities, in ascending order, linear between and constant beyond: a calibration, such as the stiffness of
    /// tissue against Hounsfield units. At every node of the stroke's box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<Vec<[f64; 2]>>,
    /// So many of the layer's units for each unit of the painted stiffness, at every node of the stroke's box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of_stiffness: Option<f64>,
}

/// Where painted values come from.
enum Source<'a> {
    Brush(&'a Brush),
    Formula(Formula),
    Curve(&'a [[f64; 2]]),
    Stiffness(f64),
}

/// Why a stroke of paint cannot be laid on.
#[derive(Debug, thiserror::Error)]
pub enum PaintError {
    /// A value of the stroke makes no sense.
    #[error("{0}")]
    Stroke(String),
    /// The stroke lies beside the object.
    #[error("the brush does not reach the object's box, {0:?} to {1:?}; move it, or choose another object")]
    Outside([f64; 3], [f64; 3]),
    /// The box is too large.
    #[error("{0} places would be painted, and {MOST_NODES} may be; give the stroke a smaller box (within)")]
    TooMany(u64),
    /// The layer cannot hold it.
    #[error(transparent)]
    Layer(#[from] LayerError),
}

impl Paint {
    /// The layer with the stroke laid on. `field` is the object's, `layers` what was painted before, `within` where it may act;
    /// the nodes of a new layer are the knots of level `detail`.
    ///
    /// # Errors
    /// Any [`PaintError`].
    pub fn apply<F: Malleable>(
        &self,
        field: &F,
        layers: &Layers,
        detail: usize,
        within: &Aabb,
    ) -> Result<Layer, PaintError> {
        let wrong = |why: String| PaintError::Stroke(format!("paint: {why}"));
        let old = layers.get(&self.layer).cloned();
        let old = old.unwrap_or_else(|| Layer::empty(&field.grids(), detail));
        let whole = field.whole();
        let source = self.source().map_err(wrong)?;
        let reach = match &source {
            Source::Brush(brush) => brush.reach().map_err(wrong)?,
            _ => whole,
        };
        let cut = |a: &Aabb, b: &Aabb| Aabb {
            min: a.min.max(b.min),
            max: a.max.min(b.max),
        };
        let reach = cut(&cut(&reach, &whole), within);
        if reach.min.cmpgt(reach.max).any() {
            return Err(PaintError::Outside(whole.min.to_array(), whole.max.to_array()));
        }
        let count = old.nodes_in(&reach);
        if count > MOST_NODES {
            return Err(PaintError::TooMany(count));
        }
        let substance = self.layer;
        let unpainted = substance.unpainted();
        let number = |value: f64| substance.check(value).map(|()| value - unpainted).map_err(wrong);
        match source {
            Source::Brush(brush) => {
                let full = number(brush.value.0)?;
                old.painted(&reach, |p, old| {
                    let weight = brush.weight(p);
                    Ok((weight > 0.0).then_some(old + weight * (full - old)))
                })
            }
            Source::Formula(formula) => old.painted(&reach, |p, _| {
                number(formula.at(p, field.value(p)).map_err(wrong)?).map(Some)
            }),
            Source::Curve(points) => {
                old.painted(&reach, |p, _| number(on_curve(points, field.value(p))).map(Some))
            }
            Source::Stiffness(scale) => {
                let stiffness = layers.get(&Substance::Stiffness);
                old.painted(&reach, |p, _| {
                    number(scale * (1.0 + stiffness.map_or(0.0, |layer| layer.at(p)))).map(Some)
                })
            }
        }
    }

    fn source(&self) -> Result<Source<'_>, String> {
        match (&self.brush, &self.formula, &self.curve, self.of_stiffness) {
            (Some(brush), None, None, None) => Ok(Source::Brush(brush)),
            (None, Some(text), None, None) => Formula::parse(text).map(Source::Formula),
            (None, None, Some(points), None) => check_curve(points).map(|()| Source::Curve(points)),
            (None, None, None, Some(scale)) if self.layer != Substance::Stiffness => {
                Ok(Source::Stiffness(scale))
            }
            (None, None, None, Some(_)) => {
                Err("stiffness cannot come from itself; name another layer".into())
            }
            _ => Err("give exactly one of brush, formula, curve and of-stiffness".into()),
        }
    }
}

/// What an object is made of at places: painted values of a substance, or what stands where nothing was painted.
pub fn values(layers: &Layers, substance: Substance, places: &[DVec3]) -> Option<Vec<f64>> {
    let painted = layers.get(&substance)?.values(places);
    Some(painted.into_iter().map(|v| substance.unpainted() + v).collect())
}

fn check_curve(points: &[[f64; 2]]) -> Result<(), String> {
    let ascending = points.is_sorted_by(|a, b| a[0] < b[0]);
    if points.is_empty() || !ascending || points.iter().flatten().any(|v| !v.is_finite()) {
        return Err(format!(
            "the curve {points:?} is none; give pairs of a density and a value, densities ascending"
        ));
    }
    Ok(())
}

fn on_curve(points: &[[f64; 2]], density: f64) -> f64 {
    let after = points.partition_point(|[d, _]| *d <= density);
    match (
        after.checked_sub(1).map(|i| points[i]),
        points.get(after).copied(),
    ) {
        (Some([d0, v0]), Some([d1, v1])) => v0 + (v1 - v0) * (density - d0) / (d1 - d0),
        (Some([_, value]), None) | (None, Some([_, value])) => value,
        (None, None) => unreachable!("a curve has points"),
    }
}

#[cfg(test)]
mod tests;
