//! The laws of [`TensorSpline`]: the definition, fields, and insertion of knots.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::common::{Options, Random, field_conformance};
use bspline::hierarchical::{BrickKey, Corrections, Lattice};
use bspline::insertion::{InsertionError, boehm, oslo};
use bspline::{Aabb, BandedRows, Field, HierarchicalSpline, KnotVector, Real, TensorError, TensorSpline};
use glam::{DAffine3, DMat3, DVec3};

/// Random spans, one in three knots repeated up to `most` times, both ends clamped or neither.
fn random_knots(degree: usize, spans: usize, most: usize, clamped: bool, random: &mut Random) -> KnotVector {
    let mut u = -1.0 + random.unit();
    let mut next = |random: &mut Random| {
        u += 10f64.powf(-2.0 * random.unit());
        u
    };
    let mut end = |random: &mut Random| match clamped {
        true => vec![next(random); degree + 1],
        false => (0..=degree).map(|_| next(random)).collect(),
    };
    let first = end(random);
    let mut inner = Vec::new();
    for _ in 1..spans {
        let times = if random.below(3) == 0 {
            1 + random.below(most)
        } else {
            1
        };
        inner.extend(vec![end(random)[0]; times]);
    }
    let knots = first.into_iter().chain(inner).chain(end(random)).collect();
    KnotVector::new(degree, knots).unwrap()
}

fn oblique() -> DAffine3 {
    let m = DMat3::from_cols(
        DVec3::new(1.5, 0.2, 0.0),
        DVec3::new(-0.3, 0.8, 0.1),
        DVec3::new(0.1, 0.0, -1.1),
    );
    DAffine3::from_mat3_translation(m, DVec3::new(10.0, -20.0, 5.0))
}

fn random_spline<T: Real>(knots: [KnotVector; 3], map: DAffine3, random: &mut Random) -> TensorSpline<T> {
    let count = knots.iter().map(KnotVector::coefficient_count).product();
    let coefficients = (0..count)
        .map(|_| T::from_f64(2.0 * random.unit() - 1.0))
        .collect();
    TensorSpline::new(knots, coefficients, map, 0.7).unwrap()
}

/// `N_{i,p}(t)` and its derivative by the recursion that defines them, right-continuous but at the end of the domain.
fn definition(knots: &KnotVector, i: usize, p: usize, t: f64) -> (f64, f64) {
    let u = knots.knots();
    let [_, end] = knots.domain();
    if p == 0 {
        let last = t == end && u[i] < end && u[i + 1] == end;
        let inside = (u[i] <= t && t < u[i + 1] && t < end) || last;
        return (f64::from(inside), 0.0);
    }
    let (a, b) = (
        definition(knots, i, p - 1, t).0,
        definition(knots, i + 1, p - 1, t).0,
    );
    let over = |x: f64, length: f64| if length > 0.0 { x / length } else { 0.0 };
    let (left, right) = (u[i + p] - u[i], u[i + p + 1] - u[i + 1]);
    (
        over(t - u[i], left) * a + over(u[i + p + 1] - t, right) * b,
        p as f64 * (over(a, left) - over(b, right)),
    )
}

/// Value and gradient by parameters: the sum over all functions, each by its definition.
fn reference(f: &TensorSpline<f64>, q: DVec3) -> (f64, DVec3) {
    let axes: [Vec<(f64, f64)>; 3] = std::array::from_fn(|a| {
        let k = &f.knots()[a];
        (0..k.coefficient_count())
            .map(|i| definition(k, i, k.degree(), q[a]))
            .collect()
    });
    let (mut value, mut gradient) = (0.0, DVec3::ZERO);
    for ([i, j, k], c) in TensorSpline::<f64>::indices(f.knots()).zip(f.coefficients()) {
        let (x, y, z) = (axes[0][i], axes[1][j], axes[2][k]);
        value += c * x.0 * y.0 * z.0;
        gradient += *c * DVec3::new(x.1 * y.0 * z.0, x.0 * y.1 * z.0, x.0 * y.0 * z.1);
    }
    (value, gradient)
}

