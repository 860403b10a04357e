use bspline::hierarchical::{BlockEdit, BrickKey, Change, DenseCorrections, Lattice, LevelEdit};
use bspline::polygonize::*;
use bspline::{Aabb, Field, Frame, HierarchicalSpline};
use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;
const CELLS: u32 = 32;
const RADIUS: f64 = 0.36;
const BAND: f64 = 2.0;
struct Ball {
    field: HierarchicalSpline<f32>,
    level: usize,
}

impl Ball {
    /// Distance to a ball on level 0; small waves near its surface on `depth` finer levels.
    fn new(depth: u32) -> Self {
        let lattice = Lattice {
            world_from_lattice: DAffine3::IDENTITY,
            cells: [CELLS; 3],
        };
        let levels = (0..=depth).map(|level| {
            let n = CELLS << level;
            let bricks = (n + 2) / 8 + 1;
            let keys = (0..bricks).into_par_iter().flat_map_iter(|x| {
                (0..bricks).flat_map(move |y| (0..bricks).map(move |z| BrickKey([x, y, z])))
            });
            let full: Vec<_> = keys
                .filter_map(|key| Some((key, Arc::new(brick(level, key)?.pack()))))
                .collect();
            full.into_iter().collect()
        });
        Self {
            field: HierarchicalSpline::from_corrections(lattice, 1.0, levels.collect()),
            level: depth as usize,
        }
    }

    /// The function next to a point.
    fn function(&self, p: DVec3) -> [u32; 3] {
        let p = p * f64::from(1u32 << self.level);
        p.to_array().map(|p| p as u32 + 1)
    }

    /// Where a stroke along the surface is after `i` steps of one finest interval each.
    fn stroke(&self, i: usize) -> DVec3 {
        let turn = 0.4 + i as f64 * self.cell() / (RADIUS * f64::from(CELLS));
        let (u, v) = (DVec3::new(0.8, 0.0, 0.6), DVec3::new(0.36, 0.8, -0.48));
        on_ball(f64::cos(turn) * u + f64::sin(turn) * v)
    }

    /// Point number `i` of a sequence that covers the surface evenly: steps of the plastic number \[Roberts18\].
    fn scattered(i: usize) -> DVec3 {
        let [a, b] = [0.754_877_666_25, 0.569_840_290_998].map(|step| (i as f64 * step).fract());
        let (z, turn) = (2.0 * a - 1.0, std::f64::consts::TAU * b);
        let r = (1.0 - z * z).sqrt();
        on_ball(DVec3::new(r * f64::cos(turn), r * f64::sin(turn), z))
    }

    /// Width of a cell of the finest level.
    fn cell(&self) -> f64 {
        1.0 / f64::from(1u32 << self.level)
    }
}

fn on_ball(direction: DVec3) -> DVec3 {
    let edge = f64::from(CELLS);
    DVec3::splat(0.5 * edge) + RADIUS * edge * direction
}

/// Functions of one brick of the ball; none if there are none.
fn brick(level: u32, key: BrickKey) -> Option<DenseCorrections<f32>> {
    let n = CELLS << level;
    let (middle, radius) = (DVec3::splat(f64::from(n) / 2.0), RADIUS * f64::from(n));
    let height = |knot: DVec3| radius - (knot - middle).length();
    let centre = DVec3::from_array(key.0.map(|k| f64::from(8 * k) + 2.5));
    if level > 0 && height(centre).abs() > 3.5 * 3f64.sqrt() + BAND {
        return None;
    }
    let mut corrections = DenseCorrections::empty();
    for slot in 0..512u32 {
        let at = [slot / 64, slot / 8 % 8, slot % 8];
        let function: [u32; 3] = std::array::from_fn(|a| 8 * key.0[a] + at[a]);
        if function.iter().any(|&f| f >= n + 3) {
            continue;
        }
        let height = height(DVec3::from_array(function.map(f64::from)) - 1.0);
        let value = match level {
            0 => height,
            _ if height.abs() > BAND => continue,
            _ => 0.05 * f64::sin(f64::from(7 * function[0] + 3 * function[1])) / f64::from(1u32 << level),
        };
        corrections.set(at.map(|a| a as usize), value as f32);
    }
    (corrections.mask != [0; 8]).then_some(corrections)
}

