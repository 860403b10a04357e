//! Smooth operations of trees of fields: the laws of fields, what is smooth and what is not, and where they are the
//! sharp ones.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::common::{Options, Random, field_conformance};
use bspline::csg::{Blend, Operation, Rounding};
use bspline::hierarchical::{BRICK_LEN, BrickKey, Corrections, Lattice};
use bspline::primitives::{Cuboid, Gyroid, HalfSpace, Sphere, Torus};
use bspline::{Aabb, Csg, CsgError, Field, HierarchicalSpline, KnotVector, TensorSpline};
use glam::{DAffine3, DMat3, DVec3, dvec3};

const REGION: Aabb = Aabb {
    min: DVec3::new(-3.0, -3.0, -3.0),
    max: DVec3::new(3.0, 3.0, 3.0),
};

type Shared = Arc<dyn Field>;

fn sphere(x: f64, y: f64, z: f64, r: f64) -> Shared {
    Arc::new(Sphere::new(dvec3(x, y, z), r).unwrap())
}

fn gyroid() -> Shared {
    Arc::new(Gyroid::new(dvec3(0.1, 0.2, 0.3), 3.0, 0.2).unwrap())
}

fn torus() -> Shared {
    Arc::new(Torus::new(dvec3(0.1, 0.2, -0.3), dvec3(1.0, 1.0, 3.0), 1.6, 0.5).unwrap())
}

const BOUNDED: Rounding = Rounding::Bounded { range: 0.6 };
const R0: Rounding = Rounding::Rvachev { rounding: 0.0 };
const R_ROUND: Rounding = Rounding::Rvachev { rounding: 0.4 };
const ALL: [Rounding; 3] = [BOUNDED, R0, R_ROUND];
const BOTH: [Operation; 2] = [Operation::Union, Operation::Intersection];

fn blend(operation: Operation, rounding: Rounding, f: &Shared, g: &Shared, iso: f64) -> Blend {
    Blend::new(operation, rounding, [f.clone(), g.clone()], iso).unwrap()
}

fn check(name: &str, field: &dyn Field, options: Options) {
    let [median, p99] = field_conformance(name, field, &REGION, &options);
    println!("{name}: bounds {median:.3} (median), {p99:.3} (99th percentile)");
}

fn options(rough_share: f64) -> Options {
    Options {
        rough_share,
        sound_boxes: 30_000,
        value_tolerance: 1e-13,
        ..Options::default()
    }
}

#[test]
fn blends_conform() {
    for rounding in ALL {
        for operation in BOTH {
            let f = blend(operation, rounding, &sphere(0.5, 0.1, 0.0, 1.3), &gyroid(), 0.1);
            check(&format!("{operation:?} {rounding:?}"), &f, options(2e-3));
        }
    }
}

#[test]
fn trees_of_blends_conform() {
    let solids = vec![sphere(1.0, 0.0, 0.0, 1.0), torus(), gyroid()];
    let union = Csg::smooth_union(solids, BOUNDED, 0.0).unwrap();
    let difference = Csg::smooth_difference(union, vec![sphere(0.0, 1.0, 0.0, 0.8)], R_ROUND, 0.05).unwrap();
    let turn = DAffine3::from_mat3(DMat3::from_cols(
        dvec3(0.0, -1.3, 0.2),
        dvec3(0.8, 0.1, 0.3),
        dvec3(0.2, 0.0, 0.6),
    ));
    let tree = Csg::affine(difference, turn).unwrap();
    check("tree of blends", &tree, options(1e-2));
    let both = Csg::smooth_intersection(vec![torus(), sphere(1.2, 0.3, 0.0, 1.0)], R0, 0.0).unwrap();
    check("intersection", both.as_ref(), options(1e-2));
}

