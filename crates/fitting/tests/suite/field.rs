//! Fields written back into a box of another.

use std::path::Path;
use std::sync::Arc;

use bspline::hierarchical::{BRICK, Lattice, LevelEdit};
use bspline::primitives::{Gyroid, Sphere, Torus};
use bspline::{Aabb, Csg, Field, HierarchicalSpline, Interval, Jet};
use fitting::field::{Aim, FieldFitOptions, FieldFitReport, fit_field};
use fitting::phantoms::{SplitMix64, head};
use fitting::points::{OrientedPoints, PointOptions, fit_points};
use fitting::volume::{VolumeOptions, VolumeView, fit_volume};
use fitting::{Cancel, Control, FitError};
use formats::{ReadLimits, points};
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

/// The scan in the repository, fitted; and the diagonal of its points.
fn bunny() -> (HierarchicalSpline<f32>, f64) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/bunny.obj.gz");
    let cloud = points::read(&path, &ReadLimits::default()).unwrap();
    let oriented = OrientedPoints {
        positions: &cloud.positions,
        normals: cloud.normals.as_deref().unwrap(),
        certainty: None,
    };
    let (field, _) = fit_points(&oriented, &PointOptions::default(), &mut Control::default()).unwrap();
    let (min, max) = cloud
        .positions
        .iter()
        .fold((cloud.positions[0], cloud.positions[0]), |(lo, hi), p| {
            (lo.min(*p), hi.max(*p))
        });
    (field, (max - min).length())
}

/// `p` moved onto the surface of `field`, if Newton steps get there.
fn on_surface(field: &dyn Field, mut p: DVec3) -> Option<DVec3> {
    for _ in 0..12 {
        let (value, gradient) = field.value_gradient(p);
        let step = gradient * (value / gradient.length_squared().max(1e-12));
        p -= step;
        if step.length() < 1e-9 {
            return Some(p);
        }
    }
    None
}

fn random_in(random: &mut SplitMix64, b: &Aabb) -> DVec3 {
    b.min + b.size() * random.uniform3()
}

fn is_inside(b: &Aabb, p: DVec3) -> bool {
    p.cmpge(b.min).all() && p.cmple(b.max).all()
}

/// Asserts what a fit owes a target within `b`: the tolerance within three finest `interval`s of the surface but near
/// its crease, whose distance `crease` gives; there the surface rounded by one interval at most; the right sign elsewhere.
fn assert_follows(
    field: &dyn Field,
    target: &dyn Field,
    b: &Aabb,
    (tolerance, interval): (f64, f64),
    crease: impl Fn(DVec3) -> f64,
) {
    let mut random = SplitMix64::new(7);
    let mut counted = 0;
    for _ in 0..20_000 {
        let p = random_in(&mut random, b);
        let (t, gradient) = target.value_gradient(p);
        let (f, height) = (field.value(p), t.abs() / gradient.length());
        if height > tolerance + interval {
            assert_eq!(f > 0.0, t > 0.0, "the sign at {p}, {height} from the surface");
        }
        if height < 3.0 * interval && crease(p) > 3.0 * interval {
            let off = (f - t).abs() / gradient.length();
            assert!(
                off < tolerance,
                "{off} for {tolerance} at {p}, {height} from the surface"
            );
            counted += 1;
        }
        let there = on_surface(field, p).filter(|q| is_inside(b, *q));
        if let Some((t, gradient)) = there.map(|q| target.value_gradient(q)) {
            let rounded = t.abs() / gradient.length();
            assert!(
                rounded < interval,
                "rounded by {rounded}, the interval is {interval}"
            );
        }
    }
    assert!(counted > 1000, "{counted} points");
}

