//! What a patch would do under forces that do not act yet: for tools that aim, and for a hand that probes.

use bspline::Real;

use crate::integrators::Integrator;
use crate::lattice::{Lattice, OnBox, Rim, SampleBox};
use crate::matter::{Matter, Quantity};
pub use crate::patch::Against;
use crate::patch::StaticSolver;
use crate::patch::{Patch, PatchError, State, finite};
use crate::solve::{SolveReport, SolverOptions, StepSolver, VCycleOptions};
use crate::sparse::Mask;
use crate::springs::{Law, SpringWeights, StepMatrix, Weights};
use crate::units::{binary_unit, largest};

/// Residual at which static solves stop. Their errors are smooth and may be some hundred times as large.
const STATIC: f64 = 1e-9;
/// Residual above which a static solve has failed.
const FAILED: f64 = 1e-6;
/// Standard deviations at which the Gaussian of a probe ends.
const REACH: f64 = 4.0;

/// A change of a patch under a force.
#[derive(Clone, Debug, PartialEq)]
pub struct Response<T> {
    /// Of the free coefficients.
    pub p: Vec<T>,
    /// Of the densities at the samples.
    pub d: Vec<T>,
    /// The worst of its solves.
    pub solve: SolveReport,
}

impl<T: Real> Response<T> {
    /// `Jᵀd`: what the change is worth to a kernel.
    pub fn along(&self, kernel: OnBox<T>, lattice: &Lattice<T>) -> f64 {
        let places = kernel.at.indices(lattice.sample_dims());
        let terms = places.zip(kernel.values);
        terms.map(|(i, j)| j.as_f64() * self.d[i].as_f64()).sum()
    }
}

impl<T: Real> Patch<T> {
    /// What a step of `dt` moves more when a force is added to those that act: of eq. 12 `H⁻¹AᵀJ` with
    /// `H = M̃/Δt² + D̃/(2Δt) + K̃`, of [`Integrator::TrBdf2`] that of both stages. One column per load, each of one or two
    /// solves to a residual of 10⁻⁵. Exact for the linear law, of the first order for the 4-D one; hard constraints hold.
    ///
    /// The state stays. The solver is made ready as for a step, and a factor made beside the steps grows by these solves too.
    ///
    /// # Errors
    /// [`PatchError::TimeStep`], [`PatchError::Explicit`], [`PatchError::Box`], [`PatchError::Length`],
    /// [`PatchError::NotFinite`], [`PatchError::Solve`].
    pub fn respond(
        &mut self,
        integrator: Integrator,
        dt: f64,
        loads: &[OnBox<T>],
    ) -> Result<Vec<Response<T>>, PatchError> {
        loads
            .iter()
            .map(|load| self.respond_to(integrator, dt, load, RESPONSE))
            .collect()
    }

    /// The same for one load, as exact as a step is, in as many iterations: for a tool that becomes part of the step.
    ///
    /// # Errors
    /// As [`respond`](Self::respond).
    pub fn respond_as_step(
        &mut self,
        integrator: Integrator,
        dt: f64,
        load: &OnBox<T>,
    ) -> Result<Response<T>, PatchError> {
        self.respond_to(integrator, dt, load, f64::INFINITY)
    }

    /// Makes responses, each with its share, part of the step of `dt` that was taken last.
    ///
    /// # Errors
    /// [`PatchError::Overflow`]; the state is then the one before.
    pub fn add_responses(&mut self, parts: &[(f64, Response<T>)], dt: f64) -> Result<(), PatchError> {
        self.cache.work.before.copy_from(&self.motion.state);
        let State { p, v, .. } = &mut self.motion.state;
        let mut change = vec![0.0; p.len()];
        for (share, response) in parts {
            let more = response.p.iter();
            change
                .iter_mut()
                .zip(more)
                .for_each(|(c, p)| *c += share * p.as_f64());
        }
        for ((p, v), change) in p.iter_mut().zip(v).zip(&change) {
            *p = T::from_f64(p.as_f64() + change);
            *v = T::from_f64(v.as_f64() + change / dt);
        }
        // Densities that were added up on their own would drift from the coefficients, in single precision by 1 % of a stroke.
        self.sample_state();
        self.keep_if_finite()
    }

