//! A part of a scanned animal: rest lengths, stiffness and mass as a sculptor paints them, and what holds it.

use std::io::Read;
use std::path::Path;
use std::sync::LazyLock;

use bspline::polygonize::{PolygonizeOptions, check_mesh, polygonize};
use bspline::{Aabb, Field, Frame, HierarchicalSpline, Real};
use dynamics::constraints::{Constraint, Hold, curve};
use dynamics::integrators::{AdaptiveOptions, Integrator};
use dynamics::lattice::TensorWorkspace;
use dynamics::matter::{Matter, Quantity};
use dynamics::region::{Cells, Region, RegionOptions};
use dynamics::springs::{Law, Neighbours, Plasticity, SpringWeights, StepMatrix, Weights};
use fitting::Control;
use fitting::mesh::{MeshOptions, fit_mesh};
use glam::DVec3;
use nalgebra::{Complex, DMatrix, DVector};

use crate::region::Stroke;

fn fitted<T: Real>() -> HierarchicalSpline<T> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/bunny.obj.gz");
    let file = std::fs::File::open(path).expect("comes with the project");
    let mut text = String::new();
    flate2::read::GzDecoder::new(file)
        .read_to_string(&mut text)
        .unwrap();
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => vertices.push(DVec3::from_array(std::array::from_fn(|_| {
                words.next().unwrap().parse().unwrap()
            }))),
            Some("f") => triangles.push(std::array::from_fn(|_| {
                let corner = words.next().unwrap().split('/').next().unwrap();
                corner.parse::<u32>().unwrap() - 1
            })),
            _ => (),
        }
    }
    // A level above the base, where it is needed.
    let options = MeshOptions {
        tolerance: Some(0.02),
        max_depth: Some(6),
        ..MeshOptions::default()
    };
    fit_mesh(&vertices, &triangles, &options, &mut Control::default())
        .unwrap()
        .0
}

static SINGLE: LazyLock<HierarchicalSpline<f32>> = LazyLock::new(fitted);
static DOUBLE: LazyLock<HierarchicalSpline<f64>> = LazyLock::new(fitted);

/// Cells of the coarsest level round the ears.
fn cells<T: Real>(field: &HierarchicalSpline<T>) -> Cells {
    let lattice = field.lattice();
    let at = lattice.world_from_lattice.inverse().transform_point3(back(field));
    Cells {
        level: 0,
        first: [at.x, at.y, at.z].map(|c| (c.round() as u32).clamp(6, 26) - 6),
        count: [12; 3],
    }
}

/// A place on the surface: the back, straight above the middle of the body.
fn back<T: Real>(field: &HierarchicalSpline<T>) -> DVec3 {
    let middle = deepest(field);
    foot(field, middle, DVec3::Y)
}

/// Where the field is largest on the coarsest nodes.
fn deepest<T: Real>(field: &HierarchicalSpline<T>) -> DVec3 {
    let space = field.lattice().world_box();
    let places = (0..32 * 32 * 32).map(|i| {
        let t = DVec3::new(f64::from(i / 1024), f64::from(i / 32 % 32), f64::from(i % 32)) / 31.0;
        space.min + t * space.size()
    });
    places
        .max_by(|a, b| field.value(*a).total_cmp(&field.value(*b)))
        .unwrap()
}

/// The first place on the surface from `from`, which is inside, along `direction`.
fn foot<T: Real>(field: &HierarchicalSpline<T>, from: DVec3, direction: DVec3) -> DVec3 {
    let along = |t: f64| from + t * direction;
    let mut far = 0.0;
    while field.value(along(far)) > 0.0 {
        far += 0.05;
    }
    let mut near = far - 0.05;
    for _ in 0..50 {
        let middle = 0.5 * (near + far);
        if field.value(along(middle)) > 0.0 {
            near = middle;
        } else {
            far = middle;
        }
    }
    along(near)
}

fn options<T: Real>(field: &HierarchicalSpline<T>, law: fn(f64) -> Law) -> RegionOptions {
    let law = law(1.0 / field.slope());
    RegionOptions {
        neighbours: match law {
            Law::Linear { .. } => Neighbours::Six,
            Law::FourD { .. } => Neighbours::Eighteen,
        },
        law,
        ..RegionOptions::of(field, 0)
    }
}

fn linear(scale: f64) -> Law {
    Law::Linear { scale }
}

fn region<T: Real>(field: &HierarchicalSpline<T>, matter: Matter) -> Region<T> {
    Region::new(field, cells(field), matter, &options(field, linear)).unwrap()
}

