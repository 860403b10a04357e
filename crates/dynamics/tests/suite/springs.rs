//! Laws of density springs: forces from energies, tangents from forces, what is conserved.

use dynamics::lattice::{Lattice, Rim};
use dynamics::matter::{Matter, Quantity};
use dynamics::springs::{Law, Neighbours, SpringNetwork, SpringWeights, StepMatrix, Weights};

const M: usize = 6;
const LAWS: [Law; 2] = [Law::Linear { scale: 0.7 }, Law::FourD { scale: 0.7 }];
const ALL: [Neighbours; 3] = [Neighbours::Six, Neighbours::Eighteen, Neighbours::TwentySix];

fn noise(seed: usize) -> Vec<f64> {
    (0..M * M * M)
        .map(|i| (1.3 * (i * 7 + seed * 131) as f64).sin() + 0.4 * (0.37 * i as f64).cos())
        .collect()
}

fn painted() -> Matter {
    let stiffness = (0..M * M * M).map(|i| 0.5 + (i % 7) as f64).collect();
    Matter {
        stiffness: Quantity::PerSample(stiffness),
        ..Matter::default()
    }
}

fn network(law: Law, neighbours: Neighbours, rest: &[f64]) -> SpringNetwork<f64> {
    let lattice = Lattice::<f64>::cube(5, M, Rim::Free, 0.8).unwrap();
    let lumped = painted().lumped(&lattice, neighbours).unwrap();
    SpringNetwork::new([M; 3], [0.8; 3], law, lumped.springs, rest)
}

fn force(n: &mut SpringNetwork<f64>, d: &[f64]) -> (f64, Vec<f64>) {
    let mut f = vec![0.0; d.len()];
    let report = n.add_forces(d, &mut f);
    (report.energy, f)
}

#[test]
fn force_is_minus_the_gradient_of_energy() {
    for law in LAWS {
        for neighbours in ALL {
            let mut n = network(law, neighbours, &noise(1));
            n.rest_mut().scale = Weights::Each((0..M * M * M).map(|i| 0.8 + 0.1 * (i % 5) as f64).collect());
            let d = noise(2);
            let (_, f) = force(&mut n, &d);
            for i in [0, 5, 43, 100, 111, 215] {
                let at = |e: f64| {
                    let mut d = d.clone();
                    d[i] += e;
                    d
                };
                let step = 1e-5;
                let slope = (force(&mut n, &at(step)).0 - force(&mut n, &at(-step)).0) / (2.0 * step);
                assert!(
                    (slope + f[i]).abs() < 1e-7,
                    "{law:?} {neighbours:?} {i}: {slope} {}",
                    -f[i]
                );
            }
        }
    }
}

#[test]
fn tangent_is_the_difference_of_forces_where_it_is_not_clamped() {
    for law in LAWS {
        for neighbours in ALL {
            // Steeper than at rest, so that no spring is flattened.
            let rest = noise(3);
            let d: Vec<f64> = rest.iter().map(|v| 1.3 * v).collect();
            let mut n = network(law, neighbours, &rest);
            let mut f = vec![0.0; d.len()];
            let mut tangent: Vec<SpringWeights<f64>> = n.springs().to_vec();
            for t in &mut tangent {
                t.weights = Weights::Each(vec![0.0; d.len()]);
            }
            let report = n.add_forces_and_tangent(&d, &mut f, 1.0, &mut tangent);
            assert_eq!(report.clamped, 0);
            let matrix = StepMatrix::new([M; 3], Weights::Constant(0.0), tangent);
            let direction = noise(4);
            let mut expected = vec![0.0; d.len()];
            matrix.apply(&direction, &mut expected);
            let step = 1e-6;
            let at = |e: f64| {
                d.iter()
                    .zip(&direction)
                    .map(|(d, v)| d + e * v)
                    .collect::<Vec<_>>()
            };
            let (plus, minus) = (force(&mut n, &at(step)).1, force(&mut n, &at(-step)).1);
            let largest = expected.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            for i in 0..d.len() {
                let found = (minus[i] - plus[i]) / (2.0 * step);
                assert!(
                    (found - expected[i]).abs() < 1e-7 * largest,
                    "{law:?} {i}: {found} {}",
                    expected[i]
                );
            }
        }
    }
}

