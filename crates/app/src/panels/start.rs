//! What is shown before anything is open.

use super::PathBox;
use crate::window::Bench;
use crate::window::orders::Order;
use crate::window::samples::SAMPLES;

/// Documents without a name that are offered, at most.
const MOST: usize = 4;

/// In the middle, before anything is open.
pub fn start(ui: &mut egui::Ui, bench: &mut Bench) {
    let room = ui.available_height();
    // Low windows scroll.
    egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        ui.vertical_centered(|ui| offers(ui, bench, 0.18 * room));
    });
}

fn offers(ui: &mut egui::Ui, bench: &mut Bench, above: f32) {
    ui.add_space(above);
    ui.label(egui::RichText::new("isoclay").size(40.0).strong());
    ui.label("Turns scans into elastic clay");
    ui.add_space(24.0);
    let wide = egui::vec2(280.0, 34.0);
    if ui
        .add(egui::Button::new("Open a scan or a document…").min_size(wide))
        .clicked()
    {
        bench.asks = Some(PathBox::open());
    }
    ui.weak("or drop a file on the window");
    ui.add_space(24.0);
    ui.label("Or begin with one of these:");
    for sample in &SAMPLES {
        if ui.add(egui::Button::new(sample.name).min_size(wide)).clicked() {
            open(sample, bench);
        }
    }
    if ui
        .add(egui::Button::new("A block of clay").min_size(wide))
        .clicked()
    {
        bench.order(Order::Clay);
    }
    if !bench.kept.is_empty() {
        ui.add_space(24.0);
        ui.label("Or go on with what was not saved under a name:");
    }
    for path in bench.kept.iter().take(MOST) {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let button = egui::Button::new(name).min_size(wide);
        if ui.add(button).on_hover_text(path.display().to_string()).clicked() {
            bench.order(Order::Open(path.clone()));
        }
    }
}

fn open(sample: &crate::window::samples::Sample, bench: &mut Bench) {
    let scratch = match bench.scratch.take() {
        Some(there) => Ok(there),
        None => tempfile::tempdir(),
    };
    let path = scratch
        .map_err(|e| format!("no temporary directory: {e}"))
        .and_then(|scratch| {
            let path = sample.file(scratch.path());
            bench.scratch = Some(scratch);
            path
        });
    match path {
        Ok(path) => bench.order(Order::Open(path)),
        Err(why) => bench.tell(why, true),
    }
}
