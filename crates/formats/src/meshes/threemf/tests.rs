use std::io::Write;

use glam::DVec3;
use zip::write::SimpleFileOptions;

use super::*;
use crate::ReadLimits;
use crate::meshes::{self, MeshFormat, TriangleMesh};

const LIMITS: ReadLimits = ReadLimits { max_bytes: 1 << 20 };
const RELS: &str =
    "<Relationships><Relationship Target=\"/3D/3dmodel.model\" Type=\"http://x/3dmodel\"/></Relationships>";

fn package(parts: &[(&str, &str)]) -> Vec<u8> {
    let mut out = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, text) in [("_rels/.rels", RELS)].iter().chain(parts) {
        out.start_file(*name, SimpleFileOptions::default()).unwrap();
        out.write_all(text.as_bytes()).unwrap();
    }
    out.finish().unwrap().into_inner()
}

const TETRAHEDRON: &str = "<mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/><vertex x=\"1\" y=\"0\" z=\"0\"/>\
    <vertex x=\"0\" y=\"1\" z=\"0\"/><vertex x=\"0\" y=\"0\" z=\"1\"></vertex></vertices><triangles>\
    <triangle v1=\"0\" v2=\"2\" v3=\"1\"/><triangle v1=\"0\" v2=\"1\" v3=\"3\"/>\
    <triangle v1=\"0\" v2=\"3\" v3=\"2\"/><triangle v1=\"1\" v2=\"2\" v3=\"3\"/></triangles></mesh>";

fn model(attributes: &str, resources: &str, build: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?><!-- made by hand --><model {attributes}><resources>{resources}</resources><build>{build}</build></model>"
    )
}

fn read(text: &str) -> Result<TriangleMesh, Fault> {
    meshes::parse_threemf(&package(&[("3D/3dmodel.model", text)]), &LIMITS)
}

fn one(attributes: &str) -> String {
    model(
        attributes,
        &format!("<object id=\"1\">{TETRAHEDRON}</object>"),
        "<item objectid=\"1\"/>",
    )
}

fn volume(mesh: &TriangleMesh) -> f64 {
    let at = |v: u32| mesh.vertices[v as usize];
    mesh.triangles
        .iter()
        .map(|t| at(t[0]).dot(at(t[1]).cross(at(t[2]))) / 6.0)
        .sum()
}

#[test]
fn every_unit_of_the_standard_becomes_millimetres() {
    for (unit, mm) in [
        ("", 1.0),
        ("unit=\"micron\"", 1e-3),
        ("unit=\"millimeter\"", 1.0),
        ("unit=\"centimeter\"", 10.0),
        ("unit=\"inch\"", 25.4),
        ("unit=\"foot\"", 304.8),
        ("unit=\"meter\"", 1000.0),
    ] {
        let mesh = read(&one(unit)).unwrap();
        assert_eq!(
            (mesh.unit, mesh.vertices[1]),
            (Unit::Millimetre, DVec3::X * mm),
            "{unit}"
        );
    }
}

#[test]
fn items_and_components_stand_where_their_transforms_say_and_mirrors_stay_outward() {
    let resources = format!(
        "<object id=\"1\">{TETRAHEDRON}</object><object id=\"2\" type=\"support\">{TETRAHEDRON}</object>\
         <object id=\"3\"><components><component objectid=\"1\" transform=\"0 2 0 -1 0 0 0 0 1 10 20 30\"/>\
         <component objectid=\"2\"/><component objectid=\"1\" transform=\"-1 0 0 0 1 0 0 0 1 0 0 0\"/></components></object>"
    );
    let mesh = read(&model(
        "",
        &resources,
        "<item objectid=\"3\" transform=\"1 0 0 0 1 0 0 0 1 100 0 0\"/>",
    ))
    .unwrap();
    assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (8, 8));
    // x becomes 2 y, y becomes -x.
    assert_eq!(mesh.vertices[1], DVec3::new(110.0, 22.0, 30.0));
    assert_eq!(mesh.vertices[2], DVec3::new(109.0, 20.0, 30.0));
    assert!((volume(&mesh) - 3.0 / 6.0).abs() < 1e-9, "{}", volume(&mesh));
    assert!(mesh.notes[0].contains("1 supports"), "{:?}", mesh.notes);
}

#[test]
fn objects_of_other_parts_and_prefixed_elements_are_read() {
    let space = "xmlns:p=\"http://schemas.microsoft.com/3dmanufacturing/production/2015/06\" requiredextensions=\"p\"";
    let root = model(
        space,
        "<object id=\"2\"><components><component p:path=\"/3D/Objects/a.model\" objectid=\"1\"/></components></object>",
        "<item objectid=\"2\"/>",
    );
    let part = one("")
        .replace('<', "<c:")
        .replace("<c:/", "</c:")
        .replace("<c:?", "<?")
        .replace("<c:!", "<!");
    // Points of slices are flat and belong to another extension.
    let part = part.replace("<c:mesh>", "<s:vertex x=\"1\" y=\"1\"/><c:mesh><vertex x=\"a\"/>");
    let mesh = meshes::parse_threemf(
        &package(&[("3D/3dmodel.model", &root), ("3D/Objects/a.model", &part)]),
        &LIMITS,
    );
    assert_eq!(mesh.unwrap().triangles.len(), 4);
}

