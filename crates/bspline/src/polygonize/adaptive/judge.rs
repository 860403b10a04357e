//! How finely the cells of a block have to be divided.

use glam::{DVec3, Mat3, Vec3};

use super::cases::is_complex;
use super::grid::{Cells, bit, each, holds, node_index, octant_of_set, octant_place, rank};
use super::hidden::{SEARCH, may_hide, may_peak, slopes};
use super::sample::{Judge, Sample, Scratch};
use crate::Jet;
use crate::polygonize::blocks::{BlockKey, CELLS, NODES};

impl Sample {
    /// The cells of a set whose errors are not known as well as `judge` asks.
    pub fn unjudged(&self, judge: &Judge, cells: &Cells) -> Cells {
        let least = judge.least as f32;
        let vague = each(std::array::from_fn(|x| {
            cells[x] & (self.bounded[x] | self.guessed[x])
        }))
        .filter(|c| holds(&self.bounded, *c) == (self.error(*c) > least));
        let mut new: Cells = std::array::from_fn(|x| cells[x] & !self.judged[x]);
        for c in vague {
            new[c[0]] |= bit(c);
        }
        for octant in 0..8 {
            if self.should_be_coarse(octant, least) != self.is_coarse(octant) {
                let known = octant_of_set(&self.judged, octant);
                for x in 0..CELLS {
                    new[x] |= known[x] & cells[x] & !self.crossed[x];
                }
            }
        }
        new
    }

    /// Whether the crossed cells of an octant are so far from fine enough that what hides beside them can wait.
    fn should_be_coarse(&self, octant: usize, least: f32) -> bool {
        self.guesses[octant] > COARSE * least
    }

    fn is_coarse(&self, octant: usize) -> bool {
        self.coarse >> octant & 1 == 1
    }

    /// Judges `cells` of the block, those of them that lie in the frame.
    pub fn judge(
        &mut self,
        judge: &Judge,
        level: usize,
        key: BlockKey,
        cells: &Cells,
        scratch: &mut Scratch,
    ) {
        let grids = judge.grids;
        let origin = key.map(|b| b * CELLS as i32);
        let new = *cells;
        let crossed = self.crossed;
        let inside_frame = |c: [usize; 3]| {
            (0..3).all(|a| {
                let at = origin[a] + c[a] as i32;
                0 <= at && at < grids.cells(level, a)
            })
        };
        let border = grids.meets_border(level, key);
        let size = grids.size(level);
        let h = size.max_element();
        let world_from_grid = grids.frames[level].world_from_grid;
        let least = judge.least as f32;
        scratch.points.clear();
        scratch.owners.clear();
        for octant in 0..8usize {
            let at = octant_place(octant);
            let part: Cells = octant_of_set(&new, octant);
            if part == [0; CELLS] {
                continue;
            }
            let lo: [i32; 3] = std::array::from_fn(|a| origin[a] + at[a] as i32);
            if (0..3).any(|a| lo[a] + 4 <= 0 || lo[a] >= grids.cells(level, a)) {
                continue;
            }
            let is_crossed = (0..CELLS).any(|x| part[x] & crossed[x] != 0);
            if !is_crossed {
                let bounds = judge.bounds(level, lo, 4);
                if bounds.hi <= judge.iso || bounds.lo > judge.iso {
                    continue;
                }
            }
            let is_coarse = self.should_be_coarse(octant, least);
            if is_coarse != self.is_coarse(octant) {
                self.coarse ^= 1 << octant;
                for (x, word) in octant_of_set(&self.judged, octant).into_iter().enumerate() {
                    self.judged[x] &= !(word & !crossed[x]);
                }
            }
            let mut bend = None;
            for c in each(part) {
                if border && !inside_frame(c) {
                    continue;
                }
                let cell: [i32; 3] = std::array::from_fn(|a| origin[a] + c[a] as i32);
                if holds(&crossed, c) {
                    let is_guessed = holds(&self.guessed, c);
                    let guess = if is_guessed {
                        self.error(c)
                    } else {
                        self.guess(judge, level, key, c)
                    };
                    if is_guessed && guess > least {
                        continue;
                    }
                    self.guessed[c[0]] &= !bit(c);
                    let bend = *bend
                        .get_or_insert_with(|| judge.field.hessian_bound(&grids.world_box(level, lo, 4)));
                    let v = self.corners(c);
                    let error =
                        self.judge_crossed(judge, level, c, cell, &v, bend, h, &world_from_grid, scratch);
                    *self.error_mut(c) = error.max(guess);
                    continue;
                }
                let may_hold = if level == grids.depth() {
                    // What hides here cannot be divided.
                    false
                } else if is_coarse {
                    let bounds = judge.bounds(level, cell, 1);
                    bounds.lo <= judge.iso && judge.iso < bounds.hi
                } else {
                    let v = self.corners(c);
                    level < judge.detection && {
                        let bend = *bend
                            .get_or_insert_with(|| judge.field.hessian_bound(&grids.world_box(level, lo, 4)));
                        let own_bend = || judge.field.hessian_bound(&grids.world_box(level, cell, 1));
                        may_peak(&v, bend, size)
                            && may_peak(&v, own_bend(), size)
                            && may_hide(judge, level, cell, v[0] > 0.0, SEARCH)
                    }
                };
                self.hidden[c[0]] &= !bit(c);
                self.hidden[c[0]] |= if may_hold { bit(c) } else { 0 };
            }
        }
        self.measure(judge, h, scratch);
        for x in 0..CELLS {
            self.judged[x] |= new[x];
        }
    }

