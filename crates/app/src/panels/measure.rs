//! Lengths, angles, walls, area and volume.

use super::over::over;
use crate::cli::quantity::human_number;
use crate::window::Bench;
use crate::window::orders::Order;

/// In a window of its own.
pub fn measure(context: &egui::Context, bench: &mut Bench) {
    let Some(mut measure) = bench.measure.take() else {
        return;
    };
    let chosen = bench.sheet.as_ref().and_then(|s| s.objects.get(s.chosen));
    let (name, unit) = chosen.map_or(("", ""), |thing| (thing.name.as_str(), thing.unit));
    let length = |x: f64| format!("{} {unit}", human_number(x)).trim_end().to_string();
    let mut is_open = true;
    over(context, "Measure", 212.0)
        .open(&mut is_open)
        .default_width(220.0)
        .show(context, |ui| {
            if measure.marks.is_empty() {
                ui.label("Click places on the solid");
            }
            egui::Grid::new("measured").striped(true).show(ui, |ui| {
                let mut row = |what: String, figure: String| {
                    ui.label(what);
                    ui.monospace(figure);
                    ui.end_row();
                };
                for (n, distance) in measure.distances().enumerate() {
                    row(format!("{} to {}", n + 1, n + 2), length(distance));
                }
                if measure.marks.len() > 2 {
                    row("in all".into(), length(measure.distances().sum()));
                }
                for (n, angle) in measure.angles().enumerate() {
                    let angle = angle.map_or("none".into(), |a| format!("{a:.1}°"));
                    row(format!("angle at {}", n + 2), angle);
                }
                for (n, mark) in measure.marks.iter().enumerate() {
                    if let Some(wall) = mark.wall {
                        row(format!("wall below {}", n + 1), length(wall));
                    }
                }
                if let Some((object, [area, volume])) = &measure.size {
                    let power = |x: f64, n: &str| match unit {
                        "" => human_number(x),
                        unit => format!("{} {unit}{n}", human_number(x)),
                    };
                    row(format!("area of {object}"), power(*area, "²"));
                    row(format!("volume of {object}"), power(*volume, "³"));
                }
            });
            ui.horizontal(|ui| {
                let all = ui.button("Area and volume");
                let all = all.on_hover_text("Of the triangles that are shown");
                if all.clicked() {
                    bench.order(Order::Weigh(name.into()));
                }
                if ui.button("Clear").clicked() {
                    measure = Default::default();
                }
            });
        });
    bench.measure = is_open.then_some(measure);
}
