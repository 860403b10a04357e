//! VRML97 out: one `IndexedFaceSet`, with the shortest digits that give the numbers back.

use std::io::{self, Write};

use crate::meshes::mesh::{CHUNK, Mesh, needs_double, spill};

pub(in crate::meshes) fn write(out: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    let double = needs_double(mesh.vertices);
    let mut bytes = Vec::with_capacity(CHUNK + 256);
    bytes.extend_from_slice(
        b"#VRML V2.0 utf8\n# isoclay\nShape {\n appearance Appearance { material Material { } }\n \
          geometry IndexedFaceSet {\n  coord Coordinate { point [\n",
    );
    let mut digits = zmij::Buffer::new();
    for p in mesh.vertices {
        for x in p.to_array() {
            let text = if double {
                digits.format(x)
            } else {
                digits.format(x as f32)
            };
            bytes.extend_from_slice(text.as_bytes());
            bytes.push(b' ');
        }
        bytes.push(b'\n');
        spill(out, &mut bytes)?;
    }
    bytes.extend_from_slice(b"] }\n  coordIndex [\n");
    let mut digits = itoa::Buffer::new();
    for t in mesh.triangles {
        for v in t {
            bytes.extend_from_slice(digits.format(*v).as_bytes());
            bytes.push(b' ');
        }
        bytes.extend_from_slice(b"-1\n");
        spill(out, &mut bytes)?;
    }
    bytes.extend_from_slice(b"]\n }\n}\n");
    out.write_all(&bytes)
}
