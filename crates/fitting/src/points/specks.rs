//! Specks: small closed pieces of solid or cavity without a sample of their own.
//!
//! Where sheets almost touch, or cells are finer than the samples, a fit wavers about zero and splits off drops and
//! bubbles, most of them far smaller than a cell, which no grid finds. But in each of them lies an extremum of the field. So
//! extrema are looked for from the few [still cells](super::still) near the surface; those whose piece ends round them and
//! holds no foot of a sample are shifted over zero by the central functions of its cells.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use bspline::hierarchical::{BRICK, BrickKey, LevelEdit};
use bspline::{Field, HierarchicalSpline, Jet, Real};
use glam::{DMat3, DVec3};
use nalgebra::{Matrix3, SymmetricEigen};
use rayon::prelude::*;
use rustc_hash::FxHashSet;

use super::residual::newton_foot;
use super::samples::Samples;
use super::still::{FARTHEST, StillCell, may_lead_to_peak, to_maximum};
use crate::level::BASE_DEPTH;

/// Steps to an extremum.
const STEPS: usize = 12;
/// Longest step, in cells.
const LONGEST_STEP: f64 = 0.5;
/// Nodes from an extremum to where its piece would end if the field were the parabola there, and to where the look ends.
const TO_END: f64 = 4.0;
const TO_BORDER: i32 = 24;
/// Most nodes of a piece.
const MOST_NODES: usize = 12_000;
/// Places of an extremum that count as one, in finest cells.
const SAME_PLACE: f64 = 0.25;
/// Longest half axis of a piece, in cells.
const LONGEST_AXIS: f64 = 3.0;
/// Distance of a sample to its foot, in cells, up to which the piece that this lies on is its own, if it faces the same way.
const OWN: f64 = 0.25;
/// Least sum of the eight central functions of a cell in it.
const LEAST_SUM: f64 = 0.57;
/// Share of a cell that the field is beyond zero after the repair.
const BEYOND: f64 = 0.02;
/// Rounds of search and repair.
const ROUNDS: usize = 3;

/// The field without specks, and how many there were; with no more than `most` functions active, if that is given.
pub(crate) fn remove<T: Real>(
    mut field: HierarchicalSpline<T>,
    samples: &Samples,
    still: &[StillCell],
    most: Option<usize>,
) -> (HierarchicalSpline<T>, usize) {
    let mut removed = 0;
    let mut asked = still.to_vec();
    for _ in 0..ROUNDS {
        let specks = specks(&field, samples, &asked);
        let edits = shifts(&field, &specks, most);
        match field.edited(&edits) {
            Ok(next) if !edits.is_empty() => field = next,
            _ => break,
        }
        removed += specks.len();
        asked = round(&specks);
    }
    (field, removed)
}

/// The cells whose values the repair of `specks` changes.
fn round(specks: &[Speck]) -> Vec<StillCell> {
    let mut cells: Vec<(usize, [u32; 3])> = Vec::new();
    for speck in specks {
        let depth = BASE_DEPTH + speck.level;
        for cell in &speck.cells {
            for d in 0..125 {
                let d = [d / 25, d / 5 % 5, d % 5];
                let at: [u32; 3] = std::array::from_fn(|a| (cell[a] + d[a]).wrapping_sub(2));
                if at.iter().all(|c| c >> depth == 0) {
                    cells.push((depth, at));
                }
            }
        }
    }
    cells.sort_unstable();
    cells.dedup();
    let unsure = cells.into_iter().map(|(depth, at)| StillCell::unsure(depth, at));
    unsure.collect()
}

/// A closed piece round an extremum.
struct Speck {
    /// Value at the extremum.
    value: f64,
    level: usize,
    /// Cells of the level that it lies in, in order.
    cells: Vec<[u32; 3]>,
}

/// Largest or least value of a small region beyond zero.
#[derive(Clone, Copy)]
struct Peak {
    at: DVec3,
    value: f64,
    level: usize,
    /// From it along the half axes of its piece to the nodes of the look round.
    node: DMat3,
}

fn specks<T: Real>(field: &HierarchicalSpline<T>, samples: &Samples, asked: &[StillCell]) -> Vec<Speck> {
    let mut peaks: Vec<Peak> = asked
        .par_iter()
        .with_min_len(64)
        .flat_map_iter(|cell| {
            let h = field.lattice().spacing(cell.depth - BASE_DEPTH).x;
            let middle = samples.origin + h * (DVec3::from_array(cell.at.map(f64::from)) + 0.5);
            let jet = field.jet(middle);
            let ways = [(cell.leads_up, 1.0), (cell.leads_down, -1.0)];
            let ways = ways.into_iter().filter(|way| way.0);
            ways.filter_map(move |(_, sign)| peak(field, cell.depth - BASE_DEPTH, (middle, jet), sign))
        })
        .collect();
    // An extremum is found from several cells; the finest says by which functions it goes.
    let place = SAME_PLACE * field.lattice().spacing(field.level_count() - 1).x;
    let place = |p: &Peak| (p.at / place).round().to_array().map(|q| q as i64);
    peaks.sort_by_key(|p| (place(p), Reverse(p.level)));
    peaks.dedup_by_key(|p| place(p));
    peaks
        .par_iter()
        .filter_map(|peak| speck(field, samples, peak))
        .collect()
}

