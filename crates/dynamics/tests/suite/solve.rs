//! Solvers of a step against dense double precision.

use dynamics::lattice::{Lattice, Rim, TensorWorkspace};
use dynamics::solve::{Method, SolverOptions};
use dynamics::springs::{Neighbours, SpringWeights, StepMatrix, Weights};
use dynamics::study::{BandCholesky, Galerkin, Pattern, StepSolver, spring_weights};
use nalgebra::DVector;

use crate::common::dense;

fn matrix(
    pattern: Pattern,
    contrast: f64,
    m: usize,
    neighbours: Neighbours,
    stiffness: f64,
) -> StepMatrix<f64> {
    let springs = spring_weights(pattern, contrast, m, neighbours, stiffness);
    let mass = if pattern == Pattern::Uniform {
        Weights::Constant(1.0)
    } else {
        Weights::Each((0..m * m * m).map(|i| 1.0 + (i % 4) as f64).collect())
    };
    StepMatrix::new([m; 3], mass, springs)
}

#[test]
fn sums_over_pairs_are_the_dense_product_for_all_neighbours_and_rims() {
    for (n, m, rim) in [(6, 8, Rim::Free), (11, 12, Rim::Fixed), (5, 5, Rim::Free)] {
        for neighbours in [Neighbours::Six, Neighbours::Eighteen, Neighbours::TwentySix] {
            let lattice = Lattice::<f64>::cube(n, m, rim, 1.0).unwrap();
            let s = matrix(Pattern::Random, 100.0, m, neighbours, 3.0);
            let steps: Vec<_> = neighbours.directions().iter().map(|d| d.step).collect();
            let h = dense(&lattice, &s);
            let scale = h.amax();
            let mut galerkin = Galerkin::new(&lattice, &steps);
            let count = lattice.coefficient_count();
            let mut band = BandCholesky::<f64>::new(count, galerkin.band());
            galerkin.assemble(&s, &mut band);
            let [_, ny, nz] = lattice.coefficient_dims();
            let place = |i: usize| [i / (ny * nz), i / nz % ny, i % nz];
            for i in 0..count {
                for j in 0..count {
                    let found = galerkin.element(place(i), place(j));
                    assert!(
                        (found - h[(i, j)]).abs() < 1e-13 * scale,
                        "{n} {neighbours:?} {i} {j}"
                    );
                }
            }
            let mut diagonal = Galerkin::diagonal(&lattice, &steps);
            for (i, d) in diagonal.diagonal_of(&s).iter().enumerate() {
                assert!((d - h[(i, i)]).abs() < 1e-13 * scale);
            }
            // The factor solves it.
            band.factorize().unwrap();
            let x = DVector::from_fn(count, |i, _| (i as f64).sin());
            let b = &h * &x;
            let mut found = b.as_slice().to_vec();
            band.solve(&mut found);
            let error = (DVector::from_vec(found) - &x).norm() / x.norm();
            assert!(error < 1e-9, "{n} {neighbours:?}: {error}");
        }
    }
}

#[test]
fn a_matrix_that_is_not_positive_definite_is_refused_with_its_pivot() {
    let mut band = BandCholesky::<f64>::new(9, 2);
    for i in 0..9 {
        band.set(i, i, if i == 6 { -1.0 } else { 1.0 });
    }
    let refused = band.factorize().unwrap_err();
    assert_eq!((refused.row, refused.pivot), (6, -1.0));
}

