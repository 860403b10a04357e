//! What a hand on a document comes to.

use std::time::Duration;

use serde::Serialize;
use tools::haptics::Workspace;
use tools::haptics::gates::Granted;

use super::super::Told;
use super::tally::Tally;
use crate::cli::failure::Outcome;
use crate::cli::quantity::{human_count, human_number};
use crate::cli::summary::{self, table};
use crate::threads::Report;
use crate::threads::histogram::Histogram;

/// What a hand on a document comes to.
#[derive(Serialize)]
pub struct Felt {
    device: String,
    /// Lengths of the document for one mm of the device.
    scale: f64,
    stiffness_wished_n_per_m: f64,
    stiffness_n_per_m: f64,
    /// What keeps stiffness low, N/m; null is no limit.
    ceiling_late_n_per_m: f64,
    ceiling_counts_n_per_m: f64,
    ceiling_makers_n_per_m: f64,
    #[serde(flatten)]
    tally: Tally,
    strokes: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    threads: Option<Threads>,
}

/// What three threads tell.
#[derive(Serialize)]
struct Threads {
    priority: String,
    missed: u64,
    lost_records: u64,
    torn: u64,
    snapshots: u64,
    period_us: Times,
    cost_cpu_us: Times,
    simulation_steps: u64,
    simulation_ms: Times,
    frames: u64,
}

/// Quantiles of times.
#[derive(Serialize)]
struct Times {
    mean: f64,
    median: f64,
    p99: f64,
    p999: f64,
    max: f64,
}

impl Times {
    fn of(times: &Histogram, unit: f64) -> Self {
        let told = |t: Duration| t.as_secs_f64() / unit;
        Self {
            mean: told(times.mean()),
            median: told(times.quantile(0.5)),
            p99: told(times.quantile(0.99)),
            p999: told(times.quantile(0.999)),
            max: told(times.largest()),
        }
    }

    fn text(&self) -> String {
        let [mean, median, p99, p999, max] =
            [self.mean, self.median, self.p99, self.p999, self.max].map(human_number);
        format!("mean {mean}, median {median}, 99 % below {p99}, 99.9 % below {p999}, at most {max}")
    }
}

impl Felt {
    /// Of a device, its coupling, and what was counted.
    pub fn new(
        device: &str,
        granted: Granted,
        workspace: &Workspace,
        tally: Tally,
        strokes: usize,
        report: Option<&Report>,
    ) -> Self {
        let ceiling = granted.ceiling;
        Self {
            device: device.into(),
            scale: workspace.scale,
            stiffness_wished_n_per_m: granted.wished,
            stiffness_n_per_m: granted.stiffness,
            ceiling_late_n_per_m: ceiling.late,
            ceiling_counts_n_per_m: ceiling.counts,
            ceiling_makers_n_per_m: ceiling.makers,
            tally,
            strokes,
            threads: report.map(|report| Threads {
                priority: report.haptic.priority.clone(),
                missed: report.haptic.missed,
                lost_records: report.haptic.lost_records,
                torn: report.haptic.torn + report.graphics.torn,
                snapshots: report.haptic.snapshots,
                period_us: Times::of(&report.haptic.period, 1e-6),
                cost_cpu_us: Times::of(&report.haptic.cost, 1e-6),
                simulation_steps: report.simulation.steps,
                simulation_ms: Times::of(&report.simulation.step, 1e-3),
                frames: report.graphics.frames,
            }),
        }
    }

    /// Prints it with what the document tells: to stderr where stdout is taken.
    pub fn print(&self, told: Told, json: bool, is_taken: bool) -> Outcome {
        let text = match json {
            true => {
                #[derive(Serialize)]
                struct All<'a> {
                    #[serde(flatten)]
                    felt: &'a Felt,
                    #[serde(flatten)]
                    told: &'a Told,
                }
                let all = All {
                    felt: self,
                    told: &told,
                };
                serde_json::to_string(&all).expect("structs of plain fields are always JSON")
            }
            false => self.table(&told.notes),
        };
        summary::print(&text, is_taken)
    }

    fn table(&self, notes: &[String]) -> String {
        let t = &self.tally;
        let newton = |x: f64| format!("{} N", human_number(x));
        let ticks = |n: u64| match n {
            0 => "never".to_string(),
            n => format!("{} ticks", human_count(n as usize)),
        };
        let ceiling = self
            .ceiling_late_n_per_m
            .min(self.ceiling_counts_n_per_m)
            .min(self.ceiling_makers_n_per_m);
        let rows = [
            ("device", self.device.clone()),
            ("scale", human_number(self.scale)),
            (
                "stiffness at the hand",
                format!(
                    "{} N/m, the device holds {}",
                    human_number(self.stiffness_n_per_m),
                    human_number(ceiling)
                ),
            ),
            (
                "time",
                format!("{} s, {}", human_number(t.seconds), ticks(t.ticks)),
            ),
            ("in contact", format!("{:.1} %", 100.0 * t.contact_share)),
            ("largest force", newton(t.largest_force_n)),
            ("largest step", newton(t.largest_step_n)),
            (
                "largest torque",
                format!("{} N mm", human_number(t.largest_torque_nmm)),
            ),
            (
                "work of the hand",
                format!(
                    "{} J, at most {} J came back that was not put in",
                    human_number(t.work_j),
                    human_number(t.returned_j)
                ),
            ),
            ("damped by passivity control", ticks(t.damped)),
            ("at the largest force", ticks(t.clamped)),
            ("at the largest step", ticks(t.slewed)),
            ("warm", ticks(t.warm)),
            ("simulation not heard of", ticks(t.old_snapshot)),
            (
                "force taken away",
                t.tripped.as_ref().map_or("never".into(), |why| why.to_string()),
            ),
            ("edits", human_count(self.strokes)),
        ];
        let threads = self.threads.iter().flat_map(|threads| {
            [
                ("priority of the haptic thread", threads.priority.clone()),
                ("ticks left out", human_count(threads.missed as usize)),
                ("tick to tick, µs", threads.period_us.text()),
                ("processor time of a tick, µs", threads.cost_cpu_us.text()),
                ("step of the simulation, ms", threads.simulation_ms.text()),
                (
                    "snapshots",
                    format!(
                        "{}, {} torn",
                        human_count(threads.snapshots as usize),
                        threads.torn
                    ),
                ),
            ]
        });
        table(rows.into_iter().chain(threads), notes)
    }
}
