//! A point tool on the patches of \[Hua04 table 2\]: free ends, clamped knots.

use bspline::polygonize::{BlockMesh, PolygonizeOptions};
use bspline::tensor::TensorSpline;
use bspline::{Aabb, Basis, Field, Frame, KnotVector};
use dynamics::integrators::Integrator;
use dynamics::lattice::{Lattice, OnBox, Rim, SampleBox};
use dynamics::matter::{Matter, Quantity};
use dynamics::region::{TensorOptions, TensorRegion};
use dynamics::solve::SolverOptions;
use dynamics::springs::{Law, Neighbours};
use glam::{DAffine3, DVec3};

use super::StudyError;
use crate::force::quadrature::{Node, Tolerance};
use crate::force::{Path, Span, Target};

/// \[Hua04 table 2\]: coefficients and samples on an axis, and the milliseconds that it prints for the simulation and the graphical
/// update.
pub const TABLE_2: [(usize, usize, f64); 5] = [
    (5, 10, 1.0),
    (10, 10, 6.9),
    (10, 15, 15.8),
    (15, 15, 38.2),
    (15, 20, 74.9),
];
/// Radius of the tool in distances of samples.
const RADIUS: f64 = 1.5;
/// Way of the tool over its radius.
const DRAG: f64 = 1.6;
/// Clay: flow of a step, and what its damping and mass are made of, as the force tools have them.
const FLOW: f64 = 0.1;
const MASS: f64 = 0.1;
/// Softness of the path over its stiffness.
const SOFT: f64 = 0.01;
/// Springs that keep the patch where it is, over those of a tool's radius.
const GROUND: f64 = 0.02;

