//! What the edits of an object mean for the volume that it was fitted to.
//!
//! Where nothing was edited a voxel stays. Elsewhere it changes by what the field changed, `v + f_new − f_fit`, so that what the
//! fit had smoothed away stays in the scan. Matter that was taken out becomes another matter, mostly air: within one voxel of
//! the new surface its density runs from the iso-value to that of the fill. The voxels that it had shared with what lay beside it
//! become what lies there: else a ghost of the old surface would stay. What never was part of the solid stays, but for the
//! voxels beside a new surface. Matter that was added is
//! no denser than the median of the solid: tools make it the denser the deeper it lies; what was solid already changes by what its fit
//! lacks of that. Brushes that
//! carry densities along or mix them, as smoothing does, leave what they make of them, between the fill and the densest
//! voxel that they met. Moves, and pastes of what the object had elsewhere, carry along what the fit had smoothed away:
//! `v = f_new(x) + (v − f_fit)(w⁻¹(x))`; from beyond the scan comes nothing, which is the fill.

use std::collections::{BTreeMap, BTreeSet};

use bspline::hierarchical::DiffError;
use bspline::{Aabb, Field, HierarchicalSpline};
use formats::volumes::{Change, Volume};
use glam::DVec3;
use rayon::prelude::*;

use super::Journey;
use super::journey::{Brought, Mix};

/// Voxels on an edge of the tiles in which changed voxels are looked for.
const TILE: usize = 8;

/// Rounding of a field's values, in units of the largest of the volume: less is no change.
const ROUNDING: f64 = 16.0 * f32::EPSILON as f64;

/// Voxels that are looked at for the median density of the solid, about.
const PROBES: usize = 1 << 18;

/// Voxels outside of a surface that comes or goes over which densities pass into those of the scan: the first changes with the field.
const BESIDE: f64 = 2.0;

/// So far round its centre a voxel reaches.
const HALF: DVec3 = DVec3::splat(0.5);

/// Share of what the field falls by in a voxel that is no edit: what is written back may be off by so much.
const OFF: f64 = 0.1;

/// New densities of a scan, and what became of its voxels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VolumeRevision {
    /// In the order of the voxels.
    pub changes: Vec<Change>,
    /// Voxels that left the solid.
    pub carved: usize,
    /// Voxels that joined it.
    pub added: usize,
    /// Those that were carved and filled.
    emptied: Vec<usize>,
    /// To which something came from beyond the scan.
    pub(super) beyond: usize,
}

impl VolumeRevision {
    /// Whether some voxels got the density of the fill.
    pub fn is_filled(&self) -> bool {
        !self.emptied.is_empty()
    }

    /// Goes on with what was done to the voxels as this one leaves them.
    pub(super) fn follow(&mut self, next: Self) {
        // Of the changes of a voxel the new one stands first, and stays.
        let earlier = std::mem::replace(&mut self.changes, next.changes);
        self.changes.extend(earlier);
        self.changes.sort_by_key(|c| c.voxel);
        self.changes.dedup_by_key(|c| c.voxel);
        self.count(next.emptied, [next.carved, next.added, next.beyond]);
    }

    /// Counts what became of more voxels.
    fn count(&mut self, emptied: Vec<usize>, [carved, added, beyond]: [usize; 3]) {
        self.emptied.extend(emptied);
        self.carved += carved;
        self.added += added;
        self.beyond += beyond;
    }
}

