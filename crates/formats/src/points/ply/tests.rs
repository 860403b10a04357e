use glam::DVec3;

use super::*;
use crate::points::NormalSource;

fn read(bytes: &[u8]) -> Result<PointCloud, Fault> {
    parse_ply(bytes, &ReadLimits::default())
}

/// The same content in three encodings: properties of every type in a strange order, an element before and one
/// after, a list in between.
fn sample(encoding: &str) -> Vec<u8> {
    let mut file = format!(
        "ply\nformat {encoding} 1.0\ncomment strange on purpose\nelement extra 2\nproperty list ushort short ids\n\
         element vertex 4\nproperty uchar red\nproperty short z\nproperty double x\nproperty float nx\n\
         property int y\nproperty char quality\nproperty float ny\nproperty float nz\nproperty uint id\n\
         element face 2\nproperty float area\nproperty list uint8 uint32 vertex_index\nelement nothing 7\n\
         end_header\n"
    )
    .into_bytes();
    let mut put = |value: f64, kind: Scalar| {
        if encoding == "ascii" {
            file.extend(format!("{value} ").bytes());
            return;
        }
        macro_rules! raw {
            ($t:ty) => {
                if encoding.contains("big") {
                    file.extend((value as $t).to_be_bytes())
                } else {
                    file.extend((value as $t).to_le_bytes())
                }
            };
        }
        match kind {
            I8 => raw!(i8),
            U8 => raw!(u8),
            I16 => raw!(i16),
            U16 => raw!(u16),
            I32 => raw!(i32),
            U32 => raw!(u32),
            F32 => raw!(f32),
            F64 => raw!(f64),
        }
    };
    use Scalar::*;
    for ids in [&[1.0, -2.0, 300.0][..], &[]] {
        put(ids.len() as f64, U16);
        ids.iter().for_each(|i| put(*i, I16));
    }
    for i in 0..4 {
        let i = f64::from(i);
        put(255.0, U8);
        put(-300.0 - i, I16);
        put(0.1 + i, F64);
        put(0.0, F32);
        put(100_000.0 * i * i, I32);
        put(-5.0, I8);
        put(0.0, F32);
        put(2.0 - i, F32);
        put(4e9, U32);
    }
    for face in [[0.0, 1.0, 2.0], [2.0, 1.0, 3.0]] {
        put(0.5, F32);
        put(3.0, U8);
        face.iter().for_each(|v| put(*v, U32));
    }
    file
}

#[test]
fn all_encodings_types_and_orders_give_the_same_cloud() {
    let clouds = ["ascii", "binary_little_endian", "binary_big_endian"].map(|e| read(&sample(e)).unwrap());
    assert_eq!(clouds[0].positions[3], DVec3::new(3.1, 900_000.0, -303.0));
    assert_eq!(
        clouds[0].normals.as_ref().unwrap()[..],
        [DVec3::Z, DVec3::Z, DVec3::ZERO, DVec3::NEG_Z]
    );
    assert_eq!((clouds[0].zero_normals, clouds[0].face_count), (1, 2));
    assert_eq!(clouds[0].normal_source, NormalSource::Stored);
    assert_eq!(clouds[0], clouds[1]);
    assert_eq!(clouds[1], clouds[2]);
}

#[test]
fn a_sample_cut_anywhere_is_refused() {
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let bytes = sample(encoding);
        let whole = bytes.len() - usize::from(encoding == "ascii");
        for length in 0..whole {
            // Digits that are cut off leave a number in text; not a point too few.
            match read(&bytes[..length]) {
                Err(e) => assert!(!e.to_string().is_empty()),
                Ok(c) => assert!(encoding == "ascii" && length == whole - 1 && c.positions.len() == 4),
            }
        }
    }
}

/// A vertex list inside of a vertex: rows of no fixed length.
#[test]
fn lists_among_the_coordinates_are_skipped() {
    let mut file = b"ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\n\
        property list uchar uchar skip\nproperty float y\nproperty float z\nend_header\n"
        .to_vec();
    for (i, skip) in [(1.0f32, &[9u8, 9, 9][..]), (2.0, &[])] {
        file.extend(i.to_le_bytes());
        file.push(skip.len() as u8);
        file.extend(skip);
        file.extend((i * 10.0).to_le_bytes());
        file.extend((i * 100.0).to_le_bytes());
    }
    assert_eq!(read(&file).unwrap().positions[1], DVec3::new(2.0, 20.0, 200.0));
}