/// `f` of the place of each sample.
fn samples<T: Real, V>(region: &Region<T>, f: impl Fn(DVec3) -> V) -> Vec<V> {
    let [nx, ny, nz] = region.patch().lattice().sample_dims();
    let places = (0..nx * ny * nz).map(|i| region.sample_position([i / nz / ny, i / nz % ny, i % nz]));
    places.map(f).collect()
}

/// A pull spread by a Gaussian of 1.5 sample distances round `at`, `size` altogether.
fn pull<T: Real>(region: &Region<T>, at: DVec3, size: f64) -> Vec<T> {
    let r = 1.5 * region.patch().lattice().spacing()[0];
    let g = samples(region, |p| (-0.5 * (p - at).length_squared() / (r * r)).exp());
    let sum: f64 = g.iter().sum();
    g.iter().map(|g| T::from_f64(size * g / sum)).collect()
}

/// One step that is long against all that swings: linear springs are at rest after it.
fn settle<T: Real>(region: &mut Region<T>) {
    region.wake();
    region.step(Integrator::Paper, 1e4).unwrap();
}

/// Volume of the solid within the box of the region.
fn volume<T: Real>(field: &HierarchicalSpline<T>, region: &Region<T>) -> f64 {
    let [nx, ny, nz] = region.patch().lattice().sample_dims();
    let (a, b) = (
        region.sample_position([0; 3]),
        region.sample_position([nx - 1, ny - 1, nz - 1]),
    );
    let space = Aabb::new(a.min(b), a.max(b));
    let (mesh, _) = polygonize(
        field,
        &Frame::over(&space, [48; 3]),
        &PolygonizeOptions::default(),
    )
    .unwrap();
    let facts = check_mesh(&mesh);
    assert!(facts.is_closed_manifold());
    facts.volume
}

fn beside_is_untouched<T: Real>(
    old: &HierarchicalSpline<T>,
    new: &HierarchicalSpline<T>,
    region: &Region<T>,
) {
    let [nx, ny, nz] = region.patch().lattice().sample_dims();
    let (low, high) = (
        region.sample_position([0; 3]),
        region.sample_position([nx - 1, ny - 1, nz - 1]),
    );
    let space = old.lattice().world_box();
    let (mut beside, mut changed) = (0, 0);
    for i in 0..20_000_u32 {
        // A sequence that fills the cube evenly [Roberts, 2018].
        let t = DVec3::new(0.819_172_513, 0.671_043_607, 0.549_700_478) * f64::from(i);
        let p = space.min + t.fract() * space.size();
        let inside = p.cmpgt(low.min(high)).all() && p.cmplt(low.max(high)).all();
        let same = old.value(p).to_bits() == new.value(p).to_bits();
        assert!(same || inside, "{p}");
        beside += usize::from(!inside);
        changed += usize::from(!same);
    }
    assert!(beside > 10_000 && changed > 300, "{beside} {changed}");
}

/// The first place on the surface straight above those of a line through the body.
fn over_the_back(field: &HierarchicalSpline<f32>, along: DVec3, reach: f64, steps: usize) -> Vec<DVec3> {
    let middle = deepest(field);
    let way = |s: usize| 2.0 * s as f64 / (steps - 1) as f64 - 1.0;
    let from = (0..steps).map(|s| middle + way(s) * reach * along);
    from.map(|p| foot(field, p, DVec3::Y)).collect()
}

#[test]
fn a_region_that_follows_a_stroke_over_the_back_ends_where_a_large_one_does() {
    let field = SINGLE.clone();
    let edge = field.lattice().spacing(0).x;
    println!(
        "cells {:?} of {edge:.3}, slope {:.3}",
        field.lattice().cells,
        field.slope()
    );
    for along in [DVec3::X, DVec3::new(0.8, 0.0, 0.6), DVec3::Z] {
        let path = over_the_back(&field, along, 5.0 * edge, 60);
        let stroke = Stroke {
            law: linear(1.0 / field.slope()),
            field: field.clone(),
            path,
        };
        let kept = stroke.apart(&stroke.whole(), &stroke.following(stroke.half(8), 8, true));
        println!("along {along}: {:.2} % of the peak", 100.0 * kept);
        assert!(kept < 0.02, "along {along}: {kept:.4}");
    }
}

