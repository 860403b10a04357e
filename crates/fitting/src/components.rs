//! Pieces of the solid, or cavities in it, that no sample speaks for.

use bspline::{Field, Frame};
use glam::{DAffine3, DVec3};

/// A 6-connected component of the sign of a field on a grid of cells, none of which holds a sample.
#[derive(Clone, Debug, PartialEq)]
pub struct UnsupportedComponent {
    /// Whether it is a piece of the solid (a false solid) or of its complement (a false cavity).
    pub is_inside: bool,
    /// Its cells, in the order of the grid.
    pub cells: Vec<[u32; 3]>,
    /// World position of the centre of its first cell.
    pub at: DVec3,
}

/// Signs held at once, about.
const SLAB: usize = 1 << 17;
/// Nodes on an axis of the blocks whose bounds are asked for first.
const BLOCK: usize = 8;

/// Cells `start..end` of one row along z, all of one sign.
struct Run {
    start: u32,
    end: u32,
    is_inside: bool,
    has_sample: bool,
    /// A run of the same component, nearer to its root.
    parent: u32,
}

/// Components of `{f > iso}` and of its complement, by the sign at the centres of the cells of `frame`, that
/// hold none of `samples` (world positions). In the order of their first cell.
///
/// Rows of cells are cut into runs of one sign, and runs that touch are joined, so the memory grows with the
/// surface.
pub fn unsupported_components(
    field: &dyn Field,
    iso: f64,
    frame: &Frame,
    samples: impl Iterator<Item = DVec3>,
) -> Vec<UnsupportedComponent> {
    unsupported_by(field, iso, frame, samples.map(|p| (p, None)))
}

/// [`unsupported_components`], of samples some of which speak for the solid only (`true`), or for its complement only.
pub(crate) fn unsupported_by(
    field: &dyn Field,
    iso: f64,
    frame: &Frame,
    samples: impl Iterator<Item = (DVec3, Option<bool>)>,
) -> Vec<UnsupportedComponent> {
    let (mut runs, rows) = runs_of_sign(field, iso, frame);
    let [nx, ny, nz] = frame.cells;
    let row = |x: u32, y: u32| rows[(x * ny + y) as usize] as usize..rows[(x * ny + y) as usize + 1] as usize;
    let grid_from_world = frame.world_from_grid.inverse();
    for (p, side) in samples {
        let q = grid_from_world.transform_point3(p).floor();
        let limit = DVec3::new(nx as f64, ny as f64, nz as f64);
        if q.cmpge(DVec3::ZERO).all() && q.cmplt(limit).all() {
            let here = &mut runs[row(q.x as u32, q.y as u32)];
            let at = here.partition_point(|r| r.end <= q.z as u32);
            here[at].has_sample |= side.is_none_or(|inside| inside == here[at].is_inside);
        }
    }
    for x in 0..nx {
        for y in 0..ny {
            if x > 0 {
                join_rows(&mut runs, row(x - 1, y), row(x, y));
            }
            if y > 0 {
                join_rows(&mut runs, row(x, y - 1), row(x, y));
            }
        }
    }
    let mut supported = vec![false; runs.len()];
    for i in 0..runs.len() {
        let root = root_of(&mut runs, i as u32);
        supported[root as usize] |= runs[i].has_sample;
    }
    let mut number = vec![u32::MAX; runs.len()];
    let mut out: Vec<UnsupportedComponent> = Vec::new();
    for x in 0..nx {
        for y in 0..ny {
            for i in row(x, y) {
                let root = root_of(&mut runs, i as u32) as usize;
                if supported[root] {
                    continue;
                }
                if number[root] == u32::MAX {
                    number[root] = out.len() as u32;
                    let centre = DVec3::new(x as f64, y as f64, f64::from(runs[i].start)) + 0.5;
                    out.push(UnsupportedComponent {
                        is_inside: runs[i].is_inside,
                        cells: Vec::new(),
                        at: frame.world_from_grid.transform_point3(centre),
                    });
                }
                out[number[root] as usize]
                    .cells
                    .extend((runs[i].start..runs[i].end).map(|z| [x, y, z]));
            }
        }
    }
    out
}

