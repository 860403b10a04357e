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
         EXTERNPROTO Q [ ] [ \"x.wrl\" ] {} {} Script {{ url \"javascript: {{\" }} ROUTE a.b TO c.d P {{ a 1 2 3 }} Inline {{ }}",
        shape(SQUARE),
        shape("ElevationGrid { height [ 1 2 ] }")
    );
    let mesh = read(&text).unwrap();
    assert_eq!(mesh.triangles.len(), 2);
    assert_eq!(
        mesh.notes,
        ["not read and left out: EXTERNPROTO, ElevationGrid, Inline"]
    );
    let e = read(&shape("ElevationGrid { height [ 1 2 ] }"))
        .unwrap_err()
        .to_string();
    assert!(e.contains("geometry of the world is ElevationGrid"), "{e}");
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
        (shape(&SQUARE.replace("0 1 0 ]", "0 1 ]")), "\"]\" where a number"),
        ("Group { children USE A }".into(), "USE of \"A\""),
        ("DEF A Group { children USE A }".into(), "USE of \"A\""),
        ("Group".into(), "body of a node"),
        ("Group [".into(), "no \"{\" after \"Group\""),
        ("Group { children [".into(), "end of a node"),
        ("}".into(), "outside of any node"),
        ("PROTO X { }".into(), "prototype without its fields"),
        (shape("Sphere { radius -1 }"), "Sphere of length -1"),
        (shape("Box { size 1 nan 1 }"), "Box of length NaN"),
        (shape("Cone { heigth 1 }"), "\"heigth\" in a Cone"),
        ("PROTO P [ ] { } P { a 1 }".into(), "no field \"a\""),
        ("PROTO P [ field SFThing a ] { }".into(), "type \"SFThing\""),
        ("PROTO P [ field SFString a 1 ] { }".into(), "\"1\" as the value"),
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

/// Every node is used by the next one: as deep as the file is long, which is no matter of the stack.
#[test]
fn chains_of_use_are_walked_without_recursion() {
    let chain: String = (1..=100_000)
        .map(|i| format!("DEF N{i} Group {{ children USE N{} }} ", i - 1))
        .collect();
    let text = format!("#VRML V2.0 utf8\nDEF N0 {} {chain}", shape(SQUARE));
    let e = meshes::parse_vrml(text.as_bytes(), &ReadLimits { max_bytes: 1 << 28 }).unwrap_err();
    // Each root is walked anew: the chain of 1 412 is the last whole one.
    assert!(e.to_string().contains("above 1000000"), "{e}");
    let hidden = format!(
        "#VRML V2.0 utf8\nSwitch {{ choice [ DEF N0 {} {chain} ] }} USE N100000",
        shape(SQUARE)
    );
    let mesh = meshes::parse_vrml(hidden.as_bytes(), &ReadLimits { max_bytes: 1 << 28 }).unwrap();
    assert_eq!(mesh.face_count, 1);
}

/// The volume by the divergence theorem, and whether every edge runs once each way.
fn volume_if_closed(mesh: &TriangleMesh) -> Option<f64> {
    let at = |v: u32| mesh.vertices[v as usize];
    let mut edges = std::collections::BTreeMap::new();
    for t in &mesh.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            *edges.entry((a.min(b), a.max(b))).or_insert(0) += if a < b { 1 } else { -1 };
        }
    }
    let six: f64 = mesh
        .triangles
        .iter()
        .map(|t| at(t[0]).dot(at(t[1]).cross(at(t[2]))))
        .sum();
    edges.values().all(|n| *n == 0).then_some(six / 6.0)
}

#[test]
fn primitives_are_closed_outward_and_of_their_volume() {
    use std::f64::consts::PI;
    for (geometry, volume, faces) in [
        ("Box { }", 8.0, 6),
        ("Box { size 1 2 3 }", 6.0, 6),
        ("Sphere { radius 2 }", 32.0 * PI / 3.0, 64 * 32),
        ("Cone { bottomRadius 2 height 3 }", 4.0 * PI, 65),
        ("Cylinder { radius 0.5 height 4 }", PI, 66),
    ] {
        let mesh = read(&shape(geometry)).unwrap();
        let found = volume_if_closed(&mesh).expect("a closed surface");
        // A polygon of 64 sides fills 1 − 1.6e-3 of its circle; the sphere loses as much along each of three axes.
        assert!(
            found <= volume * (1.0 + 1e-12) && found > volume * (1.0 - 5e-3),
            "{geometry}: {found} of {volume}"
        );
        assert_eq!(mesh.face_count, faces, "{geometry}");
        assert_eq!(mesh.notes.len(), usize::from(!geometry.starts_with("Box")));
    }
    let cup = read(&shape("Cylinder { top FALSE }")).unwrap();
    assert_eq!(cup.face_count, 65);
    assert!(
        cup.vertices
            .iter()
            .all(|v| v.y.abs() == 1.0 && (v.x.hypot(v.z) - 1.0).abs() < 1e-15)
    );
}