/// What the way from `fitted` to `now` means for the `volume` that `fitted` was fitted to. The surface lies at `iso`; what was
/// carved gets the density `fill`, what was added at most the median of the solid, and no density rises above the largest of the volume.
/// What was moved went on the `journey`.
///
/// # Errors
/// [`DiffError::Lattice`] if the two are no versions of one field.
pub fn revise_volume(
    fitted: &HierarchicalSpline<f32>,
    now: &HierarchicalSpline<f32>,
    volume: &Volume,
    iso: f64,
    fill: f64,
    journey: &Journey,
) -> Result<VolumeRevision, DiffError> {
    // Versions that were read from a file share nothing; by way of the difference they do.
    let now = &fitted.applied(&fitted.difference(now)?)?;
    let header = &volume.header;
    let world_from_voxel = header.world_from_voxel;
    let voxel_from_world = world_from_voxel.inverse();
    let last = DVec3::from_array(header.dims.map(|n| (n - 1) as f64));
    let whole = Aabb::new(DVec3::ZERO, last).transformed(&world_from_voxel);
    let boxes = now
        .changed_boxes(fitted, &whole)
        .into_iter()
        .chain(journey.reaches(&whole));
    let reaches = boxes.map(|b| b.transformed(&voxel_from_world));
    let tiles = tiles(reaches, last);
    let matter = Matter::new(volume, fitted.slope(), iso, fill);
    let mixed = Mixed::new(volume, journey);
    let [nx, ny, nz] = header.dims;
    let parts = tiles.par_iter().map(|[tz, ty, tx]| {
        let along = |tile: &usize, count: usize| tile * TILE..count.min((tile + 1) * TILE);
        let mut part = VolumeRevision::default();
        for z in along(tz, nz) {
            for y in along(ty, ny) {
                for x in along(tx, nx) {
                    let voxel = x + nx * (y + ny * z);
                    let place = DVec3::new(x as f64, y as f64, z as f64);
                    let place = world_from_voxel.transform_point3(place);
                    let [was, is] = [fitted.value(place), now.value(place)];
                    part.carved += usize::from(was >= iso && is < iso);
                    part.added += usize::from(is >= iso && was < iso);
                    let (origin, in_part) = journey.back(place);
                    let is_carried = origin != place;
                    let stayed = [f64::from(volume.values[voxel]), was];
                    let there = voxel_from_world.transform_point3(origin);
                    let came = if !is_carried {
                        stayed
                    } else if there.cmpge(-HALF).all() && there.cmple(last + HALF).all() {
                        [sampled(volume, there), fitted.value(origin)]
                    } else {
                        part.beyond += 1;
                        [fill; 2]
                    };
                    let blended = in_part.then(|| matter.blended(stayed, came, is)).flatten();
                    let density = blended.or_else(|| {
                        let [old, was] = came;
                        let beside = || matter.beside(fitted, origin);
                        let least = if is_carried {
                            OFF * matter.ramp
                        } else {
                            matter.rounding
                        };
                        let how = (least, mixed.most(place));
                        let density = matter.revised(voxel, old, [was, is], how, beside, &mut part);
                        density.or(is_carried.then_some(old))
                    });
                    let density = density.filter(|density| *density != stayed[0]);
                    let change = density.map(|density| Change { voxel, density });
                    part.changes.extend(change);
                }
            }
        }
        part
    });
    let parts: Vec<VolumeRevision> = parts.collect();
    let mut all = VolumeRevision::default();
    for part in parts {
        all.changes.extend(part.changes);
        all.count(part.emptied, [part.carved, part.added, part.beyond]);
    }
    all.changes.sort_unstable_by_key(|c| c.voxel);
    let is_touched = |voxel: usize| {
        let place = DVec3::from_array([voxel % nx, voxel / nx % ny, voxel / (nx * ny)].map(|i| i as f64));
        let place = world_from_voxel.transform_point3(place);
        (now.value(place) - fitted.value(place)).abs() > matter.rounding
    };
    without_ghosts(&mut all, volume, iso, is_touched);
    Ok(all)
}

