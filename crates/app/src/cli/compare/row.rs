//! Rows of the table.

use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::num::NonZeroUsize;

use serde::Serialize;
use serde_json::{Map, Value};

use super::super::failure::{OrFail, Outcome};
use super::super::output::Output;
use super::super::quantity::human_count;
use super::subject::{Kind, Subject};
use crate::check::ErrorStatistics;

/// What a run costs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Cost {
    /// User and system seconds.
    pub cpu_seconds: f64,
    /// By the clock.
    pub seconds: f64,
    /// Of memory.
    pub peak_mib: f64,
}

impl Cost {
    /// What a run tells, ours or another's.
    pub fn of(told: &Map<String, Value>) -> Self {
        let figure = |key: &str| told.get(key).and_then(Value::as_f64);
        Self {
            cpu_seconds: figure("cpu_seconds")
                .or_else(|| figure("cpu"))
                .unwrap_or(f64::NAN),
            seconds: figure("seconds").or_else(|| figure("wall")).unwrap_or(f64::NAN),
            peak_mib: (figure("peak_rss_bytes").map(|b| b / 1048576.0))
                .or_else(|| figure("peak_mib"))
                .unwrap_or(f64::NAN),
        }
    }

    /// The median of each.
    pub fn median(costs: Vec<Self>) -> Self {
        let of = |get: fn(&Self) -> f64| {
            let mut all: Vec<f64> = costs.iter().map(get).collect();
            all.sort_by(f64::total_cmp);
            all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
        };
        Self {
            cpu_seconds: of(|c| c.cpu_seconds),
            seconds: of(|c| c.seconds),
            peak_mib: of(|c| c.peak_mib),
        }
    }
}

/// A program on an input.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    input: String,
    program: String,
    setting: String,
    #[serde(flatten)]
    cost: Cost,
    /// Triangles or coefficients.
    size: usize,
    /// What errors are counted in.
    unit: &'static str,
    rms: f64,
    p95: f64,
    max: f64,
    /// From the result back to the truth.
    back_p95: Option<f64>,
}

impl Row {
    /// Measures a result. Its errors do not depend on the run, its costs are [set later](Self::with).
    pub fn new(
        subject: &Subject,
        program: String,
        setting: String,
        told: &Map<String, Value>,
    ) -> Outcome<Self> {
        let figure = |key: &str| told.get(key).and_then(Value::as_f64).unwrap_or(f64::NAN);
        let (size, there, back) = match subject.kind {
            Kind::Cloud => subject.errors()?,
            Kind::Volume => {
                let errors = ErrorStatistics {
                    rms: figure("rms"),
                    p95: figure("p95"),
                    max: figure("max"),
                    ..ErrorStatistics::default()
                };
                (figure("coefficients") as usize, errors, None)
            }
        };
        Ok(Self {
            input: subject.name.clone(),
            program,
            setting,
            cost: Cost::default(),
            size,
            unit: match subject.kind {
                Kind::Cloud => "1e-4 diagonal",
                Kind::Volume => "density",
            },
            rms: there.rms,
            p95: there.p95,
            max: there.max,
            back_p95: back.map(|b| b.p95),
        })
    }

    /// The same with its costs.
    pub fn with(self, cost: Cost) -> Self {
        Self { cost, ..self }
    }

    fn markdown(&self) -> String {
        let setting = if self.setting.is_empty() {
            "default"
        } else {
            &self.setting
        };
        let back = self.back_p95.map_or(String::new(), figure);
        let Cost {
            cpu_seconds,
            seconds,
            peak_mib,
        } = self.cost;
        format!(
            "| {} | {} | {setting} | {cpu_seconds:.2} | {seconds:.2} | {peak_mib:.0} | {} | {} | {} | {} | {back} | {} |",
            self.input,
            self.program,
            human_count(self.size),
            figure(self.rms),
            figure(self.p95),
            figure(self.max),
            self.unit,
        )
    }
}

/// Three digits are as many as runs agree in.
fn figure(x: f64) -> String {
    match x.abs() {
        size if size >= 100.0 => format!("{x:.0}"),
        size if size >= 10.0 => format!("{x:.1}"),
        size if size >= 0.01 || size == 0.0 => format!("{x:.2}"),
        _ => format!("{x:.1e}"),
    }
}

const HEAD: &str = "\
| input | program | setting | CPU s | wall s | peak MiB | triangles or coefficients | rms | p95 | max | back p95 | errors in |
| --- | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |
";

/// Writes the table, with what is to be known of it.
pub fn write(
    rows: &[Row],
    notes: &[String],
    threads: NonZeroUsize,
    runs: u8,
    output: Option<&Output>,
    json: bool,
) -> Outcome {
    let mut table = String::from(HEAD);
    for row in rows {
        table.push_str(&row.markdown());
        table.push('\n');
    }
    let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let _ = write!(
        table,
        "\nMedians of {runs} runs in turn, {threads} of {cores} cores. isoclay, PoissonRecon and SSDRecon: whole processes with reading \
         and writing; the others: the call alone. Errors of clouds: exact distances from the points to the triangles, and back \
         from 100 000 points of the result to the mesh that the points come from; of volumes: residuals at the voxels.\n"
    );
    for note in notes {
        let _ = writeln!(table, "\n{note}");
    }
    if let Some(output) = output {
        formats::atomic::replace(output.path(), |out| out.write_all(table.as_bytes()))
            .map_err(|e| output.writing(e))?;
        output.finish()?;
    }
    if output.is_some() && !json {
        return Ok(());
    }
    let mut stdout = io::stdout().lock();
    if json {
        for row in rows {
            writeln!(stdout, "{}", serde_json::to_string(row).or_limit()?).or_limit()?;
        }
        notes.iter().for_each(|note| eprintln!("isoclay: {note}"));
        return Ok(());
    }
    stdout.write_all(table.as_bytes()).or_limit()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_of_ours_and_of_others_are_read_and_medians_taken() {
        let told = |text: &str| Cost::of(serde_json::from_str::<Value>(text).unwrap().as_object().unwrap());
        let ours = told(r#"{"cpu_seconds": 2.0, "seconds": 3.0, "peak_rss_bytes": 2097152}"#);
        let other = told(r#"{"cpu": 1.0, "wall": 5.0, "peak_mib": 7.0}"#);
        assert_eq!((ours.cpu_seconds, ours.seconds, ours.peak_mib), (2.0, 3.0, 2.0));
        let low = Cost {
            cpu_seconds: 0.5,
            ..other
        };
        let median = Cost::median(vec![ours, other, low]);
        assert_eq!(
            (median.cpu_seconds, median.seconds, median.peak_mib),
            (1.0, 5.0, 7.0)
        );
    }

    #[test]
    fn figures_have_three_digits() {
        assert_eq!(
            [0.0, 3.456, 34.56, 345.6, 4.4e-6].map(figure),
            ["0.00", "3.46", "34.6", "346", "4.4e-6"]
        );
    }
}
