//! Speed against accuracy of patches that are no box, over the ways to solve their steps.

use bspline::Real;
use dynamics::integrators::{Integrator, StepReport};
use dynamics::lattice::{Lattice, Rim, TensorWorkspace};
use dynamics::matter::{Matter, Quantity};
use dynamics::patch::{Patch, PatchError};
use dynamics::solve::SolverOptions;
use dynamics::sparse::{Mask, MaskedWay, SparseCholesky, nested_dissection};
use dynamics::springs::{Law, Neighbours};
use serde::Serialize;

use super::{Chart, Series};

/// Coefficients that move up to which increments are held against a factor of the sparse form; beyond it against a banded one
/// in double precision, iterated to [`TIGHT`].
const FACTORIZED: usize = 1500;
const TIGHT: f64 = 1e-13;
/// Size up to which matter of the larger contrast is tried too.
const CONTRASTED: usize = 12;
/// Steps whose median is taken.
const STEPS: usize = 5;

/// The ways compared, with their names and the coefficients that move up to which they are tried.
const WAYS: [(MaskedWay, &str, usize); 4] = [
    (MaskedWay::Band, "tensor sums, banded factor", 10_000),
    (MaskedWay::Cycle, "tensor V-cycle of the box", 15_000),
    (MaskedWay::SparseFactor, "sparse factor", 3000),
    (MaskedWay::SparseIteration, "sparse iteration", 800),
];

/// What is left of a box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shape {
    All,
    Half,
    Ball,
    Shell,
}

impl Shape {
    const ALL: [Self; 4] = [Self::All, Self::Half, Self::Ball, Self::Shell];

    fn name(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Half => "half",
            Self::Ball => "tenth",
            Self::Shell => "shell",
        }
    }

    /// Whether a place of the unit cube, whose samples lie `h` apart, is inside.
    fn inside(self, p: [f64; 3], h: f64) -> bool {
        let r = p.iter().map(|c| (c - 0.5).powi(2)).sum::<f64>().sqrt();
        match self {
            Self::All => true,
            Self::Half => p[0] < 0.5,
            // A tenth of the cube.
            Self::Ball => r < 0.288,
            Self::Shell => (r - 0.35).abs() < 0.75 * h,
        }
    }
}

/// One way at one size and mask.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MaskCost {
    /// Coefficients of the box along an axis, without its rim.
    pub coefficients: usize,
    /// What is left of it: all, a half, a ball of a tenth, the shell of a sphere.
    pub mask: &'static str,
    /// Largest stiffness over smallest.
    pub contrast: f64,
    /// Coefficients that move.
    pub moving: usize,
    /// How steps are solved.
    pub way: &'static str,
    /// Processor time of what the first step makes, ms.
    pub setup_ms: f64,
    /// Processor time of a step, ms; the median.
    pub step_ms: f64,
    /// `‖A(x − x*)‖/‖Ax*‖` of the samples inside, `x*` in double precision; the worst of three loads.
    pub increment_error: f64,
    /// The same of the samples outside, relative to the motion inside too.
    pub outside_error: f64,
    /// Most iterations that a load took.
    pub iterations: usize,
    /// Whether all loads were solved.
    pub converged: bool,
    /// What a user gets without options.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub default: bool,
}

/// A box with a mask, its matter and its loads.
struct Scene {
    coefficients: usize,
    samples: usize,
    shape: Shape,
    contrast: f64,
    dt: f64,
    loads: Vec<Vec<f64>>,
}

impl Scene {
    fn new(coefficients: usize, shape: Shape, contrast: f64) -> Result<Self, PatchError> {
        // 4/3 samples a cell.
        let samples = (4.0 / 3.0 * (coefficients + 3) as f64).round() as usize + 1;
        let mut out = Self {
            coefficients,
            samples,
            shape,
            contrast,
            dt: 1.0,
            loads: Vec::new(),
        };
        let gauss = |c: [f64; 3]| {
            let r = 2.0 / (samples - 1) as f64;
            move |p: [f64; 3]| {
                let d2: f64 = (0..3).map(|a| (p[a] - c[a]).powi(2)).sum();
                (-0.5 * d2 / (r * r)).exp()
            }
        };
        // On the sphere of the shell and in the ball, in both materials, and everywhere.
        let smooth = |[x, y, z]: [f64; 3]| (1.3 * x + 0.4).sin() * (2.1 * y - 0.3).cos() * (1.0 + z * z);
        let all: [&dyn Fn([f64; 3]) -> f64; 3] = [&gauss([0.28, 0.4, 0.5]), &gauss([0.4, 0.6, 0.3]), &smooth];
        out.loads = all.iter().map(|load| out.on_samples(load)).collect();
        let mut patch = out.patch::<f64>(SolverOptions::default())?;
        out.dt = 30.0 * patch.explicit_limit()?;
        Ok(out)
    }

    fn on_samples<V>(&self, value: impl Fn([f64; 3]) -> V) -> Vec<V> {
        let m = self.samples;
        let at = |i: usize| [i / m / m, i / m % m, i % m].map(|i| i as f64 / (m - 1) as f64);
        (0..m * m * m).map(|i| value(at(i))).collect()
    }

