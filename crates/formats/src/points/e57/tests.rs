use std::io::Cursor;

use e57::{E57Writer, Quaternion, RecordValue, Transform, Translation};

use super::*;

const LIMITS: ReadLimits = ReadLimits { max_bytes: 8 << 20 };

/// Writes scans, each of one prototype with its rows.
fn file(scans: Vec<(Vec<Record>, Option<Transform>, Vec<RawValues>)>) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    let mut file = E57Writer::new(&mut out, "file").unwrap();
    for (i, (prototype, pose, rows)) in scans.into_iter().enumerate() {
        let mut scan = file.add_pointcloud(&format!("scan {i}"), prototype).unwrap();
        scan.set_name(Some(format!("Station {i}")));
        scan.set_transform(pose);
        rows.into_iter().for_each(|r| scan.add_point(r).unwrap());
        scan.finalize().unwrap();
    }
    file.finalize().unwrap();
    drop(file);
    out.into_inner()
}

fn cartesian() -> Vec<Record> {
    vec![
        Record::CARTESIAN_X_F64,
        Record::CARTESIAN_Y_F64,
        Record::CARTESIAN_Z_F64,
    ]
}

fn row(p: [f64; 3]) -> RawValues {
    p.map(RecordValue::Double).to_vec()
}

fn quarter_turn() -> Transform {
    Transform {
        rotation: Quaternion {
            w: 0.5f64.sqrt(),
            x: 0.0,
            y: 0.0,
            z: 0.5f64.sqrt(),
        },
        translation: Translation {
            x: 1e6,
            y: 5.4e6,
            z: 0.0,
        },
    }
}

#[test]
fn all_scans_are_read_each_moved_by_its_pose() {
    let bytes = file(vec![
        (cartesian(), None, vec![row([1.0, 2.0, 3.0])]),
        (cartesian(), Some(quarter_turn()), vec![row([1.0, 2.0, 3.001])]),
    ]);
    let cloud = parse_e57(&bytes, &LIMITS).unwrap();
    assert_eq!(cloud.unit, Unit::Millimetre);
    assert_eq!(cloud.positions[0], DVec3::new(1000.0, 2000.0, 3000.0));
    // A nanometre, of doubles that are 1e-7 mm apart.
    let error = cloud.positions[1] - DVec3::new(999_998_000.0, 5_400_001_000.0, 3001.0);
    assert!(error.length() < 2e-6, "{error}");
    assert!(
        cloud.notes[0].contains("scan 1 of 2 (\"Station 0\"): 1 points, without a pose"),
        "{:?}",
        cloud.notes
    );
    assert!(cloud.notes[1].contains("moved by its pose"), "{:?}", cloud.notes);
}

#[test]
fn invalid_points_and_directions_are_left_out_and_spherical_ones_converted() {
    let mut prototype = cartesian();
    prototype.push(Record::CARTESIAN_INVALID_STATE);
    let state = |p: [f64; 3], s: i64| [row(p), vec![RecordValue::Integer(s)]].concat();
    let spherical = vec![
        Record::SPHERICAL_RANGE_F64,
        Record::SPHERICAL_AZIMUTH_F64,
        Record::SPHERICAL_ELEVATION_F64,
    ];
    let bytes = file(vec![
        (
            prototype,
            None,
            vec![state([1.0; 3], 0), state([2.0; 3], 1), state([3.0; 3], 2)],
        ),
        (
            spherical,
            None,
            vec![row([2.0, std::f64::consts::FRAC_PI_2, 0.5])],
        ),
    ]);
    let cloud = parse_e57(&bytes, &LIMITS).unwrap();
    assert_eq!(cloud.positions.len(), 2);
    let expected = DVec3::new(0.0, 2000.0 * 0.5f64.cos(), 2000.0 * 0.5f64.sin());
    assert!((cloud.positions[1] - expected).length() < 1e-9);
    assert!(
        cloud
            .notes
            .last()
            .unwrap()
            .contains("2 points are marked as invalid"),
        "{:?}",
        cloud.notes
    );
}