/// A parameter of the domain: random, on a knot, or at an end.
fn parameter(f: &TensorSpline<f64>, random: &mut Random) -> DVec3 {
    DVec3::from_array(f.knots().each_ref().map(|k| {
        let [start, end] = k.domain();
        match random.below(6) {
            0 => start,
            1 => end,
            2 => k.knots()[random.below(k.knots().len())].clamp(start, end),
            _ => start + (end - start) * random.unit(),
        }
    }))
}

#[test]
fn values_and_gradients_are_those_of_the_definition() {
    let mut random = Random(1);
    for round in 0..60 {
        let degrees = [1 + round % 5, 1 + round / 5 % 5, 1 + random.below(5)];
        let knots = degrees.map(|p| {
            let (spans, clamped) = (1 + random.below(4), random.below(2) == 0);
            random_knots(p, spans, p, clamped, &mut random)
        });
        let f = random_spline::<f64>(knots, oblique(), &mut random);
        let turn = f.parameter_from_world().matrix3.transpose();
        for _ in 0..20 {
            let q = parameter(&f, &mut random);
            let (value, gradient) = reference(&f, q);
            assert!(
                (f.value_at_parameter(q) - value).abs() < 1e-13,
                "{degrees:?} at {q}"
            );
            // The map to the world and back must not leave the span: half-way to the middle of the domain it cannot.
            let p = f.world_from_parameter().transform_point3(q);
            let back = f.parameter_from_world().transform_point3(p);
            let same_spans = (0..3).all(|a| {
                let k = &f.knots()[a];
                let [start, end] = k.domain();
                k.span(back[a]) == k.span(q[a]) && start <= back[a] && back[a] <= end
            });
            if same_spans {
                let (v, g) = f.value_gradient(p);
                let steepest = gradient.length().max(1.0);
                assert!(
                    (v - value).abs() < 1e-10 * steepest,
                    "{degrees:?} at {q}: {v} {value}"
                );
                assert!(
                    (g - turn * gradient).length() < 1e-9 * steepest * steepest,
                    "{degrees:?} at {q}: {g} {}",
                    turn * gradient
                );
            }
        }
    }
}

#[test]
fn uniform_cubics_are_those_of_the_hierarchy() {
    let cells = [5u32, 4, 6];
    let map = oblique();
    let mut random = Random(3);
    let knots = [0, 1, 2].map(|a| KnotVector::uniform(3, cells[a] as usize, 0.0, cells[a] as f64).unwrap());
    let tensor = random_spline::<f64>(knots, map, &mut random);
    let mut bricks: BTreeMap<BrickKey, Corrections<f64>> = BTreeMap::new();
    for (s, c) in TensorSpline::<f64>::indices(tensor.knots()).zip(tensor.coefficients()) {
        let brick = bricks
            .entry(BrickKey(s.map(|s| s as u32 / 8)))
            .or_insert_with(Corrections::empty);
        brick.set(s.map(|s| s % 8), *c);
    }
    let level = bricks.into_iter().map(|(k, c)| (k, Arc::new(c))).collect();
    let lattice = Lattice {
        world_from_lattice: map,
        cells,
    };
    let hierarchy = HierarchicalSpline::from_corrections(lattice, 0.7, vec![level]);
    let region = tensor.world_box();
    let region = Aabb::new(region.min - 2.0, region.max + 2.0);
    for _ in 0..2000 {
        let p = random.point(&region);
        let (a, b) = (tensor.jet(p), hierarchy.jet(p));
        assert!((a.value - b.value).abs() < 1e-13);
        assert!((a.gradient - b.gradient).length() < 1e-12);
        let off = (a.hessian - b.hessian).to_cols_array();
        assert!(off.iter().all(|x| x.abs() < 1e-11), "{off:?} at {p}");
    }
}

/// Largest change over the domain, in units of the largest coefficient.
fn change(before: &TensorSpline<f64>, after: &TensorSpline<f64>, random: &mut Random) -> f64 {
    let largest = before.coefficients().iter().fold(0.0f64, |m, c| m.max(c.abs()));
    (0..60)
        .map(|_| {
            let q = parameter(before, random);
            (before.value_at_parameter(q) - after.value_at_parameter(q)).abs() / largest
        })
        .fold(0.0, f64::max)
}

