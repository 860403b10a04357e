//! Wavefront OBJ: the shortest digits that give the number back.

use std::io::{self, Write};

use crate::meshes::mesh::{CHUNK, Mesh, needs_double, spill};

pub(crate) fn write(out: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    let double = needs_double(mesh.vertices);
    let mut bytes = Vec::with_capacity(CHUNK + 256);
    bytes.extend_from_slice(b"# isoclay\n");
    let mut digits = zmij::Buffer::new();
    for p in mesh.vertices {
        bytes.push(b'v');
        for x in p.to_array() {
            bytes.push(b' ');
            let text = if double {
                digits.format(x)
            } else {
                digits.format(x as f32)
            };
            bytes.extend_from_slice(text.as_bytes());
        }
        bytes.push(b'\n');
        spill(out, &mut bytes)?;
    }
    let mut digits = itoa::Buffer::new();
    for t in mesh.triangles {
        bytes.push(b'f');
        for v in t {
            bytes.push(b' ');
            bytes.extend_from_slice(digits.format(u64::from(*v) + 1).as_bytes());
        }
        bytes.push(b'\n');
        spill(out, &mut bytes)?;
    }
    out.write_all(&bytes)
}
