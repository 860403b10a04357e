//! What the edits of an object mean for the cloud that it was fitted to.
//!
//! A point keeps its distance to the surface: noise of the scan stays. It goes where moves carried it, then along the gradient until
//! the field is what it was. Where that leads elsewhere (the point would travel far, or face another way) there is no such point any
//! more: only tools that push the surface along, as brushes and forces do, bring a point farther than the scan's spacing. Where an
//! edit bared surface there are new ones, as dense as the scan. Surface that had no points before, which the fit made up to close the
//! solid, gets none.

use std::collections::HashMap;

use bspline::hierarchical::DiffError;
use bspline::polygonize::{PolygonizeError, PolygonizeOptions, polygonize};
use bspline::{Aabb, Field, Frame, HierarchicalSpline};
use formats::points::{CloudChanges, Placed};
use glam::DVec3;
use rayon::prelude::*;

use super::Journey;

/// Rounding of a field's values, in units of the slope times the diagonal: less is no change.
const ROUNDING: f64 = 1e-6;

/// Way of the surface, in spacings of the scan, that is no edit: tools leave such waves in coarse functions around them.
const STILL: f64 = 0.01;

/// Least cosine between the normals of a point before and after.
const TURNED: f64 = 0.5;

/// Steps along the gradient, at most.
const STEPS: usize = 30;

/// Gap of a scan, in its spacings, from which on surface is bare: one in 300 000 gaps of points thrown at random is wider.
const GAP: f64 = 2.0;

/// Least distance of a new point from all others, in spacings of the scan: places chosen one after the other are then as dense.
const APART: f64 = 0.725;

/// Points whose neighbours tell the spacing of the scan, and how many of these.
const PROBES: usize = 128;
const NEIGHBOURS: usize = 20;

/// Most cells of the grid on which bare surface is looked for, along one axis.
const MOST_CELLS: f64 = 4096.0;