#[test]
fn whole_multiples_and_singles_are_numbers_too() {
    let kind = |name: RecordName, data_type| Record { name, data_type };
    let prototype = vec![
        kind(
            RecordName::CartesianX,
            RecordDataType::ScaledInteger {
                min: -1000,
                max: 1000,
                scale: 0.001,
                offset: 1e6,
            },
        ),
        kind(RecordName::CartesianY, RecordDataType::F32),
        // All the same: no bits at all.
        kind(RecordName::CartesianZ, RecordDataType::Integer { min: 7, max: 7 }),
        kind(RecordName::Intensity, RecordDataType::F32),
    ];
    let values = vec![
        RecordValue::ScaledInteger(-1),
        RecordValue::Single(0.5),
        RecordValue::Integer(7),
        RecordValue::Single(0.25),
    ];
    let cloud = parse_e57(&file(vec![(prototype, None, vec![values])]), &LIMITS).unwrap();
    assert_eq!(cloud.left_out_attributes, ["intensity"]);
    assert!((cloud.positions[0] - DVec3::new(999_999_999.0, 500.0, 7000.0)).length() < 1e-6);
}

#[test]
fn what_is_written_comes_back_with_normals_and_always_with_the_same_bytes() {
    let cloud = PointCloud {
        positions: (0..5000)
            .map(|i| DVec3::new(1e9, -0.001, 0.25) + DVec3::splat(f64::from(i) * 0.001))
            .collect(),
        normals: Some(vec![DVec3::new(0.6, 0.8, 0.0); 5000]),
        unit: Unit::Millimetre,
        ..Default::default()
    };
    let bytes = |cloud: &PointCloud| {
        let mut out = Vec::new();
        write(&mut out, cloud).unwrap();
        out
    };
    let first = bytes(&cloud);
    assert_eq!(first, bytes(&cloud));
    let back = parse_e57(&first, &LIMITS).unwrap();
    for (a, b) in back.positions.iter().zip(&cloud.positions) {
        // One rounding to metres and one back.
        assert!((*a - *b).abs().max_element() <= 4e-7, "{a} for {b}");
    }
    assert!((back.normals.unwrap()[4999] - DVec3::new(0.6, 0.8, 0.0)).length() < 1e-7);
    assert!(back.notes.is_empty(), "{:?}", back.notes);
}

/// Checksums of pages set right, which is what an attacker would do.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    for page in bytes.chunks_exact_mut(1024) {
        let mut crc = u32::MAX;
        for b in &page[..1020] {
            crc ^= u32::from(*b);
            for _ in 0..8 {
                crc = if crc & 1 == 1 {
                    crc >> 1 ^ 0x82f6_3b78
                } else {
                    crc >> 1
                };
            }
        }
        page[1020..].copy_from_slice(&(!crc).to_be_bytes());
    }
    bytes
}

#[test]
fn a_wrong_byte_is_seen_by_its_checksum_and_with_a_right_one_does_no_harm() {
    let mut good = file(vec![(
        cartesian(),
        Some(quarter_turn()),
        vec![row([1.0, 2.0, 3.0]); 3],
    )]);
    assert_eq!(sealed(good.clone()), good);
    // Past the head, whose length and version are not looked at.
    for at in (48..good.len()).step_by(23) {
        let old = std::mem::replace(&mut good[at], 0x7f);
        if old != 0x7f {
            let checksum = parse_e57(&good, &LIMITS).unwrap_err().to_string();
            assert!(checksum.contains("checksum"), "{at}: {checksum}");
            let _ = parse_e57(&sealed(good.clone()), &LIMITS);
        }
        good[at] = old;
    }
    for length in (0..good.len()).step_by(5) {
        assert!(parse_e57(&good[..length], &LIMITS).is_err(), "{length}");
    }
}

/// A description of nothing but open elements.
#[test]
fn a_deeply_nested_description_is_no_matter_of_the_stack() {
    let xml = "<a>".repeat(100_000);
    let mut head = b"ASTM-E57".to_vec();
    let bytes = (48 + xml.len()).div_ceil(1020) * 1024;
    head.extend([1u32, 0].into_iter().flat_map(u32::to_le_bytes));
    head.extend(
        [bytes as u64, 48, xml.len() as u64, 1024]
            .into_iter()
            .flat_map(u64::to_le_bytes),
    );
    head.extend(xml.bytes());
    let mut file = Vec::new();
    for page in head.chunks(1020) {
        file.extend(page);
        file.resize(file.len().next_multiple_of(1024), 0);
    }
    let limits = ReadLimits { max_bytes: 1 << 30 };
    let e = parse_e57(&sealed(file), &limits).unwrap_err().to_string();
    assert!(e.contains("XML"), "{e}");
}

