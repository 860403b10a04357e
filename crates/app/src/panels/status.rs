//! Along the bottom: what is going on.

use egui::{Align, Label, Layout, ProgressBar, RichText, Ui};

use crate::cli::quantity::human_count;
use crate::window::Bench;

/// Along the bottom.
pub fn status(ui: &mut Ui, bench: &Bench) {
    let row = egui::vec2(ui.available_width(), ui.spacing().interact_size.y);
    ui.allocate_ui_with_layout(row, Layout::right_to_left(Align::Center), |ui| {
        if bench.triangles > 0 {
            ui.weak(format!("{} triangles", human_count(bench.triangles)));
        }
        // What is left of the row is theirs; in a narrow window words are cut, and told under the mouse.
        ui.with_layout(Layout::left_to_right(Align::Center), |ui| said(ui, bench));
    });
}

fn said(ui: &mut Ui, bench: &Bench) {
    let label = |text: RichText| Label::new(text).truncate();
    if let Some((what, share)) = &bench.busy {
        if ui.button("Cancel").clicked() {
            bench.cancel();
        }
        let wide = (0.3 * ui.available_width()).min(180.0);
        ui.add(
            ProgressBar::new(*share as f32)
                .desired_width(wide)
                .show_percentage(),
        );
        ui.add(label(what.into()));
    } else if let Some((text, is_failure)) = bench.message() {
        let color = if is_failure {
            ui.visuals().error_fg_color
        } else {
            ui.visuals().text_color()
        };
        ui.add(label(RichText::new(text).color(color)));
    } else if bench.sheet.is_some() {
        ui.add(label(bench.tool.kind.hint().into()));
    } else {
        ui.add(label("Open a scan, or drop one on the window".into()));
    }
}
