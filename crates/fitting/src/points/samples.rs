//! Oriented points, made ready: checked, scaled to a unit box, in Morton order.

use bspline::{HierarchicalSpline, Real};
use glam::DVec3;

use super::LEAST_POINTS;
use super::far_points::{beyond, drop_far_outliers};
use crate::FitError;
use crate::level::MAX_DEPTH;
use crate::level::assemble::{Level, assemble};
use crate::level::full_grid::FullGrid;

/// Points with normals, as given. Normals point outward and need no unit length.
#[derive(Clone, Copy, Debug)]
pub struct OrientedPoints<'a> {
    /// World positions.
    pub positions: &'a [DVec3],
    /// One normal per position.
    pub normals: &'a [DVec3],
    /// How far to trust the direction of each normal, 0 to 1, where they were estimated: the share that the part of the
    /// gradient across the normal has in the fit.
    pub certainty: Option<&'a [f32]>,
}

impl OrientedPoints<'_> {
    /// Diagonal of the box round the points that a fit uses, world units: what shares of a length refer to.
    /// 0 if no point can be used.
    pub fn diagonal(&self) -> f64 {
        let usable =
            |&i: &u32| finite(&self.positions[i as usize]) && usable_normal(self.normals[i as usize]);
        let mut kept: Vec<u32> = (0..self.positions.len() as u32).filter(usable).collect();
        drop_far_outliers(self.positions, &mut kept);
        let (min, max) = extent(self.positions, &kept);
        if kept.is_empty() {
            0.0
        } else {
            (max - min).length()
        }
    }
}

/// Margin of the box round the points, as a multiple of their longest side.
pub(crate) const BOX_SCALE: f64 = 1.15;

/// One sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    /// Where the conditions hold, unit box.
    pub position: DVec3,
    /// Where the point was measured, unit box.
    pub measured: DVec3,
    /// Outward unit normal; zero for a sign condition.
    pub normal: [f32; 3],
    /// Value asked for, unit box.
    pub target: f32,
    /// Share in the fit.
    pub weight: f32,
    /// Share of the part of the gradient across the normal.
    pub certainty: f32,
    /// Which of the points given it is; [`ADDED`] for a condition.
    pub source: u32,
}

/// Length of the mean of unit normals from which points at one place are one point.
const AGREED: f64 = 0.5;

/// Source of a condition that is no point of the cloud.
pub(crate) const ADDED: u32 = u32::MAX;

/// The usable samples in Morton order of their position.
#[derive(Debug)]
pub(crate) struct Samples {
    /// Positions in the unit box.
    pub positions: Vec<DVec3>,
    /// Outward unit normals; zero for a sign condition.
    pub normals: Vec<[f32; 3]>,
    /// Values asked for, unit box: 0, but for sign conditions and points moved to their feet.
    pub targets: Vec<f32>,
    /// Share of each sample in the fit, `0..=1`; 0 for points that are measured but not fitted.
    pub weights: Vec<f32>,
    /// Of that, the share of the part of the gradient across the normal, `0..=1`.
    pub certainty: Vec<f32>,
    /// Which of the points given each is; [`ADDED`] for a condition.
    pub source: Vec<u32>,
    /// Where the points were measured, unit box, if they were moved from there.
    measured: Option<Vec<DVec3>>,
    /// Edge of the (cubic) box in world units.
    pub scale: f64,
    /// Corner of the box in world units.
    pub origin: DVec3,
    /// Diagonal of the points' own bounding box, world units.
    pub diagonal: f64,
    /// What was left out, and why.
    pub notes: Vec<String>,
}

impl Samples {
    /// The field on the box of the samples whose level 0 is `base`, with the corrections of the `levels` below it.
    pub fn field<T: Real>(&self, base: &FullGrid<f64>, levels: &[Level<T>]) -> HierarchicalSpline<T> {
        assemble(self.origin, self.scale, base, levels)
    }

