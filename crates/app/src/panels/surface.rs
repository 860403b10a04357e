//! Which density is the surface, over a histogram of all.

use std::sync::Arc;

use bspline::Field;
use serde_json::json;

use crate::cli::quantity::human_number;
use crate::view::{Histogram, Mode};
use crate::window::Bench;
use crate::window::orders::{Order, Thing};

/// Height of the histogram, points.
const HIGH: f32 = 56.0;
/// Densities of a CT, in Hounsfield units, between what is to be told apart.
const TISSUES: [(&str, f64); 2] = [("Skin", -300.0), ("Bone", 300.0)];
/// Density of air, from which a CT is known.
const AIR: f64 = -700.0;

/// The histogram of a field, and the density that is pointed to.
pub struct Densities {
    of: Arc<dyn Field>,
    histogram: Histogram,
    /// While it is dragged.
    pointed: Option<f64>,
}

/// Which density is the surface of an object.
pub fn surface(ui: &mut egui::Ui, bench: &mut Bench) {
    let Some(sheet) = bench.sheet.clone() else { return };
    let Some(thing) = sheet.objects.get(sheet.chosen) else {
        return;
    };
    egui::CollapsingHeader::new("Surface density")
        .default_open(thing.is_volume)
        .show(ui, |ui| {
            let is_known = bench
                .densities
                .as_ref()
                .is_some_and(|d| Arc::ptr_eq(&d.of, &thing.field));
            if !is_known {
                bench.densities = Some(Densities {
                    of: thing.field.clone(),
                    histogram: Histogram::new(&*thing.field, &thing.own_box),
                    pointed: None,
                });
            }
            let Some(densities) = &mut bench.densities else {
                return;
            };
            let chosen = show(ui, densities, thing);
            if bench.look.mode != Mode::Mesh || bench.look.cut.is_some() {
                let range = densities.histogram.range;
                shades(ui, &mut bench.look.density, range);
            }
            if let Some(iso) = chosen.filter(|iso| *iso != thing.iso) {
                let stroke = serde_json::from_value(json!({ "surface": { "iso": iso } }));
                bench.order(Order::Do(Box::new(
                    stroke.expect("a finite number is an iso-value"),
                )));
            }
        });
    ui.add_space(10.0);
}

/// Densities that show black and white.
fn shades(ui: &mut egui::Ui, [black, white]: &mut [f64; 2], [low, high]: [f64; 2]) {
    for (name, density) in [("Black", black), ("White", white)] {
        ui.horizontal(|ui| {
            let label = ui.label(name);
            let value = egui::DragValue::new(density)
                .speed((high - low) / 300.0)
                .custom_formatter(|n, _| human_number(n));
            ui.add(value).labelled_by(label.id);
        });
    }
}

/// The histogram with the density in it; returns the one that is chosen.
fn show(ui: &mut egui::Ui, densities: &mut Densities, thing: &Thing) -> Option<f64> {
    let [low, high] = densities.histogram.range;
    let size = egui::vec2(ui.available_width(), HIGH);
    let (rect, response) = ui.allocate_exact_size(size, egui::Sense::click_and_drag());
    let response = response.on_hover_text(
        "How often which density is there. Click or drag: the surface is where the density is so",
    );
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 2.0, ui.visuals().extreme_bg_color);
    let bars = densities.histogram.bars.len() as f32;
    for (n, height) in densities.histogram.heights().enumerate() {
        let left = rect.left() + n as f32 / bars * rect.width();
        let bar = egui::Rect::from_min_max(
            egui::pos2(left, rect.bottom() - height * rect.height()),
            egui::pos2(left + rect.width() / bars, rect.bottom()),
        );
        painter.rect_filled(bar, 0.0, ui.visuals().weak_text_color());
    }
    if let Some(at) = response.interact_pointer_pos() {
        let share = f64::from(((at.x - rect.left()) / rect.width()).clamp(0.0, 1.0));
        densities.pointed = Some(low + share * (high - low));
    }
    let mut iso = densities.pointed.unwrap_or(thing.iso);
    let x = rect.left() + ((iso - low) / (high - low)).clamp(0.0, 1.0) as f32 * rect.width();
    painter.vline(
        x,
        rect.y_range(),
        egui::Stroke::new(2.0, egui::Color32::from_rgb(255, 180, 80)),
    );
    ui.horizontal(|ui| {
        ui.weak(human_number(low));
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.weak(human_number(high))
        });
    });
    let mut chosen = None;
    if response.drag_stopped() || response.clicked() {
        chosen = densities.pointed.take();
    }
    ui.horizontal(|ui| {
        let label = ui.label("Surface at");
        let value = egui::DragValue::new(&mut iso)
            .range(low..=high)
            .speed((high - low) / 500.0)
            .update_while_editing(false);
        let value = ui.add(value).labelled_by(label.id);
        if value.dragged() {
            densities.pointed = Some(iso);
        } else if value.drag_stopped() || value.lost_focus() && value.changed() {
            densities.pointed = None;
            chosen = Some(iso);
        }
    });
    if thing.is_volume && low < AIR {
        // Beside the number there is no room for them.
        ui.horizontal(|ui| {
            for (name, density) in TISSUES.iter().filter(|(_, d)| (low..high).contains(d)) {
                let button = ui.small_button(*name);
                if button.on_hover_text(format!("{density} HU")).clicked() {
                    chosen = Some(*density);
                }
            }
        });
    }
    chosen
}