    /// The patch at rest, three strokes across it stiff.
    fn patch<T: Real>(&self, options: SolverOptions) -> Result<Patch<T>, PatchError> {
        let h = 1.0 / (self.samples - 1) as f64;
        let lattice = Lattice::<T>::cube(self.coefficients + 6, self.samples, Rim::Fixed, 1.0)
            .expect("at least as many samples as coefficients");
        let stiff = |[x, y, z]: [f64; 3]| {
            let stroke = (x - y).abs().min((y - z).abs()).min((x + z - 1.0).abs());
            if stroke < 0.08 { self.contrast } else { 1.0 }
        };
        let matter = Matter {
            stiffness: Quantity::PerSample(self.on_samples(stiff)),
            ..Matter::default()
        };
        let d: Vec<T> = self.on_samples(|[x, ..]| T::from_f64(0.5 - x));
        let inside = self.on_samples(|p| self.shape.inside(p, h));
        let mask = Mask::new(&lattice, inside, Rim::Free, Neighbours::Six)?;
        let law = Law::Linear { scale: 1.0 };
        Patch::new(lattice, matter, law, Neighbours::Six, &d, options)?.with_mask(mask)
    }

    /// What a step from rest moves under a load.
    fn moved<T: Real>(
        &self,
        patch: &mut Patch<T>,
        load: &[f64],
    ) -> Result<(Vec<f64>, StepReport), PatchError> {
        let zeros = vec![T::zero(); patch.lattice().coefficient_count()];
        patch.set_state(&zeros, &zeros)?;
        patch.set_force(&load.iter().map(|f| T::from_f64(*f)).collect::<Vec<_>>())?;
        let report = patch.step(Integrator::Paper, self.dt)?;
        let mut moved = vec![T::zero(); patch.lattice().sample_count()];
        let lattice = patch.lattice();
        lattice.sample(&patch.state().p, &mut moved, &mut TensorWorkspace::new());
        Ok((moved.into_iter().map(Real::as_f64).collect(), report))
    }

    /// The same in double precision: by a factor of the assembled sparse form where there is room for one.
    fn exact(&self) -> Result<Vec<Vec<f64>>, PatchError> {
        let mut patch = self.patch::<f64>(SolverOptions {
            masked: MaskedWay::Band,
            iterations: 100,
            tolerance: Some(TIGHT),
            ..SolverOptions::default()
        })?;
        let mask = patch.mask().expect("made with one");
        let moving = mask.moving().to_vec();
        if moving.len() > FACTORIZED {
            let solved = |load: &Vec<f64>| Ok(self.moved(&mut patch, load)?.0);
            return self.loads.iter().map(solved).collect();
        }
        let inside = mask.inside().to_vec();
        let [_, ny, nz] = patch.lattice().coefficient_dims();
        let places: Vec<_> = moving
            .iter()
            .map(|i| [i / nz / ny, i / nz % ny, i % nz])
            .collect();
        let forms = patch.sparse_forms();
        let h = forms.step(0.5 * self.dt, self.dt * self.dt);
        let mut factor = SparseCholesky::plan(&h, nested_dissection(&h, &places));
        factor.factorize(&h).expect("masses are positive");
        let multiply = |m, x: &[f64], rows: usize| {
            let mut y = vec![0.0; rows];
            dynamics::sparse::multiply(m, x, &mut y);
            y
        };
        let solved = |load: &Vec<f64>| {
            let pushed = load.iter().zip(&inside);
            let pushed: Vec<f64> = pushed
                .map(|(f, i)| if *i { self.dt * self.dt * f } else { 0.0 })
                .collect();
            let b = multiply(forms.sampling.transposed(), &pushed, moving.len());
            let mut x = b.clone();
            factor.solve(&mut x);
            let left = multiply(&h, &x, moving.len());
            let mut left: Vec<f64> = b.iter().zip(&left).map(|(b, l)| b - l).collect();
            factor.solve(&mut left);
            let x: Vec<f64> = x.iter().zip(&left).map(|(x, l)| x + l).collect();
            multiply(forms.sampling.matrix(), &x, inside.len())
        };
        Ok(self.loads.iter().map(solved).collect())
    }

