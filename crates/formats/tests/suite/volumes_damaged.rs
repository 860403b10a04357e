//! Volumes cut, turned and forged: an error or the same volume, never a panic, never more memory than allowed.

use std::path::{Path, PathBuf};

use formats::volumes::{self, RawLayout, Volume, VolumeOptions, VoxelType};
use formats::{Fault, FormatError, ReadLimits, Unit};

const LIMITS: ReadLimits = ReadLimits { max_bytes: 8 << 20 };

fn read(path: &Path) -> Result<Volume, FormatError> {
    volumes::read(path, &VolumeOptions::default(), &LIMITS)
}

/// The fixtures in a directory of their own, so that one can be damaged beside the others.
struct Scratch {
    directory: tempfile::TempDir,
    volumes: Vec<PathBuf>,
}

impl Scratch {
    fn new() -> Self {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/volumes");
        let directory = tempfile::tempdir().unwrap();
        let mut volumes = Vec::new();
        for entry in std::fs::read_dir(folder).unwrap() {
            let from = entry.unwrap().path();
            let name = from.file_name().unwrap().to_str().unwrap().to_owned();
            if from.is_dir() || name.ends_with(".py") || name.ends_with(".json") || name.ends_with(".md") {
                continue;
            }
            let to = directory.path().join(&name);
            std::fs::copy(&from, &to).unwrap();
            volumes.push(to);
        }
        volumes.sort();
        assert!(volumes.len() >= 30);
        Self { directory, volumes }
    }

    fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.directory.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    /// What is read when `path` is damaged: the volume of which it is a part.
    fn whole_of(path: &Path) -> PathBuf {
        let name = path.file_name().unwrap().to_str().unwrap();
        let header = match name {
            "slice_07.raw" | "slice_09.raw" | "slice_11.raw" => "int16_list.mhd".into(),
            _ if name.ends_with(".raw.gz") => name.replace(".raw.gz", ".nhdr"),
            _ if name.ends_with(".zraw") => name.replace(".zraw", ".mhd"),
            "uint16_raw_itk.raw" => name.replace(".raw", ".nhdr"),
            _ if name.ends_with(".raw") => name.replace(".raw", ".mhd"),
            _ => name.to_owned(),
        };
        path.with_file_name(header)
    }
}

/// Notes and the range of a damaged file may differ where its voxels do not: texts that no voxel depends on.
fn is_same(a: &Volume, b: &Volume) -> bool {
    a.values == b.values
        && a.header.world_from_voxel == b.header.world_from_voxel
        && a.header.dims == b.header.dims
}

/// Reads `path` with `bytes` in it: from memory where all of the volume is in them.
fn read_with(path: &Path, bytes: &[u8]) -> Result<Volume, Fault> {
    match path.extension().unwrap().to_str().unwrap() {
        "nrrd" => volumes::parse_nrrd(bytes, &LIMITS),
        "mha" => volumes::parse_metaimage(bytes, &LIMITS),
        "tif" => volumes::parse_tiff(bytes, &LIMITS),
        _ => {
            std::fs::write(path, bytes).unwrap();
            read(&Scratch::whole_of(path)).map_err(|e| e.fault)
        }
    }
}

#[test]
fn every_volume_cut_at_every_byte_is_refused_or_the_same() {
    let scratch = Scratch::new();
    for path in &scratch.volumes {
        let original = read(&Scratch::whole_of(path)).unwrap();
        let bytes = std::fs::read(path).unwrap();
        let mut refused = 0;
        for length in 0..bytes.len() {
            match read_with(path, &bytes[..length]) {
                Err(_) => refused += 1,
                // The last number of a text may be cut to a shorter one; voxels counted from the end move with it.
                Ok(v) if path.ends_with("int16_text_pynrrd.nrrd") => {
                    assert!(length + 3 >= bytes.len(), "{v:?}")
                }
                Ok(v) if path.ends_with("int16_at_end.mha") => assert!(length + 7 >= bytes.len(), "{v:?}"),
                Ok(v) => assert!(is_same(&v, &original), "{} cut at {length}", path.display()),
            }
        }
        assert!(
            refused * 2 > bytes.len(),
            "{}: {refused} of {}",
            path.display(),
            bytes.len()
        );
        std::fs::write(path, &bytes).unwrap();
    }
}