/// Shares of a path at which its force is spread, and their weights.
const NODES: [(f64, f64); 3] = [
    (0.112_701_665_379_258_3, 5.0 / 18.0),
    (0.5, 8.0 / 18.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

/// A point tool at work on a patch.
pub struct PatchPull {
    region: TensorRegion<f32>,
    field: TensorSpline<f32>,
    mesh: BlockMesh,
    all: Aabb,
    target: Target,
    force: f64,
    steps: usize,
    crossing: f64,
    overshoot: f64,
    steps_to_99: Option<usize>,
}

impl PatchPull {
    /// Way of the tool over its radius.
    pub const DRAG: f64 = DRAG;

    /// `n³` coefficients and `m³` samples, even or with a half ten times as stiff.
    ///
    /// # Errors
    /// [`StudyError`].
    pub fn new(n: usize, m: usize, painted: bool) -> Result<Self, StudyError> {
        let edge = (m - 1) as f64;
        let knots = KnotVector::clamped_uniform(3, n - 3, 0.0, 1.0).expect("cells of a patch");
        let knots = [knots.clone(), knots.clone(), knots];
        let height = |ijk: [usize; 3]| (edge * (0.5 - TensorSpline::<f32>::greville(&knots, ijk).z)) as f32;
        let coefficients = TensorSpline::<f32>::indices(&knots).map(height).collect();
        let map = DAffine3::from_scale(DVec3::splat(edge));
        let field = TensorSpline::new(knots.clone(), coefficients, map, 1.0).expect("a linear field");
        let over_radius = 1.0 / (RADIUS * RADIUS);
        let mut matter = Matter {
            mass: Quantity::Constant(MASS * over_radius),
            damping: Quantity::Constant(over_radius),
            ground: Quantity::Constant(GROUND * over_radius),
            ..Matter::default()
        };
        if painted {
            let stiffness = matter.stiffness.paint(m * m * m).iter_mut().enumerate();
            stiffness
                .filter(|(i, _)| i / (m * m) < m / 2)
                .for_each(|(_, k)| *k = 10.0);
        }
        let options = TensorOptions {
            samples: [m; 3],
            rim: Rim::Free,
            law: Law::Linear { scale: 1.0 },
            neighbours: Neighbours::Six,
            solver: SolverOptions::default(),
        };
        let region = TensorRegion::new(&field, matter, &options)?;
        let all = Aabb {
            min: DVec3::ZERO,
            max: DVec3::splat(edge),
        };
        let frame = Frame::over(&all, [(m - 1) as u32; 3]);
        let (mesh, _) = BlockMesh::new(&field, &frame, &PolygonizeOptions::default())?;
        let from = DVec3::splat(0.5 * edge);
        let path = Path::through([from, from + DRAG * RADIUS * DVec3::Z])?;
        Ok(Self {
            region,
            field,
            mesh,
            all,
            target: Target::single(path, true),
            force: 0.0,
            steps: 0,
            crossing: 0.0,
            overshoot: 0.0,
            steps_to_99: None,
        })
    }

    /// Force, step, mesh of the whole patch.
    ///
    /// # Errors
    /// [`StudyError`].
    pub fn step(&mut self) -> Result<(), StudyError> {
        self.steps += 1;
        let length = self.target.path.length();
        let goal = length * (self.steps as f64 * 0.3 * RADIUS / length).min(1.0);
        let least = 1e-6 * RADIUS;
        let (from, to) = (
            self.crossing.min(goal),
            self.crossing.max(goal).max(self.crossing.min(goal) + least),
        );
        let exact = Tolerance {
            relative: 1e-4,
            mean: 1e-5 * RADIUS,
        };
        let span = Span {
            from,
            to,
            is_gap: false,
        };
        let integral = self.target.integral(|p| self.field.value(p), 0.0, span, exact);
        let short = integral.value / (to - from);
        let (at, kernel) = self.kernel(from, to);
        let load = |force: f64| kernel.iter().map(|j| (force * j) as f32).collect::<Vec<f32>>();
        let row = self.row(&integral.nodes);
        self.force *= libm::exp(-FLOW);
        let before = self.region.patch().state().p.clone();
        let values = load(self.force);
        let patch = self.region.patch_mut();
        patch.set_force_on(OnBox { at, values: &values })?;
        patch.step(Integrator::Paper, FLOW)?;
        let moved: Vec<f32> = patch.state().p.iter().zip(&before).map(|(a, b)| a - b).collect();
        let values = load(1.0);
        let answer = patch.respond_as_step(Integrator::Paper, FLOW, &OnBox { at, values: &values })?;
        let stiffness = worth(&row, &answer.p);
        let more = (short - worth(&row, &moved) - SOFT * stiffness * self.force) / (stiffness * (1.0 + SOFT));
        self.force += more;
        patch.add_responses(&[(more, answer)], FLOW)?;
        let d = patch.state().d.clone();
        patch.springs_mut().relax(&d, -libm::expm1(-FLOW));
        self.field = self.region.bake()?;
        self.mesh.update(&self.field, &[self.all])?;
        let value = |p| self.field.value(p);
        let found = self.target.crossing(&value, 0.0, RADIUS, 0.25 * RADIUS);
        self.crossing = found.unwrap_or(self.crossing);
        self.overshoot = self.overshoot.max(self.arrival() - 1.0);
        if self.steps_to_99.is_none() && (self.arrival() - 1.0).abs() <= 0.01 {
            self.steps_to_99 = Some(self.steps);
        }
        Ok(())
    }

    /// What a change of each coefficient is worth to the mean over the nodes of an integral.
    fn row(&self, nodes: &[Node]) -> Vec<(usize, f64)> {
        let whole: f64 = nodes.iter().map(|n| n.weight).sum();
        let to_parameter = self.field.world_from_parameter().inverse();
        let [_, ny, nz] = self.field.shape();
        let mut row = Vec::with_capacity(64 * nodes.len());
        for node in nodes {
            let at = to_parameter
                .transform_point3(self.target.path.at(node.at))
                .to_array();
            let [x, y, z]: [Basis<f64>; 3] =
                std::array::from_fn(|a| Basis::at(&self.field.knots()[a], at[a], 0));
            for (i, wx) in x.values().iter().enumerate() {
                for (j, wy) in y.values().iter().enumerate() {
                    let line = ((x.first() + i) * ny + y.first() + j) * nz + z.first();
                    let weight = wx * wy * node.weight / whole;
                    row.extend(
                        z.values()
                            .iter()
                            .enumerate()
                            .map(|(k, wz)| (line + k, weight * wz)),
                    );
                }
            }
        }
        row
    }

    /// Shares of the samples in the force of a path, adding up to 1.
    fn kernel(&self, from: f64, to: f64) -> (SampleBox, Vec<f64>) {
        let lattice: &Lattice<f32> = self.region.patch().lattice();
        let places = NODES.map(|(share, weight)| (self.target.path.at(from + share * (to - from)), weight));
        let reach = 4.0 * RADIUS;
        let at = places.iter().fold(SampleBox::default(), |all, (p, _)| {
            all.joined(lattice.samples_near(p.to_array(), reach))
        });
        let mut sums = vec![0.0; at.len()];
        for (p, weight) in places {
            let along = |a: usize| -> Vec<f64> {
                let fall = |i: usize| {
                    let away = ((at.first[a] + i) as f64 * lattice.spacing()[a] - p[a]) / RADIUS;
                    libm::exp(-0.5 * away * away)
                };
                (0..at.count[a]).map(fall).collect()
            };
            let [x, y, z] = [0, 1, 2].map(along);
            let rows = x.iter().flat_map(|x| y.iter().map(move |y| weight * x * y));
            for (line, factor) in sums.chunks_exact_mut(z.len().max(1)).zip(rows) {
                line.iter_mut().zip(&z).for_each(|(sum, z)| *sum += factor * z);
            }
        }
        let whole: f64 = sums.iter().sum();
        sums.iter_mut().for_each(|s| *s /= whole);
        (at, sums)
    }

    /// Share of the way that the surface has gone.
    pub fn arrival(&self) -> f64 {
        self.crossing / self.target.path.length()
    }

    /// The most that it was ahead of its end, as a share of the way.
    pub fn overshoot(&self) -> f64 {
        self.overshoot.max(0.0)
    }

    /// Steps until it was within a hundredth of its end.
    pub fn steps_to_99(&self) -> Option<usize> {
        self.steps_to_99
    }
}

/// What a change of the coefficients is worth to a row.
fn worth(row: &[(usize, f64)], change: &[f32]) -> f64 {
    row.iter().map(|(i, w)| w * f64::from(change[*i])).sum()
}
