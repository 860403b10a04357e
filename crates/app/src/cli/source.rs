//! Files to read, standard input among them.

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Duration;

use clap::builder::PossibleValuesParser;
use fitting::Cancel;
use formats::atomic::PassingDirectory;
use formats::{Fault, FormatError};

use super::failure::{Failure, Outcome};
use super::flags;
use super::interrupt;
use super::quantity::human_bytes;

/// A file to read. What has no name of its own (standard input), or one that does not tell its format, is read
/// under another name in a directory that goes with this value.
pub struct Source {
    path: PathBuf,
    name: String,
    /// What may be read here, for the message about a file that is something else.
    accepted: &'static str,
    _held: Option<PassingDirectory>,
}

/// Names of formats that `--format` takes for an input.
pub fn input_formats() -> PossibleValuesParser {
    PossibleValuesParser::new([
        "ply", "obj", "xyz", "pcd", "las", "laz", "e57", "stl", "gltf", "glb", "3mf", "wrl", "nii", "nrrd",
        "mha", "tif",
    ])
}

/// The same where points are needed; a mesh gives its vertices.
pub fn point_formats() -> PossibleValuesParser {
    PossibleValuesParser::new([
        "ply", "obj", "xyz", "pcd", "las", "laz", "e57", "stl", "gltf", "glb", "3mf", "wrl",
    ])
}

/// What `fit`, `check` and `convert` accept.
pub const SAMPLES: &str = "point clouds .ply .obj .pcd .las .laz .e57 .xyz .xyzn .txt .asc .csv .pts, meshes .ply \
    .obj .stl .gltf .glb .3mf .wrl, volumes .nii .hdr .nrrd .nhdr .mha .mhd .tif (each also .gz), directories of DICOM \
    or .tif slices, and voxels without a header by --shape and --voxel";
/// What `info` accepts.
pub const ANYTHING: &str = "point clouds .ply .obj .pcd .las .laz .e57 .xyz .xyzn .txt .asc .csv .pts, meshes .ply \
    .obj .stl .gltf .glb .3mf .wrl, volumes .nii .hdr .nrrd .nhdr .mha .mhd .tif (each also .gz), directories of DICOM \
    or .tif slices, voxels without a header by --shape and --voxel, fields .iclay and documents .isoclay";
/// What `eval --points` accepts.
pub const POINTS: &str =
    "point clouds .ply .obj .pcd .las .laz .e57 .xyz .xyzn .txt .asc .csv .pts, each also .gz";
/// What `sample --like` accepts.
pub const VOLUMES: &str = "volumes .nii .hdr .nrrd .nhdr .mha .mhd .tif (each also .gz), directories of DICOM or .tif \
    slices, and voxels without a header by --shape and --voxel";
/// What is made by `isoclay fit`.
pub const FIELDS: &str = "fields .iclay, as isoclay fit writes them, and documents .isoclay";

impl Source {
    /// The file `given`, or standard input for `-`; `format` names the format of a content that does not tell it.
    pub fn open(
        given: &Path,
        format: Option<&str>,
        accepted: &'static str,
        cancel: &Cancel,
    ) -> Outcome<Self> {
        let (path, name, held) = if given == Path::new("-") {
            let held = scratch("standard input")?;
            let path = held
                .path()
                .join(format.map_or("stdin".into(), |f| format!("stdin.{f}")));
            spool(&path, cancel)?;
            (path, "standard input".into(), Some(held))
        } else {
            let name = given.display().to_string();
            match format.filter(|f| !has_extension(given, f) && given.is_file()) {
                Some(format) => {
                    let held = scratch(&name)?;
                    let path = held.path().join(format!("input.{format}"));
                    let whole = std::path::absolute(given).unwrap_or_else(|_| given.to_path_buf());
                    std::os::unix::fs::symlink(whole, &path)
                        .map_err(|e| Failure::limit(format!("{name}: --format {format}: {e}")))?;
                    (path, name, Some(held))
                }
                None => (given.to_path_buf(), name, None),
            }
        };
        Ok(Self {
            path,
            name,
            accepted,
            _held: held,
        })
    }

    /// Names the option that it was given by, for messages.
    pub fn under(mut self, option: &str) -> Self {
        self.name = format!("{option} {}", self.name);
        self
    }

    /// Where it is read from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the user calls it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// An error of reading: bad input, unless a limit stopped it.
    pub fn reading(&self, e: FormatError) -> Failure {
        let name = if e.path == self.path {
            self.name.clone()
        } else {
            e.path.display().to_string()
        };
        match e.fault {
            Fault::Limit { what, needed, .. } => Failure::limit(format!(
                "{name}: {what} would need {}, more than the memory ceiling leaves; raise --memory if the file is \
                 trusted",
                human_bytes(needed)
            )),
            Fault::UnknownKind { .. } if self.name.ends_with("standard input") => Failure::input(format!(
                "{name}: its first bytes do not tell its format; name it by --format (convert: --input-format), or give {}",
                self.accepted
            )),
            Fault::UnknownKind { found, .. } => Failure::input(format!(
                "{name}: {found} is not read here; give {}",
                self.accepted
            )),
            fault => Failure::input(format!("{name}: {}", flags::fault(&fault))),
        }
    }
}

/// A directory for what goes away again.
pub fn scratch(what: &str) -> Outcome<PassingDirectory> {
    PassingDirectory::new(None).map_err(|e| {
        Failure::limit(format!(
            "{what}: no temporary file can be made in {} ({e}); set TMPDIR to a directory with room",
            std::env::temp_dir().display()
        ))
    })
}

fn has_extension(path: &Path, format: &str) -> bool {
    let name = path.to_string_lossy().to_ascii_lowercase();
    name.strip_suffix(".gz")
        .unwrap_or(&name)
        .ends_with(&format!(".{format}"))
}

/// Copies standard input into `path`. The reading waits in a thread of its own, so that a cancel is seen at once.
fn spool(path: &Path, cancel: &Cancel) -> Outcome {
    static TAKEN: AtomicBool = AtomicBool::new(false);
    if TAKEN.swap(true, Ordering::Relaxed) {
        return Err(Failure::usage(
            "-: standard input can be read only once; name a file for the other input",
        ));
    }
    let failed = |e: io::Error| {
        Failure::limit(format!(
            "standard input: it cannot be kept in {} ({e}); set TMPDIR to a directory with room",
            path.display()
        ))
    };
    let mut file = File::create(path).map_err(failed)?;
    let (send, receive) = mpsc::sync_channel::<io::Result<Vec<u8>>>(4);
    std::thread::Builder::new()
        .name("stdin".into())
        .spawn(move || {
            let mut stdin = io::stdin().lock();
            loop {
                let mut part = vec![0; 1 << 18];
                let read = stdin.read(&mut part).map(|n| part.truncate(n));
                let is_last = read.is_err() || part.is_empty();
                if send.send(read.map(|()| part)).is_err() || is_last {
                    break;
                }
            }
        })
        .map_err(failed)?;
    loop {
        interrupt::check(cancel)?;
        match receive.recv_timeout(Duration::from_millis(100)) {
            Ok(Ok(part)) if part.is_empty() => return file.flush().map_err(failed),
            Ok(Ok(part)) => file.write_all(&part).map_err(failed)?,
            Ok(Err(e)) => return Err(Failure::input(format!("standard input: reading failed: {e}"))),
            Err(mpsc::RecvTimeoutError::Timeout) => {}
            Err(mpsc::RecvTimeoutError::Disconnected) => return Ok(()),
        }
    }
}