/// Asserts that outside of `b` and one support, rounded out to whole bricks, all bits are equal, and elsewhere outside
/// nearly so.
fn assert_same_beside(
    field: &HierarchicalSpline<f32>,
    before: &HierarchicalSpline<f32>,
    b: &Aabb,
    finest: usize,
) {
    let largest = before.bounds(&before.lattice().world_box());
    let allowed = 8.0 * f64::from(f32::EPSILON) * largest.hi.abs().max(largest.lo.abs());
    let interval = before.lattice().spacing(finest);
    let reach = 2.0 * interval;
    let support = Aabb::new(b.min - reach, b.max + reach);
    // Where a new brick moves evaluation to a finer level: of the first level that may have changed.
    let bricks = Aabb::new(
        support.min - BRICK as f64 * 8.0 * interval,
        support.max + BRICK as f64 * 8.0 * interval,
    );
    let mut random = SplitMix64::new(3);
    for _ in 0..20_000 {
        let p = random_in(&mut random, &before.lattice().world_box());
        if is_inside(&support, p) {
            continue;
        }
        let (old, new) = (before.value(p), field.value(p));
        assert!((old - new).abs() <= allowed, "{old} became {new} at {p}");
        if !is_inside(&bricks, p) {
            assert_eq!(old.to_bits(), new.to_bits(), "at {p}");
        }
    }
}

#[test]
fn a_ball_is_carved_from_a_scan() {
    let (bunny, diagonal) = bunny();
    let shared = Arc::new(bunny.clone());
    let finest = bunny.level_count() + 1;
    let interval = bunny.lattice().spacing(finest).max_element();
    let (radius, tolerance) = (0.05 * diagonal, 1e-4 * diagonal);
    let mut random = SplitMix64::new(5);
    let mut places = 0;
    while places < 3 {
        let start = random_in(&mut random, &bunny.lattice().world_box());
        let Some(middle) = on_surface(&bunny, start).filter(|p| is_inside(&bunny.lattice().world_box(), *p))
        else {
            continue;
        };
        places += 1;
        let tool = sphere(middle, radius);
        let target = Csg::difference(shared.clone(), vec![tool.clone()], 0.0).unwrap();
        // Off the tool, what is deep inside the scan goes on changing: three intervals count, and the functions of the
        // finest levels have to fit between them and the faces.
        let reach = radius + 10.0 * interval;
        let within = Aabb::new(middle - reach, middle + reach);
        let (field, report) = fitted(&target, &bunny, &within, &surface(tolerance, finest));
        let sheet = |p: DVec3| {
            let ((f, of_f), (g, of_g)) = (bunny.value_gradient(p), tool.value_gradient(p));
            (f + g).abs() / (of_f + of_g).length().max(1e-9)
        };
        assert_follows(&field, &target, &within, (tolerance, interval), sheet);
        assert_same_beside(&field, &bunny, &within, finest);
        assert!(report.functions > 5000, "{report:?}");
    }
}

#[test]
fn a_surface_that_is_gone_takes_its_functions_along() {
    // Waves that only fine functions can follow.
    let waves = Arc::new(Gyroid::new(DVec3::ZERO, 0.53, 0.0).unwrap());
    let ball = Csg::sum(vec![(1.0, sphere(DVec3::ZERO, 7.0)), (0.3, waves)], 0.0).unwrap();
    let (plain, _) = fitted(&ball, &empty(), &whole(), &surface(0.05, 2));
    let here = Aabb::new(DVec3::new(4.0, -2.0, -2.0), DVec3::new(9.0, 4.0, 4.0));
    let (onto, _) = fitted(&ball, &plain, &here, &surface(0.005, 5));
    let onto = Arc::new(onto);
    let tool = sphere(DVec3::new(6.5, 1.0, 1.0), 3.0);
    let reach = DVec3::splat(4.0);
    let within = Aabb::new(
        DVec3::new(6.5, 1.0, 1.0) - reach,
        DVec3::new(6.5, 1.0, 1.0) + reach,
    );
    for target in [
        Csg::difference(onto.clone(), vec![tool.clone()], 0.0).unwrap(),
        Csg::union(vec![onto.clone(), tool.clone()]).unwrap(),
    ] {
        let (field, report) = fitted(&target, &onto, &within, &surface(0.01, 4));
        assert!(report.taken_out > 500, "{report:?}");
        let sheet = |p: DVec3| {
            let ((f, of_f), (g, of_g)) = (onto.value_gradient(p), tool.value_gradient(p));
            let g = if target.value(p) == g { -1.0 } else { 1.0 } * g;
            ((f - g).abs().min((f + g).abs())) / (of_f.length() + of_g.length())
        };
        let interval = lattice().spacing(4).max_element();
        assert_follows(&field, &target, &within, (0.01, interval), sheet);
    }
}

