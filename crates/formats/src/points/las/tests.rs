use super::*;

const LIMITS: ReadLimits = ReadLimits { max_bytes: 64 << 20 };

/// A walk of `n` points in map coordinates.
fn cloud(n: usize, unit: Unit, with_normals: bool) -> PointCloud {
    let at = |i: usize| {
        let t = i as f64 * 0.37;
        DVec3::new(
            1_000_000.0 + 100.0 * t.cos(),
            5_400_000.0 + 100.0 * t.sin(),
            0.001 * i as f64,
        )
    };
    PointCloud {
        positions: (0..n).map(at).collect(),
        normals: with_normals.then(|| vec![DVec3::new(0.0, 0.6, -0.8); n]),
        unit,
        ..Default::default()
    }
}

fn bytes(cloud: &PointCloud, compress: bool) -> Vec<u8> {
    let mut out = Vec::new();
    write(&mut out, cloud, compress).unwrap();
    out
}

/// More points than a chunk of 50 000 holds.
#[test]
fn points_far_from_the_origin_come_back_within_half_a_step() {
    for (unit, scale) in [(Unit::Unknown, 1.0), (Unit::Metre, 1000.0)] {
        for with_normals in [false, true] {
            let written = cloud(60_000, unit, with_normals);
            for compress in [false, true] {
                let file = bytes(&written, compress);
                let back = parse_las(&file, &LIMITS).unwrap();
                let in_mm = if unit == Unit::Metre {
                    Unit::Millimetre
                } else {
                    unit
                };
                assert_eq!((back.positions.len(), back.unit), (60_000, in_mm));
                for (a, b) in back.positions.iter().zip(&written.positions) {
                    // A step is 1e-6 of 200; doubles there are 1e-9 apart.
                    let error = (*a / scale - *b).abs().max_element();
                    assert!(error <= 0.5e-6 + 2e-9, "{error}");
                }
                assert_eq!(back.normals.is_some(), with_normals);
                for n in back.normals.iter().flatten() {
                    assert!((*n - DVec3::new(0.0, 0.6, -0.8)).length() < 1e-7);
                }
                assert!(back.notes.is_empty(), "{:?}", back.notes);
                let step = back.resolution.unwrap() / scale;
                assert!((step - 1e-6).abs() < 1e-15, "{step}");
            }
        }
    }
}

#[test]
fn a_step_leaves_room_for_any_cloud_and_keeps_decimals() {
    for extent in [1e-12, 0.0, 1.0, 9.99, 1e9, 3e15] {
        for offset in [0.0, 1e6, -7.3e12] {
            let (min, max) = (DVec3::splat(offset), DVec3::splat(offset + extent));
            let grid = write::Grid::of(min, max);
            for p in [min, max] {
                let steps = (p - grid.offset) / grid.scale;
                assert!(steps.abs().max_element() < 2e9, "{extent} at {offset}: {steps}");
            }
            // Not coarser than a thousand-millionth, or than doubles are there.
            let least = (extent * 1e-8).max(offset.abs() * 1e-16).max(1e-17);
            assert!(
                grid.scale <= least.max(1e-8),
                "{extent} at {offset}: {}",
                grid.scale
            );
        }
    }
    let mut round = cloud(0, Unit::Unknown, false);
    round.positions = [0.0, 0.125, 12.5].map(|x| DVec3::splat(1_000_000.0 + x)).to_vec();
    assert_eq!(
        parse_las(&bytes(&round, true), &LIMITS).unwrap().positions,
        round.positions
    );
}

/// Of what every point has room for, only what some point has.
#[test]
fn attributes_are_named_where_they_are_not_zero() {
    for compress in [false, true] {
        let file = bytes(&cloud(10, Unit::Unknown, true), compress);
        assert!(parse_las(&file, &LIMITS).unwrap().left_out_attributes.is_empty());
    }
    let mut file = bytes(&cloud(10, Unit::Unknown, true), false);
    let (first, format) = (header::u32_at(&file, 96) as usize, file[104] & 0x3f);
    let class = if format < 6 { 15 } else { 16 };
    for (at, byte) in [(13, 4), (14, 2), (class, 6)] {
        file[first + at] = byte;
    }
    assert_eq!(
        parse_las(&file, &LIMITS).unwrap().left_out_attributes,
        ["returns", "intensity", "classification"]
    );
}

#[test]
fn withheld_points_are_left_out_and_counted() {
    let mut file = bytes(&cloud(10, Unit::Unknown, false), false);
    let first = usize::from(header::u16_at(&file, 94));
    file[first + 15] |= 0x80;
    let back = parse_las(&file, &LIMITS).unwrap();
    assert_eq!(back.positions.len(), 9);
    assert!(back.notes[0].contains("1 of 10 points"), "{:?}", back.notes);
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    for compress in [false, true] {
        let file = bytes(&cloud(40, Unit::Metre, true), compress);
        // The chunk table at the end is not needed.
        let needed = if compress { file.len() - 20 } else { file.len() };
        for length in 0..file.len() {
            let result = parse_las(&file[..length], &LIMITS);
            assert!(result.is_err() || length >= needed, "{length} of {}", file.len());
        }
    }
}

#[test]
fn promises_of_the_header_cost_nothing() {
    let good = bytes(&cloud(40, Unit::Metre, true), true);
    let vlr = memchr::memmem::find(&good, b"laszip encoded").unwrap() + 52;
    let points = header::u32_at(&good, 96) as usize;
    let table = header::u64_at(&good, points) as usize;
    let with = |at: usize, value: &[u8]| {
        let mut file = good.clone();
        file[at..at + value.len()].copy_from_slice(value);
        file
    };
    for (file, part) in [
        (with(0, b"LASX"), "starts with LASF"),
        (with(24, &[2, 0]), "version of LAS is 2.0"),
        (with(94, &[255, 255]), "the header needs 65535"),
        (with(96, &[255; 4]), "before the points needs 4294967295"),
        (with(100, &[255; 4]), "record 3 of 4294967295"),
        (with(104, &[0x8b]), "point format is 11"),
        (with(104, &[0]), "points of 32 bytes"),
        (with(105, &[19]), "take 20 bytes, the header says 19"),
        (with(107, &[255; 4]), "points"),
        (with(131, &f64::NAN.to_le_bytes()), "scale"),
        (with(131, &0f64.to_le_bytes()), "scale"),
        (with(vlr, &[9]), "compressor 9"),
        (with(vlr + 32, &[255, 255]), "65535 compressed items"),
        (with(vlr + 36, &[255]), "a point has 32"),
        (with(table + 4, &[255; 4]), "names 4294967295 chunks"),
    ] {
        let e = parse_las(&file, &LIMITS).unwrap_err().to_string();
        assert!(e.contains(part), "{part}: {e}");
    }
    let e = parse_las(&good, &ReadLimits { max_bytes: 1 << 20 }).unwrap_err();
    assert!(matches!(e, Fault::Limit { .. }), "{e}");
}

#[test]
fn any_byte_of_a_compressed_file_may_be_wrong() {
    let mut file = bytes(&cloud(40, Unit::Metre, true), true);
    for at in (0..file.len()).step_by(11) {
        for value in [0, 0xff] {
            let old = std::mem::replace(&mut file[at], value);
            if let Err(e) = parse_las(&file, &LIMITS) {
                // What a panic of the decoder says is for its authors.
                let e = e.to_string();
                for word in [
                    "unwrap",
                    "overflow",
                    "index out of",
                    "out of range",
                    "panic",
                    ".rs",
                ] {
                    assert!(!e.contains(word), "{at}: {e}");
                }
            }
            file[at] = old;
        }
    }
}
