//! Parts of a region that sleep: only a box of cells round what moves is stepped, the rest is its rim.

use bspline::{KnotVector, Real};
use serde::{Deserialize, Serialize};

use super::Region;
use super::sleep::solves;
use super::window::{Window, crop, paste};
use crate::integrators::{Integrator, StepReport};
use crate::lattice::{Axis, Lattice, LatticeError, Rim};
use crate::matter::{Matter, Quantity};
use crate::patch::{Patch, PatchError};
use crate::springs::{Plasticity, Weights};

/// Steps between two looks at the whole region, whose cost is that of its forces; up to eight times as many while looks
/// find nothing to cut.
const LOOK: usize = 4;
const MOST_MISSES: u32 = 3;
/// Coefficients beyond those that move, on each side, of a part that is cut: twice as many each time that one was outgrown.
const MARGIN: usize = 3;
const MOST_GROWTHS: u32 = 3;
/// Share of the samples above which a part does not pay.
const WORTH: f64 = 0.6;
/// Of its samples that a part has to lose for a smaller one to be cut.
const SHRINK: f64 = 0.5;

/// The part of a region that is awake.
#[derive(Clone, Debug)]
pub(super) struct Part<T> {
    pub patch: Patch<T>,
    pub window: Window,
    /// Operations that it saved, less what it cost.
    pub earned: f64,
}

/// Whether parts sleep, and what that costs and saves, in operations.
///
/// A part is cut when what it costs has been saved before: by other parts, or by what this one would have saved while it
/// was waited for. So a motion that outgrows every part costs hardly more than one without parts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Parts {
    pub on: bool,
    pub steps_to_look: usize,
    /// Looks in a row that found nothing to cut.
    misses: u32,
    /// Parts in a row that were outgrown.
    growths: u32,
    /// Saved so far and not spent.
    savings: f64,
    /// Doubled by each part that did not earn what it cost.
    patience: f64,
    /// Spent on parts since the matter changed, as long as the whole has no solver of its own.
    before_whole: f64,
    pub operations: f64,
    pub cuts: usize,
}

impl Default for Parts {
    fn default() -> Self {
        Self {
            on: false,
            steps_to_look: 0,
            misses: 0,
            growths: 0,
            savings: 0.0,
            patience: 1.0,
            before_whole: 0.0,
            operations: 0.0,
            cuts: 0,
        }
    }
}

impl Parts {
    /// Whether looks can come of it.
    pub fn is_sound(&self) -> bool {
        self.misses <= MOST_MISSES && self.growths <= MOST_GROWTHS
    }

    /// All that was learnt of one matter says nothing of another.
    pub fn forget(&mut self) {
        *self = Self {
            on: self.on,
            operations: self.operations,
            cuts: self.cuts,
            ..Self::default()
        };
    }
}

fn greatest_common_divisor(a: usize, b: usize) -> usize {
    if b == 0 {
        a
    } else {
        greatest_common_divisor(b, a % b)
    }
}

impl<T: Real> Region<T> {
    /// Whether parts that rest sleep while others move, so that the cost of a step follows the samples awake.
    ///
    /// Parts are boxes whose ends are samples: cells and samples have to meet more often than at the ends of the
    /// region, as they do every three cells with 4/3 samples a cell if the number of cells is a multiple of three. What
    /// sleeps stands still until it is off its balance by more than the threshold, which is looked at every few steps.
    /// A part stays cut while only the forces change, and across sleep. Regions under constraints or a mask stay whole. Off at first.
    pub fn set_parts_sleep(&mut self, parts: bool) {
        self.part = None;
        self.parts.forget();
        self.parts.on = parts;
    }

    /// Samples that the next step moves.
    pub fn awake_samples(&self) -> usize {
        match (&self.part, self.asleep) {
            (_, true) => 0,
            (Some(part), false) => part.window.sample_count(),
            (None, false) => self.patch.lattice().sample_count(),
        }
    }