    fn respond_to(
        &mut self,
        integrator: Integrator,
        dt: f64,
        load: &OnBox<T>,
        residual: f64,
    ) -> Result<Response<T>, PatchError> {
        if !(dt.is_finite() && dt > 0.0) {
            return Err(PatchError::TimeStep { dt });
        }
        self.check_load(load)?;
        let dims = self.lattice().sample_dims();
        let gamma = 2.0 - std::f64::consts::SQRT_2;
        let (a, b, share) = match integrator {
            Integrator::Paper => (0.5 * dt, dt * dt, 1.0),
            Integrator::TrBdf2 => {
                let c = 0.5 * gamma * dt;
                (c, c * c, 2.0)
            }
            other => return Err(PatchError::Explicit { scheme: other.name() }),
        };
        let unit = self.matrix_unit(a, b);
        self.tangents(b / unit);
        self.write_impulse(load, dims, share * b / unit);
        self.aim(0.0, 0.0, 0.0);
        let first = self.solve_step_to(a, b, Some(residual), None)?;
        let response = |work: &crate::patch::Scratch<T>, solve| Response {
            p: work.x.clone(),
            d: work.dx.clone(),
            solve,
        };
        if integrator == Integrator::Paper {
            return Ok(response(&self.cache.work, first));
        }
        // With e = H⁻¹·2c²J the second stage, less c²K̃e = 2c²J - (M̃ + cD̃)e, has (1 + β)(2M̃ + cD̃)e - c²J to solve.
        let e = response(&self.cache.work, first);
        let beta = (1.0 - gamma).powi(2) / (gamma * (2.0 - gamma));
        let unit = self.matrix_unit(a, b);
        self.tangents(b / unit);
        self.write_impulse(load, dims, -b / unit);
        let factors = [
            2.0 * self.material.lumped.mass.unit,
            a * self.material.lumped.damping.unit,
        ];
        let [of_mass, of_damping] = factors.map(|f| (1.0 + beta) * f / unit);
        for (i, g) in self.cache.work.g.iter_mut().enumerate() {
            let inertia = of_mass * self.material.lumped.mass.at(i).as_f64()
                + of_damping * self.material.lumped.damping.at(i).as_f64();
            *g = T::from_f64(g.as_f64() + inertia * e.d[i].as_f64());
        }
        self.aim(0.0, 0.0, 0.0);
        let second = self.solve_step_to(a, b, Some(residual), None)?;
        let mut whole = response(&self.cache.work, first.and(second));
        let add = |to: &mut [T], from: &[T]| to.iter_mut().zip(from).for_each(|(a, b)| *a += *b);
        add(&mut whole.p, &e.p);
        add(&mut whole.d, &e.d);
        Ok(whole)
    }

    /// Of the 4-D law; those of the linear one stay.
    fn tangents(&mut self, factor: f64) {
        if let Law::FourD { .. } = self.springs().law() {
            self.forces(Some(factor));
        }
    }

    fn write_impulse(&mut self, load: &OnBox<T>, dims: [usize; 3], factor: f64) {
        self.cache.work.g.fill(T::zero());
        for (i, j) in load.at.indices(dims).zip(load.values) {
            self.cache.work.g[i] = T::from_f64(factor * j.as_f64());
        }
        if let Some(mask) = &self.material.mask {
            mask.cut(&mut self.cache.work.g);
        }
    }

    /// Refuses loads that are not on this lattice.
    pub(crate) fn check_load(&self, load: &OnBox<T>) -> Result<(), PatchError> {
        let dims = self.lattice().sample_dims();
        if !load.at.fits(dims) {
            return Err(PatchError::Box { at: load.at, dims });
        }
        finite("force", load.values, load.at.len())
    }