#[test]
fn insertion_keeps_the_field() {
    let mut random = Random(5);
    for round in 0..300 {
        let degrees = [1 + round % 5, 1 + random.below(5), 1 + random.below(5)];
        let knots = degrees.map(|p| {
            let (spans, clamped) = (1 + random.below(5), random.below(2) == 0);
            random_knots(p, spans, p, clamped, &mut random)
        });
        let f = random_spline::<f64>(knots, DAffine3::IDENTITY, &mut random);
        let axis = random.below(3);
        let k = &f.knots()[axis];
        let [start, end] = k.domain();
        // Anywhere, at the ends, on knots and next to them, as often as is allowed.
        let mut new = Vec::new();
        for _ in 0..1 + random.below(8) {
            let u = match random.below(5) {
                0 => start,
                1 => end,
                2 => k.knots()[random.below(k.knots().len())].clamp(start, end),
                3 => k.knots()[random.below(k.knots().len())]
                    .clamp(start, end)
                    .next_up()
                    .min(end),
                _ => start + (end - start) * random.unit(),
            };
            let present = k.multiplicity(u) + new.iter().filter(|x| **x == u).count();
            if present < k.degree() {
                new.push(u);
            }
        }
        let at_once = f.insert_knots(axis, &new).unwrap();
        let one_by_one = new
            .iter()
            .fold(f.clone(), |f, u| f.insert_knot(axis, *u).unwrap());
        assert_eq!(at_once.knots(), one_by_one.knots());
        assert_eq!(at_once.shape()[axis], f.shape()[axis] + new.len());
        for finer in [&at_once, &one_by_one] {
            let off = change(&f, finer, &mut random);
            assert!(
                off <= 1e-12,
                "degree {:?}, {new:?} on axis {axis}: {off:e}",
                degrees
            );
        }
        for (a, b) in at_once.coefficients().iter().zip(one_by_one.coefficients()) {
            assert!((a - b).abs() <= 1e-13, "Oslo {a}, Boehm {b}");
        }
        // The finer spline against the definition, on its own knots: independent of what made it.
        let q = parameter(&f, &mut random);
        assert!((reference(&at_once, q).0 - reference(&f, q).0).abs() <= 1e-12);
    }
}

#[test]
fn knots_fill_up_to_the_degree_and_no_further() {
    let mut random = Random(7);
    for degree in 1..=5 {
        let knots = random_knots(degree, 3, 1, true, &mut random);
        let [start, end] = knots.domain();
        let mut f = random_spline::<f64>(
            [knots.clone(), knots.clone(), knots],
            DAffine3::IDENTITY,
            &mut random,
        );
        let whole = f.clone();
        let u = start + 0.37 * (end - start);
        for times in 1..=degree {
            f = f.insert_knot(1, u).unwrap();
            assert_eq!(f.knots()[1].multiplicity(u), times);
        }
        assert!(change(&whole, &f, &mut random) <= 1e-12);
        let full = InsertionError::Multiplicity {
            knot: u,
            wanted: degree + 1,
            degree,
        };
        assert_eq!(f.insert_knot(1, u).err(), Some(full.clone()));
        assert_eq!(whole.insert_knots(1, &vec![u; degree + 1]).err(), Some(full));
        // At a knot as often as the degree, the spline takes the value of a coefficient.
        let k = f.knots()[1].knots().partition_point(|x| *x < u);
        let (rows, first) = (BandedRows::<f64>::collocation(&f.knots()[1], [u], 0), k - 1);
        let (at, weights) = rows.row(0);
        assert!((weights[first - at] - 1.0).abs() < 1e-14, "{weights:?}");
        // Clamped ends are full.
        for u in [start, end] {
            assert!(matches!(
                f.insert_knot(0, u).err(),
                Some(InsertionError::Multiplicity { .. })
            ));
        }
    }
}

#[test]
fn unclamped_ends_take_knots_too() {
    let mut random = Random(9);
    for degree in 1..=5 {
        let knots = KnotVector::uniform(degree, 4, 0.0, 4.0).unwrap();
        let f = random_spline::<f64>(
            [knots.clone(), knots.clone(), knots],
            DAffine3::IDENTITY,
            &mut random,
        );
        for u in [0.0, 4.0] {
            let full = f.insert_knots(2, &vec![u; degree - 1]).unwrap();
            assert_eq!(full.knots()[2].domain(), [0.0, 4.0]);
            assert!(change(&f, &full, &mut random) <= 1e-12);
            assert!(full.insert_knot(2, u).is_err());
        }
    }
}

