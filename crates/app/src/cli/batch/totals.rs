//! What came of a batch: for people, as JSON, and as a table for other programs.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::super::end;
use super::super::failure::{Failure, Outcome};
use super::super::quantity::{human_bytes, human_count};
use super::super::summary::{print, table};
use super::manifest::{Entry, PROGRAM, Run, State};

/// Failures that a message names.
const NAMED: usize = 10;

/// Figures of all inputs together.
#[derive(Clone, Debug, Serialize)]
pub struct Totals {
    /// What wrote it.
    pub program: &'static str,
    /// Options that the results depend on.
    pub parameters: Map<String, Value>,
    /// The share that it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shard: Option<String>,
    /// Inputs.
    pub inputs: usize,
    /// Inputs done.
    pub done: usize,
    /// Inputs that failed.
    pub failed: usize,
    /// Inputs that were not tried yet.
    pub pending: usize,
    /// Of those done or failed, how many an earlier run did.
    pub kept: usize,
    /// Wall seconds of this run.
    pub seconds: f64,
    /// Wall seconds of all inputs.
    pub input_seconds: f64,
    /// Largest resident size of any process.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_rss_bytes: Option<u64>,
    /// Bytes read and written.
    pub input_bytes: u64,
    /// Bytes of all outputs.
    pub output_bytes: u64,
    /// Those that failed, with the reason.
    pub failures: Vec<Value>,
    /// Files in folders that are nothing to fit.
    pub skipped: Vec<String>,
    /// Doubts.
    pub notes: Vec<String>,
    /// Inputs in order: names of outputs.
    #[serde(skip)]
    order: Vec<(String, String)>,
}

impl Totals {
    /// Totals of runs that together are one batch, in the order of their shards.
    pub fn new(runs: &[Run], entries: &BTreeMap<String, Entry>, seconds: f64) -> Self {
        // Shards take turns in the list of all inputs.
        let turns = runs.iter().map(|r| r.inputs.len()).max().unwrap_or(0);
        let order: Vec<(String, String)> = (0..turns)
            .flat_map(|turn| runs.iter().filter_map(move |r| r.inputs.get(turn).cloned()))
            .collect();
        let all: Vec<&Entry> = order.iter().filter_map(|(name, _)| entries.get(name)).collect();
        let failed = all.iter().filter(|e| e.state == State::Failed);
        let failures = failed.map(|e| {
            json!({
                "input": e.input,
                "stage": e.failure.as_ref().map(|f| &f.stage),
                "reason": e.failure.as_ref().map(|f| &f.message),
            })
        });
        let first = runs.first();
        let failures: Vec<Value> = failures.collect();
        Self {
            program: PROGRAM,
            parameters: first.map(|r| r.parameters.clone()).unwrap_or_default(),
            shard: first
                .filter(|_| runs.len() == 1)
                .and_then(|r| Some(r.shard?.to_string())),
            inputs: order.len(),
            done: all.len() - failures.len(),
            failed: failures.len(),
            pending: order.len() - all.len(),
            kept: 0,
            seconds,
            input_seconds: all.iter().map(|e| e.seconds).sum(),
            peak_rss_bytes: all.iter().filter_map(|e| e.peak_rss_bytes).max(),
            input_bytes: all.iter().map(|e| e.input_bytes).sum(),
            output_bytes: all.iter().flat_map(|e| e.outputs.values()).map(|w| w.bytes).sum(),
            failures,
            skipped: Vec::new(),
            notes: Vec::new(),
            order,
        }
    }

