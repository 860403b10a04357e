//! The room of the state: where the samples are, how fast they move, what pushes them, and what they are counted from.

use bspline::Real;
use serde::{Deserialize, Serialize};

use super::{Patch, PatchError};
use crate::lattice::{OnBox, SampleBox};
use crate::units::largest;

/// The numbers that a state consists of: changes of the coefficients since the patch was made and their velocities,
/// with the densities and velocities of the samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State<T> {
    /// Change of the free coefficients.
    pub p: Vec<T>,
    /// Its rate.
    pub v: Vec<T>,
    /// Densities at the samples.
    pub d: Vec<T>,
    /// Their rates, `w = A v`.
    pub w: Vec<T>,
}

impl<T: Copy> State<T> {
    /// Overwrites this state by one of the same patch.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.p.copy_from_slice(&other.p);
        self.v.copy_from_slice(&other.v);
        self.d.copy_from_slice(&other.d);
        self.w.copy_from_slice(&other.w);
    }
}

/// The state, and what it is counted from and pushed by.
#[derive(Clone, Debug)]
pub(crate) struct Motion<T> {
    pub state: State<T>,
    /// Densities of the field the patch was cut from.
    pub base: Vec<T>,
    /// Where the ground springs rest.
    pub anchor: Vec<T>,
    pub external: Vec<T>,
    /// Where they are, if not 0.
    pub pushed: SampleBox,
    /// Largest of them.
    pub external_size: f64,
}

impl<T: Real> Motion<T> {
    /// At rest with the densities `d`, of which `n` coefficients are free to change.
    pub fn at(d: &[T], n: usize) -> Self {
        let zeros = |n: usize| vec![T::zero(); n];
        Self {
            state: State {
                p: zeros(n),
                v: zeros(n),
                d: d.to_vec(),
                w: zeros(d.len()),
            },
            base: d.to_vec(),
            anchor: d.to_vec(),
            external: zeros(d.len()),
            pushed: SampleBox::default(),
            external_size: 0.0,
        }
    }
}

impl<T: Real> Patch<T> {
    /// Where everything is and how fast it moves.
    pub fn state(&self) -> &State<T> {
        &self.motion.state
    }

    /// Puts the patch into a state given by changes of the coefficients and their rates, and from there by the least
    /// change onto its hard constraints. Coefficients that a [mask](Self::mask) holds stay 0.
    ///
    /// # Errors
    /// [`PatchError::Length`], [`PatchError::NotFinite`], [`PatchError::Overflow`]; the state is then the one before.
    pub fn set_state(&mut self, p: &[T], v: &[T]) -> Result<(), PatchError> {
        let n = self.lattice().coefficient_count();
        finite("coefficient", p, n)?;
        finite("velocity", v, n)?;
        self.cache.work.before.copy_from(&self.motion.state);
        self.motion.state.p.copy_from_slice(p);
        self.motion.state.v.copy_from_slice(v);
        if let Some(mask) = &self.material.mask {
            mask.hold(&mut self.motion.state.p);
            mask.hold(&mut self.motion.state.v);
        }
        self.sample_state();
        self.meet_constraints();
        self.keep_if_finite()
    }

    /// Goes back to the state before if this one is not finite.
    ///
    /// # Errors
    /// [`PatchError::Overflow`].
    pub(crate) fn keep_if_finite(&mut self) -> Result<(), PatchError> {
        let State { p, v, d, w } = &self.motion.state;
        let lists = [
            ("coefficient", p),
            ("velocity of coefficient", v),
            ("density", d),
            ("velocity of sample", w),
        ];
        let wrong = lists.iter().find_map(|(what, list)| {
            let index = first_not_finite(list)?;
            Some((*what, index, list[index].as_f64()))
        });
        let Some((what, index, value)) = wrong else {
            return Ok(());
        };
        self.motion.state.copy_from(&self.cache.work.before);
        Err(PatchError::Overflow {
            what,
            index,
            value,
            precision: match T::NAME {
                "f32" => "single precision",
                _ => "double precision",
            },
        })
    }

    /// Densities and rates of the samples from the coefficients.
    pub(crate) fn sample_state(&mut self) {
        let (lattice, state) = (self.cache.solver.lattice(), &mut self.motion.state);
        lattice.sample(&state.p, &mut state.d, &mut self.cache.workspace);
        for (d, b) in state.d.iter_mut().zip(&self.motion.base) {
            *d += *b;
        }
        lattice.sample(&state.v, &mut state.w, &mut self.cache.workspace);
    }

    /// Sets the external forces on the densities of the samples, which hold until they are set again.
    ///
    /// # Errors
    /// [`PatchError::Length`], [`PatchError::NotFinite`]; the old forces then stay.
    pub fn set_force(&mut self, force: &[T]) -> Result<(), PatchError> {
        finite("force", force, self.motion.external.len())?;
        self.write_force(|external| external.copy_from_slice(force));
        Ok(())
    }

    /// The same of forces on a box of samples, all others none, at the cost of the box and the one before.
    ///
    /// # Errors
    /// [`PatchError::Box`], [`PatchError::Length`], [`PatchError::NotFinite`]; the old forces then stay.
    pub fn set_force_on(&mut self, force: OnBox<T>) -> Result<(), PatchError> {
        self.check_load(&force)?;
        let dims = self.lattice().sample_dims();
        for row in self.motion.pushed.rows(dims) {
            self.motion.external[row..row + self.motion.pushed.count[2]].fill(T::zero());
        }
        force.at.paste(&mut self.motion.external, dims, force.values);
        if let Some(mask) = &self.material.mask {
            mask.cut(&mut self.motion.external);
        }
        self.motion.pushed = force.at;
        self.motion.external_size = largest(force.values);
        Ok(())
    }

    /// Changes the external forces.
    pub(crate) fn write_force(&mut self, write: impl FnOnce(&mut [T])) {
        write(&mut self.motion.external);
        if let Some(mask) = &self.material.mask {
            mask.cut(&mut self.motion.external);
        }
        self.motion.pushed = self.lattice().all_samples();
        self.motion.external_size = largest(&self.motion.external);
    }
}

/// Place of the first number that is not finite.
fn first_not_finite<T: Real>(list: &[T]) -> Option<usize> {
    // Whole chunks at a time: a loop that may end at any number is not vectorized.
    let fine = |chunk: &[T]| chunk.iter().fold(true, |fine, v| fine & v.is_finite());
    let chunk = list.chunks(256).position(|c| !fine(c))?;
    let inside = list[256 * chunk..].iter().position(|v| !v.is_finite())?;
    Some(256 * chunk + inside)
}

/// Refuses lists of the wrong length or with NaN or infinity.
pub(crate) fn finite<T: Real>(what: &'static str, list: &[T], needed: usize) -> Result<(), PatchError> {
    if list.len() != needed {
        return Err(PatchError::Length {
            what: match what {
                "density" => "densities",
                "force" => "forces",
                "velocity" => "velocities",
                "weight" => "weights",
                _ => "coefficients",
            },
            found: list.len(),
            needed,
        });
    }
    match first_not_finite(list) {
        Some(index) => Err(PatchError::NotFinite {
            what,
            index,
            value: list[index].as_f64(),
        }),
        None => Ok(()),
    }
}
