//! Constraint springs and hard constraints, against dense solves and over many steps.

use bspline::{Basis, Real};
use dynamics::constraints::{Constraint, ConstraintError, Hold, On, curve};
use dynamics::integrators::{AdaptiveOptions, Integrator};
use dynamics::lattice::{Lattice, Rim, TensorWorkspace};
use dynamics::matter::{Matter, Quantity};
use dynamics::patch::{Patch, PatchError};
use dynamics::solve::{Method, SolverOptions};
use dynamics::springs::{Law, Neighbours, StepMatrix};
use nalgebra::{DMatrix, DVector};

const M: usize = 10;
const SIGMA: f64 = 0.5;
const INTEGRATORS: [Integrator; 4] = [
    Integrator::Paper,
    Integrator::Symplectic,
    Integrator::Verlet,
    Integrator::TrBdf2,
];

/// Density of the undeformed field, linear in the distance along x so that every lattice holds it exactly.
fn field(at: [f64; 3]) -> f64 {
    4.3 - at[0]
}

fn matter(painted: bool) -> Matter {
    let mut matter = Matter {
        damping: Quantity::Constant(0.5),
        ground: Quantity::Constant(0.1),
        ..Matter::default()
    };
    if painted {
        for (i, k) in matter.stiffness.paint(M * M * M).iter_mut().enumerate() {
            *k = if i % (M * M) < M * M / 2 { 20.0 } else { 1.0 };
        }
    }
    matter
}

fn patch<T: Real>(n: usize, rim: Rim, painted: bool, direct_limit: usize, law: Law) -> Patch<T> {
    let lattice = Lattice::cube(n, M, rim, 1.0).unwrap();
    let d: Vec<T> = (0..M * M * M)
        .map(|i| T::from_f64(field([(i / (M * M)) as f64, 0.0, 0.0])))
        .collect();
    let options = SolverOptions {
        direct_limit,
        quick: 0,
        ..SolverOptions::default()
    };
    let mut p = Patch::new(lattice, matter(painted), law, Neighbours::Six, &d, options).unwrap();
    let force = (0..M * M * M).map(|i| T::from_f64(if i % 7 == 3 { 0.4 } else { -0.05 }));
    p.set_force(&force.collect::<Vec<_>>()).unwrap();
    p
}

fn linear(painted: bool) -> Patch<f64> {
    patch(6, Rim::Free, painted, 1000, Law::Linear { scale: SIGMA })
}

fn point(label: &str, at: [f64; 3], density: f64, hold: Hold) -> Constraint {
    let on = On::Point { at, field: field(at) };
    Constraint {
        label: label.into(),
        on,
        density,
        hold,
    }
}

fn ring(hold: Hold) -> Vec<Constraint> {
    let at = |i: usize| {
        let a = std::f64::consts::TAU * (i % 40) as f64 / 40.0;
        [
            4.3 + 0.3 * (2.0 * a).sin(),
            4.5 + 2.3 * a.cos(),
            4.5 + 2.3 * a.sin(),
        ]
    };
    let points: Vec<_> = (0..=40).map(at).collect();
    curve("ring", &points, 0.8, 0.0, hold, field).unwrap()
}

/// `K̃` and `Aᵀf` of a patch, element by element.
fn dense(p: &Patch<f64>, force: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
    let lattice = p.lattice();
    let lumped = p.matter().lumped(lattice, Neighbours::Six).unwrap();
    let s = StepMatrix::new(lattice.sample_dims(), lumped.ground, lumped.springs);
    let n = lattice.coefficient_count();
    let mut w = TensorWorkspace::new();
    let (mut d, mut q) = (vec![0.0; M * M * M], vec![0.0; M * M * M]);
    let mut column = vec![0.0; n];
    let mut k = DMatrix::zeros(n, n);
    for j in 0..n {
        let mut e = vec![0.0; n];
        e[j] = SIGMA * SIGMA;
        lattice.sample(&e, &mut d, &mut w);
        s.apply(&d, &mut q);
        lattice.gather(&q, &mut column, &mut w);
        k.set_column(j, &DVector::from_column_slice(&column));
    }
    lattice.gather(force, &mut column, &mut w);
    (k, DVector::from_vec(column))
}

