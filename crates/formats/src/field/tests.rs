use std::sync::Arc;

use bspline::hierarchical::{BlockEdit, BrickDiff, BrickKey, Change, Corrections, Lattice, LevelEdit};
use bspline::{Field, HierarchicalSpline};
use glam::{DAffine3, DMat3, DVec3};

use super::levels::Level;
use super::*;
use crate::atomic::tests::survives_a_full_disk;

/// Numbers without a generator crate: xorshift64.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }
}

/// A field of three levels on an oblique lattice; cells do not fill the last bricks.
pub(super) fn sample<T: Stored>(seed: u64, bricks_per_level: usize) -> HierarchicalSpline<T> {
    let mut random = Random(seed);
    let cells = [11, 9, 17];
    let world_from_lattice = DAffine3 {
        matrix3: DMat3::from_cols(
            DVec3::new(1.5, 0.1, 0.0),
            DVec3::new(0.0, -2.0, 0.3),
            DVec3::new(0.2, 0.0, 1.0),
        ),
        translation: DVec3::new(1234.5678, -0.125, 1e-3),
    };
    let lattice = Lattice {
        world_from_lattice,
        cells,
    };
    let mut levels = Vec::new();
    for level in 0..3 {
        let last = lattice.cells_at(level).map(|n| n + 2);
        let mut bricks = Level::new();
        for _ in 0..bricks_per_level {
            let key = std::array::from_fn(|a| (random.next() % u64::from(last[a] / 8 + 1)) as u32);
            let mut c = Corrections::empty();
            for _ in 0..1 + random.next() % 60 {
                let slot: [usize; 3] = std::array::from_fn(|_| (random.next() % 8) as usize);
                if (0..3).all(|a| key[a] * 8 + slot[a] as u32 <= last[a]) {
                    c.set(slot, T::from_f64((random.next() >> 11) as f64 / 1e16 - 0.45));
                }
            }
            bricks.insert(BrickKey(key), Arc::new(c));
        }
        levels.push(bricks);
    }
    HierarchicalSpline::from_corrections(lattice, 0.75, levels)
}

pub(super) fn meta() -> FieldMeta {
    FieldMeta {
        source: SourceKind::Volume,
        unit: Unit::Millimetre,
        density_unit: "HU".into(),
        iso: Some(300.5),
        report: "{\"rms\":1.5}".into(),
        leaves: (0..5)
            .map(|i| LeafRecord {
                level: i,
                cell: [u32::from(i), 7, 9],
                sample_count: 64,
                rms: 0.5,
                max: 1.5,
                reason: 2,
            })
            .collect(),
        sign_confidence: vec![0.0, 0.25, 0.5, 0.75, 1.0],
        notes: vec!["3 points left out".into(), "µ".into()],
        provenance: "{\"program\":\"isoclay\"}".into(),
    }
}

fn loaded<T: Stored>(bytes: &[u8]) -> (HierarchicalSpline<T>, LoadedField) {
    let file = decode(bytes, &ReadLimits::default()).unwrap();
    let any: Box<dyn std::any::Any> = match file.field.clone() {
        AnyField::F32(f) => Box::new(f),
        AnyField::F64(f) => Box::new(f),
    };
    (*any.downcast().expect("the precision that was saved"), file)
}

fn comes_back<T: Stored>(seed: u64) {
    let field = sample::<T>(seed, 12);
    let bytes = encode(&field, &meta()).unwrap();
    let (back, file) = loaded::<T>(&bytes);
    assert_eq!(file.meta, meta());
    assert_eq!(back.lattice(), field.lattice());
    assert_eq!(back.slope(), field.slope());
    assert_eq!(back.sha256(), field.sha256());
    for level in 0..field.level_count() {
        assert_eq!(back.corrections(level), field.corrections(level));
    }
    let p = DVec3::new(1240.0, -8.0, 5.0);
    assert_eq!(file.field.as_field().value(p).to_bits(), field.value(p).to_bits());
    assert_eq!(encode(&back, &meta()).unwrap(), bytes, "same field, same bytes");
}

#[test]
fn fields_of_both_precisions_come_back_to_the_bit() {
    for seed in 1..20 {
        comes_back::<f32>(seed);
        comes_back::<f64>(seed + 100);
    }
}

#[test]
fn an_empty_field_and_empty_notes_come_back() {
    let field = sample::<f32>(1, 0);
    let (back, file) = loaded::<f32>(&encode(&field, &FieldMeta::default()).unwrap());
    assert_eq!((back.sha256(), file.meta), (field.sha256(), FieldMeta::default()));
}