/// The runs of all rows, and the first run of each row (and the end).
fn runs_of_sign(field: &dyn Field, iso: f64, frame: &Frame) -> (Vec<Run>, Vec<u32>) {
    let [nx, ny, nz] = frame.cells.map(|n| n as usize);
    let to_centre = DAffine3::from_translation(DVec3::splat(0.5));
    let centres = Frame {
        world_from_grid: frame.world_from_grid * to_centre,
        ..*frame
    };
    let (mut runs, mut rows) = (Vec::new(), vec![0]);
    let planes = (SLAB / (ny * nz).max(1)).clamp(1, BLOCK);
    let mut slab = vec![false; planes * ny * nz];
    for x in (0..nx).step_by(planes) {
        let count = planes.min(nx - x);
        let slab = &mut slab[..count * ny * nz];
        mark_inside(field, iso, &centres, x, [count, ny, nz], slab);
        for inside in slab.chunks_exact(nz) {
            let mut start = 0;
            for end in 1..=nz {
                let is_inside = inside[start];
                if end == nz || inside[end] != is_inside {
                    let (start_cell, parent) = (start as u32, runs.len() as u32);
                    let run = Run {
                        start: start_cell,
                        end: end as u32,
                        is_inside,
                        has_sample: false,
                        parent,
                    };
                    runs.push(run);
                    start = end;
                }
            }
            rows.push(runs.len() as u32);
        }
    }
    (runs, rows)
}

/// Whether `f > iso` at the nodes of `frame` from plane `first` on, `count` on each axis. Blocks that the bounds of the field
/// leave on one side are not evaluated.
pub(crate) fn mark_inside(
    field: &dyn Field,
    iso: f64,
    frame: &Frame,
    first: usize,
    count: [usize; 3],
    inside: &mut [bool],
) {
    let blocks = count.map(|n| n.div_ceil(BLOCK));
    let mut values = [0.0; BLOCK * BLOCK * BLOCK];
    for block in 0..blocks.iter().product() {
        let at = [
            block / (blocks[1] * blocks[2]),
            block / blocks[2] % blocks[1],
            block % blocks[2],
        ];
        let low = at.map(|b| b * BLOCK);
        let size: [usize; 3] = std::array::from_fn(|a| BLOCK.min(count[a] - low[a]));
        let lo = [first + low[0], low[1], low[2]].map(|n| n as i64);
        let hi = std::array::from_fn(|a| lo[a] + size[a] as i64 - 1);
        let bounds = field.frame_bounds_about(frame, lo, hi, iso);
        let values = &mut values[..size.iter().product()];
        if bounds.hi <= iso {
            values.fill(f64::NEG_INFINITY);
        } else if bounds.lo > iso {
            values.fill(f64::INFINITY);
        } else {
            field.frame_values(frame, lo, size, values);
        }
        for (row, values) in values.chunks_exact(size[2]).enumerate() {
            let [x, y] = [low[0] + row / size[1], low[1] + row % size[1]];
            let to = &mut inside[(x * count[1] + y) * count[2] + low[2]..][..size[2]];
            for (to, value) in to.iter_mut().zip(values) {
                *to = *value > iso;
            }
        }
    }
}

/// Joins the runs of equal sign of two neighbouring rows that overlap.
fn join_rows(runs: &mut [Run], a: std::ops::Range<usize>, b: std::ops::Range<usize>) {
    let (mut i, mut j) = (a.start, b.start);
    while i < a.end && j < b.end {
        if runs[i].is_inside == runs[j].is_inside
            && runs[i].start < runs[j].end
            && runs[j].start < runs[i].end
        {
            let (p, q) = (root_of(runs, i as u32), root_of(runs, j as u32));
            runs[p.max(q) as usize].parent = p.min(q);
        }
        if runs[i].end <= runs[j].end {
            i += 1;
        } else {
            j += 1;
        }
    }
}

fn root_of(runs: &mut [Run], mut i: u32) -> u32 {
    while runs[i as usize].parent != i {
        let above = runs[runs[i as usize].parent as usize].parent;
        runs[i as usize].parent = above;
        i = above;
    }
    i
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use bspline::{Aabb, Csg};

    use super::*;

    #[test]
    fn a_ball_without_samples_is_named_and_one_with_samples_is_not() {
        let ball =
            |x: f64, r: f64| bspline::primitives::Sphere::new(DVec3::new(x, 0.0, 0.0), r).expect("a ball");
        let solid =
            Csg::union(vec![Arc::new(ball(-2.0, 1.0)), Arc::new(ball(2.0, 0.6))]).expect("two branches");
        let frame = Frame::over(&Aabb::new(DVec3::splat(-4.0), DVec3::splat(4.0)), [32; 3]);
        // One sample on each side of the surface of the first ball.
        let samples = [-3.1, -2.9].map(|x| DVec3::new(x, 0.0, 0.0));
        let found = unsupported_components(&solid, 0.0, &frame, samples.into_iter());
        assert_eq!(found.len(), 1);
        assert!(found[0].is_inside);
        let expected = 4.0 / 3.0 * std::f64::consts::PI * 0.6f64.powi(3) * 64.0;
        assert!(
            (found[0].cells.len() as f64 - expected).abs() < 0.2 * expected,
            "{}",
            found[0].cells.len()
        );
    }
}
