//! Regions: a box of cells of a hierarchical field becomes a dynamic patch, and its change is baked back.
//!
//! The free coefficients are those of the level's functions whose support lies inside the box; the three layers round
//! them stay, so that the field is C² across the rim and keeps its bits beside the box. Baking adds the changes on the
//! same knots: nothing is approximated. Levels finer than the region's keep their corrections: their detail stays where
//! it is in space and rides on the changed values, it is not carried along with a moving surface.
//!
//! ```
//! use std::collections::BTreeMap;
//! use bspline::{Field, HierarchicalSpline, hierarchical::Lattice};
//! use dynamics::{integrators::Integrator, matter::Matter, region::{Cells, Region, RegionOptions}};
//!
//! let lattice = Lattice { world_from_lattice: glam::DAffine3::IDENTITY, cells: [12; 3] };
//! let field = HierarchicalSpline::<f32>::from_corrections(lattice, 1.0, vec![BTreeMap::new()]);
//! let cells = Cells { level: 0, first: [1; 3], count: [10; 3] };
//! let mut region = Region::new(&field, cells, Matter::default(), &RegionOptions::of(&field, 0))?;
//! let [nx, ny, nz] = region.patch().lattice().sample_dims();
//! let mut force = vec![0.0; nx * ny * nz];
//! force[(nx / 2 * ny + ny / 2) * nz + nz / 2] = 1.0;
//! region.set_force(&force)?;
//! region.step(Integrator::TrBdf2, 0.1)?;
//! let pulled = region.release_clay(&field)?;
//! assert!(pulled.value(glam::DVec3::splat(6.0)) > 0.0);
//! assert_eq!(field.value(glam::DVec3::splat(6.0)), 0.0); // undo: the old version
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cells;
mod change;
mod error;
mod mask;
mod moved;
mod parts;
mod scene;
mod sleep;
mod snapshot;
mod strides;
mod tensor;
mod watch;
mod window;

pub use cells::{Cells, MAX_EDGE, MAX_SIZE, MIN_CELLS};
pub use change::{Change, Viewer};
pub use error::RegionError;
pub use mask::RegionMask;
pub use scene::Scene;
pub use sleep::{Schedule, Thresholds, Turn};
pub use snapshot::RegionSnapshot;
pub use tensor::{TensorOptions, TensorRegion};

use bspline::hierarchical::{BlockEdit, Change::Add, EditError, Lattice as FieldLattice, LevelEdit};
use bspline::{Field, Frame, HierarchicalSpline, KnotVector, Real};
use glam::{DAffine3, DMat3, DVec3};

use crate::integrators::{Integrator, StepReport};
use crate::lattice::{Axis, Lattice, LatticeError, OnBox, Rim, SampleBox};
use crate::matter::Matter;
use crate::patch::{Patch, PatchError};
use crate::response::{Against, Response};
use crate::solve::SolverOptions;
use crate::springs::{Law, Neighbours};

/// Cosine between two axes of a field up to which they count as perpendicular: springs are then too long or short by
/// half of it at most, and direction cosines in files are rounded to about this.
const PERPENDICULAR: f64 = 1e-4;

/// How a region is sampled and solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionOptions {
    /// Cells from one knot of the region to the next on each axis: 1, 2, 4 or 8. Where cells are not cubic the fine axes need no
    /// more knots than the coarse one.
    pub stride: [u32; 3],
    /// Samples per cell on each axis; both ends of the region get one. Of cells that are not cubic, numbers in the ratio
    /// of the edges make the samples cubic.
    pub samples_per_cell: [f64; 3],
    /// Force law and scale of densities.
    pub law: Law,
    /// Which samples are joined; other than six need samples at the same distance on all axes.
    pub neighbours: Neighbours,
    /// Of the implicit steps.
    pub solver: SolverOptions,
    /// When the region falls asleep and wakes.
    pub sleep: Thresholds,
}

