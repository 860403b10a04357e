//! How the result of a tool becomes coefficients.

use bspline::hierarchical::MAX_LEVELS;
use bspline::{Aabb, Field, Frame, HierarchicalSpline, Real};
use fitting::Control;
use fitting::field::{Aim, FieldFitOptions, FieldFitReport, fit_field_where};

use super::GeometricError;
use crate::limits::Limits;
use crate::number::Positive;

/// Tolerance over the finest knot interval where none is asked for.
pub(super) const TOLERANCE: f64 = 0.02;

/// Knot intervals of the finest level that a tool's box reaches beyond the tool and its blend: the supports of what changes.
pub(super) const MARGIN: f64 = 4.0;

/// Points across a face of the field's box at which it is asked for what leaves the box.
const FACE: u32 = 256;

/// Knot intervals that a tool should be thick, and most levels that are added for that.
const THICK: f64 = 16.0;
const DEEPER: usize = 3;

/// How closely the result of a tool is followed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Fineness {
    /// Distance from the true surface that may stay off the creases, a world length; a fiftieth of the finest knot interval
    /// if missing.
    pub tolerance: Option<Positive>,
    /// Levels finer than the field has that may be added.
    pub finer: Option<u8>,
    /// Least thickness of the tool, for which levels are added where `finer` says nothing.
    pub thickness: Option<f64>,
}

impl Fineness {
    fn finest<T: Real>(&self, field: &HierarchicalSpline<T>) -> usize {
        let own = field.level_count() - 1;
        let deeper = match (self.finer, self.thickness) {
            (Some(finer), _) => usize::from(finer),
            (None, None) => 0,
            (None, Some(thickness)) => {
                let asked = (THICK * field.finest_spacing() / thickness).log2().ceil();
                (asked.max(0.0) as usize).min(DEEPER)
            }
        };
        (own + deeper).min(MAX_LEVELS - 1)
    }
}

/// A field, and what bounds a change of it.
pub(super) struct Writer<'a, T> {
    pub field: &'a HierarchicalSpline<T>,
    pub iso: f64,
    pub limits: &'a Limits,
}

impl<T: Real> Writer<'_, T> {
    /// The box in which a tool that acts in `reach` changes the field.
    ///
    /// # Errors
    /// [`GeometricError::Outside`] if it lies beside the field, or beside what the limits leave.
    pub fn within(&self, reach: &Aabb) -> Result<Aabb, GeometricError> {
        let margin = MARGIN * self.field.finest_spacing();
        let whole = self.limits.cut(&self.field.lattice().world_box());
        let own = Aabb {
            min: reach.min - margin,
            max: reach.max + margin,
        };
        if own.max.cmplt(whole.min).any() || own.min.cmpgt(whole.max).any() {
            let corners = |b: &Aabb| [b.min.to_array(), b.max.to_array()];
            return Err(GeometricError::Outside {
                tool: corners(reach),
                field: corners(&whole),
            });
        }
        Ok(Aabb::new(own.min.max(whole.min), own.max.min(whole.max)))
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
        let finest = fineness.finest(self.field);
        let finest = finest.min(self.limits.finest().unwrap_or(finest));
        let spacing = self.field.lattice().spacing(finest).min_element();
        let mixed = self.limits.mixed(self.field, target);
        let target: &dyn Field = mixed.as_ref().map_or(target, |mixed| mixed);
        self.stays_in_box(target, within)?;
        let options = FieldFitOptions {
            aim: Aim::Surface {
                iso: self.iso,
                tolerance: fineness.tolerance.map_or(TOLERANCE * spacing, |t| t.0),
            },
            finest,
            look: true,
        };
        let is_free = |support: &Aabb| self.limits.is_free(support);
        let (field, _, report) = fit_field_where(target, self.field, within, &options, &is_free, control)?;
        Ok((field, report))
    }

    /// Looks at the faces of the field's box for solid that was not there.
    fn stays_in_box(&self, target: &dyn Field, within: &Aabb) -> Result<(), GeometricError> {
        let lattice = self.field.lattice();
        let local = within.transformed(self.field.lattice_from_world());
        let extent = lattice.extent();
        let step = 1.0 / (1u64 << (self.field.level_count() - 1)) as f64;
        let rim = self.field.finest_spacing() * self.field.slope();
        for axis in 0..3 {
            for (face, is_reached) in [
                (0.0, local.min[axis] <= 0.0),
                (extent[axis], local.max[axis] >= extent[axis]),
            ] {
                if !is_reached {
                    continue;
                }
                let mut part = Aabb::new(local.min.max(glam::DVec3::ZERO), local.max.min(extent));
                (part.min[axis], part.max[axis]) = (face, face);
                let steps = (part.size() / step).ceil();
                let cells = steps.to_array().map(|n| (n as u32).clamp(1, FACE));
                let mut frame = Frame::over(&part, cells);
                frame.world_from_grid = lattice.world_from_lattice * frame.world_from_grid;
                let count = std::array::from_fn(|a| if a == axis { 1 } else { cells[a] as usize + 1 });
                let mut values = [(); 2].map(|()| vec![0.0; count.iter().product()]);
                let [now, then] = &mut values;
                target.frame_values(&frame, [0; 3], count, now);
                self.field.frame_values(&frame, [0; 3], count, then);
                // Where the solid has been cut off before, its rim may move.
                let leaves = |(now, then): (&f64, &f64)| *now > self.iso + rim && *then < self.iso - rim;
                if let Some(n) = now.iter().zip(then.iter()).position(leaves) {
                    let at = [n / count[2] / count[1], n / count[2] % count[1], n % count[2]];
                    return Err(GeometricError::Leaves {
                        at: frame.node(at.map(|i| i as i64)).to_array(),
                    });
                }
            }
        }
        Ok(())
    }
}
