use bspline::Basis;
use dynamics::integrators::Integrator;
use dynamics::lattice::{Lattice, LatticeError, Rim};
use dynamics::matter::{Matter, Quantity};
use dynamics::patch::Patch;
use dynamics::solve::SolverOptions;
use dynamics::springs::{Law, Neighbours};
use dynamics::study::StudyError;
use glam::DVec3;

use super::{DynamicsError, Extent, Run};

/// How wide bumps are that a Gaussian force of standard deviation 1 pulls out of planes.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Springs.
    pub law: &'static str,
    /// 6, 18 or 26.
    pub neighbours: usize,
    /// Samples per standard deviation.
    pub samples_per_radius: f64,
    /// Full widths at half maximum, along two tangents of each of the planes 100, 110 and 111.
    pub widths: Vec<f64>,
}

impl Profile {
    /// Widest over narrowest, less 1.
    pub fn anisotropy(&self) -> f64 {
        let widest = self.widths.iter().copied().fold(0.0, f64::max);
        let narrowest = self.widths.iter().copied().fold(f64::INFINITY, f64::min);
        widest / narrowest - 1.0
    }

    /// Mean width.
    pub fn mean(&self) -> f64 {
        self.widths.iter().sum::<f64>() / self.widths.len() as f64
    }
}

/// Half the edge of the cube, in standard deviations of the force, as the bump feels it: the fixed layers take
/// [`RIM`] cells on each side.
const HALF: f64 = 4.0;
const RIM: f64 = 0.58;
/// Force over κσ²; lifts the tip of 4-D springs by about one standard deviation.
const FORCE: f64 = 30.0;

/// Half the edge of a cube of `m` samples, 4/3 a cell.
fn half_edge(m: usize) -> f64 {
    HALF / (1.0 - RIM * 8.0 / 3.0 / (m - 1) as f64)
}

/// Normals of the planes with two tangents each.
fn planes() -> [[DVec3; 3]; 3] {
    let v = |x: f64, y: f64, z: f64| DVec3::new(x, y, z).normalize();
    [
        [v(0.0, 0.0, 1.0), v(1.0, 0.0, 0.0), v(1.0, 1.0, 0.0)],
        [v(0.0, 1.0, 1.0), v(1.0, 0.0, 0.0), v(0.0, 1.0, -1.0)],
        [v(1.0, 1.0, 1.0), v(1.0, -1.0, 0.0), v(1.0, 1.0, -2.0)],
    ]
}

/// Widths of bumps at rest, by law, neighbours and sampling; the box and the force stay the same.
///
/// # Errors
/// [`DynamicsError`].
pub fn sampling(extent: Extent, run: &mut Run) -> Result<Vec<Profile>, DynamicsError> {
    let samples: &[usize] = match extent {
        Extent::Quick => &[9],
        Extent::Charts => &[9, 13, 17, 21, 25],
        Extent::All => &[9, 13, 17, 21, 25, 33],
    };
    let kinds = [
        (false, Neighbours::Six, 6),
        (false, Neighbours::Eighteen, 18),
        (true, Neighbours::Six, 6),
        (true, Neighbours::Eighteen, 18),
        (true, Neighbours::TwentySix, 26),
    ];
    let mut out = Vec::new();
    for (i, (four_d, neighbours, count)) in kinds.into_iter().enumerate() {
        for (j, &m) in samples.iter().enumerate() {
            let done = (i * samples.len() + j) as f64 / (kinds.len() * samples.len()) as f64;
            if !(run.go_on)(done) {
                return Err(DynamicsError::Cancelled);
            }
            let mut widths = Vec::new();
            for [normal, first, second] in planes() {
                let bump = Bump::new(m, four_d, neighbours, normal)?;
                widths.extend([bump.width(first), bump.width(second)]);
            }
            out.push(Profile {
                law: if four_d { "4-d" } else { "linear" },
                neighbours: count,
                samples_per_radius: (m - 1) as f64 / (2.0 * half_edge(m)),
                widths,
            });
        }
    }
    Ok(out)
}

