//! What was told since the window opened.

use crate::window::Bench;

/// In a panel of its own.
pub fn log(ui: &mut egui::Ui, bench: &Bench) {
    let area = egui::ScrollArea::vertical()
        .auto_shrink(false)
        .stick_to_bottom(true);
    area.show(ui, |ui| {
        if bench.messages.is_empty() {
            ui.weak("Nothing was told yet");
        }
        for (when, text, is_failure) in &bench.messages {
            let color = match is_failure {
                true => ui.visuals().error_fg_color,
                false => ui.visuals().text_color(),
            };
            let ago = format!("{} s ago", when.elapsed().as_secs());
            ui.colored_label(color, text).on_hover_text(ago);
        }
    });
}
