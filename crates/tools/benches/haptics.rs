//! What the haptic thread touches: how long it takes to make, to renew, and to ask; on one core, in processor time.
//!
//! `cargo bench -p tools --bench haptics`. Balls with knots of 0.5 mm that fill boxes of 64³ to 512³ cells show that nothing grows with the model;
//! the default fits of `data/bunny.obj.gz` and, at an iso-value that is not the fitted one, `data/head.nii.gz` what a scan costs. First a
//! table: what is lost by wider nodes and by linear interpolation, against the distance to the surface by looking everywhere; and what a tick
//! of the proxy costs.

use std::hint::black_box;
use std::sync::Arc;

use bspline::hierarchical::{BrickKey, DenseCorrections, Lattice, LevelEdit};
use bspline::{Aabb, Field, HierarchicalSpline};
use criterion::measurement::Measurement;
use criterion::{BenchmarkId, Criterion};
use glam::{DAffine3, DVec3};
use tools::haptics::{
    BrickOptions, Demand, DistanceBrick, Interpolation, Obstacle, Pose, Proxy, ProxyOptions, Renderer,
    SnapshotMaker, Surface, Touch, TouchedObject,
};
use tools::paint::Layers;

#[path = "common/cpu_time.rs"]
mod cpu_time;
#[path = "common/scans.rs"]
mod scans;

use cpu_time::{CpuTime, on_one_core};

/// Cells of level 0 on an axis of a ball's box.
const CELLS: u32 = 32;
/// Knot interval, mm.
const KNOT: f64 = 0.5;

/// A solid, and a place of its surface.
struct Piece {
    name: String,
    field: HierarchicalSpline<f32>,
    iso: f64,
    at: DVec3,
}

impl Piece {
    /// A ball whose finest knots are `KNOT` apart, with waves near its surface, in a box of `CELLS·2^depth` cells.
    fn ball(depth: u32) -> Self {
        let cells = CELLS << depth;
        let scale = KNOT * f64::from(1u32 << depth);
        let lattice = Lattice {
            world_from_lattice: DAffine3::from_scale(DVec3::splat(scale)),
            cells: [CELLS; 3],
        };
        let levels = (0..=depth).map(|level| {
            let bricks = ((CELLS << level) + 2) / 8 + 1;
            let keys = (0..bricks).flat_map(move |x| {
                (0..bricks).flat_map(move |y| (0..bricks).map(move |z| BrickKey([x, y, z])))
            });
            let full = keys.filter_map(|key| Some((key, Arc::new(brick(level, scale, key)?.pack()))));
            full.collect()
        });
        let middle = DVec3::splat(0.5 * f64::from(CELLS) * scale);
        Self {
            name: format!("ball in {cells}³ cells"),
            field: HierarchicalSpline::from_corrections(lattice, 1.0, levels.collect()),
            iso: 0.0,
            at: middle + 0.36 * f64::from(CELLS) * scale * DVec3::new(0.8, 0.36, 0.48),
        }
    }

    fn object<'a>(&self, field: &Arc<dyn Field>, layers: &'a Layers) -> TouchedObject<'a> {
        TouchedObject {
            id: 0,
            field: field.clone(),
            iso: self.iso,
            world_from_object: DAffine3::IDENTITY,
            layers,
            default: Touch::default(),
        }
    }

    /// The same with a dent of one function under the tool.
    fn dented(&self) -> HierarchicalSpline<f32> {
        let level = self.field.level_count() - 1;
        let q = self.field.lattice_from_world().transform_point3(self.at) * f64::from(1u32 << level);
        let slope = self.field.value_gradient(self.at).1.length();
        let edit = LevelEdit {
            level,
            function: q.to_array().map(|q| q as u32 + 1),
            delta: (-0.3 * slope * self.field.finest_spacing()) as f32,
        };
        self.field.edited(&[edit]).expect("a function of the lattice")
    }
}

