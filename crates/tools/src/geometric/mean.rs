//! Means of a field over a Gaussian.

use bspline::{Aabb, Field, Frame, HierarchicalSpline, KnotVector, Real, TensorSpline};
use fitting::Control;
use glam::{DAffine3, DQuat, DVec3};

use super::GeometricError;

/// Standard deviations of the kernel on each side of its middle.
pub(super) const REACH: f64 = 3.0;

/// The mean of a field over a Gaussian of `deviation` knot intervals of level `finest` on each axis, in a box: `K f`, or `2K f - K K f`, which also
/// keeps what is quadratic, so that a ball loses none of its volume to first order.
///
/// A mean over knots of a spline is the spline of the same means of its coefficients, so nothing is sampled.
pub(super) fn averaged<T: Real>(
    field: &HierarchicalSpline<T>,
    within: &Aabb,
    finest: usize,
    deviation: [f64; 3],
    keep_volume: bool,
    control: &mut Control,
) -> Result<TensorSpline<f64>, GeometricError> {
    let lattice = field.lattice();
    let scale = (1u64 << finest) as f64;
    let weights = deviation.map(kernel);
    let reach = [0, 1, 2].map(|a| weights[a].len() - 1);
    let local = within.transformed(field.lattice_from_world());
    // Functions that reach the box, and those that the kernel asks for about them. Function `s` is centred on knot `s - 1`.
    let last: [i64; 3] = lattice.cells_at(finest).map(|n| i64::from(n) + 2);
    let first: [i64; 3] =
        std::array::from_fn(|a| ((local.min[a] * scale).floor() as i64 - 1).clamp(0, last[a] - 4));
    let end: [i64; 3] =
        std::array::from_fn(|a| ((local.max[a] * scale).ceil() as i64 + 3).clamp(first[a] + 4, last[a]));
    let pad = reach.map(|n| n * if keep_volume { 2 } else { 1 });
    let wide: [usize; 3] = std::array::from_fn(|a| (end[a] - first[a] + 1) as usize + 2 * pad[a]);
    let bytes = wide
        .iter()
        .fold(1u64, |n, w| n.saturating_mul(*w as u64))
        .saturating_mul(32);
    control.reserve(bytes)?;
    if bytes > 1 << 34 {
        return Err(GeometricError::Shape(
            "so wide a brush would need more than 16 GiB at the finest knots; pass over a part after the other"
                .into(),
        ));
    }
    let block = padded(field, finest, first, end, pad.map(|n| n as i64))?;
    let once = convolved(&block, wide, &weights);
    let coefficients = match keep_volume {
        false => inner(&once, wide, reach),
        true => {
            let narrow = std::array::from_fn(|a| wide[a] - 2 * reach[a]);
            let once = inner(&once, wide, reach);
            let twice = inner(&convolved(&once, narrow, &weights), narrow, reach);
            let once = inner(&once, narrow, reach);
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

/// The mean of a field over a Gaussian as wide as `deviation`, a length, in a box, from its values at `count` places, about: for boxes in which the
/// knots are too many.
pub(super) fn sampled<T: Real>(
    field: &HierarchicalSpline<T>,
    within: &Aabb,
    deviation: f64,
    count: f64,
    control: &mut Control,
) -> Result<TensorSpline<f64>, GeometricError> {
    // A node more than cubic splines reach.
    const RIM: f64 = 2.0;
    let size = within.widened(REACH * deviation).size();
    let step = libm::cbrt(size.x * size.y * size.z / count);
    let weights = kernel(deviation / step);
    let reach = weights.len() - 1;
    let first = within.min - (reach as f64 + RIM) * step;
    let shape = ((within.size() / step).ceil() + 2.0 * (reach as f64 + RIM) + 1.0)
        .to_array()
        .map(|n| n as usize);
    let nodes: usize = shape.iter().product();
    control.reserve(32 * nodes as u64)?;
    let frame = Frame {
        world_from_grid: DAffine3::from_scale_rotation_translation(
            DVec3::splat(step),
            DQuat::IDENTITY,
            first,
        ),
        cells: shape.map(|n| n as u32 - 1),
    };
    let mut values = vec![0.0; nodes];
    field.frame_values(&frame, [0; 3], shape, &mut values);
    let even = convolved(&values, shape, &std::array::from_fn(|_| weights.clone()));
    let coefficients = inner(&even, shape, [reach; 3]);
    let knots = std::array::from_fn(|a| {
        let from = first[a] + (reach as f64 - 2.0) * step;
        let all = (0..shape[a] - 2 * reach + 4).map(|i| from + i as f64 * step);
        KnotVector::new(3, all.collect()).expect("knots in order")
    });
    TensorSpline::new(knots, coefficients, DAffine3::IDENTITY, field.slope()).map_err(GeometricError::shape)
}

/// Half of a Gaussian kernel from its middle on; its sum is 1 with the other half.
fn kernel(deviation: f64) -> Vec<f64> {
    let reach = (REACH * deviation).ceil() as i64;
    if reach == 0 {
        return vec![1.0];
    }
    let weights: Vec<f64> = (0..=reach)
        .map(|k| libm::exp(-0.5 * (k as f64 / deviation).powi(2)))
        .collect();
    let total = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
    weights.iter().map(|w| w / total).collect()
}

/// Coefficients of a level's functions from `first` to `end`, and `pad` more on every side; beyond the lattice's own they go
/// on in straight lines.
fn padded<T: Real>(
    field: &HierarchicalSpline<T>,
    level: usize,
    first: [i64; 3],
    end: [i64; 3],
    pad: [i64; 3],
) -> Result<Vec<f64>, GeometricError> {
    let last: [i64; 3] = field.lattice().cells_at(level).map(|n| i64::from(n) + 2);
    let from: [i64; 3] = std::array::from_fn(|a| (first[a] - pad[a]).max(0));
    let to: [i64; 3] = std::array::from_fn(|a| (end[a] + pad[a]).min(last[a]));
    let count: [usize; 3] = std::array::from_fn(|a| (to[a] - from[a] + 1) as usize);
    let own = field
        .level_coefficients(level, from.map(|f| f as u32), count)
        .map_err(GeometricError::shape)?;
    let mut block: Vec<f64> = own.iter().map(|c| c.as_f64()).collect();
    let mut shape = count;
    for axis in 0..3 {
        let before = (from[axis] - (first[axis] - pad[axis])) as usize;
        let behind = (end[axis] + pad[axis] - to[axis]) as usize;
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
fn convolved(block: &[f64], shape: [usize; 3], weights: &[Vec<f64>; 3]) -> Vec<f64> {
    let mut values = block.to_vec();
    let strides = [shape[1] * shape[2], shape[2], 1];
    for (axis, (stride, weights)) in strides.into_iter().zip(weights).enumerate() {
        let reach = weights.len() - 1;
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
fn inner(block: &[f64], shape: [usize; 3], rim: [usize; 3]) -> Vec<f64> {
    let mut out = Vec::new();
    for x in rim[0]..shape[0] - rim[0] {
        for y in rim[1]..shape[1] - rim[1] {
            let row = (x * shape[1] + y) * shape[2];
            out.extend_from_slice(&block[row + rim[2]..row + shape[2] - rim[2]]);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use bspline::hierarchical::Lattice;

    use super::*;

    #[test]
    fn means_of_places_are_those_of_knots() {
        let lattice = Lattice {
            world_from_lattice: DAffine3::from_scale(DVec3::new(0.5, 0.5, 0.75)),
            cells: [48, 48, 32],
        };
        let middle = DVec3::splat(12.0);
        let ball = |p: DVec3| 300.0 * libm::tanh(6.0 - p.distance(middle));
        let field = HierarchicalSpline::<f32>::schoenberg(lattice, 300.0, ball).unwrap();
        let within = Aabb::new(DVec3::splat(9.0), DVec3::splat(20.0));
        let deviation = DVec3::new(2.0, 2.0, 4.0 / 3.0).to_array();
        let mut control = Control::default();
        let knots = averaged(&field, &within, 0, deviation, false, &mut control).unwrap();
        let places = sampled(&field, &within, 1.0, 20_000.0, &mut control).unwrap();
        for n in 0..1000 {
            let at = DVec3::new((n / 100) as f64, (n / 10 % 10) as f64, (n % 10) as f64);
            let p = within.min + at / 9.0 * within.size();
            let [(value, slope), (same, other)] = [&knots, &places].map(|mean| mean.value_gradient(p));
            // Between places the spline evens out a little more.
            assert!((value - same).abs() < 10.0, "{p}: {value} {same}");
            assert!(slope.distance(other) < 10.0, "{p}: {slope} {other}");
        }
    }
}