/// What a switch or a level of detail hides was counted, and what is used twice was counted once.
#[test]
fn round_things_are_counted_where_they_are_placed() {
    let ball = shape("Sphere { }");
    let counted = |body: String| read(&body).unwrap().notes.concat();
    let hidden = format!("LOD {{ level [ {} {ball} ] }}", shape("Box { }"));
    assert_eq!(counted(hidden), "");
    assert!(
        counted(format!(
            "DEF A {ball} Transform {{ translation 5 0 0 children USE A }}"
        ))
        .ends_with(": 2")
    );
}

#[test]
fn prototypes_stand_for_the_first_node_of_their_body_with_the_fields_of_the_instance() {
    let wheel = format!(
        "PROTO Wheel [ field SFVec3f at 5 0 0 exposedField SFNode form {0} field SFFloat size 1 eventIn SFBool go \
         field MFString names [ \"IS\" ] ] {{ Transform {{ translation IS at scale 1 1 1 set_go IS go children [ \
         Shape {{ geometry IS form }} ] }} {1} }}",
        SQUARE,
        shape(SQUARE)
    );
    let start = |body: &str| {
        let mesh = read(&format!("{wheel} {body}")).unwrap();
        (mesh.face_count, mesh.vertices[0])
    };
    assert_eq!(start("Wheel { }"), (1, DVec3::X * 5.0));
    assert_eq!(
        start("Group { children [ Wheel { at 0 7 0 names [ ] } Wheel { } ] }"),
        (2, DVec3::Y * 7.0)
    );
    // A value in a value, a name of the file in a field, and a prototype in a prototype.
    let sized = "PROTO Two [ field SFVec3f here 1 1 1 field MFNode more [ ] ] { Group { children [ Wheel { at IS here } \
                 DEF A Wheel { at IS here } USE A Group { children IS more } ] } } DEF A Group { } \
                 Two { here 2 0 0 more [ USE A DEF B Wheel { } ] } USE B";
    assert_eq!(start(sized), (5, DVec3::X * 2.0));
    // Points and indices out of fields, as some exporters of parts write them.
    let table = "PROTO Net [ field MFVec3f p [ ] field MFInt32 i [ ] ] { IndexedFaceSet { coord Coordinate { point IS p } \
                 coordIndex IS i } } Shape { geometry Net { i [ 0 1 2 -1 ] p [ 0 0 0, 1 0 0, 0 1 3 ] } }";
    assert_eq!(read(table).unwrap().vertices[2], DVec3::new(0.0, 1.0, 3.0));
}

#[test]
fn prototypes_end_however_they_hold_each_other() {
    let e = read("PROTO A [ ] { A { } } A { }").unwrap_err().to_string();
    assert!(e.contains("201 deep"), "{e}");
    // Each holds the one before twice: 2⁶⁰ bodies.
    let doubled: String = (1..60)
        .map(|i| {
            format!(
                "PROTO P{i} [ ] {{ Group {{ children [ P{0} {{ }} P{0} {{ }} ] }} }} ",
                i - 1
            )
        })
        .collect();
    let text = format!("#VRML V2.0 utf8\nPROTO P0 [ ] {{ Group {{ }} }} {doubled} P59 {{ }}");
    for (max_bytes, part) in [(1 << 20, "ceiling"), (1 << 40, "prototypes, each use counted")] {
        let e = meshes::parse_vrml(text.as_bytes(), &ReadLimits { max_bytes }).unwrap_err();
        assert!(e.to_string().contains(part), "{e}");
    }
}

#[test]
fn files_beside_the_document_are_inlined_and_no_others() {
    let directory = tempfile::tempdir().unwrap();
    let write = |name: &str, body: &str| {
        let path = directory.path().join(name);
        std::fs::write(&path, format!("#VRML V2.0 utf8\n{body}")).unwrap();
        path
    };
    let read = |path: &Path| meshes::read(path, &LIMITS).map_err(|e| e.to_string());
    write("part.wrl", &shape(SQUARE));
    write(
        "half.wrl",
        "Transform { translation 1 0 0 children Inline { url [ \"part.wrl\" ] } }",
    );
    let top = write(
        "top.wrl",
        "Transform { translation 0 2 0 children Inline { url [ \"http://x.org/half.wrl\", \"half.wrl\" ] } }",
    );
    assert_eq!(read(&top).unwrap().vertices[0], DVec3::new(1.0, 2.0, 0.0));
    for (url, part) in [
        ("\"../top.wrl\"", "an inlined file is \"../top.wrl\""),
        ("\"http://x.org/a.wrl\"", "http://x.org/a.wrl"),
        ("\"none.wrl\"", "in none.wrl: opening failed"),
        ("\"loop.wrl\"", "9 deep"),
        ("[ ]", "without an address"),
    ] {
        let e = read(&write("loop.wrl", &format!("Inline {{ url {url} }}"))).unwrap_err();
        assert!(e.contains(part), "{part}: {e}");
    }
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
