//! The adaptive fit: which functions of which level are worth their place, solved jointly.
//!
//! Level 0 is fitted by exact least squares. Of each finer level the functions of largest energy
//! `c²‖B‖²` are kept, `c` being the exact least-squares coefficients of the residual; then all kept functions of
//! all levels are solved jointly. Exchanges follow: with the functions now known to work together, those of
//! least energy give way to those that the new residual asks for.

use bspline::Real;

use super::active::ActiveSet;
use super::detail::{DetailLayout, interpolation, least_squares};
use super::domain::{Domain, Samples};
use super::joint::{Fit, Problem, solve_jointly};
use super::residual::{correlations, residual};
use super::select::{Cutoff, largest};
use crate::{Control, FitError, SolverOutcome};

/// Iterations of the first joint solve, of that after an exchange, and of the last.
///
/// On a head of 7.1 M voxels at 0.96 M coefficients: rms 1.61 with 20 iterations and no exchange (0.7 s), 1.52 with
/// one exchange (1.2 s), 1.48 with two (1.5 s), 1.46 with three (2.1 s). Fewer iterations between exchanges lose more than
/// they save (5: 1.57): coefficients that have not settled say little about who should go.
const ITERATIONS: [usize; 3] = [15, 12, 20];
/// Exchanges between the first and the last joint solve.
const EXCHANGES: usize = 2;
/// Share of the free budget that goes to each level but the last at first. Exchanges correct it: 0.4 to 0.6 end
/// within 2 %.
const FIRST_SHARE: f64 = 0.5;
/// Weight of a score for each level above the finest. A coarse function competes with the eight finer ones that
/// can do its work; of 0.4, 0.5, 0.65, 0.8, 1 the middle is best over budgets of 4 to 20 % of the voxels (1: 2.5 %
/// higher rms).
const COARSER_WEIGHT: f64 = 0.65;
/// Largest share of the functions that one exchange replaces.
const EXCHANGE_LIMIT: f64 = 0.2;

/// A fit under way: the residual belongs to the coefficients at every call.
pub(crate) struct Adaptive<'a, T> {
    pub problem: Problem<'a, T>,
    pub fit: Fit<T>,
    /// `d - f` at all samples, padding included.
    pub residual: Vec<T>,
    /// How the joint solves ended.
    pub solves: Vec<SolverOutcome>,
    /// As long as `residual`.
    scratch: Vec<T>,
    /// Finest level that may be used.
    depth: usize,
}

/// Scores of the functions of levels `1 ..= depth`.
pub(crate) struct Scores<T> {
    /// Entry `ℓ - 1` belongs to level `ℓ`.
    pub levels: Vec<Vec<T>>,
    pub layouts: Vec<DetailLayout>,
}

impl<T: Real> Scores<T> {
    fn lists(&self) -> Vec<&[T]> {
        self.levels.iter().map(Vec::as_slice).collect()
    }
}

impl<'a, T: Real> Adaptive<'a, T> {
    /// Fits level 0 to the samples; functions of levels up to `depth` may follow.
    pub fn new(problem: Problem<'a, T>, depth: usize) -> Self {
        let len = problem.domain.padded().iter().product();
        Self::with_buffers(problem, depth, vec![T::zero(); len], vec![T::zero(); len])
    }

    fn with_buffers(problem: Problem<'a, T>, depth: usize, mut r: Vec<T>, scratch: Vec<T>) -> Self {
        let domain = problem.domain;
        let mut fit = Fit::new(domain);
        residual(domain, &problem.samples, &fit.active, &fit.coefficients, &mut r);
        let mut base = correlations(domain, &r, &fit.active[domain.finest()]).swap_remove(0);
        least_squares(domain, 0, &mut base);
        fit.coefficients[0] = base;
        let mut this = Self {
            problem,
            fit,
            residual: r,
            solves: Vec::new(),
            scratch,
            depth,
        };
        this.update_residual();
        this
    }

