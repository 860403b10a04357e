//! One level of a field fit: which functions take part, and what they add.

use bspline::hierarchical::{BRICK, BrickEdit, BrickKey, Corrections, DenseCorrections, active_slots};
use bspline::{Aabb, Field, Frame, HierarchicalSpline, Real};
use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use super::{Aim, FieldFitOptions};
use crate::FitError;

/// Cells of a level on each side of the surface in which its distance counts.
const NEAR: f64 = 3.0;

/// Target and field compared on one level.
#[derive(Clone, Copy)]
pub(super) struct LevelFit<'a, T> {
    pub target: &'a dyn Field,
    pub field: &'a HierarchicalSpline<T>,
    pub level: usize,
    /// The box, in lattice coordinates.
    pub within: &'a Aabb,
    pub options: &'a FieldFitOptions,
    /// Whether no coarser level was fitted: then all of the box counts.
    pub is_first: bool,
}

/// What one level found.
#[derive(Default)]
pub(super) struct Round<T> {
    pub edits: Vec<BrickEdit<T>>,
    /// Bricks below which the next level has to look.
    pub open: Vec<BrickKey>,
    pub samples: u64,
    pub worst: f64,
    pub over_tolerance: usize,
    pub wrong_signs: usize,
}

/// Values at the knots round a brick, z fastest.
struct Block {
    /// Number of the first knot.
    lo: [i64; 3],
    count: [usize; 3],
    target: Vec<f64>,
    /// `target - field`.
    rest: Vec<f64>,
}

impl Block {
    fn index(&self, knot: [i64; 3]) -> Option<usize> {
        let at: [i64; 3] = std::array::from_fn(|a| knot[a] - self.lo[a]);
        let is_inside = (0..3).all(|a| (0..self.count[a] as i64).contains(&at[a]));
        let [x, y, z] = at.map(|i| i as usize);
        is_inside.then(|| (x * self.count[1] + y) * self.count[2] + z)
    }

    fn knots(&self) -> impl Iterator<Item = [i64; 3]> {
        knots_between(
            self.lo,
            std::array::from_fn(|a| self.lo[a] + self.count[a] as i64 - 1),
        )
    }

    /// Replaces what lies outside the lattice's box, where coefficients do not reach, by straight lines from inside.
    fn go_on_outside(&mut self, last: [i64; 3]) {
        for axis in 0..3 {
            if self.lo[axis] >= 0 && self.lo[axis] + self.count[axis] as i64 - 1 <= last[axis] {
                continue;
            }
            let is_outside = |knot: &[i64; 3]| !(0..=last[axis]).contains(&knot[axis]);
            let outside: Vec<[i64; 3]> = self.knots().filter(is_outside).collect();
            for knot in outside {
                let face = knot[axis].clamp(0, last[axis]);
                let step = (face - knot[axis]).signum();
                let inside = |by: i64| {
                    let mut at = knot;
                    at[axis] = face + by * step;
                    self.index(at)
                };
                let Some(first) = inside(0) else { continue };
                let steps = (face - knot[axis]).abs() as f64;
                let second = inside(1).unwrap_or(first);
                let own = self.index(knot).expect("a knot of the block");
                for values in [&mut self.target, &mut self.rest] {
                    values[own] = values[first] + steps * (values[first] - values[second]);
                }
            }
        }
    }

    /// `combine` of every value with those before and behind it on an axis; `beyond` stands for what lies beside the block.
    fn along<V: Copy>(&self, axis: usize, values: &[V], beyond: V, combine: impl Fn(V, V, V) -> V) -> Vec<V> {
        let stride: usize = self.count[axis + 1..].iter().product();
        let mut combined = Vec::with_capacity(values.len());
        for slab in values.chunks(self.count[axis] * stride) {
            for (i, &own) in slab.iter().enumerate() {
                let before = if i >= stride { slab[i - stride] } else { beyond };
                let behind = slab.get(i + stride).copied().unwrap_or(beyond);
                combined.push(combine(before, own, behind));
            }
        }
        combined
    }

    /// Length of the target's slope in the world at every knot, from the neighbours that there are; `world_from_knot`
    /// takes the slope by knots there.
    fn slopes(&self, world_from_knot: DMat3) -> Vec<f64> {
        let [x, y, z] = [0, 1, 2].map(|axis| {
            // No value of the target is NaN: it marks a neighbour that there is not.
            self.along(axis, &self.target, f64::NAN, |a, own, b| {
                match (a.is_nan(), b.is_nan()) {
                    (false, false) => 0.5 * (b - a),
                    (true, false) => b - own,
                    (false, true) => own - a,
                    (true, true) => 0.0,
                }
            })
        });
        let slope = |((x, y), z): ((&f64, &f64), &f64)| (world_from_knot * DVec3::new(*x, *y, *z)).length();
        x.iter().zip(&y).zip(&z).map(slope).collect()
    }