impl RegionOptions {
    /// Linear springs to six neighbours, the scale of densities from the slope of the field, knots at each cell, 4/3 samples per cell, asleep
    /// below a thousandth of a cell of `level` per second and per second squared.
    pub fn of<T: Real>(field: &HierarchicalSpline<T>, level: usize) -> Self {
        let cell = field.lattice().spacing(level.min(62)).min_element();
        Self {
            stride: [1; 3],
            samples_per_cell: [4.0 / 3.0; 3],
            law: Law::Linear {
                scale: 1.0 / field.slope(),
            },
            neighbours: Neighbours::Six,
            solver: SolverOptions::default(),
            sleep: Thresholds {
                speed: 1e-3 * cell,
                acceleration: 1e-3 * cell,
            },
        }
    }
}

/// A part of a hierarchical field that moves.
#[derive(Clone, Debug)]
pub struct Region<T> {
    cells: Cells,
    field_lattice: FieldLattice,
    stride: [u32; 3],
    samples_per_cell: [f64; 3],
    /// Coefficients of the free functions in the field that the region was cut from.
    origin: Vec<T>,
    patch: Patch<T>,
    thresholds: Thresholds,
    asleep: bool,
    parts: parts::Parts,
    part: Option<Box<parts::Part<T>>>,
}

impl<T: Real> Region<T> {
    /// Cuts a region out of `field`, at rest and asleep.
    ///
    /// Its densities are those of the field itself, finer levels included, at equally spaced samples; lengths are those of
    /// the world.
    ///
    /// # Errors
    /// Any [`RegionError`] but `OtherLattice`.
    pub fn new(
        field: &HierarchicalSpline<T>,
        cells: Cells,
        matter: Matter,
        options: &RegionOptions,
    ) -> Result<Self, RegionError> {
        cells.check(field)?;
        strides::check(&cells, options.stride)?;
        spills(field, &cells)?;
        let map = field.lattice().world_from_lattice;
        perpendicular(&map.matrix3)?;
        let mut samples = [0u64; 3];
        for axis in 0..3 {
            let value = options.samples_per_cell[axis];
            if !(value.is_finite() && value > 0.0) {
                return Err(RegionError::SamplesPerCell { axis, value });
            }
            // Saturates far above what is allowed.
            samples[axis] = ((f64::from(cells.count[axis]) * value).round() as u64).saturating_add(1);
        }
        cells::size("samples", samples)?;
        let spacing = field.lattice().spacing(cells.level);
        let axis = |a: usize| {
            let (first, count) = (f64::from(cells.first[a]), cells.count[a]);
            let end = first + f64::from(count);
            let intervals = (count / options.stride[a]) as usize;
            let knots = KnotVector::uniform(3, intervals, first, end).map_err(LatticeError::from)?;
            Axis::new(
                a,
                knots,
                Rim::Fixed,
                samples[a] as usize,
                f64::from(count) * spacing[a],
            )
        };
        let lattice = Lattice::<T>::new([axis(0)?, axis(1)?, axis(2)?]);
        let d = densities(field, &cells, samples);
        let patch = Patch::new(
            lattice,
            matter,
            options.law,
            options.neighbours,
            &d,
            options.solver,
        )?;
        Ok(Self {
            cells,
            field_lattice: *field.lattice(),
            stride: options.stride,
            samples_per_cell: options.samples_per_cell,
            origin: coefficients(field, &cells)?,
            patch,
            thresholds: options.sleep,
            asleep: true,
            parts: parts::Parts::default(),
            part: None,
        })
    }

    /// The cells.
    pub fn cells(&self) -> &Cells {
        &self.cells
    }

    /// Cells from one knot to the next.
    pub fn stride(&self) -> [u32; 3] {
        self.stride
    }

    /// The patch.
    pub fn patch(&self) -> &Patch<T> {
        &self.patch
    }

    /// The patch, to change its matter, rest or state; wakes the region.
    pub fn patch_mut(&mut self) -> &mut Patch<T> {
        self.wake();
        self.part = None;
        self.parts.forget();
        &mut self.patch
    }

    /// Where sample `(i, j, k)` lies in the world.
    pub fn sample_position(&self, ijk: [usize; 3]) -> DVec3 {
        let samples = self.patch.lattice().sample_dims().map(|n| n as u64);
        frame(&self.field_lattice, &self.cells, samples).node(ijk.map(|i| i as i64))
    }

