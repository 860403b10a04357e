//! Whether an output is a file that is being read, under whatever name.

use std::ffi::OsStr;
use std::fs::File;
use std::io::Read;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use formats::Kind;
use formats::volumes::VolumeFormat;

use super::failure::{Failure, Outcome};
use super::source::Source;

/// Bytes of a header in which names of other files are looked for.
const HEADER: u64 = 1 << 24;
/// Longer words are data, not names.
const LONGEST_NAME: usize = 4096;

/// Refuses to write over an input: the same file by another spelling or a link, a slice in the directory that is read,
/// a file of voxels or of a buffer that the input's header names.
pub fn refuse_own_input(option: &str, input: &Source, output: &Path) -> Outcome {
    let Ok(target) = output.canonicalize() else {
        return Ok(()); // Nothing is there yet.
    };
    let own = if is_same(input.path(), &target) {
        format!("is {} itself", input.name())
    } else if is_slice(input.path(), &target) {
        format!("is one of the files of {}", input.name())
    } else if is_named(input.path(), &target) {
        format!("holds data of {}", input.name())
    } else {
        return Ok(());
    };
    Err(Failure::usage(format!(
        "{option} {}: {own}, which is read here and must not be overwritten; name another file",
        output.display()
    )))
}

/// Refuses two outputs that are one file.
pub fn refuse_own_output(option: &str, output: &Path, other: &Path) -> Outcome {
    // What is not there yet has a directory.
    let place = |path: &Path| {
        path.canonicalize().ok().or_else(|| {
            let directory = path.parent().filter(|p| !p.as_os_str().is_empty());
            let directory = directory.unwrap_or(Path::new(".")).canonicalize().ok()?;
            Some(directory.join(path.file_name()?))
        })
    };
    if place(output) != place(other) && !is_same(output, other) {
        return Ok(());
    }
    Err(Failure::usage(format!(
        "{option} {}: is what -o names, too, and one would be lost; name another file",
        output.display()
    )))
}

/// One file, also under two hard links.
fn is_same(a: &Path, b: &Path) -> bool {
    match (a.metadata(), b.metadata()) {
        (Ok(a), Ok(b)) => a.is_file() && (a.dev(), a.ino()) == (b.dev(), b.ino()),
        _ => false,
    }
}

/// A file of the same kind of slices in the directory that is read, or beside a file that stands for its series.
fn is_slice(input: &Path, target: &Path) -> bool {
    let directory = if input.is_dir() {
        input
    } else {
        input.parent().unwrap_or(Path::new(""))
    };
    let slices = match formats::detect(input) {
        Ok(Kind::Volume(VolumeFormat::Dicom)) => VolumeFormat::Dicom,
        Ok(Kind::Volume(VolumeFormat::TiffFolder)) => VolumeFormat::Tiff,
        _ => return false,
    };
    // Links in the directory lead to slices too, so that files are compared, not names.
    formats::detect(target).is_ok_and(|k| k == Kind::Volume(slices)) && holds(directory, target, 8)
}

/// Whether `target` is in the directory or, up to `depth` levels, below it.
fn holds(directory: &Path, target: &Path, depth: usize) -> bool {
    files_of(directory).any(|path| {
        if path.is_dir() {
            depth > 0 && holds(&path, target, depth - 1)
        } else {
            is_same(&path, target)
        }
    })
}

/// A file that the input's header names: the other half of a NIfTI pair, voxels of NRRD and MetaImage, a buffer of glTF.
fn is_named(input: &Path, target: &Path) -> bool {
    named_files(input).iter().any(|named| is_same(named, target))
}

/// Files that an input's header names, some of which may not be there, and the input itself where it is half of a pair.
pub fn named_files(input: &Path) -> Vec<PathBuf> {
    let directory = input.parent().unwrap_or(Path::new(""));
    let name = input.to_string_lossy().to_ascii_lowercase();
    let ends_in = |e: &&str| name.ends_with(*e);
    if let Some(ending) = [".hdr", ".img", ".hdr.gz", ".img.gz"].iter().find(|e| ends_in(e)) {
        let bytes = input.as_os_str().as_bytes();
        let stem = &bytes[..bytes.len() - ending.len()];
        let other = |e: &str| OsStr::from_bytes(&[stem, e.as_bytes()].concat()).into();
        return [".hdr", ".img", ".hdr.gz", ".img.gz"].map(other).into();
    }
    if ![".nhdr", ".nhdr.gz", ".mhd", ".gltf"].iter().any(ends_in) {
        return Vec::new();
    }
    let mut header = Vec::new();
    let read = File::open(input).and_then(|f| f.take(HEADER).read_to_end(&mut header));
    if read.is_err() {
        return Vec::new();
    }
    let text = String::from_utf8_lossy(&header);
    // Whole lines, what stands behind their key, and single words: names may hold blanks.
    let lines = text.lines().flat_map(|line| {
        let value = line.split_once([':', '=']).map_or("", |(_, v)| v);
        [line.trim(), value.trim()]
    });
    let words = text.split(|c: char| c.is_whitespace() || c == '"');
    lines
        .chain(words)
        .filter(|name| !name.is_empty() && name.len() < LONGEST_NAME)
        .flat_map(|name| match name.split_once('%') {
            None => vec![directory.join(name)],
            // A pattern such as slice%03d.raw, or an escaped character of a URI: all files that start like it.
            Some((head, _)) => {
                let (folder, start) = head.rsplit_once('/').unwrap_or(("", head));
                let starts = |f: &PathBuf| {
                    f.file_name()
                        .is_some_and(|n| n.to_string_lossy().starts_with(start))
                };
                files_of(&directory.join(folder)).filter(starts).collect()
            }
        })
        .collect()
}

fn files_of(directory: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    // The directory of a bare name has the empty path.
    Path::new(".")
        .join(directory)
        .read_dir()
        .into_iter()
        .flatten()
        .flatten()
        .map(|e| e.path())
}
