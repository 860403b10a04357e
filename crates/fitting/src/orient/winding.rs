//! Orientation by consistency of the winding number with the normals \[Lin24\].

use std::ops::Range;

use crate::{Control, FitError};

use super::kernel::{Adjoint, Gradient, Target, Winding};
use super::tree::Tree;

/// Rounds of the iteration.
const ROUNDS: usize = 30;

/// Smoothing widths of the kernels, for each point: of the first round, shrinking geometrically to that of the last.
#[derive(Clone, Debug)]
pub(crate) struct Widths {
    pub first: Vec<f32>,
    pub last: Vec<f32>,
}

/// Normals `ν` of the points of `tree` such that the winding field of `a ν` is ½ on them and falls along them.
///
/// Each round takes a step of steepest descent, with its exact length, for `½ Σ_i a_i (½ − w(x_i))²` in the metric
/// of the areas (so that density does not matter), then turns every `ν_i` along `−∇w(x_i)` and keeps its length.
/// Points that no surface passes through keep short normals.
pub(crate) fn iterate(
    tree: &Tree,
    areas: &[f32],
    widths: &Widths,
    progress: Range<f64>,
    control: &mut Control,
) -> Result<Vec<[f32; 3]>, FitError> {
    let n = areas.len();
    let runs = tree.leaves();
    let mut normals = vec![[0.0f32; 3]; n];
    for round in 0..ROUNDS {
        let share = round as f32 / (ROUNDS - 1) as f32;
        control.step(
            "orienting",
            progress.start + (progress.end - progress.start) * f64::from(share),
        )?;
        let at: Vec<Target> = (0..n)
            .map(|i| Target {
                position: tree.positions()[i],
                width: widths.first[i] * (widths.last[i] / widths.first[i]).powf(share),
            })
            .collect();
        let w = if round == 0 {
            vec![0.0; n]
        } else {
            tree.sum(&Winding, &weighted(&normals, areas), &at, runs)
        };
        let misfit: Vec<[f32; 1]> = w.iter().zip(areas).map(|(w, a)| [a * (0.5 - w)]).collect();
        let descent = tree.sum(&Adjoint, &misfit, &at, runs);
        let change = tree.sum(&Winding, &weighted(&descent, areas), &at, runs);
        let (mut along, mut image) = (0.0f64, 0.0f64);
        for i in 0..n {
            along += f64::from(misfit[i][0]) * f64::from(change[i]);
            image += f64::from(areas[i]) * f64::from(change[i]) * f64::from(change[i]);
        }
        let length = if image > 0.0 { (along / image) as f32 } else { 0.0 };
        for (v, r) in normals.iter_mut().zip(&descent) {
            (0..3).for_each(|k| v[k] += length * r[k]);
        }
        let down = tree.sum(&Gradient, &weighted(&normals, areas), &at, runs);
        for (v, g) in normals.iter_mut().zip(&down) {
            let (size, steep) = (dot(*v, *v).sqrt(), dot(*g, *g).sqrt());
            if steep > 0.0 {
                *v = g.map(|g| g * (size / steep));
            }
        }
    }
    Ok(normals)
}

/// Area-weighted normals, which are what points carry into the field.
pub(crate) fn weighted(normals: &[[f32; 3]], areas: &[f32]) -> Vec<[f32; 3]> {
    normals.iter().zip(areas).map(|(v, a)| v.map(|v| v * a)).collect()
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