/// One bit of each byte; another one in the next. Compressed voxels have a checksum, so that no turned bit of theirs
/// goes unseen; TIFF has none.
#[test]
fn a_bit_turned_in_any_byte_is_survived_and_seen_behind_a_checksum() {
    let scratch = Scratch::new();
    for path in &scratch.volumes {
        let mut bytes = std::fs::read(path).unwrap();
        let name = path.file_name().unwrap().to_str().unwrap();
        let original = read(&Scratch::whole_of(path)).unwrap();
        let is_packed_alone = name.ends_with(".raw.gz") || name.ends_with(".zraw");
        let mut refused = 0;
        for at in 0..bytes.len() {
            bytes[at] ^= 1 << (at % 8);
            match read_with(path, &bytes) {
                Err(e) => {
                    assert!(!e.to_string().is_empty());
                    refused += 1;
                }
                Ok(v) => assert!(
                    !is_packed_alone || is_same(&v, &original),
                    "{name}: byte {at} went unseen"
                ),
            }
            bytes[at] ^= 1 << (at % 8);
        }
        let is_bare = name.ends_with(".raw") || name.ends_with(".img");
        assert_eq!(refused > 0, !is_bare, "{name}");
        std::fs::write(path, &bytes).unwrap();
    }
}

fn refused(scratch: &Scratch, name: &str, content: &[u8]) -> String {
    let e = read(&scratch.file(name, content)).unwrap_err();
    assert!(!matches!(e.fault, Fault::Limit { .. }), "{e}");
    e.to_string()
}

const NRRD: &str = "NRRD0004\ntype: uchar\ndimension: 3\nspace: RAS\nsizes: 2 2 2\nspace directions: (1,0,0) (0,1,0) \
                    (0,0,1)\nkinds: domain domain domain\nencoding: raw\nspace origin: (0,0,0)\n\nabcdefgh";

#[test]
fn nrrd_headers_that_cannot_be_used_say_why() {
    let scratch = Scratch::new();
    assert_eq!(
        read(&scratch.file("a.nrrd", NRRD.as_bytes())).unwrap().values[7],
        104.0
    );
    for (old, new, part) in [
        ("NRRD0004", "NRRD0009", "NRRD0009"),
        ("type: uchar", "type: block", "blocks"),
        ("type: uchar", "type: quad", "quad"),
        ("type: uchar\n", "", "\"type\", and missing"),
        ("type: uchar", "type: short", "endian"),
        ("dimension: 3", "dimension: 4", "dimension"),
        ("sizes: 2 2 2", "sizes: 2 -2 2", "-2"),
        ("sizes: 2 2 2", "sizes: 0 2 2", "a dimension is 0"),
        ("sizes: 2 2 2", "sizes: 2097152 2097152 2097152", "2^50"),
        ("sizes: 2 2 2", "sizes: 9223372036854775807 3 3", "2^50"),
        (
            "sizes: 2 2 2",
            "sizes: 99999999999999999999 2 2",
            "numbers with blanks",
        ),
        ("sizes: 2 2 2", "sizes: 2 2 3", "8 are there"),
        ("sizes: 2 2 2", "sizes: 1024 1024 1024", "1073741824 bytes"),
        (
            "kinds: domain domain domain",
            "kinds: RGB-color domain domain",
            "channel",
        ),
        (
            "kinds: domain domain domain",
            "kinds: domain domain time",
            "time step",
        ),
        (
            "kinds: domain domain domain",
            "kinds: domain",
            "one for each axis",
        ),
        ("(0,0,1)", "(0,2,0)", "in one plane"),
        ("(0,0,1)", "(0,0,nan)", "finite"),
        ("(0,0,1)", "none", "channel"),
        ("(0,0,1)", "(0,0,1,0)", "space"),
        ("space: RAS", "space: right-anterior-superior-time", "space"),
        ("encoding: raw", "encoding: bzip2", "bzip2"),
        ("encoding: raw", "encoding: gzip", "ends too early"),
        ("encoding: raw", "encoding: hex", "4 are there"),
        ("encoding: raw", "encoding: text", "text of 8 numbers"),
        ("origin: (0,0,0)", "origin: (0,0)", "space"),
        ("origin: (0,0,0)", "origin: (0,0,1e99)", "1e99"),
        ("\n\n", "\nbyte skip: 5\n\n", "3 are there"),
        ("\n\n", "\nbyte skip: -2\n\n", "byteskip"),
        ("\n\n", "\nline skip: 1\n\n", "lines before"),
        ("\n\n", "\nsizes: 2 2 2\n\n", "second time"),
        ("\n\n", "\nnonsense\n\n", "colon"),
        ("\n\n", "\nspace units: \"mm\" \"cm\" \"mm\"\n\n", "same unit"),
        ("\n\n", "\ndata file: /etc/hostname\n\n", "without .."),
        ("\n\n", "\ndata file: ../other.raw\n\n", "without .."),
        ("\n\n", "\ndata file: missing.raw\n\n", "No such file"),
        (
            "\n\n",
            "\ndata file: f%d.raw 1 99999999999 1\n\n",
            "at most 4 files",
        ),
        (
            "\n\nabcdefgh",
            "\ndata file: LIST\nslice_07.raw\nslice_09.raw\nslice_11.raw\n",
            "3 for 8 voxels",
        ),
        ("\n\nabcdefgh", "\ndata file: LIST\n", "0 for 8 voxels"),
    ] {
        assert!(NRRD.contains(old), "{old}");
        let message = refused(&scratch, "a.nrrd", NRRD.replacen(old, new, 1).as_bytes());
        assert!(
            message.contains("a.nrrd") && message.contains(part),
            "{new}: {message}"
        );
    }
}