    /// Lower bound of the chord error of a crossed cell, by differences of the values at nodes; 0 where they do not tell.
    pub fn guess(&self, judge: &Judge, level: usize, key: BlockKey, c: [usize; 3]) -> f32 {
        // First nodes of the three along each axis that second differences are taken of.
        let first = c.map(|c| c.max(1) - 1);
        let is_in = |a: usize| {
            let low = key[a] * CELLS as i32 + first[a] as i32;
            0 <= low && low + 2 <= judge.grids.cells(level, a)
        };
        if !(0..3).all(is_in) {
            return 0.0;
        }
        const STRIDES: [usize; 3] = [NODES * NODES, NODES, 1];
        let size = judge.grids.size(level).as_vec3();
        let mut second = [0.0f32; 3];
        for a in 0..3 {
            let (s, t, u) = (STRIDES[a], STRIDES[(a + 1) % 3], STRIDES[(a + 2) % 3]);
            let start = node_index(c) - s * (c[a] - first[a]);
            let at = |n: usize| {
                self.values[start + n]
                    + self.values[start + n + t]
                    + self.values[start + n + u]
                    + self.values[start + n + t + u]
            };
            second[a] = 0.25 * (at(0) - 2.0 * at(s) + at(2 * s)) / (size[a] * size[a]);
        }
        let v = self.corners(c);
        let x = [v[4] - v[0], v[5] - v[1], v[6] - v[2], v[7] - v[3]];
        let y = [v[2] - v[0], v[3] - v[1], v[6] - v[4], v[7] - v[5]];
        let xy = 0.5 * (x[2] - x[0] + x[3] - x[1]) / (size.x * size.y);
        let xz = 0.5 * (x[1] - x[0] + x[3] - x[2]) / (size.x * size.z);
        let yz = 0.5 * (y[1] - y[0] + y[3] - y[2]) / (size.y * size.z);
        let hessian = Mat3::from_cols(
            Vec3::new(second[0], xy, xz),
            Vec3::new(xy, second[1], yz),
            Vec3::new(xz, yz, second[2]),
        );
        let h = size.max_element();
        let error = curvature(slopes(&v, size), hessian) * h * h / 8.0;
        // Not a number, where the gradient vanishes.
        if error.is_nan() {
            0.0
        } else {
            error.min(CREASE as f32 * h) / GUESS
        }
    }

    /// A lower bound of a crossed cell's error, and points of the surface in it where the curvature is to be asked.
    fn judge_crossed(
        &mut self,
        judge: &Judge,
        level: usize,
        c: [usize; 3],
        cell: [i32; 3],
        v: &[f32; 8],
        octant_bend: f64,
        h: f64,
        world_from_grid: &glam::DAffine3,
        scratch: &mut Scratch,
    ) -> f32 {
        let mut bend = octant_bend;
        if bend == f64::INFINITY {
            bend = judge.field.hessian_bound(&judge.grids.world_box(level, cell, 1));
            if bend == f64::INFINITY {
                self.creased[c[0]] |= bit(c);
                return (CREASE * h) as f32;
            }
        }
        if is_complex(self.case(c)) || v.iter().any(|v| !v.is_finite()) {
            return (CREASE * h) as f32;
        }
        let size = judge.grids.size(level);
        let weight = (1.0 / (size * size)).as_vec3();
        let slope = |t: [f32; 3]| trilinear(v, t);
        let (_, middle) = slope([0.5; 3]);
        let steep = f64::from(
            (0..3)
                .map(|a| middle[a] * middle[a] * weight[a])
                .sum::<f32>()
                .sqrt(),
        );
        let most = bend * h * h / (8.0 * steep);
        if most <= judge.least {
            self.bounded[c[0]] |= bit(c);
            return most as f32;
        }
        self.bounded[c[0]] &= !bit(c);
        let origin = DVec3::from_array(cell.map(f64::from));
        let owner = rank(&self.crossed, c) as u16;
        let first = scratch.points.len();
        let limit = (0.5 * h) as f32;
        // The middles of every other eighth of the cell, like the corners of a tetrahedron.
        for s in [0usize, 3, 5, 6] {
            let t = [s >> 2, s >> 1 & 1, s & 1].map(|b| 0.25 + 0.5 * b as f32);
            let (f, g) = slope(t);
            let square: f32 = (0..3).map(|a| g[a] * g[a] * weight[a]).sum();
            let step = f / square;
            if f.abs() > limit * square.sqrt() {
                continue;
            }
            let p: [f32; 3] = std::array::from_fn(|a| t[a] - step * g[a] * weight[a]);
            if p.iter().all(|x| (0.0..=1.0).contains(x)) {
                let q = DVec3::from_array(p.map(f64::from));
                scratch.points.push(world_from_grid.transform_point3(origin + q));
                scratch.owners.push((owner, most as f32));
            }
        }
        if scratch.points.len() == first {
            scratch
                .points
                .push(world_from_grid.transform_point3(origin + mean_crossing(v)));
            scratch.owners.push((owner, most as f32));
        }
        // Points may miss a bend that the bound of a coarse cell knows.
        (MISTRUST * most).min(CREASE * h) as f32
    }

