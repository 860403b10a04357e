//! Directions of estimated normals, bettered by fits that trust the positions more than them.
//!
//! Where points are sparse, a plane or quadric through neighbours leans by ten degrees and more, and the surface swings
//! between the points to obey it. A fit that hardly asks for what is doubtful bends as little as the positions allow; its
//! gradients at the points are better normals.

use bspline::{Field, Real};
use glam::DVec3;
use rayon::prelude::*;

use super::plan::Plan;
use super::samples::Samples;
use super::{cascade, coarse};
use crate::{Control, FitError};

/// Fits before the last. Of 30 : 1 density: p95 18.7, 16.3, 15.5, 14.9 u after none to three, 15.2 to 15.6 after four to six.
const ROUNDS: usize = 3;
/// How far beyond the gradient a normal without any certainty is turned: a fit gives in to its normals half way. Factors
/// of 1, 1.5, 2, 3 leave 15.9, 15.0, 14.9, 16.3 u.
const OVERSHOOT: f64 = 2.0;
/// A direction is doubtful below this certainty ...
const DOUBTFUL: f32 = 0.5;
/// ... and worth the rounds where more than this share of them is.
const WORTH_IT: f64 = 0.1;

/// Whether so many directions are doubtful that [`refine`] is worth its time.
pub(crate) fn are_doubtful(samples: &Samples) -> bool {
    let doubtful = samples.certainty.iter().filter(|c| **c < DOUBTFUL).count();
    doubtful as f64 > WORTH_IT * samples.certainty.len() as f64
}

/// Turns the normals of `samples` towards the gradients of fits to them.
///
/// # Errors
/// [`FitError::Cancelled`].
pub(crate) fn refine<T: Real>(
    samples: &mut Samples,
    plan: &Plan,
    control: &mut Control,
) -> Result<(), FitError> {
    for round in 0..ROUNDS {
        let begin = 0.035 + 0.005 * round as f64;
        let (base, _) = coarse::solve(samples, plan.beta, false);
        let found = cascade::run::<T>(samples, &base, plan, begin..begin + 0.005, control)?;
        let field = samples.field(&base, &found.levels);
        samples.normals = (0..samples.normals.len())
            .into_par_iter()
            .with_min_len(1024)
            .map(|i| turned(samples, &field, i).unwrap_or(samples.normals[i]))
            .collect();
    }
    Ok(())
}

/// The normal of a sample, turned; none where the field has nothing to say or says the opposite.
fn turned(samples: &Samples, field: &dyn Field, index: usize) -> Option<[f32; 3]> {
    let share = OVERSHOOT * (1.0 - f64::from(samples.certainty[index]));
    let normal = DVec3::from(samples.normals[index].map(f64::from));
    let outward = -field.value_gradient(samples.world(index)).1.try_normalize()?;
    if samples.is_sign_condition(index) || outward.dot(normal) <= 0.0 {
        return None;
    }
    let turned = (normal + share * (outward - normal)).try_normalize()?;
    Some(turned.as_vec3().to_array())
}
