//! Regions that go along with a tool, several regions of a field, and what a viewer is told.

use std::collections::BTreeMap;
use std::sync::Arc;

use bspline::hierarchical::{BrickKey, Corrections, LevelEdit};
use bspline::{Field, HierarchicalSpline, Real};
use dynamics::integrators::Integrator;
use dynamics::lattice::OnBox;
use dynamics::matter::{Matter, Quantity};
use dynamics::region::{Cells, Region, RegionError, RegionOptions, Scene, Turn, Viewer};
use dynamics::springs::{Law, Plasticity, Weights};
use glam::{DAffine3, DVec3};

use super::{CELLS, Random, damped, field, options, push, pushed};

/// A half-space with bumps on cells of edge 1.
fn plain(cells: [u32; 3]) -> HierarchicalSpline<f32> {
    let middle = 0.5 * f64::from(cells[2]);
    rough(cells, |p| middle - p.z)
}

/// Coefficients from their places on cells of edge 1, with bumps.
fn rough(cells: [u32; 3], f: impl Fn(DVec3) -> f64) -> HierarchicalSpline<f32> {
    let mut random = Random(17);
    let mut bricks = BTreeMap::new();
    for x in 0..cells[0] + 3 {
        for y in 0..cells[1] + 3 {
            for z in 0..cells[2] + 3 {
                // The function with the number s is largest at s - 1.
                let place = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) - 1.0;
                let value = f(place) + 0.3 * random.unit();
                let key = BrickKey([x, y, z].map(|s| s / 8));
                let brick = bricks
                    .entry(key)
                    .or_insert_with(|| Arc::new(Corrections::empty()));
                Arc::make_mut(brick).set([x, y, z].map(|s| s as usize % 8), value as f32);
            }
        }
    }
    let lattice = bspline::hierarchical::Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells,
    };
    HierarchicalSpline::from_corrections(lattice, 1.0, vec![bricks])
}

/// Standard deviation of the tool in edges of cells: 1.5 sample distances.
pub const R: f64 = 1.125;

/// A tool that pulls clay along a path, a place a step, through a field of level 0.
pub struct Stroke {
    pub law: Law,
    pub field: HierarchicalSpline<f32>,
    pub path: Vec<DVec3>,
}

impl Stroke {
    fn options(&self) -> RegionOptions {
        RegionOptions {
            law: self.law,
            ..RegionOptions::of(&self.field, 0)
        }
    }

    fn edge(&self) -> f64 {
        self.field.lattice().spacing(0).x
    }

    /// 6 r to the effective rim, and the way of the tool in half of the steps between two cuts.
    pub fn half(&self, every: usize) -> f64 {
        let ways = self.path.windows(2).map(|w| w[0].distance(w[1]));
        (6.0 * R + 0.58) * self.edge() + 0.5 * every as f64 * ways.fold(0.0, f64::max)
    }

    /// Clay whose bumps are as wide as the tool, and so light that it does not swing: λ = κ = 1, δ = r.
    fn clay(&self) -> Matter {
        let damping = (self.law.scale() / (R * self.edge())).powi(2);
        Matter {
            mass: Quantity::Constant(0.1 * damping),
            damping: Quantity::Constant(damping),
            ..Matter::default()
        }
    }

    fn cut(&self, field: &HierarchicalSpline<f32>, cells: Cells) -> Region<f32> {
        let mut region = Region::new(field, cells, self.clay(), &self.options()).unwrap();
        let plasticity = Plasticity::Clay { rate: 1.0 };
        region.patch_mut().set_plasticity(plasticity).unwrap();
        region
    }

    fn step(&self, region: &mut Region<f32>, at: DVec3) {
        let r = R * self.edge();
        let (at, kernel) = region.patch().lattice().gaussian(region.local(at), r);
        // As high as a few cells, whatever their edge and the slope of the field.
        let size = 8.0 * self.law.scale() * self.edge().powi(2);
        let values: Vec<f32> = kernel.iter().map(|k| (size * *k) as f32).collect();
        region.set_force_on(OnBox { at, values: &values }).unwrap();
        region.step(Integrator::Paper, 0.1).unwrap();
    }

