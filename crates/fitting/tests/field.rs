//! Fields written back into a box of another.

use std::sync::Arc;

use bspline::hierarchical::{Lattice, LevelEdit};
use bspline::primitives::{Gyroid, Sphere, Torus};
use bspline::{Aabb, Csg, Field, HierarchicalSpline};
use fitting::field::{Aim, FieldFitOptions, FieldFitReport, fit_field};
use fitting::{Cancel, Control, FitError};
use glam::{DAffine3, DMat3, DVec3};

/// A box of 20 by 20 by 20 world units, its lattice turned by a right angle and of other spacings on each axis.
fn lattice() -> Lattice {
    Lattice {
        world_from_lattice: DAffine3 {
            matrix3: DMat3::from_cols(
                DVec3::new(0.0, 1.25, 0.0),
                DVec3::new(-1.0, 0.0, 0.0),
                DVec3::new(0.0, 0.0, 1.0),
            ),
            translation: DVec3::new(10.0, -10.0, -10.0),
        },
        cells: [16, 20, 20],
    }
}

fn empty() -> HierarchicalSpline<f32> {
    HierarchicalSpline::from_corrections(lattice(), 1.0, vec![Default::default()])
}

fn whole() -> Aabb {
    lattice().world_box()
}

fn surface(tolerance: f64, finest: usize) -> FieldFitOptions {
    FieldFitOptions {
        aim: Aim::Surface { iso: 0.0, tolerance },
        finest,
        look: true,
    }
}

fn fitted(
    target: &dyn Field,
    onto: &HierarchicalSpline<f32>,
    within: &Aabb,
    options: &FieldFitOptions,
) -> (HierarchicalSpline<f32>, FieldFitReport) {
    let (field, diff, report) = fit_field(target, onto, within, options, &mut Control::default()).unwrap();
    assert_eq!(onto.applied(&diff).unwrap().sha256(), field.sha256());
    assert_eq!(field.applied(&diff.reversed()).unwrap().sha256(), onto.sha256());
    (field, report)
}

fn sphere(at: DVec3, r: f64) -> Arc<dyn Field> {
    Arc::new(Sphere::new(at, r).unwrap())
}

/// Points of the surface of `field` in a box, and their distance in a field of the same surface: `|f|/|∇f|`.
fn surface_errors(
    field: &dyn Field,
    other: &dyn Field,
    within: &Aabb,
    keep: impl Fn(DVec3) -> bool,
) -> Vec<f64> {
    let mut errors = Vec::new();
    let n = 40;
    for i in 0..n * n * n {
        let share = DVec3::new((i / n / n) as f64, (i / n % n) as f64, (i % n) as f64) / f64::from(n - 1);
        let mut p = within.min + within.size() * share;
        for _ in 0..4 {
            let (value, gradient) = field.value_gradient(p);
            p -= gradient * (value / gradient.length_squared().max(1e-9));
        }
        let inside = p.cmpge(within.min).all() && p.cmple(within.max).all();
        if inside && field.value(p).abs() < 1e-9 && keep(p) {
            let (value, gradient) = other.value_gradient(p);
            errors.push(value.abs() / gradient.length());
        }
    }
    errors
}

#[test]
fn a_target_is_fitted_into_an_empty_field() {
    let torus = Torus::new(DVec3::new(0.3, -0.2, 0.1), DVec3::Z, 6.0, 2.0).unwrap();
    for tolerance in [0.1, 0.01, 0.001] {
        let (field, report) = fitted(&torus, &empty(), &whole(), &surface(tolerance, 4));
        let left = report.left.unwrap();
        assert_eq!((left.wrong_signs, left.over_tolerance), (0, 0), "{report:?}");
        assert!(left.worst < tolerance);
        let errors = surface_errors(&torus, &field, &whole(), |_| true);
        let worst = errors.iter().copied().fold(0.0, f64::max);
        assert!(
            errors.len() > 1000 && worst < 1.5 * tolerance,
            "{worst} for {tolerance}"
        );
        // Nothing is left to do.
        let (again, second) = fitted(&torus, &field, &whole(), &surface(2.0 * tolerance, 4));
        let added = again.coefficient_count() - field.coefficient_count();
        assert!(
            added * 20 < field.coefficient_count(),
            "{added} more functions, {second:?}"
        );
    }
}

