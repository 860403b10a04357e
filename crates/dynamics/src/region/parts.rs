//! Parts of a region that sleep: only a box of cells round what moves is stepped, the rest is its rim.

use bspline::{KnotVector, Real};

use super::Region;
use crate::integrators::{Integrator, StepReport};
use crate::lattice::{Axis, Lattice, LatticeError, Rim};
use crate::matter::{Matter, Quantity};
use crate::patch::{Patch, PatchError};
use crate::springs::{Plasticity, Weights};

/// Steps between two looks at the whole region, whose cost is that of its forces.
const LOOK: usize = 4;
/// Coefficients beyond those that move, on each side.
const MARGIN: usize = 3;
/// Share of the samples above which a part does not pay.
const WORTH: f64 = 0.6;

/// The part of a region that is awake.
#[derive(Clone, Debug)]
pub(super) struct Part<T> {
    pub patch: Patch<T>,
    window: Window,
}

/// A box of cells whose ends are samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Window {
    /// First free coefficient, which is also the first cell, and cells.
    first: [usize; 3],
    cells: [usize; 3],
    first_sample: [usize; 3],
    samples: [usize; 3],
}

impl Window {
    fn coefficients(&self) -> [usize; 3] {
        self.cells.map(|c| c - 3)
    }
}

/// A box of a list, z fastest.
fn crop<V: Copy>(from: &[V], dims: [usize; 3], first: [usize; 3], count: [usize; 3]) -> Vec<V> {
    let mut out = Vec::with_capacity(count.iter().product());
    rows(dims, first, count, |at| {
        out.extend_from_slice(&from[at..at + count[2]])
    });
    out
}

fn paste<V: Copy>(into: &mut [V], dims: [usize; 3], first: [usize; 3], count: [usize; 3], from: &[V]) {
    let mut row = 0;
    rows(dims, first, count, |at| {
        into[at..at + count[2]].copy_from_slice(&from[row..row + count[2]]);
        row += count[2];
    });
}

