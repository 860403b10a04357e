//! Means of a field over a Gaussian.

use bspline::hierarchical::BRICK;
use bspline::{Aabb, Field, Frame, HierarchicalSpline, KnotVector, Real, TensorSpline};
use fitting::Control;
use glam::{DAffine3, DQuat, DVec3};

use super::GeometricError;

/// Standard deviations of the kernel on each side of its middle.
pub(super) const REACH: f64 = 3.0;

/// The mean of a field over a Gaussian of `deviation` knot intervals of `level` on each axis, in a box: `K f`, or `2K f - K K f`, which also
/// keeps what is quadratic, so that a ball loses none of its volume to first order.
///
/// A mean over knots of a spline is the spline of the same means of its coefficients, so nothing is sampled. What lies on finer levels counts as far as
/// those see it.
pub(super) fn averaged<T: Real>(
    field: &HierarchicalSpline<T>,
    within: &Aabb,
    level: usize,
    deviation: [f64; 3],
    keep_volume: bool,
    control: &mut Control,
) -> Result<TensorSpline<f64>, GeometricError> {
    let lattice = field.lattice();
    let scale = (1u64 << level) as f64;
    let weights = deviation.map(kernel);
    let reach = [0, 1, 2].map(|a| weights[a].len() - 1);
    let local = within.transformed(field.lattice_from_world());
    // Functions that reach the box, and those that the kernel asks for about them. Function `s` is centred on knot `s - 1`.
    let last: [i64; 3] = lattice.cells_at(level).map(|n| i64::from(n) + 2);
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
            "so wide a brush would need more than 16 GiB at its knots; pass over a part after the other"
                .into(),
        ));
    }
    let block = padded(field, level, [first, end, pad.map(|n| n as i64)], &weights)?;
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

/// Coefficients of a level's functions from `first` to `end`, and `pad` more on every side, as of a field that holds nothing finer and goes on beyond the
/// faces of its box.
fn padded<T: Real>(
    field: &HierarchicalSpline<T>,
    level: usize,
    [first, end, pad]: [[i64; 3]; 3],
    kernels: &[Vec<f64>; 3],
) -> Result<Vec<f64>, GeometricError> {
    let last: [i64; 3] = field.lattice().cells_at(level).map(|n| i64::from(n) + 2);
    let from: [i64; 3] = std::array::from_fn(|a| (first[a] - pad[a]).max(0));
    let to: [i64; 3] = std::array::from_fn(|a| (end[a] + pad[a]).min(last[a]));
    let mut shape: [usize; 3] = std::array::from_fn(|a| (to[a] - from[a] + 1) as usize);
    let own = field
        .level_coefficients(level, from.map(|f| f as u32), shape)
        .map_err(GeometricError::shape)?;
    let mut block: Vec<f64> = own.iter().map(|c| c.as_f64()).collect();
    add_finer(field, level, from, shape, &mut block);
    for axis in 0..3 {
        let ends = [from[axis] == 0, to[axis] == last[axis]];
        let beside = [
            from[axis] - (first[axis] - pad[axis]),
            end[axis] + pad[axis] - to[axis],
        ];
        if ends == [false; 2] {
            continue;
        }
        let (count, stride) = (shape[axis], shape[axis + 1..].iter().product::<usize>());
        let longer = count + (beside[0] + beside[1]) as usize;
        let mut out = vec![0.0; block.len() / count * longer];
        for n in 0..block.len() / count {
            let start = n / stride;
            let place = |i: usize, count: usize| (start * count + i) * stride + n % stride;
            let row: Vec<f64> = (0..count).map(|i| block[place(i, count)]).collect();
            for (i, value) in continued(row, ends, beside, &kernels[axis]).enumerate() {
                out[place(i, longer)] = value;
            }
        }
        (block, shape[axis]) = (out, longer);
    }
    Ok(block)
}

/// Adds what functions of levels finer than `level` hold to the functions beside them, which keeps integral and centre: under a kernel at least as wide
/// as the level's intervals nothing else of them matters, and the cost is theirs.
fn add_finer<T: Real>(
    field: &HierarchicalSpline<T>,
    level: usize,
    from: [i64; 3],
    shape: [usize; 3],
    block: &mut [f64],
) {
    for finer in level + 1..field.level_count() {
        let scale = 1.0 / (1u64 << (finer - level)) as f64;
        for (key, functions) in field.corrections(finer) {
            for (slot, c) in functions.iter() {
                let at = [slot / BRICK / BRICK, slot / BRICK % BRICK, slot % BRICK];
                // Function `s` is centred on knot `s - 1`.
                let center: [f64; 3] = std::array::from_fn(|a| {
                    let knot = (key.0[a] as usize * BRICK + at[a]) as f64 - 1.0;
                    knot * scale + 1.0 - from[a] as f64
                });
                let mass = c.as_f64() * scale.powi(3);
                for corner in 0..8 {
                    let near = |a: usize| center[a].floor() + f64::from(corner >> a & 1);
                    if (0..3).all(|a| 0.0 <= near(a) && near(a) < shape[a] as f64) {
                        let weight: f64 = (0..3).map(|a| 1.0 - (center[a] - near(a)).abs()).product();
                        let [x, y, z] = std::array::from_fn(|a| near(a) as usize);
                        block[(x * shape[1] + y) * shape[2] + z] += mass * weight;
                    }
                }
            }
        }
    }
}