#[test]
fn what_enters_the_hash_is_the_field_and_nothing_beside_it() {
    let field = sample::<f32>(5, 4);
    let (other_meta, _) = loaded::<f32>(&encode(&field, &FieldMeta::default()).unwrap());
    assert_eq!(other_meta.sha256(), field.sha256());
    assert_ne!(sample::<f32>(6, 4).sha256(), field.sha256());
    assert_ne!(sample::<f64>(5, 4).sha256(), field.sha256());
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    let bytes = encode(&sample::<f32>(3, 3), &meta()).unwrap();
    for length in 0..bytes.len() {
        let e = decode(&bytes[..length], &ReadLimits::default()).unwrap_err();
        assert!(
            matches!(e, Fault::Truncated { .. } | Fault::Empty | Fault::Value { .. }),
            "cut at {length}: {e}"
        );
    }
}

#[test]
fn a_file_with_any_bit_turned_is_refused() {
    let bytes = encode(
        &sample::<f32>(4, 1),
        &FieldMeta {
            notes: vec!["n".into()],
            ..Default::default()
        },
    )
    .unwrap();
    for bit in 0..bytes.len() * 8 {
        let mut bad = bytes.clone();
        bad[bit / 8] ^= 1 << (bit % 8);
        assert!(
            decode(&bad, &ReadLimits::default()).is_err(),
            "bit {bit} of {}",
            bytes.len() * 8
        );
    }
}

/// The parts of a file: 12 bytes in front, then its chunks.
fn chunks(bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut parts = vec![bytes[..12].to_vec()];
    let mut at = 12;
    while at < bytes.len() {
        let length = u64::from_le_bytes(bytes[at + 8..at + 16].try_into().unwrap()) as usize;
        parts.push(bytes[at..at + 28 + length].to_vec());
        at += 28 + length;
    }
    parts
}

fn raw_chunk(kind: &[u8; 4], raw: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    chunk::write(&mut out, *kind, raw).unwrap();
    out
}

#[test]
fn a_chunk_of_an_unknown_type_is_skipped_and_named() {
    let field = sample::<f32>(9, 3);
    let mut parts = chunks(&encode(&field, &FieldMeta::default()).unwrap());
    let end = parts.len() - 1;
    parts.insert(end, raw_chunk(b"MATR", &[7; 1000]));
    parts[end + 1] = raw_chunk(b"DONE", &(end as u32).to_le_bytes());
    let file = decode(&parts.concat(), &ReadLimits::default()).unwrap();
    assert_eq!(file.skipped_chunks, ["MATR"]);
}

/// Files whose checksums hold and whose content does not: each names what is wrong.
#[test]
fn wrong_content_with_right_checksums_is_refused() {
    let field = sample::<f32>(9, 3);
    let parts = chunks(&encode(&field, &FieldMeta::default()).unwrap());
    let mut budget = Budget::new(&ReadLimits::default());
    let mut raw = |part: usize| {
        chunk::Chunk::take(&mut &parts[part][..], 0)
            .unwrap()
            .unpack(&mut budget)
            .unwrap()
    };
    let (header, level_1) = (raw(1), raw(3));
    let with = |part: usize, kind: &[u8; 4], change: &dyn Fn(&mut Vec<u8>)| {
        let mut parts = parts.clone();
        let mut content = if part == 1 {
            header.clone()
        } else {
            level_1.clone()
        };
        change(&mut content);
        parts[part] = raw_chunk(kind, &content);
        decode(&parts.concat(), &ReadLimits::default())
            .unwrap_err()
            .to_string()
    };
    let head = |at: usize, bytes: &'static [u8]| {
        with(1, b"HEAD", &move |h| {
            h[at..at + bytes.len()].copy_from_slice(bytes)
        })
    };
    let nan = &[0, 0, 0, 0, 0, 0, 0xf8, 0x7f];
    for (message, part) in [
        (head(0, &[3]), "precision"),
        (head(1, &[9]), "kind of source"),
        (head(2, &[9]), "unit of length"),
        (head(3, &[2]), "iso-value"),
        (head(4, &[0, 0, 0, 0]), "number of levels"),
        (head(4, &[22, 0, 0, 0]), "number of levels"),
        (head(4, &[4, 0, 0, 0]), "3 levels are stored, 4 are stated"),
        (head(4, &[2, 0, 0, 0]), "more than 2 levels"),
        (head(8, &[0, 0, 0, 0]), "lattice"),
        (head(8, &[255, 255, 255, 255]), "lattice"),
        (head(20, nan), "map from lattice"),
        (head(20, &[0; 24]), "map from lattice"),
        (head(116, nan), "slope"),
        (with(1, b"HEAD", &|h| h.push(0)), "1 bytes too many"),
        (with(1, b"HEAT", &|_| ()), "first chunk"),
        (with(3, b"HEAD", &|_| ()), "second header"),
        (with(3, b"CORR", &|l| l[0] = 2), "level 2 stands"),
        (
            with(3, b"CORR", &|l| l[4..8].copy_from_slice(&[0xff; 4])),
            "ends too early",
        ),
        (with(3, b"CORR", &|l| l[8 + 3 * 12] ^= 1), "level"),
        (with(3, b"CORR", &|l| l[8] = 0xee), "level 1"),
        (with(3, b"CORR", &|l| l.copy_within(20..32, 8)), "out of order"),
        (with(3, b"CORR", &|l| l.truncate(l.len() - 1)), "ends too early"),
    ] {
        assert!(message.contains(part), "{part}: {message}");
    }
    // Top byte and the next of one value: exponent all ones.
    let not_finite = with(3, b"CORR", &|l| {
        let n = l.len();
        let count = u32::from_le_bytes(l[4..8].try_into().unwrap()) as usize;
        let active = (n - 8 - 76 * count) / 4;
        l[n - 1] = 0x7f;
        l[n - 1 - active] = 0x80;
    });
    assert!(
        not_finite.contains("a coefficient is NaN in brick"),
        "{not_finite}"
    );
}