    /// The entries in the order of the inputs.
    pub fn ordered<'a>(&self, entries: &'a BTreeMap<String, Entry>) -> Vec<&'a Entry> {
        self.order
            .iter()
            .filter_map(|(name, _)| entries.get(name))
            .collect()
    }

    /// Names of outputs, and inputs, in order.
    pub fn order(&self) -> &[(String, String)] {
        &self.order
    }

    /// Writes `summary.json` and `summary.csv`.
    pub fn write(&self, directory: &Path, entries: &BTreeMap<String, Entry>) -> Outcome {
        let ordered = self.ordered(entries);
        let mut object = json!(self);
        object["entries"] = json!(ordered);
        let write = |name: &str, text: &str| {
            formats::atomic::replace(&directory.join(name), |out| out.write_all(text.as_bytes()))
                .map_err(Failure::limit)
        };
        write("summary.json", &format!("{object:#}\n"))?;
        write("summary.csv", &csv(&ordered))
    }

    /// Prints the whole and ends as it has to: with exit code 3 if an input failed, 4 if some were not tried.
    pub fn tell(&self, directory: &Path, is_json: bool) -> Outcome {
        let failure = self.failure(directory);
        let mut object = json!(self);
        if let Some(f) = &failure {
            let about: Map<String, Value> = serde_json::from_str(&f.json()).unwrap_or_default();
            if let Some(o) = object.as_object_mut() {
                o.extend(about);
            }
        }
        if !is_json {
            print(&self.text(directory), false)?;
        }
        match failure {
            Some(f) => {
                end::tell_within(&f, &object.to_string());
                Err(f)
            }
            None if is_json => print(&object.to_string(), false),
            None => Ok(()),
        }
    }

    fn text(&self, directory: &Path) -> String {
        let count = |n: usize| Some(n).filter(|n| *n > 0).map(human_count);
        let rows = [
            ("inputs", Some(human_count(self.inputs))),
            ("done", Some(human_count(self.done))),
            ("  before", count(self.kept)),
            ("failed", count(self.failed)),
            ("not tried", count(self.pending)),
            ("skipped in folders", count(self.skipped.len())),
            ("share", self.shard.clone()),
            ("time", Some(format!("{:.2} s", self.seconds))),
            ("largest process", self.peak_rss_bytes.map(human_bytes)),
            ("read", Some(human_bytes(self.input_bytes))),
            ("written", Some(human_bytes(self.output_bytes))),
            ("in", Some(plain(&directory.display().to_string()))),
        ];
        table(rows.into_iter().filter_map(|(l, v)| Some((l, v?))), &self.notes)
    }

    fn failure(&self, directory: &Path) -> Option<Failure> {
        if self.failed > 0 {
            let named: Vec<String> = (self.failures.iter().take(NAMED))
                .map(|f| {
                    let part = |key: &str| plain(f[key].as_str().unwrap_or_default());
                    // Reasons mostly begin with the name themselves.
                    let (input, reason) = (part("input"), part("reason"));
                    if reason.starts_with(&input) {
                        reason
                    } else {
                        format!("{input}: {reason}")
                    }
                })
                .collect();
            let more = self.failed.saturating_sub(NAMED);
            return Some(Failure::input(format!(
                "{} of {} inputs failed:\n  {}{}\nall are named in {}; mend them and do them again by --resume",
                self.failed,
                self.inputs,
                named.join("\n  "),
                if more > 0 {
                    format!("\n  and {more} more")
                } else {
                    String::new()
                },
                plain(&directory.display().to_string()),
            )));
        }
        (self.pending > 0).then(|| {
            Failure::limit(format!(
                "{} of {} inputs were not tried yet; go on with the missing shards by --resume",
                self.pending, self.inputs
            ))
        })
    }
}

/// A name on one line.
fn plain(name: &str) -> String {
    name.chars()
        .map(|c| if c.is_control() { '?' } else { c })
        .collect()
}

/// A line for each input, as RFC 4180 has it.
fn csv(entries: &[&Entry]) -> String {
    const COLUMNS: [&str; 22] = [
        "input",
        "state",
        "kind",
        "rms",
        "p95",
        "max",
        "unit",
        "tolerance",
        "coefficients",
        "seconds",
        "cpu_seconds",
        "peak_mib",
        "input_bytes",
        "input_sha256",
        "field",
        "field_bytes",
        "field_sha256",
        "mesh",
        "triangles",
        "picture",
        "notes",
        "reason",
    ];
    let mut text = COLUMNS.join(",") + "\r\n";
    for e in entries {
        let of = |object: &Map<String, Value>, key: &str| match object.get(key) {
            Some(Value::String(s)) => s.clone(),
            Some(v) => v.to_string(),
            None => String::new(),
        };
        let fit = |key: &str| of(&e.fit, key);
        let path = |role: &str| e.outputs.get(role).map(|w| w.path.clone()).unwrap_or_default();
        let state = json!(e.state);
        let row: [String; COLUMNS.len()] = [
            e.input.clone(),
            state.as_str().unwrap_or_default().into(),
            e.kind.clone().unwrap_or_default(),
            fit("rms"),
            fit("p95"),
            fit("max"),
            fit("unit"),
            fit("tolerance"),
            fit("coefficients"),
            e.seconds.to_string(),
            fit("cpu_seconds"),
            e.peak_rss_bytes
                .map_or(String::new(), |b| format!("{:.1}", b as f64 / 1048576.0)),
            e.input_bytes.to_string(),
            e.input_sha256.clone().unwrap_or_default(),
            path("field"),
            e.outputs
                .get("field")
                .map_or(String::new(), |w| w.bytes.to_string()),
            fit("field_sha256"),
            path("mesh"),
            of(&e.mesh, "triangles"),
            path("picture"),
            e.notes.join("; "),
            e.failure.as_ref().map_or(String::new(), |f| f.message.clone()),
        ];
        text += &row.map(|cell| quoted(&cell)).join(",");
        text += "\r\n";
    }
    text
}

fn quoted(cell: &str) -> String {
    if cell.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_quoted_where_they_must_be() {
        assert_eq!(quoted("plain"), "plain");
        assert_eq!(quoted("a,\"b\"\nc"), "\"a,\"\"b\"\"\nc\"");
    }
}
