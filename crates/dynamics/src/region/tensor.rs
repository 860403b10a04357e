//! A tensor-product patch with knots of its own as a dynamic patch.

use bspline::tensor::TensorSpline;
use bspline::{Field, Real};
use glam::{DAffine3, DVec3};

use super::{RegionError, cells, perpendicular};
use crate::integrators::{Integrator, StepReport};
use crate::lattice::{Axis, Lattice, Rim};
use crate::matter::Matter;
use crate::patch::{Patch, PatchError};
use crate::snapshot::PatchSnapshot;
use crate::solve::SolverOptions;
use crate::springs::{Law, Neighbours};

/// How a tensor-product patch is sampled and solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TensorOptions {
    /// Samples on each axis, equally spaced in the parameter, both ends included; at least as many as free coefficients,
    /// one in the support of each.
    pub samples: [usize; 3],
    /// Whether the outer coefficients stay: as many layers as the degree, so that all continuous derivatives do.
    pub rim: Rim,
    /// Force law and scale of densities.
    pub law: Law,
    /// Which samples are joined; other than six need samples at the same distance on all axes.
    pub neighbours: Neighbours,
    /// Of the implicit steps.
    pub solver: SolverOptions,
}

/// A [`TensorSpline`] that moves: all of it, on its own knots, nonuniform and clamped ones too.
#[derive(Clone, Debug)]
pub struct TensorRegion<T> {
    field: TensorSpline<T>,
    patch: Patch<T>,
}

impl<T: Real> TensorRegion<T> {
    /// The patch at rest; lengths are those of the world.
    ///
    /// # Errors
    /// [`RegionError::Lattice`] if the samples do not determine the coefficients, [`RegionError::Sheared`],
    /// [`RegionError::TooLarge`], [`RegionError::Patch`].
    pub fn new(
        field: &TensorSpline<T>,
        matter: Matter,
        options: &TensorOptions,
    ) -> Result<Self, RegionError> {
        let map = field.world_from_parameter().matrix3;
        perpendicular(&map)?;
        cells::size("samples", options.samples.map(|n| n as u64))?;
        cells::size("coefficients", field.shape().map(|n| n as u64))?;
        let axis = |a: usize| {
            let knots = field.knots()[a].clone();
            let [start, end] = knots.domain();
            let length = (end - start) * map.col(a).length();
            Axis::new(a, knots, options.rim, options.samples[a], length)
        };
        let lattice = Lattice::<T>::new([axis(0)?, axis(1)?, axis(2)?]);
        let d = densities(field, &lattice);
        let (law, neighbours) = (options.law, options.neighbours);
        let patch = Patch::new(lattice, matter, law, neighbours, &d, options.solver)?;
        Ok(Self {
            field: field.clone(),
            patch,
        })
    }

    /// The region of `field` that moves as a [snapshot](Patch::snapshot) of its patch says.
    ///
    /// # Errors
    /// [`RegionError::Patch`] of a snapshot that is damaged or of another spline.
    pub fn restore(field: &TensorSpline<T>, snapshot: &PatchSnapshot<T>) -> Result<Self, RegionError> {
        cells::size("samples", snapshot.samples())?;
        let patch = Patch::restore(snapshot)?;
        let knots = |a: usize| patch.lattice().axes()[a].knots() == &field.knots()[a];
        if !(0..3).all(knots) {
            let what = "it is of a spline on other knots".to_owned();
            return Err(PatchError::Snapshot { what }.into());
        }
        Ok(Self {
            field: field.clone(),
            patch,
        })
    }

    /// The patch.
    pub fn patch(&self) -> &Patch<T> {
        &self.patch
    }

    /// The patch, to change its matter, forces, rest or state.
    pub fn patch_mut(&mut self) -> &mut Patch<T> {
        &mut self.patch
    }

    /// Where sample `(i, j, k)` lies in the world.
    pub fn sample_position(&self, ijk: [usize; 3]) -> DVec3 {
        sample_position(&self.field, self.patch.lattice(), ijk)
    }

    /// Parameters to world.
    pub fn world_from_parameter(&self) -> &DAffine3 {
        self.field.world_from_parameter()
    }

    /// Moves the patch by `dt` seconds.
    ///
    /// # Errors
    /// [`PatchError`]; the state is then the one before.
    pub fn step(&mut self, integrator: Integrator, dt: f64) -> Result<StepReport, PatchError> {
        self.patch.step(integrator, dt)
    }

    /// The spline with the change since the region was made or last [let go](Self::release_clay) added, on the same
    /// knots. The one it was made from is how that is undone, to the bit.
    ///
    /// # Errors
    /// [`RegionError::Tensor`] if a coefficient is not finite.
    pub fn bake(&self) -> Result<TensorSpline<T>, RegionError> {
        let lattice = self.patch.lattice();
        let first = lattice.axes().each_ref().map(Axis::first_free);
        let [_, fy, fz] = lattice.coefficient_dims();
        let [_, ny, nz] = self.field.shape();
        let mut coefficients = self.field.coefficients().to_vec();
        for (i, p) in self.patch.state().p.iter().enumerate() {
            let [x, y, z] = [i / fz / fy, i / fz % fy, i % fz];
            coefficients[((x + first[0]) * ny + y + first[1]) * nz + z + first[2]] += *p;
        }
        Ok(self.field.with_coefficients(coefficients)?)
    }

    /// Lets clay go: bakes it, and makes the present shape the rest; velocity := 0, force := 0. Later steps change no bit.
    /// It is then, to the bit, the region of the spline returned with this matter and plasticity.
    ///
    /// # Errors
    /// As [`Self::bake`]; nothing has changed then.
    pub fn release_clay(&mut self) -> Result<TensorSpline<T>, RegionError> {
        self.field = self.bake()?;
        self.patch.rest_at(densities(&self.field, self.patch.lattice()));
        Ok(self.field.clone())
    }
}

fn sample_position<T: Real>(field: &TensorSpline<T>, lattice: &Lattice<T>, ijk: [usize; 3]) -> DVec3 {
    let q = std::array::from_fn(|a| lattice.axes()[a].parameter(ijk[a]));
    field
        .world_from_parameter()
        .transform_point3(DVec3::from_array(q))
}

/// Values of the field at the samples.
fn densities<T: Real>(field: &TensorSpline<T>, lattice: &Lattice<T>) -> Vec<T> {
    let [_, my, mz] = lattice.sample_dims();
    let at = |i: usize| sample_position(field, lattice, [i / mz / my, i / mz % my, i % mz]);
    let count = lattice.sample_count();
    (0..count).map(|i| T::from_f64(field.value(at(i)))).collect()
}
