//! Binary STL.

use std::io::{self, Write};

use glam::DVec3;

use crate::meshes::mesh::{CHUNK, Mesh, spill};

pub(in crate::meshes) fn write(out: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    // The text must not start with "solid": readers would take the file for an ascii one.
    let mut header = [b' '; 80];
    header[..18].copy_from_slice(b"binary STL isoclay");
    out.write_all(&header)?;
    out.write_all(&(mesh.triangles.len() as u32).to_le_bytes())?;
    let mut bytes = Vec::with_capacity(CHUNK + 64);
    for t in mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let mut row = [0; 50];
        for (slot, v) in [normal, a, b, c].into_iter().enumerate() {
            put(&mut row[12 * slot..], v);
        }
        bytes.extend_from_slice(&row);
        spill(out, &mut bytes)?;
    }
    out.write_all(&bytes)
}

fn put(row: &mut [u8], v: DVec3) {
    for (i, x) in v.to_array().into_iter().enumerate() {
        row[4 * i..4 * i + 4].copy_from_slice(&(x as f32).to_le_bytes());
    }
}