    /// In one region of all cells.
    pub fn whole(&self) -> HierarchicalSpline<f32> {
        let all = Cells {
            level: 0,
            first: [0; 3],
            count: self.field.lattice().cells,
        };
        let mut region = self.cut(&self.field, all);
        self.path.iter().for_each(|p| self.step(&mut region, *p));
        region.release_clay(&self.field).unwrap()
    }

    /// In one that is cut anew every few steps with `half` of cells to each side, keeping its motion or not.
    pub fn following(&self, half: f64, every: usize, keeping: bool) -> HierarchicalSpline<f32> {
        let last = self.path.len() - 1;
        let place = |step: usize| self.path[step.min(last)];
        let round = |step| Cells::around(&self.field, 0, [1; 3], place(step), DVec3::splat(half)).unwrap();
        let mut onto = self.field.clone();
        let mut region = self.cut(&onto, round(every / 2));
        for step in 0..=last {
            if step > 0 && step % every == 0 {
                let cells = round(step + every / 2);
                (onto, region) = if keeping {
                    region.moved(&onto, cells, self.clay()).unwrap()
                } else {
                    let baked = region.bake(&onto).unwrap();
                    let cut = self.cut(&baked, cells);
                    (baked, cut)
                };
            }
            self.step(&mut region, place(step));
        }
        region.release_clay(&onto).unwrap()
    }

    /// Largest difference at the samples, over the peak of `a`.
    pub fn apart(&self, a: &HierarchicalSpline<f32>, b: &HierarchicalSpline<f32>) -> f64 {
        let cells = self.field.lattice().cells;
        let (mut apart, mut peak) = (0.0_f64, 0.0_f64);
        for x in 0..2 * cells[0] {
            for y in 0..2 * cells[1] {
                for z in 0..2 * cells[2] {
                    let p = 0.5 * DVec3::new(f64::from(x), f64::from(y), f64::from(z));
                    let p = self.field.lattice().world_from_lattice.transform_point3(p);
                    apart = apart.max((a.value(p) - b.value(p)).abs());
                    peak = peak.max((a.value(p) - self.field.value(p)).abs());
                }
            }
        }
        apart / peak
    }
}

fn line(from: DVec3, to: DVec3, steps: usize) -> Vec<DVec3> {
    (0..steps)
        .map(|s| from.lerp(to, s as f64 / steps as f64))
        .collect()
}

#[test]
fn a_region_that_follows_a_stroke_ends_where_a_large_one_does() {
    let stroke = Stroke {
        law: Law::Linear { scale: 1.0 },
        field: plain([45, 30, 30]),
        path: line(DVec3::new(12.0, 14.0, 15.0), DVec3::new(33.0, 17.0, 15.5), 93),
    };
    let whole = stroke.whole();
    let half = stroke.half(8);
    let kept = stroke.apart(&whole, &stroke.following(half, 8, true));
    let lost = stroke.apart(&whole, &stroke.following(half, 8, false));
    println!("kept {kept:.4}, lost {lost:.4}");
    assert!(kept < 0.02, "{kept:.4}");
    assert!(lost > 3.0 * kept && lost > 0.05, "{lost:.4}: nothing to keep");
}

#[test]
fn a_region_that_follows_a_stroke_round_a_ball_does_so_too() {
    let centre = DVec3::splat(16.5);
    let on_ball = |angle: f64| centre + 8.0 * DVec3::new(angle.sin(), 0.3 * angle, angle.cos()).normalize();
    let stroke = Stroke {
        law: Law::Linear { scale: 1.0 },
        field: rough([33; 3], |p| 8.0 - (p - centre).length()),
        // A quarter of the way round.
        path: (0..56)
            .map(|s| on_ball(-0.8 + 1.6 * f64::from(s) / 56.0))
            .collect(),
    };
    let kept = stroke.apart(&stroke.whole(), &stroke.following(stroke.half(8), 8, true));
    println!("ball: kept {kept:.4}");
    assert!(kept < 0.02, "{kept:.4}");
}