/// Parameters `t` in `[0, 1]` at which a function of the segment from `a` to `b` crosses 0, to the last bit.
fn crossings(a: DVec3, b: DVec3, f: impl Fn(DVec3) -> f64) -> Vec<[DVec3; 2]> {
    let at = |t: f64| a + (b - a) * t;
    let mut found = Vec::new();
    for n in 0..64 {
        let (mut lo, mut hi) = (n as f64 / 64.0, (n + 1) as f64 / 64.0);
        if f(at(lo)) * f(at(hi)) >= 0.0 {
            continue;
        }
        for _ in 0..60 {
            let middle = 0.5 * (lo + hi);
            if f(at(lo)) * f(at(middle)) < 0.0 {
                hi = middle
            } else {
                lo = middle
            }
        }
        found.push([at(lo), at(hi)]);
    }
    found
}

#[test]
fn bounded_blends_have_two_continuous_derivatives_across_their_seams_and_the_crease() {
    let (f, g) = (sphere(0.5, 0.1, 0.0, 1.3), gyroid());
    let mut random = Random(3);
    let mut seams = 0;
    for operation in BOTH {
        let field = blend(operation, BOUNDED, &f, &g, 0.0);
        for _ in 0..200 {
            let (a, b) = (random.point(&REGION), random.point(&REGION));
            for offset in [-0.6, 0.0, 0.6] {
                for [p, q] in crossings(a, b, |p| f.value(p) - g.value(p) - offset) {
                    let e = (b - a).normalize() * 1e-9;
                    let (before, after) = (field.jet(p - e), field.jet(q + e));
                    // The smooth parts change by their own derivatives over 2e-9: gradients below 2, curvatures below 20
                    // unless the point is next to the sphere's centre.
                    let bend = 1.0
                        + f.jet(p)
                            .hessian
                            .to_cols_array()
                            .iter()
                            .fold(0.0f64, |m, x| m.max(x.abs()));
                    assert!((before.value - after.value).abs() < 1e-8);
                    assert!((before.gradient - after.gradient).length() < 1e-7 * bend);
                    let jump = (before.hessian - after.hessian).to_cols_array();
                    assert!(
                        jump.iter().all(|x| x.abs() < 1e-6 * bend * bend),
                        "{jump:?} at {p}"
                    );
                    seams += 1;
                }
            }
        }
    }
    assert!(seams > 500, "{seams}");
}

#[test]
fn r_functions_are_smooth_but_for_the_crease_of_the_surfaces() {
    // Two planes at an angle: the crease is a line.
    let plane = |n: DVec3| -> Shared { Arc::new(HalfSpace::new(DVec3::ZERO, n).unwrap()) };
    let (f, g) = (plane(DVec3::X), plane(dvec3(0.3, 1.0, 0.0)));
    let around = |field: &Blend, crease: DVec3| {
        let e = 1e-6;
        let gradients =
            [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y].map(|d| field.value_gradient(crease + d * e).1);
        gradients
            .iter()
            .flat_map(|a| gradients.iter().map(move |b| (*a - *b).length()))
            .fold(0.0, f64::max)
    };
    for operation in BOTH {
        let sharp_at = |p| around(&blend(operation, R0, &f, &g, 0.0), p);
        assert!(sharp_at(DVec3::Z) > 0.5, "a crease has been smoothed away");
        // Equal values off the surfaces are no crease.
        let y = 1.09f64.sqrt() - 0.3;
        for p in [dvec3(1.0, y, 2.0), dvec3(-1.0, -y, 0.0)] {
            assert!((f.value(p) - g.value(p)).abs() < 1e-12 && sharp_at(p) < 1e-5);
        }
        assert!(around(&blend(operation, R_ROUND, &f, &g, 0.0), DVec3::Z) < 2e-5);
        // At another iso-value the crease is elsewhere.
        let other = blend(operation, R0, &f, &g, 0.5);
        let crease = dvec3(-0.5, -0.5 * (1.0 + 0.09f64).sqrt() + 0.15, 0.0);
        assert!((f.value(crease) - 0.5).abs() + (g.value(crease) - 0.5).abs() < 1e-12);
        assert!(around(&other, crease) > 0.5 && around(&other, DVec3::Z) < 1e-5);
    }
}