/// Tiles of voxels that boxes of voxels meet, in their order; `last` is the last voxel.
fn tiles(boxes: impl Iterator<Item = Aabb>, last: DVec3) -> Vec<[usize; 3]> {
    let mut tiles = BTreeSet::new();
    for reach in boxes {
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
    tiles.into_iter().collect()
}

/// Gives voxels that the field changed beside what was carved, and beside no solid that is left, the least density that stood round them.
fn without_ghosts(
    revision: &mut VolumeRevision,
    volume: &Volume,
    iso: f64,
    is_touched: impl Fn(usize) -> bool,
) {
    let (old, dims, iso) = (&volume.values, volume.header.dims, iso as f32);
    let mut new: BTreeMap<usize, f64> = revision.changes.iter().map(|c| (c.voxel, c.density)).collect();
    let is_solid = |v: usize| new.get(&v).map_or(old[v], |d| *d as f32) >= iso;
    let emptied = revision.emptied.iter().filter(|v| !is_solid(**v));
    let beside: BTreeSet<usize> = emptied
        .flat_map(|v| neighbours(*v, dims))
        .filter(|v| old[*v] < iso && !is_solid(*v))
        .collect();
    let mut freed: Vec<usize> = beside.into_iter().collect();
    freed.retain(|v| is_touched(*v) && !neighbours(*v, dims).any(is_solid));
    let cleared: Vec<(usize, f64)> = freed
        .into_iter()
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

/// The density between voxels, linear along each axis; beyond them that of the nearest.
fn sampled(volume: &Volume, at: DVec3) -> f64 {
    let dims = volume.header.dims;
    let last = DVec3::from_array(dims.map(|n| (n - 1) as f64));
    let at = at.clamp(DVec3::ZERO, last);
    let cell = at.floor().min((last - 1.0).max(DVec3::ZERO));
    let share = at - cell;
    let first = cell.to_array().map(|v| v as usize);
    let corners = (0..8).map(|corner: usize| {
        let step = [corner & 1, corner >> 1 & 1, corner >> 2];
        let weight = |a: usize| if step[a] == 1 { share[a] } else { 1.0 - share[a] };
        let [x, y, z] = std::array::from_fn(|a| (first[a] + step[a]).min(dims[a] - 1));
        weight(0) * weight(1) * weight(2) * f64::from(volume.values[x + dims[0] * (y + dims[1] * z)])
    });
    corners.sum()
}

/// The voxels round one, at most 26.
fn neighbours(voxel: usize, [nx, ny, nz]: [usize; 3]) -> impl Iterator<Item = usize> + Clone {
    let at = [voxel % nx, voxel / nx % ny, voxel / (nx * ny)];
    (0..27).filter(|n| *n != 13).filter_map(move |n: usize| {
        let step = |axis: usize, k: usize, count: usize| (at[axis] + k).checked_sub(1).filter(|i| *i < count);
        Some(step(0, n % 3, nx)? + nx * (step(1, n / 3 % 3, ny)? + ny * step(2, n / 9, nz)?))
    })
}

/// Brushes that mix densities, and the largest densities that they met.
struct Mixed<'a> {
    mixes: &'a [Mix],
    /// In the solid, and outside of it, where only what was brought can be denser than what a tool adds.
    most: Vec<[f64; 2]>,
}

impl<'a> Mixed<'a> {
    fn new(volume: &Volume, journey: &'a Journey) -> Self {
        let mixes = journey.mixes();
        let most = mixes.iter().map(|mix| {
            let brought = mix.brought.map_or(f64::NEG_INFINITY, |from| match from {
                Brought::Here(from) => largest(volume, &from),
                Brought::Elsewhere => f64::INFINITY,
            });
            [brought.max(largest(volume, &mix.reach)), brought]
        });
        Self {
            mixes,
            most: most.collect(),
        }
    }

    /// The largest densities that brushes met that passed over a place, if any did.
    fn most(&self, place: DVec3) -> Option<[f64; 2]> {
        let met = self.mixes.iter().zip(&self.most);
        met.filter(|(mix, _)| mix.holds(place))
            .map(|(_, most)| *most)
            .reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])])
    }
}

/// The largest density of the voxels in a box, if it holds any.
fn largest(volume: &Volume, within: &Aabb) -> f64 {
    let dims = volume.header.dims;
    let last = DVec3::from_array(dims.map(|n| (n - 1) as f64));
    let to_world = volume.header.world_from_voxel;
    let whole = Aabb::new(DVec3::ZERO, last).transformed(&to_world);
    let [min, max] = [within.min.max(whole.min), within.max.min(whole.max)];
    if min.cmpgt(max).any() {
        return f64::NEG_INFINITY;
    }
    let reach = Aabb::new(min, max).transformed(&to_world.inverse());
    let [from, to] = [reach.min.ceil().max(DVec3::ZERO), reach.max.floor().min(last)];
    let along = |a: usize| (from[a] as usize..).take((to[a] - from[a] + 1.0).max(0.0) as usize);
    let rows = along(2).flat_map(|z| along(1).map(move |y| dims[0] * (y + dims[1] * z)));
    let values = rows.flat_map(|row| along(0).map(move |x| volume.values[row + x]));
    values.fold(f32::NEG_INFINITY, f32::max).into()
}

/// What voxels are made of.
struct Matter {
    iso: f64,
    fill: f64,
    /// Least distance of voxels.
    voxel: f64,
    /// Density over which what was carved becomes the fill.
    ramp: f64,
    /// Median of those of the solid.
    median_solid: f64,
    /// A difference that is none.
    rounding: f64,
}

