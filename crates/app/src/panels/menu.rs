//! Along the top: files, edits, views.

use glam::DVec3;

use super::PathBox;
use crate::window::Bench;
use crate::window::orders::Order;

/// Along the top.
pub fn menu(ui: &mut egui::Ui, bench: &mut Bench) {
    egui::MenuBar::new().ui(ui, |ui| {
        let sheet = bench.sheet.clone();
        ui.menu_button("File", |ui| {
            if ui.add(item("Open…", "Ctrl+O")).clicked() {
                bench.asks = Some(PathBox::open());
            }
            if ui.button("New block of clay").clicked() {
                bench.order(Order::Clay);
            }
            ui.separator();
            let is_open = sheet.is_some();
            if ui.add_enabled(is_open, item("Save as…", "Ctrl+S")).clicked() {
                bench.asks = sheet.as_ref().map(|s| PathBox::save(s));
            }
            if ui.add_enabled(is_open, egui::Button::new("Export…")).clicked() {
                bench.asks = sheet.as_ref().map(|s| PathBox::export(s));
            }
            ui.separator();
            if ui.button("Quit").clicked() {
                ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
            }
        });
        let (done, all) = sheet.as_ref().map_or((0, 0), |s| (s.done, s.history.len()));
        ui.menu_button("Edit", |ui| {
            if ui.add_enabled(done > 0, item("Undo", "Ctrl+Z")).clicked() {
                bench.order(Order::Undo(1));
            }
            if ui.add_enabled(done < all, item("Redo", "Ctrl+Shift+Z")).clicked() {
                bench.order(Order::Redo(1));
            }
        });
        ui.menu_button("View", |ui| views(ui, bench));
        ui.separator();
        if let Some(sheet) = sheet {
            let name = sheet
                .path
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            let name = if sheet.is_untitled {
                format!("{name} (not saved yet)")
            } else {
                name
            };
            ui.label(egui::RichText::new(name).strong())
                .on_hover_text(sheet.path.display().to_string());
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                super::modes(ui, bench);
            });
        }
    });
}

fn views(ui: &mut egui::Ui, bench: &mut Bench) {
    let up = bench.look.camera.up;
    let front = if up == DVec3::Z { -DVec3::Y } else { DVec3::Z };
    for (name, key, axis) in [("Front", "1", front), ("Right", "3", DVec3::X), ("Top", "7", up)] {
        if ui.add(item(name, key)).clicked() {
            bench.look.camera.look_from(axis);
        }
    }
    if ui.add(item("All", "Home")).clicked() {
        bench.frame_all();
    }
    ui.separator();
    ui.checkbox(&mut bench.look.camera.perspective, "Perspective (5)");
    ui.checkbox(&mut bench.look.paint, "Painted stiffness");
    let mut has_slices = bench.slices.is_some();
    if ui.checkbox(&mut has_slices, "Slices").changed() {
        bench.slices = has_slices.then(super::Slices::new);
    }
    let mut is_cut = bench.look.cut.is_some();
    if ui.checkbox(&mut is_cut, "Clipping plane").changed() {
        let toward_eye = bench.look.camera.axes()[2];
        bench.look.cut = is_cut.then_some((bench.scene.0, toward_eye));
    }
    let mut has_touch = bench.touch.is_some();
    if ui.checkbox(&mut has_touch, "Touch").changed() {
        bench.touch = has_touch.then(super::TouchWish::new);
        if bench.held.is_some() {
            bench.order(Order::LetGo);
        }
    }
    let mut measures = bench.measure.is_some();
    if ui.checkbox(&mut measures, "Measure (M)").changed() {
        bench.measure = measures.then(Default::default);
    }
    ui.checkbox(&mut bench.shows_log, "Log");
    ui.separator();
    let mut theme = ui.options(|o| o.theme_preference);
    ui.horizontal(|ui| {
        for (is, name) in [
            (egui::ThemePreference::Dark, "Dark"),
            (egui::ThemePreference::Light, "Light"),
            (egui::ThemePreference::System, "As the system"),
        ] {
            ui.selectable_value(&mut theme, is, name);
        }
    });
    ui.ctx().set_theme(theme);
}

fn item<'a>(text: &'a str, keys: &'a str) -> egui::Button<'a> {
    egui::Button::new(text).shortcut_text(keys)
}
