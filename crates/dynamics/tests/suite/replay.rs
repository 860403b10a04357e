//! The contract of bits: what is kept equals what is cut anew, what is restored goes on, and hashes are those recorded.

use bspline::HierarchicalSpline;
use dynamics::constraints::{Constraint, Hold, On};
use dynamics::integrators::Integrator;
use dynamics::lattice::{Lattice, OnBox, Rim, SampleBox};
use dynamics::matter::{Matter, Quantity};
use dynamics::paint::Substance;
use dynamics::patch::Patch;
use dynamics::region::{Cells, Region, RegionOptions, RegionSnapshot, Schedule, Turn};
use dynamics::solve::{Method, SolverOptions};
use dynamics::sparse::{Mask, MaskedWay};
use dynamics::springs::{Law, Neighbours, Plasticity};
use sha2::{Digest, Sha256};

use crate::region::{CELLS, Random, damped, field, push};

/// How a sequence of strokes is made.
#[derive(Clone, Copy, Debug)]
struct Scene {
    law: Law,
    neighbours: Neighbours,
    integrator: Integrator,
    /// Free coefficients up to which the matrix is factorized at once; the region has 378 or 576.
    direct_limit: usize,
    cells: Cells,
    parts: bool,
    painted: bool,
}

const SCENE: Scene = Scene {
    law: Law::Linear { scale: 1.0 },
    neighbours: Neighbours::Six,
    integrator: Integrator::TrBdf2,
    direct_limit: 1000,
    cells: CELLS,
    parts: false,
    painted: true,
};

const LONG: Cells = Cells {
    level: 1,
    first: [0, 4, 4],
    count: [24, 9, 9],
};

/// With samples that are as far apart on all axes.
const CUBES: Cells = Cells {
    level: 1,
    first: [6, 3, 6],
    count: [12, 9, 12],
};

impl Scene {
    fn options(&self, field: &HierarchicalSpline<f32>) -> RegionOptions {
        RegionOptions {
            law: self.law,
            neighbours: self.neighbours,
            samples_per_cell: [4.0 / 3.0; 3],
            solver: SolverOptions {
                direct_limit: self.direct_limit,
                quick: 0,
                ..SolverOptions::default()
            },
            ..RegionOptions::of(field, 1)
        }
    }

    fn cut(&self, field: &HierarchicalSpline<f32>, matter: Matter) -> Region<f32> {
        let mut region = Region::new(field, self.cells, matter, &self.options(field)).unwrap();
        let clay = Plasticity::Clay { rate: 2.0 };
        region.patch_mut().set_plasticity(clay).unwrap();
        region.set_parts_sleep(self.parts);
        region
    }

    /// Pulls, sometimes paints or pins, and stops in the middle of it.
    fn stroke(&self, region: &mut Region<f32>, seed: u64) {
        let mut random = Random(seed * 77 + 5);
        region.wake();
        let [mx, my, mz] = region.patch().lattice().sample_dims();
        let at = (random.unit() * mx as f64, random.unit() - 0.4);
        let force: Vec<f32> = (0..mx * my * mz)
            .map(|i| {
                let x = (i / (my * mz)) as f64 - at.0;
                (at.1 * (-0.2 * x * x).exp()) as f32
            })
            .collect();
        region.set_force(&force).unwrap();
        if self.painted && seed.is_multiple_of(3) {
            let mut matter = region.patch().matter().clone();
            let stiff = matter.stiffness.paint(force.len()).iter_mut();
            let from = (random.unit() * 0.5 * force.len() as f64) as usize;
            stiff.skip(from).step_by(3).take(300).for_each(|k| *k = 40.0);
            region.patch_mut().set_matter(matter).unwrap();
        }
        if seed % 5 == 4 {
            let sample = (mx / 2 * my + my / 2) * mz + mz / 2;
            let pin = Constraint {
                label: "pin".into(),
                on: On::Samples(vec![(sample, 1.0)]),
                density: f64::from(region.patch().state().d[sample]) + 0.1,
                hold: Hold::Spring(3.0),
            };
            region.patch_mut().set_constraints(&[pin]).unwrap();
        }
        for _ in 0..3 + (random.unit() * 9.0) as usize {
            if self.painted && seed % 4 == 1 {
                let first = [mx, my, mz].map(|m| (random.unit() * (m - 3) as f64) as usize);
                let at = SampleBox { first, count: [3; 3] };
                let values = [2.0 + 20.0 * random.unit(); 27];
                region
                    .paint(Substance::Stiffness, OnBox { at, values: &values })
                    .unwrap();
            }
            let dt = 0.05 * (1.0 + (random.unit() * 6.0).floor());
            region.step(self.integrator, dt).unwrap();
        }
    }
}

