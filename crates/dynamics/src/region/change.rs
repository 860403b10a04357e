//! What a region changed since it was last looked at.

use bspline::Real;

use super::{Cells, Region};

/// What a viewer has seen of a region.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Viewer<T> {
    seen: Vec<T>,
}

/// Functions of a region whose coefficients changed.
#[derive(Clone, Debug, PartialEq)]
pub struct Change<T> {
    /// Level of the functions.
    pub level: usize,
    /// The first function on each axis, as [`bspline::hierarchical::LevelEdit`] numbers them.
    pub first: [u32; 3],
    /// Functions on each axis.
    pub count: [u32; 3],
    /// Change of each coefficient since the region was cut, last axis fastest: to be set, not added, beside what the field
    /// has that the region was cut from, so that nothing drifts from frame to frame.
    pub values: Vec<T>,
}

impl<T> Change<T> {
    /// The cells whose values changed.
    pub fn cells(&self) -> Cells {
        Cells {
            level: self.level,
            // Function s reaches over the cells s - 3 to s.
            first: self.first.map(|f| f - 3),
            count: self.count.map(|c| c + 3),
        }
    }
}

impl<T: Real> Region<T> {
    /// What changed since the viewer last asked, as the least box; `None` if nothing did. A new viewer has seen the field
    /// as it was when the region was cut. After a release or a move begin with a new viewer.
    pub fn change_since(&self, viewer: &mut Viewer<T>) -> Option<Change<T>> {
        let p = self.on_cells();
        if viewer.seen.len() != p.len() {
            viewer.seen = vec![T::zero(); p.len()];
        }
        let [_, ny, nz] = self.cells.count.map(|c| c as usize - 3);
        let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
        for (i, (now, seen)) in p.iter().zip(&mut viewer.seen).enumerate() {
            if now != seen {
                *seen = *now;
                let at = [i / nz / ny, i / nz % ny, i % nz];
                low = std::array::from_fn(|a| low[a].min(at[a]));
                high = std::array::from_fn(|a| high[a].max(at[a]));
            }
        }
        if low[0] == usize::MAX {
            return None;
        }
        let mut values = Vec::new();
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                let row = (x * ny + y) * nz;
                values.extend_from_slice(&p[row + low[2]..=row + high[2]]);
            }
        }
        Some(Change {
            level: self.cells.level,
            first: std::array::from_fn(|a| self.cells.first[a] + 3 + low[a] as u32),
            count: std::array::from_fn(|a| (high[a] - low[a]) as u32 + 1),
            values,
        })
    }
}
