use fitting::FitError;
use fitting::points::PointOptions;

use super::hard::{COUNT, Scene};
use super::{Chart, Series};

/// Outliers, per cent of the points of the surface.
const SHARES: [f64; 6] = [0.1, 0.3, 1.0, 3.0, 10.0, 30.0];
/// Depth of the fits.
const DEPTH: usize = 7;

/// The share of outliers against the error with and without re-weighting.
///
/// # Errors
/// Those of the fits.
pub fn outliers(scene: &Scene, name: &str, mut progress: impl FnMut(f64)) -> Result<Chart, FitError> {
    let mut series: Vec<Series> = Vec::new();
    for (i, (robust, noise)) in [(false, 0.0), (true, 0.0), (false, 0.5), (true, 0.5)]
        .into_iter()
        .enumerate()
    {
        let options = PointOptions {
            robust,
            max_depth: (noise == 0.0).then_some(DEPTH),
            ..Default::default()
        };
        let mut points = Vec::new();
        for (k, share) in SHARES.into_iter().enumerate() {
            progress((i * SHARES.len() + k) as f64 / (4 * SHARES.len()) as f64);
            let cloud = scene.cloud(noise / 100.0, share / 100.0);
            let (error, _) = scene.error(&cloud, &options)?;
            points.push((share, 100.0 * error, String::new()));
        }
        let with = if robust { "--robust" } else { "default" };
        series.push(Series {
            name: if noise > 0.0 {
                format!("{with}, noise of {noise} %")
            } else {
                with.into()
            },
            points,
        });
    }
    Ok(Chart {
        title: format!("{name}: {COUNT} points and outliers, even in the box"),
        x_title: "outliers, % of the points on the surface".into(),
        y_title: "rms distance between the surfaces, % of the diagonal".into(),
        depth: super::plot::DEPTH,
        series,
        is_joined: true,
    })
}
