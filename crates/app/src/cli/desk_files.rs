//! What the window opens and writes: each by the command that does it, in a process of its own.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use document::{Document, Object, State, with_report};
use etcetera::BaseStrategy;
use fitting::{Cancel, Control, FitReport};
use formats::field::{FieldMeta, SourceKind};
use glam::DVec3;
use serde_json::{Map, Value};
use tools::force::Solid;
use tools::geometric::block;

use super::batch::child::{Bounds, Stop, ask};
use super::ceiling::of_another;
use super::document::{self as on_documents, new};
use super::failure::{Failure, Outcome};
use super::quantity::{Memory, human_bytes};
use super::source::{FIELDS, Source, scratch};

/// Told the stage and the share done.
pub type Show<'a> = &'a dyn Fn(&str, f64);

/// What a fit may hold, and what it is told.
pub fn memory() -> (Option<Memory>, String) {
    let most = of_another();
    let told = most.map_or(String::new(), |m| format!(", with {} at most", human_bytes(m.0)));
    (most, told)
}

/// Whether a path is a document.
pub fn is_document(path: &Path) -> bool {
    formats_as(path, "isoclay")
}

fn formats_as(path: &Path, extension: &str) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case(extension))
}

/// Opens a document for the window alone; what was lost goes to the notes.
pub fn open(path: &Path, notes: &mut Vec<String>) -> Result<Document, String> {
    on_documents::open(path, notes).map_err(|e| e.to_string())
}

/// A new document at a path that no file has.
pub fn create(path: &Path, state: State) -> Result<Document, String> {
    Document::create(path, state, on_documents::options()).map_err(|e| e.to_string())
}

/// The object that a field is, and its name; none if the path is a scan.
pub fn field(path: &Path) -> Option<Result<(String, Object), String>> {
    formats_as(path, "iclay").then(|| of_field(path, None).map_err(|e| e.to_string()))
}

/// What a fit needs besides that failed for this reason: points without normals are given some, as nobody can be asked here which
/// side is inside.
pub fn remedy(why: &str) -> Option<OsString> {
    const UNORIENTED: &str = "--unoriented";
    why.contains(UNORIENTED).then(|| UNORIENTED.into())
}

/// The object that a scan is fitted to by a process that holds no more than `memory`, and its name.
pub fn fit(
    scan: &Path,
    options: &[OsString],
    memory: Option<Memory>,
    cancel: &Cancel,
    show: Show<'_>,
) -> Result<(String, Object), String> {
    let fitted = scratch("the fit").and_then(|scratch| {
        let field = scratch.path().join("field.iclay");
        let mut arguments = vec![scan.as_os_str().to_owned(), "-o".into(), field.clone().into()];
        arguments.extend_from_slice(options);
        if let Some(Memory(most)) = memory {
            arguments.extend(["--memory".into(), most.to_string().into()]);
        }
        // What is waited for is not done aside.
        let is_aside = !options.iter().any(|option| option == "--coarse");
        command("fit", &arguments, cancel, is_aside, scratch.path(), show)?;
        of_field(&field, Some(scan))
    });
    fitted.map_err(|e| e.to_string())
}

fn of_field(field: &Path, scan: Option<&Path>) -> Outcome<(String, Object)> {
    let source = Source::open(field, None, FIELDS, &Cancel::new())?;
    let (name, mut object) = new::of_field(&source, None, &mut Vec::new())?;
    if object.meta.iso.is_none() {
        let why = "names no surface; fit it with --iso DENSITY on the command line first";
        return Err(Failure::input(format!("{}: {why}", field.display())));
    }
    object.properties.material = clay();
    let scan = scan.and_then(Path::file_name).map(|n| n.to_string_lossy());
    let stem = scan.map(|n| n.split('.').next().unwrap_or("scan").to_string());
    Ok((stem.filter(|s| !s.is_empty()).unwrap_or(name), object))
}

fn clay() -> tools::material::Material {
    tools::material::Material { solid: Solid::Clay }
}

