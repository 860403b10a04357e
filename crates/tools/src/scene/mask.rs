//! Which places of a region take part.

use std::sync::OnceLock;

use bspline::{Field, HierarchicalSpline, Real};
use dynamics::lattice::Rim;
use dynamics::matter::Matter;
use dynamics::patch::PatchError;
use dynamics::region::{Cells, Region, RegionError, RegionMask, RegionOptions};
use glam::DVec3;
use serde::Deserialize;

use super::amount::Amount;
use super::error::{SimulateError, wrong};
use super::formula::Formula;
use crate::number::Point;

const PLACE: &str = "[region.mask]";

/// What of the box takes part: what lies in one of the boxes, and where the formula is positive.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct MaskTable {
    /// All if missing.
    pub boxes: Option<Vec<BoxTable>>,
    /// Of position and density; positive inside. All if missing.
    pub inside: Option<Amount>,
    /// What the border does.
    #[serde(default)]
    pub rim: RimKind,
}

/// A box in the world.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxTable {
    /// Lower corner.
    pub min: Point,
    /// Upper corner.
    pub max: Point,
}

/// Whether what lies at the border of a mask moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RimKind {
    /// The change fades before the border.
    #[default]
    Fixed,
    /// It ends freely.
    Free,
}

impl MaskTable {
    fn formula(&self) -> Result<Option<&Formula>, SimulateError> {
        match &self.inside {
            None if self.boxes.is_none() => Err(wrong(
                PLACE,
                "says nothing; write boxes = [{ min, max }, ...], or inside = \"a formula that is positive inside\"",
            )),
            None => Ok(None),
            Some(Amount::Formula(formula)) => Ok(Some(formula)),
            Some(Amount::Constant(v)) => Err(wrong(
                format!("{PLACE} inside"),
                format!("is {v}; write a formula in quotes that is positive inside, say \"1 - x*x - y*y\""),
            )),
        }
    }

    /// Cuts out a region of which only this takes part.
    pub fn cut<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        cells: Cells,
        options: &RegionOptions,
    ) -> Result<Region<T>, SimulateError> {
        let formula = self.formula()?;
        for (i, b) in self.boxes.iter().flatten().enumerate() {
            if !b.min.0.cmplt(b.max.0).all() {
                let why = format!("min {} has to lie below max {} on every axis", b.min.0, b.max.0);
                return Err(wrong(format!("{PLACE} boxes, number {}", i + 1), why));
            }
        }
        let failed = OnceLock::new();
        let in_formula = |p: DVec3| match formula.map(|f| f.at(p, field.value(p))) {
            None => true,
            Some(Ok(value)) => value > 0.0,
            Some(Err(why)) => {
                failed.get_or_init(|| why);
                false
            }
        };
        let in_boxes = |p: DVec3| {
            let has = |b: &BoxTable| b.min.0.cmple(p).all() && p.cmple(b.max.0).all();
            self.boxes.as_ref().is_none_or(|boxes| boxes.iter().any(has))
        };
        let rim = match self.rim {
            RimKind::Fixed => Rim::Fixed,
            RimKind::Free => Rim::Free,
        };
        let mask = RegionMask::new(|p| in_boxes(p) && in_formula(p), rim);
        let region = Region::masked(field, cells, &mask, Matter::default(), options);
        drop(mask);
        if let Some(why) = failed.into_inner() {
            return Err(wrong(format!("{PLACE} inside"), why));
        }
        region.map_err(|e| match e {
            RegionError::Patch(PatchError::Mask(_)) => wrong(PLACE, e),
            other => wrong("[region]", other),
        })
    }
}
