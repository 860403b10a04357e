//! Brushes that smooth, swell and shrink what they pass over.

use std::sync::Arc;

use bspline::{Aabb, Csg, HierarchicalSpline, KnotVector, Real, TensorSpline};
use fitting::Control;
use fitting::field::FieldFitReport;
use serde::{Deserialize, Serialize};

use super::GeometricError;
use super::band::band;
use super::detail::simplified;
use super::write::{Fineness, TOLERANCE, Writer};
use crate::limits::Limits;
use crate::mix::Mixed;
use crate::number::{Finite, Point, Positive};

/// Standard deviations of the kernel on each side of its middle.
const REACH: f64 = 3.0;

/// Evens a surface out: means of the density over a kernel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Smooth {
    /// The brush's way.
    pub along: Vec<Point>,
    /// It acts whole within half of this, and not at all beyond.
    pub radius: Positive,
    /// 1 to 10: standard deviation of the kernel in knot intervals of the object's detail.
    pub level: u8,
    /// Whether shapes wider than the kernel keep their volume.
    #[serde(default, rename = "keep-volume")]
    pub keep_volume: bool,
    /// As for [`Geometric`](super::Geometric).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<Positive>,
}

/// Lifts a surface by a length, or lowers it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Inflate {
    /// The brush's way.
    pub along: Vec<Point>,
    /// It acts whole within half of this, and not at all beyond.
    pub radius: Positive,
    /// By how much; negative lengths lower.
    pub by: Finite,
    /// As for [`Geometric`](super::Geometric).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<Positive>,
    /// As for [`Geometric`](super::Geometric).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finer: Option<u8>,
}

impl Smooth {
    /// What the brush leaves of a field whose surface lies at `iso`, and how close that is to the mean.
    ///
    /// Linear fields stay. What the smoother surface no longer needs is taken out of the field.
    ///
    /// # Errors
    /// Any [`GeometricError`].
    pub fn apply<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
        limits: &Limits,
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<T>, FieldFitReport), GeometricError> {
        if !(1..=10).contains(&self.level) {
            return Err(GeometricError::Shape(format!(
                "the level is {}; write 1 to 10",
                self.level
            )));
        }
        let writer = Writer { field, iso, limits };
        let (weight, reach) = band(&self.along, self.radius.0)?;
        let within = writer.within(&reach)?;
        // The kernel is as wide on finer knots.
        let finest = writer.field.finest_in(&within).max(writer.detail());
        let deviation = usize::from(self.level) << (finest - writer.detail());
        let even = averaged(field, &within, finest, deviation, self.keep_volume, control)?;
        let mixed = Mixed {
            from: field,
            to: &even,
            weight: &weight,
        };
        let fineness = Fineness {
            tolerance: self.tolerance,
            finer: Some(0),
            feature: None,
        };
        let (smooth, report) = writer.written(&mixed, &within, &fineness, control)?;
        let tolerance = self.tolerance.map_or(TOLERANCE * writer.spacing(), |t| t.0);
        let slim = simplified(&smooth, &reach, tolerance, limits)?;
        Ok((slim, report))
    }
}

impl Inflate {
    /// What the brush leaves of a field whose surface lies at `iso`, and how close that is: `f + h·|∇f|`.
    ///
    /// # Errors
    /// Any [`GeometricError`].
    pub fn apply<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
        iso: f64,
        limits: &Limits,
        control: &mut Control,
    ) -> Result<(HierarchicalSpline<T>, FieldFitReport), GeometricError> {
        if self.by.0.abs() > self.radius.0 {
            return Err(GeometricError::Shape(format!(
                "by is {}, more than the radius {}; take a wider brush, or several strokes",
                self.by.0, self.radius.0
            )));
        }
        let writer = Writer { field, iso, limits };
        let (weight, reach) = band(&self.along, self.radius.0)?;
        let within = writer.within(&reach)?;
        let grown = Csg::grown(Arc::new(field.clone()), self.by.0).map_err(GeometricError::shape)?;
        let mixed = Mixed {
            from: field,
            to: &grown,
            weight: &weight,
        };
        let fineness = Fineness {
            tolerance: self.tolerance,
            finer: self.finer,
            feature: None,
        };
        writer.written(&mixed, &within, &fineness, control)
    }
}