fn scenes() -> Vec<Scene> {
    let law = Law::FourD { scale: 1.0 };
    vec![
        SCENE,
        Scene {
            painted: false,
            ..SCENE
        },
        // A factor beside the steps: 14 or 20 solves.
        Scene {
            direct_limit: 50,
            ..SCENE
        },
        Scene {
            direct_limit: 50,
            integrator: Integrator::Auto,
            ..SCENE
        },
        Scene {
            integrator: Integrator::Paper,
            law,
            neighbours: Neighbours::Eighteen,
            cells: CUBES,
            ..SCENE
        },
        Scene {
            parts: true,
            cells: LONG,
            ..SCENE
        },
        Scene {
            parts: true,
            cells: LONG,
            direct_limit: 50,
            ..SCENE
        },
    ]
}

#[test]
fn kept_and_recut_regions_are_the_same_after_each_of_twenty_strokes() {
    for scene in scenes() {
        let mut published = field::<f32>(2);
        let mut kept = scene.cut(&published, damped());
        for seed in 0..20 {
            let mut recut = scene.cut(&published, kept.patch().matter().clone());
            scene.stroke(&mut kept, seed);
            scene.stroke(&mut recut, seed);
            let (a, b) = (without_counters(&kept), without_counters(&recut));
            assert!(a == b, "{scene:?}, stroke {seed}: {}", different(&a, &b));
            let next = kept.release_clay(&published).unwrap();
            assert_eq!(next.sha256(), recut.release_clay(&published).unwrap().sha256());
            assert_ne!(
                next.sha256(),
                published.sha256(),
                "{scene:?}: nothing moved in stroke {seed}"
            );
            published = next;
        }
    }
}

/// A snapshot less what is only counted for reports.
pub fn without_counters(region: &Region<f32>) -> serde_json::Value {
    let mut value = serde_json::to_value(region.snapshot()).unwrap();
    let parts = value["parts"].as_object_mut().unwrap();
    parts.remove("operations");
    parts.remove("cuts");
    value
}

/// The region after its snapshot was written down and read again.
fn written(region: &Region<f32>) -> Region<f32> {
    let text = serde_json::to_string(&region.snapshot()).unwrap();
    let read: RegionSnapshot<f32> = serde_json::from_str(&text).unwrap();
    assert!(read == region.snapshot());
    Region::restore(&read).unwrap()
}

#[test]
fn a_restored_region_goes_on_while_its_factor_is_being_made() {
    for scene in scenes() {
        let published = field::<f32>(2);
        let mut region = scene.cut(&published, damped());
        scene.stroke(&mut region, 0);
        region.wake();
        let mut methods = Vec::new();
        for step in 0..12 {
            let mut restored = written(&region);
            for _ in 0..2 {
                let report = region.step(scene.integrator, 0.1).unwrap();
                assert_eq!(
                    report,
                    restored.step(scene.integrator, 0.1).unwrap(),
                    "{scene:?} {step}"
                );
                methods.extend(report.map(|r| r.solve.method));
            }
            let (a, b) = (region.snapshot(), restored.snapshot());
            let [a, b] = [a, b].map(|s| serde_json::to_value(s).unwrap());
            assert!(a == b, "{scene:?}: step {step}: {}", different(&a, &b));
            assert_eq!(
                region.bake(&published).unwrap().sha256(),
                restored.bake(&published).unwrap().sha256()
            );
        }
        if scene.direct_limit == 50 && scene.integrator == Integrator::TrBdf2 && !scene.parts {
            let both = [Method::VCycle, Method::Direct];
            assert!(both.iter().all(|m| methods.contains(m)), "{methods:?}");
        }
    }
}

