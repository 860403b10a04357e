//! A moving region as a value.

use bspline::Real;
use bspline::hierarchical::Lattice as FieldLattice;
use glam::DAffine3;
use serde::{Deserialize, Serialize};

use super::parts::{Part, Parts};
use super::window::Window;
use super::{Cells, MIN_CELLS, Region, RegionError, Thresholds, cells, perpendicular, strides};
use crate::patch::{Patch, PatchError, finite};
use crate::snapshot::PatchSnapshot;

/// All of a region that later bits depend on, its part that is awake and the factors in work included.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RegionSnapshot<T> {
    cells: Cells,
    /// Columns of the map from the field's lattice to the world.
    world_from_lattice: [f64; 12],
    field_cells: [u32; 3],
    stride: [u32; 3],
    samples_per_cell: [f64; 3],
    origin: Vec<T>,
    patch: PatchSnapshot<T>,
    thresholds: Thresholds,
    asleep: bool,
    parts: Parts,
    part: Option<PartRecord<T>>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct PartRecord<T> {
    window: Window,
    earned: f64,
    patch: PatchSnapshot<T>,
}

impl<T: Real> Region<T> {
    /// All that later bits depend on, as a value that can be written down. Looking changes nothing.
    pub fn snapshot(&self) -> RegionSnapshot<T> {
        let part = self.part.as_ref().map(|part| PartRecord {
            window: part.window,
            earned: part.earned,
            patch: part.patch.snapshot(),
        });
        RegionSnapshot {
            cells: self.cells,
            world_from_lattice: self.field_lattice.world_from_lattice.to_cols_array(),
            field_cells: self.field_lattice.cells,
            stride: self.stride,
            samples_per_cell: self.samples_per_cell,
            origin: self.origin.clone(),
            patch: self.patch.snapshot(),
            thresholds: self.thresholds,
            asleep: self.asleep,
            parts: self.parts,
            part,
        }
    }

    /// The region that a snapshot is of; it goes on with the same bits.
    ///
    /// # Errors
    /// [`RegionError`] of a snapshot that is damaged or of another precision.
    pub fn restore(snapshot: &RegionSnapshot<T>) -> Result<Self, RegionError> {
        let s = snapshot;
        let damaged = |what: &str| PatchError::Snapshot {
            what: what.to_owned(),
        };
        if !s.world_from_lattice.iter().all(|v| v.is_finite()) {
            return Err(damaged("the map to the world is not finite").into());
        }
        let field_lattice = FieldLattice {
            world_from_lattice: DAffine3::from_cols_array(&s.world_from_lattice),
            cells: s.field_cells,
        };
        perpendicular(&field_lattice.world_from_lattice.matrix3)?;
        cells::size("samples", s.patch.samples())?;
        cells::size("cells", s.cells.count.map(u64::from))?;
        let inside = |a: usize| {
            let level = u32::try_from(s.cells.level).unwrap_or(u32::MAX);
            let cells = u64::from(s.field_cells[a]).checked_shl(level).unwrap_or(0);
            let end = u64::from(s.cells.first[a]) + u64::from(s.cells.count[a]);
            s.cells.count[a] >= MIN_CELLS && end <= cells && cells <= u64::from(u32::MAX)
        };
        let patch = Patch::restore(&s.patch)?;
        let dims = patch.lattice().coefficient_dims();
        let is_one = |a: usize| inside(a) && dims[a] == (s.cells.count[a] / s.stride[a]) as usize - 3;
        if strides::check(&s.cells, s.stride).is_err() || !(0..3).all(is_one) {
            return Err(damaged("its cells are not those of its patch").into());
        }
        let free = s.cells.count.map(|c| c as usize - 3);
        finite("coefficient", &s.origin, free.iter().product())?;
        if !s.parts.is_sound() {
            return Err(damaged("its record of parts is not one").into());
        }
        let part = match &s.part {
            None => None,
            Some(part) => {
                let restored = Patch::restore(&part.patch)?;
                if !part.window.fits(patch.lattice(), restored.lattice()) {
                    return Err(damaged("its part is no part of it").into());
                }
                Some(Box::new(Part {
                    patch: restored,
                    window: part.window,
                    earned: part.earned,
                }))
            }
        };
        Ok(Self {
            cells: s.cells,
            field_lattice,
            stride: s.stride,
            samples_per_cell: s.samples_per_cell,
            origin: s.origin.clone(),
            patch,
            thresholds: s.thresholds,
            asleep: s.asleep,
            parts: s.parts,
            part,
        })
    }
}