/// Functions of one brick of the ball; none if there are none.
fn brick(level: u32, scale: f64, key: BrickKey) -> Option<DenseCorrections<f32>> {
    let n = CELLS << level;
    let (middle, radius) = (DVec3::splat(f64::from(n) / 2.0), 0.36 * f64::from(n));
    let height = |knot: DVec3| radius - (knot - middle).length();
    let centre = DVec3::from_array(key.0.map(|k| f64::from(8 * k) + 2.5));
    if level > 0 && height(centre).abs() > 3.5 * 3f64.sqrt() + 2.0 {
        return None;
    }
    let cell = scale / f64::from(1u32 << level);
    let mut corrections = DenseCorrections::empty();
    for slot in 0..512u32 {
        let at = [slot / 64, slot / 8 % 8, slot % 8];
        let function: [u32; 3] = std::array::from_fn(|a| 8 * key.0[a] + at[a]);
        if function.iter().any(|&f| f >= n + 3) {
            continue;
        }
        let height = height(DVec3::from_array(function.map(f64::from)) - 1.0);
        let value = match level {
            0 => height * cell,
            _ if height.abs() > 2.0 => continue,
            _ => 0.05 * cell * libm::sin(f64::from(7 * function[0] + 3 * function[1])),
        };
        corrections.set(at.map(|a| a as usize), value as f32);
    }
    Some(corrections)
}

fn scanned() -> Vec<Piece> {
    let piece = |s: tools::study::Sculpture, iso: f64| {
        let at = s.place().expect("a surface");
        let mut x = at;
        // To the surface at this iso-value, along the gradient.
        for _ in 0..50 {
            let (value, g) = s.field.value_gradient(x);
            x += ((iso - value) / g.length()).clamp(-0.3, 0.3) * g.normalize();
        }
        Piece {
            name: format!("{} at {iso:.0}", s.name),
            field: s.field,
            iso,
            at: x,
        }
    };
    let (bunny, head) = (scans::bunny(), scans::head());
    let skin = 0.5 * head.iso;
    vec![piece(bunny, 0.0), piece(head, skin)]
}

/// Places in a box about a place, evenly \[Roberts18\].
fn places(at: DVec3, half: f64, count: usize) -> Vec<DVec3> {
    let g = 1.220_744_084_605_759_5_f64;
    let part = |n: usize, root: f64| 2.0 * (n as f64 / root).fract() - 1.0;
    let place = |n| at + half * DVec3::new(part(n, g), part(n, g * g), part(n, g * g * g));
    (1..=count).map(place).collect()
}

/// Places of the surface in a box, on lines along the axes that are `step` apart.
fn surface(piece: &Piece, b: &Aabb, step: f64) -> Vec<DVec3> {
    let count = (b.size() / step).ceil().to_array().map(|n| n as usize);
    let mut found = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for i in 0..=count[u] {
            for j in 0..=count[v] {
                let place = |n: usize| {
                    let mut p = b.min;
                    p[axis] += n as f64 * step;
                    p[u] += i as f64 * step;
                    p[v] += j as f64 * step;
                    p
                };
                let value = |n: usize| piece.field.value(place(n)) - piece.iso;
                let mut last = value(0);
                for n in 1..=count[axis] {
                    let now = value(n);
                    if (now > 0.0) != (last > 0.0) {
                        found.push(onto(piece, place(n - 1).lerp(place(n), last / (last - now))));
                    }
                    last = now;
                }
            }
        }
    }
    found
}

fn onto(piece: &Piece, mut x: DVec3) -> DVec3 {
    for _ in 0..3 {
        let (value, g) = piece.field.value_gradient(x);
        x -= (value - piece.iso) / g.length_squared() * g;
    }
    x
}

