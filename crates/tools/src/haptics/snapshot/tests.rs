//! Bricks against formulas.

use bspline::hierarchical::{BlockEdit, Change, Lattice};
use bspline::primitives::{Sphere, Torus};
use bspline::{Aabb, Field, HierarchicalSpline};
use glam::DVec3;

use super::distances::Distances;
use super::grid::Grid;
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
                |p: DVec3| of_torus(p).0 < -4.0 + 3.5 * h || DVec3::new(p.x, p.y, 0.0).length() < 3.5 * h;
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

/// A spline of a solid, on cells of `h`.
fn spline(h: f64, half: f64, f: impl Fn(DVec3) -> f64) -> HierarchicalSpline<f32> {
    let cells = (2.0 * half / h).round() as u32;
    let lattice = Lattice {
        world_from_lattice: glam::DAffine3::from_scale_rotation_translation(
            DVec3::splat(h),
            glam::DQuat::IDENTITY,
            DVec3::splat(-half),
        ),
        cells: [cells; 3],
    };
    HierarchicalSpline::schoenberg(lattice, 1.0, f).unwrap()
}

fn bits(d: &Distances) -> Vec<u32> {
    d.phi.iter().map(|v| v.to_bits()).collect()
}

/// What is known of an earlier field is used where it still holds, and nowhere else: the bits are those of a fresh start. Also where the
/// box has moved, and with it.
#[test]
fn renewed_distances_have_the_bits_of_fresh_ones() {
    let before = spline(0.5, 16.0, |p| {
        12.0 - p.length() + 0.3 * libm::sin(p.x) * libm::cos(1.3 * p.y)
    });
    let edit = |first: [u32; 3], by: f32| BlockEdit {
        level: 0,
        first,
        shape: [3; 3],
        change: Change::Set(vec![by; 27]),
    };
    // On the surface, inside it and away from it.
    let edits = [
        edit([56, 34, 33], 2.0),
        edit([46, 30, 38], -6.0),
        edit([62, 52, 33], -30.0),
    ];
    let map = glam::DAffine3::from_axis_angle(DVec3::new(0.3, 1.0, 0.2).normalize(), 0.4);
    for map in [glam::DAffine3::IDENTITY, map] {
        let options = BrickOptions {
            spacing: 0.8,
            band: 3.0,
            reach: 9.0,
            ..BrickOptions::default()
        };
        let grid = options.grid(DVec3::new(11.0, 1.0, 0.5));
        let old = Distances::new(&Surface::new(&before, 0.0).placed(map), grid, options.band);
        for (n, edit) in edits.iter().enumerate() {
            let now = before.edited_blocks(std::slice::from_ref(edit)).unwrap();
            let surface = Surface::new(&now, 0.0).placed(map);
            let changed = now.changed_boxes(&before, &before.lattice().world_box());
            for shift in [[0; 3], [3, 0, -2], [-9, 5, 1]] {
                let there = Grid {
                    first: std::array::from_fn(|a| grid.first[a] + shift[a]),
                    ..grid
                };
                let fresh = Distances::new(&surface, there, options.band);
                let renewed = old.after(&surface, there, &changed);
                assert_eq!(bits(&fresh), bits(&renewed), "edit {n}, shift {shift:?}");
                assert_eq!(fresh.unresolved, renewed.unresolved);
                assert!(bits(&fresh) != bits(&old) || n == 2);
                println!(
                    "edit {n}, shift {shift:?}: {} of {}",
                    renewed.renewed, fresh.renewed
                );
                if shift == [0; 3] {
                    assert!(
                        renewed.renewed * 2 < fresh.renewed,
                        "{} of {}",
                        renewed.renewed,
                        fresh.renewed
                    );
                }
                // And once more from there.
                let back = renewed.after(&Surface::new(&before, 0.0).placed(map), grid, &changed);
                assert_eq!(bits(&old), bits(&back));
            }
        }
    }
}

/// The distance of a place from the surface of a field, by looking everywhere: from places of the surface that are found on rays through all
/// cells, the nearest by Newton.
struct BruteForce {
    feet: Vec<super::foot::Foot>,
}

impl BruteForce {
    fn new(field: &dyn Field, iso: f64, within: &Aabb, step: f64) -> Self {
        let count = (within.size() / step).ceil().as_u64vec3();
        let at = |x: u64, y: u64, z: u64| within.min + DVec3::new(x as f64, y as f64, z as f64) * step;
        let mut feet = Vec::new();
        let surface = Surface::new(field, iso);
        let mut jets = Vec::new();
        let size = [count.x, count.y, count.z];
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for a in 0..=size[u] {
                for b in 0..=size[v] {
                    let place = |n: u64| {
                        let mut at_ = [0; 3];
                        (at_[axis], at_[u], at_[v]) = (n, a, b);
                        at(at_[0], at_[1], at_[2])
                    };
                    let mut last = field.value(place(0)) - iso;
                    for n in 1..=size[axis] {
                        let value = field.value(place(n)) - iso;
                        if (value > 0.0) != (last > 0.0) {
                            let mut x = place(n - 1).lerp(place(n), last / (last - value));
                            for _ in 0..4 {
                                surface.jets(&[x], &mut jets);
                                x -= jets[0].gradient * (jets[0].value / jets[0].gradient.length_squared());
                            }
                            surface.jets(&[x], &mut jets);
                            feet.extend(super::foot::Foot::new(x, &jets[0]));
                        }
                        last = value;
                    }
                }
            }
        }
        Self { feet }
    }

    /// Unsigned.
    fn distance(&self, p: DVec3) -> f64 {
        let near = self
            .feet
            .iter()
            .map(|f| f.at.distance(p))
            .fold(f64::INFINITY, f64::min);
        let around = self.feet.iter().filter(|f| f.at.distance(p) < near + 0.02);
        around.map(|f| f.toward(p, 0.2).distance(p)).fold(near, f64::min)
    }
}
