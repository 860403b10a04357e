//! How an object is exported, and what was written.

use std::ffi::OsString;
use std::path::PathBuf;

use egui::Ui;
use serde_json::{Map, Value};

use super::over::over;
use crate::cli::quantity::{human_count, human_number};
use crate::window::Bench;

/// How an object is exported: the options of `mesh`, or the scan of `export --like`.
#[derive(Default)]
pub struct Wishes {
    scan: String,
    most: Option<usize>,
    unit: Option<&'static str>,
    is_lps: bool,
    largest: bool,
}

/// What a limit of triangles begins with.
const MANY: usize = 100_000;

impl Wishes {
    /// Asks for them; lengths of the object are so. A scan has all else of its own.
    pub fn show(&mut self, ui: &mut Ui, unit: &str) {
        let is_mesh = self.scan().is_none();
        egui::Grid::new("wishes").num_columns(2).show(ui, |ui| {
            let label = ui.label("Scan");
            let edit = egui::TextEdit::singleline(&mut self.scan)
                .desired_width(280.0)
                .hint_text("none: write a mesh or a field");
            ui.add(edit).labelled_by(label.id);
            ui.end_row();
            if !is_mesh {
                return;
            }
            ui.label("Triangles");
            ui.horizontal(|ui| {
                ui.radio_value(&mut self.most, None, "as fine as the fit");
                let is_limited = self.most.is_some();
                if ui.radio(is_limited, "at most").clicked() && !is_limited {
                    self.most = Some(MANY);
                }
                if let Some(most) = &mut self.most {
                    ui.add(egui::DragValue::new(most).range(100..=50_000_000).speed(500));
                }
            });
            ui.end_row();
            ui.label("Unit");
            ui.horizontal(|ui| {
                let own = if unit.is_empty() { "as it is" } else { unit };
                ui.radio_value(&mut self.unit, None, own);
                for other in ["um", "mm", "cm", "m"].into_iter().filter(|other| *other != unit) {
                    ui.radio_value(&mut self.unit, Some(other), other);
                }
            });
            ui.end_row();
            ui.label("Axes");
            ui.horizontal(|ui| {
                ui.radio_value(&mut self.is_lps, false, "as they are");
                ui.radio_value(&mut self.is_lps, true, "x and y reversed")
                    .on_hover_text("Left, posterior, superior, as DICOM and ITK have volumes");
            });
            ui.end_row();
            ui.label("Pieces");
            ui.horizontal(|ui| {
                ui.radio_value(&mut self.largest, false, "all");
                ui.radio_value(&mut self.largest, true, "the largest");
            });
            ui.end_row();
        });
    }

    /// The scan to write with its edits, if one is named.
    pub fn scan(&self) -> Option<PathBuf> {
        let scan = self.scan.trim();
        (!scan.is_empty()).then(|| scan.into())
    }

    /// As options of `mesh`.
    pub fn of_mesh(&self) -> Vec<OsString> {
        let pairs = [
            ("--triangles", self.most.map(|n| n.to_string())),
            ("--unit", self.unit.map(str::to_string)),
            ("--axes", self.is_lps.then(|| "lps".to_string())),
            ("--keep", self.largest.then(|| "largest".to_string())),
        ];
        let given = pairs
            .into_iter()
            .filter_map(|(name, value)| Some([name.into(), value?.into()]));
        given.flatten().collect()
    }
}

/// A mesh that was written, as those mind who print it or compute on it.
pub struct Written {
    path: PathBuf,
    /// What, how much, and whether that is well.
    rows: Vec<(&'static str, String, bool)>,
}

impl Written {
    /// By what `mesh --check` told of it; none of what is no mesh.
    pub fn of(path: PathBuf, told: &Map<String, Value>) -> Option<Self> {
        let quality = told.get("quality")?;
        let count = |name: &str| quality.get(name).and_then(Value::as_u64);
        let triangles = told.get("triangles").and_then(Value::as_u64)?;
        let [pieces, open, faults, crossing] =
            ["pieces", "open_edges", "faults", "self_intersections"].map(|name| count(name).unwrap_or(0));
        let number = |n: u64| human_count(usize::try_from(n).unwrap_or(usize::MAX));
        let none_or = |n: u64, what: &str| match n {
            0 => "yes".to_string(),
            n => format!("no: {} {what}", number(n)),
        };
        let unit = told
            .get("unit")
            .and_then(Value::as_str)
            .filter(|u| *u != "file unit");
        let power = |name: &str, n: &str| {
            let x = quality.get(name).and_then(Value::as_f64)?;
            let unit = unit.map_or_else(String::new, |unit| format!(" {unit}{n}"));
            Some(format!("{}{unit}", human_number(x)))
        };
        let mut rows = vec![
            ("Triangles", number(triangles), true),
            ("Closed", none_or(open, "open edges"), open == 0),
            (
                "Manifold",
                none_or(faults, "faulty edges and vertices"),
                faults == 0,
            ),
            (
                "Free of crossings",
                none_or(crossing, "pairs of triangles"),
                crossing == 0,
            ),
            ("Pieces", number(pieces), true),
            ("Unit", unit.unwrap_or("not known").into(), true),
        ];
        rows.extend(power("area", "²").map(|area| ("Area", area, true)));
        rows.extend(power("volume", "³").map(|volume| ("Volume", volume, true)));
        Some(Self { path, rows })
    }

    /// The figures.
    #[cfg(test)]
    pub fn rows(&self) -> &[(&'static str, String, bool)] {
        &self.rows
    }
}

/// What was written, in a window of its own.
pub fn written(context: &egui::Context, bench: &mut Bench) {
    let Some(written) = &bench.written else { return };
    let mut is_open = true;
    over(context, "Written", 212.0)
        .open(&mut is_open)
        .resizable(false)
        .show(context, |ui| {
            ui.label(written.path.display().to_string());
            egui::Grid::new("written").striped(true).show(ui, |ui| {
                for (what, figure, is_well) in &written.rows {
                    ui.label(*what);
                    match is_well {
                        true => ui.label(figure),
                        false => ui.colored_label(ui.visuals().warn_fg_color, figure),
                    };
                    ui.end_row();
                }
            });
        });
    if !is_open {
        bench.written = None;
    }
}
