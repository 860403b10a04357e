use fitting::FitError;
use fitting::points::PointOptions;

use super::hard::{COUNT, Scene};
use super::plot::DEPTH;
use super::{Chart, Series};

/// Noise levels, per cent of the diagonal.
const LEVELS: [f64; 6] = [0.05, 0.1, 0.2, 0.5, 1.0, 2.0];

/// Noise against the knot spacing that the fit chooses and the error that comes of it, beside the errors one level
/// coarser and finer.
///
/// # Errors
/// Those of the fits.
pub fn noise(scene: &Scene, name: &str, mut progress: impl FnMut(f64)) -> Result<Chart, FitError> {
    let names = [
        "knot spacing chosen",
        "rms error, level chosen",
        "rms error, one level coarser",
        "rms error, one level finer",
    ];
    let mut series = names.map(|name| Series {
        name: name.into(),
        points: Vec::new(),
    });
    for (i, level) in LEVELS.into_iter().enumerate() {
        progress(i as f64 / LEVELS.len() as f64);
        let cloud = scene.cloud(level / 100.0, 0.0);
        let (error, report) = scene.error(&cloud, &PointOptions::default())?;
        let longest = cloud.positions.iter().fold(
            (glam::DVec3::INFINITY, glam::DVec3::NEG_INFINITY),
            |(lo, hi), p| (lo.min(*p), hi.max(*p)),
        );
        // The box of a fit is 1.15 times as wide as the cloud.
        let edge = 1.15 * (longest.1 - longest.0).max_element();
        let h = edge / 2f64.powi(report.depth as i32) / scene.diagonal();
        series[0]
            .points
            .push((level, 100.0 * h, format!("depth {}", report.depth)));
        series[1].points.push((level, 100.0 * error, String::new()));
        for (slot, depth) in [(2, report.depth.saturating_sub(1)), (3, report.depth + 1)] {
            let options = PointOptions {
                max_depth: Some(depth),
                ..Default::default()
            };
            // There is no level above 64 cells.
            if depth >= 6 {
                let (error, _) = scene.error(&cloud, &options)?;
                series[slot].points.push((level, 100.0 * error, String::new()));
            }
        }
    }
    Ok(Chart {
        title: format!("{name}: {COUNT} noisy points with exact normals"),
        x_title: "standard deviation of the noise, % of the diagonal".into(),
        y_title: "length, % of the diagonal".into(),
        depth: DEPTH,
        series: series.into(),
        is_joined: true,
    })
}
