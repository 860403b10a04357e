use e57::{E57Writer, Quaternion, RecordName, Transform, Translation};

use super::*;
use crate::ReadLimits;
use crate::points::revise::tests::{changes, revised as saved};

const LIMITS: ReadLimits = ReadLimits { max_bytes: 64 << 20 };

fn done(bytes: &[u8], changes: &CloudChanges) -> Result<Vec<u8>, Fault> {
    revised(bytes, changes, &mut Budget::new(&LIMITS))
}

/// A column of a name of its own, or one that the format knows.
fn column(name: RecordName, data_type: RecordDataType) -> Record {
    Record { name, data_type }
}

fn normal(axis: &str) -> Record {
    let name = RecordName::Unknown {
        namespace: "nor".into(),
        name: format!("normal{axis}"),
    };
    column(name, RecordDataType::F32)
}

/// Writes scans with their poses, and a picture behind them.
fn file(scans: &[(Vec<Record>, Option<Transform>, Vec<RawValues>)]) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    let mut file = E57Writer::new(&mut out, "file").unwrap();
    file.register_extension(e57::Extension::new(
        "nor",
        "http://www.libe57.org/E57_NOR_surface_normals.txt",
    ))
    .unwrap();
    for (i, (prototype, pose, rows)) in scans.iter().enumerate() {
        let mut scan = file
            .add_pointcloud(&format!("scan {i}"), prototype.clone())
            .unwrap();
        scan.set_name(Some(format!("Station {i}")));
        scan.set_transform(pose.clone());
        rows.iter().for_each(|r| scan.add_point(r.clone()).unwrap());
        scan.finalize().unwrap();
    }
    file.add_blob(&mut Cursor::new(vec![77; 3000])).unwrap();
    file.finalize().unwrap();
    drop(file);
    out.into_inner()
}

fn raw(bytes: &[u8]) -> Vec<Vec<RawValues>> {
    let mut reader = E57Reader::new(Cursor::new(bytes)).unwrap();
    let scans = reader.pointclouds();
    let rows = scans.iter().map(|scan| {
        let rows = reader.pointcloud_raw(scan).unwrap();
        rows.map(Result::unwrap).collect()
    });
    rows.collect()
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
            x: 10.0,
            y: 0.0,
            z: 0.0,
        },
    }
}

fn bits_of(rows: &[RawValues]) -> String {
    // Decimals by their bits, so that what is no number is told apart too.
    let value = |v: &RecordValue| match v {
        RecordValue::Double(x) => x.to_bits() as i64,
        RecordValue::Single(x) => i64::from(x.to_bits()),
        RecordValue::ScaledInteger(n) | RecordValue::Integer(n) => *n,
    };
    let rows = rows.iter().map(|r| r.iter().map(value).collect::<Vec<_>>());
    format!("{:?}", rows.collect::<Vec<_>>())
}

/// Whole numbers with a step, a mark for what is invalid, attributes of one, ten and no bits, normals.
fn scaled(p: [i64; 3], state: i64, tag: i64) -> RawValues {
    let mut row: RawValues = p.map(RecordValue::ScaledInteger).to_vec();
    row.extend([state, tag, 5].map(RecordValue::Integer));
    row.extend([0.0, f32::NAN, tag as f32].map(RecordValue::Single));
    row
}

fn prototype() -> Vec<Record> {
    let step = RecordDataType::ScaledInteger {
        min: -20_000,
        max: 20_000,
        scale: 0.001,
        offset: 0.25,
    };
    let whole = |min, max| RecordDataType::Integer { min, max };
    vec![
        column(RecordName::CartesianX, step.clone()),
        column(RecordName::CartesianY, step.clone()),
        column(RecordName::CartesianZ, step),
        column(RecordName::CartesianInvalidState, whole(0, 2)),
        column(RecordName::Intensity, whole(0, 1023)),
        column(RecordName::RowIndex, whole(5, 5)),
        normal("X"),
        normal("Y"),
        normal("Z"),
    ]
}