#[test]
fn a_tool_changes_its_box_and_no_bit_beside_it() {
    let (ball, tool) = (sphere(DVec3::ZERO, 7.0), sphere(DVec3::new(6.0, 2.0, 1.0), 2.5));
    let (onto, _) = fitted(ball.as_ref(), &empty(), &whole(), &surface(0.002, 3));
    let onto = Arc::new(onto);
    let target = Csg::difference(onto.clone(), vec![tool.clone()], 0.0).unwrap();
    let reach = DVec3::splat(3.2);
    let within = Aabb::new(
        DVec3::new(6.0, 2.0, 1.0) - reach,
        DVec3::new(6.0, 2.0, 1.0) + reach,
    );
    let (finest, tolerance) = (4, 0.01);
    let (field, report) = fitted(&target, &onto, &within, &surface(tolerance, finest));
    assert_eq!(report.left.unwrap().wrong_signs, 0, "{report:?}");
    // One finest interval is 1/16 to 1/12.8; off the crease the tolerance holds, on it the surface is rounded.
    let interval = 1.25 / 16.0;
    let off_crease = |p: DVec3| onto.value(p).abs().max(tool.value(p).abs()) > 3.0 * interval;
    let errors = surface_errors(&target, &field, &within, off_crease);
    let worst = errors.iter().copied().fold(0.0, f64::max);
    assert!(
        errors.len() > 1000 && worst < 1.5 * tolerance,
        "{worst} off the crease"
    );
    let all = surface_errors(&target, &field, &within, |_| true);
    let rounded = all.iter().copied().fold(0.0, f64::max);
    assert!(rounded < interval, "{rounded} on the crease");
    // Outside the box and one support of the finest functions: the same bits.
    let support = 2.0 * interval;
    let mut seen = 0;
    for i in 0..8000 {
        let share = DVec3::new((i / 400) as f64, (i / 20 % 20) as f64, (i % 20) as f64) / 19.0;
        let p = whole().min + whole().size() * share;
        if (p - within.center()).abs().cmple(reach + support).all() {
            continue;
        }
        let (old, new) = (onto.value(p), field.value(p));
        assert!(
            (old - new).abs() <= 8.0 * f64::from(f32::EPSILON) * 20.0,
            "at {p}"
        );
        seen += usize::from(old.to_bits() == new.to_bits());
    }
    assert!(seen > 7000, "{seen} points with the same bits");
}

#[test]
fn the_cost_is_that_of_the_box() {
    let ball = sphere(DVec3::ZERO, 7.0);
    let (plain, _) = fitted(ball.as_ref(), &empty(), &whole(), &surface(0.002, 3));
    // The same field with four times the functions, far from the tool.
    let edits: Vec<_> = (0..30_000)
        .map(|i| LevelEdit {
            level: 4,
            function: [200 + i % 40, 40 + i / 40 % 30, 40 + i / 1200],
            delta: 1e-4,
        })
        .collect();
    let rich = plain.edited(&edits).unwrap();
    let tool = sphere(DVec3::new(-6.0, 2.0, 1.0), 1.5);
    let within = Aabb::new(DVec3::new(-8.0, 0.0, -1.0), DVec3::new(-4.0, 4.0, 3.0));
    let cost = |onto: HierarchicalSpline<f32>| {
        let onto = Arc::new(onto);
        let target = Csg::union(vec![onto.clone(), tool.clone()]).unwrap();
        let (field, report) = fitted(&target, &onto, &within, &surface(0.005, 4));
        (
            report.samples,
            report.functions,
            field.changed_bricks(&onto).len(),
        )
    };
    let (of_plain, of_rich) = (cost(plain), cost(rich));
    assert_eq!((of_plain.0, of_plain.1), (of_rich.0, of_rich.1));
    assert!(of_plain.0 > 1000);
}

#[test]
fn densities_are_met_at_every_point() {
    let gyroid = Arc::new(Gyroid::new(DVec3::ZERO, 8.0, 0.0).unwrap());
    let target = Csg::sum(vec![(300.0, gyroid)], 100.0).unwrap();
    for tolerance in [10.0, 1.0] {
        let options = FieldFitOptions {
            aim: Aim::Density { tolerance },
            finest: 3,
            look: true,
        };
        let (field, report) = fitted(&target, &empty(), &whole(), &options);
        let mut worst = 0.0f64;
        for i in 0..27_000 {
            let share = DVec3::new((i / 900) as f64, (i / 30 % 30) as f64, (i % 30) as f64) / 29.0;
            let p = whole().min + whole().size() * share;
            worst = worst.max((field.value(p) - target.value(p)).abs());
        }
        assert!(worst < 1.5 * tolerance, "{worst} of {tolerance}, {report:?}");
    }
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let onto = empty();
    let ball = sphere(DVec3::ZERO, 3.0);
    let refused = |target: &dyn Field, within: &Aabb, options: &FieldFitOptions| {
        fit_field(target, &onto, within, options, &mut Control::default()).unwrap_err()
    };
    let point = Aabb::new(DVec3::ZERO, DVec3::ZERO);
    for (within, options) in [
        (whole(), surface(0.0, 2)),
        (whole(), surface(f64::NAN, 2)),
        (point, surface(0.1, 2)),
        (whole(), surface(0.1, 99)),
    ] {
        let e = refused(ball.as_ref(), &within, &options);
        assert!(matches!(e, FitError::Option { .. }), "{e}");
    }
    let bottomless = Csg::sum(vec![(1e308, ball.clone()), (1e308, ball.clone())], 0.0).unwrap();
    let e = refused(&bottomless, &whole(), &surface(0.1, 2));
    assert!(matches!(e, FitError::Degenerate(_)), "{e}");
    let mut control = Control {
        cancel: Cancel::new(),
        ..Control::default()
    };
    control.cancel.cancel();
    let e = fit_field(ball.as_ref(), &onto, &whole(), &surface(0.1, 2), &mut control).unwrap_err();
    assert_eq!(e, FitError::Cancelled);
}
