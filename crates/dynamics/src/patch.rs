//! A dynamic patch: a lattice, its matter and springs, and how they move.

use std::sync::Arc;

use bspline::Real;
use serde::{Deserialize, Serialize};

use crate::cache::Cache;
use crate::constraints::Held;
use crate::lattice::{Lattice, OnBox, SampleBox, TensorWorkspace};
use crate::matter::{Matter, Quantity, ScaledMatter};
pub use crate::patch_error::PatchError;
use crate::solve::{SolverOptions, StepSolver};
use crate::sparse::Mask;
use crate::springs::{Law, Neighbours, Plasticity, SpringNetwork, SpringWeights, StepMatrix, Weights};
use crate::units::largest;
use crate::version::Version;

/// Energies of a state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// `½ẇᵀMẇ` of the densities' velocities.
    pub kinetic: f64,
    /// Of the density springs.
    pub springs: f64,
    /// Of the ground springs.
    pub ground: f64,
    /// Of the constraint springs.
    pub constraints: f64,
}

impl Energy {
    /// Their sum.
    pub fn total(self) -> f64 {
        self.kinetic + self.springs + self.ground + self.constraints
    }
}

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

/// A region of a field that moves.
#[derive(Clone, Debug)]
pub struct Patch<T> {
    pub(crate) neighbours: Neighbours,
    pub(crate) matter: Matter,
    pub(crate) lumped: ScaledMatter<T>,
    pub(crate) network: SpringNetwork<T>,
    /// Whether the springs were set beside the matter.
    pub(crate) own_springs: bool,
    pub(crate) plasticity: Plasticity<T>,
    pub(crate) state: State<T>,
    /// Densities of the field the patch was cut from.
    pub(crate) base: Vec<T>,
    /// Where the ground springs rest.
    pub(crate) anchor: Vec<T>,
    pub(crate) external: Vec<T>,
    /// Where they are, if not 0.
    pub(crate) pushed: SampleBox,
    /// Largest of them.
    pub(crate) external_size: f64,
    pub(crate) held: Option<Box<Held<T>>>,
    /// Which samples and coefficients take part, if not all.
    pub(crate) mask: Option<Arc<Mask>>,
    pub(crate) cache: Cache<T>,
    pub(crate) work: Scratch<T>,
    pub(crate) workspace: TensorWorkspace<T>,
}

/// Vectors of a step.
#[derive(Clone, Debug)]
pub(crate) struct Scratch<T> {
    /// Impulse on the samples.
    pub g: Vec<T>,
    /// Forces on the samples, in `force_unit`.
    pub force: Vec<T>,
    pub force_unit: f64,
    /// Work of the external forces since the step began.
    pub work: f64,
    /// What the densities moved over an adaptive step.
    pub moved: Vec<f64>,
    pub x: Vec<T>,
    pub dx: Vec<T>,
    pub first_x: Vec<T>,
    pub first_dx: Vec<T>,
    pub before: State<T>,
}

