//! How the result of a tool becomes coefficients.

use bspline::hierarchical::{Lattice, MAX_LEVELS};
use bspline::{Aabb, Field, HierarchicalSpline, Real};
use fitting::Control;
use fitting::field::{Aim, FieldFitOptions, FieldFitReport, fit_field_where};

use super::GeometricError;
use crate::face::Face;
use crate::limits::Limits;
use crate::mix::Mixed;
use crate::number::Positive;

/// Tolerance over the finest knot interval where none is asked for.
pub const TOLERANCE: f64 = 0.02;

/// Knot intervals of the finest level that a tool's box reaches beyond the tool and its blend: the supports of what changes.
pub(super) const MARGIN: f64 = 4.0;

/// How closely the result of a tool is followed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Fineness {
    /// Distance from the true surface that may stay off the creases, a world length; a fiftieth of the finest knot interval
    /// if missing.
    pub tolerance: Option<Positive>,
    /// Levels finer than the object's detail that may be added. If missing as many as the feature asks for; without a feature
    /// one, and none where the densities of a scan are carried along.
    pub finer: Option<u8>,
    /// Smallest length that the tool shapes, if it has one.
    pub feature: Option<f64>,
    /// Of tools that carry or even matter: what densities of a scan, off the surface too, may be off by, over what its fit left.
    pub densities: Option<f64>,
}

/// Knot intervals across a feature that show it.
const ACROSS: f64 = 3.0;

/// Levels that are added for a feature, at most.
const MOST_FINER: usize = 5;

/// Functions that a fit may add before it is as fine as it is to become, at least, and over those that there are.
const MOST_FUNCTIONS: usize = 1 << 22;
const MOST_TIMES: usize = 4;
/// Places at which it may ask its target meanwhile, over those functions.
const MOST_SAMPLES: u64 = 32;

/// Whether a fit down to `finest` within a box of a field of `count` functions ends in reasonable time: where it might not, fits that are less fine
/// are tried first, which `fit` does.
///
/// # Errors
/// [`GeometricError::Shape`] with the shortest knot interval and a `remedy`; those of `fit`.
pub(crate) fn affordable(
    lattice: &Lattice,
    within: &Aabb,
    finest: usize,
    count: usize,
    remedy: &str,
    mut fit: impl FnMut(usize) -> Result<FieldFitReport, GeometricError>,
) -> Result<(), GeometricError> {
    let most = MOST_FUNCTIONS.max(MOST_TIMES.saturating_mul(count));
    let size = within.size();
    let area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
    let shortest = |level: usize| lattice.spacing(level).min_element();
    // A surface as large as the box's, in functions of a level.
    let may_be_many = |level: &usize| area / shortest(*level).powi(2) > most as f64;
    let Some(first) = (1..=finest).find(may_be_many) else {
        return Ok(());
    };
    for level in first - 1..finest {
        let report = fit(level)?;
        if report.functions > most || report.samples > MOST_SAMPLES.saturating_mul(most as u64) {
            return Err(GeometricError::Shape(format!(
                "knot intervals as short as {:e} would take too much: with {:e} they are {} functions already; {remedy}",
                shortest(finest),
                shortest(level),
                report.functions
            )));
        }
    }
    Ok(())
}

impl Fineness {
    /// Refuses levels that no field has on top of so much detail.
    fn check(&self, detail: usize) -> Result<(), GeometricError> {
        let most = MAX_LEVELS - 1 - detail.min(MAX_LEVELS - 1);
        match self.finer {
            Some(finer) if usize::from(finer) > most => Err(GeometricError::Shape(format!(
                "finer is {finer}; write 0 to {most}"
            ))),
            _ => Ok(()),
        }
    }
}

/// A field, and what bounds a change of it.
pub(super) struct Writer<'a, T> {
    pub field: &'a HierarchicalSpline<T>,
    pub iso: f64,
    pub limits: &'a Limits,
}