    pub fn domain(&self) -> &'a Domain<T> {
        self.problem.domain
    }

    pub fn samples(&self) -> Samples<'a, T> {
        self.problem.samples
    }

    pub fn depth(&self) -> usize {
        self.depth
    }

    /// Back to level 0 by exact least squares.
    pub fn restart(&mut self) {
        let scratch = std::mem::take(&mut self.scratch);
        let residual = std::mem::take(&mut self.residual);
        *self = Self::with_buffers(self.problem, self.depth, residual, scratch);
    }

    fn update_residual(&mut self) {
        let (domain, samples) = (self.problem.domain, &self.problem.samples);
        residual(
            domain,
            samples,
            &self.fit.active,
            &self.fit.coefficients,
            &mut self.residual,
        );
    }

    /// Joint least squares.
    pub fn solve(
        &mut self,
        iterations: usize,
        control: &mut Control,
        span: (f64, f64),
    ) -> Result<(), FitError> {
        let outcome = solve_jointly(
            &self.problem,
            &mut self.fit,
            &mut self.residual,
            iterations,
            control,
            span,
        )?;
        self.solves.push(outcome);
        Ok(())
    }

    /// Least-squares coefficients of the residual on `level`, all its functions taken.
    pub fn detail(&mut self, level: usize) -> Vec<T> {
        let domain = self.domain();
        if level == domain.finest() {
            let mut c = std::mem::take(&mut self.scratch);
            c.copy_from_slice(&self.residual);
            interpolation(domain, &mut c);
            c
        } else {
            let none = ActiveSet::empty(domain.functions(domain.finest()));
            let mut c = correlations(domain, &self.residual, &none).swap_remove(level);
            least_squares(domain, level, &mut c);
            c
        }
    }

    /// Gives a [`Self::detail`] back.
    pub fn recycle(&mut self, level: usize, c: Vec<T>) {
        if level == self.domain().finest() {
            self.scratch = c;
        }
    }

    /// Weight of the scores of `level`, see [`COARSER_WEIGHT`].
    pub fn level_weight(&self, level: usize) -> f64 {
        COARSER_WEIGHT.powi((self.depth - level) as i32)
    }

    /// Takes functions of `level`, none active so far, with their least-squares coefficients as start.
    pub fn grow(&mut self, level: usize, choose: impl Fn(&[T]) -> Cutoff) {
        let domain = self.domain();
        let layout = DetailLayout::of_level(domain, level);
        let coefficients = self.detail(level);
        let mut scores = coefficients.clone();
        layout.score(domain, T::one(), &mut scores);
        let set = layout.select(domain, &scores, choose(&scores), 0);
        drop(scores);
        let mut start = vec![T::zero(); set.len()];
        layout.for_each_active(&set, |packed, entry| start[packed] = coefficients[entry]);
        self.recycle(level, coefficients);
        self.fit.active[level] = set;
        self.fit.coefficients[level] = start;
        self.update_residual();
    }

    /// Square roots of energies: for active functions of what they carry, for others of what the residual would
    /// have them carry, weighted by level.
    pub fn scores(&mut self) -> Scores<T> {
        let domain = self.domain();
        let none = ActiveSet::empty(domain.functions(domain.finest()));
        let mut dense = if self.depth > 0 {
            correlations(domain, &self.residual, &none)
        } else {
            Vec::new()
        };
        let layouts: Vec<DetailLayout> = (1..=self.depth)
            .map(|level| DetailLayout::of_level(domain, level))
            .collect();
        let mut levels = Vec::with_capacity(self.depth);
        for &layout in &layouts {
            let level = layout.level;
            let mut c = if level == domain.finest() {
                self.detail(level)
            } else {
                let mut c = std::mem::take(&mut dense[level]);
                least_squares(domain, level, &mut c);
                c
            };
            let own = &self.fit.coefficients[level];
            layout.for_each_active(&self.fit.active[level], |packed, entry| c[entry] = own[packed]);
            layout.score(domain, T::from_f64(self.level_weight(level)), &mut c);
            levels.push(c);
        }
        Scores { levels, layouts }
    }

    /// Makes the functions whose score is kept the active ones.
    pub fn activate(&mut self, scores: Scores<T>, cutoff: Cutoff) {
        let mut offset = 0;
        for (layout, list) in scores.layouts.iter().zip(scores.levels) {
            let set = layout.select(self.domain(), &list, cutoff, offset);
            offset += list.len();
            self.fit.set_active(layout.level, set);
            self.recycle(layout.level, list);
        }
        self.update_residual();
    }

    /// Gives a [`Self::scores`] back unused.
    pub fn discard(&mut self, scores: Scores<T>) {
        for (layout, list) in scores.layouts.iter().zip(scores.levels) {
            self.recycle(layout.level, list);
        }
    }

    /// Replaces functions of little energy by as many that would carry more, at most a share of
    /// [`EXCHANGE_LIMIT`].
    fn exchange(&mut self, floor: f64) {
        let mut scores = self.scores();
        let count: usize = self.fit.active[1..].iter().map(ActiveSet::len).sum();
        let limit = (EXCHANGE_LIMIT * count as f64) as usize;
        let mut cutoff = largest(&scores.lists(), count);
        let mut own = self.own_scores(&scores);
        let leaving = own
            .iter()
            .zip(1..)
            .filter(|&(&(s, i), _)| !cutoff.keeps(s, i))
            .count();
        if leaving > limit {
            // Those that stay are out of the competition: an infinite score; those that leave have none.
            own.sort_unstable_by(|a, b| {
                a.0.partial_cmp(&b.0)
                    .expect("scores are numbers")
                    .then(b.1.cmp(&a.1))
            });
            for (rank, &(_, index)) in own.iter().enumerate() {
                *entry(&mut scores.levels, index) = if rank < limit { T::zero() } else { T::infinity() };
            }
            cutoff = largest(&scores.lists(), count);
        }
        self.activate(scores, cutoff.at_least(floor));
    }

    /// Score and index (counted through all levels) of every active function above level 0.
    fn own_scores(&self, scores: &Scores<T>) -> Vec<(T, usize)> {
        let mut own = Vec::new();
        let mut offset = 0;
        for (layout, list) in scores.layouts.iter().zip(&scores.levels) {
            layout.for_each_active(&self.fit.active[layout.level], |_, i| {
                own.push((list[i], offset + i))
            });
            offset += list.len();
        }
        own
    }

    /// Spends `budget` coefficients, or fewer if the rest would carry nothing above `floor`.
    pub fn spend(
        &mut self,
        budget: usize,
        floor: f64,
        control: &mut Control,
        span: (f64, f64),
    ) -> Result<(), FitError> {
        let at = |share: f64| span.0 + (span.1 - span.0) * share;
        for level in 1..=self.depth {
            control.step("choosing functions", at(0.14 * level as f64 / self.depth as f64))?;
            let free = budget.saturating_sub(self.fit.count());
            let share = if level < self.depth { FIRST_SHARE } else { 1.0 };
            let wanted = (free as f64 * share) as usize;
            self.grow(level, |scores| largest(&[scores], wanted).at_least(floor));
        }
        if self.depth == 0 {
            return self.solve(ITERATIONS[0], control, (at(0.1), at(1.0)));
        }
        let [first, between, last] = ITERATIONS;
        self.solve(first, control, (at(0.15), at(0.4)))?;
        for round in 0..EXCHANGES {
            let from = 0.4 + 0.3 * round as f64;
            control.step("exchanging functions", at(from))?;
            self.exchange(floor);
            let iterations = if round + 1 == EXCHANGES { last } else { between };
            self.solve(iterations, control, (at(from + 0.05), at(from + 0.3)))?;
        }
        Ok(())
    }
}

