//! Uniform cubic weights and the restriction of a spline to part of its cells.

use bspline::restrict::{CELLS, COEFFICIENTS, RestrictedAxis, restricted_range, slope_ranges};
use bspline::{Interval, Real, cubic};
use proptest::prelude::*;

const N: usize = COEFFICIENTS;

fn evaluate(c: &[f64], x: f64) -> f64 {
    let k = (x.floor() as usize).min(CELLS - 1);
    cubic::values(x - k as f64)
        .iter()
        .zip(&c[k..])
        .map(|(w, c)| w * c)
        .sum()
}

/// Blossom of `x³` is the product, of `x` the mean: coefficient `h` of a cubic in 1-D, exactly.
fn cubic_coefficients(p: [f64; 4]) -> Vec<f64> {
    (0..N)
        .map(|h| {
            let [u, v, w] = [h as f64 - 2.0, h as f64 - 1.0, h as f64];
            p[0] + p[1] * (u + v + w) / 3.0 + p[2] * (u * v + v * w + w * u) / 3.0 + p[3] * u * v * w
        })
        .collect()
}

fn apply<T: Real>(axis: &RestrictedAxis<T>, c: &[f64]) -> Vec<f64> {
    (0..axis.count())
        .map(|r| {
            let (start, w) = axis.row(r);
            w.iter().zip(&c[start..]).map(|(&w, c)| w.as_f64() * c).sum()
        })
        .collect()
}

