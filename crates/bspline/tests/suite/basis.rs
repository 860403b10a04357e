//! Knot vectors and B-splines of every degree, in both precisions.

use bspline::basis::MAX_DERIVATIVE;
use bspline::knots::MAX_DEGREE;
use bspline::{Basis, KnotError, KnotVector, Real, cubic};
use proptest::prelude::*;

/// Knot vectors of every degree: clamped and open, with repeated inner knots up to multiplicity `degree`.
fn knot_vectors() -> impl Strategy<Value = KnotVector> {
    (
        1..=MAX_DEGREE,
        any::<bool>(),
        prop::collection::vec((0.05..1.0f64, 1..=3usize), 1..8),
        -3.0..3.0f64,
    )
        .prop_map(|(degree, clamped, steps, start)| {
            let mut knots = Vec::new();
            let mut u = start;
            if clamped {
                knots.extend(std::iter::repeat_n(u, degree + 1));
            } else {
                knots.extend((0..=degree).map(|i| start - 0.3 * (degree - i) as f64));
            }
            for (step, multiplicity) in &steps[..steps.len() - 1] {
                u += step;
                knots.extend(std::iter::repeat_n(u, (*multiplicity).min(degree)));
            }
            u += steps[steps.len() - 1].0;
            if clamped {
                knots.extend(std::iter::repeat_n(u, degree + 1));
            } else {
                knots.extend((0..=degree).map(|i| u + 0.2 * i as f64));
            }
            KnotVector::new(degree, knots).expect("valid by construction")
        })
}

/// A knot vector and a parameter of its domain: anywhere, at a knot, at an end.
fn parameters() -> impl Strategy<Value = (KnotVector, f64)> {
    (knot_vectors(), 0.0..=1.0f64, any::<prop::sample::Index>(), 0..4u8).prop_map(
        |(k, share, index, kind)| {
            let [start, end] = k.domain();
            let t = match kind {
                0 => k.knots()[index.index(k.knots().len())].clamp(start, end),
                1 => [start, end][index.index(2)],
                _ => (start + (end - start) * share).min(end),
            };
            (k, t)
        },
    )
}

/// Smallest distance between distinct knots that the functions at `t` see: derivatives scale with its powers.
fn spacing(k: &KnotVector, t: f64) -> f64 {
    let (p, s) = (k.degree(), k.span(t));
    let gaps = k.knots()[s + 1 - p..=s + p]
        .windows(2)
        .map(|w| w[1] - w[0])
        .filter(|d| *d > 0.0);
    gaps.fold(f64::INFINITY, f64::min)
}

/// Coefficients of `(t - a)^d`: its blossom at the inner knots, the mean of the products of `d` of them
/// (Marsden's identity).
fn power_coefficients(k: &KnotVector, a: f64, d: usize) -> Vec<f64> {
    (0..k.coefficient_count())
        .map(|i| {
            let mut sums = [0.0; MAX_DEGREE + 1];
            sums[0] = 1.0;
            for (seen, u) in k.knots()[i + 1..=i + k.degree()].iter().enumerate() {
                for j in (1..=seen + 1).rev() {
                    sums[j] += sums[j - 1] * (u - a);
                }
            }
            let binomial = (0..d).fold(1.0, |b, j| b * (k.degree() - j) as f64 / (j + 1) as f64);
            sums[d] / binomial
        })
        .collect()
}

fn combine<T: Real>(basis: &Basis<T>, order: usize, c: &[f64]) -> f64 {
    let terms = basis.derivative(order).iter().zip(&c[basis.first()..]);
    terms.map(|(&n, c)| n.as_f64() * c).sum()
}

/// Cox–de Boor recurrence as it is written, for comparison.
fn cox_de_boor(u: &[f64], i: usize, p: usize, t: f64, span: usize) -> f64 {
    if p == 0 {
        return f64::from(i == span);
    }
    let part = |n: f64, d: f64, f: f64| if d == 0.0 { 0.0 } else { n / d * f };
    part(t - u[i], u[i + p] - u[i], cox_de_boor(u, i, p - 1, t, span))
        + part(
            u[i + p + 1] - t,
            u[i + p + 1] - u[i + 1],
            cox_de_boor(u, i + 1, p - 1, t, span),
        )
}