#[test]
fn internal_forces_have_no_resultant_and_none_at_rest() {
    for law in LAWS {
        for neighbours in ALL {
            let mut n = network(law, neighbours, &noise(5));
            let (energy, f) = force(&mut n, &noise(5));
            assert_eq!(energy, 0.0);
            assert!(f.iter().all(|f| *f == 0.0), "exactly none at rest");
            let (_, f) = force(&mut n, &noise(6));
            let size: f64 = f.iter().map(|f| f.abs()).sum();
            assert!(f.iter().sum::<f64>().abs() < 1e-14 * size);
        }
    }
}

#[test]
fn flattened_four_d_springs_are_clamped_and_counted() {
    let rest: Vec<f64> = (0..M * M * M).map(|i| (i / (M * M)) as f64).collect();
    let mut n = network(Law::FourD { scale: 0.8 }, Neighbours::Six, &rest);
    let flat = vec![0.0; rest.len()];
    let mut f = flat.clone();
    let mut tangent = n.springs().to_vec();
    for t in &mut tangent {
        t.weights = Weights::Each(flat.clone());
    }
    let report = n.add_forces_and_tangent(&flat, &mut f, 1.0, &mut tangent);
    // Springs along x rest at one to one and are flat: τ = 1 - √2. The others rest flat: τ = 0.
    assert_eq!(report.clamped, (M - 1) * M * M);
    let Weights::Each(w) = &tangent[0].weights else {
        unreachable!()
    };
    assert!(w.iter().all(|w| *w == 0.0));
    // The law gives no force at the flat state; the orientation of the rest state does.
    assert!(
        f[0] < 0.0 && f[M * M * M - 1] > 0.0,
        "pushed back the way they rest"
    );
}

#[test]
fn stencils_are_the_assembled_springs() {
    for neighbours in ALL {
        let lattice = Lattice::<f64>::cube(5, M, Rim::Free, 0.8).unwrap();
        let lumped = painted().lumped(&lattice, neighbours).unwrap();
        let mass: Vec<f64> = (0..M * M * M).map(|i| 1.0 + (i % 3) as f64).collect();
        let matrix = StepMatrix::new([M; 3], Weights::Each(mass.clone()), lumped.springs);
        let d = noise(7);
        let mut expected: Vec<f64> = d.iter().zip(&mass).map(|(d, m)| d * m).collect();
        matrix.for_each_spring(|i, j, w, _| {
            expected[i] += w * (d[i] - d[j]);
            expected[j] += w * (d[j] - d[i]);
        });
        let mut found = vec![0.0; d.len()];
        matrix.apply(&d, &mut found);
        for (f, e) in found.iter().zip(&expected) {
            assert!((f - e).abs() < 1e-12 * (1.0 + e.abs()), "{neighbours:?}: {f} {e}");
        }
    }
}

#[test]
fn stiffness_of_a_spring_is_the_harmonic_mean_of_its_ends() {
    let lattice = Lattice::<f64>::cube(5, M, Rim::Free, 0.5).unwrap();
    let mut matter = Matter::default();
    matter.stiffness.paint(M * M * M)[1] = 3.0;
    let lumped = matter.lumped(&lattice, Neighbours::Six).unwrap();
    // κh with κ = 2·1·3/(1+3).
    assert!((lumped.springs[2].weights.at(0) - 1.5 * 0.5).abs() < 1e-15);
    assert!((lumped.springs[2].weights.at(3) - 0.5).abs() < 1e-15);
    matter.mass = Quantity::Constant(f64::NAN);
    assert!(
        matter
            .lumped(&lattice, Neighbours::Six)
            .unwrap_err()
            .to_string()
            .contains("mass is NaN")
    );
}