fn stats(mut t: Vec<f64>) -> String {
    t.sort_by(f64::total_cmp);
    format!("min {:.0} med {:.0} us", t[0], t[t.len() / 2])
}
#[test]
fn costs() {
    let depths: Vec<u32> = std::env::var("DEPTHS")
        .unwrap_or("2,3,4".into())
        .split(',')
        .map(|d| d.parse().unwrap())
        .collect();
    for depth in depths {
        let ball = Ball::new(depth);
        let frame = Frame {
            world_from_grid: DAffine3::IDENTITY,
            cells: [CELLS; 3],
        };
        let options = AdaptiveOptions {
            depth: depth as usize,
            detection: depth as usize,
            ..Default::default()
        };
        let error = 0.02 * ball.cell();
        let within = ball.field.lattice().world_box();
        for wide in [false, true] {
            for settled in [false, true] {
                if std::env::var("ONLY").is_ok_and(|o| o != format!("{wide}{settled}")) {
                    continue;
                }
                let start = Instant::now();
                let mut mesh = AdaptiveBlockMesh::new(&ball.field, &frame, &options, error, settled).unwrap();
                let made = start.elapsed().as_secs_f64();
                let mut field = ball.field.clone();
                let mut times = Vec::new();
                let mut sum = [0usize; 5];
                let n = std::env::var("N").map_or(if settled { 12 } else { 40 }, |n| n.parse().unwrap());
                for i in 0..n {
                    let next = if wide {
                        field
                            .edited_blocks(&[BlockEdit {
                                level: ball.level,
                                first: ball.function(ball.stroke(i)).map(|f| f - 8),
                                shape: [17; 3],
                                change: Change::Add(vec![0.01 * ball.cell() as f32; 17 * 17 * 17]),
                            }])
                            .unwrap()
                    } else {
                        field
                            .edited(&[LevelEdit {
                                level: ball.level,
                                function: ball.function(ball.stroke(i)),
                                delta: 0.05 * ball.cell() as f32,
                            }])
                            .unwrap()
                    };
                    let boxes = if wide {
                        next.changed_boxes(&field, &within)
                    } else if std::env::var("B20").is_ok() {
                        let middle = (ball.stroke(i) / ball.cell()).floor() + 0.5;
                        let reach = DVec3::new(2.0, 0.5, 0.5);
                        vec![Aabb::new(
                            (middle - reach) * ball.cell(),
                            (middle + reach) * ball.cell(),
                        )]
                    } else {
                        let f = DVec3::from_array(ball.function(ball.stroke(i)).map(f64::from));
                        vec![Aabb::new((f - 3.0) * ball.cell(), (f + 1.0) * ball.cell())]
                    };
                    let next = if std::env::var("B20").is_ok() {
                        field.clone()
                    } else {
                        next
                    };
                    if i == 0 && !settled {
                        for b in boxes.iter().take(4) {
                            println!(
                                "  {} boxes, size in cells {}",
                                boxes.len(),
                                b.size() / ball.cell()
                            );
                        }
                    }
                    let start = Instant::now();
                    let u = mesh.update(&next, &boxes).unwrap();
                    times.push(start.elapsed().as_secs_f64() * 1e6);
                    for (s, v) in
                        sum.iter_mut()
                            .zip([u.sampled, u.placed, u.drawn, u.settled, u.changed.len()])
                    {
                        *s += v;
                    }
                    field = next;
                }
                let triangles = if depth < 5 {
                    mesh.mesh().unwrap().0.mesh.triangles.len()
                } else {
                    0
                };
                println!(
                    "depth {depth} coeffs {} wide {wide} settled {settled}: made {made:.2} s, {triangles} triangles, blocks {}; {} ; sampled/placed/drawn/settled/changed {:?}",
                    field.coefficient_count(),
                    mesh.block_count(),
                    stats(times),
                    sum.map(|s| s / n)
                );
            }
        }
    }
}