    /// Operations that the steps so far have taken, counted by what the solver does, not timed: those of the steps, of
    /// looking at what moves, and of making solvers for the region and for its parts.
    pub fn operations(&self) -> f64 {
        self.parts.operations
    }

    /// Parts that were cut out so far.
    pub fn cuts(&self) -> usize {
        self.parts.cuts
    }

    /// A step of what is awake.
    pub(super) fn step_parts(&mut self, integrator: Integrator, dt: f64) -> Result<StepReport, PatchError> {
        let solves = solves(integrator) as f64;
        if !self.parts.on || !self.patch.constraints().is_empty() || self.patch.mask().is_some() {
            self.part = None;
            return self.step_whole(integrator, dt);
        }
        if self.parts.steps_to_look == 0 {
            self.look(solves)?;
            self.parts.steps_to_look = LOOK << self.parts.misses;
        }
        self.parts.steps_to_look -= 1;
        let saved = self.patch.operations().solve;
        let Some(part) = &mut self.part else {
            return self.step_whole(integrator, dt);
        };
        let report = part.patch.step(integrator, dt)?;
        let taken = part.patch.operations().solve;
        part.earned += solves * (saved - taken);
        self.parts.savings += solves * (saved - taken);
        self.parts.operations += solves * taken;
        let (w, state) = (part.window, &mut self.patch.motion.state);
        let lattice = self.patch.cache.solver.lattice();
        let (n, m) = (lattice.coefficient_dims(), lattice.sample_dims());
        let from = part.patch.state();
        paste(&mut state.p, n, w.first, w.coefficients(), &from.p);
        paste(&mut state.v, n, w.first, w.coefficients(), &from.v);
        paste(&mut state.d, m, w.first_sample, w.samples, &from.d);
        paste(&mut state.w, m, w.first_sample, w.samples, &from.w);
        if *self.patch.plasticity() != Plasticity::Elastic {
            let rests = &part.patch.springs().rest().differences;
            let into = &mut self.patch.material.network.rest_mut().differences;
            for (into, from) in into.iter_mut().zip(rests) {
                // Springs that start on the far faces may leave the part.
                let count = w.samples.map(|m| m - 1);
                let inner = crop(from, w.samples, [0; 3], count);
                paste(into, m, w.first_sample, count, &inner);
            }
        }
        Ok(report)
    }

    fn step_whole(&mut self, integrator: Integrator, dt: f64) -> Result<StepReport, PatchError> {
        let ready = self.patch.has_solver();
        let report = self.patch.step(integrator, dt)?;
        let taken = self.patch.operations();
        self.parts.operations += solves(integrator) as f64 * taken.solve;
        if !ready {
            self.parts.operations += taken.preparation;
        }
        Ok(report)
    }

    /// Sets the forces of the part too. `before` are the forces of the samples whose force may have changed: those beside
    /// the part are looked at before the next step if they may wake something.
    pub(super) fn force_changed(&mut self, before: impl Iterator<Item = (usize, T)>) {
        let Some(part) = &mut self.part else { return };
        let m = self.patch.lattice().sample_dims();
        let external = &self.patch.motion.external;
        let w = part.window;
        part.patch
            .write_force(|force| force.copy_from_slice(&crop(external, m, w.first_sample, w.samples)));
        let limit = self.thresholds.acceleration / self.patch.springs().law().scale();
        let mass = &self.patch.material.lumped.mass;
        let wakes = |(i, then): (usize, T)| {
            let change = (external[i].as_f64() - then.as_f64()).abs();
            change > limit * mass.value(i) && !w.has_sample([i / m[2] / m[1], i / m[2] % m[1], i % m[2]])
        };
        if { before }.any(wakes) {
            self.parts.steps_to_look = 0;
        }
    }

    /// Gives the part up.
    pub(super) fn drop_part(&mut self) {
        if let Some(part) = self.part.take() {
            let paid = part.earned >= 0.0;
            self.parts.patience = if paid { 1.0 } else { 2.0 * self.parts.patience };
        }
    }