/// Why a cloud cannot follow.
#[derive(Debug, thiserror::Error)]
pub enum CloudError {
    /// The two are no versions of one field.
    #[error(transparent)]
    Versions(#[from] DiffError),
    /// Its surface cannot be covered with points.
    #[error(transparent)]
    Surface(#[from] PolygonizeError),
}

/// What the way from `fitted` to `now` means for the points of the cloud that `fitted` was fitted to. The surface lies at `iso`; what
/// was moved went on the `journey`.
///
/// # Errors
/// Any [`CloudError`].
pub fn revise_cloud(
    fitted: &HierarchicalSpline<f32>,
    now: &HierarchicalSpline<f32>,
    points: &[DVec3],
    iso: f64,
    journey: &Journey,
) -> Result<CloudChanges, CloudError> {
    let now = &fitted.applied(&fitted.difference(now)?)?;
    let whole = fitted.lattice().world_box();
    let least = ROUNDING * fitted.slope() * whole.size().length();
    let spacing = spacing(points);
    let fates: Vec<Fate> = points
        .par_iter()
        .map(|p| fate(fitted, now, *p, journey, least, spacing))
        .collect();
    let mut changes = CloudChanges::default();
    let mut cover = Cover::new(GAP * spacing);
    for (row, (point, fate)) in points.iter().zip(&fates).enumerate() {
        match fate {
            Fate::Stays => cover.put(*point, row),
            Fate::Moves(position, normal) => {
                cover.put(*position, row);
                changes.moved.push(Placed {
                    row,
                    position: *position,
                    normal: *normal,
                });
            }
            Fate::Goes => changes.removed.push(row),
        }
    }
    let boxes = now.changed_boxes(fitted, &whole);
    let Some(reach) = boxes.iter().copied().reduce(Aabb::hull) else {
        return Ok(changes);
    };
    let reach = Aabb {
        min: reach.min.max(whole.min),
        max: reach.max.min(whole.max),
    };
    let cells = (reach.size() / spacing)
        .ceil()
        .clamp(DVec3::ONE, DVec3::splat(MOST_CELLS));
    let frame = Frame::over(&reach, cells.to_array().map(|n| n as u32));
    let options = PolygonizeOptions {
        iso,
        ..PolygonizeOptions::default()
    };
    let (mesh, _) = polygonize(now, &frame, &options)?;
    // Caps of the mesh at the faces of its box are no surface.
    let on_surface = |p: DVec3| {
        let (value, gradient) = now.value_gradient(p);
        let is_surface = (value - iso).abs() < 0.1 * spacing * fitted.slope();
        let is_new = (value - fitted.value(p)).abs() > least;
        (is_surface && is_new).then(|| (p, -gradient.normalize_or_zero()))
    };
    let vertices: Vec<Option<(DVec3, DVec3)>> = mesh.positions.into_par_iter().map(on_surface).collect();
    let mut scanned = Cover::new(GAP * spacing);
    for (row, point) in points.iter().enumerate() {
        scanned.put(*point, row);
    }
    let was_bare = |vertex: DVec3, normal: DVec3| {
        let before = surface_of(fitted, iso, journey.back(vertex).0, normal, least);
        before.is_some_and(|before| scanned.is_bare(before, GAP * spacing))
    };
    // Scans have gaps of their own: bare is what is farther from all points than those are wide, and what lies round it.
    let mut bare = Cover::new(GAP * spacing);
    for (vertex, normal) in vertices.iter().flatten() {
        if cover.is_bare(*vertex, GAP * spacing) && !was_bare(*vertex, *normal) {
            bare.put(*vertex, 0);
        }
    }
    let is_bare = |p: &DVec3| !bare.is_bare(*p, GAP * spacing);
    for corners in mesh.triangles.iter().map(|t| t.map(|v| vertices[v as usize])) {
        let [Some(a), Some(b), Some(c)] = corners else {
            continue;
        };
        let corners = [a, b, c];
        if !corners.iter().any(|(p, _)| is_bare(p)) {
            continue;
        }
        // Vertices alone are too few to choose from.
        let middles = [(a, b), (b, c), (c, a)]
            .into_iter()
            .filter_map(|((p, normal), (q, _))| {
                surface_of(now, iso, 0.5 * (p + q), normal, least).and_then(on_surface)
            });
        for (position, normal) in corners.into_iter().chain(middles) {
            if is_bare(&position) && cover.is_bare(position, APART * spacing) {
                let row = cover.nearest(position, points);
                cover.put(position, row);
                changes.added.push(Placed {
                    row,
                    position,
                    normal,
                });
            }
        }
    }
    Ok(changes)
}

/// What becomes of a point.
enum Fate {
    Stays,
    Moves(DVec3, DVec3),
    Goes,
}

fn fate(
    fitted: &HierarchicalSpline<f32>,
    now: &HierarchicalSpline<f32>,
    p: DVec3,
    journey: &Journey,
    least: f64,
    spacing: f64,
) -> Fate {
    let (level, before) = fitted.value_gradient(p);
    let carried = journey.forth(p);
    let still = least.max(STILL * spacing * fitted.slope());
    if carried == p && (now.value(p) - level).abs() <= still {
        return Fate::Stays;
    }
    let far = match journey.pushes(carried) {
        true => (2.0 * (now.value(carried) - level).abs() / fitted.slope()).max(spacing),
        false => spacing,
    };
    let mut q = carried;
    for _ in 0..STEPS {
        let (value, gradient) = now.value_gradient(q);
        let off = level - value;
        if off.abs() <= least {
            let normal = -gradient.normalize_or_zero();
            // What a move has turned faces another way by right.
            let is_turned = carried == p && normal.dot(-before.normalize_or_zero()) < TURNED;
            return match is_turned || q.distance(carried) > far {
                true => Fate::Goes,
                false => Fate::Moves(q, normal),
            };
        }
        let step = gradient * (off / gradient.length_squared().max(f64::MIN_POSITIVE));
        q += step.clamp_length_max(spacing.max(0.5 * far));
        if !q.is_finite() {
            return Fate::Goes;
        }
    }
    Fate::Goes
}

/// The place on a surface that lies along the gradient from `p` and faces as `normal` does.
fn surface_of(
    field: &HierarchicalSpline<f32>,
    iso: f64,
    p: DVec3,
    normal: DVec3,
    least: f64,
) -> Option<DVec3> {
    let mut q = p;
    for _ in 0..STEPS {
        let (value, gradient) = field.value_gradient(q);
        let off = iso - value;
        if off.abs() <= least {
            return (normal.dot(-gradient.normalize_or_zero()) >= TURNED).then_some(q);
        }
        q += gradient * (off / gradient.length_squared().max(f64::MIN_POSITIVE));
        if !q.is_finite() {
            return None;
        }
    }
    None
}

/// Edge of the square that a point of the scan has for itself: the median, from the distances of the nearest neighbours. About a point
/// thrown at random the kth lies at `π·d² = k·edge²` on average; of even points the shells of a lattice come near that sum together.
fn spacing(points: &[DVec3]) -> f64 {
    let probes: Vec<&DVec3> = points
        .iter()
        .step_by(points.len().div_ceil(PROBES).max(1))
        .collect();
    let mut edges: Vec<f64> = probes
        .par_iter()
        .filter_map(|p| {
            let mut squares: Vec<f64> = points
                .iter()
                .map(|q| p.distance_squared(*q))
                .filter(|d| *d > 0.0)
                .collect();
            let count = NEIGHBOURS.min(squares.len());
            let (nearer, last, _) = squares.select_nth_unstable_by(count.checked_sub(1)?, f64::total_cmp);
            // A sum has one order.
            nearer.sort_unstable_by(f64::total_cmp);
            let sum = nearer.iter().sum::<f64>() + *last;
            Some((std::f64::consts::TAU * sum / (count * (count + 1)) as f64).sqrt())
        })
        .collect();
    edges.sort_unstable_by(f64::total_cmp);
    edges.get(edges.len() / 2).copied().unwrap_or(1.0)
}

/// Points in cubes, to find what lies near; asked for one place at a time, so that no order matters.
struct Cover {
    edge: f64,
    cubes: HashMap<[i64; 3], Vec<(DVec3, usize)>>,
}

impl Cover {
    fn new(edge: f64) -> Self {
        Self {
            edge,
            cubes: HashMap::new(),
        }
    }

    fn cube(&self, p: DVec3) -> [i64; 3] {
        (p / self.edge).floor().to_array().map(|v| v as i64)
    }

    fn put(&mut self, p: DVec3, row: usize) {
        let cube = self.cube(p);
        self.cubes.entry(cube).or_default().push((p, row));
    }

    fn near(&self, p: DVec3, cubes: i64) -> impl Iterator<Item = &(DVec3, usize)> {
        let [x, y, z] = self.cube(p);
        let steps = -cubes..=cubes;
        let round = steps.clone().flat_map(move |i| {
            let steps = steps.clone();
            steps
                .clone()
                .flat_map(move |j| steps.clone().map(move |k| [x + i, y + j, z + k]))
        });
        round.filter_map(|cube| self.cubes.get(&cube)).flatten()
    }

    /// Whether nothing lies within `gap`, at most the edge of a cube.
    fn is_bare(&self, p: DVec3, gap: f64) -> bool {
        self.near(p, 1).all(|(q, _)| q.distance(p) > gap)
    }

    /// Row of a point near `p`: of the nearest of all where none is.
    fn nearest(&self, p: DVec3, points: &[DVec3]) -> usize {
        let by_distance = |(a, _): &(f64, usize), (b, _): &(f64, usize)| a.total_cmp(b);
        let near = self.near(p, 2).map(|(q, row)| (q.distance_squared(p), *row));
        let near = near.min_by(by_distance);
        let all = || {
            points
                .iter()
                .enumerate()
                .map(|(row, q)| (q.distance_squared(p), row))
                .min_by(by_distance)
        };
        near.or_else(all).map_or(0, |(_, row)| row)
    }
}
