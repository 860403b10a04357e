//! Pictures of the scene as files.

use std::path::PathBuf;

use super::over::over;
use crate::window::Bench;
use crate::window::shot::Wanted;

/// How often the window's pixels a picture may have.
const SCALES: [u32; 3] = [1, 2, 4];
/// Pictures of a turn, at the least and the most.
const TURNS: std::ops::RangeInclusive<u32> = 2..=720;

/// What is set of pictures, and what is known of those under way.
pub struct Shots {
    /// Whether the panel is shown.
    pub is_open: bool,
    file: String,
    directory: String,
    scale: u32,
    turns: u32,
    /// What exists already, and is to be replaced only if that is wished.
    asks: Option<Wanted>,
    /// What is to be drawn.
    pub wanted: Option<Wanted>,
    /// Pictures drawn, of how many.
    pub progress: Option<(u32, u32)>,
    /// Whether those under way are to be left out.
    pub is_cancelled: bool,
}

impl Default for Shots {
    fn default() -> Self {
        Self {
            is_open: false,
            file: "picture.png".into(),
            directory: "turntable".into(),
            scale: 1,
            turns: 36,
            asks: None,
            wanted: None,
            progress: None,
            is_cancelled: false,
        }
    }
}

/// In a window of its own.
pub fn picture(context: &egui::Context, bench: &mut Bench) {
    let shots = &mut bench.shot;
    if !shots.is_open {
        return;
    }
    let mut is_open = true;
    over(context, "Picture", 212.0)
        .open(&mut is_open)
        .resizable(false)
        .show(context, |ui| match (shots.progress, shots.asks.clone()) {
            (Some((drawn, count)), _) => {
                ui.label(format!("Picture {} of {count}", (drawn + 1).min(count)));
                ui.add(egui::ProgressBar::new(drawn as f32 / count as f32).desired_width(220.0));
                if ui.button("Cancel").clicked() {
                    shots.is_cancelled = true;
                }
            }
            (None, Some(wanted)) => {
                ui.label(format!("{} is there already", wanted.path.display()));
                ui.horizontal(|ui| {
                    if ui.button("Replace").clicked() {
                        shots.wanted = shots.asks.take();
                    }
                    if ui.button("Cancel").clicked() {
                        shots.asks = None;
                    }
                });
            }
            (None, None) => settings(ui, shots),
        });
    shots.is_open = is_open;
}

fn settings(ui: &mut egui::Ui, shots: &mut Shots) {
    ui.label("The scene as it is seen, without panels, text and marks");
    ui.horizontal(|ui| {
        ui.label("Size");
        for scale in SCALES {
            ui.selectable_value(&mut shots.scale, scale, format!("{scale}×"));
        }
        ui.weak("of the window");
    });
    let mut wanted = None;
    ui.horizontal(|ui| {
        let label = ui.label("File");
        ui.add(egui::TextEdit::singleline(&mut shots.file).desired_width(220.0))
            .labelled_by(label.id);
        if ui.button("Save picture").clicked() {
            let path = PathBuf::from(shots.file.trim());
            let path = match path.extension() {
                Some(_) => path,
                None => path.with_extension("png"),
            };
            wanted = Some((path, None));
        }
    });
    ui.separator();
    ui.horizontal(|ui| {
        let label = ui.label("Directory");
        ui.add(egui::TextEdit::singleline(&mut shots.directory).desired_width(188.0))
            .labelled_by(label.id);
        if ui.button("Save turntable").clicked() {
            wanted = Some((PathBuf::from(shots.directory.trim()), Some(shots.turns)));
        }
    });
    ui.horizontal(|ui| {
        let label = ui.label("Pictures of a turn");
        ui.add(egui::DragValue::new(&mut shots.turns).range(TURNS))
            .labelled_by(label.id);
    });
    if let Some((path, turns)) = wanted.filter(|(path, _)| !path.as_os_str().is_empty()) {
        let is_there = match turns {
            None => path.exists(),
            Some(_) => std::fs::read_dir(&path).is_ok_and(|mut files| files.next().is_some()),
        };
        let wanted = Some(Wanted {
            path,
            scale: shots.scale,
            turns,
        });
        match is_there {
            true => shots.asks = wanted,
            false => shots.wanted = wanted,
        }
    }
}
