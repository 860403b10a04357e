use glam::DAffine3;
use serde_json::json;

use super::{failure, open};
use crate::cli::failure::Outcome;
use crate::cli::quantity::{human_count, human_number};
use crate::cli::source::Source;
use crate::cli::summary::{self, hex, table};

/// Describes a document and its objects.
pub fn run(source: &Source, json: bool) -> Outcome {
    let mut notes = Vec::new();
    let mut document = open(source.path(), &mut notes)?;
    let counts = document.counts().map_err(failure)?;
    let mut rows = vec![
        ("kind", "document".to_string()),
        ("edits done", human_count(counts.done)),
        ("edits undone", human_count(counts.undone)),
    ];
    let mut objects = Vec::new();
    for (name, object) in document.state().objects() {
        let field = &object.field;
        let b = field.world_box();
        let painted = object.layers.iter().filter(|(_, layer)| !layer.is_empty());
        let painted: Vec<_> = painted.map(|(substance, _)| substance.name()).collect();
        let [lo, hi] = [b.min, b.max].map(|p| p.to_array().map(human_number).join(", "));
        let coefficients = human_count(field.coefficient_count());
        rows.push(("object", name.clone()));
        rows.push((
            "  coefficients",
            match field.knots() {
                None => format!("{coefficients}, shaped to level {}", object.detail()),
                Some(knots) => {
                    let shape = knots.shape().map(|n| n.to_string()).join(" × ");
                    format!("{coefficients} on knots of its own, {shape}")
                }
            },
        ));
        rows.push(("  box", format!("({lo}) to ({hi}) {}", object.meta.unit)));
        if let Some(parent) = &object.properties.parent {
            rows.push(("  moves with", parent.clone()));
        }
        let [x, y, z, origin] = object
            .properties
            .placement
            .map(|c| c.map(human_number).join(", "));
        if object.properties.parent_from_object() != DAffine3::IDENTITY {
            rows.push(("  placed", format!("axes ({x}), ({y}), ({z}), origin ({origin})")));
        }
        if !painted.is_empty() {
            rows.push(("  painted", painted.join(", ")));
        }
        objects.push(json!({
            "name": name,
            "coefficients": field.coefficient_count(),
            "detail": object.detail(),
            "knots": field.knots().map(|knots| knots.shape()),
            "box": [b.min.to_array(), b.max.to_array()],
            "unit": object.meta.unit.symbol(),
            "iso": object.iso(),
            "painted": painted,
            "placement": object.properties.placement,
            "parent": object.properties.parent,
            "field_sha256": hex(&field.sha256()),
        }));
    }
    let text = match json {
        false => table(rows, &notes),
        true => json!({
            "file": source.name(),
            "kind": "document",
            "done": counts.done,
            "undone": counts.undone,
            "objects": objects,
            "notes": notes,
        })
        .to_string(),
    };
    summary::print(&text, false)
}
