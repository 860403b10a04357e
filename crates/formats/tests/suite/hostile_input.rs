//! Random bytes and random changes of good files, seeded: no panic, and never more memory than allowed.

use formats::{ReadLimits, field, meshes, points, volumes};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

const CASES: u32 = 1500;
const LIMITS: ReadLimits = ReadLimits { max_bytes: 200_000 };

/// What the ceiling does not count: messages, lists of header words, buffers of the decompressors, a vector that
/// is copied to twice its place while it grows.
const UNCOUNTED: u64 = 2 * LIMITS.max_bytes + (1 << 20);

/// Runs a reader on `bytes` and checks what it held at its peak.
fn bounded<T>(what: &str, bytes: &[u8], read: impl FnOnce(&[u8]) -> T) {
    let mut result = None;
    let held = allocation_counter::measure(|| result = Some(read(bytes))).bytes_max;
    assert!(held <= UNCOUNTED, "{what}: {held} bytes held");
}

fn read_all(bytes: &[u8]) {
    bounded("ply", bytes, |b| points::parse_ply(b, &LIMITS).is_ok());
    bounded("xyz", bytes, |b| points::parse_xyz(b, &LIMITS).is_ok());
    bounded("obj", bytes, |b| points::parse_obj(b, &LIMITS).is_ok());
    bounded("pcd", bytes, |b| points::parse_pcd(b, &LIMITS).is_ok());
    bounded("las", bytes, |b| points::parse_las(b, &LIMITS).is_ok());
    bounded("e57", bytes, |b| points::parse_e57(b, &LIMITS).is_ok());
    bounded("stl", bytes, |b| meshes::parse_stl(b, &LIMITS).is_ok());
    bounded("gltf", bytes, |b| meshes::parse_gltf(b, &LIMITS).is_ok());
    bounded("3mf", bytes, |b| meshes::parse_threemf(b, &LIMITS).is_ok());
    bounded("vrml", bytes, |b| meshes::parse_vrml(b, &LIMITS).is_ok());
    bounded("nifti", bytes, |b| volumes::parse_nifti(b, &LIMITS).is_ok());
    bounded("nrrd", bytes, |b| volumes::parse_nrrd(b, &LIMITS).is_ok());
    bounded("metaimage", bytes, |b| {
        volumes::parse_metaimage(b, &LIMITS).is_ok()
    });
    bounded("tiff", bytes, |b| volumes::parse_tiff(b, &LIMITS).is_ok());
    bounded("field", bytes, |b| field::decode(b, &LIMITS).is_ok());
}

/// Sets the checksums of a field file right, as far as its chunks can be followed: behind wrong ones nothing else
/// of it is looked at.
fn set_checksums_right(bytes: &mut [u8]) {
    let mut at = 12;
    while let Some(head) = bytes.get(at..at + 28) {
        let length = u64::from_le_bytes(head[8..16].try_into().unwrap());
        let Some(end) = usize::try_from(length).ok().and_then(|n| n.checked_add(at + 28)) else {
            break;
        };
        let Some(payload) = bytes.get(at + 28..end) else {
            break;
        };
        let mut crc = crc32fast::Hasher::new();
        crc.update(&head[..24]);
        crc.update(payload);
        bytes[at + 24..at + 28].copy_from_slice(&crc.finalize().to_le_bytes());
        at = end;
    }
}

/// The same cases in every run.
fn runner() -> TestRunner {
    let config = Config {
        cases: CASES,
        failure_persistence: None,
        ..Config::default()
    };
    TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &[7; 32]))
}

fn seeds() -> Vec<Vec<u8>> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data");
    let list = |folder: &str| std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    let mut paths: Vec<_> = list(folder).chain(list(&format!("{folder}/volumes"))).collect();
    paths.retain(|p| p.is_file());
    paths.sort();
    let mut all: Vec<_> = paths
        .iter()
        .filter(|p| {
            !matches!(
                p.extension().and_then(|e| e.to_str()),
                Some("py" | "md" | "gz" | "json" | "bin")
            )
        })
        .map(|p| std::fs::read(p).unwrap())
        .collect();
    all.push(small_field());
    all
}

/// One function on the coarsest of two levels.
fn small_field() -> Vec<u8> {
    use bspline::hierarchical::{BrickKey, Corrections, Lattice};
    let lattice = Lattice {
        world_from_lattice: glam::DAffine3::IDENTITY,
        cells: [4, 5, 6],
    };
    let mut c = Corrections::<f32>::empty();
    c.set([1, 2, 3], 0.5);
    let level = [(BrickKey([0; 3]), std::sync::Arc::new(c))].into_iter().collect();
    let f = bspline::HierarchicalSpline::from_corrections(lattice, 1.0, vec![level, Default::default()]);
    field::encode(
        &f,
        &field::FieldMeta {
            notes: vec!["note".into()],
            ..Default::default()
        },
    )
    .unwrap()
}