    /// Whether anything is true at a knot or at one of the 26 about it.
    fn spread(&self, marks: Vec<bool>) -> Vec<bool> {
        (0..3).fold(marks, |marks, axis| {
            self.along(axis, &marks, false, |a, own, b| a | own | b)
        })
    }

    /// Coefficients of the functions centred on the knots: the quasi-interpolant of the rest, which is 0 beside the block.
    fn coefficients(&self) -> Vec<f64> {
        (0..3).fold(self.rest.clone(), |values, axis| {
            self.along(axis, &values, 0.0, |a, own, b| (8.0 * own - a - b) / 6.0)
        })
    }
}

/// What a knot says of the fit.
#[derive(Clone, Copy, Default)]
struct Judgement {
    /// Rest as a world length, or as a density.
    off: f64,
    counts: bool,
    exceeds: bool,
    wrong_sign: bool,
}

impl<T: Real> LevelFit<'_, T> {
    /// Bricks of the level that hold functions or knots of the box.
    pub fn all_bricks(&self) -> Vec<BrickKey> {
        let (lo, hi) = self.judged();
        let [first, last] = [lo, hi].map(brick_of);
        keys_between(first, last).collect()
    }

    /// Bricks of the level under `parents` that the surface may meet.
    pub fn children(&self, parents: Vec<BrickKey>) -> Vec<BrickKey> {
        let (lo, hi) = self.judged();
        let [first, last] = [lo, hi].map(brick_of);
        let all = parents
            .into_iter()
            .flat_map(|p| (0..8).map(move |octant| p.child(octant)));
        let inside = |key: &BrickKey| (0..3).all(|a| (first.0[a]..=last.0[a]).contains(&key.0[a]));
        let keys: Vec<BrickKey> = all.filter(inside).collect();
        let keep: Vec<bool> = keys.par_iter().map(|key| self.may_matter(*key)).collect();
        keys.into_iter()
            .zip(keep)
            .filter(|(_, keep)| *keep)
            .map(|(key, _)| key)
            .collect()
    }

    /// Whether the surface of target or field may come near a brick.
    fn may_matter(&self, key: BrickKey) -> bool {
        let Aim::Surface { iso, .. } = self.options.aim else {
            return true;
        };
        let reach = NEAR * self.spacing(self.level.min(self.options.finest));
        let knot = |by: f64| {
            DVec3::from_array(
                key.0
                    .map(|k| (8.0 * f64::from(k) + by) * self.spacing(self.level)),
            )
        };
        let b = Aabb::new(knot(-2.0) - reach, knot(7.0) + reach);
        let b = b.transformed(&self.field.lattice().world_from_lattice);
        self.target.bounds(&b).contains(iso) || self.field.bounds(&b).contains(iso)
    }

    /// Compares target and field at the knots of `keys` and says what the functions there should add.
    pub fn run(&self, keys: &[BrickKey]) -> Result<Round<T>, FitError> {
        let rounds: Vec<Result<Round<T>, FitError>> = keys.par_iter().map(|key| self.brick(*key)).collect();
        let mut all = Round::default();
        for round in rounds {
            let round = round?;
            // What is added reaches into the bricks beside.
            all.open
                .extend(round.edits.iter().flat_map(|edit| self.bricks_about(edit.key)));
            all.edits.extend(round.edits);
            all.open.extend(round.open);
            all.samples += round.samples;
            all.worst = all.worst.max(round.worst);
            all.over_tolerance += round.over_tolerance;
            all.wrong_signs += round.wrong_signs;
        }
        all.open.sort_unstable();
        all.open.dedup();
        Ok(all)
    }

    /// A brick and those beside it, as far as the box goes.
    fn bricks_about(&self, key: BrickKey) -> impl Iterator<Item = BrickKey> + use<T> {
        let (lo, hi) = self.judged();
        let [first, last] = [lo, hi].map(brick_of);
        let first = BrickKey(std::array::from_fn(|a| {
            first.0[a].max(key.0[a].saturating_sub(1))
        }));
        let last = BrickKey(std::array::from_fn(|a| last.0[a].min(key.0[a] + 1)));
        keys_between(first, last)
    }

    /// Replaces what `edits` add by what their functions should add now; returns the number of samples.
    pub fn correct(&self, edits: &mut [BrickEdit<T>]) -> u64 {
        let samples = edits.par_iter_mut().map(|edit| {
            let block = self.block(edit.key);
            let coefficients = block.coefficients();
            let at = |slot: usize| knot_of(edit.key, [slot / 64, slot / 8 % 8, slot % 8]);
            let value = |slot: usize| block.index(at(slot)).map_or(0.0, |i| coefficients[i]);
            let values = active_slots(edit.add.mask()).map(|slot| T::from_f64(value(slot)));
            edit.add = Corrections::new(*edit.add.mask(), values.collect());
            block.rest.len() as u64
        });
        samples.sum()
    }

    fn brick(&self, key: BrickKey) -> Result<Round<T>, FitError> {
        let block = self.block(key);
        if let Some(bad) = block.target.iter().position(|t| !t.is_finite()) {
            let at = block.knots().nth(bad).expect("a value for each knot");
            let q = DVec3::from_array(at.map(|k| k as f64)) * self.spacing(self.level);
            let p = self.field.lattice().world_from_lattice.transform_point3(q);
            return Err(FitError::Degenerate(format!(
                "the target is not finite at ({}, {}, {}); fit a field that is finite in the box",
                p.x, p.y, p.z
            )));
        }
        let slopes = match self.options.aim {
            Aim::Surface { .. } => {
                let to_world = self.field.lattice_from_world().matrix3.transpose();
                block.slopes(to_world * (1.0 / self.spacing(self.level)))
            }
            Aim::Density { .. } => vec![0.0; block.rest.len()],
        };
        let (lo, hi) = self.judged();
        let judged: Vec<Judgement> = (block.knots().enumerate())
            .map(|(i, knot)| match is_between(lo, knot, hi) {
                true => self.judge(block.target[i], block.rest[i], slopes[i]),
                false => Judgement::default(),
            })
            .collect();
        let mut round = Round {
            samples: block.rest.len() as u64,
            ..Round::default()
        };
        let (own_lo, own_hi) = (knot_of(key, [0; 3]), knot_of(key, [BRICK - 1; 3]));
        for (knot, judgement) in block.knots().zip(&judged) {
            if judgement.counts && is_between(own_lo, knot, own_hi) {
                round.worst = round.worst.max(judgement.off);
                round.over_tolerance += usize::from(judgement.exceeds);
                round.wrong_signs += usize::from(judgement.wrong_sign);
            }
        }
        if self.is_first || judged.iter().any(|j| j.exceeds) {
            round.open.push(key);
        }
        let takes_part = block.spread(judged.iter().map(|j| j.exceeds).collect());
        if self.level > self.options.finest || !takes_part.contains(&true) {
            return Ok(round);
        }
        let coefficients = block.coefficients();
        let (lo, hi) = self.allowed();
        let mut add = DenseCorrections::empty();
        for (i, knot) in block.knots().enumerate() {
            if takes_part[i] && is_between(own_lo, knot, own_hi) && is_between(lo, knot, hi) {
                let slot = std::array::from_fn(|a| (knot[a] - own_lo[a]) as usize);
                add.set(slot, T::from_f64(coefficients[i]));
            }
        }
        if add.mask != [0; BRICK] {
            round.edits.push(BrickEdit {
                level: self.level,
                key,
                add: add.pack(),
            });
        }
        Ok(round)
    }

    /// Of a knot where the target is `t` and changes by `slope` per world length.
    fn judge(&self, t: f64, rest: f64, slope: f64) -> Judgement {
        match self.options.aim {
            Aim::Density { tolerance } => Judgement {
                off: rest.abs(),
                counts: true,
                exceeds: rest.abs() > tolerance,
                wrong_sign: false,
            },
            Aim::Surface { iso, tolerance } => {
                let height = (t - iso).abs();
                // Next to a crease the surface may be rounded by an interval of the finest level.
                let rounding = tolerance + self.world_spacing(self.options.finest);
                let wrong_sign = (t > iso) != (t - rest > iso) && height > rounding * slope;
                // Coarser levels prepare a wider band, so that nothing large is left where a finer one begins.
                let band = self.level.min(self.options.finest);
                let is_near = height <= NEAR * self.world_spacing(band) * slope;
                let is_over = rest.abs() > tolerance * slope;
                Judgement {
                    off: if slope > 0.0 { rest.abs() / slope } else { 0.0 },
                    counts: is_near || wrong_sign,
                    exceeds: is_over && (is_near || self.is_first) || wrong_sign,
                    wrong_sign,
                }
            }
        }
    }

    /// Values at the knots of a brick's functions and one further on each side, as far as the box asks for them.
    fn block(&self, key: BrickKey) -> Block {
        let ((lo, hi), (first, last)) = (self.judged(), self.allowed());
        let start: [i64; 3] = std::array::from_fn(|a| (knot_of(key, [0; 3])[a]).max(lo[a].min(first[a])) - 1);
        let end: [i64; 3] =
            std::array::from_fn(|a| (knot_of(key, [BRICK - 1; 3])[a]).min(hi[a].max(last[a])) + 1);
        let count: [usize; 3] = std::array::from_fn(|a| (end[a] - start[a] + 1).max(0) as usize);
        let spacing = self.spacing(self.level);
        let frame = Frame {
            world_from_grid: self.field.lattice().world_from_lattice
                * DAffine3::from_scale(DVec3::splat(spacing)),
            cells: [1; 3],
        };
        let mut target = vec![0.0; count.iter().product()];
        let mut rest = target.clone();
        self.target.frame_values(&frame, start, count, &mut target);
        self.field.frame_values(&frame, start, count, &mut rest);
        rest.iter_mut().zip(&target).for_each(|(r, t)| *r = t - *r);
        let mut block = Block {
            lo: start,
            count,
            target,
            rest,
        };
        block.go_on_outside(self.field.lattice().cells_at(self.level).map(i64::from));
        block
    }

    /// Width of a cell of a level, in lattice coordinates.
    fn spacing(&self, level: usize) -> f64 {
        1.0 / (1u64 << level) as f64
    }

    fn world_spacing(&self, level: usize) -> f64 {
        self.field.lattice().spacing(level).max_element()
    }

    /// First and last knot on each axis that lie in the box.
    fn judged(&self) -> ([i64; 3], [i64; 3]) {
        let (lo, hi) = self.knots_in(0.0, 0);
        let last = self.field.lattice().cells_at(self.level).map(i64::from);
        (lo.map(|k| k.max(0)), std::array::from_fn(|a| hi[a].min(last[a])))
    }

    /// First and last knot of functions whose support stays within the box and two finest cells beside it, which is one
    /// support of the finest level.
    fn allowed(&self) -> ([i64; 3], [i64; 3]) {
        self.knots_in(2.0 * self.spacing(self.options.finest), 2)
    }

    /// Knots of the box widened by `reach` but for the outer `rim`; up to the lattice's last functions where the box
    /// reaches its faces.
    fn knots_in(&self, reach: f64, rim: i64) -> ([i64; 3], [i64; 3]) {
        let spacing = self.spacing(self.level);
        let last = self
            .field
            .lattice()
            .cells_at(self.level)
            .map(|n| i64::from(n) + 1);
        let extent = self.field.lattice().extent();
        let lo = std::array::from_fn(|a| {
            let start = self.within.min[a];
            match start <= 0.0 {
                true => -1,
                false => ((start - reach) / spacing).ceil() as i64 + rim,
            }
        });
        let hi = std::array::from_fn(|a| {
            let end = self.within.max[a];
            match end >= extent[a] {
                true => last[a],
                false => (((end + reach) / spacing).floor() as i64 - rim).min(last[a]),
            }
        });
        (lo, hi)
    }
}

fn is_between(lo: [i64; 3], knot: [i64; 3], hi: [i64; 3]) -> bool {
    (0..3).all(|a| (lo[a]..=hi[a]).contains(&knot[a]))
}

/// The knot on which the function in a slot of a brick is centred.
fn knot_of(key: BrickKey, slot: [usize; 3]) -> [i64; 3] {
    std::array::from_fn(|a| i64::from(key.0[a]) * BRICK as i64 + slot[a] as i64 - 1)
}

/// The brick with the function that is centred on a knot.
fn brick_of(knot: [i64; 3]) -> BrickKey {
    BrickKey(knot.map(|k| (k + 1).max(0) as u32 / BRICK as u32))
}

fn knots_between(lo: [i64; 3], hi: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    let range = move |a: usize| lo[a]..=hi[a];
    range(0).flat_map(move |x| range(1).flat_map(move |y| range(2).map(move |z| [x, y, z])))
}

fn keys_between(first: BrickKey, last: BrickKey) -> impl Iterator<Item = BrickKey> {
    let range = move |a: usize| first.0[a]..=last.0[a];
    range(0).flat_map(move |x| range(1).flat_map(move |y| range(2).map(move |z| BrickKey([x, y, z]))))
}
