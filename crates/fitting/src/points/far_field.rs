//! Signs far from all samples, put right where two witnesses agree against the fit.
//!
//! Where no sample is near, the coarse levels continue the surface smoothly. That closes holes well, but where noisy
//! normals lean together the continuation of one end of a scan may stay near zero all the way to the border of the box: a
//! horn. Two witnesses know better wherever the scan is closed: the winding number
//! `w(x) = (1/4π) Σ_j a_j n_j·(x_j − x)/|x_j − x|³` of the samples as area-weighted dipoles (Barill, Dickson, Schmidt,
//! Levin & Jacobson, *Fast winding numbers for soups and clouds*, ACM TOG 2018), and the nearest samples, which on a closed
//! surface face the way to `x`. In a hole neither is sure: `w` is between 0 and 1, or that of a part cut off, and the nearest
//! samples are those of the rim. There the fit is left alone.

use std::collections::BTreeSet;

use bspline::{Aabb, Field, Frame, HierarchicalSpline, Real};
use glam::{DAffine3, DQuat, DVec3};

use super::clusters::clusters;
use super::samples::Samples;
use super::small_parts::{SmallPart, small_parts};
use crate::level::BASE_DEPTH;
use crate::level::full_grid::FullGrid;
use crate::level::full_operator::Cluster;
use crate::orient::kernel::{Target, Winding};
use crate::orient::tree::Tree;

/// Cells beyond the nearest cluster from which clusters are asked which way they face.
const ROUND: f64 = 1.5;
/// Mean cosine from which they are sure. In holes of scans it went up to 0.56 before what the fit had filled rightly.
const FACING: f64 = 0.6;
/// Beyond the box of the samples less so many cells, a winding number below `CLOSING` decides alone: within `0.7 R` of a hole
/// of radius `R` it is larger.
const MARGIN: f64 = 0.5;
const CLOSING: f64 = 0.2;
/// Share of the samples' diagonal that noisy solid may reach beyond their box before it is asked away.
const BEYOND: f64 = 0.01;
/// Share of the area of a cloud that nothing faces away from, above which it is one side of something: half for a half sphere, all
/// for a terrain, a tenth and less for scans with a hole or two. Its winding number fades with the distance on both sides.
const ONE_SIDED: f64 = 0.25;
/// Share of the volume of a ball of the cloud's area that it has to enclose with its normals inward before the user is told: thin walls
/// enclose too little to tell.
const INWARD: f64 = 0.1;
/// Winding numbers below `OUTSIDE` and above `INSIDE` are sure.
const OUTSIDE: f64 = 0.1;
const INSIDE: f64 = 0.7;
/// Value given to a coefficient that is turned over, in distances to the nearest cluster.
const SHARE: f64 = 0.5;
/// Samples that a cell holds on the grid that areas are measured on, on average.
const SAMPLES_PER_CELL: f64 = 6.0;
/// Coefficient sites whose winding numbers are summed together.
const RUN: usize = 16;