fn sums_law<T: Real>(k: &KnotVector, t: f64) -> Result<(), TestCaseError> {
    let basis = Basis::<T>::at(k, t, MAX_DERIVATIVE);
    let unit = 2.0 * T::UNIT_ROUND_OFF;
    prop_assert!(basis.values().iter().all(|n| *n >= T::zero()));
    for order in 0..=MAX_DERIVATIVE {
        let row = basis.derivative(order);
        let sum: f64 = row.iter().map(|n| n.as_f64()).sum();
        let magnitude: f64 = row.iter().map(|n| n.as_f64().abs()).sum();
        let expected = if order == 0 { 1.0 } else { 0.0 };
        // Nearly coincident knots amplify rounding by their ratio to the widest cell seen, at most 20 here.
        prop_assert!(
            (sum - expected).abs() <= 1e2 * unit * magnitude.max(1.0),
            "order {order}: {sum}"
        );
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn basis_is_partition_of_unity_and_derivatives_sum_to_zero((k, t) in parameters()) {
        sums_law::<f64>(&k, t)?;
        sums_law::<f32>(&k, t)?;
    }

    #[test]
    fn span_holds_its_parameter((k, t) in parameters()) {
        let (s, u) = (k.span(t), k.knots());
        prop_assert!(u[s] < u[s + 1] && u[s] <= t && t <= u[s + 1]);
        prop_assert!(t < u[s + 1] || t == k.domain()[1]);
        prop_assert!((k.degree()..k.coefficient_count()).contains(&s));
    }

    #[test]
    fn polynomials_up_to_the_degree_are_reproduced((k, t) in parameters()) {
        let [a, end] = k.domain();
        let reach = k.knots()[k.knots().len() - 1].max(end) - k.knots()[0];
        for d in 0..=k.degree() {
            let c = power_coefficients(&k, a, d);
            let (double, single) = (Basis::<f64>::at(&k, t, 3), Basis::<f32>::at(&k, t, 3));
            for order in 0..=MAX_DERIVATIVE {
                let falling = (0..order).fold(1.0, |f, j| f * (d as f64 - j as f64));
                let exact = if order > d { 0.0 } else { falling * (t - a).powi((d - order) as i32) };
                let scale = reach.max(1.0).powi(d as i32) * (1.0 / spacing(&k, t)).max(1.0).powi(order as i32);
                prop_assert!((combine(&double, order, &c) - exact).abs() <= 1e-12 * scale);
                prop_assert!((combine(&single, order, &c) - exact).abs() <= 1e-4 * scale);
            }
        }
    }

    #[test]
    fn values_match_the_recurrence((k, t) in parameters()) {
        let basis = Basis::<f64>::at(&k, t, 0);
        for i in 0..k.coefficient_count() {
            let expected = cox_de_boor(k.knots(), i, k.degree(), t, basis.span());
            // Local support: every function that is not listed is zero.
            let ours = i.checked_sub(basis.first()).and_then(|j| basis.values().get(j).copied()).unwrap_or(0.0);
            prop_assert!((ours - expected).abs() < 1e-14);
            let [low, high] = k.support(i);
            prop_assert!(ours == 0.0 || (low <= t && t <= high));
        }
        prop_assert_eq!(basis.derivative(1).iter().copied().fold(0.0, f64::max), 0.0);
    }

    #[test]
    fn derivatives_match_central_differences((k, t) in parameters()) {
        let gap = spacing(&k, t);
        let h = 1e-4 * gap;
        let [low, high] = [k.knots()[k.span(t)], k.knots()[k.span(t) + 1]];
        let t = t.clamp(low + 2.0 * h, high - 2.0 * h);
        let at = |t: f64| Basis::<f64>::at(&k, t, 3);
        let (before, here, after) = (at(t - h), at(t), at(t + h));
        for order in 1..=3 {
            for j in 0..=k.degree() {
                let difference = (after.derivative(order - 1)[j] - before.derivative(order - 1)[j]) / (2.0 * h);
                let exact = here.derivative(order)[j];
                // Truncation h²f'''/6 with derivatives of size (p/gap)^k, and cancellation of 1e-16/h.
                let scale = (k.degree() as f64 / gap).powi(order as i32).max(1.0);
                prop_assert!((difference - exact).abs() <= 1e-6 * scale, "{order} {j}: {difference} {exact}");
            }
        }
    }

    #[test]
    fn smoothness_falls_with_multiplicity(k in knot_vectors()) {
        for run in k.knots().chunk_by(|a, b| a == b) {
            let (u, [start, end]) = (run[0], k.domain());
            if u <= start || u >= end {
                continue;
            }
            // Left-hand limits: the polynomials of the span below, continued to u.
            let below = Basis::<f64>::at(&k, u.next_down(), 3);
            let above = Basis::<f64>::at(&k, u, 3);
            for order in 0..=(k.degree().saturating_sub(run.len())).min(3) {
                for i in 0..k.coefficient_count() {
                    let of = |b: &Basis<f64>| {
                        i.checked_sub(b.first()).and_then(|j| b.derivative(order).get(j).copied()).unwrap_or(0.0)
                    };
                    let scale = (5.0 / spacing(&k, u).min(spacing(&k, u.next_down()))).powi(order as i32 + 1);
                    prop_assert!((of(&below) - of(&above)).abs() < 1e-12 * scale.max(1.0));
                }
            }
        }
    }

    #[test]
    fn uniform_path_equals_the_general_one(cells in 1..20usize, share in 0.0..=1.0f64) {
        let k = KnotVector::uniform(3, cells, 0.0, cells as f64).unwrap();
        let t = share * cells as f64;
        let cell = (t.floor() as usize).min(cells - 1);
        let basis = Basis::<f64>::at(&k, t, 3);
        prop_assert_eq!(basis.first(), cell);
        let x = t - cell as f64;
        let fast = [cubic::values(x), cubic::first(x), cubic::second(x), cubic::third()];
        for (order, row) in fast.iter().enumerate() {
            for j in 0..4 {
                prop_assert!((row[j] - basis.derivative(order)[j]).abs() < 1e-13);
            }
        }
        let single = Basis::<f32>::at(&k, t, 2);
        let fast = [cubic::values(x as f32), cubic::first(x as f32), cubic::second(x as f32)];
        for (order, row) in fast.iter().enumerate() {
            for j in 0..4 {
                prop_assert!((row[j] - single.derivative(order)[j]).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn greville_abscissae_are_the_coefficients_of_t((k, t) in parameters()) {
        let c: Vec<f64> = k.greville_abscissae().collect();
        prop_assert!(c.is_sorted());
        prop_assert!((combine(&Basis::<f64>::at(&k, t, 0), 0, &c) - t).abs() < 1e-13);
        if k.is_clamped() {
            prop_assert_eq!([c[0], c[c.len() - 1]], k.domain());
        }
    }
}

#[test]
fn clamped_ends_take_their_coefficient_alone() {
    for degree in 1..=MAX_DEGREE {
        let k = KnotVector::clamped_uniform(degree, 4, -1.0, 2.0).unwrap();
        assert!(k.is_clamped());
        assert_eq!(k.coefficient_count(), 4 + degree);
        assert_eq!(Basis::<f64>::at(&k, -1.0, 0).values()[0], 1.0);
        let end = Basis::<f64>::at(&k, 2.0, 0);
        assert_eq!(
            (end.span(), end.values()[degree]),
            (k.coefficient_count() - 1, 1.0)
        );
    }
}

#[test]
fn outside_the_domain_the_end_polynomials_go_on() {
    let k = KnotVector::uniform(3, 3, 0.0, 3.0).unwrap();
    let c = power_coefficients(&k, 0.0, 3);
    for t in [-2.0, -0.5, 3.5, 6.0] {
        assert!((combine(&Basis::<f64>::at(&k, t, 0), 0, &c) - t.powi(3)).abs() < 1e-11);
    }
    assert!(Basis::<f64>::at(&k, f64::NAN, 3).values()[0].is_nan());
}

#[test]
fn uniform_knots_end_exactly_on_the_domain() {
    let k = KnotVector::uniform(3, 7, 0.1, 0.8).unwrap();
    assert_eq!(k.domain(), [0.1, 0.8]);
    assert_eq!(k.knots().len(), 7 + 7);
    assert!(!k.is_clamped());
}

#[test]
fn bad_knots_are_refused_with_their_numbers() {
    let of = |degree, knots: &[f64]| KnotVector::new(degree, knots.to_vec()).unwrap_err();
    assert_eq!(of(0, &[0.0, 1.0]), KnotError::Degree { degree: 0 });
    assert_eq!(of(6, &[0.0; 20]), KnotError::Degree { degree: 6 });
    assert_eq!(
        of(2, &[0.0; 5]),
        KnotError::TooFew {
            found: 5,
            needed: 6,
            degree: 2
        }
    );
    assert!(matches!(
        of(1, &[0.0, 0.0, f64::NAN, 1.0]),
        KnotError::NotFinite { index: 2, .. }
    ));
    assert_eq!(
        of(1, &[0.0, 1.0, 0.5, 2.0]),
        KnotError::Decreasing {
            index: 2,
            before: 1.0,
            after: 0.5
        }
    );
    assert_eq!(
        of(1, &[0.0, 0.0, 1.0, 1.0, 1.0, 2.0]),
        KnotError::Multiplicity {
            value: 1.0,
            found: 3,
            degree: 1
        }
    );
    assert_eq!(
        of(1, &[0.0, 1.0, 1.0, 2.0]),
        KnotError::Domain { start: 1.0, end: 1.0 }
    );
    assert!(matches!(
        of(1, &[-1e308, -1e308, 1e308, 1e308]),
        KnotError::Domain { .. }
    ));
    for (cells, start, end) in [(0, 0.0, 1.0), (usize::MAX, 0.0, 1.0), (100, 1.0, 1.0 + 1e-14)] {
        assert_eq!(
            KnotVector::uniform(3, cells, start, end),
            Err(KnotError::Cells { cells, start, end })
        );
        assert_eq!(
            KnotVector::clamped_uniform(3, cells, start, end),
            Err(KnotError::Cells { cells, start, end })
        );
    }
    assert!(matches!(
        KnotVector::uniform(3, 4, 1.0, f64::INFINITY),
        Err(KnotError::Domain { .. })
    ));
    assert!(of(1, &[0.0, 1.0, 0.5, 2.0]).to_string().contains("0.5"));
}