    /// Chooses what is awake: all coefficients that move, or are off their balance, by more than the thresholds.
    fn look(&mut self, solves: f64) -> Result<(), PatchError> {
        let moving = self.moving();
        let whole = self.patch.operations();
        self.parts.operations += whole.look;
        let all = self.patch.lattice().coefficient_dims();
        let kept = match (&self.part, moving) {
            (Some(part), Some(moving)) => part.window.holds(moving, all),
            (part, None) => part.is_some(),
            (None, _) => false,
        };
        if !kept && self.part.is_some() {
            self.parts.growths = (self.parts.growths + 1).min(MOST_GROWTHS);
            self.drop_part();
        }
        let wanted = moving.and_then(|moving| self.window(moving));
        let smaller = |w: &Window| {
            let now = self.part.as_ref().map(|p| p.window.sample_count() as f64);
            now.is_none_or(|now| w.sample_count() as f64 <= SHRINK * now)
        };
        let Some(window) = wanted.filter(smaller) else {
            self.parts.misses = if self.part.is_some() {
                0
            } else {
                (self.parts.misses + 1).min(MOST_MISSES)
            };
            return Ok(());
        };
        self.parts.misses = 0;
        let price = self.patch.operations_on(window.coefficients(), window.samples);
        let now = self
            .part
            .as_ref()
            .map_or(whole.solve, |p| p.patch.operations().solve);
        // What the whole would have to spend instead.
        let spared = if self.part.is_some() || self.patch.has_solver() {
            0.0
        } else {
            whole.preparation - self.parts.before_whole
        };
        let cost = price.preparation;
        if now <= price.solve || cost > self.parts.savings + spared {
            let missed = solves * (now - price.solve) * LOOK as f64;
            self.parts.savings += missed.max(0.0) / self.parts.patience;
            return Ok(());
        }
        let from_savings = (cost - spared.max(0.0)).max(0.0);
        self.parts.savings -= from_savings;
        self.parts.before_whole += cost - from_savings;
        self.parts.operations += cost;
        self.parts.cuts += 1;
        self.drop_part();
        // What falls asleep stops.
        let n = self.patch.lattice().coefficient_dims();
        let moving = crop(&self.patch.motion.state.v, n, window.first, window.coefficients());
        self.patch.motion.state.v.fill(T::zero());
        paste(
            &mut self.patch.motion.state.v,
            n,
            window.first,
            window.coefficients(),
            &moving,
        );
        self.patch.sample_velocities();
        let patch = self.cut(&window)?;
        self.part = Some(Box::new(Part {
            patch,
            window,
            earned: -from_savings,
        }));
        Ok(())
    }

    /// The first and the last coefficient that is awake, on each axis; `None` if none is.
    fn moving(&mut self) -> Option<[[usize; 3]; 2]> {
        let [_, ny, nz] = self.patch.lattice().coefficient_dims();
        let scale = self.patch.springs().law().scale();
        let limits = self.thresholds;
        let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
        let speeds = self.patch.motion.state.v.clone();
        let accelerations = self.patch.unbalanced_each();
        for (i, (v, a)) in speeds.iter().zip(accelerations).enumerate() {
            let quiet = scale * v.as_f64().abs() <= limits.speed && scale * a <= limits.acceleration;
            if !quiet {
                let at = [i / nz / ny, i / nz % ny, i % nz];
                low = std::array::from_fn(|k| low[k].min(at[k]));
                high = std::array::from_fn(|k| high[k].max(at[k]));
            }
        }
        (low[0] != usize::MAX).then_some([low, high])
    }