#[test]
fn properties_that_are_not_taken_are_named() {
    let file = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float nx\nproperty float y\nproperty float z\n\
                property uchar red\nproperty list uchar int seen\nend_header\n1 0 2 3 255 1 7\n";
    let cloud = read(file.as_bytes()).unwrap();
    assert_eq!(
        cloud.left_out_attributes,
        ["nx", "red", "seen"],
        "nx alone is no normal"
    );
    let plain = read(&ascii(4, "", SQUARE)).unwrap();
    assert!(plain.left_out_attributes.is_empty());
}

#[test]
fn names_in_other_letters_and_long_names_of_normals_are_known() {
    let file = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float normal_x\nproperty float normal_y\nproperty float normal_z\n\
                property float X\nproperty float Y\nproperty float Z\nend_header\n0 0 1 1 2 3\n0 1 0 4 5 6\n";
    let cloud = read(file.as_bytes()).unwrap();
    assert_eq!(
        cloud.positions,
        [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)]
    );
    assert_eq!(cloud.normals.as_deref(), Some(&[DVec3::Z, DVec3::Y][..]));
    assert!(cloud.left_out_attributes.is_empty());
}

fn ascii(vertices: u64, rest: &str, body: &str) -> Vec<u8> {
    format!(
        "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
         property float z\n{rest}end_header\n{body}"
    )
    .into_bytes()
}

const FACES: &str = "element face 1\nproperty list uchar int vertex_indices\n";
const SQUARE: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

#[test]
fn polygons_and_strips_give_normals() {
    let quad = read(&ascii(4, FACES, &format!("{SQUARE}4 0 1 2 3\n"))).unwrap();
    assert_eq!(quad.normals.as_deref(), Some(&[DVec3::Z; 4][..]));
    assert_eq!(quad.normal_source, NormalSource::Faces);
    let strip = "element tristrips 1\nproperty list int int vertex_indices\n";
    let strip = read(&ascii(4, strip, &format!("{SQUARE}8 0 1 3 2 -1 0 1 2\n"))).unwrap();
    assert_eq!((strip.normals, strip.face_count), (quad.normals, 3));
}

#[test]
fn faces_before_vertices_are_read_too() {
    let file = format!(
        "ply\nformat ascii 1.0\n{FACES}element vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         end_header\n4 0 1 2 3\n{SQUARE}"
    );
    assert_eq!(read(file.as_bytes()).unwrap().normals.unwrap(), [DVec3::Z; 4]);
}

#[test]
fn a_header_that_promises_1e11_points_allocates_nothing() {
    let promise = 100_000_000_000;
    for (file, whole) in [
        (ascii(promise, "", SQUARE), 600_000_000_000u64),
        (
            String::from_utf8(ascii(promise, "", SQUARE))
                .unwrap()
                .replace("ascii", "binary_big_endian")
                .into(),
            12 * promise,
        ),
        (
            ascii(4, &FACES.replace('1', "100000000000"), SQUARE),
            200_000_000_000,
        ),
    ] {
        match read(&file).unwrap_err() {
            Fault::Truncated { needed, found, .. } => {
                assert!(needed == whole && found < 100, "{needed} {found}")
            }
            e => panic!("{e}"),
        }
    }
    // Rows without properties take no bytes: a count of them must cost nothing either.
    let empty = ascii(4, "element nothing 100000000000\n", SQUARE);
    assert_eq!(read(&empty).unwrap().positions.len(), 4);
    // A list that says it is long.
    let long = ascii(4, FACES, &format!("{SQUARE}4000000000 0 1 2\n"));
    assert!(matches!(read(&long), Err(Fault::Truncated { .. })));
}