    /// World lengths of a place from the first sample along the axes: how samples, constraints and responses of the
    /// [patch](Self::patch) are asked for.
    pub fn local(&self, p: DVec3) -> [f64; 3] {
        let lattice = self.patch.lattice();
        let samples = lattice.sample_dims().map(|n| n as u64);
        let grid = frame(&self.field_lattice, &self.cells, samples)
            .world_from_grid
            .inverse();
        (grid.transform_point3(p) * DVec3::from_array(lattice.spacing())).to_array()
    }

    /// The least box with all samples within `radius` of a place in the world, up to the `1e-4` that axes may be off the
    /// perpendicular; found without walking the others.
    pub fn samples_near(&self, p: DVec3, radius: f64) -> SampleBox {
        let slack = 1.0 + 2.0 * PERPENDICULAR;
        self.patch.lattice().samples_near(self.local(p), slack * radius)
    }

    /// As [`Patch::respond`]; does not wake the region, and answers for the whole of it.
    ///
    /// # Errors
    /// As there.
    pub fn respond(
        &mut self,
        integrator: Integrator,
        dt: f64,
        loads: &[OnBox<T>],
    ) -> Result<Vec<Response<T>>, PatchError> {
        self.patch.respond(integrator, dt, loads)
    }

    /// As [`Patch::respond_as_step`]; does not wake the region.
    ///
    /// # Errors
    /// As there.
    pub fn respond_as_step(
        &mut self,
        integrator: Integrator,
        dt: f64,
        load: &OnBox<T>,
    ) -> Result<Response<T>, PatchError> {
        self.patch.respond_as_step(integrator, dt, load)
    }

    /// As [`Patch::static_response`]; does not wake the region.
    ///
    /// # Errors
    /// As there.
    pub fn static_response(
        &mut self,
        against: Against,
        loads: &[OnBox<T>],
    ) -> Result<Vec<Response<T>>, PatchError> {
        self.patch.static_response(against, loads)
    }

    /// [`Patch::stiffness_near`] a place in the world.
    pub fn stiffness_near(&self, p: DVec3, radius: f64) -> Option<f64> {
        self.patch.stiffness_near(self.local(p), radius)
    }

    /// [`Patch::compliance_at`] a place in the world; does not wake the region.
    ///
    /// # Errors
    /// As there.
    pub fn compliance_at(&mut self, p: DVec3, radius: f64, against: Against) -> Result<f64, PatchError> {
        let at = self.local(p);
        self.patch.compliance_at(at, radius, against)
    }

    /// Moves the region by `dt` seconds; one that is asleep costs nothing and keeps its bits, and gives `None`.
    ///
    /// # Errors
    /// [`PatchError`]; the state is then the one before.
    pub fn step(&mut self, integrator: Integrator, dt: f64) -> Result<Option<StepReport>, PatchError> {
        if self.asleep {
            return Ok(None);
        }
        let report = self.step_parts(integrator, dt)?;
        self.rest_if_quiet();
        Ok(Some(report))
    }

    /// `onto` with the change of this region since it was cut, or last [released](Self::release_clay), added on the same
    /// knots.
    ///
    /// `onto` is the field that the region was cut from, or a version of it with other regions baked. It stays as it is,
    /// and keeping it is how baking is undone, to the bit. Beside the region every value keeps its bits. A field that has other
    /// coefficients there is refused, so that no change is baked twice.
    ///
    /// # Errors
    /// [`RegionError::OtherLattice`], [`RegionError::Changed`], [`RegionError::Spills`], [`RegionError::Edit`].
    pub fn bake(&self, onto: &HierarchicalSpline<T>) -> Result<HierarchicalSpline<T>, RegionError> {
        if *onto.lattice() != self.field_lattice {
            return Err(RegionError::OtherLattice);
        }
        spills(onto, &self.cells)?;
        if coefficients(onto, &self.cells)? != self.origin {
            return Err(RegionError::Changed);
        }
        // Function s of the level has the support s - 3 .. s + 1: the first inside is number first + 3.
        let first = self.cells.first.map(|f| f + 3);
        let shape @ [_, ny, nz] = self.cells.count.map(|c| c as usize - 3);
        let p = self.on_cells();
        let level = self.cells.level;
        if p.iter().all(|p| *p != T::zero()) {
            let change = Add(p.into_owned());
            return Ok(onto.edited_blocks(&[BlockEdit {
                level,
                first,
                shape,
                change,
            }])?);
        }
        // Functions that were not active, and that nothing moves, stay so.
        let function = |i: usize| {
            let ijk = [i / nz / ny, i / nz % ny, i % nz];
            std::array::from_fn(|a| first[a] + ijk[a] as u32)
        };
        let changed = p.iter().enumerate();
        let edits: Vec<LevelEdit<T>> = changed
            .filter(|(_, p)| **p != T::zero())
            .map(|(i, &delta)| LevelEdit {
                level,
                function: function(i),
                delta,
            })
            .collect();
        Ok(onto.edited(&edits)?)
    }

