use bspline::Real;
use dynamics::integrators::Integrator;
use dynamics::lattice::Rim;
use dynamics::springs::Neighbours;
use dynamics::study::{Configuration, Pattern, Reference, Solver};

use super::control::solve_seconds;
use super::step::{Increments, patch};
use super::{DynamicsError, Line, Run, median_seconds};

/// How much is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// Small patches alone: seconds.
    Quick,
    /// What the charts show: minutes.
    Charts,
    /// All sizes, patterns, contrasts and steps: hours.
    All,
}

/// What a step of a region is without options: its scheme.
const DEFAULT: Integrator = Integrator::TrBdf2;

/// What is measured of a configuration.
#[derive(Clone, Copy, Debug)]
enum Task {
    /// Steps of a patch by the default solver.
    Step(Integrator),
    /// Solves of eq. 12 by several solvers with several caps.
    Solvers,
}

/// The painted patterns of a contrast; none of an even one.
fn patterns(contrast: f64, painted: &[Pattern]) -> &[Pattern] {
    if contrast == 1.0 {
        &[Pattern::Uniform]
    } else {
        painted
    }
}

fn tasks(extent: Extent) -> Vec<(Configuration, Task)> {
    let mut out = Vec::new();
    let mut add =
        |size: (usize, usize), rim, contrast: f64, painted: &[Pattern], dts: &[f64], four_d, task| {
            for &pattern in patterns(contrast, painted) {
                for &dt_over_limit in dts {
                    let neighbours = if four_d {
                        Neighbours::Eighteen
                    } else {
                        Neighbours::Six
                    };
                    let configuration = Configuration {
                        coefficients: size.0,
                        samples: size.1,
                        rim,
                        pattern,
                        contrast,
                        mass_contrast: 1.0,
                        dt_over_limit,
                        neighbours,
                        four_d,
                    };
                    out.push((configuration, task));
                }
            }
        };
    let (free, fixed) = (Rim::Free, Rim::Fixed);
    let default = Task::Step(DEFAULT);
    let eq12 = Task::Step(Integrator::Paper);
    let few = [Pattern::StiffBall, Pattern::Bone];
    let (quick, all) = (extent == Extent::Quick, extent == Extent::All);
    // The paper's sizes, uniform as there: its Table 2.
    let table2 = [(5, 10), (10, 10), (10, 15), (15, 15), (15, 20)];
    for size in &table2[..if quick { 1 } else { 5 }] {
        add(*size, free, 1.0, &[], &[1.0, 10.0], false, Task::Solvers);
        for task in [default, eq12] {
            add(*size, free, 1.0, &[], &[1.0, 30.0], false, task);
        }
    }
    // Which preconditioner pays.
    let size = if quick { (5, 10) } else { (15, 20) };
    for contrast in [100.0, 1e4] {
        add(
            size,
            free,
            contrast,
            &[Pattern::StiffBall],
            &[30.0],
            false,
            Task::Solvers,
        );
    }
    // The default step over materials, steps and laws.
    let steps: &[f64] = if quick { &[30.0] } else { &[0.1, 1.0, 10.0, 30.0] };
    let small: &[(usize, usize)] = if quick {
        &[(5, 10)]
    } else {
        &[(5, 10), (10, 10), (10, 15)]
    };
    for size in small {
        for contrast in [1e2, 1e3, 1e4] {
            let painted = if quick { &few[..] } else { &Pattern::PAINTED[..] };
            add(
                *size,
                free,
                contrast,
                painted,
                if quick { &[30.0] } else { steps },
                false,
                default,
            );
        }
    }
    if !quick {
        for contrast in [1.0, 1e2, 1e3, 1e4] {
            add(
                (15, 20),
                fixed,
                contrast,
                &Pattern::PAINTED,
                steps,
                false,
                default,
            );
        }
        for size in [(15, 15), (15, 20)] {
            for contrast in [1e2, 1e3, 1e4] {
                add(
                    size,
                    free,
                    contrast,
                    &Pattern::PAINTED,
                    if all { steps } else { &[30.0] },
                    false,
                    default,
                );
            }
        }
        if !all {
            add((24, 32), fixed, 1e3, &few, &[30.0], false, default);
        }
    }
    let size = if quick { (8, 10) } else { (15, 20) };
    let integrators = [Integrator::Paper, Integrator::Symplectic, Integrator::Verlet];
    for integrator in integrators.into_iter().chain([DEFAULT]) {
        let dts: &[f64] = match integrator {
            Integrator::Symplectic | Integrator::Verlet => &[0.1, 0.9],
            _ => steps,
        };
        add(
            size,
            fixed,
            100.0,
            &[Pattern::StiffBall],
            dts,
            false,
            Task::Step(integrator),
        );
        add(size, fixed, 1.0, &[], dts, true, Task::Step(integrator));
        add(
            size,
            fixed,
            100.0,
            &[Pattern::StiffBall],
            dts,
            true,
            Task::Step(integrator),
        );
    }
    if all {
        for size in [(24, 32), (32, 32)] {
            for rim in [free, fixed] {
                for contrast in [1.0, 1e2, 1e3, 1e4] {
                    add(size, rim, contrast, &Pattern::PAINTED, steps, false, default);
                }
            }
        }
    }
    out
}

