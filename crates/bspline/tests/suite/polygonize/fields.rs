//! Fields to mesh.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::Arc;

use bspline::hierarchical::{BRICK_LEN, BrickKey, Corrections, Lattice};
use bspline::{Aabb, Field, HierarchicalSpline, Interval, Jet};
use glam::{DAffine3, DVec3};

/// A field from its value with gradient; bounds as given.
pub struct Formula<F, B> {
    pub value_gradient: F,
    pub bounds: B,
}

impl<F, B> Field for Formula<F, B>
where
    F: Fn(DVec3) -> (f64, DVec3) + Send + Sync,
    B: Fn(&Aabb) -> Interval + Send + Sync,
{
    fn value(&self, p: DVec3) -> f64 {
        (self.value_gradient)(p).0
    }
    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        (self.value_gradient)(p)
    }
    fn jet(&self, _: DVec3) -> Jet {
        unreachable!("meshing asks for no Hessian")
    }
    fn bounds(&self, b: &Aabb) -> Interval {
        (self.bounds)(b)
    }
}

pub fn unbounded(
    value_gradient: impl Fn(DVec3) -> (f64, DVec3) + Send + Sync,
) -> Formula<impl Fn(DVec3) -> (f64, DVec3) + Send + Sync, impl Fn(&Aabb) -> Interval + Send + Sync> {
    Formula {
        value_gradient,
        bounds: |_: &Aabb| Interval::EVERYTHING,
    }
}

/// Signed distance to a sphere, positive inside, with its exact range over a box.
pub fn sphere(center: DVec3, radius: f64) -> impl Field {
    Formula {
        value_gradient: move |p: DVec3| {
            let r = p - center;
            (radius - r.length(), -r.normalize_or_zero())
        },
        bounds: move |b: &Aabb| {
            let near = (center.clamp(b.min, b.max) - center).length();
            let far = (b.min - center).abs().max((b.max - center).abs()).length();
            Interval::new(radius - far, radius - near).widened(1e-12)
        },
    }
}

pub fn gyroid(period: f64) -> impl Field {
    let w = TAU / period;
    unbounded(move |p| {
        let (s, c) = ((p * w).map(f64::sin), (p * w).map(f64::cos));
        let f = s.x * c.y + s.y * c.z + s.z * c.x;
        let g = DVec3::new(
            c.x * c.y - s.z * s.x,
            c.y * c.z - s.x * s.y,
            c.z * c.x - s.y * s.z,
        );
        (f, g * w)
    })
}

/// splitmix64: small, seeded, good enough to shake tables.
pub struct Random(pub u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }
    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Trilinear interpolation of values at the whole numbers `0 ..= n`, constant beyond.
pub struct Trilinear {
    nodes: usize,
    values: Vec<f64>,
}

impl Trilinear {
    /// Random values; a share of them exactly 0.
    pub fn random(nodes: usize, seed: u64, density: f64) -> Self {
        let mut random = Random(seed);
        let values = (0..nodes * nodes * nodes)
            .map(|_| match random.next() % 16 {
                0 => 0.0,
                _ if random.unit() < density => random.unit() + 1e-9,
                _ => -random.unit(),
            })
            .collect();
        Self { nodes, values }
    }
}

impl Field for Trilinear {
    fn value(&self, p: DVec3) -> f64 {
        self.value_gradient(p).0
    }
    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let q = p.clamp(DVec3::ZERO, DVec3::splat((self.nodes - 1) as f64));
        let cell = q.floor().min(DVec3::splat((self.nodes - 2) as f64));
        let t = q - cell;
        let (mut f, mut g) = (0.0, DVec3::ZERO);
        for c in 0..8 {
            let bit = DVec3::new((c >> 2) as f64, (c >> 1 & 1) as f64, (c & 1) as f64);
            let w = DVec3::ONE - bit + (bit * 2.0 - 1.0) * t;
            let at = (cell + bit).as_usizevec3();
            let v = self.values[(at.x * self.nodes + at.y) * self.nodes + at.z];
            let sign = bit * 2.0 - 1.0;
            f += v * (w.x * w.y * w.z);
            g += v * sign * DVec3::new(w.y * w.z, w.x * w.z, w.x * w.y);
        }
        (f, g)
    }
    fn jet(&self, _: DVec3) -> Jet {
        unreachable!("meshing asks for no Hessian")
    }
    fn bounds(&self, _: &Aabb) -> Interval {
        Interval::EVERYTHING
    }
}

/// Full coarse level and a finer one in part of the box, random.
pub fn random_spline(seed: u64, world_from_lattice: DAffine3) -> HierarchicalSpline<f32> {
    let mut random = Random(seed);
    let cells = [10, 9, 12];
    let mut level = |number: u32, bricks: &[[u32; 3]], size: f64| {
        let mut made = BTreeMap::new();
        for &key in bricks {
            let mut corrections = Corrections::empty();
            for slot in 0..BRICK_LEN {
                let at = [slot / 64, slot / 8 % 8, slot % 8];
                let c = (size * (2.0 * random.unit() - 1.0)) as f32;
                if (0..3).all(|a| 8 * key[a] + (at[a] as u32) < (cells[a] << number) + 3) {
                    corrections.set(at, c);
                }
            }
            made.insert(BrickKey(key), Arc::new(corrections));
        }
        made
    };
    let coarse: Vec<[u32; 3]> = (0..8).map(|n| [n >> 2, n >> 1 & 1, n & 1]).collect();
    let levels = vec![
        level(0, &coarse, 1.0),
        level(1, &[[0, 0, 0], [1, 1, 0], [1, 2, 1]], 0.5),
    ];
    let lattice = Lattice {
        world_from_lattice,
        cells,
    };
    HierarchicalSpline::from_corrections(lattice, 1.0, levels)
}
