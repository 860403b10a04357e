//! Points far from all others: few of them make the box so large that its cells are too coarse for the surface.

use glam::DVec3;

use super::OrientedPoints;
use super::samples::{BOX_SCALE, Samples};
use crate::FitError;

/// Points below which none is far from the others.
const LEAST: usize = 100;
/// Share of the points that may lie outside the robust extent before they count as part of the scan.
const OUTLIER_SHARE: f64 = 1e-3;
/// Extents from the bulk beyond which so few points are no part of the scan.
const FAR: f64 = 10.0;
/// Share of the points on each side of an axis of which it is asked whether they make the box larger.
const OUTERMOST: f64 = 0.01;
/// Length of the box over that of the others from which they do.
const STRETCHED: f64 = 2.0;
/// Points that the bulk is told from, about.
const CHOICE: usize = 4096;

/// Corners of the box of `positions` without the share `trim` of them on each side of each axis.
fn bulk(positions: impl ExactSizeIterator<Item = DVec3> + Clone, trim: f64) -> (DVec3, DVec3) {
    let stride = positions.len().div_ceil(CHOICE);
    let (mut low, mut high) = (DVec3::ZERO, DVec3::ZERO);
    for a in 0..3 {
        let mut axis: Vec<f64> = positions.clone().step_by(stride).map(|p| p[a]).collect();
        let trim = (axis.len() as f64 * trim).ceil() as usize;
        let last = axis.len() - 1;
        low[a] = *axis.select_nth_unstable_by(trim, f64::total_cmp).1;
        high[a] = *axis.select_nth_unstable_by(last - trim, f64::total_cmp).1;
    }
    (low, high)
}

/// How far a place lies beyond a box; not above 0 within it.
pub(super) fn beyond((low, high): (DVec3, DVec3), p: DVec3) -> f64 {
    (low - p).max(p - high).max_element()
}

/// Removes points that lie farther from the bulk than `extents` of it, if they are few. The bulk is without the share `trim` on each side.
fn drop_few<P>(points: &mut Vec<P>, at: impl Fn(&P) -> DVec3, trim: f64, extents: f64) {
    let bulk = bulk(points.iter().map(&at), trim);
    let reach = extents * (bulk.1 - bulk.0).max_element();
    let is_near = |p: &P| beyond(bulk, at(p)) <= reach;
    let outside = points.iter().filter(|p| !is_near(p)).count();
    if reach > 0.0 && outside as f64 <= OUTLIER_SHARE * points.len() as f64 + 1.0 {
        points.retain(is_near);
    }
}

/// Removes points far beyond the bulk, when they are few: one such point would take all resolution away.
pub(crate) fn drop_far_outliers(positions: &[DVec3], kept: &mut Vec<u32>) {
    if kept.len() >= LEAST {
        drop_few(kept, |i| positions[*i as usize], OUTLIER_SHARE, FAR);
    }
}

/// A sentence about few points that make the box much larger than that of the others, if there are such.
pub(super) fn doubt(samples: &Samples) -> Option<String> {
    if samples.positions.len() < LEAST {
        return None;
    }
    let bulk = bulk(samples.positions.iter().copied(), OUTERMOST);
    let longest = (bulk.1 - bulk.0).max_element();
    let times = 1.0 / (BOX_SCALE * longest);
    (times > STRETCHED).then(|| {
        let far = samples.positions.iter().filter(|p| beyond(bulk, **p) > 0.5 * longest);
        format!(
            "{} points make the box {times:.1} times as long as that of the others, and the cells as coarse: if these are \
             outliers, fit them by the robust loss",
            far.count()
        )
    })
}

/// The samples in a box of their own without those far from all that have weight, if that box is much smaller.
///
/// # Errors
/// As [`Samples::prepare`].
pub(super) fn without_far(samples: &Samples, cloud: OrientedPoints<'_>) -> Result<Option<Samples>, FitError> {
    let mut live: Vec<DVec3> = samples.live_points().map(|i| samples.positions[i]).collect();
    if live.len() < LEAST {
        return Ok(None);
    }
    // Few outliers have neighbours that speak for them by chance.
    drop_few(&mut live, |p| *p, OUTERMOST, 1.0);
    let low = live.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = live.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    match BOX_SCALE * STRETCHED * (high - low).max_element() < 1.0 {
        true => samples.cut_to(cloud, low, high).map(Some),
        false => Ok(None),
    }
}
