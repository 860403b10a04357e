//! What is shown beside the solids themselves.

use crate::cli::quantity::human_number;
use crate::view::{Cells, Histogram, Tint};
use crate::window::Bench;
use crate::window::orders::Thing;
use crate::window::show::Layer;

/// What colours may tell.
const TINTS: [(Tint, &str); 4] = [
    (Tint::Off, "clay, and painted stiffness"),
    (Tint::Errors, "errors of the fit"),
    (Tint::Touch, "stiffness to the touch"),
    (Tint::Friction, "friction"),
];
/// How cells of the fit may be coloured.
const CELLS: [(Cells, &str); 3] = [
    (Cells::Off, "no cells"),
    (Cells::Level, "cells by size"),
    (Cells::Error, "cells by error"),
];

/// Boxes for all that may be shown beside the solids.
pub fn show(ui: &mut egui::Ui, bench: &mut Bench) {
    let Some(sheet) = bench.sheet.clone() else { return };
    egui::CollapsingHeader::new("Show").show(ui, |ui| {
        let show = &mut bench.look.show;
        ui.checkbox(&mut show.wireframe, "Wireframe")
            .on_hover_text("Sides of the triangles that are shown, in the mode Mesh");
        ui.checkbox(&mut show.second, "Second surface")
            .on_hover_text("A surface of another density, looked through: skin over bone");
        if show.second
            && let Some(thing) = sheet.objects.get(sheet.chosen)
        {
            second(ui, bench, thing);
        }
        let show = &mut bench.look.show;
        egui::ComboBox::new("tint", "colours")
            .selected_text(name(&TINTS, show.tint))
            .width(110.0)
            .show_ui(ui, |ui| {
                for (tint, name) in TINTS {
                    ui.selectable_value(&mut show.tint, tint, name);
                }
            });
        word(ui, bench, Layer::Tint);
        let show = &mut bench.look.show;
        egui::ComboBox::new("cells", "octree")
            .selected_text(name(&CELLS, show.cells))
            .width(110.0)
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
        if ui.button("Picture…").clicked() {
            bench.shot.is_open = true;
        }
        if sheet.objects.len() > 1 {
            objects(ui, bench, &sheet.objects, sheet.chosen);
        }
    });
    ui.add_space(10.0);
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
fn second(ui: &mut egui::Ui, bench: &mut Bench, thing: &Thing) {
    let is_known = matches!(&bench.shown.second, Some((name, _)) if *name == thing.name);
    if !is_known || bench.shown.second_range.is_none() {
        let histogram = Histogram::new(&*thing.field, &thing.own_box);
        bench.shown.second_range = Some(histogram.range);
        bench.shown.second = Some((thing.name.clone(), beside(histogram.range, thing.iso)));
    }
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

/// A first density for the second surface: between that of the first and the end that is farther from it.
fn beside([low, high]: [f64; 2], iso: f64) -> f64 {
    match iso - low < high - iso {
        true => iso + 0.35 * (high - iso),
        false => iso - 0.35 * (iso - low),
    }
}

/// Which objects are drawn.
fn objects(ui: &mut egui::Ui, bench: &mut Bench, things: &[Thing], chosen: usize) {
    ui.separator();
    for thing in things {
        let mut is_shown = !bench.shown.hidden.contains(&thing.name);
        if ui.checkbox(&mut is_shown, &thing.name).changed() {
            match is_shown {
                true => bench.shown.hidden.remove(&thing.name),
                false => bench.shown.hidden.insert(thing.name.clone()),
            };
        }
    }
    ui.horizontal(|ui| {
        if ui.button("Only the chosen").clicked() {
            let others = things.iter().enumerate().filter(|(n, _)| *n != chosen);
            bench.shown.hidden = others.map(|(_, thing)| thing.name.clone()).collect();
        }
        if ui.button("All").clicked() {
            bench.shown.hidden.clear();
        }
    });
}
