//! What every field has to fulfil: one body for all implementers of [`Field`].

use bspline::{Aabb, Field, Frame};
use glam::{DAffine3, DMat3, DQuat, DVec3};

/// How much is tried and how close it has to be.
#[derive(Clone, Debug)]
pub struct Options {
    /// Seed of all random choices.
    pub seed: u64,
    /// Boxes whose bounds are checked to hold the field.
    pub sound_boxes: usize,
    /// Boxes whose bounds are compared with the true range.
    pub tight_boxes: usize,
    /// Limits on width of the bounds over width of the true range: median and 99th percentile.
    pub width_limits: [f64; 2],
    /// Share of random points at which the field may be too rough to compare with differences (creases, medial
    /// axis): 0 for a smooth field.
    pub rough_share: f64,
    /// Distance of the differences, in diagonals of the region.
    pub step: f64,
    /// Error allowed in gradients, in units of the largest gradient met; in Hessians, of the largest gradient
    /// over a hundredth of the diagonal (or of the Hessian there, if that is larger).
    pub difference_tolerance: f64,
    /// How far the ways to ask for a value may lie apart, in units of the largest value met.
    pub value_tolerance: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            seed: 1,
            sound_boxes: 100_000,
            tight_boxes: 3_000,
            width_limits: [4.0, 10.0],
            rough_share: 0.0,
            step: 1e-5,
            difference_tolerance: 1e-5,
            value_tolerance: 1e-14,
        }
    }
}

/// Checks everything; `name` stands in front of every failure. Returns the median and the 99th percentile of
/// the widths of the bounds over those of the true ranges.
pub fn field_conformance(name: &str, field: &dyn Field, region: &Aabb, options: &Options) -> [f64; 2] {
    bounds_are_sound(name, field, region, options);
    gradient_bounds_are_sound(name, field, region, options);
    bounds_along_are_sound(name, field, region, options);
    hessian_bounds_are_sound(name, field, region, options);
    ways_to_ask_agree(name, field, region, options);
    derivatives_match_differences(name, field, region, options);
    batches_equal_single_points(name, field, region, options);
    for frame in frames(region) {
        frame_values_do_not_depend_on_the_block(name, field, &frame, options);
    }
    bounds_are_tight(name, field, region, options)
}

/// SplitMix64.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// In `[0, 1)`.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }
    pub fn vector(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit())
    }
    pub fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }
    pub fn point(&mut self, b: &Aabb) -> DVec3 {
        (b.min + self.vector() * b.size()).min(b.max)
    }
    /// A box about a point of the region: 1e-4 to 1 of its size, edges within a factor of four.
    pub fn small_box(&mut self, region: &Aabb) -> Aabb {
        let share = 10f64.powf(-4.0 * self.unit());
        let edges = (self.vector() * -2.0).to_array().map(f64::exp2);
        let half = DVec3::from_array(edges) * region.size() * (0.5 * share);
        let center = self.point(region);
        Aabb {
            min: center - half,
            max: center + half,
        }
    }
}

/// Least and largest value found in a box: at its corners, centre and random points, and from the two best of
/// them uphill and downhill.
fn range_found(field: &dyn Field, b: &Aabb, samples: usize, random: &mut Random) -> [f64; 2] {
    let corners = (0..8).map(|c| {
        DVec3::from_array(std::array::from_fn(|a| {
            if c >> a & 1 == 0 { b.min[a] } else { b.max[a] }
        }))
    });
    let inner: Vec<DVec3> = (0..samples).map(|_| random.point(b)).collect();
    let mut best = [(f64::INFINITY, DVec3::ZERO), (f64::NEG_INFINITY, DVec3::ZERO)];
    for p in corners.chain([b.center()]).chain(inner) {
        let v = field.value(p);
        if v < best[0].0 {
            best[0] = (v, p);
        }
        if v > best[1].0 {
            best[1] = (v, p);
        }
    }
    let search = |sign: f64, (mut v, mut p): (f64, DVec3)| {
        let mut step = 0.5;
        for _ in 0..12 {
            let slope = field.value_gradient(p).1 * sign;
            let direction = slope.normalize_or_zero() * b.size().length();
            let next = (p + direction * step).clamp(b.min, b.max);
            let there = field.value(next);
            if (there - v) * sign > 0.0 {
                (v, p) = (there, next);
            } else {
                step *= 0.3;
            }
        }
        v
    };
    [search(-1.0, best[0]), search(1.0, best[1])]
}

