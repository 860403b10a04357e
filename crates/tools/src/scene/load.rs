//! Forces of a scene on the samples of its region.

use bspline::Real;

use super::error::{SimulateError, wrong};
use super::place::Samples;
use super::script::{Force, Pull, Scene};

/// All forces of a scene.
#[derive(Clone, Debug)]
pub struct Load {
    pulls: Vec<(Pull, Vec<f64>)>,
    forces: Vec<(Force, Vec<usize>)>,
    duration: f64,
}

impl Load {
    /// The forces of `scene`, on its samples.
    pub fn new(scene: &Scene, samples: &Samples) -> Result<Self, SimulateError> {
        let pulls = scene.pull.iter().enumerate().map(|(i, pull)| {
            let place = |key: &str| format!("[[pull]] {}{key}", i + 1);
            pull.when.check().map_err(|e| wrong(place(" when"), e))?;
            for (key, p) in [(" at", Some(pull.at)), (" to", pull.to)] {
                if let Some(p) = p.filter(|p| !samples.contains(p.0)) {
                    return Err(wrong(
                        place(key),
                        format!("{} lies outside the region; move it, or enlarge the region", p.0),
                    ));
                }
            }
            let kernel = kernel(pull, 0.0, samples);
            if kernel.iter().all(|w| *w == 0.0) {
                return Err(wrong(
                    place(" radius"),
                    format!(
                        "{} is so small that no sample feels it; enlarge it",
                        pull.radius.0
                    ),
                ));
            }
            Ok((pull.clone(), kernel))
        });
        let forces = scene.force.iter().enumerate().map(|(i, force)| {
            let place = |key: &str| format!("[[force]] {}{key}", i + 1);
            force.when.check().map_err(|e| wrong(place(" when"), e))?;
            if force.samples.len() != force.values.len() {
                return Err(wrong(
                    place(""),
                    format!(
                        "{} samples and {} values; give a value for each sample",
                        force.samples.len(),
                        force.values.len()
                    ),
                ));
            }
            let [nx, ny, nz] = samples.dims;
            let index = |[a, b, c]: &[usize; 3]| {
                if *a < nx && *b < ny && *c < nz {
                    Ok((a * ny + b) * nz + c)
                } else {
                    Err(wrong(
                        place(" samples"),
                        format!(
                            "[{a}, {b}, {c}]: the region has {nx} × {ny} × {nz} samples, numbered from 0"
                        ),
                    ))
                }
            };
            let indices = force.samples.iter().map(index).collect::<Result<_, _>>()?;
            Ok((force.clone(), indices))
        });
        Ok(Self {
            pulls: pulls.collect::<Result<_, _>>()?,
            forces: forces.collect::<Result<_, _>>()?,
            duration: scene.time.duration.0,
        })
    }

    /// Writes the forces over the step that begins at `t` and lasts `dt`.
    pub fn write<T: Real>(&self, t: f64, dt: f64, samples: &Samples, out: &mut [T]) {
        let mut sum = vec![0.0; out.len()];
        for (pull, still) in &self.pulls {
            let strength = pull.strength.0 * pull.when.strength(t, dt);
            if strength == 0.0 {
                continue;
            }
            let moved;
            let weights = if pull.to.is_some() {
                moved = kernel(pull, pull.when.share_passed(t + 0.5 * dt, self.duration), samples);
                &moved
            } else {
                still
            };
            for (f, w) in sum.iter_mut().zip(weights) {
                *f += strength * w;
            }
        }
        for (force, indices) in &self.forces {
            let strength = force.when.strength(t, dt);
            for (i, value) in indices.iter().zip(&force.values) {
                sum[*i] += strength * value.0;
            }
        }
        for (out, f) in out.iter_mut().zip(&sum) {
            *out = T::from_f64(*f);
        }
    }
}

/// Weights of the samples, of sum 1, when `share` of the way is behind the pull.
fn kernel(pull: &Pull, share: f64, samples: &Samples) -> Vec<f64> {
    let to = pull.to.unwrap_or(pull.at).0;
    let at = pull.at.0 + share * (to - pull.at.0);
    let scale = -0.5 / (pull.radius.0 * pull.radius.0);
    let distances = samples.positions.iter().map(|p| p.distance_squared(at));
    let mut weights: Vec<f64> = distances.map(|d2| libm::exp(scale * d2)).collect();
    let sum: f64 = weights.iter().sum();
    if sum > 0.0 {
        weights.iter_mut().for_each(|w| *w /= sum);
    }
    weights
}