/// The row of a point constraint with all coefficients free.
fn row(lattice: &Lattice<f64>, c: &Constraint) -> DVector<f64> {
    let On::Point { at, .. } = c.on else {
        panic!("points only")
    };
    let axes: [Basis<f64>; 3] =
        std::array::from_fn(|k| Basis::at(lattice.axes()[k].knots(), at[k] / (M - 1) as f64, 0));
    let [_, ny, nz] = lattice.coefficient_dims();
    let mut out = DVector::zeros(lattice.coefficient_count());
    for i in 0..4 {
        for j in 0..4 {
            for k in 0..4 {
                let place = ((axes[0].first() + i) * ny + axes[1].first() + j) * nz + axes[2].first() + k;
                out[place] = axes[0].values()[i] * axes[1].values()[j] * axes[2].values()[k];
            }
        }
    }
    out
}

/// Rest under springs and independent hard points, by one dense system.
fn rest(p: &Patch<f64>, force: &[f64], constraints: &[Constraint]) -> DVector<f64> {
    let (mut k, mut b) = dense(p, force);
    let n = b.len();
    let mut hard = Vec::new();
    for c in constraints {
        let On::Point { field, .. } = c.on else {
            panic!("points only")
        };
        let (r, target) = (row(p.lattice(), c), c.density - field);
        match c.hold {
            Hold::Spring(stiffness) => {
                k += SIGMA * SIGMA * stiffness * (&r * r.transpose());
                b += SIGMA * SIGMA * stiffness * target * r;
            }
            Hold::Hard => hard.push((r, target)),
        }
    }
    let mut all = DMatrix::zeros(n + hard.len(), n + hard.len());
    let mut right = DVector::zeros(n + hard.len());
    all.view_mut((0, 0), (n, n)).copy_from(&k);
    right.rows_mut(0, n).copy_from(&b);
    for (i, (r, target)) in hard.iter().enumerate() {
        all.view_mut((0, n + i), (n, 1)).copy_from(r);
        all.view_mut((n + i, 0), (1, n)).copy_from(&r.transpose());
        right[n + i] = *target;
    }
    all.full_piv_lu().solve(&right).unwrap().rows(0, n).into()
}

fn assert_settles_at_rest(constraints: &[Constraint]) {
    for painted in [false, true] {
        let mut p = linear(painted);
        let force: Vec<f64> = (0..M * M * M).map(|i| (i % 11) as f64 * 0.1 - 0.4).collect();
        p.set_force(&force).unwrap();
        p.set_constraints(constraints).unwrap();
        for _ in 0..80 {
            let report = p.step(Integrator::TrBdf2, 20.0).unwrap();
            assert!(
                report.solve.iteration.negative_curvature.is_none() || report.solve.iteration.residual < 1e-6
            );
        }
        let exact = rest(&p, &force, constraints);
        let found = DVector::from_column_slice(&p.state().p);
        let error = (&found - &exact).norm() / exact.norm();
        assert!(error < 1e-8, "painted {painted}: {error:.1e}");
    }
}

#[test]
fn constraint_springs_settle_where_a_dense_solve_says() {
    let mut list = ring(Hold::Spring(200.0));
    list.push(point("inside", [6.1, 3.3, 5.0], 0.7, Hold::Spring(30.0)));
    assert_settles_at_rest(&list);
}

#[test]
fn hard_constraints_settle_where_a_dense_solve_says() {
    assert_settles_at_rest(&[
        point("a", [4.0, 4.5, 4.5], 0.0, Hold::Hard),
        point("b", [6.1, 3.3, 5.0], -1.0, Hold::Hard),
        point("corner", [9.0, 0.0, 9.0], -4.0, Hold::Hard),
    ]);
}

#[test]
fn springs_and_hard_constraints_work_together() {
    let mut list = ring(Hold::Spring(200.0));
    // One of the springs pulls where a hard constraint holds something else, which wins.
    let On::Point { at, .. } = list[0].on else {
        panic!("a curve is made of points")
    };
    list.push(point("over the curve", at, 0.5, Hold::Hard));
    list.push(point("b", [6.1, 3.3, 5.0], -1.0, Hold::Hard));
    assert_settles_at_rest(&list);
}

#[test]
fn stiff_springs_hold_the_surface_on_a_curve() {
    let drag = |list: &[Constraint]| {
        let mut p = linear(true);
        p.set_constraints(list).unwrap();
        for _ in 0..60 {
            p.step(Integrator::TrBdf2, 20.0).unwrap();
        }
        // The gaps of the curve, whatever holds it.
        p.set_constraints(&ring(Hold::Spring(1.0))).unwrap();
        p.constraint_gaps().fold(0.0_f64, |a, g| a.max(g.abs()))
    };
    let free = drag(&[]);
    let held = drag(&ring(Hold::Spring(2e4)));
    assert!(held < 0.01 * free, "{held} of {free}");
}

