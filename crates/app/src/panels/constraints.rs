//! What force tools have to keep: points that are pinned by a click, lines that are drawn, the surface in boxes.

use serde_json::json;

use crate::window::Bench;
use crate::window::orders::Thing;
use crate::window::tool::Kind;

/// The constraints of the chosen object, and whether clicks pin.
pub fn constraints(ui: &mut egui::Ui, bench: &mut Bench) {
    let Some(thing) = bench.chosen().cloned() else {
        return;
    };
    egui::CollapsingHeader::new("Constraints")
        .default_open(true)
        .show(ui, |ui| {
            ui.toggle_value(&mut bench.pins, "Pin points (N)")
                .on_hover_text("A click on the solid holds the surface there, whatever force tools do");
            ui.horizontal_wrapped(|ui| {
                for kind in [Kind::PinLine, Kind::PinOutline, Kind::PinBox] {
                    let label = ui.selectable_label(bench.tool.kind == kind, kind.name());
                    if label.on_hover_text(kind.hint()).clicked() {
                        bench.take(kind);
                    }
                }
            });
            for held in &thing.holds {
                ui.horizontal(|ui| {
                    let about = match (&held.spring, &held.lines[..]) {
                        (Some(spring), _) => {
                            format!("By springs of {} times the solid's stiffness", spring.0)
                        }
                        (None, [line]) if line.len() == 1 => "A point that does not move".into(),
                        (None, lines) if lines.iter().all(|line| line.len() == 1) => {
                            format!("{} points of the surface that do not move", lines.len())
                        }
                        (None, _) => "A line that does not move".into(),
                    };
                    ui.label(&held.name).on_hover_text(about);
                    if ui.small_button("Free").clicked() {
                        bench.stroke(json!({ "free": { "name": held.name } }));
                    }
                });
            }
            if thing.holds.len() > 1 && ui.small_button("Free all").clicked() {
                bench.stroke(json!({ "free": {} }));
            }
        });
    ui.add_space(10.0);
}

/// A name that no constraint of an object has, by what it is.
pub fn next_hold(thing: &Thing, what: &str) -> String {
    let is_free = |name: &String| thing.holds.iter().all(|held| held.name != *name);
    let names = (1..).map(|n| format!("{what} {n}"));
    names
        .into_iter()
        .find(is_free)
        .expect("there is always another number")
}
