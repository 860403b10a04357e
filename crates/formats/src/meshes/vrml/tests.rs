use glam::DVec3;

use super::*;
use crate::ReadLimits;
use crate::meshes::{self, MeshFormat, TriangleMesh};

const LIMITS: ReadLimits = ReadLimits { max_bytes: 1 << 20 };

fn read(body: &str) -> Result<TriangleMesh, Fault> {
    meshes::parse_vrml(format!("#VRML V2.0 utf8\n{body}").as_bytes(), &LIMITS)
}

const SQUARE: &str =
    "IndexedFaceSet { coord Coordinate { point [ 0 0 0, 1 0 0, 1 1 0, 0 1 0 ] } coordIndex [ 0 1 2 3 -1 ] }";

fn shape(geometry: &str) -> String {
    format!(
        "Shape {{ appearance Appearance {{ material Material {{ diffuseColor 1 0 0 }} }} geometry {geometry} }}"
    )
}

fn normals(mesh: &TriangleMesh) -> Vec<DVec3> {
    let at = |v: u32| mesh.vertices[v as usize];
    mesh.triangles
        .iter()
        .map(|t| (at(t[1]) - at(t[0])).cross(at(t[2]) - at(t[0])).normalize())
        .collect()
}

#[test]
fn polygons_end_at_minus_one_and_turn_as_ccw_says() {
    let mesh = read(&shape(SQUARE)).unwrap();
    assert_eq!(
        (mesh.triangles.len(), mesh.face_count, mesh.unit),
        (2, 1, crate::Unit::Unknown)
    );
    assert_eq!(normals(&mesh), [DVec3::Z; 2]);
    let turned = read(&shape(
        &SQUARE.replace("coordIndex", "ccw FALSE solid TRUE creaseAngle 0.5 coordIndex"),
    ))
    .unwrap();
    assert_eq!(normals(&turned), [DVec3::NEG_Z; 2]);
    let both = SQUARE.replace("0 1 2 3 -1", "0,1,2,-1,-1,2,3,0");
    assert_eq!(read(&shape(&both)).unwrap().face_count, 2);
    let colored = SQUARE.replace(
        "coordIndex",
        "color Color { color [ 1 0 0 ] } colorIndex [ 0 0 0 0 -1 ] coordIndex",
    );
    assert_eq!(read(&shape(&colored)).unwrap().triangles.len(), 2);
}

#[test]
fn transforms_apply_in_the_order_of_the_standard_wherever_their_fields_stand() {
    let text = format!(
        "DEF Top Transform {{ children [ DEF S {} Group {{ children USE S }} ] translation 10 0 0 # \"brace {{\n \
         rotation 0 0 2 1.5707963267948966 scale 2 1 1 center 1 0 0 }} Transform {{ scale -1 1 1 children USE S }}",
        shape(SQUARE)
    );
    let mesh = read(&text).unwrap();
    assert_eq!((mesh.face_count, mesh.vertices.len()), (3, 12));
    // (1, 1, 0): from the centre (0, 1), stretched (0, 1), turned (-1, 0), back (0, 0), moved (10, 0).
    assert!(
        (mesh.vertices[2] - DVec3::new(10.0, 0.0, 0.0)).length() < 1e-15,
        "{}",
        mesh.vertices[2]
    );
    // (0, 0, 0): (-1, 0), (-2, 0), (0, -2), (1, -2), (11, -2).
    assert!((mesh.vertices[0] - DVec3::new(11.0, -2.0, 0.0)).length() < 1e-15);
    assert!(normals(&mesh).iter().all(|n| n.z > 0.999), "mirrors stay outward");
}

