//! Where methods fail: in each scene all values stay finite, no energy comes from nowhere, and the motion is within a
//! factor of two of the one in steps sixteen times as fine.

mod magnitudes;
mod random_scenes;

use dynamics::constraints::{Constraint, Hold, On};
use dynamics::integrators::{AdaptiveOptions, Integrator};
use dynamics::lattice::{Lattice, Rim};
use dynamics::matter::{Matter, Quantity};
use dynamics::patch::{Patch, PatchError};
use dynamics::solve::{Method, SolverOptions};
use dynamics::springs::{Law, Neighbours, Weights};

const LINEAR: Law = Law::Linear { scale: 1.0 };
const FOUR_D: Law = Law::FourD { scale: 1.0 };
/// Steps of the reference for each step of a scene.
const FINE: usize = 16;

/// Samples of a cube as numbers on the axes.
fn each(m: usize, f: impl Fn([f64; 3]) -> f64) -> Vec<f64> {
    let at = |i: usize| [i / (m * m), i / m % m, i % m].map(|k| k as f64);
    (0..m * m * m).map(|i| f(at(i))).collect()
}

/// Density of the half-space that patches here are cut from.
fn slope(m: usize) -> Vec<f64> {
    each(m, |[x, _, _]| 0.47 * m as f64 - x)
}

/// A pull on the middle of a cube of `m` samples, of the unit of force altogether.
fn pull(m: usize) -> Vec<f64> {
    let c = 0.5 * (m - 1) as f64;
    let gauss = each(m, |p| {
        (-p.iter().map(|x| (x - c).powi(2)).sum::<f64>() / (0.02 * (m * m) as f64)).exp()
    });
    let sum: f64 = gauss.iter().sum();
    gauss.iter().map(|g| 20.0 * g / sum).collect()
}

fn damped() -> Matter {
    Matter {
        damping: Quantity::Constant(0.3),
        ..Matter::default()
    }
}

struct Scene {
    matter: Matter,
    law: Law,
    neighbours: Neighbours,
    coefficients: usize,
    samples: usize,
    rim: Rim,
    options: SolverOptions,
    /// Length of the steps, one after the other.
    steps: Vec<f64>,
}

impl Scene {
    /// Few coefficients under a fixed rim: 5³ are free.
    fn small(matter: Matter, law: Law) -> Self {
        Self {
            matter,
            law,
            neighbours: if law == LINEAR {
                Neighbours::Six
            } else {
                Neighbours::Eighteen
            },
            coefficients: 11,
            samples: 12,
            rim: Rim::Fixed,
            options: SolverOptions::default(),
            steps: vec![0.7; 25],
        }
    }

    fn patch(&self) -> Patch<f64> {
        let lattice = Lattice::cube(self.coefficients, self.samples, self.rim, 1.0).unwrap();
        Patch::new(
            lattice,
            self.matter.clone(),
            self.law,
            self.neighbours,
            &slope(self.samples),
            self.options,
        )
        .unwrap()
    }

    /// Largest norm of the motion, in steps of the scene cut into `fine` parts. `before` acts ahead of each step of the
    /// scene, on the number of that step.
    fn follow(
        &self,
        integrator: Integrator,
        fine: usize,
        start: &impl Fn(&mut Patch<f64>),
        before: &impl Fn(&mut Patch<f64>, usize),
    ) -> f64 {
        let mut p = self.patch();
        start(&mut p);
        let from = p.state().d.clone();
        let (mut largest, mut scale) = (0.0_f64, p.energy().total());
        for (step, dt) in self.steps.iter().enumerate() {
            before(&mut p, step);
            for _ in 0..fine {
                let energy = p.energy().total();
                if let Law::FourD { .. } = self.law {
                    adaptive(&mut p, dt / fine as f64);
                } else {
                    let work = p.step(integrator, dt / fine as f64).unwrap().work;
                    let gained = p.energy().total() - energy - work;
                    scale = scale.max(energy + work.abs());
                    assert!(
                        gained <= 1e-6 * scale,
                        "{integrator:?} step {step}: {gained:.2e} gained of {scale:.2e}"
                    );
                }
                assert!(p.state().d.iter().chain(&p.state().w).all(|d| d.is_finite()));
                let moved = p.state().d.iter().zip(&from).map(|(d, f)| (d - f).powi(2));
                largest = largest.max(moved.sum::<f64>().sqrt());
            }
        }
        largest
    }