/// The maximum of `sign · f` that the steps from `start` lead to, if it is positive and its piece may be small.
fn peak<T: Real>(
    field: &HierarchicalSpline<T>,
    level: usize,
    (start, first): (DVec3, Jet),
    sign: f64,
) -> Option<Peak> {
    let h = field.lattice().spacing(level).x;
    let in_cells = Jet {
        value: first.value / h,
        hessian: first.hessian * h,
        ..first
    };
    if !may_lead_to_peak(&in_cells, sign) {
        return None;
    }
    let (mut x, mut jet) = (start, first);
    for step in 0..STEPS {
        if step > 0 {
            jet = field.jet(x);
        }
        let newton = to_maximum(&jet, sign);
        let uphill = || sign * jet.gradient.normalize_or_zero() * (LONGEST_STEP * h);
        let step = newton.map_or_else(uphill, |s| s.clamp_length_max(LONGEST_STEP * h));
        x += step;
        if (x - start).abs().max_element() > FARTHEST * h {
            return None;
        }
        if newton.is_some() && step.length() < 1e-3 * h {
            let value = field.value(x);
            let height = sign * value;
            if height <= 0.0 {
                return None;
            }
            let bend = -sign * jet.hessian;
            let eigen = SymmetricEigen::new(Matrix3::from_column_slice(&bend.to_cols_array()));
            let half: [f64; 3] = std::array::from_fn(|i| (2.0 * height / eigen.eigenvalues[i]).sqrt());
            let is_small = half.iter().all(|a| *a < LONGEST_AXIS * h);
            // The longest last: a piece that goes on goes on there.
            let mut order = [0, 1, 2];
            order.sort_by(|&a, &b| half[a].total_cmp(&half[b]));
            let axis = order
                .map(|i| DVec3::from_slice(eigen.eigenvectors.column(i).as_slice()) * (half[i] / TO_END));
            return is_small.then(|| Peak {
                at: x,
                value,
                level,
                node: DMat3::from_cols(axis[0], axis[1], axis[2]),
            });
        }
    }
    None
}

/// The piece round `peak`, if it ends within the look and no sample has its foot on it.
fn speck<T: Real>(field: &HierarchicalSpline<T>, samples: &Samples, peak: &Peak) -> Option<Speck> {
    let nodes = piece(field, peak)?;
    let node = |n: &[i32; 3]| peak.at + peak.node * DVec3::from_array(n.map(f64::from));
    let radius = nodes
        .iter()
        .map(|n| node(n).distance(peak.at))
        .fold(0.0, f64::max);
    let h = field.lattice().spacing(peak.level).x;
    let to_nodes = peak.node.inverse();
    let is_on_it = |i: usize| {
        let point = samples.world_of_conditions(i);
        let (foot, gradient) = newton_foot(field, point);
        let normal = DVec3::from_array(samples.normals[i].map(f64::from));
        if foot.distance(point) > OWN * h || gradient.dot(normal) >= 0.0 {
            return false;
        }
        let [x, y, z] = (to_nodes * (foot - peak.at)).floor().to_array().map(|q| q as i32);
        let is_near = |d: i32| nodes.contains(&[x + (d >> 2), y + (d >> 1 & 1), z + (d & 1)]);
        (0..8).any(is_near)
    };
    let near = samples.within(peak.at, radius + OWN * h);
    if near.into_iter().any(is_on_it) {
        return None;
    }
    let mut cells: Vec<[u32; 3]> = nodes
        .iter()
        .map(|n| {
            ((node(n) - samples.origin) / h)
                .to_array()
                .map(|q| q.max(0.0) as u32)
        })
        .collect();
    cells.sort_unstable();
    cells.dedup();
    Some(Speck {
        value: peak.value,
        level: peak.level,
        cells,
    })
}

/// Nodes of the piece round `peak`, numbered along its axes, unless it goes on to the border.
fn piece<T: Real>(field: &HierarchicalSpline<T>, peak: &Peak) -> Option<FxHashSet<[i32; 3]>> {
    let mut seen = FxHashSet::from_iter([[0; 3]]);
    let mut open = vec![[0i32; 3]];
    while let Some(n) = open.pop() {
        for step in 0..6 {
            let mut next = n;
            next[step / 2] += if step % 2 == 0 { 1 } else { -1 };
            if seen.contains(&next) {
                continue;
            }
            let value = field.value(peak.at + peak.node * DVec3::from_array(next.map(f64::from)));
            if (value > 0.0) == (peak.value > 0.0) {
                if next[step / 2].abs() == TO_BORDER || seen.len() > MOST_NODES {
                    return None;
                }
                seen.insert(next);
                open.push(next);
            }
        }
    }
    Some(seen)
}

