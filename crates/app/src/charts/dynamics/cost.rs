use dynamics::integrators::Integrator;
use dynamics::lattice::{Lattice, Rim, TensorWorkspace};
use dynamics::patch::Patch;
use dynamics::solve::SolverOptions;
use dynamics::springs::Neighbours;
use dynamics::study::{Configuration, Pattern, loads};

use super::step::patch;
use super::{DynamicsError, Extent, Run, median_seconds};

/// What a step of a patch costs, as processor seconds per sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// Samples along an axis.
    pub samples: usize,
    /// Springs, sampling and gathering: what is paid whatever the solver.
    pub operators: f64,
    /// A whole step of even material.
    pub even: f64,
    /// A whole step with a ball a hundred times as stiff; missing where it was not measured.
    pub painted: Option<f64>,
}

/// Seconds per sample over the size of a patch with a fixed rim, in single precision, 4/3 samples per cell.
///
/// # Errors
/// [`DynamicsError`].
pub fn cost(extent: Extent, run: &mut Run) -> Result<Vec<Cost>, DynamicsError> {
    let (even, painted): (&[usize], usize) = match extent {
        Extent::Quick => (&[10, 16], 16),
        Extent::Charts => (&[10, 16, 20, 32, 48, 64, 96, 128], 32),
        Extent::All => (&[10, 16, 20, 32, 48, 64, 96, 128], 64),
    };
    let mut out = Vec::new();
    for (i, &samples) in even.iter().enumerate() {
        if !(run.go_on)(i as f64 / even.len() as f64) {
            return Err(DynamicsError::Cancelled);
        }
        let each = (samples * samples * samples) as f64;
        let mut one = made(samples, 1.0)?;
        let operators = operators(&mut one, run.clock)?;
        out.push(Cost {
            samples,
            operators: operators / each,
            even: stepped(&mut one, samples, run.clock)? / each,
            painted: match samples <= painted {
                true => Some(stepped(&mut made(samples, 100.0)?, samples, run.clock)? / each),
                false => None,
            },
        });
    }
    Ok(out)
}

fn made(samples: usize, contrast: f64) -> Result<Patch<f32>, DynamicsError> {
    let configuration = Configuration {
        // Cells of 4/3 samples, whole ones, and three functions more than cells.
        coefficients: (0.75 * (samples - 1) as f64).round() as usize + 3,
        samples,
        rim: Rim::Fixed,
        pattern: if contrast == 1.0 {
            Pattern::Uniform
        } else {
            Pattern::StiffBall
        },
        contrast,
        mass_contrast: 1.0,
        dt_over_limit: 30.0,
        neighbours: Neighbours::Six,
        four_d: false,
    };
    patch(&configuration, SolverOptions::default())
}

/// Springs, `A` and `Aᵀ` once each.
fn operators(patch: &mut Patch<f32>, clock: fn() -> f64) -> Result<f64, DynamicsError> {
    let axes = patch.lattice().axes().clone();
    let lattice = Lattice::<f32>::new(axes);
    let d = patch.state().d.clone();
    let (mut force, mut p) = (vec![0.0; d.len()], vec![0.0; lattice.coefficient_count()]);
    let mut w = TensorWorkspace::new();
    let mut moved = d.clone();
    Ok(median_seconds(clock, || {
        patch.springs_mut().add_forces(&d, &mut force);
        lattice.gather(&force, &mut p, &mut w);
        lattice.sample(&p, &mut moved, &mut w);
    }))
}

fn stepped(patch: &mut Patch<f32>, samples: usize, clock: fn() -> f64) -> Result<f64, DynamicsError> {
    let force: Vec<f32> = loads(samples)[0].iter().map(|f| 1e-3 * *f as f32).collect();
    patch.set_force(&force)?;
    let dt = 30.0 * patch.explicit_limit()?;
    let mut failed = None;
    // The first one makes what the others keep.
    patch.step(Integrator::Paper, dt)?;
    let seconds = median_seconds(clock, || {
        if let Err(e) = patch.step(Integrator::Paper, dt) {
            failed = Some(e);
        }
    });
    failed.map_or(Ok(seconds), |e| Err(e.into()))
}