    fn check(&self, start: impl Fn(&mut Patch<f64>), before: impl Fn(&mut Patch<f64>, usize)) {
        let reference = self.follow(Integrator::TrBdf2, FINE, &start, &before);
        assert!(reference > 1e-3, "the scene moves: {reference}");
        let integrators: &[Integrator] = match self.law {
            Law::Linear { .. } => &[Integrator::Paper, Integrator::TrBdf2],
            Law::FourD { .. } => &[Integrator::TrBdf2],
        };
        for &integrator in integrators {
            let found = self.follow(integrator, 1, &start, &before);
            let ratio = found / reference;
            println!("{integrator:?}: {found:.4} of {reference:.4}");
            assert!(
                (0.5..2.0).contains(&ratio),
                "{integrator:?}: {found} of {reference}"
            );
        }
    }
}

/// Adaptive steps over the time `dt`. None creates more than a hundredth of its energy.
fn adaptive(p: &mut Patch<f64>, dt: f64) {
    let options = AdaptiveOptions {
        tolerance: 0.02,
        shortest: 1e-5 * dt,
        longest: dt,
        energy_gain: 0.01,
        acceleration: None,
    };
    let (mut time, mut next) = (0.0, dt);
    while time < dt * (1.0 - 1e-9) {
        let left = dt - time;
        let before = p.energy().total();
        let report = p
            .adaptive_step(
                next.min(left),
                &AdaptiveOptions {
                    longest: left,
                    shortest: options.shortest.min(left),
                    ..options
                },
            )
            .unwrap();
        time += report.step.dt;
        next = report.next_dt;
        let (after, work) = (p.energy().total(), report.step.work);
        let gained = (after - before - work) / before.max(after).max(work.abs());
        assert!(gained <= 0.01, "{gained:.3} gained in {:.1e} s", report.step.dt);
    }
}

fn pulled(p: &mut Patch<f64>) {
    let m = p.lattice().sample_dims()[0];
    p.set_force(&pull(m)).unwrap();
}

fn nothing(_: &mut Patch<f64>, _: usize) {}

/// `matter` with the stiffness `value` where `inside` holds, on `m` samples an axis.
fn painted(m: usize, value: f64, inside: impl Fn([f64; 3]) -> bool) -> Matter {
    Matter {
        stiffness: Quantity::PerSample(each(m, |p| if inside(p) { value } else { 1.0 })),
        ..damped()
    }
}

fn ball(m: usize) -> impl Fn([f64; 3]) -> bool {
    move |p| p.iter().map(|x| (x / (m - 1) as f64 - 0.42).powi(2)).sum::<f64>() < 0.06
}

#[test]
fn flattened_four_d_springs() {
    // Flat, and resting on a slope: every tangent along it is negative.
    let scene = Scene::small(damped(), FOUR_D);
    let flatten = |p: &mut Patch<f64>| {
        let steep: Vec<f64> = each(12, |[x, y, _]| 3.0 * (0.7 * x).sin() + y);
        let rest: Vec<f64> = slope(12).iter().zip(&steep).map(|(a, b)| a + b).collect();
        p.springs_mut().rest_at(&rest);
    };
    scene.check(flatten, nothing);
}

#[test]
fn inverted_four_d_springs() {
    let scene = Scene::small(damped(), FOUR_D);
    let invert = |p: &mut Patch<f64>| {
        let rest: Vec<f64> = slope(12).iter().map(|d| -d).collect();
        p.springs_mut().rest_at(&rest);
        pulled(p);
    };
    scene.check(invert, nothing);
}

#[test]
fn a_homogeneous_region_without_tangent() {
    // All densities equal: no 4-D spring has a tangent, only its stretch resists.
    let scene = Scene::small(damped(), FOUR_D);
    let flat = |p: &mut Patch<f64>| {
        *p = Patch::new(
            p.lattice().clone(),
            damped(),
            FOUR_D,
            Neighbours::Eighteen,
            &[0.3; 12 * 12 * 12],
            SolverOptions::default(),
        )
        .unwrap();
        pulled(p);
    };
    scene.check(flat, nothing);
}

#[test]
fn a_longer_rest_length_at_the_flat_state() {
    // Compressed springs on a hill that is nearly flat: the way they buckle is that of their rest.
    let scene = Scene::small(damped(), FOUR_D);
    let buckle = |p: &mut Patch<f64>| {
        let d = each(12, |p| {
            1e-3 * (-0.1 * p.iter().map(|x| (x - 5.2).powi(2)).sum::<f64>()).exp()
        });
        *p = Patch::new(
            p.lattice().clone(),
            damped(),
            FOUR_D,
            Neighbours::Eighteen,
            &d,
            SolverOptions::default(),
        )
        .unwrap();
        p.springs_mut().rest_mut().scale = Weights::Constant(1.5);
    };
    scene.check(buckle, nothing);
}

#[test]
fn a_stiffness_contrast_of_a_million() {
    Scene::small(painted(12, 1e6, ball(12)), LINEAR).check(pulled, nothing);
    // The V-cycle too.
    let scene = Scene {
        coefficients: 8,
        rim: Rim::Free,
        options: SolverOptions {
            direct_limit: 100,
            ..SolverOptions::default()
        },
        ..Scene::small(painted(12, 1e6, ball(12)), LINEAR)
    };
    scene.check(pulled, nothing);
}