/// `from` replaced wherever it stands.
fn with_text(mut bytes: Vec<u8>, from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let places: Vec<usize> = memchr::memmem::find_iter(&bytes, from.as_bytes()).collect();
    assert!(!places.is_empty(), "{from}");
    for at in places {
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
    }
    sealed(bytes)
}

#[test]
fn contradictions_of_the_description_are_refused() {
    for (from, to, part) in [
        ("recordCount=\"3\"", "recordCount=\"9\"", "packet"),
        ("recordCount=\"3\"", "recordCount=\"x\"", "recordCount"),
        ("cartesianX", "cartesianW", "cartesian or spherical"),
        ("</e57Root>", "</e57Boot>", "XML"),
    ] {
        let good = file(vec![(cartesian(), None, vec![row([1.0, 2.0, 3.0]); 3])]);
        let e = parse_e57(&with_text(good, from, to), &LIMITS)
            .unwrap_err()
            .to_string();
        assert!(e.contains(part), "{part}: {e}");
    }
}

/// Attributes of no bits are made up by the decoder, as many as the others have: without others, without end.
#[test]
fn a_scan_of_nothing_but_constants_is_refused() {
    let kind = |name: RecordName| Record {
        name,
        data_type: RecordDataType::Integer { min: 7, max: 8 },
    };
    let prototype = vec![
        kind(RecordName::CartesianX),
        kind(RecordName::CartesianY),
        kind(RecordName::CartesianZ),
    ];
    let row = vec![RecordValue::Integer(7); 3];
    let bytes = file(vec![(prototype, None, vec![row; 9])]);
    assert!(parse_e57(&bytes, &LIMITS).is_ok());
    let e = parse_e57(&with_text(bytes, "maximum=\"8\"", "maximum=\"7\""), &LIMITS).unwrap_err();
    assert!(e.to_string().contains("3 attributes of 0 bits"), "{e}");
}

/// One attribute of a bit a value is sent on and on, the others never: the decoder would keep 16 bytes for each bit.
#[test]
fn a_queue_that_never_finds_its_partners_is_refused_at_the_ceiling() {
    let one_bit = Record {
        name: RecordName::IsIntensityInvalid,
        data_type: RecordDataType::Integer { min: 0, max: 1 },
    };
    let intensity = Record {
        name: RecordName::Intensity,
        data_type: RecordDataType::F32,
    };
    let prototype = [cartesian(), vec![intensity, one_bit]].concat();
    let row = [
        row([1.0; 3]),
        vec![RecordValue::Single(0.5), RecordValue::Integer(1)],
    ]
    .concat();
    let good = file(vec![(prototype, None, vec![row; 1000])]);
    // Packets of nothing but bits, between the section's head and its packet.
    let logical: Vec<u8> = good
        .chunks_exact(1024)
        .flat_map(|p| &p[..1020])
        .copied()
        .collect();
    let mut packet = vec![1, 0];
    let length = 6 + 10 + 60_000;
    packet.extend((length as u16 - 1).to_le_bytes());
    packet.extend(5u16.to_le_bytes());
    packet.extend([0, 0, 0, 0, 0, 0, 0, 0]);
    packet.extend(60_000u16.to_le_bytes());
    packet.resize(length, 0xff);
    let data_at = 48 + 32;
    let inserted = packet.repeat(20);
    assert_eq!(inserted.len() % 4, 0);
    let mut hostile = [&logical[..data_at], &inserted, &logical[data_at..]].concat();
    let xml_at = memchr::memmem::find(&hostile, b"<?xml").unwrap();
    hostile.resize(hostile.len().next_multiple_of(1020), 0);
    let physical = (xml_at + xml_at / 1020 * 4) as u64;
    hostile[24..32].copy_from_slice(&physical.to_le_bytes());
    let pages: Vec<u8> = hostile
        .chunks_exact(1020)
        .flat_map(|p| [p, &[0; 4]].concat())
        .collect();
    let bytes = sealed(pages);
    let e = parse_e57(&bytes, &LIMITS).unwrap_err();
    assert!(
        matches!(
            e,
            Fault::Limit {
                what: "what waits in the decoder for its partners",
                ..
            }
        ),
        "{e}"
    );
    // The same bytes are sound where there is room.
    assert_eq!(
        parse_e57(&bytes, &ReadLimits { max_bytes: 1 << 30 })
            .unwrap()
            .positions
            .len(),
        1000
    );
}