#[test]
fn settling_is_what_the_steps_would_have_made() {
    let scene = Scene {
        direct_limit: 50,
        ..SCENE
    };
    let published = field::<f32>(2);
    let mut region = scene.cut(&published, damped());
    scene.stroke(&mut region, 0);
    region.wake();
    region.step(Integrator::TrBdf2, 0.1).unwrap();
    region.settle();
    let mut restored = written(&region);
    let report = region.step(Integrator::TrBdf2, 0.1).unwrap().unwrap();
    assert_eq!(report.solve.method, Method::Direct);
    assert_eq!(restored.step(Integrator::TrBdf2, 0.1).unwrap(), Some(report));
    // Released and settled again nothing is made anew.
    let made = region.patch().factorizations();
    let published = region.release_clay(&published).unwrap();
    let mut recut = scene.cut(&published, region.patch().matter().clone());
    for region in [&mut region, &mut recut] {
        let force = push(region, 0.3);
        region.set_force(&force).unwrap();
        region.step(Integrator::TrBdf2, 0.1).unwrap();
        region.settle();
        region.step(Integrator::TrBdf2, 0.1).unwrap();
    }
    assert!(without_counters(&region) == without_counters(&recut));
    assert_eq!(region.patch().factorizations(), made);
}

#[test]
fn damaged_snapshots_are_refused() {
    let scene = Scene {
        parts: true,
        cells: LONG,
        direct_limit: 50,
        ..SCENE
    };
    let mut region = scene.cut(&field(2), damped());
    scene.stroke(&mut region, 3);
    let value = serde_json::to_value(region.snapshot()).unwrap();
    let read = |value: &serde_json::Value| -> Result<(), String> {
        let snapshot: RegionSnapshot<f32> =
            serde_json::from_value(value.clone()).map_err(|e| e.to_string())?;
        Region::restore(&snapshot).map(|_| ()).map_err(|e| e.to_string())
    };
    read(&value).unwrap();
    // Every list one shorter, every number far too large: an error or a region, never a panic.
    let mut places = Vec::new();
    paths(&value, String::new(), &mut places);
    let mut refused = 0;
    for place in &places {
        let mut damaged = value.clone();
        match damaged.pointer_mut(place).unwrap() {
            serde_json::Value::Array(list) => drop(list.pop()),
            serde_json::Value::Number(n) => *n = 4_000_000_000_u32.into(),
            _ => continue,
        }
        refused += usize::from(read(&damaged).is_err());
    }
    assert!(refused > 40, "{refused} of {}", places.len());
    let other: Result<RegionSnapshot<f64>, _> = serde_json::from_value(value);
    let e = Region::restore(&other.unwrap()).unwrap_err().to_string();
    assert!(e.contains("precision f32"), "{e}");
}

/// Which lists of two snapshots differ.
pub fn different(a: &serde_json::Value, b: &serde_json::Value) -> String {
    let mut places = Vec::new();
    paths(a, String::new(), &mut places);
    let differ = |p: &&String| a.pointer(p) != b.pointer(p);
    format!("{:?}", places.iter().filter(differ).collect::<Vec<_>>())
}

/// JSON pointers to all lists and to the first number of each.
fn paths(value: &serde_json::Value, at: String, out: &mut Vec<String>) {
    match value {
        serde_json::Value::Object(map) => map.iter().for_each(|(k, v)| paths(v, format!("{at}/{k}"), out)),
        serde_json::Value::Array(list) => {
            out.push(at.clone());
            let few = if list.len() > 4 { 1 } else { 4 };
            let first = list.iter().take(few).enumerate();
            first.for_each(|(i, v)| paths(v, format!("{at}/{i}"), out));
        }
        serde_json::Value::Number(_) => out.push(at),
        _ => (),
    }
}

#[test]
fn a_budget_of_time_is_replayed_by_how_many_had_their_turn() {
    let published = field::<f32>(2);
    let cells = |x: u32| Cells {
        level: 1,
        first: [x, 3, 5],
        count: [8, 8, 8],
    };
    let make = || -> Vec<Region<f32>> {
        [0, 8, 16]
            .map(|x| {
                let scene = Scene {
                    cells: cells(x),
                    ..SCENE
                };
                let mut region = scene.cut(&published, damped());
                let force = push(&region, 0.1 + 0.01 * f64::from(x));
                region.set_force(&force).unwrap();
                region
            })
            .into()
    };
    let (mut live, mut again) = (make(), make());
    let (mut schedule, mut journal) = (Schedule::default(), Vec::new());
    let mut clock = Random(3);
    let mut lived = Vec::new();
    for _ in 0..12 {
        let turns = schedule.step_while(&mut live, Integrator::TrBdf2, 0.1, |_| clock.unit() < 0.6);
        journal.push(turns.iter().filter(|t| t.was_taken()).count());
        lived.push(turns);
    }
    assert!(
        journal.contains(&1) && journal.contains(&2) && journal.contains(&3),
        "{journal:?}"
    );
    let mut schedule = Schedule::default();
    for (taken, turns) in journal.into_iter().zip(lived) {
        let replayed: Vec<Turn> = schedule.replay(&mut again, Integrator::TrBdf2, 0.1, taken);
        assert_eq!(replayed, turns);
    }
    assert!(live.iter().zip(&again).all(|(a, b)| a.snapshot() == b.snapshot()));
}

