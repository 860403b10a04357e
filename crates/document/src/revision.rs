//! What the edits of an object mean for the scan that it was fitted to.
//!
//! Where nothing was edited a voxel stays. Elsewhere it changes by what the field changed, `v + f_new − f_fit`, so that what the
//! fit had smoothed away stays in the scan. Matter that was taken out becomes another matter, mostly air: within one voxel of
//! the new surface its density runs from the iso-value to that of the fill. The voxels that it had shared with what lay beside it
//! become what lies there: else a ghost of the old surface would stay. What never was part of the solid stays.

use std::collections::{BTreeMap, BTreeSet};

use bspline::hierarchical::DiffError;
use bspline::{Aabb, Field, HierarchicalSpline};
use formats::volumes::{Change, Volume};
use glam::DVec3;
use rayon::prelude::*;

/// Voxels on an edge of the tiles in which changed voxels are looked for.
const TILE: usize = 8;

/// Rounding of a field's values, in units of the largest of the volume: less is no change.
const ROUNDING: f64 = 16.0 * f32::EPSILON as f64;

/// New densities of a scan, and what became of its voxels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VolumeRevision {
    /// In the order of the voxels.
    pub changes: Vec<Change>,
    /// Voxels that left the solid.
    pub carved: usize,
    /// Voxels that joined it.
    pub added: usize,
}

/// What the way from `fitted` to `now` means for the `volume` that `fitted` was fitted to. The surface lies at `iso`; what was
/// carved gets the density `fill`, and no density rises above the largest of the volume.
///
/// # Errors
/// [`DiffError::Lattice`] if the two are no versions of one field.
pub fn revise_volume(
    fitted: &HierarchicalSpline<f32>,
    now: &HierarchicalSpline<f32>,
    volume: &Volume,
    iso: f64,
    fill: f64,
) -> Result<VolumeRevision, DiffError> {
    // Versions that were read from a file share nothing; by way of the difference they do.
    let now = fitted.applied(&fitted.difference(now)?)?;
    let header = &volume.header;
    let [nx, ny, nz] = header.dims;
    let voxel_from_world = header.world_from_voxel.inverse();
    let last = DVec3::from_array(header.dims.map(|n| (n - 1) as f64));
    let whole = Aabb::new(DVec3::ZERO, last).transformed(&header.world_from_voxel);
    let mut tiles = BTreeSet::new();
    for changed in now.changed_boxes(fitted, &whole) {
        let reach = changed.transformed(&voxel_from_world);
        let [from, to] = [reach.min.ceil().max(DVec3::ZERO), reach.max.floor().min(last)];
        if from.cmpgt(to).any() {
            continue;
        }
        let tile = |p: DVec3| p.to_array().map(|v| v as usize / TILE);
        let ([x0, y0, z0], [x1, y1, z1]) = (tile(from), tile(to));
        for z in z0..=z1 {
            for y in y0..=y1 {
                tiles.extend((x0..=x1).map(|x| [z, y, x]));
            }
        }
    }
    let m = header.world_from_voxel.matrix3;
    let step = [m.x_axis, m.y_axis, m.z_axis]
        .map(DVec3::length)
        .into_iter()
        .fold(f64::INFINITY, f64::min);
    let (least, largest) = volume
        .values
        .iter()
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), v| {
            (lo.min(*v), hi.max(*v))
        });
    let matter = Matter {
        iso,
        fill,
        ramp: fitted.slope() * step,
        largest: largest.into(),
        rounding: ROUNDING * f64::from(least.abs().max(largest.abs())),
    };
    let tiles = Vec::from_iter(tiles);
    let parts: Vec<VolumeRevision> = tiles
        .par_iter()
        .map(|[tz, ty, tx]| {
            let along = |tile: &usize, count: usize| tile * TILE..count.min((tile + 1) * TILE);
            let mut part = VolumeRevision::default();
            for z in along(tz, nz) {
                for y in along(ty, ny) {
                    for x in along(tx, nx) {
                        let place = DVec3::new(x as f64, y as f64, z as f64);
                        let place = header.world_from_voxel.transform_point3(place);
                        let voxel = x + nx * (y + ny * z);
                        let densities = [fitted.value(place), now.value(place)];
                        let density = matter.revised(f64::from(volume.values[voxel]), densities, &mut part);
                        part.changes
                            .extend(density.map(|density| Change { voxel, density }));
                    }
                }
            }
            part
        })
        .collect();
    let mut all = VolumeRevision::default();
    for part in parts {
        all.changes.extend(part.changes);
        all.carved += part.carved;
        all.added += part.added;
    }
    all.changes.sort_unstable_by_key(|c| c.voxel);
    without_ghosts(&mut all, volume, iso);
    Ok(all)
}