#[test]
fn inconsistent_hard_constraints_are_refused_by_name_and_change_nothing() {
    let mut p = linear(true);
    p.set_constraints(&[point("old", [4.0; 3], 0.3, Hold::Hard)])
        .unwrap();
    let (before, old) = (p.state().clone(), p.constraints().to_vec());
    let sum = Constraint {
        label: "sum".into(),
        on: On::Samples(vec![(555, 1.0), (222, 1.0)]),
        density: 5.0,
        hold: Hold::Hard,
    };
    let list = [
        point("bystander", [7.0, 2.0, 8.0], 0.0, Hold::Hard),
        point("first", [5.0; 3], 0.0, Hold::Hard),
        point("second", [2.0; 3], 0.5, Hold::Hard),
        sum,
    ];
    let refused = p.set_constraints(&list).unwrap_err();
    let PatchError::Constraint(ConstraintError::Inconsistent { mut rows, gap }) = refused else {
        panic!("{refused}");
    };
    rows.sort();
    assert_eq!(rows, ["first", "second", "sum"]);
    assert!(
        (gap.abs() - 4.5).abs() < 1e-9 || (gap.abs() - 4.5).abs() < 4.5,
        "{gap}"
    );
    assert_eq!((p.state(), p.constraints()), (&before, &old[..]));
    // Within the fixed rim nothing can move.
    let mut p = patch::<f64>(9, Rim::Fixed, true, 1000, Law::Linear { scale: SIGMA });
    let refused = p
        .set_constraints(&[point("rim", [0.0, 4.0, 4.0], 0.0, Hold::Hard)])
        .unwrap_err();
    assert!(
        refused.to_string().contains("hard constraint rim asks for"),
        "{refused}"
    );
    // What is there already may be asked for.
    p.set_constraints(&[point("rim", [0.0, 4.0, 4.0], 4.3, Hold::Hard)])
        .unwrap();
}

#[test]
fn redundant_hard_constraints_change_nothing() {
    // Twice the same points, sums of them, and a line along z with more points than the splines on it have coefficients.
    let mut list = vec![
        point("first", [5.0; 3], 0.0, Hold::Hard),
        point("second", [2.0; 3], 0.5, Hold::Hard),
    ];
    let line = |count: usize| {
        let points = [[3.0, 4.4, 0.0], [3.0, 4.4, 9.0]];
        curve("line", &points, 9.0 / count as f64, 0.9, Hold::Hard, field).unwrap()
    };
    let mut redundant = list.clone();
    list.extend(line(5));
    redundant.extend(line(23));
    redundant.push(point("again", [5.0; 3], 0.0, Hold::Hard));
    redundant.push(Constraint {
        label: "sum".into(),
        on: On::Samples(vec![(555, 2.0), (222, -3.0)]),
        density: -1.5,
        hold: Hold::Hard,
    });
    for integrator in INTEGRATORS {
        let [a, b] = [&list, &redundant].map(|list| {
            let mut p = linear(true);
            p.set_constraints(list).unwrap();
            for _ in 0..10 {
                p.step(integrator, 0.1).unwrap();
            }
            assert!(p.constraint_gaps().all(|g| g.abs() < 1e-7));
            p.state().d.clone()
        });
        let worst = a.iter().zip(&b).fold(0.0_f64, |w, (a, b)| w.max((a - b).abs()));
        assert!(worst < 1e-6, "{integrator:?}: {worst:.1e}");
    }
}