fn bounds_are_sound(name: &str, field: &dyn Field, region: &Aabb, options: &Options) {
    let mut random = Random(options.seed);
    for i in 0..options.sound_boxes {
        let mut b = random.small_box(region);
        // Some boxes are faces, edges and points; some reach the corners of the region exactly.
        match i % 20 {
            0 => b.max[i / 20 % 3] = b.min[i / 20 % 3],
            1 => b.max = b.min,
            2 => {
                b = Aabb {
                    min: b.min.min(region.min),
                    max: b.max.max(b.min.min(region.min)),
                }
            }
            _ => {}
        }
        let bounds = field.bounds(&b);
        let [lo, hi] = range_found(field, &b, 4, &mut random);
        assert!(
            bounds.lo <= lo && hi <= bounds.hi,
            "{name}: [{lo}, {hi}] leaves {bounds:?} over {b:?}"
        );
    }
}

fn gradient_bounds_are_sound(name: &str, field: &dyn Field, region: &Aabb, options: &Options) {
    let mut random = Random(options.seed ^ 0x97ad);
    // Over the edge of the region too.
    let reach = region.size() * 0.1;
    let around = Aabb::new(region.min - reach, region.max + reach);
    for i in 0..options.sound_boxes / 10 {
        let mut b = random.small_box(&around);
        match i % 10 {
            0 => b.max[i / 10 % 3] = b.min[i / 10 % 3],
            1 => b.max = b.min,
            _ => {}
        }
        let bounds = field.gradient_bounds(&b);
        for p in [b.min, b.max, random.point(&b), random.point(&b), random.point(&b)] {
            let (_, gradient) = field.value_gradient(p);
            assert!(
                (0..3).all(|a| bounds[a].contains(gradient[a])),
                "{name}: {gradient} leaves {bounds:?} over {b:?} at {p}"
            );
        }
    }
}

/// Segments of all lengths, also without one; a twentieth of them lie along an axis.
fn bounds_along_are_sound(name: &str, field: &dyn Field, region: &Aabb, options: &Options) {
    let mut random = Random(options.seed ^ 0xa106);
    let reach = region.size() * 0.1;
    let around = Aabb::new(region.min - reach, region.max + reach);
    for i in 0..options.sound_boxes / 10 {
        let b = random.small_box(&around);
        let (from, mut to) = (b.min, b.max);
        match i % 20 {
            0 => to = from,
            1 => to = DVec3::new(to.x, from.y, from.z),
            _ => {}
        }
        let bounds = field.bounds_along(from, to);
        for t in [0.0, 1.0, random.unit(), random.unit(), random.unit()] {
            let value = field.value(from.lerp(to, t));
            assert!(
                bounds.contains(value),
                "{name}: {value} leaves {bounds:?} between {from} and {to} at {t}"
            );
        }
    }
}

/// Where the bound is finite there is no crease either: the gradient changes no faster than it says.
fn hessian_bounds_are_sound(name: &str, field: &dyn Field, region: &Aabb, options: &Options) {
    let mut random = Random(options.seed ^ 0x4e55);
    let reach = region.size() * 0.1;
    let around = Aabb::new(region.min - reach, region.max + reach);
    for i in 0..options.sound_boxes / 10 {
        let mut b = random.small_box(&around);
        match i % 10 {
            0 => b.max[i / 10 % 3] = b.min[i / 10 % 3],
            1 => b.max = b.min,
            _ => {}
        }
        let bound = field.hessian_bound(&b);
        assert!(bound >= 0.0, "{name}: {bound} over {b:?}");
        if bound == f64::INFINITY {
            continue;
        }
        let points = [b.min, b.max, random.point(&b), random.point(&b), random.point(&b)];
        for p in points {
            let hessian = frobenius(field.jet(p).hessian);
            assert!(
                hessian <= bound,
                "{name}: {hessian} exceeds {bound} over {b:?} at {p}"
            );
        }
        for pair in points.windows(2) {
            let [g, h] = [0, 1].map(|n| field.value_gradient(pair[n]).1);
            let (change, way) = ((g - h).length(), (pair[0] - pair[1]).length());
            let rounding = options.value_tolerance * 1e3 * (g.length() + h.length());
            assert!(
                change <= bound * way + rounding,
                "{name}: the gradient changes by {change} over {way}, bound {bound}, box {b:?}"
            );
        }
    }
}