/// What shifts all of the specks over zero, with no more than `most` functions active in all.
fn shifts<T: Real>(
    field: &HierarchicalSpline<T>,
    specks: &[Speck],
    most: Option<usize>,
) -> Vec<LevelEdit<T>> {
    let mut deltas: BTreeMap<(usize, [u32; 3]), f64> = BTreeMap::new();
    for speck in specks {
        let beyond = BEYOND * field.lattice().spacing(speck.level).x;
        let delta = -(speck.value + beyond * speck.value.signum()) / LEAST_SUM;
        for cell in &speck.cells {
            for corner in 0..8u32 {
                let function = std::array::from_fn(|a| cell[a] + 1 + (corner >> a & 1));
                let known = deltas.entry((speck.level, function)).or_insert(0.0);
                *known = if delta.abs() > known.abs() { delta } else { *known };
            }
        }
    }
    if let Some(most) = most {
        let mut room = most.saturating_sub(field.coefficient_count());
        let known: Vec<_> = (0..field.level_count()).map(|l| field.corrections(l)).collect();
        deltas.retain(|(level, function), _| {
            let slot = function.map(|s| s as usize % BRICK);
            let brick = known[*level].get(&BrickKey::of(*function));
            let is_active = brick.is_some_and(|b| b.is_active((slot[0] * BRICK + slot[1]) * BRICK + slot[2]));
            let has_room = is_active || room > 0;
            room -= usize::from(!is_active && has_room);
            has_room
        });
    }
    let edits = deltas.into_iter().map(|((level, function), delta)| LevelEdit {
        level,
        function,
        delta: T::from_f64(delta),
    });
    edits.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Control;
    use crate::phantoms::{CloudOptions, Solid, sample_cloud};
    use crate::points::{OrientedPoints, PointOptions, fit_points};

    fn prepared(positions: &[DVec3], normals: &[DVec3]) -> (HierarchicalSpline<f32>, Samples) {
        let points = OrientedPoints {
            positions,
            normals,
            certainty: None,
        };
        let options = PointOptions {
            max_depth: Some(7),
            ..PointOptions::default()
        };
        let (field, _) = fit_points(&points, &options, &mut Control::default()).expect("a ball");
        (field, Samples::prepare(points).expect("a ball"))
    }

    /// A drop outside a ball and a bubble in it, and a drop that holds a sample.
    #[test]
    fn drops_and_bubbles_go_unless_a_sample_lies_on_them() {
        let ball = Solid::Sphere;
        let cloud = sample_cloud(&*ball.field(), &ball.within(), &CloudOptions::default()).expect("a ball");
        let (field, mut samples) = prepared(&cloud.positions, &cloud.normals);
        let level = field.level_count() - 1;
        let h = field.lattice().spacing(level).x;
        let to_cell = |p: DVec3| ((p - samples.origin) / h).floor();
        let at = |p: DVec3| samples.origin + h * (to_cell(p) + 0.5);
        let spots = [
            DVec3::X * (1.0 + 3.0 * h),
            DVec3::Y * (1.0 - 3.0 * h),
            DVec3::Z * (1.0 + 3.0 * h),
        ]
        .map(at);
        // In the middle of a cell its eight central functions sum to (23/24)³.
        let edits = spots.map(|p| {
            let beyond = field.value(p) + 0.3 * h * field.value(p).signum();
            [0, 1, 2, 3, 4, 5, 6, 7].map(|corner| {
                let first = to_cell(p).to_array().map(|c| c as u32 + 1);
                LevelEdit {
                    level,
                    function: std::array::from_fn(|a| first[a] + (corner >> a & 1)),
                    delta: (-beyond / 0.8801) as f32,
                }
            })
        });
        let edits = edits.as_flattened();
        let spoiled = field.edited(edits).expect("finite");
        let is_solid = |f: &HierarchicalSpline<f32>| spots.map(|p| f.value(p) > 0.0);
        assert_eq!(is_solid(&field), [false, true, false]);
        assert_eq!(is_solid(&spoiled), [true, false, true]);
        let (foot, gradient) = newton_foot(&spoiled, spots[2] + DVec3::X * 0.5 * h);
        let mut entry = samples.entry(0);
        entry.position = (foot - samples.origin) / samples.scale;
        entry.measured = entry.position;
        entry.normal = (-gradient.normalize()).as_vec3().to_array();
        let mut entries: Vec<_> = (0..samples.positions.len()).map(|i| samples.entry(i)).collect();
        entries.push(entry);
        let still =
            spots.map(|p| StillCell::unsure(BASE_DEPTH + level, to_cell(p).to_array().map(|c| c as u32)));
        samples = samples.with_entries(entries);
        let (mended, count) = remove(spoiled, &samples, &still, None);
        assert_eq!(count, 2);
        assert_eq!(is_solid(&mended), [false, true, true]);
        let moved = cloud
            .positions
            .iter()
            .map(|p| (mended.value(*p) - field.value(*p)).abs());
        assert!(moved.fold(0.0, f64::max) < 0.2 * h);
    }
}