    /// Raises the errors by the curvatures at the points found.
    fn measure(&mut self, judge: &Judge, h: f64, scratch: &mut Scratch) {
        let Scratch {
            points, owners, jets, ..
        } = scratch;
        let zero = Jet {
            value: 0.0,
            gradient: DVec3::ZERO,
            hessian: glam::DMat3::ZERO,
        };
        jets.resize(points.len(), zero);
        judge.field.jets(points, jets);
        for ((owner, most), jet) in owners.iter().zip(jets.iter()) {
            let bend = curvature(jet.gradient.as_vec3(), jet.hessian.as_mat3());
            let error = f64::from(bend) * h * h / 8.0;
            // Not a number, where the gradient vanishes: no flatter than a crease.
            let error = if error.is_nan() {
                CREASE * h
            } else {
                error.min(CREASE * h)
            };
            let slot = &mut self.errors[usize::from(*owner)];
            *slot = slot.max((error as f32).min(*most));
        }
    }
}

/// What a crease, or a surface that is not told apart, can cost in cells: half of one.
const CREASE: f64 = 0.5;

/// What differences of values may say too much of an error.
const GUESS: f32 = 1.5;

/// Errors above those that are asked for, times this, are left to the next levels.
const COARSE: f32 = 4.0;

/// Share of the bound of a cell's error that counts where points say less.
const MISTRUST: f64 = 1.0 / 16.0;

/// Value and gradient, by cells, of the trilinear function through the corners.
#[inline]
fn trilinear(v: &[f32; 8], t: [f32; 3]) -> (f32, [f32; 3]) {
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let x: [f32; 4] = std::array::from_fn(|i| mix(v[i], v[i + 4], t[0]));
    let dx: [f32; 4] = std::array::from_fn(|i| v[i + 4] - v[i]);
    let y = [mix(x[0], x[2], t[1]), mix(x[1], x[3], t[1])];
    let dy = [x[2] - x[0], x[3] - x[1]];
    let gx = mix(mix(dx[0], dx[2], t[1]), mix(dx[1], dx[3], t[1]), t[2]);
    (mix(y[0], y[1], t[2]), [gx, mix(dy[0], dy[1], t[2]), y[1] - y[0]])
}

/// Mean of the crossings of a cell's edges, in cells.
fn mean_crossing(v: &[f32; 8]) -> DVec3 {
    let (mut sum, mut count) = (DVec3::ZERO, 0.0);
    for a in 0..8usize {
        for axis in 0..3 {
            let bit = 4 >> axis;
            let (p, q) = (v[a], v[a | bit]);
            if a & bit == 0 && (p > 0.0) != (q > 0.0) {
                let mut at = DVec3::new((a >> 2) as f64, (a >> 1 & 1) as f64, (a & 1) as f64);
                at[axis] += f64::from(p / (p - q)).clamp(0.0, 1.0);
                sum += at;
                count += 1.0;
            }
        }
    }
    sum / f64::max(count, 1.0)
}

/// Largest normal curvature, in magnitude, of the level set through a point with that gradient and Hessian.
///
/// With the Hessian `A` across the unit gradient `n`, `tr A = tr H - nᵀHn` and `‖A‖² = ‖H‖² - 2|Hn|² + (nᵀHn)²` give
/// both of its eigenvalues.
#[inline(always)]
fn curvature(gradient: Vec3, hessian: Mat3) -> f32 {
    let slope = gradient.length();
    let n = gradient / slope;
    let hn = hessian * n;
    let along = n.dot(hn);
    let h = &hessian;
    let sum = h.x_axis.x + h.y_axis.y + h.z_axis.z - along;
    let square = h.x_axis.length_squared() + h.y_axis.length_squared() + h.z_axis.length_squared()
        - 2.0 * hn.length_squared()
        + along * along;
    0.5 * (sum.abs() + (2.0 * square - sum * sum).max(0.0).sqrt()) / slope
}