fn bounds_are_tight(name: &str, field: &dyn Field, region: &Aabb, options: &Options) -> [f64; 2] {
    let mut random = Random(options.seed ^ 0x7157);
    let mut ratios: Vec<f64> = (0..options.tight_boxes)
        .map(|_| {
            let b = random.small_box(region);
            let bounds = field.bounds(&b);
            let [lo, hi] = range_found(field, &b, 64, &mut random);
            // What is found may fall short of the true range, which makes the ratio larger, never smaller.
            bounds.width() / (hi - lo).max(f64::MIN_POSITIVE)
        })
        .collect();
    ratios.sort_by(f64::total_cmp);
    let quantile = |q: f64| ratios[((ratios.len() - 1) as f64 * q) as usize];
    let [median, p99] = [quantile(0.5), quantile(0.99)];
    assert!(
        median <= options.width_limits[0] && p99 <= options.width_limits[1],
        "{name}: bounds are {median:.2} (median) and {p99:.2} (99th percentile) times as wide as the range"
    );
    [median, p99]
}

fn ways_to_ask_agree(name: &str, field: &dyn Field, region: &Aabb, options: &Options) {
    let mut random = Random(options.seed ^ 0xa9ee);
    let points: Vec<DVec3> = (0..2000).map(|_| random.point(region)).collect();
    let largest = points.iter().map(|p| field.value(*p).abs()).fold(0.0, f64::max);
    for p in points {
        let (v, (w, g), jet) = (field.value(p), field.value_gradient(p), field.jet(p));
        let tolerance = options.value_tolerance * largest;
        assert!(
            (v - w).abs() <= tolerance && (v - jet.value).abs() <= tolerance,
            "{name} at {p}: {v} {w} {jet:?}"
        );
        assert!(
            (g - jet.gradient).length() <= options.value_tolerance * g.length() * 1e2,
            "{name} at {p}"
        );
        let h = jet.hessian;
        let asymmetry = (h - h.transpose())
            .to_cols_array()
            .iter()
            .fold(0.0f64, |m, x| m.max(x.abs()));
        assert!(
            asymmetry <= 1e-12 * frobenius(h),
            "{name} at {p}: Hessian {h} is not symmetric"
        );
    }
}