    /// Where a force would bring the patch in the end: `K̃⁻¹AᵀJ`, a column per load, to 10⁻⁴ and better at any contrast;
    /// solved in double precision and rounded. Looking changes nothing.
    ///
    /// # Errors
    /// [`PatchError::Unheld`] where neither rim nor ground nor constraints hold the densities, [`PatchError::Static`] where
    /// the solve does not converge; as [`respond`](Self::respond) for loads that do not fit, and [`PatchError::Matter`] for
    /// a reference that no matter has.
    pub fn static_response(
        &mut self,
        against: Against,
        loads: &[OnBox<T>],
    ) -> Result<Vec<Response<T>>, PatchError> {
        for load in loads {
            self.check_load(load)?;
        }
        let mut s = self.static_solver(against)?;
        let mask = self.material.mask.clone();
        let (dims, count) = (self.lattice().sample_dims(), self.lattice().coefficient_count());
        let mut g = vec![0.0; self.motion.base.len()];
        let (mut x, mut dx) = (vec![0.0; count], vec![0.0; self.motion.base.len()]);
        let column = |load: &OnBox<T>| {
            // The unit keeps what is solved for in range; the result is asked for in that of T.
            let size = binary_unit(largest(load.values));
            let size = if size > 0.0 { size } else { 1.0 };
            g.fill(0.0);
            for (i, j) in load.at.indices(dims).zip(load.values) {
                g[i] = j.as_f64() / size;
            }
            if let Some(mask) = &mask {
                mask.cut(&mut g);
            }
            let solve = s.solver.solve(&s.matrix, &g, &mut x, &mut dx).checked()?;
            let residual = solve.iteration.residual;
            if residual.is_nan() || residual > FAILED {
                return Err(PatchError::Static { residual });
            }
            let rounded = |list: &[f64]| list.iter().map(|v| T::from_f64(v * size / s.unit)).collect();
            Ok(Response {
                p: rounded(&x),
                d: rounded(&dx),
                solve,
            })
        };
        let columns = loads.iter().map(column).collect();
        let slot = usize::from(matches!(against, Against::Reference { .. }));
        self.cache.statics[slot] = Some(s);
        columns
    }

    fn static_solver(&mut self, against: Against) -> Result<Box<StaticSolver>, PatchError> {
        let slot = usize::from(matches!(against, Against::Reference { .. }));
        let version = self.version();
        let kept = self.cache.statics[slot].take();
        // A tangent is of the state, which has no version.
        let moves = slot == 0 && matches!(self.material.network.law(), Law::FourD { .. });
        let kept = match kept {
            Some(s) if s.against == against && (s.version == version || slot == 1) && !moves => return Ok(s),
            kept => kept,
        };
        let sigma2 = self.material.network.law().scale().powi(2);
        let (ground, springs) = match against {
            Against::Painted => (self.exact_ground(), self.present_springs()),
            Against::Reference { stiffness, ground } => {
                let matter = Matter {
                    stiffness: Quantity::Constant(stiffness),
                    ground: Quantity::Constant(ground),
                    ..Matter::default()
                };
                let lumped = self
                    .masked_matter(&matter)
                    .lumped::<f64>(&self.lattice().in_double(), self.material.neighbours)?;
                (lumped.ground, lumped.springs)
            }
        };
        let held = self.material.held.as_deref().filter(|_| slot == 0);
        let stiffest = springs.iter().fold(0.0_f64, |m, s| m.max(s.weights.range().1));
        let anchored = ground.range().1 > 0.0 || held.is_some();
        let fixed = self.lattice().axes().iter().any(|a| a.rim() == Rim::Fixed);
        let floats = |m: &Mask| m.parts().iter().any(|p| p.floats);
        let fixed = match &self.material.mask {
            Some(mask) => !floats(mask),
            None => fixed,
        };
        if !(anchored || fixed && stiffest > 0.0) {
            return Err(PatchError::Unheld);
        }
        let unit = binary_unit(stiffest.max(ground.range().1));
        let unit = if unit > 0.0 { unit } else { 1.0 };
        let in_unit = |w: &Weights<f64>| w.scaled::<f64>(1.0 / unit);
        let springs = springs.iter().map(|s| SpringWeights {
            direction: s.direction,
            weights: in_unit(&s.weights),
        });
        let matrix = StepMatrix::new(self.lattice().sample_dims(), in_unit(&ground), springs.collect());
        let mut solver = match kept {
            Some(s) => s.solver,
            None => self.new_static_solver(),
        };
        solver.set_border(held.map(|held| {
            let mut border = held.border::<f64>(true);
            border.set_weights(held.springs().iter().map(|(_, k)| k / (sigma2 * unit)));
            border
        }));
        solver.prepare(&matrix)?;
        Ok(Box::new(StaticSolver {
            against,
            version,
            matrix,
            unit: unit * sigma2,
            solver,
        }))
    }

    fn new_static_solver(&self) -> StepSolver<f64> {
        let own = self.cache.solver.options();
        let options = SolverOptions {
            iterations: 200,
            tolerance: Some(STATIC),
            // A factor beside the solves would let the bits depend on how often somebody looked.
            background_limit: 0,
            v_cycle: VCycleOptions {
                block_onset: 2.0,
                ..own.v_cycle
            },
            ..own
        };
        let steps = self.material.neighbours.directions().into_iter().map(|d| d.step);
        let mut solver = StepSolver::new(self.lattice().in_double(), &steps.collect::<Vec<_>>(), options);
        solver.set_mask(self.material.mask.clone());
        solver
    }