    fn judge(
        &self,
        (way, name): (MaskedWay, &'static str),
        exact: &[Vec<f64>],
        clock: fn() -> f64,
    ) -> Result<MaskCost, PatchError> {
        let options = SolverOptions {
            masked: way,
            ..SolverOptions::default()
        };
        let mut patch = self.patch::<f32>(options)?;
        let mask = patch.mask().expect("made with one");
        let (inside, moving) = (mask.inside().to_vec(), mask.moving().len());
        let mut out = MaskCost {
            coefficients: self.coefficients,
            mask: self.shape.name(),
            contrast: self.contrast,
            moving,
            way: name,
            setup_ms: 0.0,
            step_ms: 0.0,
            increment_error: 0.0,
            outside_error: 0.0,
            iterations: 0,
            converged: true,
            default: self.patch::<f32>(SolverOptions::default())?.masked_way() == Some(way),
        };
        let start = clock();
        for (i, (load, exact)) in self.loads.iter().zip(exact).enumerate() {
            let (moved, report) = self.moved(&mut patch, load)?;
            if i == 0 {
                out.setup_ms = 1e3 * (clock() - start);
            }
            let (mut wrong, mut beside, mut size) = (0.0, 0.0, 0.0);
            for ((a, b), inside) in moved.iter().zip(exact).zip(&inside) {
                *(if *inside { &mut wrong } else { &mut beside }) += (a - b).powi(2);
                size += if *inside { b * b } else { 0.0 };
            }
            out.increment_error = out.increment_error.max((wrong / size).sqrt());
            out.outside_error = out.outside_error.max((beside / size).sqrt());
            out.iterations = out.iterations.max(report.solve.iteration.iterations);
            out.converged &= report.solve.converged();
        }
        let mut times = Vec::new();
        for _ in 0..STEPS {
            let start = clock();
            patch.step(Integrator::Paper, self.dt)?;
            times.push(1e3 * (clock() - start));
        }
        times.sort_by(f64::total_cmp);
        out.step_ms = times[STEPS / 2];
        out.setup_ms = (out.setup_ms - out.step_ms).max(0.0);
        Ok(out)
    }
}

/// Cost and error of each way, over sizes and masks; `show` is given each when it is there and says whether to go on.
///
/// # Errors
/// [`PatchError`].
pub fn mask_costs(
    quick: bool,
    clock: fn() -> f64,
    mut show: impl FnMut(&MaskCost, f64) -> bool,
) -> Result<Vec<MaskCost>, PatchError> {
    let sizes: &[usize] = if quick { &[6] } else { &[6, 9, 12, 18, 24] };
    let contrasts: &[f64] = if quick { &[100.0] } else { &[100.0, 1e4] };
    let mut out = Vec::new();
    for (i, &coefficients) in sizes.iter().enumerate() {
        for (j, shape) in Shape::ALL.into_iter().enumerate() {
            let tried = |c: &&f64| **c <= 100.0 || coefficients <= CONTRASTED;
            for &contrast in contrasts.iter().filter(tried) {
                let scene = Scene::new(coefficients, shape, contrast)?;
                let exact = scene.exact()?;
                let patch = scene.patch::<f32>(SolverOptions::default())?;
                let moving = patch.mask().map_or(0, |m| m.moving().len());
                for (way, name, _) in WAYS.into_iter().filter(|w| moving <= w.2) {
                    let cost = scene.judge((way, name), &exact, clock)?;
                    let done = (4 * i + j) as f64 / (4 * sizes.len()) as f64;
                    let go_on = show(&cost, done);
                    out.push(cost);
                    if !go_on {
                        return Ok(out);
                    }
                }
            }
        }
    }
    Ok(out)
}

impl Chart {
    /// Error over the time of a step, time of a step and of its set-up over the coefficients that move; with the names of
    /// their files.
    pub fn of_masks(costs: &[MaskCost]) -> [(&'static str, Self); 3] {
        let mildest = costs.iter().map(|c| c.contrast).fold(f64::INFINITY, f64::min);
        let series = |point: &dyn Fn(&MaskCost) -> (f64, f64)| {
            let one = |name: &str| {
                let of = costs.iter().filter(|c| c.way == name && c.contrast == mildest);
                let label = |c: &MaskCost| format!("{}³ {}", c.coefficients, c.mask);
                let mut points: Vec<_> = of.map(|c| (point(c).0, point(c).1, label(c))).collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                Series {
                    name: name.to_owned(),
                    points,
                }
            };
            WAYS.iter().map(|w| one(w.1)).collect()
        };
        let title =
            |what: &str| format!("{what}: masks on 6³ to 24³ coefficients, stiff layers {mildest}:1, f32");
        let moving = "coefficients that move";
        let chart = |what: &str, x_title: &str, y_title: &str, is_joined, series| Self {
            title: title(what),
            x_title: x_title.into(),
            y_title: y_title.into(),
            depth: 1e-9,
            is_joined,
            series,
        };
        [
            (
                "error",
                chart(
                    "error of the increment, Δt 30 × explicit limit",
                    "processor time of a step, ms",
                    "‖A(x − x*)‖/‖Ax*‖ inside, worst of three loads",
                    false,
                    series(&|c| (c.step_ms, c.increment_error)),
                ),
            ),
            (
                "step",
                chart(
                    "time of a step",
                    moving,
                    "processor time of a step, ms",
                    false,
                    series(&|c| (c.moving as f64, c.step_ms)),
                ),
            ),
            (
                "setup",
                chart(
                    "time of set-up",
                    moving,
                    "processor time of what the first step makes, ms",
                    false,
                    series(&|c| (c.moving as f64, c.setup_ms)),
                ),
            ),
        ]
    }
}