/// Gives voxels beside what was carved, and beside no solid that is left, the least density that stood round them.
fn without_ghosts(revision: &mut VolumeRevision, volume: &Volume, iso: f64) {
    let (old, dims, iso) = (&volume.values, volume.header.dims, iso as f32);
    let mut new: BTreeMap<usize, f64> = revision.changes.iter().map(|c| (c.voxel, c.density)).collect();
    let is_solid = |v: usize| new.get(&v).map_or(old[v], |d| *d as f32) >= iso;
    let carved = revision
        .changes
        .iter()
        .map(|c| c.voxel)
        .filter(|v| old[*v] >= iso && !is_solid(*v));
    let beside: BTreeSet<usize> = carved
        .flat_map(|v| neighbours(v, dims))
        .filter(|v| old[*v] < iso && !is_solid(*v))
        .collect();
    let freed = beside.into_iter().filter(|v| !neighbours(*v, dims).any(is_solid));
    let cleared: Vec<(usize, f64)> = freed
        .map(|voxel| {
            let outside = neighbours(voxel, dims).map(|v| old[v]).filter(|d| *d < iso);
            let least = f64::from(outside.fold(old[voxel], f32::min));
            (voxel, new.get(&voxel).map_or(least, |d| d.min(least)))
        })
        .collect();
    new.extend(cleared);
    let changes = new.into_iter().map(|(voxel, density)| Change { voxel, density });
    revision.changes = changes.collect();
}

/// The voxels round one, at most 26.
fn neighbours(voxel: usize, [nx, ny, nz]: [usize; 3]) -> impl Iterator<Item = usize> + Clone {
    let at = [voxel % nx, voxel / nx % ny, voxel / (nx * ny)];
    (0..27).filter(|n| *n != 13).filter_map(move |n: usize| {
        let step = |axis: usize, k: usize, count: usize| (at[axis] + k).checked_sub(1).filter(|i| *i < count);
        Some(step(0, n % 3, nx)? + nx * (step(1, n / 3 % 3, ny)? + ny * step(2, n / 9, nz)?))
    })
}

/// What voxels are made of.
struct Matter {
    iso: f64,
    fill: f64,
    /// Density over which what was carved becomes the fill.
    ramp: f64,
    largest: f64,
    /// A difference that is none.
    rounding: f64,
}

impl Matter {
    /// The new density of a voxel, if it has one.
    fn revised(&self, old: f64, [fitted, now]: [f64; 2], told: &mut VolumeRevision) -> Option<f64> {
        if (now - fitted).abs() <= self.rounding {
            return None;
        }
        let (was_in, is_in) = (fitted >= self.iso, now >= self.iso);
        if was_in && !is_in {
            told.carved += 1;
            let share = ((self.iso - now) / self.ramp).min(1.0);
            return Some(self.iso + share * (self.fill - self.iso));
        }
        told.added += usize::from(is_in && !was_in);
        let moved = old + (now - fitted);
        // A tool's own density has no bounds far inside or outside of it; matter has.
        Some(match now > fitted {
            true => moved.min(self.largest.max(old)),
            false => moved.max(self.fill.min(old)),
        })
    }
}