/// `[a, b]` with whole numbers, points and single cells as frequent as the rest.
fn parts() -> impl Strategy<Value = (f64, f64)> {
    let end = prop_oneof![
        0.0..8.0f64,
        (0..=8u8).prop_map(f64::from),
        (0..=8u8, -1e-15..1e-15f64).prop_map(|(k, e)| (f64::from(k) + e).clamp(0.0, 8.0)),
    ];
    let short = (0.0..8.0f64, -12.0..0.0f64).prop_map(|(a, e)| (a, (a + 10f64.powf(e)).min(8.0)));
    prop_oneof![(end.clone(), end).prop_map(|(a, b)| (a.min(b), a.max(b))), short]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn rows_are_convex_combinations((a, b) in parts()) {
        let axis = RestrictedAxis::<f64>::new(a, b);
        prop_assert!((1..=N).contains(&axis.count()));
        for r in 0..axis.count() {
            let (start, w) = axis.row(r);
            prop_assert!(start + 4 <= N);
            prop_assert!(w.iter().all(|w| *w >= 0.0), "{w:?}");
            prop_assert!((w.iter().sum::<f64>() - 1.0).abs() < 13.0 * f64::EPSILON);
        }
    }

    #[test]
    fn rows_stay_in_order_and_touch_only_cells_met((a, b) in parts()) {
        let axis = RestrictedAxis::<f64>::new(a, b);
        let starts: Vec<_> = (0..axis.count()).map(|r| axis.row(r).0).collect();
        prop_assert!(starts.is_sorted());
        let used: Vec<usize> = (0..axis.count())
            .flat_map(|r| (0..4).filter(move |j| axis.row(r).1[*j] > 0.0).map(move |j| axis.row(r).0 + j))
            .collect();
        let (low, high) = (used.iter().min().unwrap(), used.iter().max().unwrap());
        prop_assert!(*low >= a.floor() as usize && *high <= b.ceil() as usize + 2);
        prop_assert!(axis.reads().start <= *low && *high < axis.reads().end);
    }

    #[test]
    fn hull_holds_the_function((a, b) in parts(), c in prop::collection::vec(-1.0..1.0f64, N)) {
        let rows = apply(&RestrictedAxis::<f64>::new(a, b), &c);
        let slack = 2.0 * RestrictedAxis::<f64>::axis_error();
        let low = rows.iter().copied().fold(f64::INFINITY, f64::min) - slack;
        let high = rows.iter().copied().fold(f64::NEG_INFINITY, f64::max) + slack;
        for i in 0..=100 {
            let f = evaluate(&c, (a + (b - a) * i as f64 / 100.0).min(b));
            prop_assert!(low <= f && f <= high, "{f} not in [{low}, {high}]");
        }
    }

    #[test]
    fn ends_are_the_values_there((a, b) in parts(), c in prop::collection::vec(-1.0..1.0f64, N)) {
        let rows = apply(&RestrictedAxis::<f64>::new(a, b), &c);
        prop_assert!((rows[0] - evaluate(&c, a)).abs() < 1e-14);
        prop_assert!((rows[rows.len() - 1] - evaluate(&c, b)).abs() < 1e-14);
    }

    #[test]
    fn linear_functions_are_bounded_by_their_ends((a, b) in parts(), p in -2.0..2.0f64, q in -2.0..2.0f64) {
        let rows = apply(&RestrictedAxis::<f64>::new(a, b), &cubic_coefficients([p, q, 0.0, 0.0]));
        let (low, high) = ((p + q * a).min(p + q * b), (p + q * a).max(p + q * b));
        let slack = 20.0 * RestrictedAxis::<f64>::axis_error() * 20.0;
        prop_assert!(rows.iter().all(|r| low - slack <= *r && *r <= high + slack));
    }

    /// Restriction changes the knots and not the function: blossoms of a cubic are known in closed form.
    #[test]
    fn rows_are_blossoms_of_a_cubic((a, b) in parts(), p in prop::array::uniform4(-1.0..1.0f64)) {
        prop_assume!(a < b);
        let axis = RestrictedAxis::<f64>::new(a, b);
        let inner = (0..=8).map(f64::from).filter(|k| a < *k && *k < b);
        let knots: Vec<f64> = [a; 3].into_iter().chain(inner).chain([b; 3]).collect();
        prop_assert_eq!(axis.count(), knots.len() - 2);
        for (row, u) in apply(&axis, &cubic_coefficients(p)).iter().zip(knots.windows(3)) {
            let [u, v, w] = [u[0], u[1], u[2]];
            let exact =
                p[0] + p[1] * (u + v + w) / 3.0 + p[2] * (u * v + v * w + w * u) / 3.0 + p[3] * u * v * w;
            prop_assert!((row - exact).abs() < 1e-12 * 700.0, "{row} {exact}");
        }
    }

    #[test]
    fn single_precision_keeps_its_stated_error((a, b) in parts(), c in prop::collection::vec(-1.0..1.0f32, N)) {
        let (single, double) = (RestrictedAxis::<f32>::new(a, b), RestrictedAxis::<f64>::new(a, b));
        for r in 0..single.count() {
            let (start, w) = single.row(r);
            let in_single = w[0] * c[start] + w[1] * c[start + 1] + w[2] * c[start + 2] + w[3] * c[start + 3];
            let w = double.row(r).1;
            let exact: f64 = (0..4).map(|j| w[j] * f64::from(c[start + j])).sum();
            prop_assert!((f64::from(in_single) - exact).abs() <= RestrictedAxis::<f32>::axis_error());
        }
    }

    #[test]
    fn brick_range_holds_the_function(
        boxes in prop::array::uniform3(parts()),
        c in prop::collection::vec(-1.0..1.0f64, N * N * N),
        points in prop::collection::vec(prop::array::uniform3(0.0..=1.0f64), 64),
    ) {
        let axes = boxes.map(|(a, b)| RestrictedAxis::<f64>::new(a, b));
        let (low, high) = restricted_range(c.as_slice().try_into().unwrap(), &axes);
        let slack = 6.0 * RestrictedAxis::<f64>::axis_error();
        for p in points {
            let x: Vec<f64> = (0..3).map(|d| (boxes[d].0 + (boxes[d].1 - boxes[d].0) * p[d]).min(boxes[d].1)).collect();
            let lines: Vec<f64> = (0..N * N).map(|i| evaluate(&c[i * N..][..N], x[2])).collect();
            let planes: Vec<f64> = (0..N).map(|i| evaluate(&lines[i * N..][..N], x[1])).collect();
            let f = evaluate(&planes, x[0]);
            prop_assert!(low - slack <= f && f <= high + slack, "{f} not in [{low}, {high}]");
        }
    }

    /// The slow way: the differences along each axis as a brick, restricted.
    #[test]
    fn slope_ranges_are_those_of_the_differences(
        boxes in prop::array::uniform3(parts()),
        c in prop::collection::vec(-1.0..1.0f64, N * N * N),
        single in any::<bool>(),
    ) {
        let within = boxes.map(|(a, b)| [a, b.min(a + 4.0)]);
        let values = within.map(|[a, b]| RestrictedAxis::<f64>::new(a, b));
        // Coefficients that are f32 make the same ranges in both precisions.
        let c: Vec<f64> = c.into_iter().map(|c| f64::from(c as f32)).collect();
        let (found, error): ([(f64, f64); 3], f64) = if single {
            let c: Vec<f32> = c.iter().map(|c| *c as f32).collect();
            let found = slope_ranges::<f32>(c.as_slice().try_into().unwrap(), &within);
            (found.ranges.map(|(a, b)| (f64::from(a), f64::from(b))), RestrictedAxis::<f32>::axis_error())
        } else {
            let found = slope_ranges::<f64>(c.as_slice().try_into().unwrap(), &within);
            (found.ranges, RestrictedAxis::<f64>::axis_error())
        };
        for axis in 0..3 {
            let step = [N * N, N, 1][axis];
            let rise = |i: usize| if i / step % N + 1 < N { c[i + step] - c[i] } else { 0.0 };
            let rises: Vec<f64> = (0..N * N * N).map(rise).collect();
            let mut axes = values;
            axes[axis] = RestrictedAxis::of_slopes(within[axis][0], within[axis][1]);
            let (lo, hi) = restricted_range(rises.as_slice().try_into().unwrap(), &axes);
            let (a, b) = found[axis];
            let slack = 7.0 * (error + RestrictedAxis::<f64>::axis_error());
            prop_assert!((a - lo).abs() <= slack && (b - hi).abs() <= slack, "{axis}: {a} {b}, {lo} {hi}");
        }
    }
}