impl<T: Real> Patch<T> {
    /// A patch at rest with the densities `d` at its samples.
    ///
    /// # Errors
    /// [`PatchError`] for densities, matter, scale or spacing that are refused.
    pub fn new(
        lattice: Lattice<T>,
        matter: Matter,
        law: Law,
        neighbours: Neighbours,
        d: &[T],
        options: SolverOptions,
    ) -> Result<Self, PatchError> {
        let (n, m) = (lattice.coefficient_count(), lattice.sample_count());
        finite("density", d, m)?;
        let scale = law.scale();
        if !(scale.is_finite() && scale > 0.0) {
            return Err(PatchError::Scale { scale });
        }
        let spacing = lattice.spacing();
        let cubic = spacing.iter().all(|h| (h / spacing[0] - 1.0).abs() < 1e-9);
        if neighbours != Neighbours::Six && !cubic {
            return Err(PatchError::NotCubic { spacing });
        }
        let (lumped, springs) = matter.in_units(&lattice, neighbours)?;
        let dims = lattice.sample_dims();
        let network = SpringNetwork::in_units(dims, spacing, law, &springs, d);
        let steps: Vec<_> = neighbours.directions().iter().map(|d| d.step).collect();
        let springs = network.springs().iter().map(|s| SpringWeights {
            direction: s.direction,
            weights: match law {
                Law::Linear { .. } => s.weights.clone(),
                Law::FourD { .. } => Weights::Each(vec![T::zero(); m]),
            },
        });
        let matrix = StepMatrix::new(dims, lumped.mass.weights.clone(), springs.collect());
        let zeros = |n: usize| vec![T::zero(); n];
        let state = State {
            p: zeros(n),
            v: zeros(n),
            d: d.to_vec(),
            w: zeros(m),
        };
        Ok(Self {
            neighbours,
            matter,
            lumped,
            network,
            plasticity: Plasticity::Elastic,
            base: d.to_vec(),
            anchor: d.to_vec(),
            own_springs: false,
            external: zeros(m),
            pushed: SampleBox::default(),
            external_size: 0.0,
            held: None,
            mask: None,
            cache: Cache::new(StepSolver::new(lattice, &steps, options), matrix),
            work: Scratch {
                g: zeros(m),
                force: zeros(m),
                force_unit: 1.0,
                work: 0.0,
                moved: Vec::new(),
                x: zeros(n),
                dx: zeros(m),
                first_x: zeros(n),
                first_dx: zeros(m),
                before: state.clone(),
            },
            state,
            workspace: TensorWorkspace::new(),
        })
    }

    /// The lattice.
    pub fn lattice(&self) -> &Lattice<T> {
        self.cache.solver.lattice()
    }

    /// How implicit steps are solved.
    pub fn solver_options(&self) -> SolverOptions {
        self.cache.solver.options()
    }

    /// Finishes at once a factor that is being made beside the steps: what some hundred steps would do.
    pub fn settle(&mut self) {
        self.cache.solver.settle();
    }

    /// Factors and cycles that implicit steps have made so far.
    pub fn factorizations(&self) -> usize {
        self.cache.solver.factorizations()
    }