    /// Checks, scales and sorts.
    ///
    /// Left out, with a note: points that are not finite, points without a usable normal, lone points
    /// farther than ten times the robust extent of the rest, and points told twice.
    ///
    /// # Errors
    /// [`FitError::Degenerate`] if no normal is usable or the points span no volume or area;
    /// [`FitError::NotEnoughSamples`] if fewer than 10 are left.
    pub fn prepare(cloud: OrientedPoints<'_>) -> Result<Self, FitError> {
        assert_eq!(cloud.positions.len(), cloud.normals.len(), "one normal per point");
        let total = cloud.positions.len();
        let mut notes = Vec::new();
        let mut note = |count: usize, what: &str| note_left_out(&mut notes, count, total, what);
        let mut kept: Vec<u32> = (0..total as u32)
            .filter(|&i| finite(&cloud.positions[i as usize]))
            .collect();
        note(total - kept.len(), "a coordinate is not finite");
        let finite_count = kept.len();
        kept.retain(|&i| usable_normal(cloud.normals[i as usize]));
        note(finite_count - kept.len(), "the normal is zero or not finite");
        if kept.is_empty() && finite_count > 0 {
            return Err(FitError::Degenerate(
                "every normal is zero: give points with outward normals, or a mesh whose faces define them"
                    .into(),
            ));
        }
        let with_normal = kept.len();
        drop_far_outliers(cloud.positions, &mut kept);
        note(
            with_normal - kept.len(),
            "farther than ten extents from the bulk of the points",
        );
        if kept.len() < LEAST_POINTS {
            return Err(FitError::NotEnoughSamples {
                found: kept.len(),
                needed: LEAST_POINTS,
            });
        }
        Self::boxed(cloud, &kept, notes)
    }

    /// Those points of a cloud whose indices are `kept`, in their box.
    fn boxed(cloud: OrientedPoints<'_>, kept: &[u32], mut notes: Vec<String>) -> Result<Self, FitError> {
        let (min, max) = extent(cloud.positions, kept);
        let size = max - min;
        let longest = size.max_element();
        if longest <= 1e-12 * min.abs().max(max.abs()).max_element() || longest == 0.0 {
            return Err(FitError::Degenerate(format!(
                "all {} points lie at {min}",
                kept.len()
            )));
        }
        if is_collinear(cloud.positions, kept, longest) {
            return Err(FitError::Degenerate(
                "the points lie on one line: a solid needs a surface around it".into(),
            ));
        }
        let scale = BOX_SCALE * longest;
        let origin = (min + max) * 0.5 - scale * 0.5;
        let mut keyed: Vec<(u64, u32)> = kept
            .iter()
            .map(|&i| (morton((cloud.positions[i as usize] - origin) / scale), i))
            .collect();
        sort_by_morton(&mut keyed);
        let sorted = keyed.len();
        let (keyed, normals) = without_repeats(keyed, &cloud);
        note_left_out(
            &mut notes,
            sorted - keyed.len(),
            cloud.positions.len(),
            "they lie where another point does, which takes the mean of their normals",
        );
        let positions = keyed
            .iter()
            .map(|k| (cloud.positions[k.1 as usize] - origin) / scale)
            .collect();
        let targets = vec![0.0; keyed.len()];
        let certainty = keyed
            .iter()
            .map(|k| cloud.certainty.map_or(1.0, |c| c[k.1 as usize].clamp(0.0, 1.0)))
            .collect();
        Ok(Self {
            positions,
            normals,
            targets,
            weights: vec![1.0; keyed.len()],
            certainty,
            source: keyed.iter().map(|k| k.1).collect(),
            measured: None,
            scale,
            origin,
            diagonal: size.length(),
            notes,
        })
    }

    /// The samples without those beyond the corners `low` and `high`, unit box, in a box of their own.
    ///
    /// # Errors
    /// As [`Self::prepare`].
    pub fn cut_to(&self, cloud: OrientedPoints<'_>, low: DVec3, high: DVec3) -> Result<Self, FitError> {
        let is_within = |i: &usize| beyond((low, high), self.positions[*i]) <= 0.0;
        let all = 0..self.positions.len();
        let mut kept: Vec<u32> = all.filter(is_within).map(|i| self.source[i]).collect();
        kept.sort_unstable();
        let mut notes = self.notes.clone();
        note_left_out(
            &mut notes,
            self.positions.len() - kept.len(),
            cloud.positions.len(),
            "they lie far from all points that their neighbours speak for",
        );
        Self::boxed(cloud, &kept, notes)
    }

    /// Whether sample `index` is a condition on the sign of the field away from the surface, not a point of it.
    pub fn is_sign_condition(&self, index: usize) -> bool {
        self.normals[index] == [0.0; 3]
    }

    /// Indices of the points of the cloud that have weight.
    pub fn live_points(&self) -> impl Iterator<Item = usize> {
        (0..self.positions.len()).filter(|&i| !self.is_sign_condition(i) && self.weights[i] > 0.0)
    }

    /// World position at which a sample was measured.
    pub fn world(&self, index: usize) -> DVec3 {
        self.origin + self.entry(index).measured * self.scale
    }

    /// World position at which the conditions of a sample hold.
    pub fn world_of_conditions(&self, index: usize) -> DVec3 {
        self.origin + self.positions[index] * self.scale
    }

    /// Whether a sample was moved to its foot.
    pub fn is_moved(&self, index: usize) -> bool {
        self.measured
            .as_ref()
            .is_some_and(|m| m[index] != self.positions[index])
    }