#[test]
fn what_is_wrong_is_named() {
    let resources = |r: &str| model("", r, "<item objectid=\"1\"/>");
    let component = |id: u32, of: u32| {
        format!("<object id=\"{id}\"><components><component objectid=\"{of}\"/></components></object>")
    };
    let chain: String = (1..100).map(|i| component(i, i + 1)).collect();
    for (text, part) in [
        (one("unit=\"cubit\""), "unit \"cubit\""),
        (
            one(
                "xmlns:b=\"http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02\" requiredextensions=\"b\"",
            ),
            "extension is \"http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02\"",
        ),
        (one("requiredextensions=\"q\""), "undeclared"),
        (
            one("").replace("v3=\"3\"", "v3=\"4\""),
            "object 1 names vertex 4 of 4",
        ),
        (
            one("").replace("v3=\"3\"", "v3=\"-1\""),
            "\"-1\" is not a whole number",
        ),
        (one("").replace("v3=\"3\"", ""), "\"triangle\" lacks \"v3\""),
        (one("").replace("z=\"1\"", "z=\"up\""), "\"up\" is not a number"),
        (one("").replace("objectid=\"1\"", "objectid=\"8\""), "object 8"),
        (
            one("").replace("objectid=\"1\"", "objectid=\"1\" transform=\"1 2 3\""),
            "twelve numbers",
        ),
        (one("").replace("<item", "<thing"), "0 of 0"),
        (one("").replace("</mesh>", "</mush>"), "XML does not hold"),
        (
            one("").replace("<model", "<!DOCTYPE m [<!ENTITY a \"aaaa\">]><model"),
            "document type",
        ),
        (one("").replace("model", "muddle"), "\"muddle\""),
        (resources(&component(1, 1)), "object 1 is a component of itself"),
        (
            resources(&(component(1, 2) + &component(2, 1))),
            "component of itself",
        ),
        (resources(&(component(1, 1) + &component(1, 1))), "object 1 again"),
        (resources(&chain), "65 deep"),
    ] {
        let e = read(&text).unwrap_err().to_string();
        assert!(e.contains(part), "{part}: {e}");
    }
    let e = meshes::parse_threemf(&package(&[]), &LIMITS)
        .unwrap_err()
        .to_string();
    assert!(e.contains("3D/3dmodel.model"), "{e}");
}

/// Each object holds the next one four times: 4³⁰ instances of nothing.
#[test]
fn components_that_multiply_end_at_a_count() {
    let objects: String = (1..31)
        .map(|i| {
            format!(
                "<object id=\"{i}\"><components>{}</components></object>",
                format!("<component objectid=\"{}\"/>", i + 1).repeat(4)
            )
        })
        .collect();
    let text = model(
        "",
        &format!("{objects}<object id=\"31\"/>"),
        "<item objectid=\"1\"/>",
    );
    let e = read(&text).unwrap_err().to_string();
    assert!(e.contains("object number 1000001"), "{e}");
}

#[test]
fn a_zip_bomb_is_refused_at_the_ceiling() {
    let text = model("", &" ".repeat(4 << 20), "");
    let bomb = package(&[("3D/3dmodel.model", &text)]);
    assert!(bomb.len() < 20_000);
    let e = meshes::parse_threemf(&bomb, &LIMITS).unwrap_err();
    assert!(
        matches!(
            e,
            Fault::Limit {
                what: "the XML, inflated",
                ..
            }
        ),
        "{e}"
    );
}

#[test]
fn what_is_written_comes_back_with_its_unit_and_all_digits_where_they_count() {
    for (offset, unit) in [
        (DVec3::ZERO, Unit::Millimetre),
        (DVec3::new(5.4e6, 3.5e5, 12.0), Unit::Millimetre),
        (DVec3::ZERO, Unit::Micrometre),
        (DVec3::ZERO, Unit::Metre),
    ] {
        let mut mesh = read(&one("")).unwrap();
        mesh.vertices.iter_mut().for_each(|v| *v += offset);
        mesh.unit = unit;
        let mut bytes = Vec::new();
        meshes::write(&mut bytes, &mesh.as_mesh(), MeshFormat::ThreeMf).unwrap();
        assert!(looks_like_3mf(&bytes) || bytes.starts_with(b"PK"));
        let back = meshes::parse_threemf(&bytes, &LIMITS).unwrap();
        mesh.to_mm(unit).ok();
        let scale = unit.in_mm().unwrap();
        for (a, b) in back.vertices.iter().zip(&mesh.vertices) {
            assert_eq!(*a, *b * scale);
        }
        assert_eq!(back.triangles, mesh.triangles);
    }
}

#[test]
fn a_package_cut_anywhere_is_refused() {
    let bytes = package(&[("3D/3dmodel.model", &one(""))]);
    for length in 0..bytes.len() {
        assert!(
            meshes::parse_threemf(&bytes[..length], &LIMITS).is_err(),
            "{length}"
        );
    }
}
