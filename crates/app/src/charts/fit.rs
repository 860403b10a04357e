use serde::Serialize;
use serde_json::{Map, Value};

use super::plot::DEPTH;
use super::{Chart, Series};

/// What kind of data a sweep runs over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// Points.
    Cloud,
    /// Voxels.
    Volume,
}

/// The option that a sweep turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Sweep {
    /// No option: what the program chooses.
    Default,
    /// `--tolerance`, single precision.
    Tolerance,
    /// `--tolerance`, double precision.
    ToleranceDouble,
    /// `--max-depth` with a tolerance that is never met.
    Depth,
    /// `--smoothing`, for clouds at `--max-depth 7` with a tolerance that is never met.
    Smoothing,
    /// `--method interpolate`, both precisions.
    Interpolate,
}

impl Sweep {
    /// Name in the legend.
    fn name(self) -> &'static str {
        match self {
            Self::Default => "default",
            Self::Tolerance => "tolerance, f32",
            Self::ToleranceDouble => "tolerance, f64",
            Self::Depth => "depth, f32",
            Self::Smoothing => "smoothing, f32",
            Self::Interpolate => "interpolating, f32 and f64",
        }
    }
}

/// One run of `isoclay fit`.
#[derive(Clone, Debug)]
pub struct Configuration {
    /// The sweep it belongs to.
    pub sweep: Sweep,
    /// What stands beside its point.
    pub label: String,
    /// Options of `isoclay fit`, in pairs.
    pub options: Vec<(&'static str, String)>,
}

/// A configuration with what it cost and how well it did.
pub struct Measurement {
    /// What was run.
    pub configuration: Configuration,
    /// The object that `isoclay fit --json` printed; times are medians.
    pub fit: Map<String, Value>,
    /// Rms error measured again: of phantoms at other points of the true surface, of files at their own samples.
    pub rms: f64,
    /// 95th percentile of the same.
    pub p95: f64,
}

/// The runs for one input.
pub fn sweeps(input: Input) -> Vec<Configuration> {
    let mut runs = Vec::new();
    let mut add = |sweep, label: String, options: Vec<(&'static str, String)>| {
        runs.push(Configuration {
            sweep,
            label,
            options,
        });
    };
    let tolerances: &[&str] = match input {
        Input::Cloud => &[
            "0.5%", "0.2%", "0.1%", "0.05%", "0.02%", "0.01%", "0.005%", "0.002%",
        ],
        Input::Volume => &["8%", "4%", "2%", "1%", "0.5%", "0.25%"],
    };
    for (sweep, precision) in [(Sweep::Tolerance, "f32"), (Sweep::ToleranceDouble, "f64")] {
        for t in tolerances {
            add(
                sweep,
                t.to_string(),
                vec![("--tolerance", t.to_string()), ("--precision", precision.into())],
            );
        }
    }
    let (depths, never) = match input {
        Input::Cloud => (6..=10, "0.0001%"),
        Input::Volume => (0..=2, "0.001%"),
    };
    for d in depths {
        add(
            Sweep::Depth,
            d.to_string(),
            vec![("--max-depth", d.to_string()), ("--tolerance", never.into())],
        );
    }
    // The weight of a cloud acts on the finest level, so that level has to be reached.
    let (weights, fixed): (&[&str], Vec<_>) = match input {
        Input::Cloud => (
            &["1e-6", "1e-5", "1e-4", "1e-3", "1e-2", "1e-1", "1"],
            vec![("--max-depth", "7".to_string()), ("--tolerance", never.into())],
        ),
        Input::Volume => (&["1e-4", "1e-3", "1e-2", "1e-1"], Vec::new()),
    };
    for mu in weights {
        let options = [("--smoothing", mu.to_string())].into_iter().chain(fixed.clone());
        add(Sweep::Smoothing, mu.to_string(), options.collect());
    }
    if input == Input::Volume {
        for precision in ["f32", "f64"] {
            let options = vec![
                ("--method", "interpolate".into()),
                ("--precision", precision.into()),
            ];
            add(Sweep::Interpolate, precision.into(), options);
        }
    }
    runs.push(Configuration {
        sweep: Sweep::Default,
        label: "default".into(),
        options: Vec::new(),
    });
    runs
}

impl Measurement {
    /// The line of JSON: the fit's object, the parameters, the error measured again.
    pub fn json(&self, input: &str) -> String {
        let mut object = self.fit.clone();
        object.insert("input".into(), input.into());
        object.insert(
            "sweep".into(),
            serde_json::to_value(self.configuration.sweep).expect("a name"),
        );
        for (option, value) in &self.configuration.options {
            let key = format!("option_{}", option.trim_start_matches('-').replace('-', "_"));
            object.insert(key, value.clone().into());
        }
        object.insert("checked_rms".into(), self.rms.into());
        object.insert("checked_p95".into(), self.p95.into());
        Value::Object(object).to_string()
    }

    fn figure(&self, key: &str) -> f64 {
        self.fit.get(key).and_then(Value::as_f64).unwrap_or(f64::NAN)
    }
}

impl Chart {
    /// Error against the figure `key` of the fit, divided by `unit`.
    pub fn of_fit(
        title: String,
        x_title: &str,
        key: &str,
        unit: f64,
        y_title: String,
        runs: &[Measurement],
    ) -> Self {
        let mut series: Vec<(Sweep, Series)> = Vec::new();
        for m in runs {
            let sweep = m.configuration.sweep;
            if series.last().is_none_or(|(s, _)| *s != sweep) {
                series.push((
                    sweep,
                    Series {
                        name: sweep.name().into(),
                        points: Vec::new(),
                    },
                ));
            }
            let (_, line) = series.last_mut().expect("one was pushed");
            line.points
                .push((m.figure(key) / unit, m.rms, m.configuration.label.clone()));
        }
        let series = series.into_iter().map(|(_, s)| s).collect();
        Self {
            title,
            x_title: x_title.into(),
            y_title,
            depth: DEPTH,
            series,
            is_joined: true,
        }
    }
}