    /// Sample `index`.
    pub fn entry(&self, index: usize) -> Entry {
        let position = self.positions[index];
        Entry {
            position,
            measured: self.measured.as_ref().map_or(position, |m| m[index]),
            normal: self.normals[index],
            target: self.targets[index],
            weight: self.weights[index],
            certainty: self.certainty[index],
            source: self.source[index],
        }
    }

    /// Other samples in the same box, put in Morton order.
    pub fn with_entries(&self, entries: Vec<Entry>) -> Self {
        let mut keyed: Vec<(u64, u32)> = entries.iter().map(|e| morton(e.position)).zip(0..).collect();
        sort_by_morton(&mut keyed);
        let sorted = || keyed.iter().map(|k| &entries[k.1 as usize]);
        let is_moved = entries.iter().any(|e| e.measured != e.position);
        Self {
            positions: sorted().map(|e| e.position).collect(),
            normals: sorted().map(|e| e.normal).collect(),
            targets: sorted().map(|e| e.target).collect(),
            weights: sorted().map(|e| e.weight).collect(),
            certainty: sorted().map(|e| e.certainty).collect(),
            source: sorted().map(|e| e.source).collect(),
            measured: is_moved.then(|| sorted().map(|e| e.measured).collect()),
            notes: self.notes.clone(),
            ..*self
        }
    }

    /// The same samples with conditions `f(x) = d` (unit box) added.
    pub fn with_sign_conditions(&self, conditions: &[(DVec3, f32)]) -> Self {
        let mut entries: Vec<Entry> = (0..self.positions.len()).map(|i| self.entry(i)).collect();
        entries.extend(conditions.iter().map(|&(position, target)| Entry {
            position,
            measured: position,
            normal: [0.0; 3],
            target,
            weight: 1.0,
            certainty: 1.0,
            source: ADDED,
        }));
        self.with_entries(entries)
    }

    /// The points of the cloud that have weight and whose conditions hold within `radius` of `at`, world units.
    pub fn within(&self, at: DVec3, radius: f64) -> Vec<usize> {
        let (at, radius) = ((at - self.origin) / self.scale, radius / self.scale);
        // Cells as wide as the ball, so that it meets eight of them.
        let mut depth = 0;
        while depth < MAX_DEPTH && 0.5f64.powi(depth as i32 + 1) >= 2.0 * radius {
            depth += 1;
        }
        let last = (1u64 << depth) - 1;
        let range = |a: usize| {
            let cell = |q: f64| ((q * (last + 1) as f64) as u64).min(last);
            cell(at[a] - radius)..=cell(at[a] + radius)
        };
        let before = |key: u64| self.positions.partition_point(|p| morton(*p) < key);
        let mut found = Vec::new();
        for x in range(0) {
            for y in range(1) {
                for z in range(2) {
                    let corner = DVec3::new(x as f64, y as f64, z as f64) / (last + 1) as f64;
                    let first = morton(corner);
                    let keys = 1u64 << (3 * (MAX_DEPTH - depth));
                    found.extend((before(first)..before(first + keys)).filter(|&i| {
                        let is_live = !self.is_sign_condition(i) && self.weights[i] > 0.0;
                        is_live && self.positions[i].distance(at) <= radius
                    }));
                }
            }
        }
        found
    }

    /// Mean spacing `√(area/N)` of the samples, unit box.
    ///
    /// The area is that of the occupied cells, `cells·h²/1.5`, on the grid where a cell holds about six points, or
    /// where it is `band` wide: noise fills a band round the surface that smaller cells would count.
    pub fn mean_spacing(&self, band: f64) -> f64 {
        // In Morton order, a sample opens new cells from the level on that parts it from the one before.
        let mut opened = [0usize; MAX_DEPTH + 1];
        let (mut n, mut last) = (0usize, None::<u64>);
        for i in self.live_points() {
            let key = morton(self.positions[i]);
            let from = last.map_or(0, |last| {
                let bits = 64 - (key ^ last).leading_zeros() as usize;
                MAX_DEPTH + 1 - bits.div_ceil(3)
            });
            if from <= MAX_DEPTH {
                opened[from] += 1;
            }
            (n, last) = (n + 1, Some(key));
        }
        let n = n.max(1);
        let occupied = |depth: usize| opened[..=depth].iter().sum::<usize>();
        let mut depth = 2;
        while depth < MAX_DEPTH && n > 6 * occupied(depth) && 0.5f64.powi(depth as i32 + 1) >= band {
            depth += 1;
        }
        let area = occupied(depth) as f64 * 0.25f64.powi(depth as i32) / 1.5;
        (area / n as f64).sqrt()
    }

    /// Cell of the grid with `2^depth` cells along the box.
    pub fn cell(&self, index: usize, depth: usize) -> [u32; 3] {
        let n = (1u64 << depth) as f64;
        (self.positions[index] * n).to_array().map(|x| x as u32)
    }
}

