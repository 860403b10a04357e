//! DICOM series: files that others wrote, and what others read from them (`data/dicom/make.py`).

mod hostile;
mod odd;
mod revised;
mod writer;

use std::path::{Path, PathBuf};

use formats::volumes::{self, DicomOptions, Volume, VolumeOptions};
use formats::{Fault, Kind, ReadLimits};
use serde_json::Value;
use writer::Picture;

fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/dicom")
}

fn read_with(path: &Path, dicom: DicomOptions) -> Result<Volume, String> {
    let options = VolumeOptions {
        dicom,
        ..Default::default()
    };
    volumes::read(path, &options, &ReadLimits::default()).map_err(|e| e.to_string())
}

fn read(path: &Path) -> Result<Volume, String> {
    read_with(path, DicomOptions::default())
}

fn expected() -> Value {
    let text = std::fs::read_to_string(data().join("expected.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// Largest difference of any voxel's place, mm.
fn distance(v: &Volume, expected: &Value) -> f64 {
    let m = v.header.world_from_voxel;
    let mut worst = 0.0f64;
    for corner in 0..8 {
        let at = |axis: usize| {
            if corner >> axis & 1 == 1 {
                v.header.dims[axis] as f64
            } else {
                0.0
            }
        };
        let index = [at(0), at(1), at(2), 1.0];
        let ours = m
            .transform_point3(glam::DVec3::new(index[0], index[1], index[2]))
            .to_array();
        for axis in 0..3 {
            let row = &expected["world_from_voxel"][axis];
            let theirs: f64 = (0..4).map(|i| row[i].as_f64().unwrap() * index[i]).sum();
            worst = worst.max((ours[axis] - theirs).abs());
        }
    }
    worst
}

fn crc(values: &[f32]) -> u64 {
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    crc32fast::hash(&bytes).into()
}

#[track_caller]
fn agrees(path: &Path, case: &str) -> Volume {
    let expected = &expected()[case];
    let v = read(path).unwrap_or_else(|e| panic!("{case}: {e}"));
    assert_eq!(serde_json::json!(v.header.dims), expected["dims"], "{case}");
    let off = distance(&v, expected);
    assert!(off < 1e-6, "{case}: {off} mm off");
    let ends = [v.values[0], v.values[v.values.len() - 1]];
    let theirs = [0, 1].map(|i| expected["probe"][i].as_f64().unwrap() as f32);
    assert_eq!(ends, theirs, "{case}");
    assert_eq!(serde_json::json!(crc(&v.values)), expected["crc32"], "{case}");
    v
}

#[test]
fn a_series_against_its_file_order_is_what_simpleitk_reads() {
    let v = agrees(&data().join("ct"), "ct");
    assert_eq!(v.header.rescale, Some([1.0, -1024.0]));
    assert_eq!(v.header.unit.symbol(), "mm");
    // Any file stands for its series.
    assert_eq!(agrees(&data().join("ct/IM0003.dcm"), "ct"), v);
}

#[test]
fn signed_implicit_files_without_extension_are_what_simpleitk_reads() {
    let v = agrees(&data().join("signed"), "signed");
    assert!(v.values.iter().any(|v| *v < -30_000.0));
    let kind = formats::detect(&data().join("signed/2")).unwrap();
    assert_eq!(kind, Kind::Volume(volumes::VolumeFormat::Dicom));
}

#[test]
fn a_rescaling_that_varies_is_applied_to_each_slice() {
    let v = agrees(&data().join("pet"), "pet");
    assert_eq!(v.header.rescale, None);
    assert!(
        v.notes.iter().any(|n| n.contains("0.37 to 1.48")),
        "{:?}",
        v.notes
    );
}

#[test]
fn multi_frame_files_are_ordered_by_the_positions_of_their_frames() {
    agrees(&data().join("enhanced"), "enhanced");
    agrees(&data().join("enhanced/frames.dcm"), "enhanced");
    agrees(&data().join("nm"), "nm");
    agrees(&data().join("dose"), "dose");
}

#[test]
fn compressed_frames_are_found_with_and_without_a_table_of_offsets() {
    for name in ["rle", "split", "untabled"] {
        let case = format!("compressed/{name}.dcm");
        agrees(&data().join(&case), &case);
    }
}

#[test]
fn every_lossless_transfer_syntax_gives_the_same_pixels() {
    for way in [
        "explicit",
        "implicit",
        "big",
        "deflated",
        "rle",
        "jpeg-lossless",
        "jpeg-sv1",
        "jpeg2000",
    ] {
        for kind in ["u12", "s16", "u8"] {
            let case = format!("syntax/{way}-{kind}.dcm");
            agrees(&data().join(&case), &case);
        }
    }
}

#[test]
fn jpeg_ls_is_read_with_its_feature_and_refused_by_name_without() {
    for kind in ["u12", "s16", "u8"] {
        let case = format!("syntax/jpeg-ls-{kind}.dcm");
        let path = data().join(&case);
        if cfg!(feature = "jpeg-ls") {
            agrees(&path, &case);
        } else {
            let e = read(&path).unwrap_err();
            assert!(e.contains("JPEG-LS") && e.contains("dcmdjpls"), "{e}");
        }
    }
}

#[test]
fn lossy_pictures_differ_from_other_decoders_by_their_rounding_alone() {
    // The inverse transforms of baseline JPEG may differ by 1 (ISO/IEC 10918-2); those of JPEG 2000 round alike but
    // for ties.
    for case in ["syntax/jpeg-baseline.dcm", "syntax/jpeg2000-lossy.dcm"] {
        let v = read(&data().join(case)).unwrap();
        let expected = &expected()[case];
        assert!(distance(&v, expected) < 1e-6);
        let theirs = expected["values"].as_array().unwrap();
        assert_eq!(theirs.len(), v.values.len());
        for (ours, theirs) in v.values.iter().zip(theirs) {
            let off = f64::from(*ours) - theirs.as_f64().unwrap();
            assert!(off.abs() <= 1.0, "{case}: {off}");
        }
    }
}

#[test]
fn what_cannot_be_decoded_is_refused_by_name() {
    let e = read(&data().join("syntax/jpeg-extended.dcm")).unwrap_err();
    assert!(e.contains("JPEG extended") && e.contains("dcmdjpeg"), "{e}");
    let e = read(&data().join("colour")).unwrap_err();
    assert!(e.contains("RGB") && e.contains("3 samples"), "{e}");
}

#[test]
fn the_peak_of_a_reading_is_what_was_stated() {
    let directory = tempfile::tempdir().unwrap();
    for z in 0..40 {
        let mut p = Picture::axial(f64::from(z));
        (p.columns, p.rows) = (64, 64);
        p.pixels = vec![1; 64 * 64];
        p.save(&directory.path().join(format!("{z:02}")));
    }
    let paths = [
        "ct",
        "pet",
        "enhanced",
        "compressed/split.dcm",
        "syntax/jpeg2000-u12.dcm",
        "syntax/deflated-s16.dcm",
    ];
    let mut paths: Vec<PathBuf> = paths.iter().map(|p| data().join(p)).collect();
    paths.push(directory.path().into());
    // Allocations of this thread are counted, so this one decodes.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for path in paths {
        let options = VolumeOptions::default();
        let need = pool.install(|| volumes::peek(&path, &options).unwrap().read_bytes);
        let limits = ReadLimits { max_bytes: need };
        let held = pool.install(|| {
            let mut result = None;
            let held = allocation_counter::measure(|| result = Some(volumes::read(&path, &options, &limits)));
            result.unwrap().unwrap();
            held.bytes_max
        });
        assert!(
            held <= need,
            "{}: {held} bytes held, {need} stated",
            path.display()
        );
        // Less is refused, and names what would be needed.
        let less = ReadLimits { max_bytes: need - 1 };
        let e = pool
            .install(|| volumes::read(&path, &options, &less))
            .unwrap_err();
        assert!(
            matches!(e.fault, Fault::Limit { needed, .. } if needed == need),
            "{e}"
        );
    }
}

#[test]
fn pictures_decoded_at_the_same_time_are_the_same_at_any_thread_count() {
    let path = data().join("compressed/split.dcm");
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| read(&path).unwrap())
    };
    let one = with(1);
    assert!([2, 3, 8].iter().all(|n| with(*n) == one));
    // Every other slice: those between are not taken for the next ones.
    let stride = VolumeOptions {
        stride: [1, 1, 2],
        ..Default::default()
    };
    let part = volumes::read(&path, &stride, &ReadLimits::default()).unwrap();
    let slice = one.header.dims[0] * one.header.dims[1];
    for (k, values) in part.values.chunks_exact(slice).enumerate() {
        assert_eq!(values, &one.values[2 * k * slice..][..slice]);
    }
}