/// Distance to the surface: of all places of it that are nearly nearest, each slid to where the way stands upright on it.
fn distance(piece: &Piece, all: &[DVec3], p: DVec3, step: f64) -> f64 {
    let near = all.iter().map(|x| x.distance(p)).fold(f64::INFINITY, f64::min);
    let around = all.iter().filter(|x| x.distance(p) < near + 0.1 * step);
    let slid = |x: &DVec3| {
        let (mut x, mut best) = (*x, x.distance(p));
        for _ in 0..12 {
            let n = piece.field.value_gradient(x).1.normalize();
            let side = (p - x) - (p - x).dot(n) * n;
            x = onto(piece, x + (0.5 * side).clamp_length_max(step));
            best = best.min(x.distance(p));
        }
        best
    };
    around.map(slid).fold(near, f64::min)
}

/// What the offset of a ball is off by, for nodes of some distance.
fn accuracy(piece: &Piece) {
    let step = 0.3;
    let all = surface(piece, &Aabb::new(piece.at, piece.at).widened(13.0), step);
    println!("{}: {} places of the surface", piece.name, all.len());
    for radius in [5.0, 2.0, 0.5, 0.0] {
        for interpolation in [Interpolation::Cubic, Interpolation::Linear] {
            let spacings = if radius > 0.0 {
                [0.4, 0.5, 0.75, 1.0, 1.5, 2.5]
            } else {
                [0.15, 0.2, 0.25, 0.375, 0.5, 1.0]
            };
            for spacing in spacings {
                let options = BrickOptions {
                    reach: if radius > 0.0 { 15.0 } else { 7.5 },
                    spacing,
                    band: radius + 2.0 * spacing,
                    interpolation,
                };
                let start = CpuTime.start();
                let brick = DistanceBrick::new(&Surface::new(&piece.field, piece.iso), piece.at, &options);
                let made = CpuTime.end(start) * 1e-6;
                let mut off = Vec::new();
                let mut slope = Vec::new();
                for mut x in places(piece.at, 6.0, 150) {
                    for _ in 0..40 {
                        let (phi, g) = brick.distance(x);
                        x -= (phi - radius).clamp(-0.5, 0.5) / g.length_squared().max(0.1) * g;
                    }
                    let (phi, g) = brick.distance(x);
                    if (phi - radius).abs() < 1e-3 && (x - piece.at).abs().max_element() < 7.0 {
                        off.push((distance(piece, &all, x, step) - radius).abs());
                        slope.push((g.length() - 1.0).abs());
                    }
                }
                off.sort_by(f64::total_cmp);
                slope.sort_by(f64::total_cmp);
                let at = |list: &[f64], share: f64| list.get((share * list.len() as f64) as usize).copied();
                println!(
                    "ball {radius} mm, nodes {spacing} mm, {interpolation:?}: {made:.1} ms, {:.2} MB; off by {:.4} mm (median), {:.4} (95 %), \
                     {:.4} (worst); |∇φ| by {:.4} (median), {:.4} (95 %); {} places, {:?}",
                    brick.bytes() as f64 * 1e-6,
                    at(&off, 0.5).unwrap_or(f64::NAN),
                    at(&off, 0.95).unwrap_or(f64::NAN),
                    off.last().unwrap_or(&f64::NAN),
                    at(&slope, 0.5).unwrap_or(f64::NAN),
                    at(&slope, 0.95).unwrap_or(f64::NAN),
                    off.len(),
                    brick.unresolved(),
                );
            }
        }
    }
}