#[test]
fn springs_of_the_four_d_law_are_carried_too() {
    let stroke = Stroke {
        law: Law::FourD { scale: 1.0 },
        field: plain([33, 27, 27]),
        path: line(DVec3::new(12.0, 13.0, 13.5), DVec3::new(20.0, 14.0, 13.5), 36),
    };
    let whole = stroke.whole();
    let kept = stroke.apart(&whole, &stroke.following(stroke.half(8), 8, true));
    println!("4-d kept {kept:.4}");
    assert!(kept < 0.02, "{kept:.4}");
}

fn goes_on<T: Real>(tolerance: f64) {
    let old = field::<T>(2);
    let matter = Matter {
        ground: Quantity::Constant(0.3),
        ..damped()
    };
    let options = RegionOptions {
        samples_per_cell: [4.0 / 3.0; 3],
        ..options(&old)
    };
    let cells = Cells {
        level: 1,
        first: [3, 3, 6],
        count: [12, 12, 15],
    };
    let mut region = Region::new(&old, cells, matter.clone(), &options).unwrap();
    let scale: Vec<T> = (0..region.patch().lattice().sample_count())
        .map(|i| T::from_f64(1.0 + 0.05 * (i % 3) as f64))
        .collect();
    region.patch_mut().springs_mut().rest_mut().scale = Weights::Each(scale);
    let clay = Plasticity::Clay { rate: 0.5 };
    region.patch_mut().set_plasticity(clay).unwrap();
    region.set_force(&push(&region, 0.3)).unwrap();
    for _ in 0..6 {
        region.step(Integrator::TrBdf2, 0.2).unwrap();
    }
    let (onto, mut moved) = region.moved(&old, cells, matter).unwrap();
    assert_eq!(onto.sha256(), region.bake(&old).unwrap().sha256());
    let none = vec![T::zero(); region.patch().lattice().sample_count()];
    region.set_force(&none).unwrap();
    let (mut speed, mut largest) = (0.0_f64, 0.0_f64);
    for _ in 0..3 {
        region.step(Integrator::TrBdf2, 0.2).unwrap();
        moved.step(Integrator::TrBdf2, 0.2).unwrap();
        speed = speed.max(
            region
                .patch()
                .state()
                .w
                .iter()
                .fold(0.0, |m, w| m.max(w.as_f64().abs())),
        );
    }
    let (a, b) = (region.bake(&old).unwrap(), moved.bake(&onto).unwrap());
    let dims = region.patch().lattice().sample_dims();
    for i in 0..dims.iter().product() {
        let at = [i / dims[2] / dims[1], i / dims[2] % dims[1], i % dims[2]];
        let p = region.sample_position(at);
        largest = largest.max((a.value(p) - b.value(p)).abs());
    }
    assert!(speed > 0.02, "nothing moves: {speed:.1e}");
    assert!(largest < tolerance, "{largest:.1e}, speed {speed:.1e}");
}

#[test]
fn a_region_that_stays_goes_on_as_if_nothing_had_been() {
    goes_on::<f64>(1e-11);
    goes_on::<f32>(3e-5);
}

#[test]
fn a_change_is_baked_once() {
    let old = field::<f32>(2);
    let mut region = pushed(&old, CELLS, damped());
    let once = region.bake(&old).unwrap();
    assert!(matches!(region.bake(&once), Err(RegionError::Changed)));
    assert!(matches!(region.release_clay(&once), Err(RegionError::Changed)));
    let baked = region.release_clay(&old).unwrap();
    assert_eq!(baked.sha256(), once.sha256());
    assert!(matches!(region.bake(&old), Err(RegionError::Changed)));
    assert_eq!(region.bake(&baked).unwrap().sha256(), once.sha256());
}