#[test]
fn rest_lengths_inflate_and_deflate() {
    let old = &*SINGLE;
    let mut last = 0.0;
    for scale in [0.6, 0.8, 0.9, 1.0, 1.1, 1.2, 1.4] {
        let mut region = region(old, Matter::default());
        region.patch_mut().springs_mut().rest_mut().scale = Weights::Constant(scale);
        settle(&mut region);
        let new = region.bake(old).unwrap();
        let now = volume(&new, &region);
        println!("rest lengths times {scale}: volume {now:.4}");
        assert!(now > last, "at {scale}: {last} → {now}");
        last = now;
        if scale != 1.0 {
            beside_is_untouched(old, &new, &region);
        }
    }
}

#[test]
fn rest_lengths_inflate_and_deflate_four_d_springs() {
    let old = &*SINGLE;
    let matter = Matter {
        damping: Quantity::Constant(2.0),
        ..Matter::default()
    };
    let mut last = 0.0;
    for scale in [0.8, 0.9, 1.0, 1.1, 1.2] {
        let options = options(old, |scale| Law::FourD { scale });
        let mut region = Region::new(old, cells(old), matter.clone(), &options).unwrap();
        region.patch_mut().springs_mut().rest_mut().scale = Weights::Constant(scale);
        let steps = AdaptiveOptions {
            tolerance: 0.01,
            shortest: 1e-4,
            longest: 0.5,
            energy_gain: 0.01,
            acceleration: None,
        };
        let (mut time, mut dt) = (0.0, 0.05);
        while time < 4.0 {
            let report = region.patch_mut().adaptive_step(dt, &steps).unwrap();
            assert!(report.gained <= 0.01, "{report:?}");
            (time, dt) = (time + report.step.dt, report.next_dt);
        }
        let new = region.bake(old).unwrap();
        let now = volume(&new, &region);
        println!("4-D, rest lengths times {scale}: volume {now:.4}");
        assert!(now > last, "at {scale}: {last} → {now}");
        last = now;
        if scale != 1.0 {
            beside_is_untouched(old, &new, &region);
        }
    }
}

/// `Aᵀ(diag(m) + Bᵀdiag(k)B)A` element by element.
fn dense(region: &Region<f64>, mass: Weights<f64>, springs: Vec<SpringWeights<f64>>) -> DMatrix<f64> {
    let lattice = region.patch().lattice();
    crate::common::dense(lattice, &StepMatrix::new(lattice.sample_dims(), mass, springs))
}

/// Mass, damping and stiffness matrices of a region under the linear law.
fn matrices(region: &Region<f64>) -> [DMatrix<f64>; 3] {
    let lattice = region.patch().lattice();
    let lumped = region.patch().matter().lumped(lattice, Neighbours::Six).unwrap();
    let sigma2 = region.patch().springs().law().scale().powi(2);
    let with = |factor: f64| -> Vec<SpringWeights<f64>> {
        let scaled = lumped.springs.iter().map(|s| SpringWeights {
            direction: s.direction,
            weights: s.weights.scaled(factor),
        });
        scaled.collect()
    };
    [
        dense(region, lumped.mass.clone(), with(0.0)),
        dense(region, lumped.damping.clone(), with(0.0)),
        dense(region, Weights::Constant(0.0), with(sigma2)),
    ]
}

fn gathered(region: &Region<f64>, force: &[f64]) -> DVector<f64> {
    let lattice = region.patch().lattice();
    let mut b = vec![0.0; lattice.coefficient_count()];
    lattice.gather(force, &mut b, &mut TensorWorkspace::new());
    DVector::from_vec(b)
}

/// Change of the density at the sample nearest to a place.
fn change(region: &Region<f64>, p: &[f64], at: DVec3) -> f64 {
    let lattice = region.patch().lattice();
    let mut d = vec![0.0; lattice.sample_count()];
    lattice.sample(p, &mut d, &mut TensorWorkspace::new());
    let far = samples(region, |p| (p - at).length());
    let nearest = (0..d.len()).min_by(|a, b| far[*a].total_cmp(&far[*b])).unwrap();
    d[nearest]
}

/// `value` on one side of the middle of the region along z, 1 on the other.
fn half(value: f64) -> Quantity {
    let field = &*DOUBLE;
    let plain = region(field, Matter::default());
    let middle = back(field).z;
    Quantity::PerSample(samples(&plain, |p| if p.z > middle { value } else { 1.0 }))
}

/// Places on the surface in either half, three cells off the border between them.
fn sides() -> [DVec3; 2] {
    let field = &*DOUBLE;
    let cell = field.lattice().spacing(0).z;
    [2.0, -2.0].map(|side| foot(field, deepest(field) + DVec3::Z * (side * cell), DVec3::Y))
}