#[test]
fn hexadecimal_voxels_and_skips_are_read() {
    let scratch = Scratch::new();
    let expected: Vec<f32> = (97u8..105).map(f32::from).collect();
    for (old, new) in [
        (
            "raw\nspace origin: (0,0,0)\n\nabcdefgh",
            "hex\n\n61 62\n6364 65666768\n".to_string(),
        ),
        (
            "raw\nspace origin: (0,0,0)\n\nabcdefgh",
            "raw\nbyte skip: 3\n\nxyzabcdefgh".into(),
        ),
        (
            "raw\nspace origin: (0,0,0)\n\nabcdefgh",
            "raw\nbyteskip: -1\n\nxyzabcdefgh".into(),
        ),
        (
            "raw\nspace origin: (0,0,0)\n\nabcdefgh",
            "raw\nlineskip: 2\nbyte skip: 1\n\n\nfoo\nxabcdefgh".into(),
        ),
        (
            "sizes: 2 2 2",
            "comment:=sizes: 9\n# dimension: 7\nsizes: 2 2 2".into(),
        ),
        ("dimension: 3", "dimension: 3 ".into()),
    ] {
        let content = NRRD.replacen(old, &new, 1);
        let v = read(&scratch.file("a.nrrd", content.as_bytes())).unwrap();
        assert_eq!(v.values, expected, "{new}");
    }
}

const MHA: &str = "ObjectType = Image\nNDims = 3\nBinaryData = True\nElementSpacing = 1 2 3\nDimSize = 2 2 2\n\
                   TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 0 0 0\nElementType = MET_UCHAR\n\
                   ElementDataFile = LOCAL\nabcdefgh";

#[test]
fn metaimage_headers_that_cannot_be_used_say_why() {
    let scratch = Scratch::new();
    assert_eq!(
        read(&scratch.file("a.mha", MHA.as_bytes())).unwrap().values[7],
        104.0
    );
    for (old, new, part) in [
        ("NDims = 3", "NDims = 4", "three dimensions"),
        ("NDims = 3", "NDims = x", "NDims"),
        ("DimSize = 2 2 2", "DimSize = 2 2", "as many whole numbers"),
        ("DimSize = 2 2 2", "DimSize = 2 0 2", "a dimension is 0"),
        (
            "DimSize = 2 2 2",
            "DimSize = 4294967296 4294967296 4294967296",
            "2^50",
        ),
        ("DimSize = 2 2 2", "DimSize = 2 2 9", "8 are there"),
        ("DimSize = 2 2 2\n", "", "DimSize, and missing"),
        ("ElementSpacing = 1 2 3", "ElementSpacing = 1 -2 3", "above 0"),
        ("ElementSpacing = 1 2 3", "ElementSpacing = 1 nan 3", "finite"),
        ("ElementSpacing = 1 2 3", "ElementSpacing = 1 2", "three numbers"),
        ("1 0 0 0 1 0 0 0 1", "1 0 0 1 0 0 0 0 1", "in one plane"),
        ("1 0 0 0 1 0 0 0 1", "1 0 0", "nine numbers"),
        ("Offset = 0 0 0", "Offset = 0 0 inf", "inf"),
        ("MET_UCHAR", "MET_UCHAR_ARRAY", "MET_UCHAR_ARRAY"),
        ("ElementType = MET_UCHAR\n", "", "ElementType, and missing"),
        ("NDims = 3", "NDims = 3\nElementNumberOfChannels = 3", "channels"),
        ("NDims = 3", "NDims = 3\nNDims = 3", "second time"),
        ("NDims = 3", "NDims = 3\nnonsense", "has no ="),
        ("NDims = 3", "NDims = 3\nHeaderSize = -5", "HeaderSize"),
        ("NDims = 3", "NDims = 3\nHeaderSize = 9", "0 are there"),
        ("NDims = 3", "NDims = 3\nCompressedData = True", "does not hold"),
        ("BinaryData = True", "BinaryData = False", "text of 8 numbers"),
        (
            "BinaryData = True",
            "BinaryData = False\nCompressedData = True",
            "compressed text",
        ),
        ("LOCAL", "/etc/hostname", "without .."),
        ("LOCAL", "../a.raw", "without .."),
        ("LOCAL", "a%d.raw 1 3 1", "at most 2 files"),
        ("LOCAL", "LIST\n../a.raw", "without .."),
        ("LOCAL", "", "names a file"),
        ("ElementDataFile = LOCAL\nabcdefgh", "", "cut off"),
    ] {
        assert!(MHA.contains(old), "{old}");
        let message = refused(&scratch, "a.mha", MHA.replacen(old, new, 1).as_bytes());
        assert!(
            message.contains("a.mha") && message.contains(part),
            "{new}: {message}"
        );
    }
}

