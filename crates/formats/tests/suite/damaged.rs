//! Every reader against cut, turned and hostile bytes: an error or a cloud, never a panic, never more memory
//! than allowed.

use std::io::Write;
use std::path::{Path, PathBuf};

use formats::{Fault, Kind, PointFormat, ReadLimits, detect, field, meshes, points, volumes};

/// Far above any fixture, far below what a forged count could ask for.
const LIMITS: ReadLimits = ReadLimits { max_bytes: 8 << 20 };

fn fixtures() -> Vec<PathBuf> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let mut all: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| {
            p.is_file()
                && !matches!(
                    p.extension().and_then(|e| e.to_str()),
                    Some("py" | "md" | "json" | "bin")
                )
        })
        .collect();
    all.sort();
    assert!(all.len() >= 15);
    all
}

/// Reads a file as what it is; the message of the error if it is refused.
fn read(path: &Path) -> Result<(), formats::FormatError> {
    match detect(path)? {
        Kind::Cloud(_) => points::read(path, &LIMITS).map(drop),
        Kind::Volume(_) => volumes::read(path, &Default::default(), &LIMITS).map(drop),
        Kind::Mesh(_) => meshes::read(path, &LIMITS).map(drop),
        Kind::Field => field::load(path, &LIMITS).map(drop),
    }
}

struct Scratch {
    directory: tempfile::TempDir,
}

impl Scratch {
    fn new() -> Self {
        Self {
            directory: tempfile::tempdir().unwrap(),
        }
    }
    fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.directory.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }
}

/// Everything that a file gives, for comparison.
fn content(path: &Path) -> Result<String, formats::FormatError> {
    match detect(path)? {
        Kind::Cloud(_) => points::read(path, &LIMITS).map(|c| format!("{c:?}")),
        Kind::Mesh(_) => meshes::read(path, &LIMITS).map(|m| format!("{m:?}")),
        _ => read(path).map(|()| String::new()),
    }
}

/// Text may end anywhere and still be a file; a binary or packed one may not, unless what is cut off is not needed
/// (the chunk table of LAZ).
#[test]
fn every_fixture_cut_at_every_byte_is_refused_or_shorter_text() {
    let scratch = Scratch::new();
    for fixture in fixtures() {
        let name = fixture.file_name().unwrap().to_str().unwrap();
        let bytes = std::fs::read(&fixture).unwrap();
        let is_text =
            ["ascii", ".obj", ".xyz", ".wrl"].iter().any(|t| name.contains(t)) && !name.ends_with(".gz");
        let whole = content(&fixture).unwrap();
        for length in (0..bytes.len()).step_by(1 + bytes.len() / 400) {
            let path = scratch.file(name, &bytes[..length]);
            match read(&path) {
                Ok(()) if is_text => {}
                Ok(()) => assert!(
                    name.ends_with(".laz") && content(&path).unwrap() == whole,
                    "{name} cut at {length} of {} was read",
                    bytes.len()
                ),
                Err(e) => assert!(e.to_string().contains(name), "{e}"),
            }
        }
    }
}

