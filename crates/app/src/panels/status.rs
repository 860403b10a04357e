//! Along the bottom: what is going on.

use crate::cli::quantity::human_count;
use crate::window::Bench;

/// Along the bottom.
pub fn status(ui: &mut egui::Ui, bench: &Bench) {
    ui.horizontal(|ui| {
        if let Some((what, share)) = &bench.busy {
            if ui.button("Cancel").clicked() {
                bench.cancel();
            }
            ui.add(
                egui::ProgressBar::new(*share as f32)
                    .desired_width(180.0)
                    .show_percentage(),
            );
            ui.label(what);
        } else if let Some((text, is_failure)) = bench.message() {
            let color = if is_failure {
                ui.visuals().error_fg_color
            } else {
                ui.visuals().text_color()
            };
            ui.colored_label(color, text);
        } else if bench.sheet.is_some() {
            ui.label(bench.tool.kind.hint());
        } else {
            ui.label("Open a scan, or drop one on the window");
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            if bench.triangles > 0 {
                ui.weak(format!("{} triangles", human_count(bench.triangles)));
            }
        });
    });
}