/// Turns over the coefficients of the full level `base` that contradict both witnesses; returns how many, and the parts that are too small
/// for it.
pub(crate) fn settle(base: &mut FullGrid<f64>, samples: &Samples) -> (usize, Vec<SmallPart>) {
    let data = clusters(samples, BASE_DEPTH);
    let small = small_parts(&data, base.n);
    let areas = areas(&data);
    let mut is_small = vec![false; data.len()];
    small
        .iter()
        .flat_map(|part| &part.clusters)
        .for_each(|i| is_small[*i] = true);
    let about: Vec<Vec<usize>> = small.iter().map(|part| sites_about(part, base.n)).collect();
    let places: Vec<DVec3> = about
        .iter()
        .flatten()
        .map(|&site| site_position(site, base.n))
        .collect();
    let mut numbers = &mut winding_numbers(&data, &areas, &places)[..];
    for (part, sites) in small.iter().zip(&about) {
        let own = numbers
            .split_off_mut(..sites.len())
            .expect("a number for each site");
        // A site may lie in the part.
        let usual = *own.select_nth_unstable_by(sites.len() / 2, f64::total_cmp).1;
        if !(OUTSIDE..=INSIDE).contains(&usual) {
            let sign = if usual > INSIDE { 1.0 } else { -1.0 };
            for &site in sites {
                let distance = part.distance(&data, site_position(site, base.n), base.n);
                base.values[site] = sign * (SHARE * distance).max(base.values[site].abs());
            }
        }
    }
    let sites = far_sites(data.iter().map(|c| c.position), base.n);
    let places: Vec<DVec3> = sites.iter().map(|&site| site_position(site, base.n)).collect();
    let numbers = winding_numbers(&data, &areas, &places);
    let (low, high) = ends(data.iter().map(|c| c.position));
    let is_beyond = |x: DVec3| (low - x).max(x - high).max_element() > -MARGIN / base.n as f64;
    let m = base.width();
    let mut behind = BTreeSet::new();
    if is_one_sided(&data, &areas) {
        let solid = sites.iter().zip(&places).zip(&numbers);
        let solid = solid.filter(|((site, x), _)| base.values[**site] > 0.0 && is_beyond(**x));
        behind = closing(solid.map(|((site, _), w)| ([site / (m * m), site / m % m, site % m], *w)));
    }
    let mut turned = 0;
    for (site, w) in sites.into_iter().zip(numbers) {
        let value = base.values[site];
        let is_outside = value > 0.0 && w < CLOSING;
        let is_inside = value < 0.0 && w > INSIDE;
        if !is_outside && !is_inside {
            continue;
        }
        let x = site_position(site, base.n);
        let Way {
            nearest,
            distance,
            facing,
        } = way_to(&data, x, base.n);
        let sign = if is_outside { -1.0 } else { 1.0 };
        // What closes on itself has no hole to fill.
        let is_sure = (-sign * facing > FACING || is_small[nearest]) && (is_inside || w < OUTSIDE);
        let is_behind = || behind.contains(&[site / (m * m), site / m % m, site % m]);
        if is_sure || (is_outside && is_beyond(x) && !is_behind()) {
            base.values[site] = sign * SHARE * distance;
            turned += 1;
        }
    }
    (turned, small)
}

/// Turns over the coefficients of the full level `base` that lie in the cells of `conditions` (position and value asked for),
/// away from all points, and have the other sign: where noise asks for a stiff surface, conditions on the finer levels
/// cannot bend a whole pocket away.
pub(crate) fn turn_over(base: &mut FullGrid<f64>, samples: &Samples, conditions: &[(DVec3, f32)], h: f64) {
    let m = base.width();
    let mut is_far = vec![false; base.values.len()];
    for site in far_sites(samples.live_points().map(|i| samples.positions[i]), base.n) {
        is_far[site] = true;
    }
    let mut asked: Vec<(usize, f32)> = Vec::new();
    for (centre, target) in conditions {
        // Knots on the border of a cell belong to it.
        let [lo, hi] = [-0.5 * h, 0.5 * h].map(|d| ((*centre + d) * base.n as f64).to_array());
        let range = |a: usize| (lo[a] - 1e-9).ceil() as usize..=(hi[a] + 1e-9) as usize;
        for x in range(0) {
            for y in range(1) {
                asked.extend(range(2).map(|z| (((x + 1) * m + y + 1) * m + z + 1, *target)));
            }
        }
    }
    asked.sort_unstable_by_key(|a| a.0);
    asked.dedup_by_key(|a| a.0);
    for (site, target) in asked {
        let value = &mut base.values[site];
        if is_far[site] && *value * f64::from(target) < 0.0 {
            *value = -*value;
        }
    }
}

/// Cells of width `h` that noise has left in the solid beyond the box of the samples, where it closes no hole: position and value asked
/// for, both in the unit box.
pub(crate) fn beyond<T: Real>(field: &HierarchicalSpline<T>, samples: &Samples, h: f64) -> Vec<(DVec3, f32)> {
    let margin = BEYOND * samples.diagonal / samples.scale;
    let (low, high) = ends(samples.live_points().map(|i| samples.positions[i]));
    let n = (1.0 / h).round();
    let to_world = |p: DVec3| samples.origin + samples.scale * p;
    let mut found: BTreeSet<[usize; 3]> = BTreeSet::new();
    for axis in 0..3 {
        for (from, to) in [(0.0, low[axis] - margin), (high[axis] + margin, 1.0)] {
            let [mut first, mut end] = [DVec3::ZERO, DVec3::splat(n)];
            // Cells whose centres lie there.
            (first[axis], end[axis]) = ((from / h - 0.5).ceil().max(0.0), (to / h + 0.5).floor().min(n));
            let slab = Aabb {
                min: to_world(first * h),
                max: to_world(end * h),
            };
            if first[axis] >= end[axis] || field.bounds(&slab).hi <= 0.0 {
                continue;
            }
            let count = (end - first).to_array().map(|c| c as usize);
            let frame = Frame {
                world_from_grid: DAffine3::from_scale_rotation_translation(
                    DVec3::splat(samples.scale * h),
                    DQuat::IDENTITY,
                    to_world((first + 0.5) * h),
                ),
                cells: count.map(|c| c as u32),
            };
            let mut values = vec![0.0; count.iter().product()];
            field.frame_values(&frame, [0; 3], count, &mut values);
            let first = first.to_array().map(|c| c as usize);
            let inside = (0..values.len()).filter(|i| values[*i] > 0.0);
            found.extend(inside.map(|i| {
                let at = [i / count[2] / count[1], i / count[2] % count[1], i % count[2]];
                std::array::from_fn(|a| first[a] + at[a])
            }));
        }
    }
    let centre = |cell: &[usize; 3]| (DVec3::from_array(cell.map(|c| c as f64)) + 0.5) * h;
    let places: Vec<DVec3> = found.iter().map(centre).collect();
    let data = clusters(samples, BASE_DEPTH);
    let areas = areas(&data);
    let numbers = winding_numbers(&data, &areas, &places);
    let mut behind = BTreeSet::new();
    if is_one_sided(&data, &areas) {
        behind = closing(found.iter().copied().zip(numbers.iter().copied()));
    }
    let cells = found.iter().zip(places).zip(numbers);
    cells
        .filter(|((cell, _), w)| *w < CLOSING && !behind.contains(*cell))
        .map(|((_, place), _)| (place, -h as f32))
        .collect()
}