#[test]
fn blends_are_the_sharp_operations_away_from_the_crease() {
    let (f, g) = (sphere(0.5, 0.1, 0.0, 1.3), gyroid());
    let mut random = Random(5);
    for operation in BOTH {
        let sharp = match operation {
            Operation::Union => Csg::union(vec![f.clone(), g.clone()]).unwrap(),
            Operation::Intersection => Csg::intersection(vec![f.clone(), g.clone()]).unwrap(),
        };
        let (mut same, mut apart) = (0, 0);
        for _ in 0..5000 {
            let p = random.point(&REGION);
            let field = blend(operation, BOUNDED, &f, &g, 0.0);
            let (value, gradient) = field.value_gradient(p);
            if (f.value(p) - g.value(p)).abs() >= 0.6 {
                assert_eq!((value, gradient), sharp.value_gradient(p));
                assert_eq!(field.jet(p).hessian, sharp.jet(p).hessian);
                same += 1;
            } else {
                // Unions grow, intersections shrink, by a sixth of the range at most.
                let grown = match operation {
                    Operation::Union => value - sharp.value(p),
                    Operation::Intersection => sharp.value(p) - value,
                };
                assert!((0.0..=0.1 + 1e-15).contains(&grown), "{grown}");
                apart += 1;
            }
            // The R-function has the surface of the sharp operation: the same sign everywhere.
            let iso = 0.15;
            let r = blend(operation, R0, &f, &g, iso).value(p) - iso;
            assert!(r * (sharp.value(p) - iso) > 0.0 || r.abs() < 1e-12, "at {p}");
        }
        assert!(same > 1000 && apart > 500, "{same} {apart}");
    }
}

#[test]
fn a_fillet_begins_at_its_range_from_the_crease() {
    // A block and a plate that meet at a right angle, seen from outside of both: a concave corner.
    let wall = |n: DVec3| -> Shared { Arc::new(HalfSpace::new(DVec3::ZERO, n).unwrap()) };
    let (x, y) = (wall(DVec3::X), wall(DVec3::Y));
    let k = 0.5;
    let field = blend(Operation::Union, Rounding::Bounded { range: k }, &x, &y, 0.0);
    assert!((field.value(DVec3::ZERO) - k / 6.0).abs() < 1e-15);
    assert_eq!(field.value(dvec3(0.0, k, 0.0)), 0.0);
    assert!(field.value(dvec3(0.0, 0.99 * k, 0.0)) > 0.0);
    // With ε the surface is the hyperbola 2xy = ε².
    let e = 0.3f64;
    let field = blend(Operation::Union, Rounding::Rvachev { rounding: e }, &x, &y, 0.0);
    for t in [0.05, 0.2, 1.0, 30.0] {
        let p = dvec3(t, e * e / (2.0 * t), 1.0);
        let (value, gradient) = field.value_gradient(p);
        assert!(value.abs() < 1e-14 && gradient.length() > 0.05, "{value} at {p}");
    }
}

#[test]
fn operations_are_symmetric_and_follow_de_morgan() {
    let (f, g) = (sphere(0.5, 0.1, 0.0, 1.3), gyroid());
    let iso = 0.2;
    let complement = |f: &Shared| -> Shared { Arc::new(Csg::complement(f.clone(), iso).unwrap()) };
    let mut random = Random(7);
    for rounding in ALL {
        let union = blend(Operation::Union, rounding, &f, &g, iso);
        let swapped = blend(Operation::Union, rounding, &g, &f, iso);
        let other: Shared = Arc::new(blend(
            Operation::Intersection,
            rounding,
            &complement(&f),
            &complement(&g),
            iso,
        ));
        let other = complement(&other);
        let difference = Csg::smooth_difference(f.clone(), vec![g.clone()], rounding, iso).unwrap();
        let intersection = blend(Operation::Intersection, rounding, &f, &complement(&g), iso);
        for _ in 0..3000 {
            let p = random.point(&REGION);
            assert_eq!(union.value(p).to_bits(), swapped.value(p).to_bits());
            let ((v, a), (w, b)) = (union.value_gradient(p), swapped.value_gradient(p));
            assert!(v == w && (a - b).length() < 1e-14);
            let (w, b) = other.value_gradient(p);
            assert!(
                (v - w).abs() < 1e-13 && (a - b).length() < 1e-12,
                "{rounding:?}: {v} {w}"
            );
            assert_eq!(difference.value(p), intersection.value(p));
        }
    }
}