fn rows(dims: [usize; 3], first: [usize; 3], count: [usize; 3], mut f: impl FnMut(usize)) {
    for x in first[0]..first[0] + count[0] {
        for y in first[1]..first[1] + count[1] {
            f((x * dims[1] + y) * dims[2] + first[2]);
        }
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
    /// sleeps stands still until it is off its balance by more than the threshold, which is looked at every fourth step.
    /// Regions under constraints stay whole. Off at first.
    pub fn set_parts_sleep(&mut self, parts: bool) {
        self.parts_sleep = parts;
        self.part = None;
        self.steps_to_look = 0;
    }

    /// Samples that the next step moves.
    pub fn awake_samples(&self) -> usize {
        match (&self.part, self.asleep) {
            (_, true) => 0,
            (Some(part), false) => part.window.samples.iter().product(),
            (None, false) => self.patch.lattice().sample_count(),
        }
    }

    /// A step of what is awake.
    pub(super) fn step_parts(&mut self, integrator: Integrator, dt: f64) -> Result<StepReport, PatchError> {
        if !self.parts_sleep || !self.patch.constraints().is_empty() {
            self.part = None;
            return self.patch.step(integrator, dt);
        }
        if self.steps_to_look == 0 {
            self.look()?;
            self.steps_to_look = LOOK;
        }
        self.steps_to_look -= 1;
        let Some(part) = &mut self.part else {
            return self.patch.step(integrator, dt);
        };
        let report = part.patch.step(integrator, dt)?;
        let (w, state) = (part.window, &mut self.patch.state);
        let lattice = self.patch.solver.lattice();
        let (n, m) = (lattice.coefficient_dims(), lattice.sample_dims());
        let from = part.patch.state();
        paste(&mut state.p, n, w.first, w.coefficients(), &from.p);
        paste(&mut state.v, n, w.first, w.coefficients(), &from.v);
        paste(&mut state.d, m, w.first_sample, w.samples, &from.d);
        paste(&mut state.w, m, w.first_sample, w.samples, &from.w);
        if *self.patch.plasticity() != Plasticity::Elastic {
            let rests = &part.patch.springs().rest().differences;
            let into = &mut self.patch.network.rest_mut().differences;
            for (into, from) in into.iter_mut().zip(rests) {
                // Springs that start on the far faces may leave the part.
                let count = w.samples.map(|m| m - 1);
                let inner = crop(from, w.samples, [0; 3], count);
                paste(into, m, w.first_sample, count, &inner);
            }
        }
        Ok(report)
    }

    /// Chooses what is awake: all coefficients that move, or are off their balance, by more than the thresholds.
    fn look(&mut self) -> Result<(), PatchError> {
        let wanted = self.awake_window();
        if self.part.as_ref().map(|p| p.window) == wanted {
            return Ok(());
        }
        self.part = None;
        let Some(window) = wanted else { return Ok(()) };
        // What falls asleep stops.
        let n = self.patch.lattice().coefficient_dims();
        let moving = crop(&self.patch.state.v, n, window.first, window.coefficients());
        self.patch.state.v.fill(T::zero());
        paste(
            &mut self.patch.state.v,
            n,
            window.first,
            window.coefficients(),
            &moving,
        );
        self.patch.sample_velocities();
        let patch = self.cut(&window)?;
        self.part = Some(Box::new(Part { patch, window }));
        Ok(())
    }

    /// The least window round what is awake; `None` for the whole region.
    fn awake_window(&mut self) -> Option<Window> {
        let [_, ny, nz] = self.patch.lattice().coefficient_dims();
        let scale = self.patch.springs().law().scale();
        let limits = self.thresholds;
        let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
        let speeds = self.patch.state.v.clone();
        let accelerations = self.patch.unbalanced_each();
        for (i, (v, a)) in speeds.iter().zip(accelerations).enumerate() {
            if scale * v.as_f64().abs() > limits.speed || scale * a > limits.acceleration {
                let at = [i / nz / ny, i / nz % ny, i % nz];
                low = std::array::from_fn(|k| low[k].min(at[k]));
                high = std::array::from_fn(|k| high[k].max(at[k]));
            }
        }
        if low[0] == usize::MAX {
            return None;
        }
        let samples = self.patch.lattice().sample_dims();
        let mut window = Window {
            first: [0; 3],
            cells: [0; 3],
            first_sample: [0; 3],
            samples: [0; 3],
        };
        for k in 0..3 {
            let (cells, gaps) = (self.cells.count[k] as usize, samples[k] - 1);
            let meetings = greatest_common_divisor(cells, gaps);
            let (period, step) = (cells / meetings, gaps / meetings);
            // Function i reaches over cells i to i + 4.
            let first = low[k].saturating_sub(MARGIN) / period;
            let end = (high[k] + 4 + MARGIN).div_ceil(period).min(meetings);
            window.first[k] = first * period;
            window.cells[k] = (end - first) * period;
            window.first_sample[k] = first * step;
            window.samples[k] = (end - first) * step + 1;
        }
        let share =
            window.samples.iter().product::<usize>() as f64 / samples.iter().product::<usize>() as f64;
        (share <= WORTH).then_some(window)
    }

    /// The patch of a window, in the state that the region has there.
    fn cut(&self, w: &Window) -> Result<Patch<T>, PatchError> {
        let whole = &self.patch;
        let m = whole.lattice().sample_dims();
        let spacing = self.field_lattice.spacing(self.cells.level);
        let axis = |k: usize| -> Result<Axis, LatticeError> {
            let first = f64::from(self.cells.first[k]) + w.first[k] as f64;
            let knots = KnotVector::uniform(3, w.cells[k], first, first + w.cells[k] as f64)?;
            Axis::new(k, knots, Rim::Fixed, w.samples[k], w.cells[k] as f64 * spacing[k])
        };
        let axes = (|| Ok::<_, LatticeError>([axis(0)?, axis(1)?, axis(2)?]))();
        let lattice = Lattice::new(axes.expect("a part of knots and samples that are a lattice is one"));
        let samples = |from: &[T]| crop(from, m, w.first_sample, w.samples);
        let quantity = |q: &Quantity| match q {
            Quantity::Constant(v) => Quantity::Constant(*v),
            Quantity::PerSample(v) => Quantity::PerSample(crop(v, m, w.first_sample, w.samples)),
        };
        let factors = whole.matter.spring_factors.as_ref();
        let matter = Matter {
            stiffness: quantity(&whole.matter.stiffness),
            mass: quantity(&whole.matter.mass),
            damping: quantity(&whole.matter.damping),
            ground: quantity(&whole.matter.ground),
            spring_factors: factors.map(|f| {
                let all = f.iter().map(|f| crop(f, m, w.first_sample, w.samples));
                all.collect()
            }),
        };
        let law = whole.springs().law();
        let d = samples(&whole.state.d);
        let options = whole.solver.options();
        let mut part = Patch::new(lattice, matter, law, whole.neighbours, &d, options)?;
        part.base = samples(&whole.base);
        part.external = samples(&whole.external);
        let n = whole.lattice().coefficient_dims();
        part.state.p = crop(&whole.state.p, n, w.first, w.coefficients());
        part.state.v = crop(&whole.state.v, n, w.first, w.coefficients());
        part.state.w = samples(&whole.state.w);
        let rest = part.network.rest_mut();
        let from = whole.springs().rest();
        rest.differences = from.differences.iter().map(|r| samples(r)).collect();
        rest.scale = match &from.scale {
            Weights::Constant(s) => Weights::Constant(*s),
            Weights::Each(s) => Weights::Each(samples(s)),
        };
        part.plasticity = match whole.plasticity() {
            Plasticity::Kernel { rate, weights } => Plasticity::Kernel {
                rate: *rate,
                weights: samples(weights),
            },
            other => other.clone(),
        };
        Ok(part)
    }
}