fn snapshots(c: &mut Criterion<CpuTime>, piece: &Piece) {
    let mut group = c.benchmark_group(&piece.name);
    group.sample_size(10);
    let layers = Layers::new();
    let fields: [Arc<dyn Field>; 2] = [Arc::new(piece.field.clone()), Arc::new(piece.dented())];
    for radius in [0.0, 0.5, 2.0, 5.0] {
        let demand = Demand::of_ball(radius);
        group.bench_function(BenchmarkId::new(format!("ball {radius} mm"), "made"), |b| {
            b.iter(|| {
                let mut maker = SnapshotMaker::new(demand);
                black_box(maker.make(piece.at, &[piece.object(&fields[0], &layers)], 0))
            });
        });
        let mut maker = SnapshotMaker::new(demand);
        let mut n = 0;
        let mut next = || {
            n += 1;
            maker.free();
            maker.make(piece.at, &[piece.object(&fields[n % 2], &layers)], n as u64)
        };
        next();
        group.bench_function(
            BenchmarkId::new(format!("ball {radius} mm"), "after an edit"),
            |b| {
                b.iter(|| black_box(next()));
            },
        );
        let mut maker = SnapshotMaker::new(demand);
        let mut n = 0;
        let mut follow = || {
            n += 1;
            maker.free();
            let along = DVec3::X * if n % 2 == 0 { 0.0 } else { 0.3 * demand.reach };
            maker.make(piece.at + along, &[piece.object(&fields[0], &layers)], 0)
        };
        follow();
        group.bench_function(
            BenchmarkId::new(format!("ball {radius} mm"), "box follows"),
            |b| {
                b.iter(|| black_box(follow()));
            },
        );
        let snapshot = follow();
        let asked = places(piece.at, 6.0, 4096);
        let mut sum = 0.0;
        group.bench_function(
            BenchmarkId::new(format!("ball {radius} mm"), "4096 distances"),
            |b| {
                b.iter(|| sum += asked.iter().map(|p| snapshot.distance(*p).0).sum::<f64>());
            },
        );
        assert!(sum.is_finite());
    }
    group.finish();
}

/// What a tick of the proxy costs, over the surface with the hand 2 mm inside: mean and 99 %, of the least time that each tick took in
/// some rounds, so that what else the machine did is left out.
fn ticks(piece: &Piece) {
    let field: Arc<dyn Field> = Arc::new(piece.field.clone());
    let layers = Layers::new();
    let inward = piece.field.value_gradient(piece.at).1.normalize();
    let (u, v) = inward.any_orthonormal_pair();
    for radius in [0.0, 0.5, 2.0, 5.0] {
        let mut maker = SnapshotMaker::new(Demand::of_ball(radius));
        let snapshot = maker.make(piece.at, &[piece.object(&field, &layers)], 0);
        let hand = |n: usize| {
            let (sine, cosine) = libm::sincos(1e-3 * n as f64);
            let depth = 2.0 - (radius + 4.0) * (1.0 - n as f64 / 500.0).max(0.0);
            Pose::at(piece.at + 3.0 * (sine * u + cosine * v) + (depth - radius) * inward)
        };
        let mut least = vec![f64::INFINITY; 6000];
        let mut touched = 0;
        for _ in 0..4 {
            let mut proxy = Proxy::new(ProxyOptions {
                radius,
                ..ProxyOptions::default()
            });
            touched = 0;
            for (n, least) in least.iter_mut().enumerate() {
                let pose = hand(n);
                let start = std::time::Instant::now();
                let felt = black_box(proxy.tick(&*snapshot, &pose, 1e-3));
                *least = least.min(start.elapsed().as_secs_f64() * 1e6);
                touched += usize::from(felt.force != DVec3::ZERO);
            }
        }
        let mean = least.iter().sum::<f64>() / least.len() as f64;
        least.sort_by(f64::total_cmp);
        println!(
            "{}, ball {radius} mm: tick {mean:.2} µs on the mean, {:.2} µs at 99 %; {touched} of {} touch",
            piece.name,
            least[least.len() * 99 / 100],
            least.len()
        );
    }
}

fn haptics(c: &mut Criterion<CpuTime>) {
    let scans = scanned();
    // Tables come without a filter.
    let is_whole = std::env::args().skip(1).all(|a| a.starts_with("--"));
    if is_whole {
        scans.iter().for_each(accuracy);
        scans.iter().for_each(ticks);
    }
    for depth in 1..=4 {
        let ball = Piece::ball(depth);
        if is_whole {
            ticks(&ball);
        }
        snapshots(c, &ball);
    }
    scans.iter().for_each(|piece| snapshots(c, piece));
}

fn main() {
    on_one_core(haptics);
}
