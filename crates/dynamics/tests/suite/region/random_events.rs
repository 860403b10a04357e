//! Regions under random events: forces, paint, constraints, sleep, parts and letting go, one after the other by chance.

use bspline::Real;
use dynamics::constraints::{Constraint, Hold, On};
use dynamics::integrators::{AdaptiveOptions, Integrator};
use dynamics::lattice::{OnBox, SampleBox};
use dynamics::matter::Quantity;
use dynamics::paint::Substance;
use dynamics::region::{Cells, Region, RegionOptions, RegionSnapshot};
use dynamics::solve::SolverOptions;
use dynamics::springs::{Law, Neighbours, Plasticity};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{Random, damped, field, push, state_bits};

/// The region after its snapshot was written down and read again.
fn written<T: Real + Serialize + DeserializeOwned>(region: &Region<T>) -> Result<Region<T>, String> {
    let text = serde_json::to_string(&region.snapshot()).map_err(|e| e.to_string())?;
    let snapshot: RegionSnapshot<T> = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    Region::restore(&snapshot).map_err(|e| e.to_string())
}

/// What is left of a region after forty events, `restored` before each of them or not; an error tells which event went
/// wrong.
fn play<T: Real + Serialize + DeserializeOwned>(seed: u64, restored: bool) -> Result<Vec<u64>, String> {
    let mut random = Random(seed.wrapping_mul(0x5851_f42d_4c95_7f2d));
    let mut r = || random.unit();
    let mut onto = field::<T>(2);
    let cells = Cells {
        level: 1,
        first: [0; 3],
        count: [24, 6 + (r() * 4.0) as u32, 6 + (r() * 4.0) as u32],
    };
    let scale = 1.0;
    let law = if r() < 0.3 {
        Law::FourD { scale }
    } else {
        Law::Linear { scale }
    };
    let options = RegionOptions {
        law,
        neighbours: if r() < 0.3 {
            Neighbours::Eighteen
        } else {
            Neighbours::Six
        },
        samples_per_cell: [if r() < 0.5 { 4.0 / 3.0 } else { 2.0 }; 3],
        solver: SolverOptions {
            // Every third has its factors made beside the steps.
            direct_limit: if seed.is_multiple_of(3) { 100 } else { 1000 },
            ..SolverOptions::default()
        },
        ..RegionOptions::of(&onto, 1)
    };
    let Ok(mut region) = Region::new(&onto, cells, damped(), &options) else {
        return Ok(Vec::new());
    };
    let dims = region.patch().lattice().sample_dims();
    let count = dims.iter().product::<usize>();
    let mut told = String::new();
    for event in 0..40 {
        if restored {
            region = written(&region)?;
        }
        let wrong = |what: &str, told: &str| Err(format!("{law:?} event {event}: {what}; {told}"));
        let kind = (r() * 16.0) as usize;
        told.push_str(&format!("{kind} "));
        match kind {
            0 => region.set_parts_sleep(r() < 0.8),
            1 => {
                let size = r() - 0.3;
                let force = push(&region, size);
                region.set_force(&force).map_err(|e| e.to_string())?;
            }
            2 | 3 => {
                let (at, size) = (r() * dims[0] as f64, 2.0 * r());
                let force: Vec<T> = (0..count)
                    .map(|i| {
                        let x = (i / (dims[1] * dims[2])) as f64 - at;
                        T::from_f64(size * (-0.5 * x * x).exp())
                    })
                    .collect();
                region.set_force(&force).map_err(|e| e.to_string())?;
            }
            4 => region.release_elastic(),
            5 => onto = region.release_clay(&onto).map_err(|e| e.to_string())?,
            6 => {
                let mut matter = region.patch().matter().clone();
                let (contrast, which) = (10f64.powf(4.0 * r() - 2.0), 1 + (r() * 9.0) as usize);
                let stiffness = matter.stiffness.paint(count).iter_mut();
                stiffness.step_by(which).for_each(|k| *k = contrast);
                matter.ground = Quantity::Constant(if r() < 0.3 { 0.1 } else { 0.0 });
                region.patch_mut().set_matter(matter).map_err(|e| e.to_string())?;
            }
            7 => {
                let sample = (r() * count as f64) as usize;
                let constraint = Constraint {
                    label: "one".into(),
                    on: On::Samples(vec![(sample, 1.0)]),
                    density: region.patch().state().d[sample].as_f64() + r() - 0.5,
                    hold: if r() < 0.5 {
                        Hold::Hard
                    } else {
                        Hold::Spring(10.0 * r() + 1e-3)
                    },
                };
                // At the rim it may be refused; the old ones then stay.
                let _ = region.patch_mut().set_constraints(&[constraint]);
            }
            8 => region
                .patch_mut()
                .set_constraints(&[])
                .map_err(|e| e.to_string())?,
            9 => {
                let rate = if r() < 0.5 { 0.0 } else { 3.0 * r() };
                let set = region.patch_mut().set_plasticity(Plasticity::Clay { rate });
                set.map_err(|e| e.to_string())?;
            }
            10 => region.wake(),
            11 | 12 => {
                let first = dims.map(|m| (r() * (m - 1) as f64) as usize);
                let count = [0, 1, 2].map(|a| 1 + (r() * (dims[a] - first[a]) as f64 * 0.6) as usize);
                let at = SampleBox { first, count };
                let value = 10f64.powf(3.0 * r() - 1.0);
                let values = vec![value; at.len()];
                let substance = if r() < 0.8 {
                    Substance::Stiffness
                } else {
                    Substance::Damping
                };
                let paint = OnBox { at, values: &values };
                region.paint(substance, paint).map_err(|e| e.to_string())?;
            }
            _ => (),
        }
        let asleep = region.is_asleep().then(|| state_bits(&region));
        let dt = 10f64.powf(2.0 * r() - 1.5);
        for _ in 0..1 + (r() * 6.0) as usize {
            let adaptive = AdaptiveOptions {
                tolerance: 1e-2,
                shortest: 1e-4 * dt,
                longest: dt,
                energy_gain: 0.01,
                acceleration: None,
            };
            let done = match kind % 3 {
                0 => region.adaptive_step(dt, &adaptive).map(|s| s.is_some()),
                1 => region.step(Integrator::Paper, dt).map(|s| s.is_some()),
                _ => region.step(Integrator::TrBdf2, dt).map(|s| s.is_some()),
            };
            match done {
                Err(e) => return wrong(&e.to_string(), &told),
                Ok(moved) if moved && asleep.is_some() => return wrong("moved in its sleep", &told),
                Ok(_) => (),
            }
        }
        if asleep.is_some_and(|bits| bits != state_bits(&region)) {
            return wrong("sleep changed bits", &told);
        }
        let state = region.patch().state();
        let lists = [&state.p, &state.v, &state.d, &state.w];
        if !lists.iter().all(|l| l.iter().all(|v| v.is_finite())) {
            return wrong("not finite", &told);
        }
        // The field is about 12 at most, and no push lifts it by more than some tens.
        let largest = state.d.iter().fold(0.0_f64, |m, d| m.max(d.as_f64().abs()));
        if largest > 1e4 || region.awake_samples() > count {
            return wrong(
                &format!("density {largest:.1e}, {} awake", region.awake_samples()),
                &told,
            );
        }
    }
    region.bake(&onto).map_err(|e| e.to_string())?;
    Ok(state_bits(&region))
}