#[test]
fn random_bytes_behind_any_magic_are_refused_or_read_within_the_ceiling() {
    let heads: Vec<&[u8]> = vec![
        b"",
        b"ply\nformat binary_little_endian 1.0\nelement vertex ",
        b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 9\n\
          property list uchar int vertex_indices\nend_header\n",
        b"v 1 2 3\nf ",
        b"\x5c\x01\0\0",
        b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 5 5 5\nencoding: gzip\n",
        b"NRRD0004\ntype: short\ndimension: 3\nsizes: 3 3 3\nendian: big\nencoding: text\n\n1 2 ",
        b"ObjectType = Image\nNDims = 3\nDimSize = 4 4 4\nElementType = MET_UCHAR\nCompressedData = True\n\
          ElementDataFile = LOCAL\n",
        b"II*\0\x08\0\0\0",
        b"MM\0+\0\x08\0\0\0\0\0\0\0\0\0\x10",
        &field::MAGIC,
        b"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 9\nHEIGHT 1\nPOINTS 9\nDATA binary_compressed\n",
        b"solid\nfacet normal 0 0 1\nouter loop\nvertex ",
        b"glTF\x02\0\0\0",
        b"{\"asset\":{\"version\":\"2.0\"},\"nodes\":[",
        b"#VRML V2.0 utf8\nShape { geometry IndexedFaceSet { coord Coordinate { point [ ",
        b"PK\x03\x04",
        b"LASF",
        b"ASTM-E57\x01\0\0\0\0\0\0\0",
        b"\x89ICLAY\r\n\x01\0\0\0HEAD",
    ];
    let strategy = (0..heads.len(), prop::collection::vec(any::<u8>(), 0..700));
    runner()
        .run(&strategy, |(head, tail)| {
            read_all(&[heads[head], &tail].concat());
            Ok(())
        })
        .unwrap();
}

#[test]
fn files_with_numbers_blown_up_and_parts_moved_stay_within_the_ceiling() {
    let seeds = seeds();
    let edit = (
        any::<prop::sample::Index>(),
        prop::sample::select(vec![0u8, 1, 0x7f, 0x80, 0xff, b'9', b'-']),
        1usize..9,
    );
    let strategy = (
        0..seeds.len(),
        prop::collection::vec(edit, 1..6),
        any::<prop::sample::Index>(),
        any::<bool>(),
    );
    runner()
        .run(&strategy, |(seed, edits, cut, twice)| {
            let mut bytes = seeds[seed].clone();
            for (at, value, length) in edits {
                let at = at.index(bytes.len());
                let end = (at + length).min(bytes.len());
                bytes[at..end].fill(value);
            }
            if twice {
                let part = bytes[cut.index(bytes.len())..].to_vec();
                bytes.extend(part);
            }
            read_all(&bytes);
            if bytes.starts_with(&field::MAGIC) {
                set_checksums_right(&mut bytes);
                bounded("field", &bytes, |b| field::decode(b, &LIMITS).is_ok());
            }
            Ok(())
        })
        .unwrap();
}

/// A field has few bytes and many seeds stand beside it: it gets cases of its own.
#[test]
fn fields_with_changed_content_and_right_checksums_stay_within_the_ceiling() {
    let seed = small_field();
    let edits = prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4);
    let mut read = 0;
    runner()
        .run(&edits, |edits| {
            let mut bytes = seed.clone();
            for (at, value) in edits {
                let at = at.index(bytes.len());
                bytes[at] = value;
            }
            set_checksums_right(&mut bytes);
            bounded("field", &bytes, |b| field::decode(b, &LIMITS).is_ok());
            Ok(())
        })
        .unwrap();
    // Nothing but the two coefficients and the map may be changed without notice.
    for at in 0..seed.len() {
        let mut bytes = seed.clone();
        bytes[at] ^= 1;
        set_checksums_right(&mut bytes);
        read += usize::from(field::decode(&bytes, &LIMITS).is_ok());
    }
    assert!(
        read > 50 && read < seed.len() / 2,
        "{read} of {} bytes",
        seed.len()
    );
}

/// Counts that lie, in every digit of every ascii header.
#[test]
fn a_promise_of_1e11_of_anything_costs_no_memory() {
    for seed in seeds() {
        let Some(end) = seed.windows(10).position(|w| w == b"end_header") else {
            continue;
        };
        let header = String::from_utf8_lossy(&seed[..end]).into_owned();
        for element in ["vertex 8", "face 12"] {
            let grown = header.replace(element, &format!("{}00000000000", &element[..element.len() - 1]));
            if grown != header {
                let file = [grown.as_bytes(), &seed[end..]].concat();
                read_all(&file);
                assert!(points::parse_ply(&file, &LIMITS).is_err());
            }
        }
    }
}
