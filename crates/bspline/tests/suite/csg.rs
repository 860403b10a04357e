//! Trees of fields: the laws of fields for every operation, and that pruning changes nothing but the cost.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::common::{Options, Random, field_conformance};
use bspline::csg::Rounding;
use bspline::hierarchical::{Lattice, LevelEdit};
use bspline::primitives::{Capsule, Cuboid, Cylinder, Gyroid, PiercedTetrahedron, Sphere, Torus};
use bspline::{Aabb, Csg, CsgError, Field, Frame, HierarchicalSpline, Interval, Jet};
use glam::{DAffine3, DMat3, DQuat, DVec3, dvec3};

const REGION: Aabb = Aabb {
    min: DVec3::new(-3.0, -3.0, -3.0),
    max: DVec3::new(3.0, 3.0, 3.0),
};

type Shared = Arc<dyn Field>;

fn sphere(x: f64, y: f64, z: f64, r: f64) -> Shared {
    Arc::new(Sphere::new(dvec3(x, y, z), r).unwrap())
}

fn cuboid() -> Shared {
    Arc::new(Cuboid::new(dvec3(0.2, -0.1, 0.3), dvec3(1.5, 1.0, 0.8)).unwrap())
}

fn torus() -> Shared {
    Arc::new(Torus::new(dvec3(0.1, 0.2, -0.3), dvec3(1.0, 1.0, 3.0), 1.6, 0.5).unwrap())
}

fn tilted(field: Shared) -> Shared {
    let turn = DQuat::from_rotation_arc(DVec3::X, dvec3(1.0, 2.0, -0.5).normalize());
    Arc::new(
        Csg::affine(
            field,
            DAffine3::from_rotation_translation(turn, dvec3(0.3, 0.4, -0.2)),
        )
        .unwrap(),
    )
}

fn check(name: &str, field: &dyn Field, rough_share: f64) {
    // Moving a frame into local coordinates rounds otherwise than moving its nodes one by one.
    let options = Options {
        rough_share,
        value_tolerance: 1e-13,
        ..Options::default()
    };
    let [median, p99] = field_conformance(name, field, &REGION, &options);
    println!("{name}: bounds {median:.3} (median), {p99:.3} (99th percentile)");
}

#[test]
fn unions_conform() {
    let union = Csg::union(vec![cuboid(), sphere(1.0, 1.0, 0.5, 1.2), torus()]).unwrap();
    check("union", &union, 0.01);
}

#[test]
fn intersections_conform() {
    let lens = Csg::intersection(vec![
        sphere(-0.5, 0.0, 0.0, 1.8),
        sphere(0.9, 0.2, 0.1, 1.6),
        cuboid(),
    ])
    .unwrap();
    check("intersection", &lens, 0.01);
}

#[test]
fn differences_conform() {
    let carved = Csg::difference(cuboid(), vec![sphere(1.0, 1.0, 0.5, 1.2), torus()], 0.0).unwrap();
    check("difference", &carved, 0.01);
    let at_other_iso =
        Csg::difference(sphere(0.0, 0.0, 0.0, 2.0), vec![sphere(1.0, 0.0, 0.0, 1.5)], 0.4).unwrap();
    check("difference at iso-value 0.4", &at_other_iso, 0.01);
}

#[test]
fn affine_nodes_conform() {
    check("turned cuboid", tilted(cuboid()).as_ref(), 0.005);
    let m = DMat3::from_cols(dvec3(0.0, -1.3, 0.2), dvec3(0.8, 0.1, 0.3), dvec3(0.2, 0.0, 0.6));
    let map = DAffine3::from_mat3_translation(m, dvec3(-0.4, 0.3, 0.1));
    let sheared = Csg::affine(Arc::new(Gyroid::new(DVec3::ZERO, 2.5, 0.1).unwrap()), map).unwrap();
    check("sheared gyroid", &sheared, 0.0);
    let mirrored = Csg::affine(torus(), DAffine3::from_scale(dvec3(-1.2, 1.0, 0.7))).unwrap();
    check("mirrored torus", &mirrored, 0.005);
}

