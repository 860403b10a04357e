//! Where a scene takes place: cells of the field, and its samples.

use bspline::{Aabb, HierarchicalSpline, Real};
use dynamics::matter::Matter;
use dynamics::region::{Cells, Region, RegionOptions, Thresholds};
use dynamics::springs::{Law, Neighbours};
use glam::DVec3;

use super::error::{SimulateError, wrong};
use super::script::{LawKind, RegionTable, Scene};

/// Of a pull: samples lie at most this share of its radius apart, or its kernel is not resolved.
const SPACINGS_PER_RADIUS: f64 = 1.5;

/// The samples of a region when it was cut out.
#[derive(Clone, Debug)]
pub struct Samples {
    /// Along each axis.
    pub dims: [usize; 3],
    /// World places, z fastest.
    pub positions: Vec<DVec3>,
    /// Densities of the field.
    pub densities: Vec<f64>,
    /// Unit vectors of the axes.
    axes: [DVec3; 3],
}

impl Samples {
    /// The samples of `region`.
    pub fn of<T: Real>(region: &Region<T>) -> Self {
        let dims = region.patch().lattice().sample_dims();
        let [nx, ny, nz] = dims;
        let mut positions = Vec::with_capacity(nx * ny * nz);
        for i in 0..nx {
            for j in 0..ny {
                positions.extend((0..nz).map(|k| region.sample_position([i, j, k])));
            }
        }
        let origin = positions[0];
        let axis = |ijk| (region.sample_position(ijk) - origin).normalize();
        Self {
            dims,
            densities: region.patch().state().d.iter().map(|d| d.as_f64()).collect(),
            axes: [axis([1, 0, 0]), axis([0, 1, 0]), axis([0, 0, 1])],
            positions,
        }
    }

    /// Lengths along the axes from the first sample.
    pub fn local(&self, p: DVec3) -> [f64; 3] {
        self.axes.map(|a| a.dot(p - self.positions[0]))
    }

    /// The place in the world of such lengths.
    pub fn world(&self, local: [f64; 3]) -> DVec3 {
        (0..3).fold(self.positions[0], |p, a| p + local[a] * self.axes[a])
    }

    /// Whether a place lies in the region.
    pub fn contains(&self, p: DVec3) -> bool {
        let last = self.positions.last().map_or([0.0; 3], |l| self.local(*l));
        let at = self.local(p);
        (0..3).all(|a| (-1e-9 * last[a]..=last[a] * (1.0 + 1e-9)).contains(&at[a]))
    }
}

/// Cuts the region of a scene out of a field; with what has to be told of it.
pub fn cut<T: Real>(
    scene: &Scene,
    field: &HierarchicalSpline<T>,
    notes: &mut Vec<String>,
) -> Result<Region<T>, SimulateError> {
    let level = level(scene, field)?;
    let asked = cells(&scene.region, field, level)?;
    let cells = asked.widened(field).map_err(|e| wrong("[region]", e))?;
    if cells != asked {
        notes.push(format!(
            "the region was widened to cells {:?} to {:?} of level {level}, where the field had no coefficients of that level",
            cells.first,
            [0, 1, 2].map(|a| cells.first[a] + cells.count[a])
        ));
    }
    let mut options = RegionOptions::of(field, level);
    if let Some(samples) = scene.region.samples_per_cell {
        options.samples_per_cell = samples.0;
    }
    let scale = scene.law.scale.map_or(1.0 / field.slope(), |s| s.0);
    options.law = match scene.law.kind {
        LawKind::Linear => Law::Linear { scale },
        LawKind::FourD => Law::FourD { scale },
    };
    options.neighbours = match (scene.law.neighbours, scene.law.kind) {
        (Some(6), _) | (None, LawKind::Linear) => Neighbours::Six,
        (Some(18), _) | (None, LawKind::FourD) => Neighbours::Eighteen,
        (Some(26), _) => Neighbours::TwentySix,
        (Some(n), _) => {
            return Err(wrong(
                "[law] neighbours",
                format!("a sample cannot have {n} neighbours; write 6, 18 or 26"),
            ));
        }
    };
    let Thresholds { speed, acceleration } = options.sleep;
    options.sleep = Thresholds {
        speed: scene.sleep.speed.map_or(speed, |s| s.0),
        acceleration: scene.sleep.acceleration.map_or(acceleration, |a| a.0),
    };
    let Some(mask) = &scene.region.mask else {
        return Region::new(field, cells, Matter::default(), &options).map_err(|e| wrong("[region]", e));
    };
    let region = mask.cut(field, cells, &options)?;
    let parts = region.mask_parts().len();
    if parts > 1 {
        notes.push(format!(
            "the mask falls into {parts} parts, each of which moves on its own"
        ));
    }
    Ok(region)
}