#[test]
fn a_part_painted_stiff_stays() {
    let field = &*DOUBLE;
    let matter = Matter {
        stiffness: half(1000.0),
        damping: Quantity::Constant(1.0),
        ..Matter::default()
    };
    let [stiff, soft] = sides();
    let mut travels = [0.0; 2];
    for (travel, at) in travels.iter_mut().zip([stiff, soft]) {
        let mut region = region(field, matter.clone());
        let force = pull(&region, at, 0.3);
        region.set_force(&force).unwrap();
        for _ in 0..80 {
            region.wake();
            region.step(Integrator::TrBdf2, 5.0).unwrap();
        }
        let [.., k] = matrices(&region);
        let exact = k.cholesky().unwrap().solve(&gathered(&region, &force));
        *travel = change(&region, &region.patch().state().p, at);
        let expected = change(&region, exact.as_slice(), at);
        println!("travel {travel:.5}, by a direct solve {expected:.5}");
        assert!((*travel / expected - 1.0).abs() < 0.01, "{travel} {expected}");
    }
    assert!(travels[0] < 0.02 * travels[1], "{travels:?}");
}

#[test]
fn a_part_painted_heavy_lags() {
    let field = &*DOUBLE;
    let matter = Matter {
        mass: half(20.0),
        damping: Quantity::Constant(1.0),
        ..Matter::default()
    };
    let [heavy, light] = sides();
    let mut region = region(field, matter);
    let both: Vec<f64> = pull(&region, heavy, 0.1)
        .iter()
        .zip(pull(&region, light, 0.1))
        .map(|(a, b)| a + b)
        .collect();
    let [m, d, k] = matrices(&region);
    // Between the frequencies of the two halves.
    let slowest = m.clone().cholesky().unwrap().inverse() * &k;
    let omega = 1.3
        * slowest
            .complex_eigenvalues()
            .iter()
            .map(|v| v.re)
            .fold(f64::INFINITY, f64::min)
            .sqrt();
    let (parts, periods) = (48, 24);
    let dt = std::f64::consts::TAU / omega / f64::from(parts);
    // Eq. 12 at the end of a step: s = (1 - z⁻¹)/Δt in the mass and the stiffness, the damping in the middle.
    let z = Complex::new(0.0, -omega * dt).exp();
    let s = (Complex::new(1.0, 0.0) - z) / dt;
    let damped = (Complex::new(1.0, 0.0) - z * z) / (2.0 * dt);
    let symbol = m.map(|v| s * s * v) + d.map(|v| damped * v) + k.map(|v| Complex::new(v, 0.0));
    let exact = symbol
        .lu()
        .solve(&gathered(&region, &both).map(|v| Complex::new(v, 0.0)))
        .unwrap();
    let mut sums = [Complex::new(0.0, 0.0); 2];
    for step in 1..=parts * periods {
        let phase = omega * dt * f64::from(step);
        let force: Vec<f64> = both.iter().map(|f| f * phase.cos()).collect();
        region.set_force(&force).unwrap();
        region.wake();
        region.step(Integrator::Paper, dt).unwrap();
        // The last period, when what the start left has died out.
        if step > parts * (periods - 1) {
            for (sum, at) in sums.iter_mut().zip([heavy, light]) {
                let u = change(&region, &region.patch().state().p, at);
                *sum += Complex::new(0.0, -phase).exp() * u;
            }
        }
    }
    let real: Vec<f64> = exact.iter().map(|v| v.re).collect();
    let imaginary: Vec<f64> = exact.iter().map(|v| v.im).collect();
    let mut phases = [0.0; 2];
    for ((phase, sum), at) in phases.iter_mut().zip(sums).zip([heavy, light]) {
        let expected = Complex::new(change(&region, &real, at), change(&region, &imaginary, at));
        *phase = -sum.arg();
        let off = (sum / expected).arg();
        println!("lags by {:.4} rad, off by {off:.1e}", *phase);
        assert!(off.abs() < 1e-3, "{off}");
    }
    assert!(phases[0] > phases[1] + 0.3, "{phases:?}");
}