#[test]
fn a_function_outside_of_the_lattice_is_refused() {
    let lattice = Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [4, 4, 4],
    };
    let mut c = Corrections::<f32>::empty();
    c.set([6, 6, 6], 1.0);
    let level = Level::from([(BrickKey([0; 3]), Arc::new(c.clone()))]);
    let read = |level: &Level<f32>| {
        let mut budget = Budget::new(&ReadLimits::default());
        levels::from_bytes::<f32>(&levels::to_bytes(0, level), 0, &lattice, &mut budget)
    };
    assert_eq!(read(&level).unwrap(), level);
    c.set([6, 7, 6], 1.0);
    assert!(
        read(&Level::from([(BrickKey([0; 3]), Arc::new(c))]))
            .unwrap_err()
            .to_string()
            .contains("outside")
    );
}

#[test]
fn a_few_bytes_that_would_become_gigabytes_are_refused() {
    // 2^30 bricks of level 0 from a header alone.
    let field = sample::<f32>(9, 0);
    let mut parts = chunks(&encode(&field, &FieldMeta::default()).unwrap());
    let mut budget = Budget::new(&ReadLimits::default());
    let mut header = chunk::Chunk::take(&mut &parts[1][..], 0)
        .unwrap()
        .unpack(&mut budget)
        .unwrap();
    for axis in 0..3 {
        header[8 + 4 * axis..12 + 4 * axis].copy_from_slice(&(1u32 << 13).to_le_bytes());
    }
    parts[1] = raw_chunk(b"HEAD", &header);
    let e = decode(&parts.concat(), &ReadLimits::default()).unwrap_err();
    assert!(matches!(e, Fault::Limit { .. }), "{e}");

    // A packed chunk of zeros a thousand times as long.
    let mut parts = chunks(&encode(&field, &FieldMeta::default()).unwrap());
    parts[2] = raw_chunk(b"CORR", &vec![0; 1 << 24]);
    assert!(parts[2].len() < 1 << 14);
    let e = decode(&parts.concat(), &ReadLimits { max_bytes: 1 << 20 }).unwrap_err();
    assert!(
        matches!(
            e,
            Fault::Limit {
                what: "an unpacked chunk",
                ..
            }
        ),
        "{e}"
    );
}

#[test]
fn memory_for_the_totals_is_weighed_before_they_are_built() {
    let field = sample::<f32>(11, 40);
    let bytes = encode(&field, &FieldMeta::default()).unwrap();
    let needed = field.totals_bytes() as u64;
    assert!(decode(&bytes, &ReadLimits { max_bytes: needed }).is_err());
    // Three times: totals, corrections, and functions counted as if they reached every neighbour.
    assert!(
        decode(
            &bytes,
            &ReadLimits {
                max_bytes: 3 * needed
            }
        )
        .is_ok()
    );
}

