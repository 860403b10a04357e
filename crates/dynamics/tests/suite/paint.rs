//! Paint on a box, while it moves: the same matter, no factor a dab, and increments as right as ever.

use bspline::Real;
use dynamics::integrators::Integrator;
use dynamics::lattice::{Lattice, OnBox, Rim, SampleBox};
use dynamics::matter::Matter;
use dynamics::paint::Substance;
use dynamics::patch::{Patch, PatchError};
use dynamics::solve::SolverOptions;
use dynamics::springs::{Law, Neighbours};

use crate::region::Random;

fn patch<T: Real>(m: usize, n: usize, neighbours: Neighbours, direct_limit: usize) -> Patch<T> {
    let lattice = Lattice::<T>::cube(n, m, Rim::Fixed, 0.5).unwrap();
    let d: Vec<T> = (0..m * m * m)
        .map(|i| T::from_f64(0.4 * (i / m / m) as f64))
        .collect();
    let options = SolverOptions {
        direct_limit,
        ..SolverOptions::default()
    };
    let law = Law::Linear { scale: 1.0 };
    Patch::new(lattice, Matter::default(), law, neighbours, &d, options).unwrap()
}

#[test]
fn painting_a_box_is_setting_the_matter() {
    for neighbours in [Neighbours::Six, Neighbours::Eighteen] {
        let mut a = patch::<f32>(11, 9, neighbours, 1000);
        let mut b = a.clone();
        let mut random = Random(4);
        let force: Vec<f32> = (0..11 * 11 * 11).map(|_| random.unit() as f32 - 0.3).collect();
        for p in [&mut a, &mut b] {
            p.set_force(&force).unwrap();
        }
        for dab in 0..60 {
            let first = [0; 3].map(|_| (random.unit() * 10.0) as usize);
            let count = first.map(|f| 1 + (random.unit() * (10 - f) as f64) as usize);
            let at = SampleBox { first, count };
            let substances = [Substance::Mass, Substance::Damping, Substance::Ground];
            let substance = *substances.get(dab % 8).unwrap_or(&Substance::Stiffness);
            let largest = 10f64.powf(6.0 * random.unit() - 3.0);
            let least = if substance == Substance::Mass { 0.1 } else { 0.0 };
            let values: Vec<f64> = (0..at.len()).map(|_| least + largest * random.unit()).collect();
            a.paint(substance, OnBox { at, values: &values }).unwrap();
            let mut matter = b.matter().clone();
            let quantity = match substance {
                Substance::Stiffness => &mut matter.stiffness,
                Substance::Mass => &mut matter.mass,
                Substance::Damping => &mut matter.damping,
                Substance::Ground => &mut matter.ground,
            };
            let list = quantity.paint(11 * 11 * 11);
            at.indices([11; 3]).zip(&values).for_each(|(i, v)| list[i] = *v);
            b.set_matter(matter).unwrap();
            assert_eq!(a.matter(), b.matter());
            assert_eq!(a.springs().stiffness_unit(), b.springs().stiffness_unit());
            assert!(
                a.springs().springs() == b.springs().springs(),
                "{neighbours:?} dab {dab}"
            );
            let dt = 0.3 * a.explicit_limit().unwrap().min(1.0);
            assert_eq!(b.explicit_limit().unwrap(), a.explicit_limit().unwrap());
            for p in [&mut a, &mut b] {
                p.step(Integrator::Verlet, dt).unwrap();
            }
            assert_eq!(a.state(), b.state());
        }
        let wrong = OnBox {
            at: SampleBox {
                first: [0; 3],
                count: [1; 3],
            },
            values: &[-1.0],
        };
        let before = a.matter().clone();
        assert!(matches!(
            a.paint(Substance::Stiffness, wrong),
            Err(PatchError::Matter(_))
        ));
        let outside = OnBox {
            at: SampleBox {
                first: [11, 0, 0],
                count: [1; 3],
            },
            ..wrong
        };
        assert!(matches!(
            a.paint(Substance::Mass, outside),
            Err(PatchError::Box { .. })
        ));
        assert_eq!(a.matter(), &before);
    }
}

/// A brush that stiffens up to `contrast` along a stroke, a dab a step: the worst error of an increment, the most
/// iterations of a solve, the mean of them, and factors made.
fn stroke(m: usize, n: usize, direct_limit: usize, contrast: f64, dabs: usize) -> (f64, usize, f64, usize) {
    let mut p = patch::<f32>(m, n, Neighbours::Six, direct_limit);
    let length = 0.5 * (m - 1) as f64;
    let (at, kernel) = p.lattice().gaussian([0.5 * length; 3], 1.0);
    let values: Vec<f32> = kernel.iter().map(|k| 3.0 * *k as f32).collect();
    p.set_force_on(OnBox { at, values: &values }).unwrap();
    // Thirty times the explicit limit of unit matter.
    let dt = 30.0 * p.explicit_limit().unwrap();
    let radius = 1.5;
    let mut stiffness = vec![1.0_f64; m * m * m];
    let (mut worst, mut most, mut sum) = (0.0_f64, 0, 0);
    for dab in 0..dabs {
        let t = dab as f64 / dabs as f64;
        let centre = [0.2 + 0.6 * t, 0.5, 0.4 + 0.2 * t].map(|q| q * length);
        let near = p.lattice().samples_near(centre, radius);
        let dims = p.lattice().sample_dims();
        let values: Vec<f64> = near
            .indices(dims)
            .map(|i| {
                let q = p.lattice().sample_place([i / m / m, i / m % m, i % m]);
                let apart = (0..3).map(|a| (q[a] - centre[a]).powi(2)).sum::<f64>().sqrt();
                let fall = (1.0 - apart / radius).max(0.0);
                stiffness[i] = stiffness[i].max(1.0 + (contrast - 1.0) * fall);
                stiffness[i]
            })
            .collect();
        p.paint(
            Substance::Stiffness,
            OnBox {
                at: near,
                values: &values,
            },
        )
        .unwrap();
        let mut exact = p.clone();
        exact.set_matter(p.matter().clone()).unwrap();
        let before = p.state().d.clone();
        let report = p.step(Integrator::Paper, dt).unwrap();
        most = most.max(report.solve.iteration.iterations);
        sum += report.solve.iteration.iterations;
        if dab % 5 == 4 {
            exact.step(Integrator::Paper, dt).unwrap();
            let increment = |p: &Patch<f32>| {
                p.state()
                    .d
                    .iter()
                    .zip(&before)
                    .map(|(a, b)| f64::from(a - b))
                    .collect::<Vec<_>>()
            };
            let (a, b) = (increment(&p), increment(&exact));
            let apart: f64 = a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum();
            worst = worst.max((apart / b.iter().map(|b| b * b).sum::<f64>()).sqrt());
        }
    }
    (worst, most, sum as f64 / dabs as f64, p.factorizations())
}

#[test]
fn a_dab_costs_no_factor() {
    for (m, n, limit) in [(20, 15, 1000), (14, 13, 200)] {
        // The bars are those of steps without paint.
        for (contrast, bar) in [(10.0, 3e-3), (100.0, 3e-3), (1e3, 1e-2)] {
            let (worst, most, mean, made) = stroke(m, n, limit, contrast, 60);
            println!(
                "{m}/{n} {limit} {contrast}: error {worst:.1e}, iterations {mean:.1} {most}, {made} made"
            );
            assert!(worst < bar, "{m}/{n} {contrast}: {worst:.1e}");
            assert!(
                made <= 30 && mean < 8.0,
                "{m}/{n} {contrast}: {made} made, {mean} iterations"
            );
        }
    }
}
