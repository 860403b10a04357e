//! Whether a field and an input belong together.

use bspline::Aabb;
use formats::field::{FieldMeta, SourceKind};
use serde_json::{Value, json};

use super::failure::{Failure, Outcome};
use super::field::OpenField;
use super::input::{Input, bounding_box};

/// What a field remembers of its input.
pub fn provenance(input: &Input, name: Option<String>) -> String {
    let arguments = std::env::args_os()
        .skip(1)
        .map(|a| a.to_string_lossy().into_owned());
    json!({
        "program": concat!("isoclay ", env!("CARGO_PKG_VERSION")),
        "input": name,
        "input_kind": kind(input),
        "input_digest": digest(input),
        "arguments": that_matter(arguments),
    })
    .to_string()
}

/// The arguments without those that no bit of the field depends on: a fit written elsewhere, or on more threads, is the
/// same file.
fn that_matter(arguments: impl Iterator<Item = String>) -> Vec<String> {
    let mut kept = Vec::new();
    let mut arguments = arguments.peekable();
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--json" => {}
            "-o" | "--output" | "--threads" => drop(arguments.next()),
            a if a.starts_with("--output=") || a.starts_with("--threads=") => {}
            a if a.starts_with("-o") => {}
            "--" => {
                kept.push(argument);
                kept.extend(arguments);
                break;
            }
            _ => kept.push(argument),
        }
    }
    kept
}

/// Refuses an input that `open` was not fitted to, as far as the field tells.
///
/// # Errors
/// Exit code 2 with what differs: the kind, the samples, or, where a field remembers no samples, the box.
pub fn check(open: &OpenField, field: &str, input: &Input, name: &str) -> Outcome {
    let differs = differs(open.meta(), &open.lattice().world_box(), field, input, name);
    differs.map_or(Ok(()), |differs| {
        Err(Failure::usage(format!(
            "{differs}; give its own input with the options that it was read with, or --anyway to measure all the same"
        )))
    })
}

/// How an input is told from the one that a field with such a `meta` and `extent` was fitted to.
pub fn differs(meta: &FieldMeta, extent: &Aabb, field: &str, input: &Input, name: &str) -> Option<String> {
    let stored: Value = serde_json::from_str(&meta.provenance).unwrap_or_default();
    let was = |key: &str| stored[key].as_str();
    let (fitted_to, given) = (was("input_kind"), kind(input));
    if fitted_to.is_some_and(|k| k != given) {
        Some(format!(
            "{field} was fitted to a {}, and {name} is taken for a {given}",
            fitted_to.unwrap_or_default()
        ))
    } else if (meta.source == SourceKind::Volume) != matches!(input, Input::Volume(_)) {
        Some(format!("{name} is a {given}, which {field} was not fitted to"))
    } else if let Some(digest) = was("input_digest") {
        let file = was("input").unwrap_or("another file");
        (digest != self::digest(input)).then(|| {
            format!(
                "{field} was fitted to other samples than those of {name} (to {file}, as it was read then)"
            )
        })
    } else {
        (!overlaps(extent, input)).then(|| format!("{name} lies outside the box of {field}"))
    }
}

fn kind(input: &Input) -> &'static str {
    match input {
        Input::Cloud(_) => "cloud",
        Input::Mesh(_) => "mesh",
        Input::Volume(_) => "volume",
    }
}

/// Whether most of the input lies where the field does.
fn overlaps(field: &Aabb, input: &Input) -> bool {
    let own: Aabb = match input {
        Input::Cloud(c) => bounding_box(&c.positions),
        Input::Mesh(m) => bounding_box(&m.vertices),
        Input::Volume(v) => {
            let last = glam::DVec3::from_array(v.header.dims.map(|n| (n - 1) as f64));
            Aabb::new(glam::DVec3::ZERO, last).transformed(&v.header.world_from_voxel)
        }
    };
    let common = (own.max.min(field.max) - own.min.max(field.min)).max(glam::DVec3::ZERO);
    let size = own.size();
    (0..3).all(|a| common[a] >= 0.5 * size[a])
}

/// A number of the samples by which another input is told from this one; hexadecimal.
fn digest(input: &Input) -> String {
    let mut hash = Hash(0);
    match input {
        // Errors are measured at the positions alone, and other formats round the normals.
        Input::Cloud(c) => hash.vectors(&c.positions),
        Input::Mesh(m) => {
            hash.vectors(&m.vertices);
            m.triangles
                .iter()
                .flatten()
                .for_each(|v| hash.take(u64::from(*v)));
        }
        Input::Volume(v) => {
            v.header.dims.iter().for_each(|n| hash.take(*n as u64));
            let map = v.header.world_from_voxel.to_cols_array();
            map.iter().for_each(|x| hash.take(x.to_bits()));
            v.values.iter().for_each(|x| hash.take(u64::from(x.to_bits())));
        }
    }
    format!("{:016x}", hash.0)
}

/// Against mistakes, not against forgers.
struct Hash(u64);

impl Hash {
    fn take(&mut self, word: u64) {
        self.0 = (self.0.rotate_left(5) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }

    fn vectors(&mut self, list: &[glam::DVec3]) {
        self.take(list.len() as u64);
        for v in list {
            v.to_array().iter().for_each(|x| self.take(x.to_bits()));
        }
    }
}
