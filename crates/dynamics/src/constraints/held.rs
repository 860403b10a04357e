use bspline::Real;

use super::constraint::{Constraint, ConstraintError, Hold, Row};
use super::independent::Independent;
use crate::lattice::{Lattice, TensorWorkspace};
use crate::solve::Border;
use crate::sparse::Mask;

/// The constraints of a patch, as rows on the unknowns of its solver: the coefficients, or on a square lattice the
/// samples.
#[derive(Clone, Debug)]
pub(crate) struct Held<T> {
    pub(super) constraints: Vec<Constraint>,
    /// On the coefficients, one per constraint.
    pub(super) rows: Vec<Row>,
    /// Rows and `σ²k`.
    pub(super) springs: Vec<(Vec<(usize, f64)>, f64)>,
    pub(super) targets: Vec<f64>,
    pub(super) hard: Independent,
    pub(super) impulses: Vec<f64>,
    pub(super) gaps: Vec<f64>,
    /// Displacement and velocity of the unknowns.
    pub(super) moved: [Vec<T>; 2],
}

impl<T: Real> Held<T> {
    pub fn new(
        constraints: &[Constraint],
        lattice: &Lattice<T>,
        base: &[T],
        sigma2: f64,
        mask: Option<&Mask>,
    ) -> Result<Self, ConstraintError> {
        let rows = constraints.iter().map(|c| Row::new(c, lattice, base));
        let mut rows: Vec<Row> = rows.collect::<Result<_, _>>()?;
        // A field that is zero at a place is so but for the rounding of the densities about it.
        let largest = base.iter().fold(0.0_f64, |most, d| most.max(d.as_f64().abs()));
        rows.iter_mut().for_each(|row| row.size += row.weight * largest);
        if let Some(mask) = mask {
            let moves = |term: &(usize, f64)| mask.moving().binary_search(&term.0).is_ok();
            rows.iter_mut().for_each(|row| row.terms.retain(moves));
        }
        let mut on_unknowns = rows.clone();
        if lattice.is_square() {
            // r·p = (A⁻ᵀr)·d
            let inverse = lattice.inverse_transposed();
            let mut w = TensorWorkspace::new();
            let (mut from, mut to) = (vec![0.0; base.len()], vec![0.0; base.len()]);
            for row in &mut on_unknowns {
                from.fill(0.0);
                for (i, v) in &row.terms {
                    from[*i] = *v;
                }
                inverse.apply(&from, &mut to, &mut w);
                let terms = to.iter().copied().enumerate();
                row.terms = terms.filter(|(_, v)| v.abs() > 1e-14 * row.weight).collect();
            }
        }
        let all = constraints.iter().zip(&on_unknowns);
        let hard = all.clone().filter(|(c, _)| c.hold == Hold::Hard);
        let hard: Vec<(&str, &Row)> = hard.map(|(c, r)| (c.label.as_str(), r)).collect();
        let hard = Independent::new(&hard)?;
        let soft = all.filter_map(|(c, r)| match c.hold {
            Hold::Spring(k) => Some(((r.terms.clone(), sigma2 * k), r.target)),
            Hold::Hard => None,
        });
        let (springs, targets): (Vec<_>, Vec<_>) = soft.unzip();
        let zeros = || vec![T::zero(); lattice.coefficient_count()];
        Ok(Self {
            constraints: constraints.to_vec(),
            rows,
            impulses: vec![0.0; springs.len()],
            gaps: vec![0.0; hard.c.len()],
            springs,
            targets,
            hard,
            moved: [zeros(), zeros()],
        })
    }

    /// Moves the targets to those of `constraints`, if nothing else is different and all hard ones are independent; says
    /// whether that was so.
    pub(super) fn aim_at(&mut self, constraints: &[Constraint], base: &[T]) -> Result<bool, ConstraintError> {
        let same = |a: &Constraint, b: &Constraint| a.label == b.label && a.on == b.on && a.hold == b.hold;
        let mut pairs = self.constraints.iter().zip(constraints);
        if constraints.len() != self.constraints.len()
            || !pairs.all(|(a, b)| same(a, b))
            || !self.hard.can_be_aimed()
        {
            return Ok(false);
        }
        if let Some(c) = constraints.iter().find(|c| !c.density.is_finite()) {
            return Err(ConstraintError::NotFinite {
                label: c.label.clone(),
                what: "density",
                value: c.density,
            });
        }
        self.constraints.clone_from_slice(constraints);
        for (row, c) in self.rows.iter_mut().zip(constraints) {
            row.aim(c, base);
        }
        let all = || constraints.iter().zip(&self.rows);
        let hard = all().filter(|(c, _)| c.hold == Hold::Hard);
        let hard: Vec<f64> = hard.map(|(_, r)| r.target).collect();
        self.hard.aim(hard.into_iter());
        let soft = all().filter(|(c, _)| c.hold != Hold::Hard);
        self.targets = soft.map(|(_, r)| r.target).collect();
        Ok(true)
    }

    /// Rows on the unknowns of the constraint springs, with `σ²k`.
    pub fn springs(&self) -> &[(Vec<(usize, f64)>, f64)] {
        &self.springs
    }

    /// For a solver of steps in which the springs are implicit, or not.
    pub fn border<U: Real>(&self, implicit: bool) -> Border<U> {
        let springs = self.springs.iter().map(|s| s.0.clone()).collect();
        Border::new(self.moved[0].len(), springs, implicit, self.hard.rows.clone())
    }

    /// Writes what the next solve has to do.
    pub fn aim(&self, border: &mut Border<T>) {
        border.impulses.copy_from_slice(&self.impulses);
        border.gaps.copy_from_slice(&self.gaps);
    }
}