#[test]
fn what_no_file_can_hold_is_refused_before_writing() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("f.iclay");
    let lattice = Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [4, 4, 4],
    };
    let refused = |slope: f64, levels: Vec<Level<f32>>, meta: &FieldMeta| {
        let field = HierarchicalSpline::from_corrections(lattice, slope, levels);
        save(&path, &field, meta).unwrap_err().to_string()
    };
    // All that loading would refuse.
    let brick = |slot: [usize; 3]| {
        let mut c = Corrections::<f32>::empty();
        c.set(slot, 1.0);
        Arc::new(c)
    };
    let one = |key: [u32; 3], slot| vec![Level::from([(BrickKey(key), brick(slot))])];
    let leaf = |level, rms| FieldMeta {
        leaves: vec![LeafRecord {
            level,
            rms,
            ..Default::default()
        }],
        ..Default::default()
    };
    let plain = FieldMeta::default();
    for (e, part) in [
        (
            refused(f64::NAN, one([0; 3], [1; 3]), &plain),
            "slope outside of the box of NaN",
        ),
        (
            refused(-1.0, one([0; 3], [1; 3]), &plain),
            "slope outside of the box of -1",
        ),
        (refused(1.0, one([0; 3], [1; 3]), &leaf(32, 0.0)), "level: 32"),
        (refused(1.0, one([0; 3], [1; 3]), &leaf(1, f32::NAN)), "rms: NaN"),
    ] {
        assert!(e.contains("f.iclay") && e.contains(part), "{part}: {e}");
    }
    // Functions that the lattice does not have, and coefficients that are no numbers, are in no field.
    let c = brick([0; 3]);
    let e = valid::brick(&lattice, 0, BrickKey([1, 0, 0]), &c).unwrap_err();
    assert!(e.value.contains("outside of the lattice"), "{}", e.value);
    assert!(!path.exists());
}

#[test]
fn a_saved_field_is_loaded_and_a_disk_that_fills_keeps_the_old_one() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("f.iclay");
    let field = sample::<f64>(2, 2);
    save(&path, &field, &meta()).unwrap();
    let back = load(&path, &ReadLimits::default()).unwrap();
    let AnyField::F64(back) = back.field else {
        panic!("saved in double precision")
    };
    assert_eq!(back.sha256(), field.sha256());
    assert_eq!(crate::detect(&path).unwrap(), crate::Kind::Field);

    survives_a_full_disk(|out| encode::write(out, &field, &meta()));
}

#[test]
fn files_of_version_1_are_read_and_those_of_the_future_are_not() {
    let field = sample::<f32>(3, 2);
    let mut bytes = encode(&field, &meta()).unwrap();
    assert_eq!(bytes[8..12], 2u32.to_le_bytes());
    bytes[8] = 1;
    let old = decode(&bytes, &ReadLimits::default()).unwrap();
    let AnyField::F32(old) = old.field else {
        panic!("saved in single precision")
    };
    assert_eq!(old.sha256(), field.sha256());
    for version in [0, 3] {
        bytes[8] = version;
        let refused = decode(&bytes, &ReadLimits::default()).unwrap_err().to_string();
        assert!(
            refused.contains(&format!("version of the file is {version}")),
            "{refused}"
        );
    }
}

#[test]
fn differences_come_back_and_damaged_ones_are_refused() {
    let old = sample::<f32>(21, 6);
    let edits: Vec<_> = (0..40)
        .map(|i| LevelEdit {
            level: i as usize % 4,
            function: [1 + i % 3, 2, 1 + i % 2],
            delta: 0.5,
        })
        .collect();
    let mut new = old.edited(&edits).unwrap();
    let gone = BlockEdit {
        level: 1,
        first: [0; 3],
        shape: [6; 3],
        change: Change::Deactivate,
    };
    new = new.edited_blocks(&[gone]).unwrap();
    let diff = old.difference(&new).unwrap();
    let bytes = encode_difference(&diff).unwrap();
    let limits = ReadLimits::default();
    let read = |bytes: &[u8]| decode_difference::<f32>(bytes, old.lattice(), &limits);
    let back = read(&bytes).unwrap();
    assert_eq!(back, diff);
    assert_eq!(old.applied(&back).unwrap().sha256(), new.sha256());
    assert_eq!(
        read(&encode_difference(&BrickDiff::<f32>::default()).unwrap())
            .unwrap()
            .bricks,
        []
    );
    for length in 0..bytes.len() {
        assert!(read(&bytes[..length]).is_err(), "cut at {length}");
    }
    for bit in (0..8 * bytes.len()).step_by(7) {
        let mut turned = bytes.clone();
        turned[bit / 8] ^= 1 << (bit % 8);
        assert!(read(&turned).is_err(), "bit {bit}");
    }
    assert!(decode_difference::<f64>(&bytes, old.lattice(), &limits).is_err());
    let small = Lattice {
        cells: [1; 3],
        ..*old.lattice()
    };
    assert!(decode_difference::<f32>(&bytes, &small, &limits).is_err());
    let few = ReadLimits { max_bytes: 500 };
    assert!(decode_difference::<f32>(&bytes, old.lattice(), &few).is_err());
}