fn frobenius(m: DMat3) -> f64 {
    m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn derivatives_match_differences(name: &str, field: &dyn Field, region: &Aabb, options: &Options) {
    const COUNT: usize = 2000;
    let mut random = Random(options.seed ^ 0xd1ff);
    let diagonal = region.size().length();
    let h = options.step * diagonal;
    let points: Vec<DVec3> = (0..COUNT).map(|_| random.point(region)).collect();
    let steepest = points
        .iter()
        .map(|p| field.value_gradient(*p).1.length())
        .fold(0.0, f64::max);
    let curved = steepest / (0.01 * diagonal);
    let (mut gradients_off, mut hessians_off) = (Vec::new(), Vec::new());
    for p in points {
        let jet = field.jet(p);
        let (mut gradient, mut hessian) = (DVec3::ZERO, DMat3::ZERO);
        for a in 0..3 {
            let e = DVec3::AXES[a] * h;
            gradient[a] = (field.value(p + e) - field.value(p - e)) / (2.0 * h);
            *hessian.col_mut(a) = (field.value_gradient(p + e).1 - field.value_gradient(p - e).1) / (2.0 * h);
        }
        if (gradient - jet.gradient).length() > options.difference_tolerance * steepest {
            gradients_off.push((p, gradient, jet.gradient));
        }
        let scale = curved.max(frobenius(jet.hessian));
        if frobenius(hessian - jet.hessian) > options.difference_tolerance * scale {
            hessians_off.push((p, hessian, jet.hessian));
        }
    }
    let allowed = (options.rough_share * COUNT as f64) as usize;
    assert!(
        gradients_off.len() <= allowed,
        "{name}: {} gradients: {:?}",
        gradients_off.len(),
        gradients_off[0]
    );
    assert!(
        hessians_off.len() <= allowed,
        "{name}: {} Hessians: {:?}",
        hessians_off.len(),
        hessians_off[0]
    );
}

fn batches_equal_single_points(name: &str, field: &dyn Field, region: &Aabb, options: &Options) {
    let mut random = Random(options.seed ^ 0xba7c);
    let spread: Vec<DVec3> = (0..500).map(|_| random.point(region)).collect();
    // Clusters, as a sorted batch has them: here branches are left out.
    let clustered = (0..20).flat_map(|_| {
        let b = random.small_box(region);
        (0..100).map(|_| random.point(&b)).collect::<Vec<_>>()
    });
    // A grid: neighbours have two coordinates in common.
    let grid = (0..216).map(|i| {
        let share = DVec3::new((i / 36) as f64, (i / 6 % 6) as f64, (i % 6) as f64) / 5.0;
        region.min + share * region.size()
    });
    let points: Vec<DVec3> = spread.into_iter().chain(clustered).chain(grid).collect();
    for start in [0, 1, 37, 2499] {
        let points = &points[start..];
        let mut batch = vec![(f64::NAN, DVec3::NAN); points.len()];
        field.values_gradients(points, &mut batch);
        for (p, b) in points.iter().zip(batch) {
            let (v, g) = field.value_gradient(*p);
            let bits = |v: f64, g: DVec3| [v, g.x, g.y, g.z].map(f64::to_bits);
            assert_eq!(
                bits(v, g),
                bits(b.0, b.1),
                "{name} at {p}: alone {v} {g}, in a batch {b:?}"
            );
        }
    }
    field.values_gradients(&[], &mut []);
}

/// A grid along the axes, one that is turned, and one that is mirrored and sheared.
fn frames(region: &Aabb) -> [Frame; 3] {
    let cells = [40, 31, 52];
    let along = Frame::over(region, cells);
    let about_center = |m: DMat3| {
        let c = region.center();
        let turn = DAffine3::from_translation(c) * DAffine3::from_mat3(m) * DAffine3::from_translation(-c);
        Frame {
            world_from_grid: turn * along.world_from_grid,
            cells,
        }
    };
    let turned = about_center(DMat3::from_quat(DQuat::from_rotation_arc(
        DVec3::X,
        DVec3::ONE.normalize(),
    )));
    let sheared = about_center(DMat3::from_cols(-DVec3::X, DVec3::new(0.3, 1.0, 0.0), DVec3::Z));
    [along, turned, sheared]
}

fn frame_values_do_not_depend_on_the_block(name: &str, field: &dyn Field, frame: &Frame, options: &Options) {
    let (lo, count) = ([-2i64, 1, 0], [45usize, 20, 50]);
    let mut whole = vec![f64::NAN; count.iter().product()];
    field.frame_values(frame, lo, count, &mut whole);
    let at = |n: [usize; 3]| whole[(n[0] * count[1] + n[1]) * count[2] + n[2]];
    let largest = whole.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let node = |n: [usize; 3]| frame.node(std::array::from_fn(|a| lo[a] + n[a] as i64));
    let mut random = Random(options.seed ^ 0xf4a3);
    for _ in 0..2000 {
        let n: [usize; 3] = std::array::from_fn(|a| random.below(count[a]));
        let v = field.value(node(n));
        assert!(
            (v - at(n)).abs() <= options.value_tolerance * 10.0 * largest,
            "{name}: node {n:?} is {} in a grid and {v} alone",
            at(n)
        );
    }
    for round in 0..60 {
        let start: [usize; 3] = std::array::from_fn(|a| random.below(count[a]));
        let limit = if round % 2 == 0 { 6 } else { 50 };
        let part: [usize; 3] = std::array::from_fn(|a| 1 + random.below((count[a] - start[a]).min(limit)));
        let from: [i64; 3] = std::array::from_fn(|a| lo[a] + start[a] as i64);
        let to: [i64; 3] = std::array::from_fn(|a| from[a] + part[a] as i64 - 1);
        let mut values = vec![f64::NAN; part.iter().product()];
        field.frame_values(frame, from, part, &mut values);
        let bounds = field.frame_bounds(frame, from, to);
        for (i, v) in values.iter().enumerate() {
            let n = [i / part[2] / part[1], i / part[2] % part[1], i % part[2]];
            let expected = at(std::array::from_fn(|a| start[a] + n[a]));
            assert_eq!(
                v.to_bits(),
                expected.to_bits(),
                "{name}: {v} in block {from:?} {part:?}, else {expected}"
            );
            assert!(
                bounds.contains(*v),
                "{name}: {v} leaves {bounds:?} over nodes {from:?} to {to:?}"
            );
        }
    }
    field.frame_values(frame, lo, [3, 0, 2], &mut []);
}