fn usable_normal(n: DVec3) -> bool {
    n.is_finite() && n.abs().max_element() > 0.0
}

pub(crate) fn finite(p: &DVec3) -> bool {
    p.is_finite() && p.abs().max_element() < 1e150
}

pub(crate) fn extent(positions: &[DVec3], kept: &[u32]) -> (DVec3, DVec3) {
    kept.iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), &i| {
            let p = positions[i as usize];
            (lo.min(p), hi.max(p))
        })
}

fn note_left_out(notes: &mut Vec<String>, count: usize, total: usize, why: &str) {
    if count > 0 {
        notes.push(format!("{count} of {total} points left out: {why}"));
    }
}

/// Whether all points lie within `1e-9` of the extent from the line through the two farthest found.
pub(crate) fn is_collinear(positions: &[DVec3], kept: &[u32], longest: f64) -> bool {
    let p = |i: u32| positions[i as usize];
    let first = p(kept[0]);
    let farthest = |from: DVec3| {
        kept.iter()
            .map(|&i| p(i))
            .max_by(|a, b| (*a - from).length().total_cmp(&(*b - from).length()))
    };
    let a = farthest(first).expect("not empty");
    let b = farthest(a).expect("not empty");
    let direction = (b - a).normalize_or_zero();
    kept.iter()
        .all(|&i| (p(i) - a).cross(direction).length() <= 1e-9 * longest)
}

/// Sorts by key, those of one key as they come: digit by digit, the last first.
/// The points of a cloud in Morton order, one where several lie at one place and face about the same way, with their normals. A
/// point told twice is no second measurement: it would pass its noise off as certain.
fn without_repeats(
    mut keyed: Vec<(u64, u32)>,
    cloud: &OrientedPoints<'_>,
) -> (Vec<(u64, u32)>, Vec<[f32; 3]>) {
    let unit = |n: DVec3| (n / n.abs().max_element()).normalize();
    let normal = |k: &(u64, u32)| unit(cloud.normals[k.1 as usize]);
    let place = |k: &(u64, u32)| cloud.positions[k.1 as usize].to_array();
    let (mut kept, mut normals) = (Vec::with_capacity(keyed.len()), Vec::with_capacity(keyed.len()));
    for near in keyed.chunk_by_mut(|a, b| a.0 == b.0) {
        if let [only] = near {
            normals.push(normal(only).as_vec3().to_array());
            kept.push(*only);
            continue;
        }
        near.sort_unstable_by(|a, b| {
            let axes = place(a).into_iter().zip(place(b));
            let order = axes.map(|(a, b)| a.total_cmp(&b)).find(|o| o.is_ne());
            order.unwrap_or(a.1.cmp(&b.1))
        });
        for same in near.chunk_by(|a, b| place(a) == place(b)) {
            let sum: DVec3 = same.iter().map(normal).sum();
            let agree = sum.length() > AGREED * same.len() as f64;
            if agree {
                kept.push(same[0]);
                normals.push(unit(sum).as_vec3().to_array());
            } else {
                kept.extend(same);
                normals.extend(same.iter().map(|k| normal(k).as_vec3().to_array()));
            }
        }
    }
    (kept, normals)
}

fn sort_by_morton(keyed: &mut Vec<(u64, u32)>) {
    const BITS: usize = 12;
    let mut sorted = vec![(0, 0); keyed.len()];
    for shift in (0..3 * MAX_DEPTH).step_by(BITS) {
        let digit = |key: u64| (key >> shift) as usize & ((1 << BITS) - 1);
        let mut place = vec![0u32; 1 << BITS];
        keyed.iter().for_each(|(key, _)| place[digit(*key)] += 1);
        let mut next = 0;
        for p in &mut place {
            next += std::mem::replace(p, next);
        }
        for entry in keyed.iter() {
            let p = &mut place[digit(entry.0)];
            sorted[*p as usize] = *entry;
            *p += 1;
        }
        std::mem::swap(keyed, &mut sorted);
    }
}

/// Interleaved bits of the cell at [`MAX_DEPTH`], x highest.
pub(crate) fn morton(unit: DVec3) -> u64 {
    let n = (1u64 << MAX_DEPTH) as f64;
    let spread = |x: f64| {
        let mut v = (x * n).clamp(0.0, n - 1.0) as u64;
        v = (v | v << 32) & 0x001f_0000_0000_ffff;
        v = (v | v << 16) & 0x001f_0000_ff00_00ff;
        v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
        v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
        (v | v << 2) & 0x1249_2492_4924_9249
    };
    spread(unit.x) << 2 | spread(unit.y) << 1 | spread(unit.z)
}