#[test]
fn every_method_solves_its_own_kind_of_step() {
    let cases = [
        (7, 10, Rim::Free, Pattern::Uniform, Method::FastDiagonalization),
        (9, 9, Rim::Free, Pattern::Uniform, Method::FastDiagonalization),
        (5, 8, Rim::Free, Pattern::Bone, Method::Direct),
        (7, 7, Rim::Free, Pattern::Random, Method::SampleDirect),
        (9, 9, Rim::Free, Pattern::StiffBall, Method::SampleMultigrid),
        (9, 12, Rim::Free, Pattern::StiffBall, Method::VCycle),
    ];
    for (n, m, rim, pattern, method) in cases {
        let lattice = Lattice::<f64>::cube(n, m, rim, 1.0).unwrap();
        let s = matrix(pattern, 1e3, m, Neighbours::Six, 0.5);
        let steps: Vec<_> = s.springs.iter().map(|s| s.direction.step).collect();
        let g: Vec<f64> = (0..m * m * m)
            .map(|i| (0.31 * i as f64).sin() * (1.0 + (i % 11) as f64))
            .collect();
        let options = SolverOptions {
            direct_limit: 180,
            iterations: 30,
            tolerance: Some(1e-12),
            ..SolverOptions::default()
        };
        let mut solver = StepSolver::new(lattice.clone(), &steps, options);
        solver.prepare(&s).unwrap();
        let (mut x, mut dx) = (vec![0.0; lattice.coefficient_count()], vec![0.0; g.len()]);
        let report = solver.solve(&s, &g, &mut x, &mut dx);
        assert_eq!(report.method, method);
        let mut b = vec![0.0; x.len()];
        let mut w = TensorWorkspace::new();
        lattice.gather(&g, &mut b, &mut w);
        let exact = dense(&lattice, &s)
            .cholesky()
            .unwrap()
            .solve(&DVector::from_vec(b));
        let mut expected = vec![0.0; g.len()];
        lattice.sample(exact.as_slice(), &mut expected, &mut w);
        let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|v| v * v).sum::<f64>().sqrt();
        let error =
            norm(&mut dx.iter().zip(&expected).map(|(a, b)| a - b)) / norm(&mut expected.iter().copied());
        assert!(
            error < 1e-8,
            "{n}/{m} {method:?}: {error:.1e} after {:?}",
            report.iteration
        );
        let limit = match method {
            Method::FastDiagonalization | Method::Direct | Method::SampleDirect => 2,
            _ => 30,
        };
        assert!(
            report.iteration.iterations <= limit,
            "{method:?}: {:?}",
            report.iteration
        );
    }
}

#[test]
fn negative_curvature_is_reported_and_not_divided_by() {
    let lattice = Lattice::<f64>::cube(6, 9, Rim::Free, 1.0).unwrap();
    let s = matrix(Pattern::Uniform, 1.0, 9, Neighbours::Six, 1.0);
    let steps: Vec<_> = s.springs.iter().map(|s| s.direction.step).collect();
    let mut solver = StepSolver::new(lattice.clone(), &steps, SolverOptions::default());
    solver.prepare(&s).unwrap();
    // Prepared for a good matrix, asked about one with repelling springs.
    let repelling = s.springs.iter().map(|s| SpringWeights {
        direction: s.direction,
        weights: Weights::Constant(-5.0),
    });
    let bad = StepMatrix::new([9; 3], Weights::Constant(1.0), repelling.collect());
    let g: Vec<f64> = (0..729).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
    let (mut x, mut dx) = (vec![0.0; 216], vec![0.0; 729]);
    let report = solver.solve(&bad, &g, &mut x, &mut dx);
    assert!(
        report.iteration.negative_curvature.is_some_and(|c| c <= 0.0),
        "{report:?}"
    );
    assert!(x.iter().all(|x| x.is_finite()));
}

#[test]
fn a_factor_takes_over_when_it_is_made_and_is_renewed_when_it_is_old() {
    let (n, m) = (11, 14);
    let lattice = Lattice::<f32>::cube(n, m, Rim::Free, 1.0).unwrap();
    let s: StepMatrix<f32> = matrix(Pattern::StiffBall, 100.0, m, Neighbours::Six, 30.0).convert();
    let steps: Vec<_> = s.springs.iter().map(|s| s.direction.step).collect();
    let options = SolverOptions {
        quick: 0,
        ..SolverOptions::default()
    };
    let mut solver = StepSolver::new(lattice.clone(), &steps, options);
    solver.prepare(&s).unwrap();
    let g: Vec<f32> = (0..m * m * m).map(|i| (0.1 * i as f32).sin()).collect();
    let (mut x, mut dx) = (vec![0.0; n * n * n], vec![0.0; m * m * m]);
    let mut methods = Vec::new();
    let mut solve = |solver: &mut StepSolver<f32>, s: &StepMatrix<f32>| {
        let report = solver.solve(s, &g, &mut x, &mut dx);
        methods.push(report.method);
        (report.iteration.iterations, dx.clone())
    };
    // The first solve adds nothing to the V-cycle's preparation; then mass, springs of three directions and the matrix are
    // assembled, one a solve, and each of the others takes 32 rows.
    let parts = 6 + (n * n * n).div_ceil(32);
    for _ in 0..parts {
        solve(&mut solver, &s);
    }
    let (iterations, by_parts) = solve(&mut solver, &s);
    assert_eq!(iterations, 1);
    // Made at once the factor has the same bits.
    let mut settled = StepSolver::new(lattice, &steps, options);
    settled.prepare(&s).unwrap();
    settled.settle();
    let (iterations, at_once) = solve(&mut settled, &s);
    assert_eq!((iterations, &at_once), (1, &by_parts));
    // A step twice as long: the old factor does it slowly, a new one is made beside the next solves.
    let longer = s.springs.iter().map(|s| SpringWeights {
        direction: s.direction,
        weights: s.weights.scaled(4.0),
    });
    let longer = StepMatrix::new([m; 3], s.mass.clone(), longer.collect());
    for _ in 0..4 {
        assert!(solve(&mut solver, &longer).0 > 2);
    }
    for _ in 0..parts {
        solve(&mut solver, &longer);
    }
    assert_eq!(solve(&mut solver, &longer).0, 1);
    let used = |from: usize, count: usize, method| methods[from..from + count].iter().all(|m| *m == method);
    assert!(used(0, parts, Method::VCycle));
    // The old one serves until the new one takes its place.
    assert!(used(parts, parts + 7, Method::Direct));
    assert_eq!(solver.factorizations(), 2);
}

