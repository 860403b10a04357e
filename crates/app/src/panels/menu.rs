//! Along the top: files, edits, views. Every entry is an action, with its keys.

use crate::window::Bench;
use crate::window::actions::{Action, Name};

const FILE: &[&[Name]] = &[
    &[Name::Open, Name::Preview, Name::NewClay],
    &[Name::Save, Name::Export],
    &[Name::RunScript, Name::SaveScript],
    &[Name::Quit],
];
const EDIT: &[&[Name]] = &[
    &[Name::Undo, Name::Redo],
    &[Name::Arrange, Name::Shift, Name::Turn, Name::Scale],
    &[Name::Duplicate, Name::Remove],
    &[Name::Commands, Name::Shortcuts],
];
const VIEW: &[&[Name]] = &[
    &[
        Name::Perspective,
        Name::Paint,
        Name::Wireframe,
        Name::Floor,
        Name::Clip,
    ],
    &[Name::Hide, Name::Alone, Name::ShowAll],
];
/// Below entries of their own: all at once would not fit into a low window.
const FROM: &[&[Name]] = &[&[Name::Front, Name::Right, Name::Top, Name::All]];
const STEREO: &[&[Name]] = &[&[Name::NoStereo, Name::SideBySide, Name::Anaglyph]];
const WINDOWS: &[&[Name]] = &[
    &[
        Name::Slices,
        Name::FourViews,
        Name::Measure,
        Name::Touch,
        Name::Simulation,
    ],
    &[Name::Performance, Name::Log, Name::Picture],
    &[Name::Tools, Name::Objects, Name::Panels],
    &[Name::Sides, Name::AsAtFirst],
];

/// Along the top.
pub fn menu(ui: &mut egui::Ui, bench: &mut Bench) {
    egui::MenuBar::new().ui(ui, |ui| {
        ui.menu_button("File", |ui| entries(ui, bench, FILE));
        ui.menu_button("Edit", |ui| entries(ui, bench, EDIT));
        ui.menu_button("View", |ui| {
            ui.menu_button("Look from", |ui| entries(ui, bench, FROM));
            ui.menu_button("Windows", |ui| entries(ui, bench, WINDOWS));
            ui.menu_button("Stereo", |ui| entries(ui, bench, STEREO));
            ui.separator();
            entries(ui, bench, VIEW);
            ui.separator();
            theme(ui);
        });
        ui.separator();
        let Some(sheet) = bench.sheet.clone() else { return };
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
        if bench.arranging {
            ui.separator();
            ui.colored_label(ui.visuals().warn_fg_color, "Arranging objects");
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            super::modes(ui, bench);
        });
    });
}

fn entries(ui: &mut egui::Ui, bench: &mut Bench, groups: &[&[Name]]) {
    for (n, names) in groups.iter().enumerate() {
        if n > 0 {
            ui.separator();
        }
        for action in names.iter().map(|name| Action::Do(*name)) {
            let is_possible = action.is_possible(bench);
            let keys = bench.keys.text(action);
            match action.is_on(bench) {
                Some(mut is_on) => {
                    let text = match keys.is_empty() {
                        true => action.text().to_string(),
                        false => format!("{} ({keys})", action.text()),
                    };
                    let switch = egui::Checkbox::new(&mut is_on, text);
                    if ui.add_enabled(is_possible, switch).changed() {
                        action.run(bench, ui.ctx());
                    }
                }
                None => {
                    let button = egui::Button::new(action.text()).shortcut_text(keys);
                    if ui.add_enabled(is_possible, button).clicked() {
                        action.run(bench, ui.ctx());
                    }
                }
            }
        }
    }
}

fn theme(ui: &mut egui::Ui) {
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
