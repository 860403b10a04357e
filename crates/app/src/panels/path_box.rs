//! Asks for a file: by the system's own dialog, or by its path where there is none.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, channel};

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
    /// Of an export: the scan to write with its edits.
    scan: String,
    chosen: Option<Receiver<Option<PathBuf>>>,
    is_new: bool,
}

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
            scan: String::new(),
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
    let (mut goes_on, mut is_given) = (true, false);
    let modal = egui::Modal::new(egui::Id::unique("path")).show(context, |ui| {
        ui.set_width(460.0);
        ui.heading(asks.title());
        ui.label(asks.hint());
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            let label = ui.label("File");
            let field = ui.add(egui::TextEdit::singleline(&mut asks.text).desired_width(320.0));
            let field = field.labelled_by(label.id);
            if std::mem::take(&mut asks.is_new) {
                field.request_focus();
            }
            is_given |= field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
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
            ui.horizontal(|ui| {
                let label = ui.label("Scan");
                let edit = egui::TextEdit::singleline(&mut asks.scan)
                    .desired_width(320.0)
                    .hint_text("none: write a mesh or a field");
                ui.add(edit).labelled_by(label.id);
            });
        }
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            is_given |= ui
                .add_enabled(!asks.text.trim().is_empty(), egui::Button::new(asks.title()))
                .clicked();
            goes_on &= !ui.button("Not now").clicked();
        });
    });
    goes_on &= !modal.should_close();
    if is_given && !asks.text.trim().is_empty() {
        match asks.purpose {
            Purpose::Open => bench.open(asks.text.trim().into()),
            Purpose::OpenPart => bench.part = Some(super::Part::of(asks.text.trim().into())),
            _ => bench.order(order(&asks)),
        }
    } else if goes_on {
        bench.asks = Some(asks);
    }
}

fn order(asks: &PathBox) -> Order {
    let path = PathBuf::from(asks.text.trim());
    match asks.purpose {
        Purpose::Open | Purpose::OpenPart => Order::Open(path),
        Purpose::RunScript => Order::RunScript(path),
        Purpose::SaveScript => Order::SaveScript(match path.extension() {
            Some(_) => path,
            None => path.with_extension("jsonl"),
        }),
        Purpose::Save => Order::Save(match path.extension() {
            Some(_) => path,
            None => path.with_extension("isoclay"),
        }),
        Purpose::Export => Order::Export {
            out: path,
            scan: Some(asks.scan.trim())
                .filter(|s| !s.is_empty())
                .map(PathBuf::from),
        },
    }
}
