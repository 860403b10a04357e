use std::io::Cursor;

use super::tests::{Random, meta, sample};
use super::*;

fn streamed<T: Stored>(
    path: &Path,
    field: &HierarchicalSpline<T>,
    meta: &FieldMeta,
) -> Result<(), FormatError> {
    let frame = Frame {
        lattice: *field.lattice(),
        slope: field.slope(),
        level_count: field.level_count(),
    };
    save_stream(path, &frame, meta, |sink| {
        for level in 0..field.level_count() {
            for (key, functions) in field.corrections(level) {
                sink.brick(level, key, &functions)?;
            }
        }
        meta.leaves.iter().try_for_each(|leaf| sink.leaf(leaf))?;
        Ok::<_, FormatError>(meta.clone())
    })
}

/// Chunks that are packed, too small to be, and noise that does not get smaller; levels beyond one block of the packer.
#[test]
fn a_stream_writes_the_bytes_of_a_field_at_once() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.iclay");
    for (seed, bricks) in [(1, 0), (2, 1), (3, 12), (4, 400)] {
        for count in [0, 1, 40_000] {
            let mut random = Random(7);
            let meta = FieldMeta {
                leaves: (0..count)
                    .map(|i| LeafRecord {
                        level: 0,
                        cell: [i, i / 7, i / 49],
                        sample_count: 64,
                        rms: random.next() as f32,
                        max: random.next() as f32,
                        reason: 0,
                    })
                    .collect(),
                sign_confidence: Vec::new(),
                ..meta()
            };
            let field = sample::<f32>(seed, bricks);
            streamed(&path, &field, &meta).unwrap();
            assert!(
                std::fs::read(&path).unwrap() == encode(&field, &meta).unwrap(),
                "{bricks} bricks, {count} leaves"
            );
            let field = sample::<f64>(seed, bricks);
            streamed(&path, &field, &meta).unwrap();
            assert!(std::fs::read(&path).unwrap() == encode(&field, &meta).unwrap());
        }
    }
}

#[test]
fn columns_larger_than_the_window_of_the_packer_give_the_same_bytes() {
    let directory = tempfile::tempdir().unwrap();
    let mut random = Random(9);
    // Repeats far behind, which a packer that sees all at once might find and a stream not.
    let part: Vec<u8> = (0..300_000).map(|_| random.next() as u8 & 3).collect();
    let raw: Vec<u8> = part.iter().cycle().take(9_000_001).copied().collect();
    let mut columns = columns::Columns::new(directory.path(), 2).unwrap();
    for (n, piece) in raw[5..].chunks(4093).enumerate() {
        columns.put(usize::from(n >= 1000), piece).unwrap();
    }
    let (mut stream, mut whole) = (Vec::new(), Vec::new());
    columns
        .write(&mut stream, directory.path(), kinds::LEVEL, &raw[..5])
        .unwrap();
    chunk::write(&mut whole, kinds::LEVEL, &raw).unwrap();
    assert!(stream == whole);
}

#[test]
fn what_no_field_has_is_refused_and_leaves_the_old_file() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.iclay");
    std::fs::write(&path, "old").unwrap();
    let field = sample::<f32>(1, 3);
    let frame = Frame {
        lattice: *field.lattice(),
        slope: 1.0,
        level_count: 1,
    };
    let mut bad = bspline::hierarchical::Corrections::empty();
    bad.set([0; 3], f32::NAN);
    let mut outside = bspline::hierarchical::Corrections::empty();
    outside.set([7; 3], 1.0);
    for (key, functions) in [([0; 3], bad), ([1, 1, 2], outside)] {
        let e = save_stream(&path, &frame, &FieldMeta::default(), |sink| {
            sink.brick(0, bspline::hierarchical::BrickKey(key), &functions)?;
            Ok::<_, FormatError>(FieldMeta::default())
        });
        assert!(e.unwrap_err().to_string().contains("fit the input again"));
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
    }
    assert_eq!(std::fs::read_dir(&directory).unwrap().count(), 1);
}

#[test]
fn parts_come_back_page_by_page() {
    let field = sample::<f32>(8, 12);
    let levels: Vec<_> = (0..field.level_count()).map(|l| field.corrections(l)).collect();
    let bytes = encode_part(&levels, 2.5);
    let mut part = Cursor::new(&bytes);
    let index = PartIndex::read(&mut part).unwrap();
    assert_eq!(index.slope(), 2.5);
    let mut back = vec![Default::default(); levels.len()];
    for (level, x) in index.pages() {
        let page = index.page::<f32>(&mut part, field.lattice(), (level, x)).unwrap();
        let bricks: &mut bspline::hierarchical::LevelCorrections<f32> = &mut back[level];
        bricks.extend(page);
    }
    assert_eq!(back, levels);
    assert!(
        index
            .page::<f32>(&mut part, field.lattice(), (0, 99))
            .unwrap()
            .is_empty()
    );
    for length in 0..bytes.len() {
        let mut cut = Cursor::new(&bytes[..length]);
        let read = PartIndex::read(&mut cut).and_then(|index| {
            let pages: Vec<_> = index.pages().collect();
            pages
                .into_iter()
                .try_for_each(|page| index.page::<f32>(&mut cut, field.lattice(), page).map(drop))
        });
        assert!(read.is_err(), "cut at {length}");
    }
}