#[test]
fn regions_of_a_scene_share_no_cells() {
    let old = field::<f32>(2);
    let options = options(&old);
    let at = |first| Cells {
        level: 1,
        first,
        count: [8; 3],
    };
    let mut scene = Scene::new(old.clone());
    let a = scene.cut(at([0, 0, 0]), damped(), &options).unwrap();
    let refused = scene.cut(at([7, 7, 7]), damped(), &options).unwrap_err();
    assert!(
        matches!(refused, RegionError::Overlaps { index: 0, .. }),
        "{refused}"
    );
    let b = scene.cut(at([8, 0, 0]), damped(), &options).unwrap();
    let coarse = Cells {
        level: 0,
        first: [2, 1, 3],
        count: [4; 3],
    };
    assert!(
        coarse.overlaps(&at([0; 3])) && coarse.overlaps(&at([8, 0, 8])) && !coarse.overlaps(&at([0, 10, 0]))
    );
    assert_eq!(at([0; 3]).joined(&coarse).count, [12, 10, 14]);
    assert_eq!(coarse.joined(&at([1, 0, 9])).first, [0, 0, 3]);
    for index in [a, b] {
        let region = scene.region_mut(index).unwrap();
        let force = push(region, 0.3);
        region.set_force(&force).unwrap();
    }
    for _ in 0..4 {
        let turns = scene.step_while(Integrator::TrBdf2, 0.2, |_| true);
        assert!(turns.iter().all(Turn::was_taken));
    }
    let alone = scene.regions()[a].bake(&old).unwrap();
    assert_eq!(scene.release(a).unwrap().sha256(), alone.sha256());
    assert_eq!(
        scene.release(a).unwrap().sha256(),
        alone.sha256(),
        "released twice, baked once"
    );
    let blocked = scene.move_region(a, at([4, 0, 0]), damped());
    assert!(matches!(blocked, Err(RegionError::Overlaps { index: 1, .. })));
    scene.move_region(a, at([0, 8, 0]), damped()).unwrap();
    assert_eq!(scene.regions()[a].cells().first, [0, 8, 0]);
    // The other is still in motion: one that covers it has its shape.
    let both = scene.regions()[b].bake(scene.field()).unwrap();
    let joined = scene.cut_joined(at([4, 0, 0]), |_| damped(), &options).unwrap();
    assert_eq!(scene.field().sha256(), both.sha256());
    assert_eq!(scene.regions().len(), 2);
    let cells = *scene.regions()[joined].cells();
    assert_eq!((cells.first, cells.count), ([4, 0, 0], [12, 8, 8]));
    assert!(scene.region_mut(2).is_none() && scene.release(2).is_err());
}

#[test]
fn a_viewer_is_told_what_changed() {
    let old = field::<f32>(2);
    let mut region = pushed(&old, CELLS, damped());
    let mut viewer = Viewer::default();
    let mut seen = BTreeMap::new();
    for step in 0..5 {
        let change = region.change_since(&mut viewer).expect("it moves");
        assert_eq!(region.change_since(&mut viewer), None);
        let inside = |a: usize| {
            let (c, all) = (change.cells(), CELLS);
            c.first[a] >= all.first[a] && c.first[a] + c.count[a] <= all.first[a] + all.count[a]
        };
        assert!((0..3).all(inside) && change.level == 1, "{step}");
        let [_, ny, nz] = change.count.map(|c| c as usize);
        for (i, value) in change.values.iter().enumerate() {
            let at = [i / nz / ny, i / nz % ny, i % nz];
            let function: [u32; 3] = std::array::from_fn(|a| change.first[a] + at[a] as u32);
            seen.insert(function, *value);
        }
        // The last change is told before the end.
        if step < 4 {
            region.step(Integrator::TrBdf2, 0.1).unwrap();
        }
    }
    let edits: Vec<LevelEdit<f32>> = seen
        .into_iter()
        .filter(|(_, delta)| *delta != 0.0)
        .map(|(function, delta)| LevelEdit {
            level: 1,
            function,
            delta,
        })
        .collect();
    assert_eq!(
        old.edited(&edits).unwrap().sha256(),
        region.bake(&old).unwrap().sha256()
    );
}