/// In single precision, near the zero set of large coefficients, where the hull is smaller than its rounding.
#[test]
fn bounds_in_single_precision_hold_points() {
    let plane = |x: usize, y: usize, z: usize| 900.0 * (x as f32 + 0.7 * y as f32 - 1.3 * z as f32 - 1.234);
    let mut c = [0.0f32; N * N * N];
    (0..N * N * N).for_each(|i| c[i] = plane(i / N / N, i / N % N, i % N));
    let largest = c.iter().fold(0.0f64, |m, c| m.max(f64::from(c.abs())));
    let mut nearly_zero = 0;
    for i in 0..2000 {
        let [x, y] = [(i as f64 * 0.618).fract() * 8.0, (i as f64 * 0.414).fract() * 8.0];
        // Function h is centred on h - 1.
        let z = ((x + 1.0 + 0.7 * (y + 1.0) - 1.234) / 1.3 - 1.0).clamp(0.0, 8.0);
        let axes = [x, y, z].map(|q| RestrictedAxis::<f32>::new(q, q));
        // 8 units in the weights of an axis, t rounded to f32 under slopes of 4/3 max |c|, 64 sums.
        let evaluation = (64.0 + 3.0 * (8.0 + 4.0 / 3.0)) * f32::UNIT_ROUND_OFF;
        let (lo, hi) = restricted_range(&c, &axes);
        let bounds = Interval::new(f64::from(lo), f64::from(hi))
            .widened((evaluation + 3.0 * RestrictedAxis::<f32>::axis_error()) * largest);
        let part = |q: f64| {
            let cell = (q.floor() as usize).min(CELLS - 1);
            (cell, cubic::values((q - cell as f64) as f32))
        };
        let [(i, u), (j, v), (k, w)] = [x, y, z].map(part);
        let mut f = 0.0f32;
        for (a, u) in u.iter().enumerate() {
            for (b, v) in v.iter().enumerate() {
                for (d, w) in w.iter().enumerate() {
                    f += u * (v * (w * c[((i + a) * N + j + b) * N + k + d]));
                }
            }
        }
        assert!(
            bounds.contains(f64::from(f)),
            "{f} leaves {bounds:?} at {x} {y} {z}"
        );
        nearly_zero += usize::from(f.abs() < 1e-2);
    }
    assert!(nearly_zero > 500, "{nearly_zero}");
}