#[test]
fn scans_follow_each_in_its_place_and_all_else_stays() {
    let rows = |n: i64| -> Vec<RawValues> {
        (0..n)
            .map(|i| scaled([i % 977, i % 83 - 40, i], i64::from(i % 7 == 3), i % 1024))
            .collect()
    };
    // Of eight thousand points, in several packets, and of a few.
    let bytes = file(&[
        (prototype(), None, rows(40)),
        (prototype(), Some(quarter_turn()), rows(8005)),
        (prototype(), None, rows(9)),
    ]);
    assert_eq!(done(&bytes, &CloudChanges::default()).unwrap(), bytes);
    let mut text = Paged::of(&bytes).unwrap();
    let said = text.description().unwrap().replace(
        "<data3D",
        "<demo type=\"String\">nobody knows this</demo>\n<data3D",
    );
    text.take_description();
    let bytes = text.file(&said);
    let before = raw(&bytes);
    let whole = crate::points::parse_e57(&bytes, &LIMITS).unwrap();
    let is_point = |r: &RawValues| r[3] == RecordValue::Integer(0);
    let first = before[0].iter().filter(|r| is_point(r)).count();
    let second = before[1].iter().filter(|r| is_point(r)).count();

    // Moved alone: nothing else of the file is another, but for checksums and bounds.
    let to = DVec3::new(9_000.0, 1_500.0, -700.0);
    let placed = |row| Placed {
        row,
        position: to,
        normal: DVec3::Y,
    };
    let moved = CloudChanges {
        moved: vec![placed(first + 3), placed(first + second - 1)],
        ..CloudChanges::default()
    };
    let new = done(&bytes, &moved).unwrap();
    let after = raw(&new);
    assert_eq!(bits_of(&after[0]), bits_of(&before[0]));
    assert_eq!(bits_of(&after[2]), bits_of(&before[2]));
    let others = |rows: &[RawValues]| -> Vec<RawValues> {
        let mut points = 0;
        let others = rows.iter().filter(|r| {
            points += usize::from(is_point(r));
            !is_point(r) || points != 4 && points != second
        });
        others.cloned().collect()
    };
    assert_eq!(bits_of(&others(&after[1])), bits_of(&others(&before[1])));
    let cloud = crate::points::parse_e57(&new, &LIMITS).unwrap();
    for (n, (old, now)) in whole.positions.iter().zip(&cloud.positions).enumerate() {
        match n == first + 3 || n == first + second - 1 {
            true => assert!(now.distance(to) < 1.0, "{now}: to a millimetre"),
            false => assert_eq!(old, now),
        }
    }
    assert!((cloud.normals.unwrap()[first + 3] - DVec3::Y).length() < 1e-6);
    assert!(new.len() <= bytes.len() + 1024, "{} {}", new.len(), bytes.len());
    let told = Paged::of(&new).unwrap().description().unwrap();
    assert!(
        told.contains("nobody knows this") && told.contains("Station 1"),
        "{told}"
    );
    // 9 m lie 1.5 m along x before a quarter turn, and 1 m along y.
    assert!(told.contains("<yMaximum type=\"Float\">1.0</yMaximum>"), "{told}");
    let blob = |bytes: &[u8]| {
        Paged::of(bytes)
            .unwrap()
            .bytes
            .iter()
            .filter(|b| **b == 77)
            .count()
    };
    assert!(blob(&new) >= 3000);

    // Points come and go: what is packed stands at the end, and nothing is left of what was there.
    let mixed = CloudChanges {
        moved: vec![placed(1)],
        removed: vec![first + 5, first + 6],
        added: (0..200).map(|n| placed(first + n)).collect(),
    };
    let new = done(&bytes, &mixed).unwrap();
    let after = raw(&new);
    assert_eq!(
        [40, 8005 + 198, 9],
        [after[0].len(), after[1].len(), after[2].len()]
    );
    assert_eq!(bits_of(&after[2]), bits_of(&before[2]));
    let points: Vec<&RawValues> = before[1].iter().filter(|r| is_point(r)).collect();
    for (n, row) in after[1][8003..].iter().enumerate() {
        assert_eq!(row[4], points[n][4], "attributes of the row named");
    }
    // Again on what was written.
    let once_more = done(&new, &moved).unwrap();
    assert_eq!(raw(&once_more)[1].len(), 8203);
}

