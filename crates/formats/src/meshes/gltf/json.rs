//! The part of the glTF 2.0 document that geometry needs; everything else is skipped as it is parsed.

use serde::Deserialize;

use crate::Fault;
use crate::limits::Budget;

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Root {
    pub scene: Option<u32>,
    pub scenes: Vec<Scene>,
    pub nodes: Vec<Node>,
    pub meshes: Vec<Mesh>,
    pub accessors: Vec<Accessor>,
    pub buffer_views: Vec<BufferView>,
    pub buffers: Vec<Buffer>,
    pub extensions_required: Vec<String>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Head {
    asset: Asset,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Asset {
    /// Text, though drafts of version 1 had a number.
    version: serde_json::Value,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Scene {
    pub nodes: Vec<u32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Node {
    pub children: Vec<u32>,
    pub mesh: Option<u32>,
    pub skin: Option<u32>,
    pub matrix: Option<Box<[f64; 16]>>,
    pub translation: Option<[f64; 3]>,
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Mesh {
    pub primitives: Vec<Primitive>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Primitive {
    pub attributes: Attributes,
    pub indices: Option<u32>,
    pub mode: Option<u32>,
    pub targets: Vec<serde::de::IgnoredAny>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Attributes {
    #[serde(rename = "POSITION")]
    pub position: Option<u32>,
    #[serde(rename = "COLOR_0")]
    pub color: Option<u32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Accessor {
    pub buffer_view: Option<u32>,
    pub byte_offset: u64,
    pub component_type: u32,
    pub normalized: bool,
    pub count: u64,
    #[serde(rename = "type")]
    pub shape: String,
    pub sparse: Option<serde::de::IgnoredAny>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct BufferView {
    pub buffer: u32,
    pub byte_offset: u64,
    pub byte_length: u64,
    pub byte_stride: Option<u64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Buffer {
    pub uri: Option<String>,
    pub byte_length: u64,
}

/// Extensions that leave the positions and the faces as they are, or whose effect on them is read.
const HARMLESS: [&str; 6] = [
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_texture_basisu",
    "KHR_lights_punctual",
    "EXT_texture_webp",
    "EXT_texture_avif",
];

/// Reads the document.
pub(super) fn parse(text: &[u8], budget: &mut Budget) -> Result<Root, Fault> {
    // What it is parsed into: an object a brace, a number or name a comma or bracket, each in a list that doubles
    // as it grows, and the strings.
    let (mut objects, mut items) = (0, 0);
    for byte in text {
        objects += u64::from(*byte == b'{');
        items += u64::from(matches!(byte, b',' | b'['));
    }
    budget.reserve("the document", objects, 3 * size_of::<Node>())?;
    budget.reserve("the document", items, 3 * size_of::<String>())?;
    budget.reserve("the document", text.len() as u64, 1)?;
    let damaged = |e| Fault::Damaged {
        what: format!("the JSON document does not hold: {e}"),
    };
    // Lists of version 2 were objects before, so the version is asked first.
    let Head { asset } = serde_json::from_slice(text).map_err(damaged)?;
    let version = asset
        .version
        .as_str()
        .map_or_else(|| asset.version.to_string(), str::to_owned);
    if version.split('.').next() != Some("2") {
        return Err(Fault::Value {
            what: "the version of glTF",
            value: format!("{:?}", version.chars().take(20).collect::<String>()),
            remedy: "2.x is read; export the file again",
        });
    }
    let root: Root = serde_json::from_slice(text).map_err(damaged)?;
    let unread = root
        .extensions_required
        .iter()
        .find(|e| !HARMLESS.contains(&e.as_str()) && !e.starts_with("KHR_materials_"));
    if let Some(name) = unread {
        return Err(Fault::Value {
            what: "a required extension",
            value: name.chars().take(60).collect(),
            remedy: "it is not read; export without compression and extensions",
        });
    }
    Ok(root)
}