fn random_hierarchy() -> HierarchicalSpline<f64> {
    let mut random = Random(9);
    let cells = [6, 6, 9];
    let mut level = |number: u32, bricks: &[[u32; 3]], size: f64| {
        let mut made = BTreeMap::new();
        for &key in bricks {
            let mut corrections = Corrections::empty();
            for slot in 0..BRICK_LEN {
                let at = [slot / 64, slot / 8 % 8, slot % 8];
                let c = size * (2.0 * random.unit() - 1.0);
                if (0..3).all(|a| 8 * key[a] + (at[a] as u32) < (cells[a] << number) + 3) {
                    corrections.set(at, c);
                }
            }
            made.insert(BrickKey(key), Arc::new(corrections));
        }
        made
    };
    let levels = vec![
        level(0, &[[0; 3], [0, 0, 1]], 1.0),
        level(1, &[[0; 3], [1, 0, 0]], 0.3),
    ];
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_scale_rotation_translation(
            DVec3::new(0.9, 0.8, 0.7),
            glam::DQuat::from_rotation_z(0.4),
            dvec3(-1.0, -3.5, -2.7),
        ),
        cells,
    };
    HierarchicalSpline::from_corrections(lattice, 1.0, levels)
}

#[test]
fn grown_fields_conform() {
    let smooth = Options {
        // The third derivative of the spline jumps at its knots.
        difference_tolerance: 1e-4,
        step: 1e-5,
        // A box is bounded by the field's range and the slope's, each taken alone.
        width_limits: [4.0, 20.0],
        ..options(2e-2)
    };
    for by in [0.2, -0.15] {
        check("grown gyroid", &Csg::grown(gyroid(), by).unwrap(), smooth.clone());
        check("grown torus", &Csg::grown(torus(), by).unwrap(), smooth.clone());
        let spline = Csg::grown(Arc::new(random_hierarchy()), by).unwrap();
        let inner = Aabb::new(DVec3::splat(-0.9), DVec3::splat(0.9));
        let widths = field_conformance("grown hierarchy", &spline, &inner, &smooth);
        println!("grown hierarchy: {widths:?}");
    }
    let knots = [4, 5, 6].map(|n| KnotVector::clamped_uniform(3, n, 0.0, 1.0).unwrap());
    let mut random = Random(13);
    let count = knots.iter().map(KnotVector::coefficient_count).product();
    let coefficients = (0..count).map(|_| random.unit() - 0.5).collect();
    let map = DAffine3::from_scale_rotation_translation(
        DVec3::splat(2.0),
        glam::DQuat::from_rotation_x(0.3),
        DVec3::splat(-1.0),
    );
    let tensor: Shared = Arc::new(TensorSpline::<f64>::new(knots, coefficients, map, 1.0).unwrap());
    let grown = Csg::grown(tensor, 0.05).unwrap();
    let inner = Aabb::new(DVec3::splat(-0.6), DVec3::splat(0.6));
    field_conformance("grown tensor", &grown, &inner, &smooth);
}

