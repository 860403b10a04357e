//! On the right: the objects and the history.

use crate::cli::quantity::human_count;
use crate::window::Bench;
use crate::window::orders::Order;

/// On the right.
pub fn document(ui: &mut egui::Ui, bench: &mut Bench) {
    let Some(sheet) = bench.sheet.clone() else { return };
    ui.add_space(6.0);
    ui.heading("Objects");
    for (n, thing) in sheet.objects.iter().enumerate() {
        let size = thing.own_box.size();
        let about = format!(
            "{:.3} × {:.3} × {:.3} {}, {} coefficients",
            size.x,
            size.y,
            size.z,
            thing.unit,
            human_count(thing.coefficients)
        );
        let chosen = ui
            .selectable_label(n == sheet.chosen, &thing.name)
            .on_hover_text(about);
        if chosen.clicked() {
            bench.order(Order::Choose(thing.name.clone()));
        }
    }
    ui.add_space(10.0);
    super::surface(ui, bench);
    super::show(ui, bench);
    super::constraints(ui, bench);
    ui.heading("History");
    egui::ScrollArea::vertical()
        .auto_shrink(false)
        .stick_to_bottom(true)
        .show(ui, |ui| {
            let go_to = |done: usize| match done.cmp(&sheet.done) {
                std::cmp::Ordering::Less => bench.order(Order::Undo(sheet.done - done)),
                std::cmp::Ordering::Greater => bench.order(Order::Redo(done - sheet.done)),
                std::cmp::Ordering::Equal => {}
            };
            if ui.selectable_label(sheet.done == 0, "as it was").clicked() {
                go_to(0);
            }
            for (n, title) in sheet.history.iter().enumerate() {
                let text = egui::RichText::new(format!("{}  {title}", n + 1));
                let text = if n < sheet.done { text } else { text.weak() };
                if ui.selectable_label(n + 1 == sheet.done, text).clicked() {
                    go_to(n + 1);
                }
            }
        });
}