/// The mean of a field over a Gaussian of `deviation` knot intervals of level `finest`, in a box: `K f`, or `2K f - K K f`, which also keeps
/// what is quadratic, so that a ball loses none of its volume to first order.
///
/// A mean over knots of a spline is the spline of the same means of its coefficients, so nothing is sampled.
fn averaged<T: Real>(
    field: &HierarchicalSpline<T>,
    within: &Aabb,
    finest: usize,
    deviation: usize,
    keep_volume: bool,
    control: &mut Control,
) -> Result<TensorSpline<f64>, GeometricError> {
    let lattice = field.lattice();
    let scale = (1u64 << finest) as f64;
    let reach = (REACH * deviation as f64).ceil() as i64;
    let weights: Vec<f64> = (0..=reach)
        .map(|k| libm::exp(-0.5 * (k as f64 / deviation as f64).powi(2)))
        .collect();
    let total = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
    let weights: Vec<f64> = weights.iter().map(|w| w / total).collect();
    let local = within.transformed(field.lattice_from_world());
    // Functions that reach the box, and those that the kernel asks for about them. Function `s` is centred on knot `s - 1`.
    let last: [i64; 3] = lattice.cells_at(finest).map(|n| i64::from(n) + 2);
    let first: [i64; 3] =
        std::array::from_fn(|a| ((local.min[a] * scale).floor() as i64 - 1).clamp(0, last[a] - 4));
    let end: [i64; 3] =
        std::array::from_fn(|a| ((local.max[a] * scale).ceil() as i64 + 3).clamp(first[a] + 4, last[a]));
    let pad = reach * if keep_volume { 2 } else { 1 };
    let wide: [usize; 3] = std::array::from_fn(|a| (end[a] - first[a] + 1 + 2 * pad) as usize);
    let bytes = wide
        .iter()
        .fold(1u64, |n, w| n.saturating_mul(*w as u64))
        .saturating_mul(32);
    control.reserve(bytes)?;
    if bytes > 1 << 34 {
        return Err(GeometricError::Shape(
            "so wide a brush would need more than 16 GiB at the finest knots; smooth a part after the other"
                .into(),
        ));
    }
    let block = padded(field, finest, first, end, pad)?;
    let once = convolved(&block, wide, &weights);
    let coefficients = match keep_volume {
        false => inner(&once, wide, reach as usize),
        true => {
            let narrow = wide.map(|n| n - 2 * reach as usize);
            let once = inner(&once, wide, reach as usize);
            let twice = inner(&convolved(&once, narrow, &weights), narrow, reach as usize);
            let once = inner(&once, narrow, reach as usize);
            once.iter().zip(&twice).map(|(a, b)| 2.0 * a - b).collect()
        }
    };
    let knots = std::array::from_fn(|a| {
        let knot = |i: i64| (first[a] + i - 3) as f64 / scale;
        let all = (0..end[a] - first[a] + 5).map(knot).collect();
        KnotVector::new(3, all).expect("knots in order")
    });
    TensorSpline::new(knots, coefficients, lattice.world_from_lattice, field.slope())
        .map_err(GeometricError::shape)
}

/// Coefficients of a level's functions from `first` to `end`, and `pad` more on every side; beyond the lattice's own they go
/// on in straight lines.
fn padded<T: Real>(
    field: &HierarchicalSpline<T>,
    level: usize,
    first: [i64; 3],
    end: [i64; 3],
    pad: i64,
) -> Result<Vec<f64>, GeometricError> {
    let last: [i64; 3] = field.lattice().cells_at(level).map(|n| i64::from(n) + 2);
    let from: [i64; 3] = std::array::from_fn(|a| (first[a] - pad).max(0));
    let to: [i64; 3] = std::array::from_fn(|a| (end[a] + pad).min(last[a]));
    let count: [usize; 3] = std::array::from_fn(|a| (to[a] - from[a] + 1) as usize);
    let own = field
        .level_coefficients(level, from.map(|f| f as u32), count)
        .map_err(GeometricError::shape)?;
    let mut block: Vec<f64> = own.iter().map(|c| c.as_f64()).collect();
    let mut shape = count;
    for axis in 0..3 {
        let before = (from[axis] - (first[axis] - pad)) as usize;
        let behind = (end[axis] + pad - to[axis]) as usize;
        if before + behind == 0 {
            continue;
        }
        let mut longer = shape;
        longer[axis] += before + behind;
        let n = shape[axis] as i64;
        let line = |i: usize| {
            let at = i as i64 - before as i64;
            let near = at.clamp(0, n - 1);
            let next = if at < 0 { 1.min(n - 1) } else { (n - 2).max(0) };
            (near as usize, next as usize, (at - near).abs() as f64)
        };
        let mut out = Vec::with_capacity(longer.iter().product());
        for x in 0..longer[0] {
            for y in 0..longer[1] {
                for z in 0..longer[2] {
                    let mut at = [x, y, z];
                    let (near, next, steps) = line(at[axis]);
                    let mut value = |i: usize| {
                        at[axis] = i;
                        block[(at[0] * shape[1] + at[1]) * shape[2] + at[2]]
                    };
                    let face = value(near);
                    out.push(face + steps * (face - value(next)));
                }
            }
        }
        (block, shape) = (out, longer);
    }
    Ok(block)
}

/// A symmetric kernel along each axis; right but for its reach at the borders.
fn convolved(block: &[f64], shape: [usize; 3], weights: &[f64]) -> Vec<f64> {
    let mut values = block.to_vec();
    let strides = [shape[1] * shape[2], shape[2], 1];
    let reach = weights.len() - 1;
    for (axis, stride) in strides.into_iter().enumerate() {
        let old = values.clone();
        for (i, value) in values.iter_mut().enumerate() {
            let at = i / stride % shape[axis];
            if at < reach || at + reach >= shape[axis] {
                continue;
            }
            *value = weights[0] * old[i];
            for (k, w) in weights.iter().enumerate().skip(1) {
                *value += w * (old[i - k * stride] + old[i + k * stride]);
            }
        }
    }
    values
}

/// A block without `rim` values on every side.
fn inner(block: &[f64], shape: [usize; 3], rim: usize) -> Vec<f64> {
    let mut out = Vec::new();
    for x in rim..shape[0] - rim {
        for y in rim..shape[1] - rim {
            let row = (x * shape[1] + y) * shape[2];
            out.extend_from_slice(&block[row + rim..row + shape[2] - rim]);
        }
    }
    out
}