/// A few bytes that promise a gigabyte within what their compression could hold.
#[test]
fn promises_cost_no_memory_before_the_ceiling_is_asked() {
    let scratch = Scratch::new();
    let bomb = NRRD.replace("2 2 2", "1024 1024 1024").replace("raw", "gzip") + &"x".repeat(1 << 21);
    let e = read(&scratch.file("a.nrrd", bomb.as_bytes())).unwrap_err();
    assert!(matches!(e.fault, Fault::Limit { .. }), "{e}");
}

#[test]
fn voxels_without_a_header_need_their_layout() {
    let scratch = Scratch::new();
    let path = scratch.file("a.raw", &[7; 24]);
    let e = read(&path).unwrap_err().to_string();
    assert!(e.contains(".raw") && e.contains("layout"), "{e}");
    let raw = RawLayout {
        dims: [2, 3, 4],
        voxel: VoxelType::U8,
        big_endian: false,
        offset: 0,
        spacing: [1.0, 2.0, 3.0],
        origin: [0.0; 3],
        unit: Unit::Unknown,
        rescale: None,
    };
    let options = VolumeOptions {
        raw: Some(raw),
        ..Default::default()
    };
    assert_eq!(volumes::read(&path, &options, &LIMITS).unwrap().values, [7.0; 24]);
    // Voxels that look like gzip are still voxels, and gzip is read where the name says so.
    let path = scratch.file("b.raw", &[[0x1f, 0x8b].as_slice(), &[8; 22]].concat());
    assert_eq!(volumes::read(&path, &options, &LIMITS).unwrap().values[1], 139.0);
    let mut gz = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut gz, &[7; 24]).unwrap();
    let path = scratch.file("a.raw.gz", &gz.finish().unwrap());
    assert_eq!(volumes::read(&path, &options, &LIMITS).unwrap().values, [7.0; 24]);
}

#[test]
fn tiff_files_that_are_no_volume_say_why() {
    let scratch = Scratch::new();
    let bytes = std::fs::read(scratch.directory.path().join("float64_strips_deflate.tif")).unwrap();
    // The first directory: its count, then entries of 12 bytes.
    let at = u32::from_le_bytes(bytes[4..8].try_into().unwrap()) as usize;
    let count = u16::from_le_bytes(bytes[at..at + 2].try_into().unwrap()) as usize;
    let entry = |tag: u16| {
        let all = (0..count).map(|k| at + 2 + 12 * k);
        all.into_iter()
            .find(|e| bytes[*e..*e + 2] == tag.to_le_bytes())
            .unwrap()
    };
    for (tag, value, part) in [
        (256u16, 0u32, "width"),
        (256, 6, "page 1 from 0"),
        (257, u32::MAX, "page 1 from 0"),
        (258, 12, "12 bits"),
        (259, 7, "JPEG"),
        (259, 50000, "Zstandard"),
        (259, 9999, "9999"),
        (262, 0, "white is zero"),
        (262, 3, "palette"),
        (277, 3, "3 samples"),
        (339, 6, "sample format 6"),
        (278, 0, "rows in a strip"),
    ] {
        let mut bad = bytes.clone();
        let e = entry(tag);
        // As a long, whatever it was.
        bad[e + 2..e + 4].copy_from_slice(&4u16.to_le_bytes());
        bad[e + 8..e + 12].copy_from_slice(&value.to_le_bytes());
        let message = refused(&scratch, "bad.tif", &bad);
        assert!(message.contains(part), "{tag} = {value}: {message}");
    }
    // A directory that names itself as the next one.
    let mut bad = bytes.clone();
    let next = at + 2 + 12 * count;
    bad[next..next + 4].copy_from_slice(&(at as u32).to_le_bytes());
    assert!(refused(&scratch, "bad.tif", &bad).contains("comes again"));
}