/// Hash of a scene in which every solver and law takes part.
fn recorded_scene(
    m: usize,
    n: usize,
    law: Law,
    neighbours: Neighbours,
    direct_limit: usize,
    masked: Option<MaskedWay>,
) -> String {
    let rim = if n == m { Rim::Free } else { Rim::Fixed };
    let lattice = Lattice::<f32>::cube(n, m, rim, 0.5).unwrap();
    let count = lattice.sample_count();
    let at = |i: usize| [i / m / m, i / m % m, i % m].map(|i| i as f64 / (m - 1) as f64);
    let d: Vec<f32> = (0..count)
        .map(|i| {
            let [x, y, z] = at(i);
            (1.0 - x * x - 0.7 * y + 0.3 * z * x) as f32
        })
        .collect();
    let stiffness = (0..count).map(|i| if i % 7 < 3 { 50.0 } else { 1.0 });
    let matter = Matter {
        stiffness: Quantity::PerSample(stiffness.collect()),
        damping: Quantity::Constant(0.4),
        ..Matter::default()
    };
    let options = SolverOptions {
        direct_limit,
        quick: 0,
        masked: masked.unwrap_or(MaskedWay::Best),
        ..SolverOptions::default()
    };
    let mut patch = Patch::new(lattice, matter, law, neighbours, &d, options).unwrap();
    if masked.is_some() {
        let inside = (0..count).map(|i| at(i).map(|c| (c - 0.5).powi(2)).iter().sum::<f64>() < 0.2);
        let mask = Mask::new(patch.lattice(), inside.collect(), Rim::Free, neighbours).unwrap();
        patch = patch.with_mask(mask).unwrap();
    }
    patch.set_plasticity(Plasticity::Clay { rate: 3.0 }).unwrap();
    let force: Vec<f32> = (0..count)
        .map(|i| {
            let [x, y, z] = at(i);
            (0.3 - (x - 0.4).abs() - (y - 0.5).abs() * (z - 0.6).abs()) as f32
        })
        .collect();
    patch.set_force(&force).unwrap();
    let mut hash = Sha256::new();
    for step in 0..12 {
        let integrator = [Integrator::TrBdf2, Integrator::Paper, Integrator::Auto][step % 3];
        let report = patch.step(integrator, 0.05).unwrap();
        hash.update([report.solve.iteration.iterations as u8, report.substeps as u8]);
        let s = patch.state();
        for v in s.p.iter().chain(&s.v).chain(&s.d).chain(&s.w) {
            hash.update(v.to_bits().to_le_bytes());
        }
    }
    hash.finalize()
        .iter()
        .map(|b| format!("{b:02x}"))
        .take(8)
        .collect()
}

/// Run under an emulator of an old processor too: `qemu-x86_64 -cpu Nehalem`, which has neither AVX nor FMA.
#[test]
fn recorded_hashes_hold_on_every_processor() {
    let (linear, four_d) = (Law::Linear { scale: 1.0 }, Law::FourD { scale: 1.0 });
    let found = [
        // Factor, factor beside the steps, and factor and multigrid on the samples.
        recorded_scene(12, 10, linear, Neighbours::Six, 1000, None),
        recorded_scene(14, 12, linear, Neighbours::Six, 100, None),
        recorded_scene(12, 10, four_d, Neighbours::Eighteen, 1000, None),
        recorded_scene(9, 9, linear, Neighbours::Six, 1000, None),
        recorded_scene(9, 9, linear, Neighbours::Six, 100, None),
        // A ball of the box.
        recorded_scene(12, 10, linear, Neighbours::Six, 1000, Some(MaskedWay::Best)),
        recorded_scene(
            12,
            10,
            four_d,
            Neighbours::Six,
            1000,
            Some(MaskedWay::SparseFactor),
        ),
    ];
    assert_eq!(found, RECORDED);
}

const RECORDED: [&str; 7] = [
    "af9486a266bc6d3a",
    "6b98a66b2011166d",
    "bede5369be31f6db",
    "608c5e69271f2778",
    "eb8b4b5a4b17d7d7",
    "210dbdaa4c371502",
    "d74e1dd636759f22",
];