/// In memory, because there are some ten thousand bits.
#[test]
fn every_plain_fixture_with_any_bit_turned_is_read_or_refused() {
    for fixture in fixtures() {
        let mut bytes = std::fs::read(&fixture).unwrap();
        let parse = |bytes: &[u8]| match fixture.extension().unwrap().to_str().unwrap() {
            "ply" => Some(points::parse_ply(bytes, &LIMITS).map(drop)),
            "obj" => Some(points::parse_obj(bytes, &LIMITS).map(drop)),
            "xyzn" => Some(points::parse_xyz(bytes, &LIMITS).map(drop)),
            "pcd" => Some(points::parse_pcd(bytes, &LIMITS).map(drop)),
            "las" | "laz" => Some(points::parse_las(bytes, &LIMITS).map(drop)),
            "e57" => Some(points::parse_e57(bytes, &LIMITS).map(drop)),
            "stl" => Some(meshes::parse_stl(bytes, &LIMITS).map(drop)),
            "glb" => Some(meshes::parse_gltf(bytes, &LIMITS).map(drop)),
            "3mf" => Some(meshes::parse_threemf(bytes, &LIMITS).map(drop)),
            "wrl" => Some(meshes::parse_vrml(bytes, &LIMITS).map(drop)),
            "nii" => Some(volumes::parse_nifti(bytes, &LIMITS).map(drop)),
            _ => None,
        };
        if parse(&bytes).is_none() {
            continue;
        }
        let mut refused = 0;
        for bit in (0..bytes.len() * 8).step_by(1 + bytes.len() / 500) {
            bytes[bit / 8] ^= 1 << (bit % 8);
            if let Some(Err(e)) = parse(&bytes) {
                assert!(!e.to_string().is_empty());
                refused += 1;
            }
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        assert!(refused > 0, "{}", fixture.display());
    }
}

/// Gzip has a checksum: what is read in spite of a turned bit (in a stored time, in padding, in a distance that
/// meets the same zeros) is what was written.
#[test]
fn every_gzipped_fixture_with_any_bit_turned_is_refused_or_the_same() {
    let scratch = Scratch::new();
    for name in ["box_trimesh.obj.gz", "float32_nibabel.nii.gz"] {
        let path = fixtures().into_iter().find(|p| p.ends_with(name)).unwrap();
        let content = |path: &Path| match name {
            "box_trimesh.obj.gz" => points::read(path, &LIMITS).map(|c| format!("{c:?}")),
            _ => volumes::read(path, &Default::default(), &LIMITS).map(|v| format!("{v:?}")),
        };
        let original = content(&path).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        // Without the two magic bytes it is another kind of file.
        for bit in 16..bytes.len() * 8 {
            bytes[bit / 8] ^= 1 << (bit % 8);
            match content(&scratch.file(name, &bytes)) {
                Err(e) => assert!(e.to_string().contains(name), "{e}"),
                Ok(c) => assert_eq!(c, original, "{name}: bit {bit} went unseen"),
            }
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
    }
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    out.write_all(bytes).unwrap();
    out.finish().unwrap()
}

/// 12 MB of blanks and of zero voxels, in less than 200 kB; the volume would take 25 MB.
#[test]
fn a_gzip_bomb_is_refused_at_the_ceiling() {
    let scratch = Scratch::new();
    let mut text = vec![b' '; 12 << 20];
    text.splice(..6, *b"1 2 3\n");
    let mut volume = std::fs::read(
        fixtures()
            .iter()
            .find(|p| p.ends_with("int16_nibabel.nii"))
            .unwrap(),
    )
    .unwrap();
    for (axis, n) in [512i16, 256, 48].into_iter().enumerate() {
        volume[42 + 2 * axis..44 + 2 * axis].copy_from_slice(&n.to_le_bytes());
    }
    volume.resize(12 << 20, 0);
    for (name, content) in [("bomb.xyz.gz", text), ("bomb.nii.gz", volume)] {
        let bomb = gzip(&content);
        assert!(bomb.len() < 200_000);
        let e = read(&scratch.file(name, &bomb)).unwrap_err();
        assert!(
            matches!(e.fault, Fault::Limit { limit, .. } if limit == LIMITS.max_bytes),
            "{e}"
        );
        assert!(e.to_string().contains("raise the memory ceiling"), "{e}");
    }
}

#[test]
fn a_volume_that_promises_30000_cubed_voxels_is_refused_at_once() {
    let scratch = Scratch::new();
    let bytes = std::fs::read(
        fixtures()
            .iter()
            .find(|p| p.ends_with("int16_nibabel.nii"))
            .unwrap(),
    )
    .unwrap();
    let mut huge = bytes.clone();
    for axis in 0..3 {
        huge[42 + 2 * axis..44 + 2 * axis].copy_from_slice(&30_000i16.to_le_bytes());
    }
    for (name, content) in [("huge.nii", huge.clone()), ("huge.nii.gz", gzip(&huge))] {
        let e = read(&scratch.file(name, &content)).unwrap_err();
        assert!(
            matches!(
                e.fault,
                Fault::Truncated {
                    needed: 54_000_000_000_000,
                    ..
                }
            ),
            "{e}"
        );
    }
}

/// Fields of the header of a NIfTI-1 file that make it useless, and what the message says.
#[test]
fn volumes_that_cannot_be_used_say_why_and_what_helps() {
    let scratch = Scratch::new();
    let bytes = std::fs::read(
        fixtures()
            .iter()
            .find(|p| p.ends_with("int16_nibabel.nii"))
            .unwrap(),
    )
    .unwrap();
    let zero_affine = vec![0; 48];
    for (at, change, part) in [
        (0, &b"\0\0\0\0"[..], "first number"),
        (344, b"ni1", "the image of the header/image pair"),
        (344, b"xyz", "magic"),
        (40, &[0, 0], "number of dimensions is 0"),
        (42, &[0, 0], "a dimension is 0"),
        (44, &[0xff, 0xff], "a dimension is -1"),
        (40, &[4, 0, 5, 0, 4, 0, 3, 0, 7, 0], "volumes in the file is 7"),
        (70, &[128, 0], "colour"),
        (70, &[32, 0], "complex"),
        (70, &[99, 0], "99"),
        (108, &[0, 0, 0, 0], "vox_offset"),
        (108, &[0, 0, 0xc0, 0x7f], "vox_offset"),
        (112, &[0, 0, 0x80, 0x7f], "rescaling"),
    ] {
        let mut bad = bytes.clone();
        bad[at..at + change.len()].copy_from_slice(change);
        let e = read(&scratch.file("bad.nii", &bad)).unwrap_err().to_string();
        assert!(e.contains("bad.nii") && e.contains(part), "{part}: {e}");
    }
    // Without sform, qform or spacings there is nothing left.
    let mut bad = bytes.clone();
    bad[280..328].copy_from_slice(&zero_affine);
    bad[76..92].fill(0);
    assert!(
        read(&scratch.file("bad.nii", &bad))
            .unwrap_err()
            .to_string()
            .contains("voxel spacing")
    );
}

#[test]
fn a_directory_an_empty_file_no_file_and_a_strange_name_are_named() {
    let scratch = Scratch::new();
    let folder = scratch.directory.path().join("scan.ply");
    std::fs::create_dir(&folder).unwrap();
    for (path, part) in [
        (folder, "scan.ply: a directory without DICOM or TIFF files is not"),
        (scratch.file("none.ply", b""), "none.ply: is empty"),
        (scratch.file("none.nii.gz", &gzip(b"")), "is empty"),
        (
            scratch.directory.path().join("lost.ply"),
            "lost.ply: opening failed",
        ),
        (
            scratch.file("scan.step", b"ISO-10303 and so on"),
            ".step is not a supported input; supported: point clouds .ply",
        ),
        (scratch.file("text.ply", b"this is no ply"), "text.ply: line 1"),
        (
            scratch.file("text.nii", &[b'x'; 500]),
            "text.nii: the first number",
        ),
        (
            scratch.file("text.iclay", &[b'x'; 500]),
            "text.iclay: the start of the file",
        ),
    ] {
        let e = read(&path).unwrap_err().to_string();
        assert!(e.contains(part), "{part}: {e}");
    }
    // A good file given for the wrong purpose.
    let cloud = scratch.file("cloud.xyz", b"1 2 3\n");
    let e = volumes::read(&cloud, &Default::default(), &LIMITS)
        .unwrap_err()
        .to_string();
    assert!(e.contains("cloud.xyz"), "{e}");
    let volume = fixtures()
        .into_iter()
        .find(|p| p.ends_with("int16_nibabel.nii"))
        .unwrap();
    let e = points::read(&volume, &LIMITS).unwrap_err().to_string();
    assert!(
        e.contains("a volume (NIfTI) is not a supported point cloud"),
        "{e}"
    );
}

#[test]
fn gzip_is_known_by_its_bytes_and_content_by_its_magic_whatever_the_name() {
    let scratch = Scratch::new();
    let ply = std::fs::read(
        fixtures()
            .iter()
            .find(|p| p.ends_with("box_trimesh.ply"))
            .unwrap(),
    )
    .unwrap();
    for name in ["box", "box.ply", "box.ply.gz", "box.obj"] {
        for content in [
            ply.clone(),
            gzip(&ply),
            [gzip(&ply[..50]), gzip(&ply[50..])].concat(),
        ] {
            let path = scratch.file(name, &content);
            assert_eq!(detect(&path).unwrap(), Kind::Cloud(PointFormat::Ply), "{name}");
            assert_eq!(points::read(&path, &LIMITS).unwrap().positions.len(), 8, "{name}");
        }
    }
}