/// A field pushed along `by` about a place, as a hand that moves clay does.
struct Pushed {
    field: Arc<dyn Field>,
    at: DVec3,
    by: DVec3,
    width: f64,
}

impl Field for Pushed {
    fn value(&self, p: DVec3) -> f64 {
        let share = libm::exp(-(p - self.at).length_squared() / (self.width * self.width));
        self.field.value(p - self.by * share)
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let step = 1e-5;
        let slope = |axis: DVec3| (self.value(p + axis * step) - self.value(p - axis * step)) / (2.0 * step);
        (
            self.value(p),
            DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z)),
        )
    }

    fn jet(&self, _: DVec3) -> Jet {
        unreachable!("a fit asks for values")
    }

    fn bounds(&self, _: &Aabb) -> Interval {
        Interval::EVERYTHING
    }
}

#[test]
fn a_push_is_written_into_a_scan() {
    let (bunny, diagonal) = bunny();
    let middle = on_surface(&bunny, bunny.lattice().world_box().center() + DVec3::X).unwrap();
    let width = 0.05 * diagonal;
    let target = Pushed {
        field: Arc::new(bunny.clone()),
        at: middle,
        by: DVec3::new(0.3, 0.2, -0.1) * width,
        width,
    };
    let finest = bunny.level_count();
    let interval = bunny.lattice().spacing(finest).max_element();
    let reach = 4.0 * width;
    let within = Aabb::new(middle - reach, middle + reach);
    let tolerance = 2e-4 * diagonal;
    let (field, report) = fitted(&target, &bunny, &within, &surface(tolerance, finest));
    assert_eq!(report.left.unwrap().wrong_signs, 0);
    assert_follows(&field, &target, &within, (tolerance, interval), |_| f64::INFINITY);
    assert_same_beside(&field, &bunny, &within, finest);
}

#[test]
fn densities_are_met_at_every_voxel_off_the_crease() {
    let dims = [40, 44, 36];
    let voxels = head(dims, 0.0, 1);
    let view = VolumeView {
        dims,
        values: (&voxels).into(),
        world_from_voxel: DAffine3::from_scale(DVec3::new(4.0, 4.0, 5.0)),
    };
    let (onto, _): (HierarchicalSpline<f32>, _) =
        fit_volume(&view, &VolumeOptions::default(), &mut Control::default()).unwrap();
    // A ball of metal, 40 mm wide, and what is about it: densities fall by 100 a millimetre.
    let middle = DVec3::new(78.0, 90.0, 92.0);
    let metal = Csg::sum(vec![(100.0, sphere(middle, 20.0))], 1000.0).unwrap();
    let (onto, metal) = (Arc::new(onto), Arc::new(metal));
    let target = Csg::union(vec![onto.clone(), metal.clone()]).unwrap();
    let within = Aabb::new(middle - 50.0, middle + 50.0);
    let finest = onto.level_count();
    let options = FieldFitOptions {
        aim: Aim::Density { tolerance: 20.0 },
        finest,
        look: true,
    };
    let (field, report) = fitted(&target, &onto, &within, &options);
    let interval = onto.lattice().spacing(finest).max_element();
    let mut counted = 0;
    for i in 0..dims.iter().product() {
        let voxel = [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]].map(|k: usize| k as f64);
        let p = view.world_from_voxel.transform_point3(DVec3::from_array(voxel));
        let ((f, of_f), (g, of_g)) = (onto.value_gradient(p), metal.value_gradient(p));
        let is_off_crease = (f - g).abs() > 3.0 * interval * (of_f - of_g).length();
        // The metal has a crease of its own in the middle.
        if is_inside(&within, p) && is_off_crease && p.distance(middle) > 3.0 * interval {
            let off = (field.value(p) - target.value(p)).abs();
            assert!(off < 20.0, "{off} at {p}, {report:?}");
            counted += usize::from(g > f);
        }
    }
    assert!(counted > 200, "{counted} voxels of metal");
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
