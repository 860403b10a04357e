use bspline::Real;

use super::constraint::{Constraint, ConstraintError, Hold};
use super::held::Held;
use crate::lattice::TensorWorkspace;
use crate::patch::{Patch, PatchError};
use crate::solve::spring_value;

impl<T: Real> Patch<T> {
    /// Replaces all constraints, also while the patch moves. Hard ones are met at once by the least change of the
    /// unknowns; to bring matter to them slowly, move their densities from step to step. Hard constraints that follow
    /// from others are accepted.
    ///
    /// Costs a solve per constraint at the next step and as many vectors of coefficients; nothing of that where only densities
    /// differ from those of the constraints before.
    ///
    /// # Errors
    /// [`PatchError::Constraint`]; the old constraints then stay.
    pub fn set_constraints(&mut self, constraints: &[Constraint]) -> Result<(), PatchError> {
        if let Some(held) = &mut self.material.held
            && held.aim_at(constraints, &self.motion.base)?
        {
            self.meet_constraints();
            return Ok(());
        }
        let sigma2 = self.material.network.law().scale().powi(2);
        let (coefficients, limit) = (
            self.lattice().coefficient_count(),
            self.cache.solver.options().sample_direct_limit(),
        );
        // Multigrid solves to 3e-4, and A⁻¹ of a bordered solve as rough as that was seen to grow from step to step.
        if !constraints.is_empty() && self.lattice().is_square() && coefficients > limit {
            return Err(ConstraintError::Multigrid { coefficients, limit }.into());
        }
        let held = match constraints {
            [] => None,
            list => Some(Box::new(Held::new(
                list,
                self.cache.solver.lattice(),
                &self.motion.base,
                sigma2,
                self.material.mask.as_deref(),
            )?)),
        };
        self.cache
            .solver
            .set_border(held.as_ref().map(|h| h.border(true)));
        self.material.held = held;
        if let Some(solver) = &mut self.cache.mass_solver {
            solver.set_border(None);
        }
        self.cache.mass_matrix = None;
        self.material.changes += 1;
        self.meet_constraints();
        Ok(())
    }

    /// The constraints.
    pub fn constraints(&self) -> &[Constraint] {
        self.material.held.as_ref().map_or(&[], |h| &h.constraints)
    }

