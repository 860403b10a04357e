//! Solids with a formula: the laws of fields, and what is known of each in closed form.

use crate::common::{Options, Random, field_conformance};
use bspline::primitives::{Capsule, Cuboid, Cylinder, Gyroid, HalfSpace, PiercedTetrahedron, Sphere, Torus};
use bspline::{Aabb, Field, Primitive, PrimitiveError};
use glam::{DVec3, dvec3};

/// A region off the origin, a little larger than the solids in it.
const REGION: Aabb = Aabb {
    min: DVec3::new(-2.0, 8.0, -3.5),
    max: DVec3::new(4.0, 14.0, 3.0),
};
const CENTER: DVec3 = DVec3::new(1.1, 10.7, -0.2);

fn check(name: &str, solid: impl Into<Primitive>, options: Options) {
    let [median, p99] = field_conformance(name, &solid.into(), &REGION, &options);
    println!("{name}: bounds {median:.3} (median), {p99:.3} (99th percentile)");
}

/// Distances have creases on their medial axis, and curvature jumps where another feature becomes nearest.
fn rough(share: f64) -> Options {
    Options {
        rough_share: share,
        ..Options::default()
    }
}

fn solids() -> Vec<(&'static str, Primitive)> {
    vec![
        ("sphere", Sphere::new(CENTER, 1.9).unwrap().into()),
        (
            "cuboid",
            Cuboid::new(CENTER, dvec3(1.5, 0.7, 2.0)).unwrap().into(),
        ),
        (
            "cylinder",
            Cylinder::new(CENTER - dvec3(1.0, 0.4, 1.2), CENTER + dvec3(0.9, 0.8, 1.0), 0.8)
                .unwrap()
                .into(),
        ),
        (
            "capsule",
            Capsule::new(CENTER - dvec3(1.0, 0.4, 1.2), CENTER + dvec3(0.9, 0.8, 1.0), 0.6)
                .unwrap()
                .into(),
        ),
        (
            "torus",
            Torus::new(CENTER, dvec3(0.3, -0.5, 2.0), 1.4, 0.5)
                .unwrap()
                .into(),
        ),
        (
            "half-space",
            HalfSpace::new(CENTER, dvec3(1.0, 2.0, -0.5)).unwrap().into(),
        ),
        ("gyroid", Gyroid::new(CENTER, 2.3, 0.2).unwrap().into()),
        (
            "pierced tetrahedron",
            PiercedTetrahedron::new(CENTER, 0.7, 5.0).unwrap().into(),
        ),
    ]
}

#[test]
fn sphere_conforms() {
    check("sphere", Sphere::new(CENTER, 1.9).unwrap(), rough(0.001));
}

#[test]
fn cuboid_conforms() {
    check(
        "cuboid",
        Cuboid::new(CENTER, dvec3(1.5, 0.7, 2.0)).unwrap(),
        rough(0.003),
    );
}

#[test]
fn cylinders_conform() {
    let (from, to) = (CENTER - dvec3(1.0, 0.4, 1.2), CENTER + dvec3(0.9, 0.8, 1.0));
    check("cylinder", Cylinder::new(from, to, 0.8).unwrap(), rough(0.003));
    let (from, to) = (CENTER - DVec3::Z, CENTER + DVec3::Z);
    check(
        "upright cylinder",
        Cylinder::new(from, to, 0.8).unwrap(),
        rough(0.003),
    );
}

#[test]
fn capsule_conforms() {
    let (from, to) = (CENTER - dvec3(1.0, 0.4, 1.2), CENTER + dvec3(0.9, 0.8, 1.0));
    check("capsule", Capsule::new(from, to, 0.6).unwrap(), rough(0.003));
}

#[test]
fn tori_conform() {
    check(
        "torus",
        Torus::new(CENTER, dvec3(0.3, -0.5, 2.0), 1.4, 0.5).unwrap(),
        rough(0.003),
    );
    check(
        "upright torus",
        Torus::new(CENTER, DVec3::Z, 1.4, 0.5).unwrap(),
        rough(0.003),
    );
}

#[test]
fn half_space_conforms() {
    check(
        "half-space",
        HalfSpace::new(CENTER, dvec3(1.0, 2.0, -0.5)).unwrap(),
        Options::default(),
    );
}

#[test]
fn gyroid_conforms() {
    check(
        "gyroid",
        Gyroid::new(CENTER, 2.3, 0.2).unwrap(),
        Options::default(),
    );
}

#[test]
fn pierced_tetrahedron_conforms() {
    check(
        "pierced tetrahedron",
        PiercedTetrahedron::new(CENTER, 0.7, 5.0).unwrap(),
        Options::default(),
    );
}

