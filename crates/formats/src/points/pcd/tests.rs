use super::*;

const LIMITS: ReadLimits = ReadLimits { max_bytes: 1 << 20 };

fn read(bytes: &[u8]) -> Result<PointCloud, Fault> {
    parse_pcd(bytes, &LIMITS)
}

/// Fields of every kind in a strange order; `z` is a whole number.
const HEADER: &str = "# .PCD v0.7\nVERSION 0.7\nFIELDS normal_z label x z normal_x y normal_y skip\n\
                      SIZE 4 1 8 2 4 4 4 8\nTYPE F U F I F F F U\nCOUNT 1 1 1 1 1 1 1 3\nWIDTH 3\nHEIGHT 1\n\
                      VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA ";
const STRIDE: usize = 4 + 1 + 8 + 2 + 4 + 4 + 4 + 24;

/// The rows of three points, field after field.
fn fields() -> Vec<Vec<Vec<u8>>> {
    let rows = |f: &dyn Fn(i16) -> Vec<u8>| (0..3).map(f).collect::<Vec<_>>();
    vec![
        rows(&|_| 1f32.to_le_bytes().to_vec()),
        rows(&|i| vec![i as u8]),
        rows(&|i| (5_400_000.001 + f64::from(i)).to_le_bytes().to_vec()),
        rows(&|i| (-300 - i).to_le_bytes().to_vec()),
        rows(&|_| 0f32.to_le_bytes().to_vec()),
        rows(&|i| (0.5 * f32::from(i)).to_le_bytes().to_vec()),
        rows(&|_| 0f32.to_le_bytes().to_vec()),
        rows(&|_| vec![7; 24]),
    ]
}

fn binary() -> Vec<u8> {
    let fields = fields();
    let mut bytes = format!("{HEADER}binary\n").into_bytes();
    for row in 0..3 {
        for f in &fields {
            bytes.extend(&f[row]);
        }
    }
    bytes
}

fn compressed() -> Vec<u8> {
    let body: Vec<u8> = fields().into_iter().flatten().flatten().collect();
    assert_eq!(body.len(), 3 * STRIDE);
    // Literal runs alone are LZF, too.
    let packed: Vec<u8> = body
        .chunks(32)
        .flat_map(|c| [&[c.len() as u8 - 1], c].concat())
        .collect();
    let mut bytes = format!("{HEADER}binary_compressed\n").into_bytes();
    bytes.extend((packed.len() as u32).to_le_bytes());
    bytes.extend((body.len() as u32).to_le_bytes());
    bytes.extend(packed);
    bytes
}

fn ascii() -> Vec<u8> {
    let rows: String = (0..3)
        .map(|i| {
            format!(
                "1 {i} {} {} 0 {} 0 7 7 7\n",
                5_400_000.001 + f64::from(i),
                -300 - i,
                0.5 * f64::from(i)
            )
        })
        .collect();
    format!("{HEADER}ascii\n{rows}").into_bytes()
}

#[test]
fn rows_as_text_bytes_and_packed_give_the_same_points() {
    for file in [ascii(), binary(), compressed()] {
        let cloud = read(&file).unwrap();
        assert_eq!(cloud.left_out_attributes, ["label", "skip"]);
        assert_eq!(
            cloud.positions[2],
            DVec3::new(5_400_002.001, 1.0, -302.0),
            "to the last bit"
        );
        assert_eq!(cloud.normals.unwrap(), [DVec3::Z; 3]);
        assert!(cloud.notes.is_empty(), "{:?}", cloud.notes);
    }
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    for file in [ascii(), binary(), compressed()] {
        // The last line needs no end, and digits cut off leave a number.
        let text = file.ends_with(b"7\n");
        for length in 0..file.len() - usize::from(text) {
            assert!(read(&file[..length]).is_err(), "{length} of {}", file.len());
        }
    }
}

#[test]
fn names_of_fields_are_the_same_in_capitals() {
    for file in [ascii(), binary(), compressed()] {
        let at = memchr::memmem::find(&file, b"FIELDS").unwrap() + 6;
        let end = at + memchr::memchr(b'\n', &file[at..]).unwrap();
        let mut loud = file.clone();
        loud[at..end].make_ascii_uppercase();
        let mut loud = read(&loud).unwrap();
        assert_eq!(loud.left_out_attributes, ["LABEL", "SKIP"]);
        loud.left_out_attributes
            .iter_mut()
            .for_each(|n| n.make_ascii_lowercase());
        assert_eq!(loud, read(&file).unwrap());
    }
}

#[test]
fn holes_are_counted_and_a_viewpoint_is_noted() {
    let text = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 2\n\
                VIEWPOINT 1 0 0 1 0 0 0\nPOINTS 4\nDATA ascii\n0 0 0\nnan nan nan\n1 0 0\n1 1 1\n";
    assert!(looks_like_pcd(text.as_bytes()));
    let cloud = read(text.as_bytes()).unwrap();
    assert_eq!((cloud.positions.len(), cloud.invalid_dropped), (3, 1));
    assert!(cloud.notes[0].contains("1 0 0 1 0 0 0"), "{:?}", cloud.notes);
}

#[test]
fn header_and_row_faults_name_line_text_and_remedy() {
    let with = |from: &str, to: &str| {
        String::from_utf8(ascii())
            .unwrap()
            .replacen(from, to, 1)
            .into_bytes()
    };
    let packed = |at: usize, value: u32| {
        let mut file = compressed();
        let start = memchr::memmem::find(&file, b"compressed\n").unwrap() + 11;
        file[start + at..start + at + 4].copy_from_slice(&value.to_le_bytes());
        file
    };
    for (file, part) in [
        (with("SIZE 4 1 8", "SIZE 4 3 8"), "line 4: type \"U\" of \"3\""),
        (with("SIZE 4 1 8", "SIZE 4 8"), "line 4: 7 words for 8 fields"),
        (with("COUNT 1", "COUNT -1"), "line 6: count \"-1\""),
        (with("POINTS 3", "POINTS 4"), "line 11: cannot use"),
        (with("HEIGHT 1", "HEIGHT many"), "line 8: cannot use"),
        (with("DATA ascii", "DATA packed"), "binary_compressed"),
        (with("VERSION", "VERSIONS"), "line 2"),
        (with(" x ", " w "), "a point cloud needs x, y and z"),
        (with("-300", "-3oo"), "line 12: \"-3oo\" is not a number"),
        (with("7 7 7\n", "7 7\n"), "line 12: fewer than 10 words"),
        (with("7 7 7\n", "7 7 7 7\n"), "line 12: more than 10 words"),
        (packed(4, 7), "3 points of 51 bytes need 153"),
        (packed(0, 1), "are to become 153"),
        (packed(0, 4_000_000_000), "compressed rows"),
    ] {
        let e = read(&file).unwrap_err().to_string();
        assert!(e.contains(part), "{part}: {e}");
    }
}

#[test]
fn a_header_that_promises_1e11_points_allocates_nothing() {
    for file in [binary(), compressed(), ascii()] {
        let text = String::from_utf8_lossy(&file)
            .replace("WIDTH 3", "WIDTH 100000000000")
            .replace("POINTS 3", "POINTS 100000000000");
        let e = read(text.as_bytes()).unwrap_err();
        assert!(
            matches!(e, Fault::Truncated { .. } | Fault::Damaged { .. }),
            "{e}"
        );
    }
}