/// The entry of an index counted through all lists.
fn entry<T>(lists: &mut [Vec<T>], mut index: usize) -> &mut T {
    for list in lists {
        if index < list.len() {
            return &mut list[index];
        }
        index -= list.len();
    }
    unreachable!("index {index} beyond all lists");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantoms::head;

    const DIMS: [usize; 3] = [64, 61, 58];

    fn norm<T: Real>(r: &[T]) -> f64 {
        r.iter().map(|&v| v.as_f64() * v.as_f64()).sum::<f64>().sqrt()
    }

    fn started<'a, T: Real>(domain: &'a Domain<T>, values: &'a [f32]) -> Adaptive<'a, T> {
        let samples = Samples {
            values: values.into(),
            dims: DIMS,
            scale: T::one(),
        };
        Adaptive::new(
            Problem {
                domain,
                samples,
                ridge: 0.0,
            },
            2,
        )
    }

    #[test]
    fn least_squares_residual_is_orthogonal_to_its_functions() {
        let (domain, values) = (Domain::<f64>::new(DIMS, 3), head(DIMS, 0.02, 1));
        let mut fit = started(&domain, &values);
        let none = ActiveSet::empty(domain.functions(2));
        let left = |fit: &Adaptive<f64>, level: usize| {
            correlations(&domain, &fit.residual, &none)[level]
                .iter()
                .fold(0.0_f64, |m, c| m.max(c.abs()))
        };
        // Correlations of the data itself are up to 64: sums of as many voxels of density 1.
        assert!(left(&fit, 0) < 1e-10, "level 0 alone: {}", left(&fit, 0));

        let mut detail = correlations(&domain, &fit.residual, &none).swap_remove(1);
        assert!(left(&fit, 1) > 1e-2, "level 1 has something to say");
        least_squares(&domain, 1, &mut detail);
        fit.fit.active[1] = ActiveSet::full(domain.functions(1));
        fit.fit.coefficients[1] = detail;
        fit.update_residual();
        // The functions of level 1 express those of level 0.
        assert!(
            left(&fit, 1) < 1e-10 && left(&fit, 0) < 1e-10,
            "{} {}",
            left(&fit, 1),
            left(&fit, 0)
        );
    }

    #[test]
    fn joint_solve_lowers_the_residual_in_every_step() {
        let (domain, values) = (Domain::<f32>::new(DIMS, 3), head(DIMS, 0.02, 1));
        let mut fit = started(&domain, &values);
        for level in 1..=2 {
            fit.grow(level, |scores| largest(&[scores], 8_000));
        }
        let mut last = f64::INFINITY;
        for iterations in 0..12 {
            let mut copy = started(&domain, &values);
            copy.fit = fit.fit.clone();
            copy.residual.clone_from(&fit.residual);
            copy.solve(iterations, &mut Control::default(), (0.0, 1.0))
                .unwrap();
            let now = norm(&copy.residual);
            assert!(now < last, "{iterations} iterations: {now} after {last}");
            last = now;
        }
    }

    #[test]
    fn joint_solve_reaches_the_least_squares_solution() {
        let (domain, values) = (Domain::<f64>::new(DIMS, 3), head(DIMS, 0.02, 1));
        let mut fit = started(&domain, &values);
        fit.grow(2, |scores| largest(&[scores], 8_000));
        let gradient = |fit: &Adaptive<f64>| {
            let all = correlations(&domain, &fit.residual, &fit.fit.active[2]);
            norm(&all[2]) + norm(&all[0])
        };
        let start = gradient(&fit);
        // Clusters of functions along edges make for slow convergence: 1e-2 after 20 steps, 1e-5 after 800.
        fit.solve(800, &mut Control::default(), (0.0, 1.0)).unwrap();
        assert!(gradient(&fit) < 1e-4 * start, "{} of {start}", gradient(&fit));
    }

    #[test]
    fn adaptive_choice_beats_the_uniform_optimum() {
        let (domain, values) = (Domain::<f32>::new(DIMS, 3), head(DIMS, 0.0, 1));
        let mut fit = started(&domain, &values);
        fit.grow(1, |_| Cutoff::above(-1.0));
        let uniform = norm(&fit.residual);
        let count = domain.function_count(1);
        fit.restart();
        fit.spend(count, 0.0, &mut Control::default(), (0.0, 1.0))
            .unwrap();
        assert!(fit.fit.count() <= count);
        // On a head with such sharp edges a quarter is left; a loss of the method's edge would show at a half.
        assert!(
            norm(&fit.residual) < 0.5 * uniform,
            "{} of {uniform}",
            norm(&fit.residual)
        );
    }

    #[test]
    fn exchange_keeps_the_count_and_helps() {
        let (domain, values) = (Domain::<f32>::new(DIMS, 3), head(DIMS, 0.0, 1));
        let mut fit = started(&domain, &values);
        for level in 1..=2 {
            fit.grow(level, |scores| largest(&[scores], 6_000));
        }
        let control = &mut Control::default();
        fit.solve(40, control, (0.0, 1.0)).unwrap();
        let (count, before) = (fit.fit.count(), norm(&fit.residual));
        fit.exchange(0.0);
        assert_eq!(fit.fit.count(), count);
        fit.solve(40, control, (0.0, 1.0)).unwrap();
        assert!(
            norm(&fit.residual) < 0.97 * before,
            "{} after {before}",
            norm(&fit.residual)
        );
    }
}