/// Whether the cloud is one side of something: most of what its areas face, nothing faces away from.
fn is_one_sided(data: &[Cluster], areas: &[f64]) -> bool {
    let unit = |c: &Cluster| c.normal.normalize_or_zero();
    let facing: DVec3 = data.iter().zip(areas).map(|(c, a)| unit(c) * *a).sum();
    facing.length() > ONE_SIDED * areas.iter().sum::<f64>()
}

/// A sentence about normals that face into a solid, if the cloud is closed and encloses a volume below zero,
/// `V = ⅓ Σ a_j n_j·x_j`.
pub(crate) fn doubt_of_inward(samples: &Samples) -> Option<String> {
    let data = clusters(samples, BASE_DEPTH);
    let areas = areas(&data);
    if is_one_sided(&data, &areas) {
        return None;
    }
    let total: f64 = areas.iter().sum();
    let weighed = data.iter().zip(&areas);
    let middle = weighed.clone().map(|(c, a)| c.position * *a).sum::<DVec3>() / total;
    let volume: f64 = weighed
        .map(|(c, a)| a / 3.0 * c.normal.normalize_or_zero().dot(c.position - middle))
        .sum();
    // A ball of this area.
    let most = total.powf(1.5) / (6.0 * std::f64::consts::PI.sqrt());
    (volume < -INWARD * most).then(|| {
        "the normals of this closed cloud point into what it encloses, so the solid is what lies outside it: if they should \
         point out of the solid, find the directions from the positions alone"
            .to_owned()
    })
}

/// Of cells and their winding numbers, those joined by faces to one that closes a hole. The solid behind a terrain goes on to
/// the border of the box, where the winding number is that of the outside.
fn closing(cells: impl Iterator<Item = ([usize; 3], f64)>) -> BTreeSet<[usize; 3]> {
    let mut left = BTreeSet::new();
    let mut joined = BTreeSet::new();
    let mut next = Vec::new();
    for (cell, w) in cells {
        if w < CLOSING {
            left.insert(cell);
        } else {
            joined.insert(cell);
            next.push(cell);
        }
    }
    while let Some(cell) = next.pop() {
        for axis in 0..3 {
            for at in [cell[axis].checked_sub(1), cell[axis].checked_add(1)] {
                let mut beside = cell;
                let Some(at) = at else { continue };
                beside[axis] = at;
                if left.remove(&beside) {
                    joined.insert(beside);
                    next.push(beside);
                }
            }
        }
    }
    joined
}

/// Corners of the box of places.
fn ends(places: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    places.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
        (low.min(p), high.max(p))
    })
}

/// The way to a place from the clusters near it.
struct Way {
    /// Nearest cluster, and how far it is.
    nearest: usize,
    distance: f64,
    /// Mean cosine between the ways from the clusters that are hardly farther and their normals: near 1 before the outside of a closed
    /// surface, -1 before its inside, and 0 in a hole.
    facing: f64,
}