/// A block of clay to begin with.
pub fn clay_block() -> Result<(String, Object), String> {
    const SIZE: f64 = 40.0;
    const SPACING: f64 = 0.8;
    let field = block(DVec3::splat(SIZE), SPACING, &mut Control::default()).map_err(|e| e.to_string())?;
    let report = FitReport {
        tolerance: 0.02 * SPACING,
        ..FitReport::default()
    };
    let meta = FieldMeta {
        source: SourceKind::Other,
        unit: formats::Unit::Millimetre,
        iso: Some(0.0),
        ..FieldMeta::default()
    };
    let mut object = Object::of(field.into(), with_report(meta, &report));
    object.properties.material = clay();
    Ok(("clay".into(), object))
}

/// Writes an object of a document that nobody has open: its mesh, by options of `mesh`, its field, or, over a scan, that scan with its
/// edits. What the command tells of it, as `--json` prints it.
pub fn export(
    document: &Path,
    object: &str,
    out: &Path,
    scan: Option<&Path>,
    of_mesh: &[OsString],
    cancel: &Cancel,
    show: Show<'_>,
) -> Result<Map<String, Value>, String> {
    let mut arguments: Vec<OsString> = vec![
        document.into(),
        "--object".into(),
        object.into(),
        "-o".into(),
        out.into(),
    ];
    let name = match (scan, formats_as(out, "iclay")) {
        (Some(scan), _) => {
            arguments.extend(["--like".into(), scan.as_os_str().to_owned()]);
            "export"
        }
        (None, true) => "export",
        (None, false) => {
            arguments.push("--check".into());
            arguments.extend_from_slice(of_mesh);
            "mesh"
        }
    };
    let done = scratch("the export").and_then(|s| command(name, &arguments, cancel, true, s.path(), show));
    done.map_err(|e| e.to_string())
}

/// What a command prints as JSON.
fn command(
    name: &str,
    arguments: &[OsString],
    cancel: &Cancel,
    is_aside: bool,
    scratch: &Path,
    show: Show<'_>,
) -> Outcome<Map<String, Value>> {
    let bounds = Bounds {
        cancel,
        deadline: None,
        scratch,
        is_aside,
    };
    ask(name, arguments, &bounds, show)
        .said
        .map_err(|stop| match stop {
            Stop::Cancelled => Failure::input("cancelled"),
            Stop::Failed(reason) => Failure::input(reason.message),
        })
}

/// Where documents are kept that have no name yet: beside what other programs keep for the user.
pub fn home() -> PathBuf {
    let usual = etcetera::choose_base_strategy().map(|kept| kept.data_dir());
    usual.unwrap_or_else(|_| std::env::temp_dir()).join("isoclay")
}

/// Where settings are kept.
pub fn settings() -> PathBuf {
    let usual = etcetera::choose_base_strategy().map(|kept| kept.config_dir());
    usual.unwrap_or_else(|_| std::env::temp_dir()).join("isoclay")
}

/// Documents in a directory, the newest first.
pub fn kept(directory: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(directory).into_iter().flatten().flatten();
    let dated = entries.filter_map(|entry| {
        let path = entry.path();
        let changed = entry.metadata().and_then(|m| m.modified()).ok()?;
        is_document(&path).then_some((changed, path))
    });
    let mut dated: Vec<_> = dated.collect();
    dated.sort_by(|a, b| b.cmp(a));
    dated.into_iter().map(|(_, path)| path).collect()
}

/// The file in a directory of a document that has no name yet.
pub fn untitled(directory: &Path, name: &str) -> Result<PathBuf, String> {
    std::fs::create_dir_all(directory).map_err(|e| {
        format!(
            "{}: cannot be made ({e}); check who may write there",
            directory.display()
        )
    })?;
    let free = (1..).map(|n| match n {
        1 => directory.join(format!("{name}.isoclay")),
        n => directory.join(format!("{name}-{n}.isoclay")),
    });
    Ok(free
        .into_iter()
        .find(|p| !p.exists())
        .expect("numbers do not end"))
}
