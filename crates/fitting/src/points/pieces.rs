//! Pieces of solid or cavity away from all samples: found on the finished field, and asked away.

use bspline::{Frame, HierarchicalSpline, Real};
use glam::{DAffine3, DVec3};

use super::samples::Samples;
use crate::components::{UnsupportedComponent, unsupported_by, unsupported_components};
use crate::level::BASE_DEPTH;

/// Finest grid on which signs are looked at: 128 cells along the box.
const DEPTH: usize = 7;
/// Components of one cell are left: on thin parts a cell's centre may be inside while the samples of its walls lie
/// in the cells beside it.
const CELLS_TO_ACT: usize = 2;
/// Nor is anything larger than this share of the box: a piece so large is more likely right than not.
const LARGEST_SHARE: f64 = 0.1;
/// Cells along its normal from a sample to where it speaks for the solid, and against it for the complement: a face along a plane of cells has all
/// its samples in cells of one sign.
const SIDE: f64 = 0.75;

/// Width of the cells that are looked at, unit box.
pub(crate) fn width<T: Real>(field: &HierarchicalSpline<T>) -> f64 {
    0.5f64.powi(DEPTH.min(BASE_DEPTH + field.level_count() - 1) as i32)
}

/// Conditions of the opposite sign, one cell deep, at the cells of every component that holds no sample: position
/// and value in the unit box.
pub(crate) fn conditions<T: Real>(field: &HierarchicalSpline<T>, samples: &Samples) -> Vec<(DVec3, f32)> {
    let h = width(field);
    let n = (1.0 / h) as u32;
    let cell = DVec3::splat(samples.scale * h);
    let frame = Frame {
        world_from_grid: DAffine3::from_scale_rotation_translation(
            cell,
            glam::DQuat::IDENTITY,
            samples.origin,
        ),
        cells: [n; 3],
    };
    let most = (LARGEST_SHARE * f64::from(n).powi(3)) as usize;
    let points = || samples.live_points().map(|i| samples.world(i));
    let is_false = |c: &UnsupportedComponent| c.cells.len() >= CELLS_TO_ACT && c.cells.len() <= most;
    let mut found = unsupported_components(field, 0.0, &frame, points());
    found.retain(is_false);
    if !found.is_empty() {
        let sides = samples.live_points().flat_map(|i| {
            let out = SIDE * cell * DVec3::from(samples.normals[i].map(f64::from));
            let at = samples.world(i);
            [(at, None), (at - out, Some(true)), (at + out, Some(false))]
        });
        found = unsupported_by(field, 0.0, &frame, sides);
        found.retain(is_false);
    }
    found
        .iter()
        .flat_map(|c| {
            let target = if c.is_inside { -h } else { h } as f32;
            c.cells.iter().map(move |at| {
                let centre = DVec3::from_array(at.map(f64::from)) + 0.5;
                (centre * h, target)
            })
        })
        .collect()
}