impl Matter {
    fn new(volume: &Volume, slope: f64, iso: f64, fill: f64) -> Self {
        let m = volume.header.world_from_voxel.matrix3;
        let steps = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::length);
        let voxel = steps.into_iter().fold(f64::INFINITY, f64::min);
        let range = (f32::INFINITY, f32::NEG_INFINITY);
        let densities = volume.values.iter();
        let (least, largest) = densities.fold(range, |(lo, hi), v| (lo.min(*v), hi.max(*v)));
        let probes = volume
            .values
            .iter()
            .step_by(volume.values.len().div_ceil(PROBES).max(1));
        let mut solid: Vec<f32> = probes.copied().filter(|v| f64::from(*v) >= iso).collect();
        let median_solid = match solid.len() / 2 {
            0 => largest,
            middle => *solid.select_nth_unstable_by(middle, f32::total_cmp).1,
        };
        Self {
            iso,
            fill,
            median_solid: median_solid.into(),
            ramp: slope * voxel,
            voxel,
            rounding: ROUNDING * f64::from(least.abs().max(largest.abs())),
        }
    }

    /// The density of a voxel at the border of where matter may move: what was there and what came, each with its density in
    /// the scan and in the fit, have mixed as the field `now` says. None if it says something else.
    fn blended(&self, [stayed, was]: [f64; 2], [came, brought]: [f64; 2], now: f64) -> Option<f64> {
        if (now - was).abs() <= self.rounding {
            return Some(stayed);
        }
        let share = (now - was) / (brought - was);
        let off = (now - now.clamp(was.min(brought), was.max(brought))).abs();
        (off <= OFF * self.ramp && share.is_finite())
            .then(|| stayed + share.clamp(0.0, 1.0) * (came - stayed))
    }

    /// How many voxels outside of a surface a place lies, if the way up does lead to one: the wall of a lung is as steep as bone.
    fn beside(&self, field: &dyn Field, place: DVec3) -> Option<f64> {
        let (value, gradient) = field.value_gradient(place);
        let way = gradient.try_normalize()? * self.voxel;
        let ahead = |step: u32| field.value(place + BESIDE * f64::from(step) / 4.0 * way);
        let is_there = (1..=4).any(|step| ahead(step) >= self.iso);
        is_there.then(|| (self.iso - value) / (gradient.length() * self.voxel))
    }

    /// The new density of a voxel, if it has one: of what had `old` in the scan and `was` in its fit, so many voxels `beside` a surface,
    /// where the field is `now`. Changes up to `least` are none. Where brushes have passed that mix densities, all of the field's
    /// change is meant, up to the `most` that they met in the solid and outside of it.
    fn revised(
        &self,
        voxel: usize,
        old: f64,
        [was, now]: [f64; 2],
        (least, most): (f64, Option<[f64; 2]>),
        beside: impl Fn() -> Option<f64>,
        told: &mut VolumeRevision,
    ) -> Option<f64> {
        let change = now - was;
        if change.abs() <= least {
            return None;
        }
        let moved = old + change;
        // A tool's own density has no bounds far inside or outside of it; matter has.
        let raised = moved.min(self.median_solid.max(old));
        let lowered = moved.max(self.fill.min(old));
        if let Some([inside, outside]) = most {
            if was >= self.iso && now < self.iso && moved <= self.fill {
                told.emptied.push(voxel);
            }
            let most = if was >= self.iso { inside } else { outside };
            return Some(if change < 0.0 {
                lowered
            } else {
                raised.max(moved.min(most))
            });
        }
        Some(match (was >= self.iso, now >= self.iso) {
            (true, false) if change.abs() <= OFF * self.ramp => lowered,
            (true, false) => {
                told.emptied.push(voxel);
                let share = ((self.iso - now) / self.ramp).min(1.0);
                self.iso + share * (self.fill - self.iso)
            }
            // The waves that a tool leaves in coarse functions around it.
            (true, true) | (false, false) if change.abs() <= OFF * self.ramp => return None,
            (false, false) => {
                // Voxels from the surface that comes, or from the one that goes.
                let outside = match change > 0.0 {
                    true => (self.iso - now) / self.ramp,
                    false => beside()?,
                };
                let share = (BESIDE - outside).clamp(0.0, 1.0);
                let to = if change > 0.0 { raised } else { lowered };
                return (share > 0.0).then_some(old + share * (to - old));
            }
            // What was solid already is filled up where its fit shows less than that.
            (true, true) if change > 0.0 => {
                let most = self.median_solid;
                (old + now.min(most) - was.min(most)).min(most.max(old))
            }
            (false, true) => raised,
            // What stays solid keeps its density but for the voxel beside the new surface: a tool's field may rise much slower than matter does.
            (true, true) => {
                let depth = ((now - self.iso) / self.ramp).min(1.0);
                lowered.max(old.min(self.iso + depth * (old - self.iso)))
            }
        })
    }
}
