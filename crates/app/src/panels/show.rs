//! What is shown beside the solids themselves.

use crate::cli::quantity::human_number;
use crate::view::{Cells, Pair, Stereo, Tint};
use crate::window::Bench;
use crate::window::show::Layer;

/// What colours may tell.
const TINTS: [(Tint, &str); 4] = [
    (Tint::Off, "clay and paint"),
    (Tint::Errors, "errors of fit"),
    (Tint::Touch, "touch stiffness"),
    (Tint::Friction, "friction"),
];
/// How cells of the fit may be coloured.
const CELLS: [(Cells, &str); 3] = [
    (Cells::Off, "no cells"),
    (Cells::Level, "cells by size"),
    (Cells::Error, "cells by error"),
];

/// Where the pictures of two eyes may be.
const PAIRS: [(Pair, &str); 3] = [
    (Pair::Off, "off"),
    (Pair::Beside, "side by side"),
    (Pair::Anaglyph, "red and cyan"),
];

/// Boxes for all that may be shown beside the solids.
pub fn show(ui: &mut egui::Ui, bench: &mut Bench) {
    if bench.sheet.is_none() {
        return;
    }
    egui::CollapsingHeader::new("Show").show(ui, |ui| {
        let show = &mut bench.look.show;
        ui.checkbox(&mut show.wireframe, "Wireframe")
            .on_hover_text("Sides of the triangles that are shown, in the mode Mesh");
        ui.checkbox(&mut show.second, "Second surface")
            .on_hover_text("A surface of another density, looked through: skin over bone");
        if show.second {
            second(ui, bench);
        }
        let show = &mut bench.look.show;
        egui::ComboBox::new("tint", "Colours")
            .selected_text(name(&TINTS, show.tint))
            .width(112.0)
            .show_ui(ui, |ui| {
                for (tint, name) in TINTS {
                    ui.selectable_value(&mut show.tint, tint, name);
                }
            });
        word(ui, bench, Layer::Tint);
        let show = &mut bench.look.show;
        egui::ComboBox::new("cells", "Octree")
            .selected_text(name(&CELLS, show.cells))
            .width(112.0)
            .show_ui(ui, |ui| {
                for (cells, name) in CELLS {
                    ui.selectable_value(&mut show.cells, cells, name);
                }
            });
        word(ui, bench, Layer::Cells);
        ui.checkbox(&mut bench.look.show.points, "Input points")
            .on_hover_text("The points that the chosen object was fitted to");
        word(ui, bench, Layer::Points);
        let show = &mut bench.look.show;
        ui.checkbox(&mut show.floor, "Floor and axes")
            .on_hover_text("A grid below; x is red, y green, z blue");
        ui.checkbox(&mut show.scale_bar, "Scale bar");
        ui.checkbox(&mut show.forces, "Forces")
            .on_hover_text("Arrows of forces at the tool, in newtons");
        stereo(ui, &mut show.stereo);
        if ui.button("Picture…").clicked() {
            bench.shot.is_open = true;
        }
    });
    ui.add_space(10.0);
}

/// Whether each eye has a picture of its own, and how far the eyes are apart.
fn stereo(ui: &mut egui::Ui, stereo: &mut Stereo) {
    egui::ComboBox::new("stereo", "Stereo")
        .selected_text(name(&PAIRS, stereo.pair))
        .width(112.0)
        .show_ui(ui, |ui| {
            for (pair, name) in PAIRS {
                ui.selectable_value(&mut stereo.pair, pair, name);
            }
        });
    if stereo.pair == Pair::Off {
        return;
    }
    ui.horizontal(|ui| {
        let hint = "From one eye to the other, as a share of their way to what the view turns round";
        let label = ui.label("Eyes apart").on_hover_text(hint);
        let [least, most] = Stereo::RANGE.map(|share| 100.0 * share);
        let mut percent = 100.0 * stereo.apart;
        let field = egui::DragValue::new(&mut percent)
            .range(least..=most)
            .speed(0.05)
            .max_decimals(2)
            .suffix(" %");
        let field = ui.add(field).on_hover_text(hint).labelled_by(label.id);
        if field.changed() {
            stereo.apart = percent / 100.0;
        }
    });
}

fn name<T: PartialEq + Copy>(all: &[(T, &'static str)], chosen: T) -> &'static str {
    all.iter()
        .find(|(is, _)| *is == chosen)
        .map_or("", |(_, name)| name)
}

/// What was made of a layer, or why nothing was.
fn word(ui: &mut egui::Ui, bench: &Bench, layer: Layer) {
    match bench.shown.words.get(&layer) {
        Some(Ok(told)) if !told.is_empty() => {
            ui.weak(told);
        }
        Some(Err(why)) => {
            ui.colored_label(ui.visuals().warn_fg_color, why);
        }
        _ => {}
    }
}

/// Which density the second surface has.
fn second(ui: &mut egui::Ui, bench: &mut Bench) {
    let (Some((_, density)), Some([low, high])) = (&mut bench.shown.second, bench.shown.second_range) else {
        return;
    };
    let mut wished = bench.shown.second_dragged.unwrap_or(*density);
    let label = ui.label("Density");
    ui.spacing_mut().slider_width = 100.0;
    let slider = egui::Slider::new(&mut wished, low..=high).custom_formatter(|n, _| human_number(n));
    let slider = ui.add(slider).labelled_by(label.id);
    // It takes a while: not for every step of a drag.
    if slider.dragged() {
        bench.shown.second_dragged = Some(wished);
    } else {
        bench.shown.second_dragged = None;
        *density = wished;
    }
    word(ui, bench, Layer::Second);
}