impl<T: Real> Writer<'_, T> {
    /// Level that the object is shaped to. Places where tools went finer do not count: else every stroke would be finer than the
    /// one before.
    pub fn detail(&self) -> usize {
        self.limits.detail().unwrap_or(self.field.level_count() - 1)
    }

    /// The finest level that a tool may use.
    fn finest(&self, fineness: &Fineness) -> usize {
        let (lattice, detail) = (self.field.lattice(), self.detail());
        let shows = |feature: f64| {
            let spacing = |finer: usize| lattice.spacing(detail + finer).min_element();
            (1..MOST_FINER).find(|finer| ACROSS * spacing(*finer) <= feature)
        };
        let finer = match (fineness.finer, fineness.feature) {
            (Some(finer), _) => usize::from(finer),
            (None, Some(feature)) => shows(feature).unwrap_or(MOST_FINER),
            // The knots of a scan are the centres of its voxels, where its densities count.
            (None, None) => usize::from(self.density(fineness).is_none()),
        };
        (detail + finer).min(MAX_LEVELS - 1)
    }

    /// How far densities may be off, where a tool carries those of a scan along.
    fn density(&self, fineness: &Fineness) -> Option<f64> {
        Some(fineness.densities? * self.limits.density()?)
    }

    /// Least distance of its knots.
    pub fn spacing(&self) -> f64 {
        self.field.lattice().spacing(self.detail()).min_element()
    }

    /// A fineness that adds the levels that its feature asks for, and none where the object's own detail shows it, unless it is told.
    pub fn shown(&self, fineness: &Fineness) -> Fineness {
        let is_shown = fineness
            .feature
            .is_some_and(|feature| ACROSS * self.spacing() <= feature);
        Fineness {
            finer: fineness.finer.or(is_shown.then_some(0)),
            ..*fineness
        }
    }

    /// Distance that may stay where a tool makes the field as fine as it asks for.
    pub fn tolerance(&self, fineness: &Fineness) -> f64 {
        let spacing = self.field.lattice().spacing(self.finest(fineness));
        let own = TOLERANCE * spacing.min_element();
        fineness.tolerance.map_or(own, |t| t.0)
    }

    /// The box in which a tool that acts in `reach` changes the field.
    ///
    /// # Errors
    /// [`GeometricError::Outside`] if it lies beside the field, [`GeometricError::Beside`] if beside what the limits leave.
    pub fn within(&self, reach: &Aabb) -> Result<Aabb, GeometricError> {
        let margin = MARGIN * self.spacing();
        let whole = self.field.lattice().world_box();
        let left = self.limits.cut(&whole);
        let own = Aabb {
            min: reach.min - margin,
            max: reach.max + margin,
        };
        let misses = |b: &Aabb| own.max.cmplt(b.min).any() || own.min.cmpgt(b.max).any();
        let corners = |b: &Aabb| [b.min.to_array(), b.max.to_array()];
        let tool = corners(reach);
        if misses(&whole) {
            let field = corners(&whole);
            return Err(GeometricError::Outside { tool, field });
        }
        if misses(&left) {
            let region = corners(&left);
            return Err(GeometricError::Beside { tool, region });
        }
        Ok(Aabb::new(own.min.max(left.min), own.max.min(left.max)))
    }

    /// The field with `target` in a box, as far as the limits allow, and how close it is.
    ///
    /// # Errors
    /// [`GeometricError::Leaves`] if the solid would grow through a face of the field's box; [`GeometricError::Fit`].
    pub fn written(
        &self,
        target: &dyn Field,
        within: &Aabb,
        fineness: &Fineness,
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<T>, FieldFitReport), GeometricError> {
        self.written_where(target, within, fineness, &|_| true, control)
    }

    /// The same with those functions alone of whose supports `is_meant` is true.
    ///
    /// # Errors
    /// As [`Self::written`].
    pub fn written_where(
        &self,
        target: &dyn Field,
        within: &Aabb,
        fineness: &Fineness,
        is_meant: &(dyn Fn(&Aabb) -> bool + Sync),
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<T>, FieldFitReport), GeometricError> {
        fineness.check(self.detail())?;
        let finest = self.finest(fineness);
        // What is there already must not be left over; and nothing finer than a coarse edit may be.
        let finest = finest.max(self.field.finest_in(within));
        let finest = finest.min(self.limits.finest().unwrap_or(finest));
        let spacing = self.field.lattice().spacing(finest).min_element();
        let weight = self.limits.weight(self.spacing());
        let mixed = weight.as_deref().map(|weight| Mixed {
            from: self.field,
            to: target,
            weight,
        });
        let target: &dyn Field = mixed.as_ref().map_or(target, |mixed| mixed);
        // What stays as it is needs no more room.
        if !self.limits.is_inside() {
            self.stays_in_box(target, within)?;
        }
        let density = self.density(fineness);
        // A scan knows its surface as well as its densities.
        let part = density.and(fineness.densities).unwrap_or(TOLERANCE);
        let usual = part.max(TOLERANCE) * spacing;
        let tolerance = fineness.tolerance.map_or(usual, |t| t.0);
        let is_free = |support: &Aabb| is_meant(support) && self.limits.may_change(support);
        let iso = self.iso;
        let aim = match density {
            None => Aim::Surface { iso, tolerance },
            Some(density) => Aim::SurfaceAndDensity {
                iso,
                tolerance,
                density,
            },
        };
        let mut fit = |finest: usize, look: bool| {
            let options = FieldFitOptions { aim, finest, look };
            fit_field_where(target, self.field, within, &options, &is_free, control)
        };
        let remedy = "give a lower finer, a larger tolerance, or an object whose knots lie farther apart";
        let count = self.field.coefficient_count();
        affordable(self.field.lattice(), within, finest, count, remedy, |level| {
            Ok(fit(level, false)?.2)
        })?;
        let (field, _, report) = fit(finest, true)?;
        Ok((field, report))
    }

    /// Looks at the faces of the field's box for solid that was not there, where none has been cut off before.
    fn stays_in_box(&self, target: &dyn Field, within: &Aabb) -> Result<(), GeometricError> {
        let local = within.transformed(self.field.lattice_from_world());
        let step = 1.0 / (1u64 << self.detail()) as f64;
        for face in Face::ALL {
            let Some(nodes) = face.nodes(self.field.lattice(), &local, step) else {
                continue;
            };
            let then = nodes.values(self.field);
            if then.iter().any(|value| *value > self.iso) {
                continue;
            }
            if let Some(n) = nodes.values(target).iter().position(|now| *now > self.iso) {
                return Err(GeometricError::Leaves {
                    at: nodes.place(n).to_array(),
                    face,
                });
            }
        }
        Ok(())
    }
}