/// A bump at rest.
struct Bump {
    lattice: Lattice<f64>,
    half_edge: f64,
    p: Vec<f64>,
}

impl Bump {
    fn new(m: usize, four_d: bool, neighbours: Neighbours, normal: DVec3) -> Result<Self, DynamicsError> {
        let half_edge = half_edge(m);
        let h = 2.0 * half_edge / (m - 1) as f64;
        let lattice = |e: LatticeError| DynamicsError::Study(StudyError::from(e));
        let lattice = Lattice::<f64>::cube(3 * (m - 1) / 4 + 3, m, Rim::Fixed, h).map_err(lattice)?;
        let at = |i: usize| {
            let ijk = [i / (m * m), i / m % m, i % m].map(|c| c as f64 * h - half_edge);
            DVec3::from_array(ijk)
        };
        let d: Vec<f64> = (0..m * m * m).map(|i| -normal.dot(at(i))).collect();
        let kernel: Vec<f64> = (0..m * m * m)
            .map(|i| (-0.5 * at(i).length_squared()).exp())
            .collect();
        let sum: f64 = kernel.iter().sum();
        let law = if four_d {
            Law::FourD { scale: 1.0 }
        } else {
            Law::Linear { scale: 1.0 }
        };
        // Light and damped: steps of eq. 12 go to rest like Newton's method.
        let matter = Matter {
            mass: Quantity::Constant(1e-3),
            damping: Quantity::Constant(0.1),
            ..Matter::default()
        };
        let mut patch = Patch::new(
            lattice.clone(),
            matter,
            law,
            neighbours,
            &d,
            SolverOptions::default(),
        )?;
        let force: Vec<f64> = kernel.iter().map(|k| FORCE * k / sum).collect();
        patch.set_force(&force)?;
        let (mut dt, mut before) = (0.05, 0.0);
        for _ in 0..60 {
            patch.step(Integrator::Paper, dt)?;
            let tip = patch.state().d[(m * m * m) / 2];
            if (tip - before).abs() < 1e-5 * tip.abs() {
                break;
            }
            (before, dt) = (tip, f64::min(2.0 * dt, 10.0));
        }
        Ok(Self {
            p: patch.state().p.clone(),
            half_edge,
            lattice,
        })
    }

    /// Change of the density at a place.
    fn at(&self, q: DVec3) -> f64 {
        let dims = self.lattice.coefficient_dims();
        let axes: [Vec<(usize, f64)>; 3] = std::array::from_fn(|a| {
            let axis = &self.lattice.axes()[a];
            let [start, end] = axis.knots().domain();
            let t = start + (end - start) * (q[a] + self.half_edge) / (2.0 * self.half_edge);
            let basis: Basis<f64> = Basis::at(axis.knots(), t, 0);
            let all = basis.values().iter().enumerate();
            let free =
                all.filter_map(|(j, w)| Some(((basis.first() + j).checked_sub(axis.first_free())?, *w)));
            free.filter(|(j, _)| *j < axis.free_count()).collect()
        });
        let [x, y, z] = &axes;
        let mut sum = 0.0;
        for (i, a) in x {
            for (j, b) in y {
                for (k, c) in z {
                    sum += a * b * c * self.p[(i * dims[1] + j) * dims[2] + k];
                }
            }
        }
        sum
    }

    /// Full width at half maximum along a line through the tip.
    fn width(&self, along: DVec3) -> f64 {
        let half = 0.5 * self.at(DVec3::ZERO);
        let side = |sign: f64| {
            let (mut lo, mut hi) = (0.0, HALF);
            for _ in 0..40 {
                let mid = 0.5 * (lo + hi);
                if self.at(sign * mid * along) > half {
                    lo = mid;
                } else {
                    hi = mid;
                }
            }
            lo
        };
        side(1.0) + side(-1.0)
    }
}
