//! A moving patch as a value that can be written down, and a patch that goes on from it with the same bits.

use bspline::{KnotVector, Real};
use serde::{Deserialize, Serialize};

use crate::constraints::{Constraint, Held};
use crate::lattice::{Axis, Lattice, LatticeError, Rim, SampleBox};
use crate::matter::Matter;
use crate::patch::{Patch, PatchError, State, finite};
use crate::patch::{Prepared, Version};
use crate::solve::{SolverHistory, SolverOptions};
use crate::sparse::MaskRecord;
use crate::springs::{Law, Neighbours, Plasticity, Rest, SpringWeights, StepMatrix, Weights};

/// All of a patch that later bits depend on: state, matter, and of the solvers what they were made for. Factors are not in
/// it; they come out the same when they are made again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PatchSnapshot<T> {
    precision: String,
    axes: [AxisRecord; 3],
    law: Law,
    neighbours: Neighbours,
    options: SolverOptions,
    matter: Matter,
    /// Springs that were set beside the matter.
    springs: Option<Vec<Weights<f64>>>,
    rest: Rest<T>,
    plasticity: Plasticity<T>,
    state: State<T>,
    base: Vec<T>,
    anchor: Vec<T>,
    external: Vec<T>,
    constraints: Vec<Constraint>,
    mask: Option<MaskRecord>,
    /// Damping, stiffness, unit and residual of [`Prepared`], as bits: some formats know no infinity.
    prepared: Option<[u64; 4]>,
    /// Where there was paint since.
    painted: Option<SampleBox>,
    solver: Option<SolverHistory<T>>,
    /// Bits of the damping in the matrix of explicit steps.
    mass_prepared: Option<u64>,
    mass_solver: Option<SolverHistory<T>>,
    /// Bits of the bound of explicit steps.
    limit: Option<u64>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct AxisRecord {
    degree: usize,
    knots: Vec<f64>,
    rim: Rim,
    samples: usize,
    spacing: f64,
}

impl AxisRecord {
    fn of(axis: &Axis) -> Self {
        Self {
            degree: axis.knots().degree(),
            knots: axis.knots().knots().to_vec(),
            rim: axis.rim(),
            samples: axis.sample_count(),
            spacing: axis.spacing(),
        }
    }

    fn axis(&self, number: usize) -> Result<Axis, LatticeError> {
        let knots = KnotVector::new(self.degree, self.knots.clone())?;
        Axis::with_spacing(number, knots, self.rim, self.samples, self.spacing)
    }
}

impl<T: Real> PatchSnapshot<T> {
    /// The lattice.
    ///
    /// # Errors
    /// [`LatticeError`] of a damaged snapshot.
    pub(crate) fn lattice(&self) -> Result<Lattice<T>, LatticeError> {
        let axis = |k: usize| self.axes[k].axis(k);
        Ok(Lattice::new([axis(0)?, axis(1)?, axis(2)?]))
    }

    /// Samples along each axis.
    pub(crate) fn samples(&self) -> [u64; 3] {
        self.axes.each_ref().map(|a| a.samples as u64)
    }
}

/// Why a snapshot is refused.
fn damaged(what: impl ToString) -> PatchError {
    PatchError::Snapshot {
        what: what.to_string(),
    }
}

impl<T: Real> Patch<T> {
    /// All that later bits depend on. Looking changes nothing.
    pub fn snapshot(&self) -> PatchSnapshot<T> {
        let (now, cache) = (self.version(), &self.cache);
        let springs = self.material.own_springs.then(|| self.exact_springs());
        let solver = cache.solver.history();
        // Constant material is prepared for anew after paint.
        let lags = |p: &Prepared| p.version.changes == now.changes && solver.is_some();
        let prepared = cache.prepared.filter(|p| p.version == now || lags(p));
        let mass_matrix = cache.mass_matrix.as_ref().filter(|m| m.0 == now);
        let bits = |p: Prepared| [p.damping, p.stiffness, p.unit, p.residual].map(f64::to_bits);
        PatchSnapshot {
            precision: T::NAME.to_owned(),
            axes: self.lattice().axes().each_ref().map(AxisRecord::of),
            law: self.material.network.law(),
            neighbours: self.material.neighbours,
            options: cache.solver.options(),
            matter: self.material.matter.clone(),
            springs: springs.map(|all| all.into_iter().map(|s| s.weights).collect()),
            rest: self.material.network.rest().clone(),
            plasticity: self.material.plasticity.clone(),
            state: self.motion.state.clone(),
            base: self.motion.base.clone(),
            anchor: self.motion.anchor.clone(),
            external: self.motion.external.clone(),
            constraints: self.constraints().to_vec(),
            mask: self.mask().map(MaskRecord::of),
            prepared: prepared.map(bits),
            painted: prepared.and_then(|p| (p.version != now).then_some(cache.painted_on)),
            solver,
            mass_prepared: mass_matrix.map(|m| m.1.to_bits()),
            mass_solver: cache.mass_solver.as_ref().and_then(|s| s.history()),
            limit: cache.limit.filter(|l| l.0 == now).map(|l| l.1.to_bits()),
        }
    }