#[test]
fn sums_conform() {
    let gyroid: Shared = Arc::new(Gyroid::new(DVec3::ZERO, 1.7, 0.0).unwrap());
    let sum = Csg::sum(
        vec![(1.0, sphere(0.3, 0.1, 0.0, 1.5)), (0.4, gyroid), (-0.3, torus())],
        0.25,
    )
    .unwrap();
    check("sum", &sum, 0.005);
    check("offset", &Csg::offset(cuboid(), 0.2).unwrap(), 0.005);
    check(
        "complement",
        &Csg::complement(sphere(0.0, 0.0, 0.0, 1.0), 0.5).unwrap(),
        0.001,
    );
}

#[test]
fn deep_trees_conform() {
    let drilled = Csg::difference(
        tilted(Arc::new(Csg::union(vec![cuboid(), torus()]).unwrap())),
        vec![Arc::new(
            Cylinder::new(dvec3(-2.0, -1.0, 0.0), dvec3(2.0, 1.0, 0.5), 0.4).unwrap(),
        )],
        0.0,
    );
    let solid: Shared = Arc::new(PiercedTetrahedron::new(DVec3::ZERO, 0.5, 5.0).unwrap());
    let capsule: Shared = Arc::new(Capsule::new(dvec3(-1.0, 0.0, 2.0), dvec3(1.0, 0.5, 2.0), 0.5).unwrap());
    let tree = Csg::union(vec![
        tilted(Arc::new(drilled.unwrap())),
        Arc::new(Csg::intersection(vec![solid, sphere(0.0, 0.0, 0.0, 2.5)]).unwrap()),
        capsule,
    ]);
    check("deep tree", &tree.unwrap(), 0.02);
}

#[test]
fn operations_are_max_and_min() {
    let (a, b) = (sphere(0.0, 0.0, 0.0, 1.0), sphere(1.0, 0.0, 0.0, 1.0));
    let union = Csg::union(vec![a.clone(), b.clone()]).unwrap();
    let intersection = Csg::intersection(vec![a.clone(), b.clone()]).unwrap();
    let difference = Csg::difference(a.clone(), vec![b.clone()], 0.25).unwrap();
    let mut random = Random(2);
    for _ in 0..2000 {
        let p = random.point(&REGION);
        let (f, g) = (a.value(p), b.value(p));
        assert_eq!(union.value(p), f.max(g));
        assert_eq!(intersection.value(p), f.min(g));
        assert_eq!(difference.value(p), f.min(0.5 - g));
    }
    // A tie: the first branch named gives the gradient.
    let middle = dvec3(0.5, 0.3, 0.0);
    assert_eq!(union.value_gradient(middle), a.value_gradient(middle));
    assert_eq!(intersection.value_gradient(middle), a.value_gradient(middle));
    let swapped = Csg::union(vec![b.clone(), a]).unwrap();
    assert_eq!(swapped.value_gradient(middle), b.value_gradient(middle));
    assert_ne!(swapped.value_gradient(middle), union.value_gradient(middle));
}

#[test]
fn affine_values_are_carried() {
    let m = DMat3::from_cols(dvec3(0.0, 2.0, 0.0), dvec3(-1.0, 0.0, 0.5), dvec3(0.0, 0.0, 3.0));
    let map = DAffine3::from_mat3_translation(m, dvec3(1.0, -2.0, 0.5));
    let moved = Csg::affine(cuboid(), map).unwrap();
    let mut random = Random(4);
    for _ in 0..1000 {
        let p = random.point(&REGION);
        assert!((moved.value(map.transform_point3(p)) - cuboid().value(p)).abs() < 1e-14);
    }
}

/// Counts the values a field is asked for.
struct Counted {
    field: Shared,
    asked: AtomicUsize,
}

impl Counted {
    fn new(field: Shared) -> Arc<Self> {
        Arc::new(Self {
            field,
            asked: AtomicUsize::new(0),
        })
    }
    fn take(&self) -> usize {
        self.asked.swap(0, Ordering::Relaxed)
    }
}

