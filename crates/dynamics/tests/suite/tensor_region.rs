//! Tensor-product patches with nonuniform, clamped knots as dynamic patches.

use bspline::tensor::TensorSpline;
use bspline::{Field, KnotVector};
use dynamics::integrators::Integrator;
use dynamics::lattice::{LatticeError, Rim, TensorWorkspace};
use dynamics::matter::{Matter, Quantity};
use dynamics::region::{RegionError, TensorOptions, TensorRegion};
use dynamics::solve::SolverOptions;
use dynamics::springs::{Law, Neighbours, StepMatrix};
use glam::{DAffine3, DMat3, DVec3};
use nalgebra::DVector;

/// Nine, nine and ten coefficients, knots closer together near one end, cubic but for one quadratic axis.
fn field() -> TensorSpline<f64> {
    let knots = |degree: usize, inner: &[f64], end: f64| {
        let mut all = vec![0.0; degree + 1];
        all.extend_from_slice(inner);
        all.extend(vec![end; degree + 1]);
        KnotVector::new(degree, all).unwrap()
    };
    let knots = [
        knots(3, &[0.3, 0.7, 1.2, 2.0, 3.0], 4.0),
        knots(3, &[0.5, 1.0, 1.5, 2.2, 3.1], 4.0),
        knots(2, &[0.4, 0.8, 1.2, 1.6, 2.1, 2.7, 3.3], 4.0),
    ];
    let wave = |q: DVec3| 2.0 - q.x + 0.2 * (2.0 * q.y).sin() * q.z.cos();
    let places = TensorSpline::<f64>::indices(&knots).map(|ijk| TensorSpline::<f64>::greville(&knots, ijk));
    let coefficients = places.map(wave).collect();
    let map = DAffine3::from_mat3_translation(
        DMat3::from_rotation_z(0.3) * DMat3::from_diagonal(DVec3::new(2.0, 2.0, 3.0)),
        DVec3::new(5.0, -1.0, 2.0),
    );
    TensorSpline::new(knots, coefficients, map, 1.0).unwrap()
}

fn options(rim: Rim) -> TensorOptions {
    TensorOptions {
        samples: [17, 17, 17],
        rim,
        law: Law::Linear { scale: 0.5 },
        neighbours: Neighbours::Six,
        solver: SolverOptions::default(),
    }
}

fn painted() -> Matter {
    let count = 17 * 17 * 17;
    Matter {
        stiffness: Quantity::PerSample((0..count).map(|i| if i % 17 < 8 { 30.0 } else { 1.0 }).collect()),
        damping: Quantity::Constant(1.0),
        ground: Quantity::Constant(0.01),
        ..Matter::default()
    }
}

fn pushed(rim: Rim) -> (TensorRegion<f64>, Vec<f64>) {
    let mut region = TensorRegion::new(&field(), painted(), &options(rim)).unwrap();
    let force: Vec<f64> = (0..17 * 17 * 17)
        .map(|i| f64::from(i % 17 > 9 && i / 289 < 9))
        .collect();
    region.patch_mut().set_force(&force).unwrap();
    for _ in 0..60 {
        region.step(Integrator::TrBdf2, 2000.0).unwrap();
    }
    (region, force)
}

#[test]
fn a_pushed_patch_rests_where_a_dense_solve_says() {
    for rim in [Rim::Fixed, Rim::Free] {
        let (region, force) = pushed(rim);
        let lattice = region.patch().lattice();
        // The spacings are those of the world.
        assert_eq!(lattice.spacing(), [0.5, 0.5, 0.75]);
        let lumped = region.patch().matter().lumped(lattice, Neighbours::Six).unwrap();
        let s = StepMatrix::new([17; 3], lumped.ground, lumped.springs);
        // Springs have σ² = 1/4.
        let k = 0.25 * crate::common::dense(lattice, &s);
        let mut column = vec![0.0; lattice.coefficient_count()];
        lattice.gather(&force, &mut column, &mut TensorWorkspace::new());
        let exact = k.cholesky().unwrap().solve(&DVector::from_vec(column));
        let error = (DVector::from_column_slice(&region.patch().state().p) - &exact).norm() / exact.norm();
        assert!(error < 1e-8, "{rim:?}: {error:.1e}");
    }
}

#[test]
fn the_baked_spline_is_the_patch_and_keeps_its_border() {
    let old = field();
    let (region, _) = pushed(Rim::Fixed);
    let new = region.bake().unwrap();
    assert_eq!(new.knots(), old.knots());
    let (mut worst, mut moved) = (0.0_f64, 0.0_f64);
    for (i, d) in region.patch().state().d.iter().enumerate() {
        let at = [i / 289, i / 17 % 17, i % 17];
        let p = region.sample_position(at);
        worst = worst.max((new.value(p) - d).abs());
        moved = moved.max((new.value(p) - old.value(p)).abs());
        if at.iter().any(|k| *k == 0 || *k == 16) {
            let (now, then) = (new.value_gradient(p), old.value_gradient(p));
            assert!(
                (now.0 - then.0).abs() + (now.1 - then.1).length() < 1e-12,
                "{at:?}"
            );
        }
    }
    assert!(worst < 1e-12 && moved > 0.1, "{worst:.1e} of {moved:.1e}");
    // Outside it falls from the border, which stays.
    let outside = DVec3::new(-20.0, 3.0, 40.0);
    assert_eq!(new.value(outside).to_bits(), old.value(outside).to_bits());
}

#[test]
fn released_clay_stays_to_the_bit() {
    let (mut region, _) = pushed(Rim::Free);
    let clay = region.release_clay().unwrap();
    for integrator in [Integrator::Paper, Integrator::TrBdf2, Integrator::Verlet] {
        region.step(integrator, 0.01).unwrap();
    }
    assert_eq!(region.bake().unwrap().coefficients(), clay.coefficients());
    assert_ne!(clay.coefficients(), field().coefficients());
}

#[test]
fn too_few_samples_are_refused() {
    let few = TensorOptions {
        samples: [17, 5, 17],
        ..options(Rim::Free)
    };
    let refused = TensorRegion::new(&field(), Matter::default(), &few).unwrap_err();
    assert!(
        matches!(
            refused,
            RegionError::Lattice(LatticeError::TooFewSamples { axis: 1, .. })
        ),
        "{refused}"
    );
    // Knots so close that two functions have no sample of their own.
    let crowded = field().insert_knots(0, &[0.01, 0.02, 0.03, 0.04]).unwrap();
    let refused = TensorRegion::new(&crowded, Matter::default(), &options(Rim::Free)).unwrap_err();
    assert!(
        matches!(
            refused,
            RegionError::Lattice(LatticeError::Undetermined { axis: 0, .. })
        ),
        "{refused}"
    );
}