#[test]
fn refinement_and_parts_keep_the_field() {
    let mut random = Random(11);
    for degree in 1..=5 {
        let knots = [0; 3].map(|_| random_knots(degree, 4, 2.min(degree), degree % 2 == 0, &mut random));
        let f = random_spline::<f64>(knots, DAffine3::IDENTITY, &mut random);
        let finer = (0..3).fold(f.clone(), |f, axis| f.refined(axis, 3).unwrap());
        assert!(change(&f, &finer, &mut random) <= 1e-12);
        let [start, end] = f.knots()[0].domain();
        let cut = [start + 0.21 * (end - start), start + 0.74 * (end - start)];
        let part = f.restricted(0, cut[0], cut[1]).unwrap();
        assert!(part.knots()[0].is_clamped() && part.knots()[0].domain() == cut);
        let mut inner = part.clone();
        for _ in 0..3 {
            assert!(change(&inner, &f, &mut random) <= 1e-12);
            inner = inner.refined(0, 2).unwrap();
        }
    }
}

#[test]
fn insertion_matrices_are_convex_combinations() {
    let mut random = Random(13);
    for round in 0..200 {
        let degree = 1 + round % 5;
        let spans = 2 + random.below(5);
        let knots = random_knots(degree, spans, degree, round % 2 == 0, &mut random);
        let [start, end] = knots.domain();
        let new: Vec<f64> = (0..5).map(|_| start + (end - start) * random.unit()).collect();
        let (_, many) = oslo::<f64>(&knots, &new).unwrap();
        let (_, one) = boehm::<f64>(&knots, new[0]).unwrap();
        for rows in [many, one] {
            for r in 0..rows.row_count() {
                let (first, weights) = rows.row(r);
                assert!(first + weights.len() <= rows.column_count());
                assert!(weights.iter().all(|w| *w >= 0.0));
                assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-14, "{weights:?}");
            }
        }
    }
}

fn conforms<T: Real>(name: &str, f: &TensorSpline<T>, options: &Options) {
    let whole = f.world_box();
    // Differences across the faces of the box would see the kink of the extension.
    let margin = 2.0 * options.step * whole.size().length();
    let region = Aabb::new(whole.min + margin, whole.max - margin);
    let widths = field_conformance(name, f, &region, options);
    println!("{name}: bounds over ranges, median and p99: {widths:?}");
}

#[test]
fn fields_conform() {
    let mut random = Random(15);
    let scaled = DAffine3::from_scale(DVec3::new(1.0, 2.0, 0.5));
    // Rough: third derivatives are large in the shortest spans, and the gradient jumps where the degree is 1.
    for (degrees, rough_share) in [([3, 2, 4], 5e-3), ([5, 5, 5], 5e-3), ([1, 3, 1], 1e-2)] {
        let knots = degrees.map(|p| random_knots(p, 4, 1, p != 3, &mut random));
        let f = random_spline::<f64>(knots, scaled, &mut random);
        let options = Options {
            rough_share,
            sound_boxes: 20_000,
            value_tolerance: 1e-13,
            ..Options::default()
        };
        conforms(&format!("degrees {degrees:?}"), &f, &options);
    }
    // In single precision differences need long steps, and so even spans.
    let knots = [3, 4, 5].map(|cells| KnotVector::clamped_uniform(3, cells, 0.0, cells as f64).unwrap());
    let f = random_spline::<f32>(knots, scaled, &mut random);
    let options = Options {
        value_tolerance: 1e-6,
        step: 1e-3,
        difference_tolerance: 3e-2,
        rough_share: 1e-3,
        sound_boxes: 20_000,
        ..Options::default()
    };
    conforms("f32", &f, &options);
}