fn failures(seeds: std::ops::Range<u64>) -> Vec<String> {
    use rayon::prelude::*;
    let run = |seed: u64, restored: bool| {
        if seed.is_multiple_of(2) {
            play::<f32>(seed, restored)
        } else {
            play::<f64>(seed, restored)
        }
    };
    let seeds: Vec<u64> = seeds.collect();
    let pool = |threads| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
    };
    let all = |threads, restored| {
        let play = || seeds.par_iter().map(|s| run(*s, restored)).collect::<Vec<_>>();
        pool(threads).install(play)
    };
    let (one, eight) = (all(1, false), all(8, true));
    let outcomes = seeds.iter().zip(one.iter().zip(&eight));
    let wrong = outcomes.filter_map(|(seed, (a, b))| match a {
        Err(e) => Some(format!("{seed}: {e}")),
        Ok(_) if a != b => Some(format!(
            "{seed}: other bits on eight threads, restored before each event"
        )),
        Ok(_) => None,
    });
    wrong.collect()
}

#[test]
fn random_events_leave_regions_finite_and_sleep_alone() {
    let wrong = failures(0..12);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
#[ignore = "minutes"]
fn many_random_events() {
    let wrong = failures(100..700);
    assert!(wrong.is_empty(), "{} wrong\n{}", wrong.len(), wrong.join("\n"));
}