#[test]
fn content_faults_name_place_value_and_remedy() {
    for (file, part) in [
        (
            ascii(4, FACES, &format!("{SQUARE}3 0 1 4\n")),
            "face 0: vertex index 4 with 4 vertices",
        ),
        (ascii(4, FACES, &format!("{SQUARE}3 0 1 -1\n")), "vertex index -1"),
        (
            ascii(4, FACES, &format!("{SQUARE}3 0 1 1.5\n")),
            "vertex index 1.5",
        ),
        (
            ascii(4, FACES, &format!("{SQUARE}-3 0 1 2\n")),
            "a list has \"-3\" entries",
        ),
        (ascii(1, "", "0 0 here\n"), "line 8: \"here\" is not a number"),
        (ascii(2, "", "0 0 0\nnan 0 0\nx"), ""),
        (ascii(0, "", ""), "0 of 0"),
        (
            b"ply\nformat ascii 1.0\nelement point 1\nend_header\n".to_vec(),
            "[point]",
        ),
        (
            b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n".to_vec(),
            "[x]; a point cloud needs x, y and z",
        ),
    ] {
        match read(&file) {
            Err(e) => assert!(e.to_string().contains(part) && !part.is_empty(), "{part}: {e}"),
            Ok(c) => assert!(part.is_empty() && c.invalid_dropped == 1, "{part}"),
        }
    }
}

#[test]
fn nan_points_take_their_faces_with_them() {
    let body = "0 0 0\n1 0 0\n1 1 0\nnan 1 0\n3 0 1 2\n3 0 2 3\n";
    let c = read(&ascii(4, &FACES.replace("face 1", "face 2"), body)).unwrap();
    assert_eq!(
        (c.positions.len(), c.invalid_dropped, c.unused_vertices),
        (3, 1, 0)
    );
    assert!(c.notes[0].contains("1 of 4 points"), "{:?}", c.notes);
}

#[test]
fn rows_that_the_header_does_not_tell_of_are_told() {
    let normals = "property float nx\nproperty float ny\nproperty float nz\n";
    for (rows, is_told) in [(4, false), (5, true), (40, true)] {
        let c = read(&ascii(4, normals, &"0 0 0 1 2 3\n".repeat(rows))).unwrap();
        assert_eq!(c.positions.len(), 4);
        let told = c.notes.iter().any(|n| n.contains("behind the last row"));
        assert_eq!(told, is_told, "{rows}: {:?}", c.notes);
    }
}

#[test]
fn the_ceiling_holds_for_points_and_for_faces() {
    let body = "0 0 0 1 2 3\n".repeat(1000);
    let normals = "property float nx\nproperty float ny\nproperty float nz\n";
    let file = ascii(1000, normals, &body);
    assert!(matches!(
        parse_ply(&file, &ReadLimits { max_bytes: 47_999 }),
        Err(Fault::Limit {
            what: "points",
            needed: 48_000,
            ..
        })
    ));
    assert!(parse_ply(&file, &ReadLimits { max_bytes: 48_000 }).is_ok());
    let corners = "0 ".repeat(5000);
    let file = ascii(4, FACES, &format!("{SQUARE}5000 {corners}"));
    assert!(matches!(
        parse_ply(&file, &ReadLimits { max_bytes: 20_000 }),
        Err(Fault::Limit {
            what: "the entries of a list",
            ..
        })
    ));
}

/// Coordinates of a survey: `float` in a header of text is no reason to throw digits away.
#[test]
fn ascii_keeps_the_digits_of_a_float() {
    let file = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n\
                5400000.123 3500000.456 -0.001\n";
    let cloud = read(file.as_bytes()).unwrap();
    assert_eq!(cloud.positions, [DVec3::new(5400000.123, 3500000.456, -0.001)]);
}

/// One face of so many corners that reading and cutting it holds many times the file: booked before it is held.
#[test]
fn a_list_without_end_is_booked_before_it_is_held() {
    let corners = 300_000u32;
    let mut file = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
         element face 1\nproperty list uint uchar vertex_indices\nend_header\n"
    .to_vec();
    for v in [0f32, 0., 0., 1., 0., 0., 0., 1., 0.] {
        file.extend(v.to_le_bytes());
    }
    file.extend(corners.to_le_bytes());
    file.extend((0..corners).map(|i| (i % 3) as u8));
    let under = |max_bytes: usize| {
        parse_ply(
            &file,
            &ReadLimits {
                max_bytes: max_bytes as u64,
            },
        )
    };
    // Beside the triangles the entries of the list and the scratch of the cut: 12 + 8 + 72 bytes a corner, doubled lists.
    assert!(matches!(under(60 * corners as usize), Err(Fault::Limit { .. })));
    let plenty = under(200 * corners as usize);
    assert!(!matches!(plenty, Err(Fault::Limit { .. })), "{plenty:?}");
}