/// From every point the nearest surface point is `f` away along the gradient: exact distances, inside and out.
#[test]
fn distances_are_euclidean() {
    for (name, solid) in &solids()[..6] {
        let mut random = Random(3);
        let mut crossed = 0;
        for _ in 0..5000 {
            let p = random.point(&REGION);
            let (f, g) = solid.value_gradient(p);
            if (g.length() - 1.0).abs() > 1e-9 {
                continue; // On the medial axis.
            }
            let foot = p - g * f;
            assert!(solid.value(foot).abs() < 1e-12, "{name}: {p} is {f} from {foot}");
            crossed += 1;
            // 1-Lipschitz: nothing of the surface is nearer.
            let q = random.point(&REGION);
            assert!(
                (f - solid.value(q)).abs() <= p.distance(q) * (1.0 + 1e-12),
                "{name}: {p} {q}"
            );
        }
        assert!(crossed > 4900, "{name}: {crossed}");
    }
}

#[test]
fn known_values() {
    let cuboid = Cuboid::new(DVec3::ZERO, dvec3(1.0, 2.0, 3.0)).unwrap();
    assert_eq!(cuboid.value(DVec3::ZERO), 1.0);
    assert_eq!(cuboid.value(dvec3(4.0, 6.0, 3.0)), -5.0);
    assert_eq!(
        cuboid.value_gradient(dvec3(0.5, 0.0, 0.0)),
        (0.5, dvec3(-1.0, 0.0, 0.0))
    );
    let cylinder = Cylinder::new(dvec3(0.0, 0.0, -1.0), dvec3(0.0, 0.0, 1.0), 2.0).unwrap();
    assert_eq!(cylinder.value(dvec3(5.0, 0.0, 5.0)), -5.0);
    assert_eq!(cylinder.value(DVec3::ZERO), 1.0);
    let capsule = Capsule::new(dvec3(0.0, 0.0, -1.0), dvec3(0.0, 0.0, 1.0), 0.5).unwrap();
    assert_eq!(capsule.value(dvec3(0.0, 0.0, 3.0)), -1.5);
    assert_eq!(capsule.value(dvec3(0.0, 2.0, 0.5)), -1.5);
    let torus = Torus::new(DVec3::ZERO, DVec3::Z, 3.0, 1.0).unwrap();
    assert_eq!(torus.value(dvec3(0.0, 3.0, 0.0)), 1.0);
    assert_eq!(torus.value(DVec3::ZERO), -2.0);
    let half = HalfSpace::new(DVec3::ZERO, dvec3(0.0, 0.0, 1e-200)).unwrap();
    assert_eq!(half.value(dvec3(7.0, 7.0, -2.0)), 2.0);
}

/// Where the formula divides by zero, something finite is answered.
#[test]
fn singular_points_stay_finite() {
    for (name, solid) in solids() {
        for p in [CENTER, CENTER + DVec3::Z, REGION.min, DVec3::ZERO] {
            let jet = solid.jet(p);
            let finite = jet.value.is_finite() && jet.gradient.is_finite() && jet.hessian.is_finite();
            assert!(finite, "{name} at {p}: {jet:?}");
        }
    }
    let torus = Torus::new(DVec3::ZERO, DVec3::Z, 3.0, 1.0).unwrap();
    for p in [dvec3(3.0, 0.0, 0.0), dvec3(0.0, 0.0, 1.0)] {
        assert!(torus.jet(p).hessian.is_finite());
    }
}

/// Far from the origin, and over boxes without end, bounds stay sound and are never NaN.
#[test]
fn bounds_of_far_and_huge_boxes_are_sound() {
    let mut random = Random(9);
    for (name, solid) in solids() {
        for exponent in [0, 3, 6, 9, 15, 100, 160, 300] {
            let scale = 10f64.powi(exponent);
            for _ in 0..200 {
                let center = (random.vector() - 0.5) * scale;
                let half = random.vector() * (scale * 10f64.powf(-9.0 * random.unit()));
                let b = Aabb {
                    min: center - half,
                    max: center + half,
                };
                let bounds = solid.bounds(&b);
                assert!(bounds.lo <= bounds.hi, "{name}: {bounds:?} over {b:?}");
                let v = solid.value(random.point(&b));
                assert!(
                    bounds.contains(v) || v.is_nan(),
                    "{name}: {v} leaves {bounds:?} over {b:?}"
                );
            }
        }
        let everything = Aabb {
            min: DVec3::NEG_INFINITY,
            max: DVec3::INFINITY,
        };
        let bounds = solid.bounds(&everything);
        assert!(
            bounds.lo == f64::NEG_INFINITY || name == "gyroid",
            "{name}: {bounds:?}"
        );
        assert!(bounds.contains(solid.value(CENTER)), "{name}: {bounds:?}");
    }
}