/// Measures every configuration of an extent.
///
/// # Errors
/// [`DynamicsError`].
pub fn sweep(extent: Extent, run: &mut Run) -> Result<Vec<Line>, DynamicsError> {
    let tasks = tasks(extent);
    let mut lines = Vec::new();
    for (i, (configuration, task)) in tasks.iter().enumerate() {
        if !(run.go_on)(i as f64 / tasks.len() as f64) {
            return Err(DynamicsError::Cancelled);
        }
        let from = lines.len();
        match task {
            Task::Step(integrator) => {
                let increments = Increments::new(configuration, *integrator)?;
                lines.push(step::<f32>(configuration, &increments, *integrator, run.clock)?);
                lines.push(step::<f64>(configuration, &increments, *integrator, run.clock)?);
            }
            Task::Solvers => solvers(configuration, run.clock, &mut lines)?,
        }
        lines[from..].iter().for_each(&mut *run.show);
    }
    Ok(lines)
}

/// A line without figures.
fn blank<T: Real>(c: &Configuration, integrator: Integrator) -> Line {
    let rim = if c.rim == Rim::Fixed { ", rim fixed" } else { "" };
    Line {
        coefficients: c.coefficients,
        samples: c.samples,
        contrast: c.contrast,
        pattern: format!("{}{rim}", c.pattern.name()),
        dt_over_limit: c.dt_over_limit,
        iterations: 0,
        preconditioner: "",
        law: if c.four_d { "4-d" } else { "linear" },
        integrator: integrator.name(),
        precision: T::NAME,
        increment_error: 0.0,
        step_seconds: 0.0,
        default: false,
    }
}

fn step<T: Real>(
    c: &Configuration,
    increments: &Increments,
    integrator: Integrator,
    clock: fn() -> f64,
) -> Result<Line, DynamicsError> {
    let stepped = increments.judge::<T>(c, clock)?;
    Ok(Line {
        iterations: stepped.iterations,
        preconditioner: stepped.method,
        increment_error: stepped.error,
        step_seconds: stepped.seconds,
        default: integrator == DEFAULT && T::NAME == <f32 as Real>::NAME && !c.four_d,
        ..blank::<T>(c, integrator)
    })
}

/// Eq. 12 with several solvers, caps and precisions.
fn solvers(c: &Configuration, clock: fn() -> f64, lines: &mut Vec<Line>) -> Result<(), DynamicsError> {
    let reference = Reference::new(*c)?;
    for solver in [Solver::Plain, Solver::ScaledDiagonalization, Solver::Default] {
        let square = c.coefficients == c.samples && c.rim == Rim::Free;
        // With as many coefficients as samples one preconditions on the samples, or not at all.
        if square && solver == Solver::ScaledDiagonalization {
            continue;
        }
        iterations::<f32>(&reference, solver, clock, lines)?;
        iterations::<f64>(&reference, solver, clock, lines)?;
    }
    Ok(())
}

/// A solver with more and more iterations, until it stops by itself.
fn iterations<T: Real>(
    reference: &Reference,
    solver: Solver,
    clock: fn() -> f64,
    lines: &mut Vec<Line>,
) -> Result<(), DynamicsError> {
    for cap in [1, 2, 4, 8, 16] {
        let line = solved::<T>(reference, solver, cap, clock)?;
        let done = line.iterations < cap;
        lines.push(line);
        if done {
            break;
        }
    }
    Ok(())
}

fn solved<T: Real>(
    reference: &Reference,
    solver: Solver,
    cap: usize,
    clock: fn() -> f64,
) -> Result<Line, DynamicsError> {
    let c = &reference.configuration;
    let outcome = reference.judge::<T>(solver, cap)?;
    let rest = rest_seconds::<T>(c, clock)?;
    Ok(Line {
        iterations: outcome.iterations,
        preconditioner: outcome.method,
        increment_error: outcome.increment_error,
        step_seconds: rest + solve_seconds::<T>(reference, solver, cap, clock)?,
        ..blank::<T>(c, Integrator::Paper)
    })
}

/// What a step costs beside its solve: the forces of the springs.
fn rest_seconds<T: Real>(c: &Configuration, clock: fn() -> f64) -> Result<f64, DynamicsError> {
    let mut patch = patch::<T>(c, Default::default())?;
    let d = patch.state().d.clone();
    let mut force = vec![T::zero(); d.len()];
    let seconds = median_seconds(clock, || {
        patch.springs_mut().add_forces(&d, &mut force);
    });
    Ok(seconds)
}