/// The hull of a smooth function exceeds its range less and less as the box shrinks (quadratically), whereas
/// the plain hull of the coefficients that a cell reads never does.
#[test]
fn hull_of_a_smooth_function_is_tight() {
    let f = |x: f64| (0.7 * x).sin();
    // Quasi-interpolant: c_i = (8f_i - f_{i-1} - f_{i+1})/6 reproduces cubics.
    let c: Vec<f64> = (0..N)
        .map(|h| h as f64 - 1.0)
        .map(|x| (8.0 * f(x) - f(x - 1.0) - f(x + 1.0)) / 6.0)
        .collect();
    for (length, limit) in [(4.0, 1.6), (1.0, 1.3), (0.25, 1.07), (0.01, 1.003)] {
        let mut worst: f64 = 0.0;
        for i in 0..400 {
            let a = (8.0 - length) * i as f64 / 399.0;
            let rows = apply(&RestrictedAxis::<f64>::new(a, a + length), &c);
            let samples: Vec<f64> = (0..=1000)
                .map(|j| evaluate(&c, (a + length * j as f64 / 1000.0).min(8.0)))
                .collect();
            let width = |v: &[f64]| {
                v.iter().copied().fold(f64::NEG_INFINITY, f64::max)
                    - v.iter().copied().fold(f64::INFINITY, f64::min)
            };
            // A box round an extremum has a range of second order itself; measure against the slope there.
            let range = width(&samples).max(0.7 * length * 0.25);
            worst = worst.max(width(&rows) / range);
        }
        assert!(worst <= limit, "length {length}: {worst}");
    }
}

#[test]
fn everything_gives_the_interior_coefficients_back() {
    let axis = RestrictedAxis::<f64>::new(0.0, 8.0);
    assert_eq!(axis.count(), N);
    for r in 3..N - 3 {
        let (start, w) = axis.row(r);
        let picked: Vec<usize> = (0..4).filter(|j| w[*j] != 0.0).map(|j| start + j).collect();
        assert_eq!(picked, [r]);
    }
}

fn weights_law<T: Real>(tolerance: f64) {
    for i in 0..=64 {
        let t = T::from_f64(i as f64 / 64.0);
        let x = t.as_f64();
        let sum = |w: [T; 4]| w.iter().map(|&w| w.as_f64()).sum::<f64>();
        assert!((sum(cubic::values(t)) - 1.0).abs() < tolerance);
        assert!(sum(cubic::first(t)).abs() < tolerance);
        assert!(sum(cubic::second(t)).abs() < tolerance);
        assert!(cubic::values(t).iter().all(|w| *w >= T::zero()));
        // Mirrored arguments give mirrored weights, to the bit.
        let mut mirrored = cubic::values(T::one() - t);
        mirrored.reverse();
        assert_eq!(cubic::values(t), mirrored);
        // Reproduction of x³ = Σ w_j (j-2)(j-1)j and of its derivatives.
        let c: [f64; 4] = std::array::from_fn(|j| (j as f64 - 2.0) * (j as f64 - 1.0) * j as f64);
        let apply = |w: [T; 4]| w.iter().zip(c).map(|(&w, c)| w.as_f64() * c).sum::<f64>();
        assert!((apply(cubic::values(t)) - x * x * x).abs() < 6.0 * tolerance);
        assert!((apply(cubic::first(t)) - 3.0 * x * x).abs() < 6.0 * tolerance);
        assert!((apply(cubic::second(t)) - 6.0 * x).abs() < 6.0 * tolerance);
        assert_eq!(apply(cubic::third::<T>()), 6.0);
    }
}

#[test]
fn uniform_weights_sum_reproduce_and_mirror() {
    weights_law::<f64>(8.0 * f64::EPSILON);
    weights_law::<f32>(8.0 * f64::from(f32::EPSILON));
}
