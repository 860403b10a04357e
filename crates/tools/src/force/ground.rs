use bspline::{HierarchicalSpline, Real};
use dynamics::matter::{Matter, Quantity};
use dynamics::region::{Cells, MIN_CELLS, Region, RegionOptions};
use dynamics::springs::Weights;
use glam::DVec3;

use super::ForceError;
use super::target::Target;
use crate::face::Face;
use crate::paint::{self, Layers, Substance};

/// Samples at most this share of a radius apart: coarser ones show in the result.
const SPACINGS_PER_RADIUS: f64 = 1.5;
/// Samples per cell of the regions that are cut.
const SAMPLES_PER_CELL: f64 = 4.0 / 3.0;
/// Radii of a region beside the paths.
pub(super) const ROOM: f64 = 4.0;
/// Knot intervals that the rim takes from a region.
const RIM: f64 = 0.58;
/// Knot intervals from a face of the field's box within which so little can move that what moves a path there throws up what lies beside it.
const FACE: f64 = 1.9;
/// Mass and damping over `K/(λr)²` and `K/(λr²)`.
const MASS: f64 = 0.1;
const DAMPING: f64 = 1.0;

/// What a tool of a radius moves.
#[derive(Clone, Copy)]
pub struct Ground<'a, T> {
    pub field: &'a HierarchicalSpline<T>,
    /// What is painted on it.
    pub layers: &'a Layers,
    pub radius: f64,
    /// Radii that a tool in a hand may go before the region is too small.
    pub roam: f64,
}