/// Points of the surface itself, at a tenth of a sample distance: their densities are zero but for rounding, and so is what one of them is off by
/// when the others hold. What is off by more is still refused.
#[test]
fn finely_sampled_hard_curves_on_the_surface_agree_to_rounding() {
    let line = |off: f64| {
        let points = [[4.3, 4.4, 0.5], [4.3, 6.1, 8.5]];
        let rounded = |at: [f64; 3]| field(at) + off * (1e3 * at[2]).sin();
        curve("line", &points, 0.1, 0.0, Hold::Hard, rounded).unwrap()
    };
    let mut p = linear(true);
    p.set_constraints(&line(3e-8)).unwrap();
    for _ in 0..20 {
        p.step(Integrator::TrBdf2, 1.0).unwrap();
    }
    let worst = p.constraint_gaps().fold(0.0_f64, |w, g| w.max(g.abs()));
    assert!(worst < 1e-6, "{worst:.1e}");
    // It moves nothing by itself, and neither does what is too little to be seen.
    let settled = |off: f64| {
        let mut p = linear(true);
        p.set_constraints(&line(off)).unwrap();
        for _ in 0..20 {
            p.step(Integrator::TrBdf2, 1.0).unwrap();
        }
        let worst = p.constraint_gaps().fold(0.0_f64, |w, g| w.max(g.abs()));
        assert!(worst < 1e-3, "{off}: {worst:.1e}");
        p.state().d.clone()
    };
    let exact = settled(0.0);
    for off in [3e-8, 2e-6] {
        let moved = settled(off);
        let moved = moved
            .iter()
            .zip(&exact)
            .fold(0.0_f64, |w, (a, b)| w.max((a - b).abs()));
        // A tenth of the densities, which go up to 5.
        assert!(moved < 0.5, "{off}: {moved}");
    }
    let refused = p.set_constraints(&line(1e-3)).unwrap_err();
    assert!(
        matches!(
            refused,
            PatchError::Constraint(ConstraintError::Inconsistent { .. })
        ),
        "{refused}"
    );
}

fn held_over_many_steps<T: Real>(
    (n, rim, painted, limit): (usize, Rim, bool, usize),
    law: Law,
    method: Method,
    bound: f64,
) {
    for integrator in INTEGRATORS {
        let mut p = patch::<T>(n, rim, painted, limit, law);
        let mut list = ring(Hold::Hard);
        list.push(point("spring", [6.1, 3.3, 5.0], 0.7, Hold::Spring(30.0)));
        list.push(Constraint {
            label: "sum".into(),
            on: On::Samples(vec![(564, 1.0), (234, -1.0)]),
            density: -2.5,
            hold: Hold::Hard,
        });
        p.set_constraints(&list).unwrap();
        let longest = match integrator {
            Integrator::Symplectic | Integrator::Verlet => 0.9 * p.explicit_limit().unwrap(),
            _ => 0.7,
        };
        let mut worst = 0.0_f64;
        for step in 0..150 {
            let dt = if step % 3 == 0 { 0.5 * longest } else { longest };
            let report = p.step(integrator, dt).unwrap();
            if ![Integrator::Symplectic, Integrator::Verlet].contains(&integrator) {
                // A factor made beside the steps takes the place of the cycle.
                let by = report.solve.method;
                assert!(by == method || method == Method::VCycle && by == Method::Direct);
                assert!(step > 0 || by == method);
            }
            let gaps = list
                .iter()
                .zip(p.constraint_gaps())
                .filter(|(c, _)| c.hold == Hold::Hard);
            worst = gaps.fold(worst, |w, (_, g)| w.max(g.abs()));
        }
        let name = method.name();
        assert!(worst < bound, "{name} {integrator:?}: {worst:.1e}");
        let moved = p.state().p.iter().fold(0.0_f64, |w, p| w.max(p.as_f64().abs()));
        assert!((0.01..50.0).contains(&moved), "{name} {integrator:?}: {moved}");
        assert!(p.state().d.iter().chain(&p.state().w).all(|d| d.is_finite()));
    }
}

#[test]
fn hard_constraints_hold_over_many_steps_of_every_integrator_and_solver() {
    let law = Law::Linear { scale: SIGMA };
    let cases = [
        ((6, Rim::Free, false, 1000), Method::FastDiagonalization),
        ((6, Rim::Free, true, 1000), Method::Direct),
        ((11, Rim::Fixed, true, 1000), Method::Direct),
        ((8, Rim::Free, true, 100), Method::VCycle),
    ];
    for (case, method) in cases {
        held_over_many_steps::<f64>(case, law, method, 1e-6);
        held_over_many_steps::<f32>(case, law, method, 2e-5);
    }
    held_over_many_steps::<f64>(cases[1].0, Law::FourD { scale: SIGMA }, Method::Direct, 1e-6);
}

