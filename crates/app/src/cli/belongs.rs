//! Whether a field and an input belong together.

use bspline::Aabb;
use document::Samples;
use fitting::volume::VolumeView;
use formats::field::FieldMeta;
use serde_json::json;

use super::failure::{Failure, Outcome};
use super::field::OpenField;
use super::input::Input;

/// What a field remembers of its input.
pub fn provenance(input: &Input, name: Option<String>) -> String {
    let arguments = std::env::args_os()
        .skip(1)
        .map(|a| a.to_string_lossy().into_owned());
    json!({
        "program": concat!("isoclay ", env!("CARGO_PKG_VERSION")),
        "input": name,
        "input_kind": with_samples(input, |samples| samples.kind()),
        "input_digest": with_samples(input, |samples| samples.digest()),
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
    with_samples(input, |samples| samples.differ_from(meta, extent, field, name))
}

fn with_samples<R>(input: &Input, ask: impl FnOnce(Samples) -> R) -> R {
    match input {
        Input::Cloud(c) => ask(Samples::Cloud(&c.positions)),
        Input::Mesh(m) => ask(Samples::Mesh(&m.vertices, &m.triangles)),
        Input::Volume(v) => ask(Samples::Volume(&VolumeView {
            dims: v.header.dims,
            values: (&v.values).into(),
            world_from_voxel: v.header.world_from_voxel,
        })),
    }
}