    pub(crate) fn exact_ground(&self) -> Weights<f64> {
        let ground = &self.material.lumped.ground;
        ground.weights.scaled(ground.unit)
    }

    /// Springs of the linear law, tangents of the 4-D one, without `σ²`.
    pub(crate) fn present_springs(&self) -> Vec<SpringWeights<f64>> {
        let mut springs = self.exact_springs();
        if let Law::FourD { .. } = self.material.network.law() {
            self.material
                .network
                .scale_by_tangent(&self.motion.state.d, &mut springs);
        }
        springs
    }

    /// Stiffness per volume near a place, given in world lengths from the first sample along the axes: the mean over the
    /// springs that start within `radius`, weights falling linearly from 1 to 0. `None` where there are none.
    pub fn stiffness_near(&self, at: [f64; 3], radius: f64) -> Option<f64> {
        let lattice = self.lattice();
        let (dims, h) = (lattice.sample_dims(), lattice.spacing());
        let near = lattice.samples_near(at, radius);
        let volume = lattice.sample_volume();
        let (mut sum, mut all) = (0.0, 0.0);
        for i in near.indices(dims) {
            let ijk = [i / dims[2] / dims[1], i / dims[2] % dims[1], i % dims[2]];
            let weight = 1.0 - distance(lattice.sample_place(ijk), at) / radius;
            if weight <= 0.0 || weight.is_nan() {
                continue;
            }
            for s in self.material.network.springs() {
                let step = s.direction.step;
                let end = |a: usize| ijk[a].checked_add_signed(step[a]).is_some_and(|e| e < dims[a]);
                if !(0..3).all(end) {
                    continue;
                }
                let axis = step.iter().position(|&s| s != 0).unwrap_or(0);
                let share = s.direction.share * volume / (h[axis] * h[axis]);
                let weight = weight * s.direction.share;
                sum += weight * self.material.network.stiffness_unit() * s.weights.at(i).as_f64() / share;
                all += weight;
            }
        }
        (all > 0.0).then(|| sum / all)
    }

    /// Compliance at a place, density per force: `JᵀK̃⁻¹J` of a Gaussian of standard deviation `radius`, its weights adding
    /// up to 1. At least about 1.5 sample distances are needed for it not to depend on the sampling.
    ///
    /// # Errors
    /// As [`static_response`](Self::static_response), and [`PatchError::Nowhere`] where no sample is near.
    pub fn compliance_at(&mut self, at: [f64; 3], radius: f64, against: Against) -> Result<f64, PatchError> {
        let (near, kernel) = self.lattice().gaussian(at, radius);
        if near.is_empty() {
            return Err(PatchError::Nowhere { at, radius });
        }
        let kernel: Vec<T> = kernel.into_iter().map(T::from_f64).collect();
        let load = OnBox {
            at: near,
            values: &kernel,
        };
        let response = self.static_response(against, &[load])?;
        Ok(response[0].along(load, self.lattice()))
    }
}

/// Residual to which responses of a step are solved.
const RESPONSE: f64 = 1e-5;

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

impl<T: Real> Lattice<T> {
    /// A Gaussian of standard deviation `radius` at a place given in world lengths from the first sample along the axes:
    /// the samples that it reaches, with weights that add up to 1.
    pub fn gaussian(&self, at: [f64; 3], radius: f64) -> (SampleBox, Vec<f64>) {
        let near = self.samples_near(at, REACH * radius);
        let dims = self.sample_dims();
        let weight = |i: usize| {
            let ijk = [i / dims[2] / dims[1], i / dims[2] % dims[1], i % dims[2]];
            let x = distance(self.sample_place(ijk), at) / radius;
            libm::exp(-0.5 * x * x)
        };
        let mut weights: Vec<f64> = near.indices(dims).map(weight).collect();
        let sum: f64 = weights.iter().sum();
        if sum <= 0.0 || sum.is_nan() {
            return (SampleBox::default(), Vec::new());
        }
        weights.iter_mut().for_each(|w| *w /= sum);
        (near, weights)
    }

    /// The lattice in double precision.
    pub(crate) fn in_double(&self) -> Lattice<f64> {
        Lattice::new(self.axes().clone())
    }
}
