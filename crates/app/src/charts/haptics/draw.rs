//! The charts of what was measured.

use super::{HapticLine, Place};
use crate::charts::{Chart, Series};

/// Lowest value drawn, relative to the largest.
const DEPTH: f64 = 1e-9;

/// A chart of the lines that `place` says the series, the point and its word of.
fn chart(
    lines: &[HapticLine],
    [title, x, y]: [&str; 3],
    is_joined: bool,
    place: impl Fn(&HapticLine) -> Option<(String, f64, f64, String)>,
) -> Chart {
    let mut series: Vec<Series> = Vec::new();
    for line in lines {
        let Some((name, x, y, word)) = place(line) else {
            continue;
        };
        let word = match (line.default && is_joined, word.is_empty()) {
            (false, _) => word,
            (true, true) => "default".into(),
            (true, false) => format!("{word} (default)"),
        };
        if !series.iter().any(|s| s.name == name) {
            series.push(Series {
                name: name.clone(),
                points: Vec::new(),
            });
        }
        let found = series.iter_mut().find(|s| s.name == name);
        found.expect("just made").points.push((x, y, word));
    }
    Chart {
        title: title.into(),
        x_title: x.into(),
        y_title: y.into(),
        depth: DEPTH,
        series,
        is_joined,
    }
}

/// All charts with the names of their files.
pub fn charts(lines: &[HapticLine]) -> Vec<(&'static str, Chart)> {
    let by_cost = |line: &HapticLine| match &line.place {
        Place::Resolution { series, spacing } => Some((
            (*series).to_string(),
            line.tick_mean_us,
            line.force_error_n?,
            format!("{spacing} mm"),
        )),
        _ => None,
    };
    let by_spacing = |line: &HapticLine| match &line.place {
        Place::Resolution { series, spacing } => Some((
            (*series).to_string(),
            *spacing,
            line.force_error_n?,
            String::new(),
        )),
        _ => None,
    };
    let steps = |line: &HapticLine| match &line.place {
        Place::Steps { series, word } => Some((
            (*series).to_string(),
            line.tick_mean_us,
            line.force_error_n?,
            word.clone(),
        )),
        _ => None,
    };
    let modes = |line: &HapticLine| match &line.place {
        Place::Scene { scene, mode } => {
            let name = scene.split(' ').next().unwrap_or(scene);
            let word = if line.passed {
                name.to_string()
            } else {
                format!("{name} fails")
            };
            Some((
                (*mode).to_string(),
                line.tick_mean_us,
                line.force_jump_max_n,
                word,
            ))
        }
        _ => None,
    };
    let sizes = |line: &HapticLine| match &line.place {
        Place::Size { radius } => Some((
            format!("tool of {radius} mm"),
            line.field_bytes as f64,
            line.tick_mean_us,
            String::new(),
        )),
        _ => None,
    };
    let tick = "mean time of a tick, µs";
    let error = "rms error of the force, N";
    vec![
        (
            "resolution",
            chart(
                lines,
                [
                    "a ball of 2 mm on a torus: force against cost, by the distance of nodes",
                    tick,
                    error,
                ],
                true,
                by_cost,
            ),
        ),
        (
            "nodes",
            chart(
                lines,
                [
                    "a ball of 2 mm on a torus: force against snapshots",
                    "distance of nodes, mm",
                    error,
                ],
                true,
                by_spacing,
            ),
        ),
        (
            "steps",
            chart(
                lines,
                [
                    "a ball of 2 mm on a torus: force against cost, by the steps of the search",
                    tick,
                    error,
                ],
                true,
                steps,
            ),
        ),
        (
            "modes",
            chart(
                lines,
                [
                    "scenes where methods fail: who holds",
                    tick,
                    "largest change of the force in a tick, N",
                ],
                false,
                modes,
            ),
        ),
        (
            "sizes",
            chart(
                lines,
                [
                    "a tick against the size of the field",
                    "bytes of coefficients",
                    tick,
                ],
                true,
                sizes,
            ),
        ),
    ]
}