/// By default. A cycle of one level is a factor, and quick; one of two is not at this contrast.
#[test]
fn beside_quick_solves_no_factor_is_made() {
    let (n, m) = (11, 14);
    let lattice = Lattice::<f32>::cube(n, m, Rim::Free, 1.0).unwrap();
    let s: StepMatrix<f32> = matrix(Pattern::StiffBall, 1e4, m, Neighbours::Six, 30.0).convert();
    let steps: Vec<_> = s.springs.iter().map(|s| s.direction.step).collect();
    let g: Vec<f32> = (0..m * m * m).map(|i| (0.1 * i as f32).sin()).collect();
    let (mut x, mut dx) = (vec![0.0; n * n * n], vec![0.0; m * m * m]);
    for (direct_limit, is_quick) in [(1400, true), (300, false)] {
        let mut options = SolverOptions::default();
        options.v_cycle.direct_limit = direct_limit;
        let mut solver = StepSolver::new(lattice.clone(), &steps, options);
        solver.prepare(&s).unwrap();
        let reports: Vec<_> = (0..80).map(|_| solver.solve(&s, &g, &mut x, &mut dx)).collect();
        let (first, last) = (reports[0], reports[79]);
        assert_eq!(first.method, Method::VCycle);
        assert_eq!(first.iteration.iterations <= options.quick, is_quick);
        assert_eq!(last.method == Method::VCycle, is_quick);
    }
}

#[test]
fn solves_allocate_nothing_whatever_the_method() {
    let cases = [
        (7, 10, Pattern::Uniform, Method::FastDiagonalization),
        (7, 10, Pattern::Bone, Method::Direct),
        (11, 14, Pattern::Bone, Method::VCycle),
        (19, 22, Pattern::StiffBall, Method::VCycle),
        (7, 7, Pattern::Random, Method::SampleDirect),
        (17, 17, Pattern::StiffBall, Method::SampleMultigrid),
    ];
    for (n, m, pattern, method) in cases {
        let lattice = Lattice::<f32>::cube(n, m, Rim::Free, 1.0).unwrap();
        let s: StepMatrix<f32> = matrix(pattern, 1e3, m, Neighbours::Six, 30.0).convert();
        let steps: Vec<_> = s.springs.iter().map(|s| s.direction.step).collect();
        let mut solver = StepSolver::new(lattice, &steps, SolverOptions::default());
        solver.prepare(&s).unwrap();
        let g: Vec<f32> = (0..m * m * m).map(|i| (0.1 * i as f32).sin()).collect();
        let (mut x, mut dx) = (vec![0.0; n * n * n], vec![0.0; m * m * m]);
        // From the second solve on the matrix of a factor made beside the steps is assembled; workspaces grow once.
        for _ in 0..5 {
            assert_eq!(solver.solve(&s, &g, &mut x, &mut dx).method, method);
        }
        for _ in 0..50 {
            let counted = allocation_counter::measure(|| {
                solver.solve(&s, &g, &mut x, &mut dx);
            });
            assert_eq!(counted.count_total, 0, "{n}/{m} {method:?} {counted:?}");
        }
    }
}