impl Field for Counted {
    fn value(&self, p: DVec3) -> f64 {
        self.asked.fetch_add(1, Ordering::Relaxed);
        self.field.value(p)
    }
    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        self.asked.fetch_add(1, Ordering::Relaxed);
        self.field.value_gradient(p)
    }
    fn jet(&self, p: DVec3) -> Jet {
        self.field.jet(p)
    }
    fn bounds(&self, b: &Aabb) -> Interval {
        self.field.bounds(b)
    }
}

/// In a row of a thousand spheres nearly all are far from any block; the cost is that of the near ones, and the
/// values are those of the whole row.
#[test]
fn far_branches_are_not_evaluated() {
    let counted: Vec<_> = (0..1000)
        .map(|i| Counted::new(sphere(i as f64, 0.0, 0.0, 0.7)))
        .collect();
    let union = Csg::union(counted.iter().map(|c| c.clone() as Shared).collect()).unwrap();
    let total = || counted.iter().map(|c| c.take()).sum::<usize>();

    let frame = Frame::over(
        &Aabb {
            min: dvec3(0.0, -1.0, -1.0),
            max: dvec3(1000.0, 1.0, 1.0),
        },
        [8000, 16, 16],
    );
    let count = [128, 17, 17];
    let nodes = count.iter().product::<usize>();
    let mut values = vec![0.0; nodes];
    union.frame_values(&frame, [4000, 0, 0], count, &mut values);
    let asked = total();
    assert!(
        asked < 10 * nodes,
        "{asked} values for {nodes} nodes of a union of 1000"
    );
    let plain = |p: DVec3| {
        counted
            .iter()
            .map(|c| c.value(p))
            .fold(f64::NEG_INFINITY, f64::max)
    };
    for i in (0..nodes).step_by(97) {
        let n = [4000 + (i / 289) as i64, (i / 17 % 17) as i64, (i % 17) as i64];
        assert_eq!(values[i], plain(frame.node(n)));
    }
    total();

    let mut random = Random(6);
    let near = Aabb {
        min: dvec3(500.0, 0.2, 0.2),
        max: dvec3(500.4, 0.4, 0.4),
    };
    let points: Vec<DVec3> = (0..640).map(|_| random.point(&near)).collect();
    let mut batch = vec![(0.0, DVec3::ZERO); points.len()];
    union.values_gradients(&points, &mut batch);
    let asked = total();
    assert!(
        asked <= 2 * points.len(),
        "{asked} values for {} points",
        points.len()
    );

    // A difference leaves out tools that are far away, and everything but the tool deep inside one.
    let (block, tool) = (Counted::new(cuboid()), Counted::new(sphere(1.5, 0.0, 0.0, 0.5)));
    let carved = Csg::difference(block.clone(), vec![tool.clone()], 0.0).unwrap();
    let small = |x: f64| {
        Frame::over(
            &Aabb {
                min: dvec3(x, 0.0, 0.0),
                max: dvec3(x + 0.1, 0.1, 0.1),
            },
            [8; 3],
        )
    };
    let mut values = [0.0; 512];
    carved.frame_values(&small(-2.5), [0; 3], [8; 3], &mut values);
    assert_eq!((block.take(), tool.take()), (512, 0));
    carved.frame_values(&small(1.4), [0; 3], [8; 3], &mut values);
    assert_eq!((block.take(), tool.take()), (0, 512));
}

