use bspline::{HierarchicalSpline, Real};
use dynamics::matter::{Matter, Quantity};
use dynamics::region::{Cells, Region, RegionOptions};
use glam::DVec3;

use super::ForceError;
use super::holding::Holding;
use super::target::Target;
use crate::paint::{self, Layers, Substance};

/// Samples at most this share of a radius apart: coarser ones show in the result.
const SPACINGS_PER_RADIUS: f64 = 1.5;
/// Samples per cell of the regions that are cut.
const SAMPLES_PER_CELL: f64 = 4.0 / 3.0;
/// Radii of a region beside the paths.
const ROOM: f64 = 4.0;
/// Knot intervals that the rim takes from a region.
const RIM: f64 = 0.58;
/// Levels by which a region may be finer than its tool asks for, where limits leave little room.
const FINER: usize = 2;
/// Mass and damping over `K/(λr)²` and `K/(λr²)`.
const MASS: f64 = 0.1;
const DAMPING: f64 = 1.0;

/// What a tool of a radius moves.
#[derive(Clone, Copy)]
pub struct Ground<'a, T> {
    pub field: &'a HierarchicalSpline<T>,
    /// What is painted on it.
    pub layers: &'a Layers,
    /// What may not move.
    pub holding: &'a Holding,
    pub radius: f64,
}

impl<T: Real> Ground<'_, T> {
    /// A region about paths, at rest, of matter that moves as wide as the tool is.
    pub fn cut(&self, targets: &[&Target]) -> Result<Region<T>, ForceError> {
        let mut matter = matter(self.field, self.radius);
        let mut level = level(self.field, self.radius)?;
        let cut = |level: usize| -> Result<Region<T>, ForceError> {
            let cells = about(self.field, level, targets, self.radius)?;
            let options = RegionOptions::of(self.field, level);
            Ok(self.holding.cut(self.field, cells, matter.clone(), &options)?)
        };
        let mut region = cut(level)?;
        // Narrow places move by narrow functions alone.
        for _ in 0..FINER {
            if self.holding.gives_way(self.field, &region, targets) {
                break;
            }
            level += 1;
            region = cut(level)?;
        }
        let [nx, ny, nz] = region.patch().lattice().sample_dims();
        let mut places = Vec::new();
        if !self.layers.is_empty() {
            let at = |i: usize| region.sample_position([i / nz / ny, i / nz % ny, i % nz]);
            places.extend((0..nx * ny * nz).map(at));
        }
        let mut is_painted = false;
        for (substance, quantity) in [
            (Substance::Stiffness, &mut matter.stiffness),
            (Substance::Mass, &mut matter.mass),
            (Substance::Damping, &mut matter.damping),
        ] {
            let factors = paint::values(self.layers, substance, &places);
            // Where there is no paint matter stays uniform, and its solver fast.
            let Some(factors) = factors.filter(|f| f.iter().any(|f| *f != 1.0)) else {
                continue;
            };
            let values = quantity.paint(factors.len()).iter_mut();
            values.zip(factors).for_each(|(value, factor)| *value *= factor);
            is_painted = true;
        }
        if is_painted {
            region.patch_mut().set_matter(matter)?;
        }
        Ok(region)
    }
}

/// The coarsest level whose samples are fine enough for a tool.
fn level<T: Real>(field: &HierarchicalSpline<T>, radius: f64) -> Result<usize, ForceError> {
    let spacing = field.lattice().spacing(0).max_element() / SAMPLES_PER_CELL;
    let level = (SPACINGS_PER_RADIUS * spacing / radius).log2().ceil().max(0.0);
    match level <= 16.0 {
        true => Ok(level as usize),
        false => Err(ForceError::tool(format!(
            "a radius of {radius} is too small for this field, whose coarsest knot intervals are {}; use a larger one",
            field.lattice().spacing(0).max_element()
        ))),
    }
}

/// Matter of stiffness 1 that moves as wide as the tool is.
fn matter<T: Real>(field: &HierarchicalSpline<T>, radius: f64) -> Matter {
    let stiffness = field.slope().powi(-2);
    Matter {
        mass: Quantity::Constant(MASS * stiffness / (radius * radius)),
        damping: Quantity::Constant(DAMPING * stiffness / (radius * radius)),
        ..Matter::default()
    }
}

/// Corners of the box about paths, in lattice coordinates.
fn bounds<T: Real>(field: &HierarchicalSpline<T>, targets: &[&Target]) -> [DVec3; 2] {
    let places = targets.iter().flat_map(|t| t.path.points());
    let local = places.map(|p| field.lattice_from_world().transform_point3(*p));
    local.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| {
        [low.min(p), high.max(p)]
    })
}

/// Cells about paths, with room on all sides.
fn about<T: Real>(
    field: &HierarchicalSpline<T>,
    level: usize,
    targets: &[&Target],
    radius: f64,
) -> Result<Cells, ForceError> {
    let [low, high] = bounds(field, targets);
    let spacing = field.lattice().spacing(0);
    let room = ROOM * radius + RIM * field.lattice().spacing(level).max_element();
    let middle = field
        .lattice()
        .world_from_lattice
        .transform_point3(0.5 * (low + high));
    let half = 0.5 * (high - low) * spacing + room;
    Ok(Cells::around(field, level, middle, half)?.widened(field)?)
}