    /// What is missing to the density of each constraint.
    pub fn constraint_gaps(&self) -> impl Iterator<Item = f64> + '_ {
        let rows = self.material.held.iter().flat_map(|h| &h.rows);
        rows.map(|r| r.target - r.value(&self.motion.state.p))
    }

    /// Constraint springs on the coefficients: rows with `σ²k`.
    pub(crate) fn constraint_springs(&self) -> Vec<(&[(usize, f64)], f64)> {
        let sigma2 = self.material.network.law().scale().powi(2);
        let rows = self
            .material
            .held
            .iter()
            .flat_map(|h| h.constraints.iter().zip(&h.rows));
        let springs = rows.filter_map(|(c, row)| match c.hold {
            Hold::Spring(k) => Some((&row.terms[..], sigma2 * k)),
            Hold::Hard => None,
        });
        springs.collect()
    }

    /// Energy of the constraint springs.
    pub(crate) fn constraint_energy(&self) -> f64 {
        let sigma2 = self.material.network.law().scale().powi(2);
        let springs = self.constraints().iter().zip(self.constraint_gaps());
        let energies = springs.map(|(c, gap)| match c.hold {
            Hold::Spring(k) => 0.5 * sigma2 * k * gap * gap,
            Hold::Hard => 0.0,
        });
        energies.sum()
    }

    /// Brings the state onto the hard constraints, and its velocity into their null space.
    pub(crate) fn meet_constraints(&mut self) {
        let Some(mut held) = self.material.held.take() else {
            return;
        };
        if !held.hard.c.is_empty() {
            self.displace(&mut held);
            let Held { hard, moved, .. } = &mut *held;
            let before = moved.clone();
            hard.rows.close(&mut moved[0], |h| hard.c[h]);
            hard.rows.close(&mut moved[1], |_| 0.0);
            if self.lattice().is_square() {
                let inverse = self.lattice().inverse();
                let mut w = TensorWorkspace::new();
                let mut change = vec![0.0; before[0].len()];
                for ((now, then), p) in moved
                    .iter()
                    .zip(&before)
                    .zip([&mut self.motion.state.p, &mut self.motion.state.v])
                {
                    let moved = now.iter().zip(then);
                    let moved: Vec<f64> = moved.map(|(a, b)| (*a - *b).as_f64()).collect();
                    inverse.apply(&moved, &mut change, &mut w);
                    for (p, c) in p.iter_mut().zip(&change) {
                        *p += T::from_f64(*c);
                    }
                }
            } else {
                self.motion.state.p.copy_from_slice(&moved[0]);
                self.motion.state.v.copy_from_slice(&moved[1]);
            }
            self.sample_state();
        }
        self.material.held = Some(held);
    }

    /// Reads displacement and velocity of the unknowns.
    fn displace(&self, held: &mut Held<T>) {
        let [u, v] = &mut held.moved;
        if self.lattice().is_square() {
            for ((u, d), base) in u.iter_mut().zip(&self.motion.state.d).zip(&self.motion.base) {
                *u = *d - *base;
            }
            v.copy_from_slice(&self.motion.state.w);
        } else {
            u.copy_from_slice(&self.motion.state.p);
            v.copy_from_slice(&self.motion.state.v);
        }
    }

    /// Completes forces on the unknowns, multiples of `unit`, by those of the constraints: what the springs pull with, and
    /// what the hard ones bear.
    pub(crate) fn balance(&mut self, unit: f64, forces: &mut [T]) {
        let Some(mut held) = self.material.held.take() else {
            return;
        };
        self.displace(&mut held);
        let u = &held.moved[0];
        for ((row, stiffness), target) in held.springs.iter().zip(&held.targets) {
            let pull = stiffness * (target - spring_value(row, u)) / unit;
            for (i, w) in row {
                forces[*i] += T::from_f64(pull * w);
            }
        }
        held.hard.rows.close(forces, |_| 0.0);
        self.material.held = Some(held);
    }

    /// What constraint springs gain when the coefficients have grown by `moved(i)` since the state `p`.
    pub(crate) fn constraint_energy_change(&self, p: &[T], moved: impl Fn(usize) -> f64) -> f64 {
        let sigma2 = self.material.network.law().scale().powi(2);
        let rows = self
            .material
            .held
            .iter()
            .flat_map(|h| h.constraints.iter().zip(&h.rows));
        let gains = rows.map(|(c, row)| match c.hold {
            Hold::Spring(k) => {
                let closed: f64 = row.terms.iter().map(|(i, w)| w * moved(*i)).sum();
                sigma2 * k * closed * (0.5 * closed - (row.target - row.value(p)))
            }
            Hold::Hard => 0.0,
        });
        gains.sum()
    }

    /// Sets what the constraints do in the next solve: springs push with `force` times their force, and the hard ones
    /// want `position` times what is missing less `rate` times their velocity.
    pub(crate) fn aim(&mut self, force: f64, position: f64, rate: f64) {
        let Some(mut held) = self.material.held.take() else {
            return;
        };
        self.displace(&mut held);
        let [u, v] = &held.moved;
        let springs = held.springs.iter().zip(&held.targets);
        for (impulse, ((row, stiffness), target)) in held.impulses.iter_mut().zip(springs) {
            *impulse = force * stiffness * (target - spring_value(row, u));
        }
        let hard = &held.hard;
        for (h, gap) in held.gaps.iter_mut().enumerate() {
            let missing = hard.c[h] - hard.rows.times(h, u);
            *gap = position * missing - rate * hard.rows.times(h, v);
        }
        self.material.held = Some(held);
    }

    /// Hands the constraints to the solver of implicit steps; `stiffness` is that of the springs in its matrix.
    pub(crate) fn aim_implicit(&mut self, stiffness: f64) {
        if let (Some(held), Some(border)) = (&self.material.held, self.cache.solver.border_mut()) {
            border.set_weights(held.springs.iter().map(|(_, k)| stiffness * k));
            held.aim(border);
        }
    }
}