    /// The patch that a snapshot is of. It goes on with the same bits; factors are made again at once, one that was being
    /// made up to where it was.
    ///
    /// # Errors
    /// [`PatchError`] of a snapshot that is damaged or of another precision.
    pub fn restore(snapshot: &PatchSnapshot<T>) -> Result<Self, PatchError> {
        let s = snapshot;
        if s.precision != T::NAME {
            return Err(damaged(format!(
                "it is of precision {}, not {}",
                s.precision,
                T::NAME
            )));
        }
        let lattice = s.lattice().map_err(damaged)?;
        let (n, m) = (lattice.coefficient_count(), lattice.sample_count());
        let mut patch = Self::new(lattice, s.matter.clone(), s.law, s.neighbours, &s.base, s.options)?;
        if let Some(mask) = &s.mask {
            let mask = mask.mask(patch.lattice(), s.neighbours)?;
            patch = patch.with_mask(mask)?;
        }
        if let Some(weights) = &s.springs {
            let directions = s.neighbours.directions();
            if weights.len() != directions.len() {
                return Err(damaged("springs of another number of directions"));
            }
            let springs = directions.into_iter().zip(weights);
            let springs = springs.map(|(direction, weights)| SpringWeights {
                direction,
                weights: weights.clone(),
            });
            let springs: Vec<_> = springs.collect();
            patch.check_springs(&springs)?;
            // They are those of the mask already.
            patch.put_springs(&springs);
        }
        let sizes = [(&s.state.p, n), (&s.state.v, n), (&s.state.d, m), (&s.state.w, m)];
        for (list, needed) in sizes.into_iter().chain([(&s.anchor, m), (&s.external, m)]) {
            finite("number", list, needed)?;
        }
        let directions = patch.material.network.rest().differences.len();
        if s.rest.differences.len() != directions {
            return Err(damaged("rest lengths of another number of directions"));
        }
        for list in &s.rest.differences {
            finite("rest length", list, m)?;
        }
        if let Weights::Each(scale) = &s.rest.scale {
            finite("rest scale", scale, m)?;
        }
        *patch.material.network.rest_mut() = s.rest.clone();
        patch.set_plasticity(s.plasticity.clone())?;
        patch.motion.state = s.state.clone();
        patch.motion.anchor.copy_from_slice(&s.anchor);
        patch.write_force(|external| external.copy_from_slice(&s.external));
        if !s.constraints.is_empty() {
            let sigma2 = s.law.scale().powi(2);
            let mask = patch.material.mask.as_deref();
            let held = Held::new(&s.constraints, patch.lattice(), &patch.motion.base, sigma2, mask)?;
            patch.cache.solver.set_border(Some(held.border(true)));
            patch.material.held = Some(Box::new(held));
        }
        patch.resume(s)?;
        Ok(patch)
    }

    fn resume(&mut self, s: &PatchSnapshot<T>) -> Result<(), PatchError> {
        let now = self.version();
        let fits = |history: &SolverHistory<T>, like: &StepMatrix<T>| match history.fits(like) {
            true => Ok(()),
            false => Err(damaged("a matrix of another size")),
        };
        let cache = &mut self.cache;
        if let Some(history) = &s.solver {
            fits(history, &cache.matrix)?;
            cache.solver.resume(history, &cache.matrix)?;
        }
        cache.limit = s.limit.map(|l| (now, f64::from_bits(l)));
        if let Some(bits) = s.prepared {
            let [damping, stiffness, unit, residual] = bits.map(f64::from_bits);
            if s.solver.is_none() {
                // Of constant material.
                self.fill_matrix(damping, stiffness, unit);
                self.cache.solver.prepare(&self.cache.matrix)?;
            }
            let paints = match s.painted {
                Some(at) if !at.fits(self.lattice().sample_dims()) => {
                    return Err(damaged("paint beside the samples"));
                }
                Some(at) => {
                    self.cache.painted_on = at;
                    u64::MAX
                }
                None => now.paints,
            };
            self.cache.prepared = Some(Prepared {
                version: Version { paints, ..now },
                damping,
                stiffness,
                unit,
                residual,
            });
        }
        if s.mass_prepared.is_none() && s.mass_solver.is_none() {
            return Ok(());
        }
        let damping = s.mass_prepared.map(f64::from_bits);
        let matrix = self.mass_matrix(damping.unwrap_or(0.0));
        let mut solver = self.mass_solver();
        if let (Some(held), Some(_)) = (&self.material.held, damping) {
            solver.set_border(Some(held.border(false)));
        }
        match &s.mass_solver {
            Some(history) => {
                fits(history, &matrix)?;
                solver.resume(history, &matrix)?;
            }
            None => solver.prepare(&matrix)?,
        }
        self.cache.mass_solver = Some(solver);
        self.cache.mass_matrix = damping.map(|damping| (now, damping, matrix));
        Ok(())
    }

    /// Stiffness of the springs, as it was given.
    pub(crate) fn exact_springs(&self) -> Vec<SpringWeights<f64>> {
        let unit = self.material.network.stiffness_unit();
        let springs = self.material.network.springs().iter().map(|s| SpringWeights {
            direction: s.direction,
            weights: s.weights.scaled(if unit > 0.0 { unit } else { 1.0 }),
        });
        springs.collect()
    }
}