#[test]
fn the_surface_stays_on_a_held_curve() {
    let field = &*DOUBLE;
    let top = back(field);
    let cell = field.lattice().spacing(0).x;
    let free = region(field, Matter::default());
    let origin = free.sample_position([0; 3]);
    let r = 1.5 * free.patch().lattice().spacing()[0];
    // A ring on the surface, 2.5 deviations of the pull wide.
    let inside = deepest(field);
    let ring = |i: usize, count: usize| {
        let a = std::f64::consts::TAU * (i % count) as f64 / count as f64;
        foot(
            field,
            DVec3::new(top.x + 2.5 * r * a.cos(), inside.y, top.z + 2.5 * r * a.sin()),
            DVec3::Y,
        )
    };
    let local = |p: DVec3| (p - origin).to_array();
    let points: Vec<[f64; 3]> = (0..=256).map(|i| local(ring(i, 256))).collect();
    let constraints = |hold: Hold| -> Vec<Constraint> {
        curve("ring", &points, 0.5 * cell, 0.0, hold, |p| {
            field.value(origin + DVec3::from_array(p))
        })
        .unwrap()
    };
    let force = pull(&free, top, 5.0);
    let drag = |list: &[Constraint]| {
        let mut region = free.clone();
        region.patch_mut().set_constraints(list).unwrap();
        region.set_force(&force).unwrap();
        settle(&mut region);
        let new = region.bake(field).unwrap();
        let moved = |p: DVec3| {
            let (value, gradient) = new.value_gradient(p);
            value.abs() / gradient.length()
        };
        let tip = new.value(top) / field.value_gradient(top).1.length();
        let worst = (0..1000).map(|i| moved(ring(i, 1000))).fold(0.0, f64::max);
        (tip, worst)
    };
    let (dragged, there) = drag(&[]);
    assert!(
        there > 0.1 * dragged,
        "the ring moves when nothing holds it: {there} of {dragged}"
    );
    for (name, hold) in [("springs", Hold::Spring(200.0)), ("hard", Hold::Hard)] {
        let (_, moved) = drag(&constraints(hold));
        println!(
            "{name}: {:.3} % of the drag of {dragged:.3}, free {:.1} %",
            100.0 * moved / dragged,
            100.0 * there / dragged
        );
        assert!(moved <= 0.01 * dragged, "{name}: {moved} of {dragged}");
    }
}

/// A stroke of clay with all that a region can have, cut, moved, baked and let go.
fn sculpted(field: &HierarchicalSpline<f32>) -> [HierarchicalSpline<f32>; 2] {
    let top = back(field);
    let mut region = region(
        field,
        Matter {
            damping: Quantity::Constant(2.0),
            ..Matter::default()
        },
    );
    let mut matter = region.patch().matter().clone();
    let stiff = samples(&region, |p| if p.z > top.z + 0.5 { 50.0 } else { 1.0 });
    matter.stiffness = Quantity::PerSample(stiff);
    region.patch_mut().set_matter(matter).unwrap();
    let weights = samples(&region, |p| (-2.0 * (p - top).length_squared()).exp() as f32);
    region
        .patch_mut()
        .set_plasticity(Plasticity::Kernel { rate: 2.0, weights })
        .unwrap();
    let force = pull(&region, top, 5.0);
    region.set_force(&force).unwrap();
    for integrator in [
        Integrator::TrBdf2,
        Integrator::Paper,
        Integrator::Auto,
        Integrator::Verlet,
    ] {
        let dt = match integrator {
            Integrator::Verlet => 0.5 * region.patch_mut().explicit_limit().unwrap(),
            _ => 0.05,
        };
        for _ in 0..3 {
            region.step(integrator, dt).unwrap();
        }
    }
    let clay = region.release_clay(field).unwrap();
    for _ in 0..3 {
        region.wake();
        region.step(Integrator::TrBdf2, 0.1).unwrap();
    }
    let later = region.bake(&clay).unwrap();
    [clay, later]
}

#[test]
fn released_clay_keeps_its_hash_and_undo_restores_the_old_one() {
    let old = &*SINGLE;
    let before = old.sha256();
    let [clay, later] = sculpted(old);
    assert_ne!(clay.sha256(), before);
    assert_eq!(later.sha256(), clay.sha256(), "clay that was let go stays");
    // Undo is the version before, which shares all bricks that did not change.
    assert_eq!(old.sha256(), before);
    assert!(clay.changed_bricks(old).len() < clay.brick_count());
    // And doing the stroke again on it makes the same clay.
    assert_eq!(sculpted(old)[0].sha256(), clay.sha256());
}

#[test]
fn the_same_bits_on_one_two_and_eight_threads() {
    let old = &*SINGLE;
    let hash = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| sculpted(old)[0].sha256())
    };
    let one = hash(1);
    assert_eq!(one, hash(2));
    assert_eq!(one, hash(8));
}