/// A tree whose first leaf is a field of which the values are known does not ask it again, and has the values of the
/// whole; a version that is another, or stands elsewhere in the tree, is of no use.
#[test]
fn values_from_a_known_field_are_those_of_the_whole() {
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_scale_rotation_translation(
            DVec3::splat(0.5),
            DQuat::IDENTITY,
            DVec3::splat(-3.0),
        ),
        cells: [12; 3],
    };
    let ball = |p: DVec3| 1.8 - p.length() + 0.1 * (3.0 * p.x).sin();
    let field = HierarchicalSpline::<f32>::schoenberg(lattice, 1.0, ball).unwrap();
    let edit = LevelEdit {
        level: 1,
        function: [9, 12, 12],
        delta: 0.1,
    };
    let other = field.edited(&[edit]).unwrap();
    let shared = || Arc::new(field.clone()) as Shared;
    let tool = || sphere(0.8, 0.9, 0.4, 1.1);
    let carved = Csg::difference(shared(), vec![tool()], 0.05).unwrap();
    let plain = |tree: Csg| Arc::new(tree) as Shared;
    let blend = |range: f64| Rounding::Bounded { range };
    let far = || sphere(2.5, 2.5, 2.5, 0.2);
    let trees: Vec<(&str, Shared)> = vec![
        (
            "union",
            plain(Csg::union(vec![shared(), tool(), torus(), far()]).unwrap()),
        ),
        (
            "intersection",
            plain(Csg::intersection(vec![shared(), cuboid()]).unwrap()),
        ),
        (
            "nested",
            plain(Csg::union(vec![plain(carved.clone()), torus()]).unwrap()),
        ),
        ("difference", plain(carved)),
        (
            "blend",
            Csg::smooth_union(vec![shared(), tool()], blend(0.4), 0.05).unwrap(),
        ),
        (
            "far blend",
            Csg::smooth_difference(shared(), vec![far()], blend(0.1), 0.3).unwrap(),
        ),
    ];
    let frame = Frame::over(&REGION, [24; 3]);
    for (lo, count) in [
        ([0, 0, 0], [25; 3]),
        ([-3, 5, 20], [7, 1, 12]),
        ([0, 0, 0], [0, 3, 2]),
    ] {
        let blank = || vec![f64::NAN; count.iter().product()];
        let (mut known, mut whole) = (blank(), blank());
        field.frame_values(&frame, lo, count, &mut known);
        for (name, tree) in &trees {
            tree.frame_values(&frame, lo, count, &mut whole);
            let mut from = blank();
            assert!(
                tree.frame_values_from(&field, &known, &frame, lo, count, &mut from),
                "{name}"
            );
            let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&from), bits(&whole), "{name} at {lo:?}");
            let mut untouched = blank();
            assert!(!tree.frame_values_from(&other, &known, &frame, lo, count, &mut untouched));
            assert!(untouched.iter().all(|v| v.is_nan()), "{name}");
        }
        let behind = Csg::union(vec![tool(), shared()]).unwrap();
        assert!(!behind.frame_values_from(&field, &known, &frame, lo, count, &mut blank()));
        assert!(!cuboid().frame_values_from(&field, &known, &frame, lo, count, &mut blank()));
    }
}

#[test]
fn bad_nodes_are_refused() {
    assert_eq!(Csg::union(vec![]).err(), Some(CsgError::NoBranches));
    assert_eq!(Csg::intersection(vec![]).err(), Some(CsgError::NoBranches));
    let nan = Csg::difference(cuboid(), vec![cuboid()], f64::NAN).err();
    assert!(matches!(nan, Some(CsgError::NotFinite { .. })));
    assert!(matches!(
        Csg::sum(vec![(f64::INFINITY, cuboid())], 0.0).err(),
        Some(CsgError::NotFinite { .. })
    ));
    assert!(matches!(
        Csg::sum(vec![], f64::NAN).err(),
        Some(CsgError::NotFinite { .. })
    ));
    let flat = DAffine3::from_scale(dvec3(1.0, 0.0, 1.0));
    assert!(matches!(
        Csg::affine(cuboid(), flat).err(),
        Some(CsgError::NotInvertible { .. })
    ));
    let sheet = DAffine3::from_mat3(DMat3::from_cols(DVec3::X, dvec3(1.0, 1e-13, 0.0), DVec3::Z));
    assert!(matches!(
        Csg::affine(cuboid(), sheet).err(),
        Some(CsgError::NotInvertible { .. })
    ));
    let thin = DAffine3::from_scale(dvec3(1.0, 1e-9, 1.0));
    assert!(Csg::affine(cuboid(), thin).is_ok());
    let nan = DAffine3::from_translation(dvec3(0.0, f64::NAN, 0.0));
    assert!(matches!(
        Csg::affine(cuboid(), nan).err(),
        Some(CsgError::NotFinite { .. })
    ));
}
