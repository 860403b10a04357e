//! glTF 2.0 out: one mesh in one buffer, in metres where the unit is known.

use std::io::{self, Write};

use base64::engine::general_purpose::STANDARD;
use base64::write::EncoderWriter;
use glam::{DVec3, Vec3};

use crate::meshes::mesh::{CHUNK, Mesh, needs_double, spill};

/// Positions and how they are stored: single precision about an origin of double precision.
struct Layout {
    scale: f64,
    origin: DVec3,
    min: Vec3,
    max: Vec3,
    position_bytes: usize,
    color_bytes: usize,
    index_bytes: usize,
}

impl Layout {
    fn of(mesh: &Mesh) -> Self {
        let scale = mesh.unit.in_mm().map_or(1.0, |mm| mm / 1000.0);
        let vertices = mesh.vertices;
        // The node carries the offset of a small thing far away, which floats could not.
        let origin = match vertices.first() {
            Some(first) if needs_double(vertices) => *first * scale,
            _ => DVec3::ZERO,
        };
        let mut layout = Self {
            scale,
            origin,
            min: Vec3::INFINITY,
            max: Vec3::NEG_INFINITY,
            position_bytes: 12 * vertices.len(),
            color_bytes: mesh.colors.map_or(0, |c| 4 * c.len()),
            index_bytes: 12 * mesh.triangles.len(),
        };
        for v in vertices {
            let p = layout.stored(*v);
            (layout.min, layout.max) = (layout.min.min(p), layout.max.max(p));
        }
        layout
    }

    fn stored(&self, v: DVec3) -> Vec3 {
        (v * self.scale - self.origin).as_vec3()
    }

    fn bytes(&self) -> usize {
        self.position_bytes + self.color_bytes + self.index_bytes
    }

    /// The document; `uri` is that of the buffer, where it has one.
    fn document(&self, mesh: &Mesh, uri: &str) -> String {
        let text = |v: Vec3| format!("[{:?},{:?},{:?}]", v.x, v.y, v.z);
        let origin = self.origin;
        let (vertices, corners) = (mesh.vertices.len(), 3 * mesh.triangles.len());
        let place = match origin == DVec3::ZERO {
            true => String::new(),
            false => format!(",\"translation\":[{:?},{:?},{:?}]", origin.x, origin.y, origin.z),
        };
        let (color, color_view, color_accessor) = match mesh.colors {
            None => Default::default(),
            Some(_) => (
                ",\"COLOR_0\":2",
                format!(
                    ",{{\"buffer\":0,\"byteOffset\":{},\"byteLength\":{},\"byteStride\":4,\"target\":34962}}",
                    self.position_bytes + self.index_bytes,
                    self.color_bytes
                ),
                format!(
                    ",{{\"bufferView\":2,\"componentType\":5121,\"normalized\":true,\"count\":{vertices},\"type\":\"VEC4\"}}"
                ),
            ),
        };
        format!(
            "{{\"asset\":{{\"version\":\"2.0\",\"generator\":\"isoclay\"}},\"scene\":0,\"scenes\":[{{\"nodes\":[0]}}],\
             \"nodes\":[{{\"mesh\":0{place}}}],\
             \"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0{color}}},\"indices\":1,\"mode\":4}}]}}],\
             \"accessors\":[{{\"bufferView\":0,\"componentType\":5126,\"count\":{vertices},\"type\":\"VEC3\",\
             \"min\":{},\"max\":{}}},\
             {{\"bufferView\":1,\"componentType\":5125,\"count\":{corners},\"type\":\"SCALAR\"}}{color_accessor}],\
             \"bufferViews\":[{{\"buffer\":0,\"byteLength\":{},\"target\":34962}},\
             {{\"buffer\":0,\"byteOffset\":{},\"byteLength\":{},\"target\":34963}}{color_view}],\
             \"buffers\":[{{\"byteLength\":{}{uri}",
            text(self.min),
            text(self.max),
            self.position_bytes,
            self.position_bytes,
            self.index_bytes,
            self.bytes(),
        )
    }

    fn write_buffer(&self, out: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
        let mut bytes = Vec::with_capacity(CHUNK + 16);
        for v in mesh.vertices {
            for x in self.stored(*v).to_array() {
                bytes.extend_from_slice(&x.to_le_bytes());
            }
            spill(out, &mut bytes)?;
        }
        for v in mesh.triangles.iter().flatten() {
            bytes.extend_from_slice(&v.to_le_bytes());
            spill(out, &mut bytes)?;
        }
        for c in mesh.colors.into_iter().flatten() {
            bytes.extend_from_slice(&[c[0], c[1], c[2], 255]);
            spill(out, &mut bytes)?;
        }
        out.write_all(&bytes)
    }
}

/// Bytes of the buffer of a mesh; a binary container counts to 2³² − 1.
pub(in crate::meshes) fn buffer_bytes(mesh: &Mesh) -> u64 {
    12 * (mesh.vertices.len() as u64 + mesh.triangles.len() as u64)
        + mesh.colors.map_or(0, |c| 4 * c.len() as u64)
}

/// Writes a `.glb` file.
pub(in crate::meshes) fn write_binary(out: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    let layout = Layout::of(mesh);
    let mut document = layout.document(mesh, "}]}");
    while !document.len().is_multiple_of(4) {
        document.push(' ');
    }
    let buffer = layout.bytes();
    let total = 12 + 8 + document.len() + 8 + buffer;
    out.write_all(b"glTF\x02\0\0\0")?;
    out.write_all(&(total as u32).to_le_bytes())?;
    out.write_all(&(document.len() as u32).to_le_bytes())?;
    out.write_all(b"JSON")?;
    out.write_all(document.as_bytes())?;
    out.write_all(&(buffer as u32).to_le_bytes())?;
    out.write_all(b"BIN\0")?;
    layout.write_buffer(out, mesh)
}

/// Writes a `.gltf` file with its buffer in it.
pub(in crate::meshes) fn write_text(out: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    let layout = Layout::of(mesh);
    let document = layout.document(mesh, ",\"uri\":\"data:application/octet-stream;base64,");
    out.write_all(document.as_bytes())?;
    let mut encoder = EncoderWriter::new(&mut *out, &STANDARD);
    layout.write_buffer(&mut encoder, mesh)?;
    encoder.finish()?;
    drop(encoder);
    out.write_all(b"\"}]}\n")
}