/// The level asked for, or the coarsest that resolves the smallest pull.
fn level<T: Real>(scene: &Scene, field: &HierarchicalSpline<T>) -> Result<usize, SimulateError> {
    if let Some(level) = scene.region.level {
        return Ok(usize::from(level));
    }
    let per_cell = scene.region.samples_per_cell.map_or([4.0 / 3.0; 3], |s| s.0);
    let radius = scene
        .pull
        .iter()
        .map(|p| p.radius.0)
        .fold(f64::INFINITY, f64::min);
    if radius == f64::INFINITY {
        return Err(wrong(
            "[region] level",
            "is missing, and there is no pull whose radius would tell how fine the region has to be; write level = 0 to 16",
        ));
    }
    let spacing = field.lattice().spacing(0) / DVec3::from_array(per_cell);
    let level = (SPACINGS_PER_RADIUS * spacing.max_element() / radius)
        .log2()
        .ceil()
        .max(0.0);
    if level > 16.0 {
        return Err(wrong(
            "[region] level",
            format!(
                "a pull of radius {radius} needs level {level}; make the pull wider, or write a level of at most 16"
            ),
        ));
    }
    Ok(level as usize)
}

/// The cells of the box, whole ones.
fn cells<T: Real>(
    table: &RegionTable,
    field: &HierarchicalSpline<T>,
    level: usize,
) -> Result<Cells, SimulateError> {
    match (table.min, table.max, table.first, table.count) {
        (None, None, Some(first), Some(count)) => Ok(Cells { level, first, count }),
        (Some(min), Some(max), None, None) => {
            let (min, max) = (min.0, max.0);
            if !min.cmplt(max).all() {
                return Err(wrong(
                    "[region]",
                    format!("min {min} has to lie below max {max} on every axis"),
                ));
            }
            let scale = (1u64 << level.min(62)) as f64;
            let b = Aabb { min, max }.transformed(field.lattice_from_world());
            let limit = field.lattice().extent();
            let slack = 1e-9 * limit;
            if b.min.cmplt(-slack).any() || b.max.cmpgt(limit + slack).any() {
                let world = field.lattice().world_box();
                return Err(wrong(
                    "[region]",
                    format!(
                        "the box {min} to {max} lies partly outside the field, which reaches from {} to {}; make it smaller",
                        world.min, world.max
                    ),
                ));
            }
            // Borders that are meant to lie on cells may miss them by rounding.
            let first = (b.min * scale + 1e-6).floor().max(DVec3::ZERO);
            let end = (b.max * scale - 1e-6).ceil().min(limit * scale);
            let whole = |v: DVec3| v.to_array().map(|c| c as u32);
            let mut cells = Cells {
                level,
                first: whole(first),
                count: whole(end - first),
            };
            if table.samples_per_cell.is_none() {
                thirds(&mut cells, whole(limit * scale));
            }
            Ok(cells)
        }
        _ => Err(wrong(
            "[region]",
            "give either min and max (in the world) or first and count (cells of a level)",
        )),
    }
}

/// Takes in up to two cells more on an axis, at the end first, so that their number is a multiple of three and samples,
/// 4/3 a cell, lie as far apart on every axis.
fn thirds(cells: &mut Cells, limit: [u32; 3]) {
    for (axis, limit) in limit.into_iter().enumerate() {
        let (first, count) = (&mut cells.first[axis], &mut cells.count[axis]);
        let missing = (3 - *count % 3) % 3;
        let behind = missing.min(limit.saturating_sub(*first + *count));
        let before = (missing - behind).min(*first);
        *first -= before;
        *count += behind + before;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_grow_to_thirds_within_the_field() {
        let mut cells = Cells {
            level: 0,
            first: [4, 4, 0],
            count: [7, 9, 8],
        };
        thirds(&mut cells, [12, 13, 8]);
        assert_eq!((cells.first, cells.count), ([3, 4, 0], [9, 9, 8]));
    }
}