fn way_to(data: &[Cluster], x: DVec3, n: usize) -> Way {
    let squares = data.iter().map(|c| c.position.distance_squared(x)).enumerate();
    let (nearest, square) = squares
        .reduce(|a, b| if b.1 < a.1 { b } else { a })
        .expect("a cloud has clusters");
    let distance = square.sqrt();
    let reach = distance + ROUND / n as f64;
    let (mut along, mut count) = (0.0, 0.0);
    for c in data {
        let way = x - c.position;
        let distance = way.length();
        if distance <= reach {
            along += c.weight * c.normal.dot(way) / distance;
            count += c.weight;
        }
    }
    Way {
        nearest,
        distance,
        facing: along / count,
    }
}

/// Knot of coefficient `site` of a level of `n` cells, unit box.
fn site_position(site: usize, n: usize) -> DVec3 {
    let m = n + 3;
    let s = [site / (m * m), site / m % m, site % m];
    (DVec3::from_array(s.map(|s| s as f64)) - 1.0) / n as f64
}

/// Sites at the corners of a cell of a level of `n` cells.
fn corners(cell: [usize; 3], n: usize) -> impl Iterator<Item = usize> {
    let m = n + 3;
    (0..8).map(move |corner| {
        let s = [0, 1, 2].map(|a| cell[a] + 1 + (corner >> a & 1));
        (s[0] * m + s[1]) * m + s[2]
    })
}

/// Sites at the corners of the cells of a part, each once.
fn sites_about(part: &SmallPart, n: usize) -> Vec<usize> {
    let mut sites: Vec<usize> = part.cells.iter().flat_map(|cell| corners(*cell, n)).collect();
    sites.sort_unstable();
    sites.dedup();
    sites
}

/// Sites of a level of `n` cells in whose eight cells there is none of `points`.
fn far_sites(points: impl Iterator<Item = DVec3>, n: usize) -> Vec<usize> {
    let m = n + 3;
    let mut is_near = vec![false; m * m * m];
    for p in points {
        let cell = (p * n as f64).to_array().map(|x| (x as usize).min(n - 1));
        corners(cell, n).for_each(|site| is_near[site] = true);
    }
    (0..m * m * m).filter(|&s| !is_near[s]).collect()
}

fn winding_numbers(data: &[Cluster], areas: &[f64], places: &[DVec3]) -> Vec<f64> {
    let positions: Vec<[f32; 3]> = data.iter().map(|c| c.position.as_vec3().to_array()).collect();
    let strengths: Vec<[f32; 3]> = data
        .iter()
        .zip(areas)
        .map(|(c, a)| (c.normal * *a).as_vec3().to_array())
        .collect();
    let areas: Vec<f32> = areas.iter().map(|a| *a as f32).collect();
    let tree = Tree::new(positions, &areas);
    let targets: Vec<Target> = places
        .iter()
        .map(|place| Target {
            position: place.as_vec3().to_array(),
            width: 0.0,
        })
        .collect();
    let runs: Vec<_> = (0..targets.len())
        .step_by(RUN)
        .map(|i| i..(i + RUN).min(targets.len()))
        .collect();
    let numbers = tree.sum(&Winding, &strengths, &targets, &runs);
    numbers.into_iter().map(f64::from).collect()
}

/// Area that each cluster stands for: its share of the samples round it, times the area of the surface there. A plane of
/// unit normal `n` cuts `(|n_x| + |n_y| + |n_z|)/h²` cells for each unit of its area, so an occupied cell counts
/// `h²/(|n_x| + |n_y| + |n_z|)`. Samples and areas are added up over 3³ cells, on the finest grid whose occupied cells
/// hold enough samples.
fn areas(data: &[Cluster]) -> Vec<f64> {
    let total: f64 = data.iter().map(|c| c.count).sum();
    let mut depth = BASE_DEPTH;
    let (mut samples, mut widths) = sums_by_cell(data, depth);
    while depth > 2 && total < SAMPLES_PER_CELL * samples.iter().filter(|s| **s > 0.0).count() as f64 {
        depth -= 1;
        (samples, widths) = sums_by_cell(data, depth);
    }
    let n = 1usize << depth;
    let mut area: Vec<f64> = samples
        .iter()
        .zip(&widths)
        .map(|(s, w)| if *s > 0.0 { s / w / (n * n) as f64 } else { 0.0 })
        .collect();
    add_up_3(&mut area, n);
    add_up_3(&mut samples, n);
    data.iter()
        .map(|c| {
            let cell = cell_of(c, n);
            c.count * area[cell] / samples[cell]
        })
        .collect()
}

fn cell_of(c: &Cluster, n: usize) -> usize {
    let [x, y, z] = (c.position * n as f64)
        .to_array()
        .map(|x| (x as usize).min(n - 1));
    (x * n + y) * n + z
}