#[test]
fn hard_constraints_hold_where_coefficients_are_as_many_as_samples() {
    let law = Law::Linear { scale: SIGMA };
    let cases = [
        ((M, Rim::Free, false, 1000), Method::FastDiagonalization),
        ((M, Rim::Free, true, 1000), Method::SampleDirect),
    ];
    for (case, method) in cases {
        held_over_many_steps::<f64>(case, law, method, 1e-6);
    }
    let mut p = patch::<f64>(M, Rim::Free, true, 100, law);
    let refused = p.set_constraints(&ring(Hold::Hard)).unwrap_err();
    assert!(
        matches!(
            refused,
            PatchError::Constraint(ConstraintError::Multigrid { limit: 400, .. })
        ),
        "{refused}"
    );
    assert!(p.constraints().is_empty());
}

#[test]
fn constraints_create_no_energy() {
    for integrator in [Integrator::Paper, Integrator::TrBdf2] {
        let mut p = linear(true);
        p.set_force(&[0.0; M * M * M]).unwrap();
        let mut list = ring(Hold::Spring(1e6));
        list.push(point("hard", [6.1, 3.3, 5.0], -1.0, Hold::Hard));
        p.set_constraints(&list).unwrap();
        let n = p.lattice().coefficient_count();
        let v: Vec<f64> = (0..n).map(|i| (1.1 * i as f64).cos()).collect();
        p.set_state(&vec![0.0; n], &v).unwrap();
        let first = p.energy().total();
        assert!(p.energy().constraints > 0.0);
        let mut last = first;
        for step in 0..200 {
            p.step(integrator, [0.001, 0.03, 1.0, 0.3, 0.01][step % 5])
                .unwrap();
            let now = p.energy().total();
            assert!(
                now <= last + 1e-9 * first,
                "{integrator:?} step {step}: {last} → {now}"
            );
            last = now;
        }
    }
}

#[test]
fn adaptive_steps_accept_constraints_that_are_set_while_it_moves() {
    let mut p = linear(true);
    let options = AdaptiveOptions {
        tolerance: 1e-3,
        shortest: 1e-5,
        longest: 1.0,
        energy_gain: 0.01,
        acceleration: None,
    };
    let (mut dt, mut time, mut steps) = (0.1, 0.0, 0);
    while time < 6.0 {
        if steps == 5 {
            p.set_constraints(&[point("late", [5.0; 3], 1.5, Hold::Hard)])
                .unwrap();
        }
        let report = p.adaptive_step(dt, &options).unwrap();
        (dt, time, steps) = (report.next_dt, time + report.step.dt, steps + 1);
    }
    assert!(steps < 300, "{steps} steps");
    assert!(p.constraint_gaps().all(|g| g.abs() < 1e-6));
}

#[test]
fn constraint_springs_lower_the_explicit_bound() {
    let mut p = linear(true);
    let free = p.explicit_limit().unwrap();
    p.set_constraints(&[point("stiff", [5.0; 3], 1.5, Hold::Spring(1e6))])
        .unwrap();
    let limit = p.explicit_limit().unwrap();
    assert!(limit < 0.1 * free, "{free} → {limit}");
    assert!(matches!(
        p.step(Integrator::Symplectic, free),
        Err(PatchError::Unstable { .. })
    ));
    let start = p.energy().total();
    for _ in 0..300 {
        p.step(Integrator::Symplectic, 0.9 * limit).unwrap();
    }
    assert!(p.energy().total() < 3.0 * start);
    p.set_constraints(&[]).unwrap();
    assert_eq!(p.explicit_limit().unwrap(), free);
}

#[test]
fn nonsense_is_refused_with_its_name() {
    let mut p = linear(false);
    let outside = point("far", [5.0, 12.0, 5.0], 0.0, Hold::Hard);
    let nan = point("nan", [5.0; 3], f64::NAN, Hold::Spring(1.0));
    let slack = point("slack", [5.0; 3], 0.0, Hold::Spring(0.0));
    let nowhere = point("nowhere", [f64::NAN; 3], 0.0, Hold::Hard);
    let sample = Constraint {
        label: "sample".into(),
        on: On::Samples(vec![(M * M * M, 1.0)]),
        density: 0.0,
        hold: Hold::Hard,
    };
    for (c, expected) in [
        (outside, "constraint far: 12 along axis 1 lies outside"),
        (nan, "constraint nan: density is NaN"),
        (slack, "constraint slack: the stiffness is 0"),
        (nowhere, "constraint nowhere: density of the field is NaN"),
        (sample, "constraint sample names sample 1000"),
    ] {
        let refused = p.set_constraints(&[c]).unwrap_err().to_string();
        assert!(refused.contains(expected), "{refused}");
        assert!(p.constraints().is_empty());
    }
    for (points, spacing) in [
        (vec![], 1.0),
        (vec![[1.0; 3]; 2], 1.0),
        (vec![[1.0; 3], [2.0; 3]], 0.0),
    ] {
        let refused = curve("c", &points, spacing, 0.0, Hold::Hard, field).unwrap_err();
        assert!(matches!(refused, ConstraintError::Curve { .. }), "{refused}");
    }
}