#[test]
fn a_mass_contrast_of_ten_thousand() {
    let mut matter = damped();
    matter.mass = Quantity::PerSample(each(12, |p| if ball(12)(p) { 1e4 } else { 1.0 }));
    // Long enough for the heavy part to move.
    let steps = vec![4.0; 40];
    for (coefficients, rim, direct_limit) in [(11, Rim::Fixed, 1000), (8, Rim::Free, 100)] {
        let scene = Scene {
            coefficients,
            rim,
            steps: steps.clone(),
            options: SolverOptions {
                direct_limit,
                ..SolverOptions::default()
            },
            ..Scene::small(matter.clone(), LINEAR)
        };
        scene.check(pulled, nothing);
    }
}

#[test]
fn as_many_coefficients_as_samples() {
    for (m, steps) in [(15, 12), (32, 2)] {
        let scene = Scene {
            coefficients: m,
            samples: m,
            rim: Rim::Free,
            steps: vec![0.7; steps],
            ..Scene::small(painted(m, 100.0, ball(m)), LINEAR)
        };
        let mut p = scene.patch();
        p.step(Integrator::TrBdf2, 0.1).unwrap();
        assert_eq!(
            p.step(Integrator::TrBdf2, 0.1).unwrap().solve.method,
            if m == 15 {
                Method::SampleDirect
            } else {
                Method::SampleMultigrid
            }
        );
        scene.check(pulled, nothing);
    }
}

#[test]
fn material_one_sample_thick() {
    Scene::small(painted(12, 1e4, |[x, _, _]| x == 5.0), LINEAR).check(pulled, nothing);
    let soft = painted(12, 1e-4, |[x, _, _]| x == 5.0);
    Scene::small(soft, LINEAR).check(pulled, nothing);
}

#[test]
fn a_force_switched_on_and_off_every_step() {
    let switch = |p: &mut Patch<f64>, step: usize| {
        let m = p.lattice().sample_dims()[0];
        let force = if step.is_multiple_of(2) {
            pull(m)
        } else {
            vec![0.0; m * m * m]
        };
        p.set_force(&force).unwrap();
    };
    Scene::small(painted(12, 100.0, ball(12)), LINEAR).check(|_| (), switch);
    Scene::small(damped(), FOUR_D).check(|_| (), switch);
}

#[test]
fn halved_and_doubled_steps_every_other_step() {
    let steps = (0..30).map(|i| 0.6 * [1.0, 0.5, 1.0, 2.0][i % 4]);
    let steps: Vec<f64> = steps.collect();
    for law in [LINEAR, FOUR_D] {
        let scene = Scene {
            steps: steps.clone(),
            ..Scene::small(painted(12, 100.0, ball(12)), law)
        };
        scene.check(pulled, nothing);
    }
}

#[test]
fn painting_stiffness_while_it_moves() {
    let stroke = |p: &mut Patch<f64>, step: usize| {
        let mut matter = p.matter().clone();
        for (i, k) in matter.stiffness.paint(12 * 12 * 12).iter_mut().enumerate() {
            if i % 30 == step {
                *k = if step.is_multiple_of(2) { 1e4 } else { 0.1 };
            }
        }
        p.set_matter(matter).unwrap();
    };
    Scene::small(damped(), LINEAR).check(pulled, stroke);
    Scene::small(damped(), FOUR_D).check(pulled, stroke);
}

fn hard(label: &str, at: [f64; 3], density: f64) -> Constraint {
    Constraint {
        label: label.into(),
        on: On::Point {
            at,
            field: 0.47 * 12.0 - at[0],
        },
        density,
        hold: Hold::Hard,
    }
}

#[test]
fn inconsistent_and_redundant_hard_constraints() {
    let place = [4.0, 5.0, 6.0];
    let list = |p: &mut Patch<f64>| {
        pulled(p);
        let twice = [
            hard("a", place, 1.64),
            hard("b", place, 1.64),
            hard("c", [7.0, 5.0, 5.0], -1.36),
        ];
        p.set_constraints(&twice).unwrap();
    };
    let contradict = |p: &mut Patch<f64>, _: usize| {
        // Asked for and refused ahead of every step: nothing may come of it.
        let before = p.state().clone();
        let refused = p.set_constraints(&[hard("a", place, 1.0), hard("b", place, 2.0)]);
        assert!(matches!(refused, Err(PatchError::Constraint(_))));
        assert_eq!(*p.state(), before);
    };
    let scene = Scene::small(painted(12, 100.0, ball(12)), LINEAR);
    scene.check(list, contradict);
    // Twice the same constraint is once.
    let once = |p: &mut Patch<f64>| {
        pulled(p);
        p.set_constraints(&[hard("a", place, 1.64), hard("c", [7.0, 5.0, 5.0], -1.36)])
            .unwrap();
    };
    let [a, b] = [
        scene.follow(Integrator::TrBdf2, 1, &list, &contradict),
        scene.follow(Integrator::TrBdf2, 1, &once, &nothing),
    ];
    assert!((a - b).abs() < 1e-9 * b, "{a} {b}");
}

