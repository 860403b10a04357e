//! 3MF out: a package of one object.

use std::io::{self, Cursor, Write};

use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use crate::Unit;
use crate::meshes::mesh::{CHUNK, Mesh, needs_double, spill};

const TYPES: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
    <Types xmlns=\"http://schemas.openxmlformats.org/package/2006/content-types\">\
    <Default Extension=\"rels\" ContentType=\"application/vnd.openxmlformats-package.relationships+xml\"/>\
    <Default Extension=\"model\" ContentType=\"application/vnd.ms-package.3dmanufacturing-3dmodel+xml\"/></Types>\n";
const RELATIONSHIPS: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
    <Relationships xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\">\
    <Relationship Id=\"rel0\" Target=\"/3D/3dmodel.model\" \
    Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>\n";

/// Writes the package; it is gathered in memory, since a package is finished at its start.
pub(in crate::meshes) fn write(out: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    let mut package = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().large_file(mesh.triangles.len() > 20_000_000);
    for (name, content) in [("[Content_Types].xml", TYPES), ("_rels/.rels", RELATIONSHIPS)] {
        package.start_file(name, options)?;
        package.write_all(content.as_bytes())?;
    }
    package.start_file("3D/3dmodel.model", options)?;
    write_model(&mut package, mesh)?;
    out.write_all(package.finish()?.get_ref())
}

fn write_model(out: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    let unit = match mesh.unit {
        Unit::Micrometre => "micron",
        Unit::Centimetre => "centimeter",
        Unit::Metre => "meter",
        Unit::Millimetre | Unit::Unknown => "millimeter",
    };
    write!(
        out,
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<model unit=\"{unit}\" xml:lang=\"en-US\" \
         xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\">\n<resources><object id=\"1\" \
         type=\"model\"><mesh><vertices>\n"
    )?;
    let double = needs_double(mesh.vertices);
    let mut bytes = Vec::with_capacity(CHUNK + 256);
    let mut digits = zmij::Buffer::new();
    for v in mesh.vertices {
        bytes.extend_from_slice(b"<vertex");
        for (key, x) in [" x=\"", " y=\"", " z=\""].into_iter().zip(v.to_array()) {
            bytes.extend_from_slice(key.as_bytes());
            let text = if double {
                digits.format(x)
            } else {
                digits.format(x as f32)
            };
            bytes.extend_from_slice(text.as_bytes());
            bytes.push(b'"');
        }
        bytes.extend_from_slice(b"/>\n");
        spill(out, &mut bytes)?;
    }
    bytes.extend_from_slice(b"</vertices><triangles>\n");
    let mut digits = itoa::Buffer::new();
    for t in mesh.triangles {
        bytes.extend_from_slice(b"<triangle");
        for (key, v) in [" v1=\"", " v2=\"", " v3=\""].into_iter().zip(t) {
            bytes.extend_from_slice(key.as_bytes());
            bytes.extend_from_slice(digits.format(*v).as_bytes());
            bytes.push(b'"');
        }
        bytes.extend_from_slice(b"/>\n");
        spill(out, &mut bytes)?;
    }
    bytes.extend_from_slice(
        b"</triangles></mesh></object></resources>\n<build><item objectid=\"1\"/></build></model>\n",
    );
    out.write_all(&bytes)
}