/// For each of `2^depth` cubed cells: samples, and the sum of `|n_x| + |n_y| + |n_z|` over them.
fn sums_by_cell(data: &[Cluster], depth: usize) -> (Vec<f64>, Vec<f64>) {
    let n = 1usize << depth;
    let (mut samples, mut widths) = (vec![0.0; n * n * n], vec![0.0; n * n * n]);
    for c in data {
        let cell = cell_of(c, n);
        samples[cell] += c.count;
        widths[cell] += c.count * c.normal.normalize_or(DVec3::X).abs().element_sum();
    }
    (samples, widths)
}

/// Replaces each value by the sum over the 3³ cells round it.
fn add_up_3(values: &mut [f64], n: usize) {
    for stride in [n * n, n, 1] {
        let before = values.to_vec();
        for (i, v) in values.iter_mut().enumerate() {
            let at = i / stride % n;
            let low = if at > 0 { before[i - stride] } else { 0.0 };
            let high = if at + 1 < n { before[i + stride] } else { 0.0 };
            *v += low + high;
        }
    }
}

#[cfg(test)]
mod tests {
    use bspline::hierarchical::Lattice;

    use super::*;
    use crate::points::OrientedPoints;

    /// Points all over a unit ball.
    fn ball() -> Vec<DVec3> {
        let place = |i: u32| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 400.0;
            let (sin, cos) = libm::sincos(2.399_963_229_728_653 * f64::from(i));
            let r = (1.0 - z * z).sqrt();
            DVec3::new(r * cos, r * sin, z)
        };
        (0..400).map(place).collect()
    }

    fn prepared(points: &[DVec3]) -> Samples {
        let cloud = OrientedPoints {
            positions: points,
            normals: points,
            certainty: None,
        };
        Samples::prepare(cloud).expect("a ball")
    }

    /// A bump on a ball is found where it leaves the box of the samples; what closes a hole is not.
    #[test]
    fn solid_beyond_the_box_is_asked_away_but_over_a_hole() {
        let whole = ball();
        let cut: Vec<DVec3> = whole.iter().copied().filter(|p| p.z < 0.8).collect();
        let (top, radius) = (DVec3::new(0.1, 0.0, 1.0), 0.12);
        for (points, has_bump, expected) in
            [(&whole, false, false), (&whole, true, true), (&cut, false, false)]
        {
            let samples = prepared(points);
            let lattice = Lattice {
                world_from_lattice: DAffine3::from_scale_rotation_translation(
                    DVec3::splat(samples.scale / 64.0),
                    DQuat::IDENTITY,
                    samples.origin,
                ),
                cells: [64; 3],
            };
            let solid = |p: DVec3| {
                let bump = if has_bump { radius - p.distance(top) } else { -1.0 };
                bump.max(1.0 - p.length())
            };
            let field = HierarchicalSpline::<f32>::schoenberg(lattice, 1.0, solid).unwrap();
            let found = beyond(&field, &samples, 1.0 / 128.0);
            assert_eq!(!found.is_empty(), expected, "{has_bump} {}", points.len());
            for (place, value) in found {
                let world = samples.origin + samples.scale * place;
                assert!(
                    value < 0.0 && world.distance(top) < radius + 0.02 && world.z > 1.03,
                    "{world}"
                );
            }
        }
    }

    /// Coefficients of the cells asked for turn over, but for those beside a point and those that are right already.
    #[test]
    fn a_pocket_away_from_all_points_turns_over() {
        let samples = prepared(&ball());
        let mut base = FullGrid::zeros(32);
        let site = |knot: [usize; 3]| ((knot[0] + 1) * 35 + knot[1] + 1) * 35 + knot[2] + 1;
        // The ball ends at knot 29.9 of each axis through its middle.
        let (pocket, right, beside, elsewhere) = ([29, 29, 29], [29, 29, 30], [30, 16, 16], [2, 2, 2]);
        for (knot, value) in [(pocket, 0.5), (right, -0.25), (beside, 0.5), (elsewhere, 0.5)] {
            base.values[site(knot)] = value;
        }
        let h = 1.0 / 128.0;
        let conditions: Vec<(DVec3, f32)> = [pocket, right, beside]
            .iter()
            .map(|knot| {
                let corner = DVec3::from_array(knot.map(|k| k as f64 / 32.0));
                (corner + 0.5 * h, -h as f32)
            })
            .collect();
        turn_over(&mut base, &samples, &conditions, h);
        let found = [pocket, right, beside, elsewhere].map(|knot| base.values[site(knot)]);
        assert_eq!(found, [-0.5, -0.25, 0.5, 0.5]);
    }
}