    /// Where everything is and how fast it moves.
    pub fn state(&self) -> &State<T> {
        &self.state
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
        self.work.before.copy_from(&self.state);
        self.state.p.copy_from_slice(p);
        self.state.v.copy_from_slice(v);
        if let Some(mask) = &self.mask {
            mask.hold(&mut self.state.p);
            mask.hold(&mut self.state.v);
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
        let State { p, v, d, w } = &self.state;
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
        self.state.copy_from(&self.work.before);
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
        let (lattice, state) = (self.cache.solver.lattice(), &mut self.state);
        lattice.sample(&state.p, &mut state.d, &mut self.workspace);
        for (d, b) in state.d.iter_mut().zip(&self.base) {
            *d += *b;
        }
        lattice.sample(&state.v, &mut state.w, &mut self.workspace);
    }

    /// The matter.
    pub fn matter(&self) -> &Matter {
        &self.matter
    }

    /// Changes the matter, also while the patch moves. Costs a new factor or V-cycle at the next implicit step.
    ///
    /// # Errors
    /// [`PatchError::Matter`]; the old matter then stays.
    pub fn set_matter(&mut self, matter: Matter) -> Result<(), PatchError> {
        let masked = self.masked_matter(&matter);
        let (lumped, springs) = masked.in_units(self.cache.solver.lattice(), self.neighbours)?;
        drop(masked);
        self.lumped = lumped;
        self.matter = matter;
        self.network.set_springs(&springs);
        self.own_springs = false;
        self.cache.changes += 1;
        Ok(())
    }

    /// Replaces the stiffness of the springs, also while the patch moves: forces, the matrix of the steps and the bound of
    /// the explicit ones follow. It holds until the [matter](Self::set_matter) is set again.
    ///
    /// # Errors
    /// [`PatchError::Directions`] for other directions than those of the patch, [`PatchError::Matter`] for a list of
    /// another length and for numbers that are negative or not finite; the old springs then stay.
    pub fn set_springs(&mut self, springs: &[SpringWeights<f64>]) -> Result<(), PatchError> {
        self.check_springs(springs)?;
        let springs = self.masked_springs(springs);
        self.put_springs(&springs);
        Ok(())
    }

    pub(crate) fn check_springs(&self, springs: &[SpringWeights<f64>]) -> Result<(), PatchError> {
        let steps = |s: &[SpringWeights<f64>]| s.iter().map(|s| s.direction.step).collect::<Vec<_>>();
        let needed: Vec<_> = self.neighbours.directions().iter().map(|d| d.step).collect();
        let found = steps(springs);
        if found != needed {
            return Err(PatchError::Directions { found, needed });
        }
        for s in springs {
            let values = match &s.weights {
                Weights::Constant(v) => Quantity::Constant(*v),
                Weights::Each(v) => Quantity::PerSample(v.clone()),
            };
            values.check("spring stiffness", self.base.len(), true)?;
        }
        Ok(())
    }

    /// Springs that were checked, and are those of the mask.
    pub(crate) fn put_springs(&mut self, springs: &[SpringWeights<f64>]) {
        self.network.set_springs(springs);
        self.own_springs = true;
    }

    /// Counts all that the matrix of a step depends on.
    pub(crate) fn version(&self) -> Version {
        Version {
            changes: self.cache.changes + self.network.changes(),
            paints: self.cache.paints,
        }
    }

    /// Sets the external forces on the densities of the samples, which hold until they are set again.
    ///
    /// # Errors
    /// [`PatchError::Length`], [`PatchError::NotFinite`]; the old forces then stay.
    pub fn set_force(&mut self, force: &[T]) -> Result<(), PatchError> {
        finite("force", force, self.external.len())?;
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
        for row in self.pushed.rows(dims) {
            self.external[row..row + self.pushed.count[2]].fill(T::zero());
        }
        force.at.paste(&mut self.external, dims, force.values);
        if let Some(mask) = &self.mask {
            mask.cut(&mut self.external);
        }
        self.pushed = force.at;
        self.external_size = largest(force.values);
        Ok(())
    }

    /// Changes the external forces.
    pub(crate) fn write_force(&mut self, write: impl FnOnce(&mut [T])) {
        write(&mut self.external);
        if let Some(mask) = &self.mask {
            mask.cut(&mut self.external);
        }
        self.pushed = self.lattice().all_samples();
        self.external_size = largest(&self.external);
    }

    /// The springs and their rest state.
    pub fn springs(&self) -> &SpringNetwork<T> {
        &self.network
    }

    /// The springs, to change their rest state.
    pub fn springs_mut(&mut self) -> &mut SpringNetwork<T> {
        &mut self.network
    }

    /// Energies of the present state.
    pub fn energy(&mut self) -> Energy {
        self.work.force.fill(T::zero());
        let springs = self.network.add_forces(&self.state.d, &mut self.work.force);
        Energy {
            kinetic: self.kinetic(),
            springs: springs.energy,
            ground: self.ground_energy(),
            constraints: self.constraint_energy(),
        }
    }

    pub(crate) fn kinetic(&self) -> f64 {
        let w = &self.state.w;
        let terms = w.iter().enumerate();
        let sum: f64 = terms
            .map(|(i, w)| self.lumped.mass.at(i).as_f64() * w.as_f64() * w.as_f64())
            .sum();
        0.5 * self.lumped.mass.unit * sum
    }

    pub(crate) fn ground_energy(&self) -> f64 {
        if self.lumped.ground.unit == 0.0 {
            return 0.0;
        }
        let sigma2 = self.network.law().scale().powi(2);
        let away = self.state.d.iter().zip(&self.anchor).enumerate();
        let terms = away.map(|(i, (d, b))| self.lumped.ground.at(i).as_f64() * (*d - *b).as_f64().powi(2));
        0.5 * sigma2 * self.lumped.ground.unit * terms.sum::<f64>()
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
