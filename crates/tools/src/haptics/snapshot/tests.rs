//! Bricks against formulas.

use bspline::Field;
use bspline::primitives::{Sphere, Torus};
use glam::DVec3;

use super::*;
use crate::haptics::Obstacle;

/// What a brick is off by, at places in a box whose true distance is known.
#[derive(Debug, Default)]
struct Off {
    /// Largest error of the distance where it is at most `band`, mm.
    value: f64,
    /// Largest error of the gradient's length there.
    slope: f64,
    /// Largest angle between the gradients there.
    turn: f64,
    /// Largest distance where the surface is told to be.
    zero: f64,
    /// Largest error beyond the band.
    far: f64,
}

/// Places that fill a box evenly.
fn places(b: &bspline::Aabb, count: usize) -> impl Iterator<Item = DVec3> {
    let part = |n: usize, root: f64| (n as f64 / root) % 1.0;
    let (min, size) = (b.min, b.size());
    // The irrational numbers of [Roberts18].
    let g = 1.220_744_084_605_759_5;
    (1..=count).map(move |n| min + size * DVec3::new(part(n, g), part(n, g * g), part(n, g * g * g)))
}

fn off(brick: &DistanceBrick, truth: &dyn Fn(DVec3) -> (f64, DVec3), skip: &dyn Fn(DVec3) -> bool) -> Off {
    let mut off = Off::default();
    for p in places(&brick.world_box().widened(-brick.band()), 20_000) {
        let ((value, gradient), (true_value, true_gradient)) = (brick.distance(p), truth(p));
        assert!(
            value.signum() == true_value.signum() || true_value.abs() < 1e-2,
            "{p}: {value} for {true_value}"
        );
        if skip(p) {
            continue;
        }
        let wrong = (value - true_value).abs();
        if true_value.abs() > brick.band() {
            off.far = off.far.max(wrong);
            continue;
        }
        off.value = off.value.max(wrong);
        off.slope = off.slope.max((gradient.length() - 1.0).abs());
        off.turn = off.turn.max(gradient.angle_between(true_gradient));
        // Down to where the brick says that the surface is.
        let mut x = p;
        for _ in 0..20 {
            let (value, gradient) = brick.distance(x);
            x -= value * gradient / gradient.length_squared();
        }
        if brick.distance(x).0.abs() < 1e-6 && brick.covers(x, brick.band()) {
            off.zero = off.zero.max(truth(x).0.abs());
        }
    }
    off
}

/// A field that is no distance: its cube, and as steep as a scan in Hounsfield units.
struct Steep<F>(F);

impl<F: Field> Field for Steep<F> {
    fn value(&self, p: DVec3) -> f64 {
        self.value_gradient(p).0
    }
    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let jet = self.jet(p);
        (jet.value, jet.gradient)
    }
    fn jet(&self, p: DVec3) -> bspline::Jet {
        let f = self.0.jet(p);
        let g = f.gradient;
        let outer = glam::DMat3::from_cols(g * g.x, g * g.y, g * g.z);
        let (first, second) = (200.0 + 3.0 * f.value * f.value, 6.0 * f.value);
        bspline::Jet {
            value: 300.0 + 200.0 * f.value + f.value.powi(3),
            gradient: g * first,
            hessian: f.hessian * first + outer * second,
        }
    }
    fn bounds(&self, b: &bspline::Aabb) -> bspline::Interval {
        let i = self.0.bounds(b);
        let map = |v: f64| 300.0 + 200.0 * v + v.powi(3);
        bspline::Interval::new(map(i.lo), map(i.hi)).widened(1e-6)
    }
}

fn sphere() -> Sphere {
    Sphere::new(DVec3::new(1.3, -0.4, 0.7), 10.0).unwrap()
}

fn of_sphere(p: DVec3) -> (f64, DVec3) {
    let d = p - DVec3::new(1.3, -0.4, 0.7);
    (d.length() - 10.0, d.normalize())
}

fn torus() -> Torus {
    Torus::new(DVec3::new(0.2, 0.1, -0.3), DVec3::Z, 12.0, 4.0).unwrap()
}

fn of_torus(p: DVec3) -> (f64, DVec3) {
    let d = p - DVec3::new(0.2, 0.1, -0.3);
    let out = DVec3::new(d.x, d.y, 0.0).normalize();
    let v = d - 12.0 * out;
    (v.length() - 4.0, v.normalize())
}

#[test]
fn a_ball_has_its_distance() {
    for (radius, h) in [(2.0, 1.0), (1.0, 0.5)] {
        let options = BrickOptions {
            spacing: h,
            band: radius + 2.0 * h,
            ..BrickOptions::default()
        };
        let at = DVec3::new(11.0, 0.0, 0.0);
        let (plain, steep) = (sphere(), Steep(sphere()));
        let fields: [(&dyn Field, f64); 2] = [(&plain, 0.0), (&steep, 300.0)];
        for (field, iso) in fields {
            let brick = DistanceBrick::new(&Surface::new(field, iso), at, &options);
            let off = off(&brick, &of_sphere, &|p| of_sphere(p).0 < -6.0);
            println!("h {h}: {off:?}");
            assert!(off.zero < 1e-3 && off.slope < 2e-3, "{off:?}");
        }
    }
}

#[test]
fn a_torus_has_its_distance() {
    let at = DVec3::new(14.0, 3.0, 2.0);
    for h in [1.0, 0.5] {
        let options = BrickOptions {
            spacing: h,
            band: 2.0 + 2.0 * h,
            ..BrickOptions::default()
        };
        let (plain, steep) = (torus(), Steep(torus()));
        let fields: [(&dyn Field, f64); 2] = [(&plain, 0.0), (&steep, 300.0)];
        for (field, iso) in fields {
            let brick = DistanceBrick::new(&Surface::new(field, iso), at, &options);
            // Three nodes from where the distance itself has no gradient.
            let skip =
                |p: DVec3| of_torus(p).0 < -4.0 + 3.0 * h || DVec3::new(p.x, p.y, 0.0).length() < 3.0 * h;
            let off = off(&brick, &of_torus, &skip);
            println!("h {h}: {off:?}");
            assert!(off.zero < 1e-2 && off.slope < 1e-2, "{off:?}");
        }
    }
}

/// Moved, turned and enlarged, distances are those of the place where the object stands.
#[test]
fn distances_are_those_of_the_shared_world() {
    let map = glam::DAffine3::from_scale_rotation_translation(
        DVec3::splat(1.5),
        glam::DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 0.7),
        DVec3::new(3.0, -2.0, 5.0),
    );
    let ball = sphere();
    let center = map.transform_point3(DVec3::new(1.3, -0.4, 0.7));
    let truth = |p: DVec3| ((p - center).length() - 15.0, (p - center).normalize());
    let surface = Surface::new(&ball, 0.0).placed(map);
    let brick = DistanceBrick::new(
        &surface,
        center + DVec3::X * 15.0,
        &BrickOptions {
            spacing: 1.0,
            ..BrickOptions::default()
        },
    );
    let off = off(&brick, &truth, &|_| false);
    println!("{off:?}");
    assert!(off.zero < 1e-3 && off.slope < 2e-3, "{off:?}");
}
