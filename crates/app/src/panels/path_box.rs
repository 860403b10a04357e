//! Asks for a file: by the system's own dialog, or by its path where there is none.

use std::ffi::OsStr;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, channel};

use egui::text::{CCursor, CCursorRange};

use super::Wishes;
use crate::cli::convert::{CLOUDS, VOLUMES};
use crate::cli::mesh_output::MESHES;
use crate::window::Bench;
use crate::window::orders::{Order, Sheet};

/// What the file is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Purpose {
    Open,
    OpenPart,
    RunScript,
    SaveScript,
    Save,
    Export,
}

/// A question for a file.
pub struct PathBox {
    purpose: Purpose,
    text: String,
    /// Of an export.
    wishes: Wishes,
    chosen: Option<Receiver<Option<PathBuf>>>,
    is_new: bool,
}

/// Endings of what is written beside meshes and scans.
const ENDINGS: [&str; 3] = ["iclay", "isoclay", "jsonl"];

impl PathBox {
    /// For one to open.
    pub fn open() -> Self {
        Self::new(Purpose::Open, String::new())
    }

    /// For a volume of which a part is opened.
    pub fn open_part() -> Self {
        Self::new(Purpose::OpenPart, String::new())
    }

    /// For a script that is done.
    pub fn run_script() -> Self {
        Self::new(Purpose::RunScript, String::new())
    }

    /// For the script of all edits that are done.
    pub fn save_script(sheet: &Sheet) -> Self {
        let name = sheet.path.file_stem().unwrap_or_default().to_string_lossy();
        Self::new(Purpose::SaveScript, format!("{name}.jsonl"))
    }

    /// For the name of a document.
    pub fn save(sheet: &Sheet) -> Self {
        let name = match sheet.is_untitled {
            true => sheet.path.file_name().map(PathBuf::from).unwrap_or_default(),
            false => sheet.path.clone(),
        };
        Self::new(Purpose::Save, name.display().to_string())
    }

    /// For what the chosen object is written to.
    pub fn export(sheet: &Sheet) -> Self {
        let name = sheet.objects.get(sheet.chosen).map_or("object", |t| &t.name);
        Self::new(Purpose::Export, format!("{name}.stl"))
    }

    fn new(purpose: Purpose, text: String) -> Self {
        Self {
            purpose,
            text,
            wishes: Wishes::default(),
            chosen: None,
            is_new: true,
        }
    }

    fn title(&self) -> &'static str {
        match self.purpose {
            Purpose::Open => "Open",
            Purpose::OpenPart => "Preview",
            Purpose::RunScript => "Run script",
            Purpose::SaveScript => "Save script",
            Purpose::Save => "Save as",
            Purpose::Export => "Export",
        }
    }

    fn hint(&self) -> &'static str {
        match self.purpose {
            Purpose::Open => {
                "A document .isoclay, a field .iclay, a cloud or mesh .ply .obj .pcd .las .xyz …, a volume .nii .nrrd .mha …"
            }
            Purpose::OpenPart => {
                "A volume .nii .nrrd .mha …, a directory of DICOM slices, a cloud or a mesh: what it is is told, and asked how much of it is wanted"
            }
            Purpose::RunScript => {
                "Strokes or a scene .toml, or strokes .jsonl, as isoclay sculpt does them on the chosen object"
            }
            Purpose::SaveScript => {
                "All edits that are done, one a line, .jsonl: isoclay sculpt does them again"
            }
            Purpose::Save => "A document .isoclay. From then on every edit goes there",
            Purpose::Export => {
                "A mesh .stl .ply .obj .3mf .glb, a field .iclay; or, with the scan named below, the scan with its edits"
            }
        }
    }

    fn writes(&self) -> bool {
        matches!(
            self.purpose,
            Purpose::Save | Purpose::SaveScript | Purpose::Export
        )
    }

    /// The file that is named; `~` is the home directory. Documents and scripts get their endings;
    /// one that is typed before the one that was offered takes its place.
    fn path(&self) -> PathBuf {
        let text = self.text.trim();
        let path = match (text.strip_prefix("~/"), etcetera::home_dir()) {
            (Some(rest), Ok(home)) => home.join(rest),
            _ => text.into(),
        };
        let offered = match self.purpose {
            Purpose::Save => "isoclay",
            Purpose::SaveScript => "jsonl",
            Purpose::Export => "stl",
            Purpose::Open | Purpose::OpenPart | Purpose::RunScript => return path,
        };
        let is_typed = |stem: &OsStr| {
            let stem = stem.to_string_lossy().to_ascii_lowercase();
            let mut known = MESHES.iter().chain(&CLOUDS).chain(&VOLUMES).chain(&ENDINGS);
            known.any(|known| stem.strip_suffix(known).is_some_and(|name| name.ends_with('.')))
        };
        match path.extension() {
            None if self.purpose != Purpose::Export => path.with_extension(offered),
            // Another one was typed before it.
            Some(ending) if ending == offered && path.file_stem().is_some_and(is_typed) => {
                path.with_extension("")
            }
            _ => path,
        }
    }

    /// Why no such file can be had.
    fn refusal(&self) -> Option<String> {
        let path = self.path();
        if self.writes() {
            let directory = path.parent().filter(|p| !p.as_os_str().is_empty())?;
            let is_there = directory.is_dir();
            return (!is_there).then(|| format!("there is no directory {}", directory.display()));
        }
        (!path.exists()).then(|| format!("there is no file {}", path.display()))
    }

    /// The field for the path, and whether it was given by Enter.
    fn field(&mut self, ui: &mut egui::Ui) -> bool {
        let label = ui.label("File");
        let field = egui::TextEdit::singleline(&mut self.text)
            .desired_width(320.0)
            .show(ui);
        let response = field.response.response.clone().labelled_by(label.id);
        if std::mem::take(&mut self.is_new) {
            response.request_focus();
            // What is typed replaces the name, not its ending.
            let ending = PathBuf::from(&self.text)
                .extension()
                .map_or(0, |e| 1 + e.to_string_lossy().chars().count());
            let name = self.text.chars().count() - ending;
            let mut state = field.state;
            let range = CCursorRange::two(CCursor::new(0), CCursor::new(name));
            state.cursor.set_char_range(Some(range));
            state.store(ui.ctx(), response.id);
        }
        response.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter))
    }

    /// The system's dialog, on a thread of its own: some wait for it.
    fn browse(&mut self, context: &egui::Context, is_directory: bool) {
        let (tell, chosen) = channel();
        let (purpose, context) = (self.purpose, context.clone());
        let name = self.text.clone();
        std::thread::spawn(move || {
            let dialog = rfd::FileDialog::new();
            let path = match purpose {
                _ if is_directory => dialog.pick_folder(),
                Purpose::Open | Purpose::OpenPart | Purpose::RunScript => dialog.pick_file(),
                Purpose::Save | Purpose::SaveScript | Purpose::Export => {
                    dialog.set_file_name(name).save_file()
                }
            };
            let _ = tell.send(path);
            context.request_repaint();
        });
        self.chosen = Some(chosen);
    }
}