#[test]
fn bounds_hold_outside_the_box_and_on_oblique_maps() {
    let mut random = Random(17);
    for round in 0..40 {
        let knots = [0; 3].map(|_| random_knots(1 + random.below(5), 3, 1, round % 2 == 0, &mut random));
        let map = if round % 2 == 0 {
            oblique()
        } else {
            DAffine3::from_scale(DVec3::new(1.0, 2.0, 0.5))
        };
        let f = random_spline::<f32>(knots, map, &mut random);
        let region = f.world_box();
        let region = Aabb::new(region.min - 3.0, region.max + 3.0);
        for _ in 0..200 {
            let b = random.small_box(&region);
            let bound = f.bounds(&b);
            for _ in 0..20 {
                let p = random.point(&b);
                assert!(bound.contains(f.value(p)), "{} outside {bound:?}", f.value(p));
            }
        }
    }
}

#[test]
fn derivatives_outside_the_box_match_differences() {
    let mut random = Random(19);
    let knots = [0; 3].map(|_| random_knots(3, 3, 1, true, &mut random));
    let f = random_spline::<f64>(knots, oblique(), &mut random);
    let whole = f.world_box();
    let region = Aabb::new(whole.min - 4.0, whole.max + 4.0);
    let d = 1e-5;
    let mut off = 0;
    for _ in 0..1000 {
        let p = random.point(&region);
        let jet = f.jet(p);
        for a in 0..3 {
            let e = DVec3::AXES[a] * d;
            let ((v1, g1), (v0, g0)) = (f.value_gradient(p + e), f.value_gradient(p - e));
            // Only next to the planes of the faces, where the extension has its kinks.
            off += usize::from(((v1 - v0) / (2.0 * d) - jet.gradient[a]).abs() > 1e-4);
            off += usize::from(
                ((g1 - g0) / (2.0 * d) - jet.hessian.col(a)).length()
                    > 1e-3 * (1.0 + jet.hessian.col(a).length()),
            );
        }
    }
    assert!(off <= 6, "{off} derivatives are wrong");
}

#[test]
fn bad_splines_are_refused() {
    let k = KnotVector::clamped_uniform(2, 2, 0.0, 1.0).unwrap();
    let make = |knots: [&KnotVector; 3], count: usize, map: DAffine3, slope: f64| {
        TensorSpline::<f64>::new(knots.map(Clone::clone), vec![0.0; count], map, slope).err()
    };
    let (id, all) = (DAffine3::IDENTITY, [&k, &k, &k]);
    assert_eq!(make(all, 64, id, 0.0), None);
    let wrong = TensorError::CoefficientCount {
        shape: [4; 3],
        found: 63,
    };
    assert_eq!(make(all, 63, id, 0.0), Some(wrong));
    assert!(matches!(make(all, 64, id, -1.0), Some(TensorError::Slope { .. })));
    assert!(matches!(
        make(all, 64, id, f64::NAN),
        Some(TensorError::Slope { .. })
    ));
    let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
    assert!(matches!(
        make(all, 64, flat, 0.0),
        Some(TensorError::Placement { .. })
    ));
    let torn = KnotVector::new(1, vec![0.0, 0.0, 0.5, 0.5, 1.0, 1.0]).unwrap();
    assert!(matches!(
        make([&k, &torn, &k], 64, id, 0.0),
        Some(TensorError::Discontinuous {
            axis: 1,
            found: 2,
            degree: 1,
            ..
        })
    ));
    let nan = TensorSpline::new([k.clone(), k.clone(), k.clone()], vec![f32::NAN; 64], id, 0.0).err();
    assert!(matches!(nan, Some(TensorError::NotFinite { index: 0, .. })));

    let f = TensorSpline::new([k.clone(), k.clone(), k], vec![1.0; 64], id, 0.0).unwrap();
    for u in [-0.1, 1.1, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            f.insert_knot(0, u).err(),
            Some(InsertionError::Outside { .. })
        ));
    }
    assert_eq!(f.refined(0, 0).err(), Some(InsertionError::NoParts));
    assert!(matches!(
        f.refined(0, usize::MAX).err(),
        Some(InsertionError::TooMany { .. })
    ));
    assert!(matches!(
        f.restricted(0, 0.5, 0.5).err(),
        Some(InsertionError::Interval { .. })
    ));
    assert!(matches!(
        f.restricted(0, -0.5, 0.5).err(),
        Some(InsertionError::Interval { .. })
    ));
    let near = f.insert_knot(0, 0.5f64.next_up()).unwrap();
    assert!(matches!(
        near.refined(0, 2).err(),
        Some(InsertionError::SpanTooShort { .. })
    ));
}