#[test]
fn directions_decimals_with_limits_and_what_convert_writes() {
    let decimal = |min, max| RecordDataType::Double {
        min: Some(min),
        max: Some(max),
    };
    let columns = vec![
        column(RecordName::SphericalRange, decimal(0.0, 6.0)),
        column(RecordName::SphericalAzimuth, decimal(-4.0, 4.0)),
        column(RecordName::SphericalElevation, decimal(-2.0, 2.0)),
    ];
    let rows: Vec<RawValues> = [[5.0, 0.1, 0.2], [5.5, -0.3, 0.4], [6.0, 3.0, -1.0]]
        .map(|r| r.map(RecordValue::Double).to_vec())
        .into();
    let bytes = file(&[(columns, Some(quarter_turn()), rows)]);
    let to = DVec3::new(2_000.0, -7_000.0, 4_000.0);
    let moved = CloudChanges {
        moved: vec![Placed {
            row: 1,
            position: to,
            normal: DVec3::X,
        }],
        ..CloudChanges::default()
    };
    let new = done(&bytes, &moved).unwrap();
    let cloud = crate::points::parse_e57(&new, &LIMITS).unwrap();
    assert!(cloud.positions[1].distance(to) < 1e-9, "{}", cloud.positions[1]);
    assert_eq!(bits_of(&raw(&new)[0][2..]), bits_of(&raw(&bytes)[0][2..]));
    let told = Paged::of(&new).unwrap().description().unwrap();
    assert!(
        !told.contains("sphericalBounds") && !told.contains("maximum=\"6\""),
        "{told}"
    );

    let three = crate::points::PointCloud {
        positions: vec![DVec3::ONE, DVec3::new(4.0, 5.0, 6.0), DVec3::new(7.0, 8.0, 9.5)],
        normals: Some(vec![DVec3::X, DVec3::Y, DVec3::NEG_Z]),
        ..Default::default()
    };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.e57");
    crate::points::save(&path, &three).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let metres = |changes: CloudChanges| {
        let scaled = |p: &Placed| Placed {
            position: p.position * MM_PER_METRE,
            ..*p
        };
        CloudChanges {
            moved: changes.moved.iter().map(scaled).collect(),
            added: changes.added.iter().map(scaled).collect(),
            ..changes
        }
    };
    let (_, cloud) = saved("a.e57", &bytes, &metres(changes()));
    let places: Vec<DVec3> = cloud.positions.iter().map(|p| *p / MM_PER_METRE).collect();
    let expected = [[7.0, 0.25, -1.5], [7.0, 8.0, 9.5], [9.0, 0.25, -1.5]].map(DVec3::from_array);
    assert_eq!(cloud.normals.unwrap(), [DVec3::Z, DVec3::NEG_Z, DVec3::Z]);
    for (found, expected) in [places[0], places[2]].into_iter().zip([expected[0], expected[2]]) {
        assert!(found.distance(expected) < 1e-12, "{found}");
    }
}

#[test]
fn what_cannot_be_written_back_says_why() {
    let rows: Vec<RawValues> = (0..3).map(|i| scaled([i, 2, 3], 0, i)).collect();
    let bytes = file(&[(prototype(), None, rows)]);
    let far = CloudChanges {
        moved: vec![Placed {
            row: 1,
            position: DVec3::splat(1e6),
            normal: DVec3::X,
        }],
        ..CloudChanges::default()
    };
    let why = done(&bytes, &far).unwrap_err().to_string();
    assert!(why.contains("scale and limits"), "{why}");
    let mut file = Paged::of(&bytes).unwrap();
    let text = file.description().unwrap();
    file.take_description();
    let text = text.replace("<points ", "<pointGroupingSchemes type=\"Structure\"/><points ");
    let grouped = file.file(&text);
    let gone = CloudChanges {
        removed: vec![1],
        ..CloudChanges::default()
    };
    let why = done(&grouped, &gone).unwrap_err().to_string();
    assert!(why.contains("pointGroupingSchemes"), "{why}");
    // Bytes that lie, under checksums that hold.
    let near = CloudChanges {
        moved: vec![Placed {
            row: 1,
            position: DVec3::splat(500.0),
            normal: DVec3::X,
        }],
        ..gone
    };
    let near = CloudChanges {
        removed: vec![0],
        ..near
    };
    assert!(done(&bytes, &near).is_ok());
    let whole = Paged::of(&bytes).unwrap();
    let mut refused = 0;
    for at in (0..whole.bytes.len()).step_by(5) {
        for flip in [1, 0x80, 0xff] {
            let mut file = Paged::of(&bytes).unwrap();
            let Ok(text) = file.description() else { panic!() };
            file.take_description();
            let mut file = file.file(&text);
            let place = pages::physical(at) as usize;
            file[place] ^= flip;
            let Ok(mut lying) = Paged::of(&file) else {
                refused += 1;
                continue;
            };
            let Ok(text) = lying.description() else {
                refused += 1;
                continue;
            };
            lying.take_description();
            refused += usize::from(done(&lying.file(&text), &near).is_err());
        }
    }
    assert!(refused > 100, "{refused}");
}
