//! The charts of what was measured.

use super::{Place, ToolCosts, ToolLine};
use crate::charts::{Chart, Series};

/// Lowest value drawn, relative to the largest.
const DEPTH: f64 = 1e-11;

/// Error of an integral that is drawn for any that is smaller.
const LEAST: f64 = 1e-10;

/// Adds a point to the series of a name, which is made when it comes first.
fn add(series: &mut Vec<Series>, name: &str, point: (f64, f64, String)) {
    if !series.iter().any(|s| s.name == name) {
        series.push(Series {
            name: name.into(),
            points: Vec::new(),
        });
    }
    let found = series.iter_mut().find(|s| s.name == name);
    found.expect("just made").points.push(point);
}

fn chart(title: &str, x: &str, y: &str, is_joined: bool, series: Vec<Series>) -> Chart {
    Chart {
        title: title.into(),
        x_title: x.into(),
        y_title: y.into(),
        depth: DEPTH,
        series,
        is_joined,
    }
}

fn marked(is_default: bool, word: String) -> String {
    match (is_default, word.is_empty()) {
        (false, _) => word,
        (true, true) => "default".into(),
        (true, false) => format!("{word} (default)"),
    }
}

impl ToolCosts {
    /// All charts with the names of their files.
    pub fn charts(&self) -> Vec<(&'static str, Chart)> {
        let mut charts = vec![
            ("quadrature", self.quadrature()),
            ("sampling", self.sampling()),
            ("paths", self.paths(true)),
            ("paths-cost", self.paths(false)),
            ("brush", self.brush()),
            ("table2", self.table2()),
        ];
        let loops = self.loops();
        if !loops.series.is_empty() {
            charts.push(("loops", loops));
        }
        charts
    }

    fn quadrature(&self) -> Chart {
        let mut series = Vec::new();
        for q in &self.quadratures {
            let error = q.error.max(LEAST);
            let point = (q.values as f64, error, marked(q.default, q.word()));
            add(&mut series, &q.series, point);
        }
        chart(
            "force along a path: error against cost, by the exactness asked for",
            "values of the density",
            "error of the force over the force; 1e-10 stands for less",
            true,
            series,
        )
    }

    fn sampling(&self) -> Chart {
        let mut series = Vec::new();
        for line in &self.lines {
            let (Place::Sampling { error }, Some(x)) = (&line.place, line.sampling_factor) else {
                continue;
            };
            let word = marked(line.default, String::new());
            add(&mut series, &format!("{}: tip", line.law), (x, *error, word));
            let profile = line.profile_error.unwrap_or(0.0);
            add(
                &mut series,
                &format!("{}: profile", line.law),
                (x, profile, String::new()),
            );
        }
        chart(
            "a point tool: arrival against sampling",
            "samples per length, over those that a tool takes by itself",
            "error over the drag",
            true,
            series,
        )
    }

    /// Of the arrival, or of what a step costs.
    fn paths(&self, arrival: bool) -> Chart {
        let mut series = Vec::new();
        for line in &self.lines {
            let (Place::Paths { error }, Some(drag)) = (&line.place, line.drag_over_r) else {
                continue;
            };
            let (x, word) = (line.paths as f64, marked(line.default, String::new()));
            let name = format!("{}, drag {drag:.1} r", line.law);
            if arrival {
                add(&mut series, &format!("{name}: worst place"), (x, *error, word));
                let shape = line.profile_error.unwrap_or(0.0);
                add(&mut series, &format!("{name}: shape"), (x, shape, String::new()));
            } else {
                add(&mut series, &name, (x, line.loop_ms.unwrap_or(0.0), word));
            }
        }
        let (title, y) = match arrival {
            true => (
                "a curve of 6 r: arrival against the number of paths",
                "error over the drag",
            ),
            false => (
                "a curve of 6 r: cost against the number of paths",
                "time of force and step, ms",
            ),
        };
        chart(title, "paths", y, true, series)
    }

    fn brush(&self) -> Chart {
        let mut series = Vec::new();
        for line in &self.lines {
            if let Place::Brush {
                intervals,
                series: name,
            } = &line.place
            {
                let point = (*intervals, line.loop_ms.unwrap_or(0.0), String::new());
                add(&mut series, name, point);
            }
        }
        chart(
            "time of an update against the size of the brush (all defaults)",
            "radius over the knot interval of the field",
            "time of a loop, ms",
            true,
            series,
        )
    }

    fn table2(&self) -> Chart {
        let mut series = Vec::new();
        for (line, samples, _) in self.placed().filter(|(l, ..)| l.printed_ms.is_some()) {
            let name = match line.default {
                true => "here (default)",
                false => "here, a half ten times as stiff",
            };
            let row = line.tool.split(' ').find(|w| w.contains('/')).unwrap_or("");
            let row = row.trim_end_matches(',');
            let word = if line.default {
                row.to_owned()
            } else {
                String::new()
            };
            add(&mut series, name, (samples, line.loop_ms.unwrap_or(0.0), word));
            if line.default {
                let printed = line.printed_ms.unwrap_or(0.0);
                add(
                    &mut series,
                    "[Hua04] table 2, 2004",
                    (samples, printed, String::new()),
                );
            }
        }
        chart(
            "force, step, difference and mesh on the patches of [Hua04] table 2",
            "samples",
            "time of a loop, ms",
            true,
            series,
        )
    }

    fn loops(&self) -> Chart {
        let mut series = Vec::new();
        for (line, samples, name) in self.placed().filter(|(l, ..)| l.printed_ms.is_none()) {
            let object = line.tool.split([',', ' ']).nth(2).unwrap_or("");
            add(
                &mut series,
                name,
                (samples, line.loop_ms.unwrap_or(0.0), object.into()),
            );
        }
        chart(
            "loops of force tools on fitted fields, region of about 15/20 and 24/32 (all defaults)",
            "samples that move",
            "time of a loop, ms",
            false,
            series,
        )
    }

    fn placed(&self) -> impl Iterator<Item = (&ToolLine, f64, &String)> {
        self.lines.iter().filter_map(|line| match &line.place {
            Place::Loop { samples, series } => Some((line, *samples as f64, series)),
            _ => None,
        })
    }
}
