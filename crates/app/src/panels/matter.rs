//! What the chosen object is made of.

use egui::{CollapsingHeader, DragValue, Ui};
use serde_json::json;
use tools::paint::Substance;

use crate::window::Bench;

/// All layers, with what they are called and their units.
const LAYERS: [(Substance, &str, &str, &str); 6] = [
    (
        Substance::Stiffness,
        "Stiffness",
        "×",
        "Factor on the stiffness against forces",
    ),
    (Substance::Mass, "Mass", "×", "Factor on the mass"),
    (Substance::Damping, "Damping", "×", "Factor on the damping"),
    (
        Substance::RestLength,
        "Rest length",
        "×",
        "Above 1 the surface swells when it is let move, below 1 it shrinks",
    ),
    (
        Substance::SurfaceStiffness,
        "Hardness",
        "N/m",
        "How hard the surface feels under a hand",
    ),
    (
        Substance::Friction,
        "Friction",
        "",
        "How rough the surface feels under a hand",
    ),
];

/// Stiffness by density of a CT, HU: tissue gives way, bone hardly.
const TISSUE: [[f64; 2]; 5] = [
    [-200.0, 0.5],
    [0.0, 1.0],
    [100.0, 2.0],
    [300.0, 10.0],
    [1000.0, 50.0],
];

/// What is laid on all over.
#[derive(Clone, Copy, Debug)]
pub struct Fill {
    layer: usize,
    value: f64,
}

impl Default for Fill {
    fn default() -> Self {
        Self { layer: 0, value: 1.0 }
    }
}

/// What the chosen object is made of, and paint all over it.
pub fn matter(ui: &mut Ui, bench: &mut Bench) {
    let Some(thing) = bench.chosen().cloned() else {
        return;
    };
    CollapsingHeader::new("Material").show(ui, |ui| {
        ui.horizontal(|ui| {
            for (is_elastic, name, hint) in [
                (false, "Clay", "Keeps the shape that force tools leave"),
                (true, "Elastic", "Springs back when force tools let go"),
            ] {
                let label = ui
                    .selectable_label(thing.is_elastic == is_elastic, name)
                    .on_hover_text(hint);
                if label.clicked() && thing.is_elastic != is_elastic {
                    bench.stroke(
                        json!({ "material": { "solid": if is_elastic { "elastic" } else { "clay" } } }),
                    );
                }
            }
        });
        for (substance, name, unit, hint) in LAYERS {
            if thing.layers.contains(&substance) {
                ui.label(format!(
                    "{name} is painted{}",
                    if unit == "N/m" { ", N/m" } else { "" }
                ))
                .on_hover_text(hint);
            }
        }
        let fill = &mut bench.fill;
        let (substance, name, unit, hint) = LAYERS[fill.layer];
        egui::ComboBox::from_label("All over")
            .width(96.0)
            .selected_text(name)
            .show_ui(ui, |ui| {
                for (n, (_, name, _, hint)) in LAYERS.into_iter().enumerate() {
                    ui.selectable_value(&mut fill.layer, n, name).on_hover_text(hint);
                }
            });
        ui.horizontal(|ui| {
            let label = ui.label("Value").on_hover_text(hint);
            let field = DragValue::new(&mut bench.fill.value)
                .range(0.0..=1e6)
                .speed(0.05)
                .suffix(format!(" {unit}"));
            ui.add(field).labelled_by(label.id);
            let value = bench.fill.value;
            if ui
                .button("Lay on")
                .on_hover_text("The whole object gets this value")
                .clicked()
            {
                bench.stroke(json!({ "paint": { "layer": substance, "formula": value.to_string() } }));
            }
        });
        if thing.is_volume {
            let button = ui.button("Stiffness by density");
            let button = button
                .on_hover_text("Of a CT: fat gives way, muscle less, bone hardly (0.5 to 50, by its HU)");
            if button.clicked() {
                bench.stroke(json!({ "paint": { "layer": "stiffness", "curve": TISSUE } }));
            }
        }
        if thing.layers.contains(&Substance::Stiffness) {
            let button = ui.button("Hardness of stiffness");
            let button =
                button.on_hover_text("The surface feels as hard as it is stiff: 200 N/m for each unit");
            if button.clicked() {
                bench.stroke(json!({ "paint": { "layer": "surface-stiffness", "of-stiffness": 200.0 } }));
            }
        }
    });
    ui.add_space(6.0);
}