#[test]
fn a_free_patch_without_anchor() {
    let scene = Scene {
        coefficients: 8,
        rim: Rim::Free,
        ..Scene::small(
            Matter {
                damping: Quantity::Constant(0.0),
                ..painted(12, 100.0, ball(12))
            },
            LINEAR,
        )
    };
    scene.check(pulled, nothing);
    // The mean drifts as the force says, for ever: ½(F/M)t².
    let mut p = scene.patch();
    pulled(&mut p);
    for dt in &scene.steps {
        p.step(Integrator::TrBdf2, *dt).unwrap();
    }
    let count = (12 * 12 * 12) as f64;
    let mean: f64 = p
        .state()
        .d
        .iter()
        .zip(&slope(12))
        .map(|(d, f)| d - f)
        .sum::<f64>()
        / count;
    let time: f64 = scene.steps.iter().sum();
    let expected = 0.5 * 20.0 / count * time * time;
    assert!((mean / expected - 1.0).abs() < 1e-6, "{mean} {expected}");
}

#[test]
fn a_nan_in_the_force_is_refused_and_the_motion_goes_on() {
    let poison = |p: &mut Patch<f64>, _: usize| {
        let mut force = pull(12);
        force[77] = f64::NAN;
        let before = p.state().clone();
        let refused = p.set_force(&force).unwrap_err();
        assert!(
            matches!(refused, PatchError::NotFinite { index: 77, .. }),
            "{refused}"
        );
        assert_eq!(*p.state(), before);
    };
    let scene = Scene::small(damped(), LINEAR);
    scene.check(pulled, poison);
    let [a, b] = [
        scene.follow(Integrator::TrBdf2, 1, &pulled, &poison),
        scene.follow(Integrator::TrBdf2, 1, &pulled, &nothing),
    ];
    assert_eq!(a, b);
}

#[test]
fn an_explicit_step_of_ten_times_the_bound_is_refused_or_cut() {
    // Painted beyond the direct limit, where an implicit step is dear.
    let m = 12;
    let mut scene = Scene {
        coefficients: m,
        rim: Rim::Free,
        options: SolverOptions {
            direct_limit: 100,
            ..SolverOptions::default()
        },
        ..Scene::small(
            Matter {
                damping: Quantity::Constant(0.0),
                ..painted(m, 10.0, ball(m))
            },
            LINEAR,
        )
    };
    let mut p = scene.patch();
    let dt = 10.0 * p.explicit_limit().unwrap();
    for integrator in [Integrator::Symplectic, Integrator::Verlet] {
        let before = p.state().clone();
        let refused = p.step(integrator, dt).unwrap_err();
        assert!(matches!(refused, PatchError::Unstable { .. }), "{refused}");
        assert_eq!(*p.state(), before);
    }
    let report = p.step(Integrator::Auto, dt).unwrap();
    assert_eq!(report.integrator, Integrator::Verlet);
    assert!((11..=12).contains(&report.substeps), "{}", report.substeps);
    // Explicit sub-steps keep an energy near the true one, not the energy: the motion is what is asked for.
    scene.steps = vec![dt; 12];
    let run = |integrator: Integrator, fine: usize| {
        let mut p = scene.patch();
        pulled(&mut p);
        let mut largest = 0.0_f64;
        let mut worst = f64::NEG_INFINITY;
        let mut scale = 0.0_f64;
        for _ in 0..scene.steps.len() * fine {
            let before = p.energy().total();
            let work = p.step(integrator, dt / fine as f64).unwrap().work;
            let gained = p.energy().total() - before - work;
            scale = scale.max(before + work.abs());
            worst = worst.max(gained / scale);
            assert!(p.state().d.iter().chain(&p.state().w).all(|d| d.is_finite()));
            let from = slope(m);
            let moved = p.state().d.iter().zip(&from).map(|(d, f)| (d - f).powi(2));
            largest = largest.max(moved.sum::<f64>().sqrt());
        }
        (largest, worst)
    };
    let ((found, gained), (reference, _)) = (run(Integrator::Auto, 1), run(Integrator::TrBdf2, FINE));
    println!("cut: {found:.4} of {reference:.4}, {gained:.1e} gained");
    assert!(
        (0.5..2.0).contains(&(found / reference)),
        "{found} of {reference}"
    );
    assert!(gained < 0.02, "{gained}");
}