#[test]
fn clay_at_rest_is_held_no_longer() {
    for hold in [Hold::Hard, Hold::Spring(50.0)] {
        let mut p = linear(false);
        p.set_constraints(&[point("pin", [4.0, 4.0, 4.0], 0.7, hold)])
            .unwrap();
        for _ in 0..5 {
            p.step(Integrator::TrBdf2, 0.1).unwrap();
        }
        p.rest_here();
        let d = p.state().d.to_vec();
        assert!(p.constraints().is_empty());
        p.step(Integrator::TrBdf2, 0.1).unwrap();
        assert_eq!(p.state().d, d);
    }
}

#[test]
fn targets_move_without_a_new_factor() {
    for direct_limit in [1000, 50] {
        let mut p = patch::<f64>(6, Rim::Free, true, direct_limit, Law::Linear { scale: SIGMA });
        let with = |shift: f64| {
            let mut all = ring(Hold::Hard);
            all.push(point("spring", [5.2, 4.4, 3.9], -0.8, Hold::Spring(7.0)));
            all.push(point("hard", [3.1, 2.0, 6.4], 1.0, Hold::Hard));
            all.iter_mut().for_each(|c| c.density += shift);
            all
        };
        p.set_constraints(&with(0.0)).unwrap();
        p.step(Integrator::TrBdf2, 0.2).unwrap();
        let made = p.factorizations();
        for step in 1..20 {
            let all = with(0.02 * f64::from(step));
            let mut other = p.clone();
            p.set_constraints(&all).unwrap();
            assert_eq!(p.constraints(), all);
            // The same as constraints made for these targets.
            other.set_constraints(&[]).unwrap();
            other.set_constraints(&all).unwrap();
            for p in [&mut p, &mut other] {
                p.step(Integrator::TrBdf2, 0.2).unwrap();
                let hard = p
                    .constraint_gaps()
                    .zip(&all)
                    .filter(|(_, c)| c.hold == Hold::Hard);
                assert!(hard.map(|(gap, _)| gap.abs()).fold(0.0, f64::max) < 1e-9);
            }
            let apart = p
                .state()
                .p
                .iter()
                .zip(&other.state().p)
                .map(|(a, b)| (a - b).abs());
            let apart = apart.fold(0.0, f64::max);
            assert!(
                apart < if direct_limit == 50 { 3e-3 } else { 1e-9 },
                "{apart:.1e}"
            );
        }
        assert_eq!(p.factorizations(), made);
        let mut wrong = with(0.0);
        wrong[3].density = f64::NAN;
        assert!(p.set_constraints(&wrong).is_err());
        // Rows that follow from others are asked anew whether they agree.
        let twice = |d: f64| {
            [
                point("a", [4.0; 3], 1.0, Hold::Hard),
                point("b", [4.0; 3], d, Hold::Hard),
            ]
        };
        p.set_constraints(&twice(1.0)).unwrap();
        assert!(p.set_constraints(&twice(1.5)).is_err());
    }
}

#[test]
fn constrained_patches_get_the_factor_made_beside_the_steps() {
    let mut p = patch::<f64>(6, Rim::Free, true, 50, Law::Linear { scale: SIGMA });
    let mut direct = patch::<f64>(6, Rim::Free, true, 1000, Law::Linear { scale: SIGMA });
    let mut methods = Vec::new();
    for p in [&mut p, &mut direct] {
        p.set_constraints(&ring(Hold::Hard)).unwrap();
    }
    for _ in 0..12 {
        let report = p.step(Integrator::TrBdf2, 0.2).unwrap();
        direct.step(Integrator::TrBdf2, 0.2).unwrap();
        methods.push((report.solve.method, report.solve.iteration.iterations));
    }
    assert_eq!(methods[0].0, Method::VCycle);
    assert_eq!(methods[11], (Method::Direct, 1), "{methods:?}");
    let apart = p
        .state()
        .p
        .iter()
        .zip(&direct.state().p)
        .map(|(a, b)| (a - b).abs());
    assert!(apart.fold(0.0, f64::max) < 3e-3);
}