/// A row of coefficients that ends, where `ends` says so, with the function beyond a face of the box, with so many more `beside` it.
///
/// Those beyond a face are the others turned by half a turn about what a line through the values there, weighted by the kernel, has at the face. So
/// what is linear goes on, and however often the mean is taken, nothing grows: its powers stay below 1.9 (kernels of 1 to 10 intervals, 4 to 120
/// functions). A line through the last two would carry the noise in their difference on and on.
fn continued(
    mut row: Vec<f64>,
    ends: [bool; 2],
    beside: [i64; 2],
    kernel: &[f64],
) -> impl Iterator<Item = f64> {
    let count = row.len();
    // No tool sees what functions beyond a face are but by the value there.
    let at_face = |i: usize| (row[i - 1] + 4.0 * row[i] + row[i + 1]) / 6.0;
    let faces = [ends[0].then(|| at_face(1)), ends[1].then(|| at_face(count - 2))];
    if let Some(value) = faces[1] {
        row.truncate(count - 1);
        row[count - 2] = value;
    }
    if let Some(value) = faces[0] {
        row.remove(0);
        row[0] = value;
    }
    let last = row.len() as i64 - 1;
    let means = [intercept(row.iter(), kernel), intercept(row.iter().rev(), kernel)];
    let first = -beside[0] - i64::from(ends[0]);
    (first..first + count as i64 + beside[0] + beside[1]).map(move |mut at| {
        let (mut sign, mut sum) = (1.0, 0.0);
        loop {
            let end = at.clamp(0, last);
            if end == at {
                return sum + sign * row[at as usize];
            }
            sum += sign * 2.0 * means[usize::from(at > end)];
            sign = -sign;
            at = 2 * end - at;
        }
    })
}

/// What the line through values, weighted by a kernel about the first, has there.
fn intercept<'a>(values: impl Iterator<Item = &'a f64>, kernel: &[f64]) -> f64 {
    let [mut w0, mut w1, mut w2, mut v0, mut v1] = [0.0; 5];
    for (i, (value, w)) in values.zip(kernel).enumerate() {
        let i = i as f64;
        w0 += w;
        w1 += w * i;
        w2 += w * i * i;
        v0 += w * value;
        v1 += w * i * value;
    }
    match w0 * w2 - w1 * w1 {
        0.0 => v0 / w0,
        spread => (w2 * v0 - w1 * v1) / spread,
    }
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

    /// Whatever the values, a mean that is taken again and again stays within 1.9 of them; a straight line stays.
    #[test]
    fn means_of_rows_that_end_never_grow() {
        let mut state = 1u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            if state >> 63 == 0 { 1.0 } else { -1.0 }
        };
        for deviation in [1.0, 2.0, 5.0, 10.0] {
            let kernel = kernel(deviation);
            let reach = kernel.len() - 1;
            let mean = |row: &[f64], pad: usize| -> Vec<f64> {
                let wide: Vec<f64> = continued(row.to_vec(), [true; 2], [pad as i64; 2], &kernel).collect();
                let even = convolved(&wide, [1, 1, wide.len()], &[vec![1.0], vec![1.0], kernel.clone()]);
                even[pad..pad + row.len()].to_vec()
            };
            for count in [4, 7, 20, 60] {
                let line: Vec<f64> = (0..count).map(|i| 3.0 - 0.5 * i as f64).collect();
                for (a, b) in line.iter().zip(mean(&line, reach)) {
                    assert!((a - b).abs() < 1e-12, "{deviation} {count}: {a} {b}");
                }
                for _ in 0..20 {
                    let mut row: Vec<f64> = (0..count).map(|_| draw()).collect();
                    for _ in 0..50 {
                        row = mean(&row, reach);
                        let most = row[1..count - 1].iter().fold(0.0, |m: f64, v| m.max(v.abs()));
                        assert!(most < 1.9, "{deviation} {count}: {most}");
                    }
                }
            }
        }
    }
}