#[test]
fn coordinates_are_shared_and_switches_show_one_child() {
    let shared = format!(
        "{} {}",
        shape(&SQUARE.replace("coord Coord", "coord DEF C Coord")),
        shape("IndexedFaceSet { coordIndex [ 0 2 1 -1 ] coord USE C }")
    );
    assert_eq!(read(&shared).unwrap().face_count, 2);
    for (node, faces) in [
        ("Switch { whichChoice 1 choice [ Group { } X ] }", Some(1)),
        ("Switch { choice [ X ] whichChoice 0 }", Some(1)),
        ("Switch { choice [ X ] }", None),
        ("Switch { whichChoice 7 choice [ X ] }", None),
        ("LOD { level [ X, X ] range [ 5 ] }", Some(1)),
    ] {
        let mesh = read(&node.replace('X', &shape(SQUARE)));
        assert_eq!(mesh.ok().map(|m| m.face_count), faces, "{node}");
    }
}

#[test]
fn what_is_left_out_is_named() {
    let text = format!(
        "WorldInfo {{ title \"a \\\" }} title\" info [ \"b\" ] }} PROTO P [ field SFVec3f a 0 0 0 ] {{ Group {{ }} }} \
         EXTERNPROTO Q [ ] [ \"x.wrl\" ] {} {} Script {{ url \"javascript: {{\" }} ROUTE a.b TO c.d P {{ a 1 2 3 }}",
        shape(SQUARE),
        shape("Sphere { radius 2 }")
    );
    let mesh = read(&text).unwrap();
    assert_eq!(mesh.triangles.len(), 2);
    assert_eq!(mesh.notes, ["not read and left out: PROTO, Sphere"]);
}

#[test]
fn faults_name_the_line() {
    for (text, part) in [
        (
            shape(&SQUARE.replace("1 1 0", "1 x 0")),
            "line 2: \"x\" is not a number",
        ),
        (shape(&SQUARE.replace("2 3", "2\n-3")), "line 3: index \"-3\""),
        (shape(&SQUARE.replace("2 3", "2 4")), "index 4 with 4 points"),
        (
            shape("IndexedFaceSet { coordIndex [ 0 1 2 ] }"),
            "index 0 with 0 points",
        ),
        (
            shape(&SQUARE.replace("0 1 0 ]", "0 1 ]")),
            "CloseList where a number",
        ),
        ("Group { children USE A }".into(), "USE of \"A\""),
        ("DEF A Group { children USE A }".into(), "USE of \"A\""),
        ("Group".into(), "body of a node"),
        ("Group [".into(), "no \"{\" after \"Group\""),
        ("Group { children [".into(), "end of a node"),
        ("}".into(), "outside of any node"),
        ("PROTO X { }".into(), "prototype"),
        (shape("Sphere { }"), "0 of 0"),
    ] {
        let e = read(&text).unwrap_err().to_string();
        assert!(e.contains(part), "{part}: {e}");
    }
    let e = meshes::parse_vrml(b"#VRML V1.0 ascii\nSeparator { }", &LIMITS)
        .unwrap_err()
        .to_string();
    assert!(e.contains("#VRML V1.0 ascii") && e.contains("VRML97"), "{e}");
}

#[test]
fn nesting_and_multiplied_use_end_at_a_count() {
    let deep = "Group { children ".repeat(100_000);
    assert!(read(&deep).unwrap_err().to_string().contains("201 deep"));
    let skipped = format!("Material {}", "{".repeat(100_000));
    assert!(read(&skipped).is_err());
    let doubled: String = (1..60)
        .map(|i| format!("DEF N{i} Group {{ children [ USE N{0} USE N{0} ] }} ", i - 1))
        .collect();
    let e = read(&format!("DEF N0 Group {{ }} {doubled}"))
        .unwrap_err()
        .to_string();
    assert!(e.contains("above 1000000"), "{e}");
}

#[test]
fn what_is_written_comes_back() {
    for offset in [DVec3::ZERO, DVec3::new(5.4e6, 3.5e5, 0.125)] {
        let mut mesh = read(&shape(SQUARE)).unwrap();
        mesh.vertices.iter_mut().for_each(|v| *v += offset);
        let mut bytes = Vec::new();
        meshes::write(&mut bytes, &mesh.as_mesh(), MeshFormat::Vrml).unwrap();
        let back = meshes::parse_vrml(&bytes, &LIMITS).unwrap();
        assert_eq!((back.vertices, back.triangles), (mesh.vertices, mesh.triangles));
    }
}
