//! Several regions of one field.

use bspline::{HierarchicalSpline, Real};

use super::{Cells, Region, RegionError, RegionOptions, Schedule, Turn};
use crate::integrators::Integrator;
use crate::matter::Matter;

/// A field and the regions of it that move. Regions share no cells: where two would, the second is refused, or one that
/// covers both is cut in their place.
#[derive(Clone, Debug)]
pub struct Scene<T> {
    field: HierarchicalSpline<T>,
    regions: Vec<Region<T>>,
    schedule: Schedule,
}

impl Cells {
    /// Whether both share cells, of whatever levels they are.
    pub fn overlaps(&self, other: &Self) -> bool {
        let deepest = self.level.max(other.level);
        let ends = |c: &Self, a: usize| {
            let shift = (deepest - c.level) as u32;
            let first = u64::from(c.first[a]) << shift;
            [first, first + (u64::from(c.count[a]) << shift)]
        };
        (0..3).all(|a| {
            let ([f, e], [g, h]) = (ends(self, a), ends(other, a));
            f < h && g < e
        })
    }

    /// The least box of the level of this one that covers both.
    pub fn joined(&self, other: &Self) -> Self {
        let mut out = *self;
        for a in 0..3 {
            let (first, end) = (
                u64::from(other.first[a]),
                u64::from(other.first[a]) + u64::from(other.count[a]),
            );
            let [first, end] = if other.level > self.level {
                let width = 1 << (other.level - self.level);
                [first / width, end.div_ceil(width)]
            } else {
                [
                    first << (self.level - other.level),
                    end << (self.level - other.level),
                ]
            };
            let last = (u64::from(self.first[a]) + u64::from(self.count[a])).max(end);
            // Both lie in the field, whose cells have numbers of this size.
            out.first[a] = self.first[a].min(first as u32);
            out.count[a] = (last - u64::from(out.first[a])) as u32;
        }
        out
    }
}

impl<T: Real> Scene<T> {
    /// Of a field at rest.
    pub fn new(field: HierarchicalSpline<T>) -> Self {
        Self {
            field,
            regions: Vec::new(),
            schedule: Schedule::default(),
        }
    }

    /// The field as published: what the regions do is not in it before they are [released](Self::release).
    pub fn field(&self) -> &HierarchicalSpline<T> {
        &self.field
    }

    /// The regions.
    pub fn regions(&self) -> &[Region<T>] {
        &self.regions
    }

    /// One of the regions, to push it.
    pub fn region_mut(&mut self, index: usize) -> Option<&mut Region<T>> {
        self.regions.get_mut(index)
    }

    /// Cuts a region out; returns its number.
    ///
    /// # Errors
    /// [`RegionError::Overlaps`] where one is already, and as [`Region::new`].
    pub fn cut(
        &mut self,
        cells: Cells,
        matter: Matter,
        options: &RegionOptions,
    ) -> Result<usize, RegionError> {
        if let Some(index) = self.regions.iter().position(|r| r.cells().overlaps(&cells)) {
            let with = *self.regions[index].cells();
            return Err(RegionError::Overlaps { cells, index, with });
        }
        self.regions
            .push(Region::new(&self.field, cells, matter, options)?);
        Ok(self.regions.len() - 1)
    }

    /// Cuts a region out that also covers all regions it overlaps, which are let go as clay first, in order; returns its
    /// number, which is the last. `matter` gives the matter of the cells it becomes.
    ///
    /// # Errors
    /// As [`Region::new`] and [`Region::bake`]; nothing has changed then.
    pub fn cut_joined(
        &mut self,
        cells: Cells,
        matter: impl FnOnce(Cells) -> Matter,
        options: &RegionOptions,
    ) -> Result<usize, RegionError> {
        let mut joined = cells;
        // A box that grows may reach others.
        while let Some(r) = self.regions.iter().find(|r| {
            let c = r.cells();
            c.overlaps(&joined) && joined.joined(c) != joined
        }) {
            joined = joined.joined(r.cells());
        }
        let mut field = self.field.clone();
        for region in self.regions.iter().filter(|r| r.cells().overlaps(&joined)) {
            field = region.bake(&field)?;
        }
        let region = Region::new(&field, joined, matter(joined), options)?;
        self.regions.retain(|r| !r.cells().overlaps(&joined));
        self.field = field;
        self.regions.push(region);
        Ok(self.regions.len() - 1)
    }

    /// Moves the regions in turns, as [`Schedule::step_while`].
    pub fn step_while(
        &mut self,
        integrator: Integrator,
        dt: f64,
        may_move: impl FnMut(u64) -> bool,
    ) -> Vec<Turn> {
        self.schedule
            .step_while(&mut self.regions, integrator, dt, may_move)
    }

    /// Moves as many regions as had their turn then, as [`Schedule::replay`].
    pub fn replay(&mut self, integrator: Integrator, dt: f64, taken: usize) -> Vec<Turn> {
        self.schedule.replay(&mut self.regions, integrator, dt, taken)
    }

    /// Lets a region go as clay: its change is in the field from now on, once, and it stays where it is, at rest.
    ///
    /// # Errors
    /// As [`Region::release_clay`]; nothing has changed then.
    pub fn release(&mut self, index: usize) -> Result<&HierarchicalSpline<T>, RegionError> {
        let count = self.regions.len();
        let region = self
            .regions
            .get_mut(index)
            .ok_or(RegionError::NoRegion { index, count })?;
        self.field = region.release_clay(&self.field)?;
        Ok(&self.field)
    }

    /// The same, and moves the region to other cells of its level, as [`Region::moved`].
    ///
    /// # Errors
    /// [`RegionError::Overlaps`] where another one is, and as [`Region::moved`]; nothing has changed then.
    pub fn move_region(&mut self, index: usize, cells: Cells, matter: Matter) -> Result<(), RegionError> {
        let count = self.regions.len();
        let region = self
            .regions
            .get(index)
            .ok_or(RegionError::NoRegion { index, count })?;
        let others = self.regions.iter().enumerate().filter(|(i, _)| *i != index);
        for (index, other) in others {
            if other.cells().overlaps(&cells) {
                let with = *other.cells();
                return Err(RegionError::Overlaps { cells, index, with });
            }
        }
        let (field, moved) = region.moved(&self.field, cells, matter)?;
        self.field = field;
        self.regions[index] = moved;
        Ok(())
    }

    /// Takes a region out as it is, its change lost unless it was released.
    pub fn remove(&mut self, index: usize) -> Option<Region<T>> {
        (index < self.regions.len()).then(|| self.regions.remove(index))
    }
}