    /// Lets clay go: bakes it, and makes the present shape the rest. Rest := current, velocity := 0, force := 0, no
    /// constraints; the region sleeps. From then on it is, to the bit, the region that [`new`](Self::new) cuts out of the field
    /// returned with this matter, plasticity and choice of parts: nothing is left of the steps before, in densities or solvers. Factors
    /// that would come out the same are not made again.
    ///
    /// # Errors
    /// As [`Self::bake`]; nothing has changed then.
    pub fn release_clay(
        &mut self,
        onto: &HierarchicalSpline<T>,
    ) -> Result<HierarchicalSpline<T>, RegionError> {
        let baked = self.bake(onto)?;
        let samples = self.patch.lattice().sample_dims().map(|n| n as u64);
        self.origin = coefficients(&baked, &self.cells)?;
        self.patch.rest_at(densities(&baked, &self.cells, samples));
        self.part = None;
        self.parts.forget();
        self.asleep = true;
        Ok(baked)
    }

    /// Lets an elastic solid go: force := 0, and it swings back to its rest. What it was cut from is, to the bit, the shape
    /// that it returns to.
    pub fn release_elastic(&mut self) {
        let none = vec![T::zero(); self.patch.motion.external.len()];
        self.set_force(&none).expect("zeros, one per sample, are forces");
        self.wake();
    }
}

/// Refuses boxes whose baking would change roundings beside them.
fn spills<T: Real>(field: &HierarchicalSpline<T>, cells: &Cells) -> Result<(), RegionError> {
    match cells.spilled_brick(field) {
        Some((first, end)) => Err(RegionError::Spills {
            level: cells.level,
            first,
            end,
        }),
        None => Ok(()),
    }
}

/// Coefficients of the functions that are free in a box of cells.
fn coefficients<T: Real>(field: &HierarchicalSpline<T>, cells: &Cells) -> Result<Vec<T>, EditError> {
    let first = cells.first.map(|f| f + 3);
    field.level_coefficients(cells.level, first, cells.count.map(|c| c as usize - 3))
}

/// Refuses axes that are not perpendicular.
fn perpendicular(m: &DMat3) -> Result<(), RegionError> {
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::normalize);
    let cosine = [x.dot(y), y.dot(z), z.dot(x)].map(f64::abs);
    let cosine = cosine.into_iter().fold(0.0, f64::max);
    if cosine > PERPENDICULAR {
        return Err(RegionError::Sheared { cosine });
    }
    Ok(())
}

/// The samples of a region as the nodes of a frame.
fn frame(lattice: &FieldLattice, cells: &Cells, samples: [u64; 3]) -> Frame {
    let scale = 1.0 / (1u64 << cells.level) as f64;
    let first = DVec3::from_array(cells.first.map(f64::from)) * scale;
    let step = std::array::from_fn(|a| f64::from(cells.count[a]) * scale / (samples[a] - 1) as f64);
    let local = DAffine3 {
        matrix3: DMat3::from_diagonal(DVec3::from_array(step)),
        translation: first,
    };
    Frame {
        world_from_grid: lattice.world_from_lattice * local,
        cells: samples.map(|n| (n - 1) as u32),
    }
}

/// Values of the field at the samples.
fn densities<T: Real>(field: &HierarchicalSpline<T>, cells: &Cells, samples: [u64; 3]) -> Vec<T> {
    let frame = frame(field.lattice(), cells, samples);
    let count = samples.map(|n| n as usize);
    let mut values = vec![0.0; count.iter().product()];
    field.frame_values(&frame, [0; 3], count, &mut values);
    values.into_iter().map(T::from_f64).collect()
}