/// Shows the question that is asked, if one is.
pub fn path_box(context: &egui::Context, bench: &mut Bench) {
    let Some(mut asks) = bench.asks.take() else { return };
    if let Some(chosen) = &asks.chosen
        && let Ok(path) = chosen.try_recv()
    {
        asks.chosen = None;
        if let Some(path) = path {
            asks.text = path.display().to_string();
        }
    }
    let (mut goes_on, mut is_given, mut is_entered) = (true, false, false);
    let modal = egui::Modal::new(egui::Id::unique("path")).show(context, |ui| {
        ui.set_width(460.0);
        ui.heading(asks.title());
        ui.label(asks.hint());
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            is_entered = asks.field(ui);
            if ui.button("Browse…").clicked() {
                asks.browse(context, false);
            }
            let may_be_directory = matches!(asks.purpose, Purpose::Open | Purpose::OpenPart);
            if may_be_directory
                && ui
                    .button("Folder…")
                    .on_hover_text("Of DICOM or TIFF slices")
                    .clicked()
            {
                asks.browse(context, true);
            }
        });
        if asks.purpose == Purpose::Export {
            let unit = bench.chosen().map_or("", |thing| thing.unit);
            asks.wishes.show(ui, unit);
        }
        let is_named = !asks.text.trim().is_empty();
        let refusal = asks.refusal().filter(|_| is_named);
        let is_own = bench.sheet.as_ref().is_some_and(|s| s.path == asks.path());
        let replaces = asks.writes() && asks.path().is_file() && !is_own;
        match (&refusal, std::path::absolute(asks.path())) {
            (Some(why), _) => drop(ui.colored_label(ui.visuals().error_fg_color, why)),
            (None, Ok(path)) if replaces => {
                let told = format!("{} is there already", path.display());
                ui.colored_label(ui.visuals().warn_fg_color, told);
            }
            (None, Ok(path)) if is_named => drop(ui.weak(path.display().to_string())),
            _ => drop(ui.weak(" ")),
        }
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            let word = if replaces { "Replace" } else { asks.title() };
            let can = is_named && refusal.is_none();
            let is_clicked = ui.add_enabled(can, egui::Button::new(word)).clicked();
            // What is there already goes away by the button alone.
            is_given = is_clicked || can && is_entered && !replaces;
            goes_on &= !ui.button("Cancel").clicked();
        });
    });
    goes_on &= !modal.should_close();
    if is_given {
        match asks.purpose {
            Purpose::Open => bench.open(asks.path()),
            Purpose::OpenPart => bench.part = Some(super::Part::of(asks.path())),
            _ => bench.order(order(&asks)),
        }
    } else if goes_on {
        // What cannot be is put right.
        asks.is_new |= is_entered;
        bench.asks = Some(asks);
    }
}

fn order(asks: &PathBox) -> Order {
    let path = asks.path();
    match asks.purpose {
        Purpose::Open | Purpose::OpenPart => Order::Open(path),
        Purpose::RunScript => Order::RunScript(path),
        Purpose::SaveScript => Order::SaveScript(path),
        Purpose::Save => Order::Save(path),
        Purpose::Export => Order::Export {
            out: path,
            scan: asks.wishes.scan(),
            of_mesh: asks.wishes.of_mesh(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ending_that_is_typed_takes_the_place_of_the_offered_one() {
        for (purpose, text, path) in [
            (Purpose::Export, "mine.3mf.stl", "mine.3mf"),
            (Purpose::Export, "mine.PLY.stl", "mine.PLY"),
            (Purpose::Export, "mine.wrl.stl", "mine.wrl"),
            (Purpose::Export, "mine.nii.gz.stl", "mine.nii.gz"),
            (Purpose::Export, "mine.las.stl", "mine.las"),
            (Purpose::Export, "mine.stl", "mine.stl"),
            (Purpose::Export, "mine.v2.stl", "mine.v2.stl"),
            (Purpose::Export, "mine.stl.gz", "mine.stl.gz"),
            (Purpose::Save, "mine", "mine.isoclay"),
            (Purpose::Save, "mine.isoclay.isoclay", "mine.isoclay"),
            (Purpose::Open, "mine.3mf.stl", "mine.3mf.stl"),
        ] {
            let asks = PathBox::new(purpose, text.into());
            assert_eq!(asks.path(), PathBuf::from(path), "{text}");
        }
    }
}
