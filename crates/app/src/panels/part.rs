//! What is asked before a scan is opened: what it is, how much of it is wanted, and what that will hold.

mod cloud;
mod volume;

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, channel};

use egui::Ui;
use formats::Kind;

use self::cloud::Cloud;
use crate::cli::desk_files;
use crate::cli::quantity::human_bytes;
use crate::window::Bench;
use crate::window::orders::Order;

/// Files up to this are opened at once, bytes.
pub const LARGE: u64 = 64 << 20;
/// Points of a picture along its longest side.
const WIDE: f32 = 190.0;

/// A scan that may be opened.
pub struct Part {
    path: PathBuf,
    told: Receiver<Result<Looked, String>>,
    known: Option<Result<Looked, String>>,
}

/// What a first look has found.
enum Looked {
    Volume(Box<volume::Part>),
    Cloud(Box<Cloud>),
}

impl Part {
    /// Begins to look at a file, on a thread of its own.
    pub fn of(path: PathBuf) -> Self {
        let (tell, told) = channel();
        let file = path.clone();
        std::thread::spawn(move || {
            let _ = tell.send(look(&file));
        });
        Self {
            path,
            told,
            known: None,
        }
    }
}

/// Whether a scan is so large that it is asked first how much of it is wanted: a directory of slices always is.
pub fn is_large(path: &Path) -> bool {
    if desk_files::is_document(path) {
        return false;
    }
    let is_long = path.metadata().is_ok_and(|file| file.len() > LARGE);
    path.is_dir() || is_long && formats::detect(path).is_ok_and(|kind| kind != Kind::Field)
}

fn look(path: &Path) -> Result<Looked, String> {
    match formats::detect(path).map_err(|e| e.to_string())? {
        Kind::Volume(_) => volume::Part::of(path).map(Box::new).map(Looked::Volume),
        Kind::Field => Err(format!(
            "{}: is a field, which is opened as it is",
            path.display()
        )),
        kind => Cloud::of(path, kind).map(Box::new).map(Looked::Cloud),
    }
}

/// Over all else, while it is asked how much is wanted.
pub fn part(context: &egui::Context, bench: &mut Bench) {
    let Some(mut part) = bench.part.take() else { return };
    if part.known.is_none() {
        part.known = part.told.try_recv().ok();
        context.request_repaint_after(std::time::Duration::from_millis(50));
    }
    let mut answer = None;
    let modal = egui::Modal::new(egui::Id::unique("part")).show(context, |ui| {
        ui.set_width(3.0 * WIDE + 24.0);
        let name = part.path.file_name().unwrap_or_default().to_string_lossy();
        ui.heading(match part.known {
            Some(Ok(Looked::Cloud(_))) => format!("Open {name}?"),
            _ => format!("How much of {name}?"),
        });
        match &mut part.known {
            None => drop(ui.horizontal(|ui| {
                ui.spinner();
                ui.label("Looking at it");
            })),
            Some(Err(why)) => drop(ui.colored_label(ui.visuals().error_fg_color, &**why)),
            Some(Ok(Looked::Volume(volume))) => volume.show(ui),
            Some(Ok(Looked::Cloud(cloud))) => cloud.show(ui),
        }
        ui.horizontal(|ui| answer = answered(ui, &part));
    });
    match answer {
        Some(order) => bench.order(order),
        None if modal.should_close() => {}
        None => bench.part = Some(part),
    }
}

/// What is to be done; to leave it does nothing.
fn answered(ui: &mut Ui, part: &Part) -> Option<Order> {
    let mut answer = None;
    let path = || part.path.clone();
    let mut button = |ui: &mut Ui, text: &str, order: &dyn Fn() -> Order| {
        if ui.button(text).clicked() {
            answer = Some(order());
        }
    };
    match &part.known {
        Some(Ok(Looked::Volume(volume))) => {
            let options: Vec<OsString> = volume.options();
            button(ui, "Open this part", &|| Order::OpenPart(path(), options.clone()));
            button(ui, "Open all of it", &|| Order::Open(path()));
        }
        Some(Ok(Looked::Cloud(_))) => button(ui, "Open it", &|| Order::Open(path())),
        None => button(ui, "Open all of it", &|| Order::Open(path())),
        Some(Err(_)) => {}
    }
    button(ui, "Cancel", &|| Order::Untry);
    answer
}

/// How much memory something takes, with a warning where the fit may hold too little for it.
fn bytes_of(ui: &mut Ui, what: &str, bytes: u64, remedy: &str) {
    let told = format!("{what}, {} to read them", human_bytes(bytes));
    let most = desk_files::memory().0.map(|most| most.0);
    match most.filter(|most| bytes > most / 2) {
        Some(most) => {
            let text = format!("{told}; the fit may hold {}: {remedy}", human_bytes(most));
            ui.colored_label(ui.visuals().warn_fg_color, text);
        }
        None => drop(ui.label(told)),
    }
}