    /// The window round what moves; `None` for the whole region.
    fn window(&self, [low, high]: [[usize; 3]; 2]) -> Option<Window> {
        let samples = self.patch.lattice().sample_dims();
        let margin = MARGIN << self.parts.growths;
        let mut window = Window {
            first: [0; 3],
            cells: [0; 3],
            first_sample: [0; 3],
            samples: [0; 3],
        };
        for k in 0..3 {
            let (cells, gaps) = (self.intervals()[k] as usize, samples[k] - 1);
            let meetings = greatest_common_divisor(cells, gaps);
            let (period, step) = (cells / meetings, gaps / meetings);
            // Function i reaches over cells i to i + 4.
            let first = low[k].saturating_sub(margin) / period;
            let end = (high[k] + 4 + margin).div_ceil(period).min(meetings);
            window.first[k] = first * period;
            window.cells[k] = (end - first) * period;
            window.first_sample[k] = first * step;
            window.samples[k] = (end - first) * step + 1;
        }
        let share = window.sample_count() as f64 / samples.iter().product::<usize>() as f64;
        (share <= WORTH).then_some(window)
    }

    /// The patch of a window, in the state that the region has there.
    fn cut(&self, w: &Window) -> Result<Patch<T>, PatchError> {
        let whole = &self.patch;
        let m = whole.lattice().sample_dims();
        let spacing = self.field_lattice.spacing(self.cells.level);
        let axis = |k: usize| -> Result<Axis, LatticeError> {
            let stride = f64::from(self.stride[k]);
            let first = f64::from(self.cells.first[k]) + stride * w.first[k] as f64;
            let length = stride * w.cells[k] as f64;
            let knots = KnotVector::uniform(3, w.cells[k], first, first + length)?;
            Axis::new(k, knots, Rim::Fixed, w.samples[k], length * spacing[k])
        };
        let axes = (|| Ok::<_, LatticeError>([axis(0)?, axis(1)?, axis(2)?]))();
        let lattice = Lattice::new(axes.expect("a part of knots and samples that are a lattice is one"));
        let samples = |from: &[T]| crop(from, m, w.first_sample, w.samples);
        let quantity = |q: &Quantity| match q {
            Quantity::Constant(v) => Quantity::Constant(*v),
            Quantity::PerSample(v) => Quantity::PerSample(crop(v, m, w.first_sample, w.samples)),
        };
        let factors = whole.material.matter.spring_factors.as_ref();
        let matter = Matter {
            stiffness: quantity(&whole.material.matter.stiffness),
            mass: quantity(&whole.material.matter.mass),
            damping: quantity(&whole.material.matter.damping),
            ground: quantity(&whole.material.matter.ground),
            spring_factors: factors.map(|f| {
                let all = f.iter().map(|f| crop(f, m, w.first_sample, w.samples));
                all.collect()
            }),
        };
        let law = whole.springs().law();
        let d = samples(&whole.motion.state.d);
        let options = whole.cache.solver.options();
        let mut part = Patch::new(lattice, matter, law, whole.material.neighbours, &d, options)?;
        part.motion.base = samples(&whole.motion.base);
        part.motion.anchor = samples(&whole.motion.anchor);
        part.write_force(|force| force.copy_from_slice(&samples(&whole.motion.external)));
        let n = whole.lattice().coefficient_dims();
        part.motion.state.p = crop(&whole.motion.state.p, n, w.first, w.coefficients());
        part.motion.state.v = crop(&whole.motion.state.v, n, w.first, w.coefficients());
        part.motion.state.w = samples(&whole.motion.state.w);
        let mut springs = whole.exact_springs();
        for s in &mut springs {
            if let Weights::Each(k) = &mut s.weights {
                *k = crop(k, m, w.first_sample, w.samples);
            }
        }
        part.material.network.set_springs(&springs);
        let rest = part.material.network.rest_mut();
        let from = whole.springs().rest();
        rest.differences = from.differences.iter().map(|r| samples(r)).collect();
        rest.scale = match &from.scale {
            Weights::Constant(s) => Weights::Constant(*s),
            Weights::Each(s) => Weights::Each(samples(s)),
        };
        part.material.plasticity = match whole.plasticity() {
            Plasticity::Kernel { rate, weights } => Plasticity::Kernel {
                rate: *rate,
                weights: samples(weights),
            },
            other => other.clone(),
        };
        Ok(part)
    }
}
