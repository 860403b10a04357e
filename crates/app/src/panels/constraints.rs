//! What force tools have to keep: points that are pinned by a click.

use serde_json::json;

use crate::window::Bench;
use crate::window::orders::{Order, Thing};

/// The constraints of the chosen object, and whether clicks pin.
pub fn constraints(ui: &mut egui::Ui, bench: &mut Bench) {
    let Some(sheet) = bench.sheet.clone() else { return };
    let Some(thing) = sheet.objects.get(sheet.chosen) else {
        return;
    };
    egui::CollapsingHeader::new("Constraints")
        .default_open(true)
        .show(ui, |ui| {
            ui.toggle_value(&mut bench.pins, "Pin points (N)")
                .on_hover_text("A click on the solid holds the surface there, whatever force tools do");
            for held in &thing.holds {
                ui.horizontal(|ui| {
                    ui.label(&held.name);
                    if ui.small_button("Free").clicked() {
                        free(bench, json!({ "name": held.name }));
                    }
                });
            }
            if thing.holds.len() > 1 && ui.small_button("Free all").clicked() {
                free(bench, json!({}));
            }
        });
    ui.add_space(10.0);
}

fn free(bench: &Bench, which: serde_json::Value) {
    let stroke = serde_json::from_value(json!({ "free": which }));
    bench.order(Order::Do(Box::new(stroke.expect("it is a stroke"))));
}

/// A name that no constraint of an object has.
pub fn next_pin(thing: &Thing) -> String {
    let is_free = |name: &String| thing.holds.iter().all(|held| held.name != *name);
    let names = (1..).map(|n| format!("pin {n}"));
    names
        .into_iter()
        .find(is_free)
        .expect("there is always another number")
}