impl<T: Real> Ground<'_, T> {
    /// A region about paths, at rest, of matter that moves as wide as the tool is.
    pub fn cut(&self, targets: &[&Target]) -> Result<Region<T>, ForceError> {
        let level = level(self.field, self.radius)?;
        let stride = stride(self.field, level, self.radius);
        let options = RegionOptions {
            stride,
            samples_per_cell: stride.map(|s| SAMPLES_PER_CELL / f64::from(s)),
            ..RegionOptions::of(self.field, level)
        };
        let cells = self.cells(level, stride, targets)?;
        let matter = matter(self.field, self.radius);
        let mut region = Region::new(self.field, cells, matter, &options)?;
        self.paint(&mut region)?;
        Ok(region)
    }

    /// The field with the change of a region, and one about other paths that goes on where it was.
    pub fn follow(
        &self,
        region: &Region<T>,
        targets: &[&Target],
    ) -> Result<(HierarchicalSpline<T>, Region<T>), ForceError> {
        let matter = matter(self.field, self.radius);
        let cells = self.cells(region.cells().level, region.stride(), targets)?;
        let (field, mut region) = region.moved(self.field, cells, matter)?;
        self.paint(&mut region)?;
        Ok((field, region))
    }

    /// Faces of the field's box so near a place that a region can hardly move it.
    pub fn faces_at(&self, region: &Region<T>, place: DVec3) -> impl Iterator<Item = Face> + use<T> {
        let local = self.field.lattice_from_world().transform_point3(place);
        let ends = [local, self.field.lattice().extent() - local];
        let knots = DVec3::from_array(region.stride().map(f64::from)) / (1u64 << region.cells().level) as f64;
        let is_near = move |face: &Face| ends[usize::from(face.is_last)][face.axis] < FACE * knots[face.axis];
        Face::ALL.into_iter().filter(is_near)
    }

    /// Whether a region reaches some radii beside a path, or to the border of the field.
    pub fn has_room(&self, region: &Region<T>, target: &Target, radii: f64) -> bool {
        let cells = region.cells();
        let lattice = self.field.lattice();
        let (spacing, limit) = (lattice.spacing(cells.level), lattice.cells_at(cells.level));
        let scale = (1u64 << cells.level) as f64;
        target.path.points().iter().all(|p| {
            let p = self.field.lattice_from_world().transform_point3(*p) * scale;
            (0..3).all(|a| {
                let (low, end) = (cells.first[a], cells.first[a] + cells.count[a]);
                let room = 0.999 * radii * self.radius / spacing[a] + RIM * f64::from(region.stride()[a]);
                (low == 0 || p[a] - f64::from(low) >= room)
                    && (end == limit[a] || f64::from(end) - p[a] >= room)
            })
        })
    }

    /// Gives a region the matter that is painted. Springs whose rest lengths are painted pull from then on.
    pub fn paint(&self, region: &mut Region<T>) -> Result<(), ForceError> {
        let mut matter = matter(self.field, self.radius);
        let [nx, ny, nz] = region.patch().lattice().sample_dims();
        let mut places = Vec::new();
        if !self.layers.is_empty() {
            let at = |i: usize| region.sample_position([i / nz / ny, i / nz % ny, i % nz]);
            places.extend((0..nx * ny * nz).map(at));
        }
        let mut rest = Quantity::Constant(1.0);
        for (substance, quantity) in [
            (Substance::Stiffness, &mut matter.stiffness),
            (Substance::Mass, &mut matter.mass),
            (Substance::Damping, &mut matter.damping),
            (Substance::RestLength, &mut rest),
        ] {
            let factors = paint::values(self.layers, substance, &places);
            // Where there is no paint matter stays uniform, and its solver fast.
            if let Some(factors) = factors.filter(|f| f.iter().any(|f| *f != 1.0)) {
                let values = quantity.paint(factors.len()).iter_mut();
                values.zip(factors).for_each(|(value, factor)| *value *= factor);
            }
        }
        if *region.patch().matter() != matter {
            region.patch_mut().set_matter(matter)?;
        }
        let scale = match rest {
            Quantity::Constant(_) => Weights::Constant(T::one()),
            Quantity::PerSample(all) => Weights::Each(all.into_iter().map(T::from_f64).collect()),
        };
        region.patch_mut().springs_mut().rest_mut().scale = scale;
        Ok(())
    }

    /// Cells about paths, with room on all sides.
    fn cells(&self, level: usize, stride: [u32; 3], targets: &[&Target]) -> Result<Cells, ForceError> {
        let [low, high] = bounds(self.field, targets);
        let lattice = self.field.lattice();
        let knots = lattice.spacing(level) * DVec3::from_array(stride.map(f64::from));
        let room = (ROOM + self.roam) * self.radius + RIM * knots.max_element();
        let middle = lattice.world_from_lattice.transform_point3(0.5 * (low + high));
        let half = 0.5 * (high - low) * lattice.spacing(0) + room;
        Ok(Cells::around(self.field, level, stride, middle, half)?.widened(self.field)?)
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

/// Share of the longest edge of a cell beyond which no knots lie apart: cubes keep theirs.
const LONGEST: f64 = 1.5;

/// Cells from knot to knot of a level: along an axis of cells that are shorter than others, as many as still are fine enough for a tool.
fn stride<T: Real>(field: &HierarchicalSpline<T>, level: usize, radius: f64) -> [u32; 3] {
    let longest = LONGEST * field.lattice().spacing(level).max_element();
    let most = longest.min(SAMPLES_PER_CELL * radius / SPACINGS_PER_RADIUS);
    let (spacing, cells) = (field.lattice().spacing(level), field.lattice().cells_at(level));
    std::array::from_fn(|a| {
        let fits = |n: &u32| cells[a].is_multiple_of(*n) && cells[a] / n >= MIN_CELLS;
        let is_fine = |n: &u32| f64::from(*n) * spacing[a] <= most && fits(n);
        [2, 4, 8].into_iter().take_while(is_fine).last().unwrap_or(1)
    })
}

/// Over what length the motion of such matter fades by `e` in a step of `dt`, as `1/m`.
pub(super) fn fading(radius: f64, dt: f64) -> f64 {
    (MASS / (dt * dt) + DAMPING / (2.0 * dt)).sqrt() / radius
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