#[test]
fn gyroid_slope_on_its_surface_is_as_stated() {
    let gyroid = Gyroid::new(DVec3::ZERO, 1.0, 0.0).unwrap();
    let mut random = Random(5);
    let (mut least, mut most) = (f64::INFINITY, 0.0f64);
    for _ in 0..20_000 {
        let mut p = random.vector();
        for _ in 0..20 {
            let (f, g) = gyroid.value_gradient(p);
            p -= g * (f / g.length_squared().max(0.1));
        }
        let (f, g) = gyroid.value_gradient(p);
        if f.abs() < 1e-12 {
            (least, most) = (least.min(g.length()), most.max(g.length()));
        }
    }
    let expected = [2f64.sqrt(), 3f64.sqrt()];
    assert!(
        (least - expected[0]).abs() < 1e-3 && (most - expected[1]).abs() < 1e-3,
        "{least} {most}"
    );
    // One period on, the same; half a period on along all axes, too.
    for _ in 0..100 {
        let p = random.vector();
        assert!((gyroid.value(p) - gyroid.value(p + DVec3::X)).abs() < 1e-15);
    }
}

/// Four holes join the hollow with the outside, four walls close it, and all lies within the stated reach.
#[test]
fn pierced_tetrahedron_is_hollow_with_four_holes() {
    let solid = PiercedTetrahedron::new(DVec3::ZERO, 1.0, 5.0).unwrap();
    let ray = |direction: DVec3| {
        (0..500)
            .filter(|i| solid.value(direction.normalize() * (*i as f64 * 0.01)) > 0.0)
            .count()
    };
    for s in [
        DVec3::ONE,
        dvec3(1.0, -1.0, -1.0),
        dvec3(-1.0, 1.0, -1.0),
        dvec3(-1.0, -1.0, 1.0),
    ] {
        assert_eq!(ray(s), 0, "a hole along {s}");
        assert!(ray(-s) > 100, "a wall along {}", -s);
    }
    assert!(solid.value(DVec3::ZERO) < 0.0);
    let mut random = Random(8);
    let shell = Aabb {
        min: DVec3::splat(-6.0),
        max: DVec3::splat(6.0),
    };
    let (mut slopes, mut reach) = (Vec::new(), 0.0f64);
    for _ in 0..200_000 {
        let p = random.point(&shell);
        let (f, g) = solid.value_gradient(p);
        if f > 0.0 {
            reach = reach.max(p.length());
        }
        if f.abs() < 0.01 {
            slopes.push(g.length());
        }
    }
    slopes.sort_by(f64::total_cmp);
    let median = slopes[slopes.len() / 2];
    assert!(3.7 < reach && reach < 3.85, "{reach}");
    assert!(0.5 < median && median < 2.0, "{median}");
}

#[test]
fn bad_parameters_are_refused_with_their_numbers() {
    let (o, z) = (DVec3::ZERO, DVec3::Z);
    assert_eq!(
        Sphere::new(o, 0.0),
        Err(PrimitiveError::NotPositive {
            name: "radius",
            value: 0.0
        })
    );
    assert!(matches!(
        Sphere::new(o, f64::NAN),
        Err(PrimitiveError::NotFinite { name: "radius", .. })
    ));
    assert!(matches!(
        Sphere::new(dvec3(0.0, f64::NAN, 0.0), 1.0),
        Err(PrimitiveError::NotFinite { .. })
    ));
    assert!(
        matches!(Cuboid::new(o, dvec3(1.0, -1.0, 1.0)), Err(PrimitiveError::NotPositive { name, .. }) if name.ends_with('y'))
    );
    assert!(matches!(
        Cylinder::new(z, z, 1.0),
        Err(PrimitiveError::NoDirection { .. })
    ));
    assert!(matches!(
        Cylinder::new(o, z, f64::INFINITY),
        Err(PrimitiveError::NotFinite { .. })
    ));
    assert!(matches!(
        Capsule::new(o, z, -1.0),
        Err(PrimitiveError::NotPositive { .. })
    ));
    assert!(matches!(
        Capsule::new(o, o, 1.0),
        Err(PrimitiveError::NoDirection { .. })
    ));
    assert!(matches!(
        HalfSpace::new(o, o),
        Err(PrimitiveError::NoDirection { .. })
    ));
    assert_eq!(
        Torus::new(o, z, 1.0, 1.0),
        Err(PrimitiveError::ClosedTorus {
            major: 1.0,
            minor: 1.0
        })
    );
    assert!(matches!(
        Gyroid::new(o, 1.0, 1.5),
        Err(PrimitiveError::Level { .. })
    ));
    assert!(matches!(
        Gyroid::new(o, 1.0, f64::NAN),
        Err(PrimitiveError::Level { .. })
    ));
    assert!(matches!(
        PiercedTetrahedron::new(o, 0.0, 5.0),
        Err(PrimitiveError::NotPositive { .. })
    ));
    assert!(Sphere::new(o, -2.5).unwrap_err().to_string().contains("-2.5"));
}