#[test]
fn solids_grow_by_a_length_whatever_the_unit_of_their_field() {
    let mut random = Random(15);
    for scale in [1.0, 300.0, 1e-3] {
        let scaled: Shared = Arc::new(Csg::sum(vec![(scale, sphere(0.0, 0.0, 0.0, 1.0))], 0.0).unwrap());
        for by in [0.25, -0.25] {
            let grown = Csg::grown(scaled.clone(), by).unwrap();
            for _ in 0..200 {
                let n = (random.vector() - 0.5).normalize();
                assert!(grown.value(n * (1.0 + by)).abs() < 1e-14 * scale);
            }
        }
    }
    // f = 1 - |x/a|² is no distance: first order, with the error the curvature says.
    let squares = |p: DVec3| 1.0 - (p.x * p.x / 4.0 + p.y * p.y + p.z * p.z);
    let knots = [0; 3].map(|_| KnotVector::clamped_uniform(2, 1, -4.0, 4.0).unwrap());
    // The blossom of t² at the clamped ends of one span: 16, -16, 16.
    let square = [16.0, -16.0, 16.0];
    let coefficients = TensorSpline::<f64>::indices(&knots)
        .map(|[i, j, k]| 1.0 - (square[i] / 4.0 + square[j] + square[k]))
        .collect();
    let quadric = TensorSpline::new(knots, coefficients, DAffine3::IDENTITY, 1.0).unwrap();
    assert!((quadric.value(dvec3(0.3, 0.4, -0.2)) - squares(dvec3(0.3, 0.4, -0.2))).abs() < 1e-14);
    let quadric: Shared = Arc::new(quadric);
    for by in [0.1, 0.05, 0.025] {
        let grown = Csg::grown(quadric.clone(), by).unwrap();
        // At the tip of the short axis: |∇f| = 2, bending 2, so h²·2/(2·2) off; the slope grows on the way out, and with
        // it the step: together below 2 h².
        let off = (grown.value(DVec3::Y * (1.0 + by))
            / grown.value_gradient(DVec3::Y * (1.0 + by)).1.length())
        .abs();
        assert!(off < 2.0 * by * by && off > 0.1 * by * by, "{off} for {by}");
    }
}

#[test]
fn bounds_of_sums_know_how_their_terms_vary_together() {
    let (f, g) = (gyroid(), torus());
    let shifted: Shared =
        Arc::new(Csg::affine(f.clone(), DAffine3::from_translation(DVec3::splat(1e-3))).unwrap());
    let difference = Csg::sum(vec![(1.0, f.clone()), (-1.0, shifted)], 0.0).unwrap();
    let sum = Csg::sum(vec![(1.0, f), (0.5, g), (-0.4, sphere(0.3, 0.1, 0.0, 1.5))], 0.25).unwrap();
    let mut random = Random(17);
    for _ in 0..1000 {
        let b = random.small_box(&REGION);
        let reach = b.size().length();
        // Each term alone varies by about the box's size; together by a thousandth, and the square of the size.
        let width = difference.bounds(&b).width();
        assert!(
            width < 0.02 * reach + 30.0 * reach * reach,
            "{width} over {reach}"
        );
    }
    check("sum", &sum, options(5e-3));
}

#[test]
fn bad_blends_are_refused() {
    let new = |rounding, iso| Blend::new(Operation::Union, rounding, [gyroid(), gyroid()], iso).err();
    let bounded = |range| Rounding::Bounded { range };
    let rvachev = |rounding| Rounding::Rvachev { rounding };
    assert_eq!(new(bounded(1.0), 0.0), None);
    assert_eq!(new(rvachev(0.0), 0.0), None);
    for rounding in [bounded(0.0), bounded(-1.0), rvachev(-1e-9)] {
        assert!(matches!(new(rounding, 0.0), Some(CsgError::OutOfRange { .. })));
    }
    for rounding in [bounded(f64::NAN), bounded(f64::INFINITY), rvachev(f64::NAN)] {
        assert!(matches!(new(rounding, 0.0), Some(CsgError::NotFinite { .. })));
    }
    assert!(matches!(
        new(bounded(1.0), f64::NAN),
        Some(CsgError::NotFinite { .. })
    ));
    assert_eq!(
        Csg::smooth_union(vec![], BOUNDED, 0.0).err(),
        Some(CsgError::NoBranches)
    );
    assert!(matches!(
        Csg::grown(gyroid(), f64::NAN).err(),
        Some(CsgError::NotFinite { .. })
    ));
    // One solid is itself.
    let one = Csg::smooth_union(vec![gyroid()], BOUNDED, 0.0).unwrap();
    assert_eq!(one.value(DVec3::ONE), gyroid().value(DVec3::ONE));
    // Far from the crease a cuboid without gradient bounds of its own blends all the same.
    let cuboid: Shared = Arc::new(Cuboid::new(DVec3::ZERO, DVec3::ONE).unwrap());
    let f = blend(Operation::Union, R_ROUND, &cuboid, &gyroid(), 0.0);
    assert!(f.gradient_bounds(&REGION).iter().all(|g| g.width().is_finite()));
}
