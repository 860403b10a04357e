//! Regions of a hierarchical field: what baking keeps, how a solid is let go, when it sleeps, and what that costs.

mod baking;
mod cutting;
mod moving;
mod parts;
mod random_events;
mod sleep;
mod strides;

use std::collections::BTreeMap;
use std::sync::Arc;

use bspline::hierarchical::{BrickKey, Corrections, Lattice, LevelCorrections};
use bspline::{Field, HierarchicalSpline, Real};
use dynamics::integrators::Integrator;
use dynamics::matter::{Matter, Quantity};
use dynamics::region::{Cells, Region, RegionOptions};
use glam::{DAffine3, DMat3, DQuat, DVec3};

pub use moving::Stroke;

const INTEGRATORS: [Integrator; 4] = [
    Integrator::Paper,
    Integrator::Symplectic,
    Integrator::Verlet,
    Integrator::TrBdf2,
];

/// Numbers in `0..1`.
pub struct Random(pub u64);

impl Random {
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        ((z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb) >> 11) as f64 / (1u64 << 53) as f64
    }
}

fn lattice() -> Lattice {
    let turned = DMat3::from_quat(DQuat::from_rotation_z(0.4)) * DMat3::from_diagonal(DVec3::splat(2.0));
    Lattice {
        world_from_lattice: DAffine3::from_mat3_translation(turned, DVec3::new(10.0, -20.0, 5.0)),
        cells: [12, 9, 14],
    }
}

/// A half-space with bumps on `levels` levels: level 0 and 1 everywhere, level 2 where `x` is in the lower half.
pub fn field<T: Real>(levels: usize) -> HierarchicalSpline<T> {
    let lattice = lattice();
    let mut random = Random(7);
    let levels = (0..levels).map(|level| {
        let n = lattice.cells_at(level).map(|n| n + 3);
        let mut bricks: LevelCorrections<T> = BTreeMap::new();
        let end = if level == 2 { n[0] / 2 } else { n[0] };
        for x in 0..end {
            for y in 0..n[1] {
                for z in 0..n[2] {
                    let slope = if level == 0 {
                        2.0 * (6.2 - f64::from(x))
                    } else {
                        0.0
                    };
                    let value = slope + 0.3 * (random.unit() - 0.5) / (level + 1) as f64;
                    let key = BrickKey([x, y, z].map(|s| s / 8));
                    let brick = bricks
                        .entry(key)
                        .or_insert_with(|| Arc::new(Corrections::empty()));
                    Arc::make_mut(brick).set([x, y, z].map(|s| s as usize % 8), T::from_f64(value));
                }
            }
        }
        bricks
    });
    HierarchicalSpline::from_corrections(lattice, 1.0, levels.collect())
}

pub const CELLS: Cells = Cells {
    level: 1,
    first: [7, 3, 5],
    count: [10, 9, 12],
};

fn options<T: Real>(field: &HierarchicalSpline<T>) -> RegionOptions {
    RegionOptions {
        samples_per_cell: [2.0; 3],
        ..RegionOptions::of(field, 1)
    }
}

pub fn damped() -> Matter {
    Matter {
        damping: Quantity::Constant(3.0),
        ..Matter::default()
    }
}

/// A push on the samples round the middle.
pub fn push<T: Real>(region: &Region<T>, size: f64) -> Vec<T> {
    let [nx, ny, nz] = region.patch().lattice().sample_dims();
    let mut force = vec![T::zero(); nx * ny * nz];
    for (i, f) in force.iter_mut().enumerate() {
        let at = [i / nz / ny, i / nz % ny, i % nz];
        let near = [nx, ny, nz].iter().zip(at).all(|(n, i)| i.abs_diff(n / 2) < 3);
        *f = T::from_f64(if near { size } else { 0.0 });
    }
    force
}

/// A region of `field` pushed out of its rest.
fn pushed<T: Real>(field: &HierarchicalSpline<T>, cells: Cells, matter: Matter) -> Region<T> {
    let mut region = Region::new(field, cells, matter, &options(field)).unwrap();
    region.set_force(&push(&region, 0.3)).unwrap();
    for _ in 0..8 {
        region
            .step(Integrator::TrBdf2, 0.3)
            .unwrap()
            .expect("awake under a force");
    }
    region
}

/// How far the field `new` is at the samples from what the patch says, and from the field `old`, at most.
fn off_at_samples<T: Real>(
    region: &Region<T>,
    old: &HierarchicalSpline<T>,
    new: &HierarchicalSpline<T>,
) -> [f64; 2] {
    let [_, ny, nz] = region.patch().lattice().sample_dims();
    let d = region.patch().state().d.iter().enumerate();
    d.fold([0.0; 2], |[off, moved], (i, d)| {
        let p = region.sample_position([i / nz / ny, i / nz % ny, i % nz]);
        let now = new.value(p);
        [
            off.max((now - d.as_f64()).abs()),
            moved.max((now - old.value(p)).abs()),
        ]
    })
}

fn state_bits<T: Real>(region: &Region<T>) -> Vec<u64> {
    let s = region.patch().state();
    let all = s.p.iter().chain(&s.v).chain(&s.d).chain(&s.w);
    all.map(|v| v.as_f64().to_bits()).collect()
}
