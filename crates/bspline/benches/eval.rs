//! Speed of evaluation: value and gradient at 10⁶ points of the active band, one thread.
//!
//! The field is as large as that of a detailed scan: every function within 1.75 cells of a torus is active, on each of
//! the levels of 64 to 1024 cells along the box, with seeded random coefficients that shrink with the cell. The points
//! are uniform in the unit cells round the knots of the finest level's functions.
//!
//! - `order`: sorting the points by brick and cell;
//! - `sorted`, `random`: `values_gradients` of the points in that order, and as they were drawn;
//! - `single`: `value_gradient` point by point, sorted.
//!
//! Peers on a cubic field of 7 M coefficients, one thread, in million points per second, values alone: SciPy
//! `map_coordinates` in f32 0.84 at random points, 4.2 sorted by cell; SimpleITK on a grid 3.1; SciPy `NdBSpline` 0.39
//! and 1.6, with gradient 0.11.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::sync::Arc;

use bspline::hierarchical::{BrickKey, Corrections, Lattice, LevelCorrections};
use bspline::{Field, HierarchicalSpline, Real};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{DAffine3, DVec3};

const POINTS: usize = 1_000_000;
/// Cells along the box on the coarsest level, which is full.
const BASE: u32 = 32;
const LEVELS: usize = 6;
/// Half the width of the band of active functions, in cells of their level.
const REACH: f64 = 1.75;

/// Steele, Lea and Flood's SplitMix64.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// In `[0, 1)`.
    fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Distance to a torus of radii 1 and 0.4 round the middle of a box 3.22 wide, in lattice coordinates.
fn torus_distance(q: DVec3) -> f64 {
    let unit = f64::from(BASE) / 3.22;
    let p = q / unit - 1.61;
    ((p.truncate().length() - 1.0).hypot(p.z) - 0.4).abs() * unit
}

/// Knots of the functions of a level that lie within [`REACH`] cells of the torus, found from coarse to fine.
fn near_torus(level: usize) -> Vec<[u32; 3]> {
    let width = 0.5f64.powi(level as i32);
    if level == 0 {
        let n = 0..BASE + 3;
        return n
            .clone()
            .flat_map(|x| n.clone().flat_map(move |y| (0..BASE + 3).map(move |z| [x, y, z])))
            .collect();
    }
    // Slot s stands for knot s - 1: the children of knots 0 .. BASE, tree-wise, so that work goes with the surface.
    let mut cells: Vec<[u32; 3]> = (0..BASE.pow(3))
        .map(|i| [i / BASE / BASE, i / BASE % BASE, i % BASE])
        .collect();
    for l in 0..=level {
        let w = 0.5f64.powi(l as i32);
        let middle = |c: [u32; 3]| (DVec3::from_array(c.map(f64::from)) + 0.5) * w;
        // Half a cell's diagonal and the band of the target level.
        cells.retain(|&c| torus_distance(middle(c)) <= 0.87 * w + REACH * width);
        if l < level {
            cells = cells
                .into_iter()
                .flat_map(|c| {
                    (0..8u32).map(move |o| [2 * c[0] + (o >> 2), 2 * c[1] + (o >> 1 & 1), 2 * c[2] + (o & 1)])
                })
                .collect();
        }
    }
    // A cell stands for the knot at its lower corner.
    cells.retain(|&c| torus_distance(DVec3::from_array(c.map(f64::from)) * width) <= REACH * width);
    cells.into_iter().map(|c| c.map(|c| c + 1)).collect()
}

/// The field, and the slots of the finest level's functions.
fn band_field<T: Real>() -> (HierarchicalSpline<T>, Vec<[u32; 3]>) {
    let mut random = Random(1);
    let mut finest = Vec::new();
    let levels: Vec<LevelCorrections<T>> = (0..LEVELS)
        .map(|level| {
            let mut bricks: BTreeMap<BrickKey, Corrections<T>> = BTreeMap::new();
            finest = near_torus(level);
            for s in &finest {
                let c = (2.0 * random.uniform() - 1.0) * 0.5f64.powi(level as i32);
                bricks
                    .entry(BrickKey(s.map(|s| s / 8)))
                    .or_insert_with(Corrections::empty)
                    // Rounded, so that both precisions hold the same field.
                    .set(s.map(|s| (s % 8) as usize), T::from_f64(f64::from(c as f32)));
            }
            bricks.into_iter().map(|(k, c)| (k, Arc::new(c))).collect()
        })
        .collect();
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_scale(DVec3::splat(0.1)),
        cells: [BASE; 3],
    };
    (HierarchicalSpline::from_corrections(lattice, 1.0, levels), finest)
}

/// World points, uniform in the unit cells round the knots of `slots`.
fn points_in_band<T: Real>(f: &HierarchicalSpline<T>, slots: &[[u32; 3]]) -> Vec<DVec3> {
    let mut random = Random(2);
    let width = 0.5f64.powi(LEVELS as i32 - 1);
    (0..POINTS)
        .map(|_| {
            let s = slots[(random.uniform() * slots.len() as f64) as usize];
            let q = s.map(|s| (f64::from(s) - 1.0 + random.uniform() - 0.5) * width);
            f.lattice()
                .world_from_lattice
                .transform_point3(DVec3::from_array(q))
        })
        .collect()
}

/// Root of the mean square difference of values and of gradients, each relative to the exact root mean square.
fn error_of(out: &[(f64, DVec3)], exact: &[(f64, DVec3)]) -> [f64; 2] {
    let mut sums = [0.0; 4];
    for (a, b) in out.iter().zip(exact) {
        sums[0] += (a.0 - b.0).powi(2);
        sums[1] += b.0 * b.0;
        sums[2] += (a.1 - b.1).length_squared();
        sums[3] += b.1.length_squared();
    }
    [(sums[0] / sums[1]).sqrt(), (sums[2] / sums[3]).sqrt()]
}

fn evaluation(c: &mut Criterion) {
    let (f, finest) = band_field::<f32>();
    let points = points_in_band(&f, &finest);
    let order = f.evaluation_order(&points);
    let sorted: Vec<DVec3> = order.iter().map(|&i| points[i as usize]).collect();
    let mut out = vec![(0.0, DVec3::ZERO); POINTS];
    f.values_gradients(&sorted, &mut out);
    let exact: Vec<(f64, DVec3)> = {
        let (f, _) = band_field::<f64>();
        sorted.iter().map(|p| f.value_gradient(*p)).collect()
    };
    let [value, gradient] = error_of(&out, &exact);
    println!(
        "field: {:.2} M coefficients, {} bricks, {:.0} MB of totals; f32 against f64: value {value:.1e}, gradient \
         {gradient:.1e} of the rms",
        f.coefficient_count() as f64 * 1e-6,
        f.brick_count(),
        f.totals_bytes() as f64 * 1e-6,
    );
    let mut group = c.benchmark_group("eval");
    group
        .sample_size(10)
        .throughput(Throughput::Elements(POINTS as u64));
    group.bench_function("order/1M", |b| b.iter(|| f.evaluation_order(black_box(&points))));
    group.bench_function("sorted/1M", |b| {
        b.iter(|| f.values_gradients(black_box(&sorted), &mut out))
    });
    group.bench_function("random/1M", |b| {
        b.iter(|| f.values_gradients(black_box(&points), &mut out))
    });
    group.bench_function("single/1M", |b| {
        b.iter(|| {
            for (p, o) in black_box(&sorted).iter().zip(&mut out) {
                *o = f.value_gradient(*p);
            }
        })
    });
    group.finish();
}

criterion_group!(benches, evaluation);
criterion_main!(benches);
