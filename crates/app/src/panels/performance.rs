//! What the work costs: pictures, steps, touch and memory over the last time.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use egui_plot::{GridMark, Plot, PlotPoints, Points};
use tools::scene::StepLine;

use crate::cli::cost::rss_bytes;
use crate::cli::quantity::{human_bytes, human_count, human_number};
use crate::window::Bench;

/// How long figures are kept.
const KEPT: Duration = Duration::from_secs(30);
/// Time from one look at the memory to the next.
const LOOK: Duration = Duration::from_millis(500);

/// Figures with the time at which each was found.
#[derive(Default)]
struct Row(VecDeque<(Instant, f64)>);

impl Row {
    fn push(&mut self, figure: f64) {
        let now = Instant::now();
        self.0.push_back((now, figure));
        while self.0.front().is_some_and(|(when, _)| now - *when > KEPT) {
            self.0.pop_front();
        }
    }

    /// Seconds ago, negative, and the figure.
    fn points(&self) -> Vec<[f64; 2]> {
        let at = |(when, figure): &(Instant, f64)| [-when.elapsed().as_secs_f64(), *figure];
        self.0.iter().map(at).collect()
    }

    /// The middle one of the last second; none if there is none.
    fn lately(&self) -> Option<f64> {
        let new = self
            .0
            .iter()
            .rev()
            .take_while(|(when, _)| when.elapsed() < Duration::from_secs(1));
        let mut new: Vec<f64> = new.map(|(_, figure)| *figure).collect();
        new.sort_by(f64::total_cmp);
        new.get(new.len() / 2).copied()
    }
}

/// What the work costs.
#[derive(Default)]
pub struct Performance {
    /// Whether its panel is shown.
    pub is_open: bool,
    /// Of pictures, ms.
    pictures: Row,
    /// Of steps of strokes, ms.
    steps: Row,
    /// Forces of a device a second.
    touch: Row,
    /// MiB.
    memory: Row,
    /// When a picture began last.
    last: Option<Instant>,
    /// What the last step of a scene did that is played, or was.
    step: Option<StepLine>,
    /// Bytes of the triangles on the card.
    pub meshes: u64,
}

impl Performance {
    /// A step of a stroke took so many seconds.
    pub fn step(&mut self, seconds: f64) {
        self.steps.push(1e3 * seconds);
    }

    /// A step of a scene did that.
    pub fn moved(&mut self, step: StepLine) {
        self.step = Some(step);
    }

    /// A device was given so many forces a second.
    pub fn touched(&mut self, rate: f64) {
        self.touch.push(rate);
    }

    /// A picture begins; pictures that nobody asked for, long after the last, do not count.
    pub fn picture(&mut self) {
        let now = Instant::now();
        if let Some(last) = self.last.replace(now)
            && now - last < Duration::from_millis(400)
        {
            self.pictures.push(1e3 * (now - last).as_secs_f64());
        }
    }
}

/// In a panel of its own.
pub fn performance(ui: &mut egui::Ui, bench: &mut Bench) {
    let memory = bench.performance.memory.0.back();
    let is_new = memory.is_none_or(|(when, _)| when.elapsed() > LOOK);
    if let Some(bytes) = rss_bytes().filter(|_| is_new) {
        bench.performance.memory.push(bytes as f64 / f64::from(1 << 20));
    }
    ui.ctx().request_repaint_after(LOOK);
    let costs = &bench.performance;
    let pictures = costs
        .pictures
        .lately()
        .map(|ms| format!("{:.0} a second", 1e3 / ms.max(1e-3)));
    let steps = costs
        .steps
        .lately()
        .map(|ms| format!("{ms:.1} ms a step, {:.0} a second", 1e3 / ms.max(1e-3)));
    let touch = costs.touch.lately().map(|rate| format!("{rate:.0} a second"));
    let memory = costs
        .memory
        .lately()
        .map(|mib| human_bytes((mib * f64::from(1 << 20)) as u64));
    let rows = [
        (
            "Pictures",
            &costs.pictures,
            "ms",
            pictures.unwrap_or("nothing moves".into()),
        ),
        (
            "Strokes",
            &costs.steps,
            "ms",
            steps.unwrap_or("none lately".into()),
        ),
        (
            "Forces of a device",
            &costs.touch,
            "/s",
            touch.unwrap_or("none in the hand".into()),
        ),
        (
            "Memory",
            &costs.memory,
            "MiB",
            memory.unwrap_or("the system does not tell".into()),
        ),
    ];
    for (name, row, unit, text) in rows {
        ui.horizontal_wrapped(|ui| {
            ui.strong(name);
            ui.label(text);
        });
        if row.0.len() > 1 {
            plot(ui, name, row, unit);
        }
    }
    for (name, text) in [("Simulation", simulated(costs)), ("Fields", fields(bench))] {
        ui.horizontal_wrapped(|ui| {
            ui.strong(name);
            ui.label(text);
        });
    }
    ui.horizontal_wrapped(|ui| {
        ui.strong("Meshes");
        let count = human_count(bench.triangles);
        ui.label(format!("{count} triangles, {}", human_bytes(costs.meshes)));
    });
}

/// What the last step of a scene did.
fn simulated(costs: &Performance) -> String {
    let Some(step) = &costs.step else {
        return "none was played".into();
    };
    let time = human_number(step.time);
    if !step.awake {
        return format!("asleep at {time} s");
    }
    format!(
        "{} iterations, residual {:.1e}, {} samples awake at {time} s",
        step.iterations,
        step.residual,
        human_count(step.awake_samples)
    )
}

/// What the objects hold.
fn fields(bench: &Bench) -> String {
    let objects = bench.sheet.iter().flat_map(|sheet| &sheet.objects);
    let (count, bytes) = objects.fold((0, 0), |(count, bytes), thing| {
        let totals = thing
            .object
            .field
            .levels()
            .map_or(0, |levels| levels.totals_bytes());
        let own = thing.coefficients * size_of::<f32>() + totals;
        (count + thing.coefficients, bytes + own as u64)
    });
    format!("{} coefficients, {}", human_count(count), human_bytes(bytes))
}

fn plot(ui: &mut egui::Ui, name: &str, row: &Row, unit: &str) {
    let unit = unit.to_string();
    let most = row
        .0
        .iter()
        .fold(f64::MIN_POSITIVE, |most, (_, figure)| most.max(*figure));
    // Of so small a plot the ends alone are marked.
    let ends = |far: f64| {
        move |_| {
            [0.0, far]
                .map(|value| GridMark {
                    value,
                    step_size: far.abs(),
                })
                .to_vec()
        }
    };
    Plot::new(name)
        .height(64.0)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .include_x(-KEPT.as_secs_f64())
        .include_x(0.0)
        .include_y(0.0)
        .show_x(false)
        .y_grid_spacer(ends(most))
        .x_grid_spacer(ends(-KEPT.as_secs_f64()))
        .y_axis_formatter(move |mark, _| format!("{:.0} {unit}", mark.value))
        .x_axis_formatter(|mark, _| format!("{} s", mark.value))
        .show(ui, |plot| {
            plot.points(Points::new(name, PlotPoints::from(row.points())).radius(1.5))
        });
}
